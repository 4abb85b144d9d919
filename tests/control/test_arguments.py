"""Arguments of another kind than wanted are refused in words, by every stock law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.arguments import numbers_of

phased = walking.rabbit_phased


GAINS: dict[str, Any] = {"kp": 1.0, "kd": 1.0}
ON_A_GAIT: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "ComputedTorque": (hs.ComputedTorque, {}),
    "FootstepFeedback": (hs.FootstepFeedback, {}),
    "JointPD": (hs.JointPD, GAINS),
    "WholeBody": (hs.WholeBody, {}),
    "ZeroMomentPointRegulation": (hs.ZeroMomentPointRegulation, {}),
}
NUMBERS = {
    "ComputedTorque": "kp kd",
    "FootstepFeedback": "speed friction",
    "JointPD": "kp kd",
    "ZeroMomentPointRegulation": (
        "margin kp kd friction least_force returning hurry slowest fastest bandwidth period"
    ),
}
WRONG = ["0.5", object(), [1.0, "a"], 1j]


@pytest.mark.parametrize("name", sorted(ON_A_GAIT))
def test_robots_and_gaits_that_are_none(name: str) -> None:
    make, options = ON_A_GAIT[name]
    robot, gait = walking.bravo7(), walking.gait()
    with pytest.raises(
        hs.ControllerError, match=r"robot must be a Robot, got 'bravo7' \(str\); hs"
    ):
        make("bravo7", gait, **options)
    with pytest.raises(hs.ControllerError, match=r"gait must be a Gait, got .*optimize_gait"):
        make(robot, None, **options)
    with pytest.raises(hs.ControllerError, match=r"gait must be a Gait, got .*PhasedGait"):
        make(robot, phased(), **options)
    with pytest.raises(hs.ControllerError, match="robot must be a Robot, got Gait"):
        make(gait, robot, **options)


@pytest.mark.parametrize("name", sorted(ON_A_GAIT))
def test_a_gait_of_another_robot_whose_joints_are_called_the_same(name: str) -> None:
    """Numbers may be others, since a law may know its robot wrongly; the name is the robot's."""
    make, options = ON_A_GAIT[name]
    other = replace(walking.bravo7(), name="tall7")
    with pytest.raises(hs.ControllerError, match="one of robot 'bravo7', not of 'tall7'"):
        make(other, walking.gait(), **options)
    make(replace(other, name="bravo7"), walking.gait(), **options)  # as advised


@pytest.mark.parametrize(
    ("name", "number"), [(name, each) for name in NUMBERS for each in NUMBERS[name].split()]
)
def test_numbers_of_laws_on_a_gait(name: str, number: str) -> None:
    make, options = ON_A_GAIT[name]
    for wrong in WRONG:
        with pytest.raises(hs.ControllerError, match=rf"\b{number}\b|the period"):
            make(walking.bravo7(), walking.gait(), **{**options, number: wrong})


def test_numbers_by_name_are_a_mapping_of_numbers() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    with pytest.raises(hs.ControllerError, match=r"numbers must be a mapping, got \['kp'\]"):
        hs.WholeBody(robot, gait, numbers=["kp"])  # type: ignore[arg-type]
    with pytest.raises(hs.ControllerError, match="kp must be a number, got 'stiff'"):
        hs.WholeBody(robot, gait, numbers={"kp": "stiff"})  # type: ignore[dict-item]


@pytest.mark.parametrize(
    "number", ["posture", "position_weight", "velocity_weight", "torque_weight", "period"]
)
def test_numbers_of_standing(number: str) -> None:
    given: dict[str, Any] = {}
    for wrong in WRONG:
        given[number] = wrong
        with pytest.raises(hs.ControllerError, match=number):
            hs.StandingLQR(walking.bravo7(), **given)
    with pytest.raises(hs.ControllerError, match="robot must be a Robot"):
        hs.StandingLQR(None)  # type: ignore[arg-type]
    with pytest.raises(hs.ControllerError, match="of 9 finite numbers"):
        hs.StandingLQR(walking.bravo7(), [0.0, 1.0])


def test_laws_over_a_phase() -> None:
    wanted: Any
    for make, wanted in (
        (hs.VirtualConstraints, "gait must be a PhasedGait"),
        (hs.SteppingConstraints, "family must be a StepFamily"),
        (hs.GaitLQR, "gait over a phase"),
    ):
        law: Any = make
        with pytest.raises(hs.ControllerError, match=wanted):
            law(walking.gait())
    for number in ("kp", "kd", "finite_time", "exponent", "outputs"):
        for wrong in WRONG:
            given: dict[str, Any] = {number: wrong}
            with pytest.raises(hs.ControllerError, match=number):
                hs.VirtualConstraints(phased(), **given)
    for number in ("position_weight", "velocity_weight", "torque_weight"):
        given = {number: "heavy"}
        with pytest.raises(hs.ControllerError, match=number):
            hs.GaitLQR(phased(), **given)


def test_gaits_over_a_phase() -> None:
    robot, law = walking.bravo7(), walking.gait()
    family: Any = hs.StepFamily.around
    with pytest.raises(hs.GaitError, match="around a PhasedGait, got Gait"):
        family(law)
    with pytest.raises(hs.GaitError, match="slope='steep'"):
        family(phased(), slope="steep")
    read: Any = hs.PhasedGait.from_gait
    with pytest.raises(hs.GaitError, match="gait must be a Gait, got Robot"):
        read(robot, robot)
    with pytest.raises(hs.GaitError, match="robot must be a Robot, got Gait"):
        read(law, law)


def test_an_encoder_is_one() -> None:
    given: Any = 1e-3
    with pytest.raises(hs.ControllerError, match=r"encoder must be an Encoder.*hs\.Encoder"):
        hs.ComputedTorque(walking.bravo7(), walking.gait(), encoder=given)


def test_numbers_in_arrays_are_numbers() -> None:
    law = hs.ZeroMomentPointRegulation(
        walking.bravo7(), walking.gait(), margin=np.float64(0.03), hurry=np.array(40.0)
    )
    assert law.parameters.margin == 0.03
    assert law.parameters.hurry == 40.0
    np.testing.assert_array_equal(numbers_of("gains", (1, 2)), [1.0, 2.0])
