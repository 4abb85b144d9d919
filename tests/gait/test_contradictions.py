"""Requests that contradict themselves or say half of it: a sentence with the conflict."""

from __future__ import annotations

import dataclasses
import importlib
import re
from functools import wraps
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.gait import Cost
from heelstrike.gait.optimize import request_of

families = importlib.import_module("heelstrike.gait.family")

STEP: dict[str, Any] = {"step_length": 0.30, "step_duration": 0.70}
QUICK: dict[str, Any] = {"starts": 1, "intervals": 10}
ONE = [hs.ContactPhase("right_foot", duration=(0.3, 0.9), pieces=4)]
BOTH = [hs.ContactPhase("right_foot", "left_foot", duration=(0.3, 0.9), pieces=3)]


@pytest.fixture
def never(monkeypatch: pytest.MonkeyPatch) -> None:
    """No gait of a family is designed."""
    designed = wraps(families.optimize_gait)(lambda *_, **__: pytest.fail("a gait was designed"))
    monkeypatch.setattr(families, "optimize_gait", designed)


def empty_family(robot: hs.Robot) -> hs.GaitFamily:
    axes = {"speed": np.array([0.40, 0.45]), "slope": np.array([0.0, 0.03, 0.06])}
    return hs.GaitFamily(robot, axes, {"step_duration": 0.70}, {}, {(0, 0): "why"})


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"step_length": [0.30, 0.35], "speed": 0.0}, "speed must be a positive number"),
        ({"speed": [0.40], "step_length": 0.0}, "step_length must be a positive number"),
        ({"speed": [0.40], "step_duration": 0}, "step_duration must be a positive number"),
        ({"speed": [0.40], "warm_start": None}, "leave out warm_start"),
        ({"slope": [0.0, 1.2]}, "slope must be a number between"),
        ({"slope": [0.0, 0.05], "rise": [0.0, 0.05]}, "slope and rise are both given"),
        ({"speed": [0.4], "file": "f.json", "cost": lambda now: now.torque[0]}, "leave out file"),
    ],
)
@pytest.mark.usefixtures("never")
def test_families_that_cannot_be_are_refused_before_the_first_gait(
    bravo7: hs.Robot, asked: dict[str, Any], said: str
) -> None:
    with pytest.raises(hs.GaitError, match=said):
        hs.gait_family(bravo7, **asked)


@pytest.mark.parametrize("value", ["0.42", None, np.array([0.41, 0.42]), 0.42j])
def test_a_gait_between_is_asked_for_by_numbers(bravo7: hs.Robot, value: Any) -> None:
    with pytest.raises(hs.GaitError, match="speed must be a number, got"):
        empty_family(bravo7).at(speed=value, slope=0.0)


def test_places_of_a_family_have_an_index_of_each_axis(bravo7: hs.Robot) -> None:
    family = empty_family(bravo7)
    assert family[1, 2] is None
    places: list[Any] = [0, (2, 0), (0, -1), (0, 0, 0), ("a", 0)]
    for place in places:
        with pytest.raises(hs.GaitError, match="2 x 3 places, over speed, slope"):
            family[place]


