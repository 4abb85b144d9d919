"""hs.watch(), but for what a browser shows."""

from __future__ import annotations

import dataclasses
import signal
import stat
import subprocess
import sys
import threading
import webbrowser
from _thread import interrupt_main
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.view import ViewError
from heelstrike.view.live import viewer as module


def test_without_the_extra_it_says_what_to_install() -> None:
    """In a process that has no websockets, where the rest of the package works."""
    script = (
        "import sys; sys.modules['websockets'] = None\n"
        "import heelstrike as hs\n"
        "robot = hs.load_robot('compass_gait')\n"
        "simulation = hs.Simulation(robot, state=robot.reference_state())\n"
        "try:\n    hs.watch(simulation)\n"
        "except hs.ViewError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == (
        "the live view needs the package websockets, which is not installed: "
        "pip install 'heelstrike[watch]'\n"
    ), done.stderr


@pytest.mark.parametrize(
    ("what", "options", "words"),
    [
        ("bravo7", {}, "watch takes a Run or a Simulation, got str"),
        (None, {"rate": 0.0}, "rate must lie between"),
        (None, {"rate": np.nan}, "rate must lie between"),
        (None, {"port": 70000}, "a port is a number from 0 to 65535"),
    ],
)
def test_what_cannot_be_watched(what: Any, options: Any, words: str) -> None:
    pytest.importorskip("websockets")
    with pytest.raises(ViewError, match=words):
        hs.watch(walking.walk(steps=1) if what is None else what, **options)


def test_an_empty_run_cannot_be_watched() -> None:
    run = walking.walk(steps=1)
    empty = dataclasses.replace(run, time=run.time[:0], message="stopped at once")
    with pytest.raises(ViewError, match=r"no rows .stopped at once"):
        hs.watch(empty)


def test_the_browser_is_given_a_file_that_nobody_else_reads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The address holds the token, and the arguments of programs are seen by all users."""
    pytest.importorskip("websockets")
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: bool(opened.append(url)) or True)
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.BackgroundBrowser("some"))
    with hs.watch(walking.walk(steps=1), block=False) as viewer:
        (given,) = opened
        token = viewer.url.partition("token=")[2]
        assert given.startswith("file:")
        assert token not in given
        (way,) = Path(viewer._way.name).iterdir()
        assert way.as_uri() == given
        assert f"url={viewer.url}" in way.read_text(encoding="utf-8")
        if sys.platform != "win32":
            assert stat.S_IMODE(way.parent.stat().st_mode) == 0o700
    assert not way.exists()


def test_a_browser_of_texts_does_not_take_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("websockets")
    monkeypatch.delenv("BROWSER", raising=False)
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.GenericBrowser("w3m"))
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail("opened a browser"))
    with hs.watch(walking.walk(steps=1), browser=False, block=False) as viewer:
        assert not viewer.open()

        def none() -> None:
            raise webbrowser.Error("there is none")

        monkeypatch.setattr(webbrowser, "get", none)
        assert not viewer.open()


def test_when_it_is_closed_the_simulation_is_there_to_go_on() -> None:
    pytest.importorskip("websockets")
    robot = hs.load_robot("compass_gait")
    simulation = hs.Simulation(robot, state=robot.reference_state(), stop_when_fallen=False)
    with hs.watch(simulation, browser=False, block=False):
        pass
    until = simulation.time + 0.01
    assert simulation.advance(until) is hs.sim.RunStatus.COMPLETED
    assert simulation.time == pytest.approx(until)


def test_a_notebook_shows_it_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("websockets")
    monkeypatch.setattr(module, "_in_notebook", lambda: True)
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail("opened a browser"))
    with hs.watch(walking.walk(steps=1)) as viewer:
        shown = viewer._repr_html_()
        assert shown.startswith("<iframe")
        assert viewer.url in shown


def test_a_script_waits_until_it_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("websockets")
    waited: list[module.Viewer] = []

    def wait(viewer: module.Viewer) -> None:
        waited.append(viewer)
        viewer.close()
        raise KeyboardInterrupt

    monkeypatch.setattr(module.Viewer, "wait", wait)
    assert waited == [hs.watch(walking.walk(steps=1), browser=False)]


def test_an_interrupt_closes_it_and_is_not_lost() -> None:
    pytest.importorskip("websockets")
    viewer = hs.watch(walking.walk(steps=1), browser=False, block=False)
    # A suite in the background of a script inherits interrupts that are ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer = threading.Timer(0.3, interrupt_main)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            viewer.wait()
        timer.join()
    finally:
        signal.signal(signal.SIGINT, before)
    assert viewer.closed
