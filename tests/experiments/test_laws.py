"""Laws by their names, and those of a user, whose code is run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import walking

import heelstrike as hs
from heelstrike.experiments.laws import LAWS, check_law, law_called, law_that_steps, laws_of
from heelstrike.experiments.walk import beginning
from heelstrike.experiments.zoo import CONTROLLERS

MINE = """
from __future__ import annotations
import numpy as np
import heelstrike as hs
from beside import GAIN

class Gains(hs.Bundle):
    kp: float = hs.number(float)

class Limp:
    def __init__(self, robot, gait):
        self.nu = robot.nu
    def torque(self, t, state, contacts):
        return np.zeros(self.nu)

def stiff(robot, gait):
    return hs.JointPD(robot, gait, kp=GAIN, kd=20.0)

def broken(robot, gait):
    return 1.0 / 0.0

def hungry(robot):
    return Limp(robot, None)

def number(robot, gait):
    return 3.0

@hs.controller(compile=False)
def springs(t, state, parameters: Gains, torque):
    torque[:] = -parameters.kp * state.joint_position

@hs.controller(compile=False)
def nothing(t, torque):
    torque[:] = 0.0

ready = nothing()
text = "a law"
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with laws, and one beside it that it imports."""
    monkeypatch.setattr(sys, "path", sys.path.copy())
    for name in ("mine", "own_law_mine", "beside"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    (tmp_path / "beside.py").write_text("GAIN = 900.0\n")
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    return path


def test_names_are_found_however_they_are_written() -> None:
    assert len({entry.name.lower() for entry in LAWS}) == len(LAWS)
    assert set(CONTROLLERS) < set(LAWS)
    for words in ("FootstepFeedback", "footstepfeedback", "footstep-feedback", "footstep_feedback"):
        assert law_called(words).name == "FootstepFeedback"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("FootstepFeedbak", r"Did you mean 'FootstepFeedback'\? There are ComputedTorque, JointPD"),
        ("mine.py", r"is a file: say which law .* as in mine\.py:NAME"),
        ("nosuch.py:make", r"there is no file nosuch\.py"),
        ("nosuch_module:make", "no module 'nosuch_module', neither installed nor in "),
        (":make", "names no law"),
    ],
)
def test_what_is_no_law_is_told_with_what_there_is(words: str, said: str) -> None:
    with pytest.raises(hs.ControllerError, match=said):
        law_called(words)


@pytest.mark.parametrize("name", ["Limp", "stiff", "nothing", "ready"])
def test_a_law_of_a_file_is_made_of_robot_and_gait(mine: Path, name: str) -> None:
    law = law_called(f"{mine}:{name}")
    assert law.source == str(mine)
    start = beginning(walking.bravo7(), walking.gait(), None, law)
    run = hs.simulate(walking.bravo7(), start.controller, state=start.state, duration=0.01)
    assert run.completed
    assert (run.torque.any()) == (name == "stiff")


def test_a_law_of_a_module_is_found_where_one_is(
    mine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(mine.parent)
    law = law_called("mine:stiff")
    controller = law.trial(walking.bravo7(), walking.gait()).controller
    assert isinstance(controller, hs.JointPD)
    assert law.source == str(mine)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("broken", r"makes no controller for robot 'bravo7': ZeroDivisionError: .*mine\.py, line"),
        ("hungry", "called with a robot and its gait, which it does not take"),
        ("number", "returned a float, not a controller"),
        ("springs", r"under @controller that takes parameters: .* springs\(parameters\)"),
        ("text", "is of type str: it must be a class, or a function, of"),
        ("nosuch", r"has no 'nosuch'; there are Gains, Limp, stiff"),
    ],
)
def test_what_goes_wrong_in_a_law_of_ones_own_is_told(mine: Path, name: str, said: str) -> None:
    with pytest.raises(hs.ControllerError, match=said):
        law_called(f"{mine}:{name}").trial(walking.bravo7(), walking.gait())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def make(:", r"SyntaxError: .*line 1"),
        ("import nosuch_package", "ModuleNotFoundError: No module named 'nosuch_package'"),
        ("raise SystemExit(3)", "SystemExit: 3"),
    ],
)
def test_a_file_that_does_not_run_says_why(mine: Path, text: str, said: str) -> None:
    mine.write_text(text)
    with pytest.raises(hs.ControllerError, match=said):
        law_called(f"{mine}:make")
    assert "mine" not in sys.modules


def test_a_robot_has_the_laws_that_can_drive_it() -> None:
    bravo7, rabbit = walking.bravo7(), hs.load_robot("rabbit")
    steps = law_that_steps(bravo7)
    assert steps is not None
    assert steps.name == "FootstepFeedback"
    assert law_that_steps(rabbit) is None
    assert {"VirtualConstraints", "ComputedTorque"} <= {law.name for law in laws_of(rabbit)}
    with pytest.raises(hs.ControllerError, match=r"needs flat feet\)\. It can have ComputedTorque"):
        check_law(steps, rabbit)
    with pytest.raises(hs.ControllerError, match=r"no motors\)\. No law by name can"):
        check_law(steps, hs.load_robot("compass_gait"))


def test_a_law_that_stands_begins_on_its_ground_without_a_gait() -> None:
    robot, ground = walking.bravo7(), hs.Ground(slope=0.03)
    start = beginning(robot, None, ground, law_called("StandingLQR"))
    assert not start.state.v.any()
    assert abs(hs.contact_kinematics(robot, start.state.q, start.state.v, ground).gap).max() < 1e-6
    assert isinstance(start.controller, hs.StandingLQR)
