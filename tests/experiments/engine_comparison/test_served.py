"""An engine in its own process may refuse, abort or hang: that is told, and ends nothing else."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.experiments.engines import InvalidRunError, Scenario
from heelstrike.experiments.engines import served as served_module
from heelstrike.experiments.engines.genesis_peer import GenesisPeer
from heelstrike.experiments.engines.peer import flight
from heelstrike.experiments.engines.served import ServedPeer, other_python, served

SCRIPT = """
import json, os, time

def answer(order):
    do = json.loads(order)["do"]
    if do == "go":
        {act}
    return b'{{"seconds": 0.0}}\\n'
"""


def scripted(tmp_path: Path, act: str, patience: float = 20.0) -> ServedPeer:
    script = tmp_path / "engine.py"
    script.write_text(SCRIPT.format(act=act))
    scenario = flight(hs.load_robot("bravo7"))
    peer = ServedPeer(scenario, 1e-3, engine="its", job=f"{script}:answer", patience=patience)
    peer.restart()
    return peer


def test_an_engine_that_aborts_is_told_by_its_signal(tmp_path: Path) -> None:
    peer = scripted(tmp_path, "os.abort()")
    with pytest.raises(InvalidRunError, match="ended by SIGABRT"):
        peer.record(1)


def test_an_engine_that_exits_is_told_by_its_code(tmp_path: Path) -> None:
    peer = scripted(tmp_path, "os._exit(3)")
    with pytest.raises(InvalidRunError, match="ended with exit 3"):
        peer.record(1)


def test_an_engine_that_hangs_is_given_up(tmp_path: Path) -> None:
    peer = scripted(tmp_path, "time.sleep(100.0)", patience=1.0)
    with pytest.raises(InvalidRunError, match="hangs: no answer within 1 s"):
        peer.record(1)


def test_an_engine_that_refuses_is_quoted(tmp_path: Path) -> None:
    peer = scripted(tmp_path, 'raise ValueError("no such joint. And much more")')
    with pytest.raises(InvalidRunError, match=r"^ValueError: no such joint$"):
        peer.record(1)


def test_what_has_ended_is_not_asked_again(tmp_path: Path) -> None:
    """A new process would know nothing of the robot."""
    peer = scripted(tmp_path, "os.abort()")
    with pytest.raises(InvalidRunError):
        peer.record(1)
    with pytest.raises(InvalidRunError):
        peer.record(1)


def test_a_module_that_no_python_has_is_found_nowhere() -> None:
    assert other_python("no_such_module_of_anybody") == ("", "")


@pytest.fixture
def version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], bytes]:
    """What looks for a module in another Python, here where it finds what lies in a folder."""
    monkeypatch.syspath_prepend(str(tmp_path))
    found: Callable[[bytes], bytes] = runpy.run_path(served_module._LOOKING)["version"]
    return found


def test_a_module_that_is_slow_is_not_imported_for_its_version(
    tmp_path: Path, version: Callable[[bytes], bytes]
) -> None:
    (tmp_path / "genesis.py").write_text("raise RuntimeError('it was imported')\n")
    assert version(b"genesis") == b""  # some other module of this name
    told = tmp_path / "genesis_world-1.2.3.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: genesis-world\nVersion: 1.2.3\n")
    assert version(b"genesis") == b"1.2.3"
    (tmp_path / "genesis.py").unlink()
    assert version(b"genesis") == b""


def test_genesis_may_compile_for_long_and_then_not_hang(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "engine.py"
    text = SCRIPT.format(act="time.sleep(100.0)")
    script.write_text(
        text.replace('if do == "go"', 'if do == "make": time.sleep(1.0)\n    if do == "go"')
    )
    monkeypatch.setattr(served_module, "other_python", lambda _: (sys.executable, "1"))
    monkeypatch.setattr(GenesisPeer, "script", str(script))
    peer: Any = GenesisPeer(flight(hs.load_robot("bravo7")), 1e-3, patience=0.5)
    peer.restart()
    with pytest.raises(InvalidRunError, match="hangs"):
        peer.record(1)


def test_mujoco_in_another_process_does_as_in_this_one() -> None:
    """The same calls of the same library, so the same numbers."""
    from heelstrike.experiments.engines.mujoco_peer import MuJoCoPeer

    robot = hs.load_robot("bravo7")
    scenario = Scenario("falling", robot, robot.reference_state(), 0.2)
    torque = np.linspace(-5.0, 5.0, scenario.robot.nu)
    here = MuJoCoPeer(scenario, 1e-3, elliptic=True)
    there = served("mujoco", scenario, 1e-3, elliptic=True)
    rows = []
    for peer in (here, there):
        peer.restart()
        peer.hold(torque)
        rows.append(peer.record(200))
    there.close()
    assert rows[0][:, 18:].any()  # it touches
    np.testing.assert_array_equal(rows[0], rows[1])
    assert there.seconds > 0.0
