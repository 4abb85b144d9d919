"""A robot that a program moves: what viewers are shown, and how they halt the program."""

from __future__ import annotations

import threading
import time
import webbrowser
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browsers import wait_until
from live_page import RIGHT_LEG, Page

import heelstrike as hs
from heelstrike.view.live.board import KEPT

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")

from heelstrike.view.live.display import NOT_HERE, Display
from heelstrike.view.live.session import RATES


@pytest.fixture
def display() -> Iterator[Display]:
    shown = Display(hs.load_robot("compass_gait"), browser=False)
    shown.begin(hs.Ground(friction=0.8))
    yield shown
    shown.close()


class Listener:
    """Who looks, and what it was told."""

    def __init__(self, display: Display) -> None:
        self.frames: list[Any] = []
        self.display = display
        display._board.join(self.hear)

    def hear(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            kind, *frame = np.frombuffer(message)
            self.frames.append((kind, frame))

    def leave(self) -> None:
        self.display._board.leave(self.hear)
        self.display.ask("me", {"do": "leave"})


def moved(display: Display, times: Any) -> None:
    robot = display._layout.robot
    force = np.tile((3.0, -1.0), (robot.nc, 1))
    for each in times:
        display.show(
            each, robot.reference_state(), force=force, torque=np.full(robot.nu, 2.0),
            residual=1e-12,
        )  # fmt: skip


def test_states_are_shown_in_real_time_with_forces_and_torques(display: Display) -> None:
    listener = Listener(display)
    begin = time.perf_counter()
    moved(display, np.linspace(0.0, 0.2, 11))
    assert time.perf_counter() - begin >= 0.2
    assert [kind for kind, _ in listener.frames] == [KEPT] * 11
    layout, frame = display._layout, np.array(listener.frames[-1][1])
    assert frame[0] == 0.2
    at = layout.begin["force"]
    np.testing.assert_allclose(frame[at : at + 2], (-1.0, 3.0))  # the ground is level
    at = layout.begin["torque"]
    np.testing.assert_array_equal(frame[at : at + layout.robot.nu], 2.0)
    display.begin(hs.Ground(friction=0.8))
    assert display._frames == []


def test_a_pause_halts_the_program_a_step_lets_it_go_on_once(display: Display) -> None:
    listener = Listener(display)
    moved(display, [0.0, 0.01])
    display.ask("me", {"do": "play", "on": False})
    program = threading.Thread(target=moved, args=(display, [0.02, 0.03, 0.04]), daemon=True)
    program.start()
    time.sleep(0.3)
    assert display._frames[-1][0] == 0.01
    display.ask("me", {"do": "step", "rows": 1})
    wait_until(lambda: display._frames[-1][0] == 0.02, "a step")
    display.ask("me", {"do": "seek", "time": 0.013})
    assert listener.frames[-1][1][0] == 0.01
    display.ask("me", {"do": "random push"})
    assert display._note == NOT_HERE
    display.ask("me", {"do": "seek"})
    assert "cannot be read" in display._note
    listener.leave()  # and nobody is there who could let it go on
    program.join(20.0)
    assert display._frames[-1][0] == 0.04


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "fast"])
def test_commands_without_a_finite_number_change_nothing(display: Display, value: Any) -> None:
    display.ask("me", {"do": "rate", "value": 2.0})
    for command in ({"do": "rate", "value": value}, {"do": "seek", "time": value}):
        display.ask("me", command)
        assert f"command '{command['do']}' cannot be read" in display._note
    assert display._rate == 2.0
    assert display._playing
    display.ask("me", {"do": "rate", "value": 1e9})
    assert display._rate == RATES[1]


def test_closing_lets_the_program_go_on(display: Display) -> None:
    Listener(display)
    moved(display, [0.0])
    display.ask("me", {"do": "play", "on": False})
    program = threading.Thread(target=moved, args=(display, [0.1]), daemon=True)
    program.start()
    display.close()
    program.join(20.0)
    assert not program.is_alive()


@pytest.mark.parametrize("vector", [False, True])
def test_an_environment_is_shown_in_the_browser(
    vector: bool, chromium: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``render_mode="human"`` opens a page, which draws each step; ``render`` is not needed."""
    gymnasium = pytest.importorskip("gymnasium", minversion="1.1")
    import heelstrike.experiments.learning.environments  # noqa: F401 - registers them

    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: bool(opened.append(url)))
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.BackgroundBrowser("some"))
    name = "heelstrike/Walker2d-v0"
    if vector:
        env = gymnasium.make_vec(
            name, num_envs=3, vectorization_mode="vector_entry_point", render_mode="human"
        )
    else:
        env = gymnasium.make(name, render_mode="human")
    screen = env.unwrapped._screen
    assert len(opened) == 1
    assert f"watch at {screen.url}\n" in capsys.readouterr().err  # for this browser opens nothing
    env.reset(seed=0)
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    for _ in range(3):
        env.step(action)
    assert env.render() is None
    with Page(chromium, screen) as page:
        wait_until(lambda: page.time == pytest.approx(0.024), "the third step")
        assert len(page.where(RIGHT_LEG)) > 100
        env.step(action)
        wait_until(lambda: page.time == pytest.approx(0.032), "the next step")
        env.reset(seed=1)
        env.step(action)
        wait_until(lambda: page.time == pytest.approx(0.008), "a new episode")
        assert page.data("frames") == 2
        env.close()
        wait_until(lambda: page.page.evaluate("document.body.dataset.connected") == "no", "the end")


def test_an_environment_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    gymnasium = pytest.importorskip("gymnasium", minversion="1.1")
    from heelstrike.experiments.learning.environments import TaskEnv

    monkeypatch.setitem(__import__("sys").modules, "websockets.asyncio.server", None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r"heelstrike\[watch\]"):
        TaskEnv("Walker2d", render_mode="human")