def test_a_family_goes_on_however_its_arguments_were_written(
    bravo7: hs.Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file has lists for pairs, names for members of enums, and numbers of Python."""
    asked: dict[str, Any] = {
        "speed": [0.40], "step_duration": 0.70, "file": tmp_path / "family.json", **QUICK,
        "joint_ranges": {"right_knee": (0.05, 1.5)}, "friction": np.float32(0.5),
        "cost": {Cost.TORQUE: 2.0}, "clearance_profile": hs.gait.ClearanceProfile.SMOOTH,
    }  # fmt: skip
    first = hs.gait_family(bravo7, **asked)
    designed = wraps(families.optimize_gait)(lambda *_, **__: pytest.fail("designed again"))
    monkeypatch.setattr(families, "optimize_gait", designed)
    again = hs.gait_family(bravo7, **asked)
    assert again.asked == first.asked
    assert len(again.gaits) == 1


@pytest.mark.parametrize(
    ("cost", "said"),
    [
        (["torque", "mechanical_energy"], "cost must be one of"),
        ({"torque": 1.0, Cost.TORQUE: 5.0}, "names one cost twice"),
        (lambda now: None, r"must return a number or an expression of CasADi, got None"),
        (lambda now: "torque", r"must return a number or an expression of CasADi, got 'torque'"),
        (lambda now: np.nan, "returns what is no finite number: nan"),
        (lambda now: casadi.log(-1.0 - casadi.sumsqr(now.torque)), "no finite number of any mot"),
    ],
)
def test_costs_that_are_none(bravo7: hs.Robot, cost: Any, said: str) -> None:
    with pytest.raises(hs.GaitError, match=said) as caught:
        hs.optimize_gait(bravo7, **STEP, **QUICK, cost=cost)
    assert not isinstance(caught.value, hs.InfeasibleGaitError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "undefined",
    [
        {"cost": lambda now: casadi.log(-1.0 - casadi.sumsqr(now.torque))},
        {"constraint": lambda now: casadi.sqrt(-1.0 - now.position[1] ** 2)},
    ],
)
def test_functions_of_motions_that_have_no_value(
    bravo7: hs.Robot, undefined: dict[str, Any]
) -> None:
    with pytest.raises(hs.GaitError, match="no finite number of any motion") as caught:
        hs.optimize_motion(bravo7, ONE, distance=0.3, starts=1, refine=False, **undefined)
    assert not isinstance(caught.value, hs.InfeasibleGaitError)


def number_after(words: str, message: str) -> float:
    found = re.search(rf"{words} (\d[\d.e-]*\d)", message)
    assert found is not None
    return float(found[1])


def test_the_friction_that_a_slope_takes_is_told(bravo7: hs.Robot) -> None:
    """Over a step the ground carries the weight: tan(0.6) = 0.684. The advice is followed."""
    with pytest.raises(hs.InfeasibleGaitError, match=r"slope of -0\.6 rad") as caught:
        request_of(bravo7, **STEP, slope=-0.6, friction=0.3)
    assert not isinstance(caught.value, hs.GaitNotFoundError)  # it is proved
    message = str(caught.value)
    least, steepest = (number_after(each, message) for each in ("at least", "slopes up to"))
    assert least == pytest.approx(np.tan(0.6), rel=1e-3)
    request_of(bravo7, **STEP, slope=-0.6, friction=least)
    request_of(bravo7, **STEP, slope=-steepest, friction=0.3)
    for asked in ({"slope": -0.6, "friction": least * 0.999}, {"slope": steepest * 1.001}):
        with pytest.raises(hs.InfeasibleGaitError):
            request_of(bravo7, **{**STEP, "friction": 0.3, **asked})


def test_scales_of_the_soles_count_on_a_slope(bravo7: hs.Robot) -> None:
    with pytest.raises(hs.InfeasibleGaitError) as caught:
        request_of(with_soles(bravo7, 0.5), **STEP, slope=0.3, friction=0.5)
    assert number_after("at least", str(caught.value)) == pytest.approx(2 * np.tan(0.3), rel=1e-3)


def with_soles(robot: hs.Robot, scale: float) -> hs.Robot:
    model = robot.model.replaced(friction_scale=np.full(robot.nc, scale))
    return dataclasses.replace(robot, model=model)


def test_the_ground_does_not_carry_more_than_the_weight(bravo7: hs.Robot) -> None:
    margin = 0.8 * bravo7.weight
    request_of(bravo7, **STEP, force_margin=margin)
    across = r"more than the 457\.\d* N of the robot's weight that"
    with pytest.raises(hs.InfeasibleGaitError, match=across):  # a gap of a family of slopes
        request_of(bravo7, **STEP, force_margin=margin, slope=0.9, friction=2.0)
    for slope in (0.0, 0.3):
        with pytest.raises(hs.GaitError, match="Ask for less") as caught:
            request_of(bravo7, **STEP, force_margin=1.01 * bravo7.weight, slope=slope)
        assert not isinstance(caught.value, hs.InfeasibleGaitError)


@pytest.mark.usefixtures("never")
def test_a_family_without_any_gait_is_refused(bravo7: hs.Robot) -> None:
    margin = 0.8 * bravo7.weight
    with pytest.raises(hs.InfeasibleGaitError, match="across this slope"):
        hs.gait_family(bravo7, slope=[0.8, 0.9], **STEP, force_margin=margin, friction=2.0)


@pytest.mark.parametrize(
    ("phases", "asked", "said"),
    [
        (BOTH, {"distance": 0.3}, r"stands in all phases.* no distance, and 0\.3 m are"),
        (BOTH, {"speed": 0.4}, r"stands in all phases.* no distance, and 0\.4 m/s are"),
        (ONE, {"distance": (0.1, 0.3), "repeat": "same"}, r"no distance, and 0\.1 to 0\.3 m are"),
        (ONE, {"distance": True}, "distance must be a number"),
        (ONE, {"distance": -0.3, "speed": 0.4}, "a speed is forwards, and a distance .* backwards"),
        (ONE, {"distance": 0.3, "slope": 0.5, "friction": 0.3}, "friction of at least 0.5464"),
        (ONE, {"distance": 0.3, "friction": np.inf}, "negative or infinite"),
        (ONE, {"distance": 0.3, "duration": np.array([9.0])}, "duration must be a positive number"),
        (ONE, {"distance": 0.3, "speed": np.array([0.4])}, "speed must be a positive number"),
        (ONE, {"distance": 0.3, "guess": lambda t: "here"}, "guess must return 9 finite positions"),
        (ONE, {"distance": 0.3, "guess": lambda t: 1 / 0}, "guess function failed at 0 s: ZeroDi"),
    ],
)
def test_motions_that_contradict_themselves(
    bravo7: hs.Robot, phases: list[hs.ContactPhase], asked: dict[str, Any], said: str
) -> None:
    with pytest.raises(hs.GaitError, match=said) as caught:
        hs.optimize_motion(bravo7, phases, starts=1, refine=False, **asked)
    assert not isinstance(caught.value, hs.GaitNotFoundError)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [(np.nan, "start must have finite positions"), (10.0, "right_knee is at 10, beyond its range")],
)
def test_states_in_which_no_robot_can_be(bravo7: hs.Robot, wrong: float, said: str) -> None:
    state = bravo7.standing(hs.Ground())
    q = state.q.copy()
    q[bravo7.joint_names.index("right_knee")] = wrong
    with pytest.raises(hs.GaitError, match=said):
        hs.optimize_motion(bravo7, BOTH, repeat="never", start=hs.State(q, state.v), starts=1)


def test_a_constraint_of_ones_own_that_cannot_be_met_is_named(bravo7: hs.Robot) -> None:
    with pytest.raises(hs.GaitNotFoundError, match=r"own \(number 1\) in phase 1: 1\. Ask less of"):
        hs.optimize_motion(
            bravo7, ONE, distance=0.3, starts=1, refine=False, constraint=lambda now: -1.0
        )


@pytest.mark.parametrize("time", ["a", None, {}])
def test_times_are_numbers(gait: hs.Gait, time: Any) -> None:
    for at in (gait.position, gait.velocity, gait.acceleration):
        with pytest.raises(hs.GaitError, match="t must be numbers"):
            at(time)


def test_force_margins_of_motions_that_the_weight_does_not_bear(bravo7: hs.Robot) -> None:
    """One sole at least stands at all times, with two ends."""
    with pytest.raises(hs.InfeasibleGaitError, match="each of 2 ends of soles") as caught:
        hs.optimize_motion(bravo7, ONE, distance=0.3, force_margin=0.6 * bravo7.weight)
    most = number_after("less than", str(caught.value))
    assert most == pytest.approx(0.5 * bravo7.weight, rel=1e-4)


@pytest.mark.slow
def test_slippery_soles_count_in_motions(bravo7: hs.Robot) -> None:
    """Half the scale on twice the friction is the same motion; a plan has the same cone."""
    asked: dict[str, Any] = {"distance": 0.3, "starts": 1, "refine": False, "duration": 0.7}
    plain = hs.optimize_motion(bravo7, ONE, friction=0.12, **asked)
    slippery = hs.optimize_motion(with_soles(bravo7, 0.2), ONE, friction=0.6, **asked)
    assert slippery.cost == pytest.approx(plain.cost, rel=1e-9)
    assert plain.margins["friction"] < 1e-3  # the cone decides
    with pytest.raises(hs.InfeasibleGaitError, match="friction would have to exceed"):
        hs.plan_motion(with_soles(bravo7, 0.03), **STEP, friction=0.75)
