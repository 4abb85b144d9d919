"""Every public function refuses what is clearly another thing than it takes, in words.

What it takes it says in its annotations. Whoever adds a public function finds it here: it needs
arguments with which it could be called, or a place among what only the package makes.
"""

from __future__ import annotations

import enum
import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.arguments import _is_any, _kinds, at_least, at_most, check_fields, takes

ONE, FLAT = np.eye(2), np.ones(2)


class PhasedGait:
    """Passes for one until it is used."""


@cache
def usual() -> dict[str, dict[str, Any]]:
    """Arguments of each function that it could be called with."""
    robot, gait = walking.bravo7(), walking.gait()
    state = gait.initial_state
    law = hs.ComputedTorque(robot, gait)
    on_a_gait: dict[str, Any] = {"robot": robot, "gait": gait}
    walked: dict[str, Any] = {"robot": robot, "state": state}
    there: dict[str, Any] = {"robot": robot, "q": state.q, "v": state.v}
    trial = hs.Trial(**walked, controller=law, step_length=0.3, step_duration=0.7)
    active = hs.ActiveContacts(resting=(0,))
    return {
        "Campaign": {"trial": trial, "parameters": {"ground.friction": 0.5}, "trials": 2},
        "Actuated": {"controller": law},
        "Compliant": {},
        "ComputedTorque": on_a_gait,
        "Encoder": {},
        "Encoders": {},
        "Estimated": {"controller": law},
        "EventDriven": {},
        "FlatGaitLQR": on_a_gait,
        "FootSensors": {},
        "FootstepFeedback": on_a_gait,
        "Ground": {},
        "HuntCrossley": {},
        "InertialUnit": {},
        "JointPD": {**on_a_gait, "kp": 1.0, "kd": 1.0},
        "KelvinVoigt": {},
        "Policy": {"file": "policy.npz"},
        "Box": {"center": np.zeros(3), "size": np.ones(3)},
        "SpatialGround": {},
        "HoldBalance": {"robot": hs.load_robot("bravo7", dimension=3, floating=True)},
        "HoldPosture": {"robot": hs.load_robot("bravo7", dimension=3), "kp": 1.0, "kd": 1.0},
        "Push": {"link": "trunk", "force": (1.0, 0.0), "start": 0.0, "duration": 0.1},
        "RobotBuilder": {"name": "robot"},
        "Sensed": {"controller": law},
        "Simulation": walked,
        "SpringMass": {"stiffness": 1e4, "angle": 0.3, "energy": 800.0},
        "StandingLQR": {"robot": robot},
        "State": {"q": FLAT, "v": FLAT},
        "TimeStepping": {},
        "Trial": {**walked, "controller": law, "step_length": 0.3, "step_duration": 0.7},
        "WholeBody": on_a_gait,
        "Batch": walked,
        "HeldTorque": {"robot": robot},
        "compare": {**walked, "methods": [hs.TimeStepping()], "duration": 0.1},
        "compare_engines": {**on_a_gait, "controller": law, "engines": ["mujoco"], "steps": 0},
        "constrained": {"robot": robot},
        "contact_forward_dynamics": {**there, "torque": np.zeros(robot.nu)},
        "contact_inverse_dynamics": {**there, "acceleration": np.zeros(robot.nv)},
        "contact_kinematics": there,
        "disturbance_response": {**walked, "disturbances": {}},
        "find_limit_cycle": walked,
        "floquet_multipliers": walked,
        "load_motion": {"path": "motion.json"},
        "optimize_motion": {
            "robot": robot,
            "phases": [hs.ContactPhase("right_foot")],
            "speed": 0.4,
        },
        "over_obstacle": {"robot": robot, "place": 0.15, "height": 0.1, "half_width": 0.02},
        "gait_family": {"robot": robot, "speed": [0.4]},
        "gait_sensitivity_norm": dict.fromkeys("ABCD", 0.5 * ONE),
        "human": {},
        "identify": {"robot": robot, "log": hs.simulate(**walked, duration=0.1)},
        "inspect_robot": {"robot": robot},
        "largest_ground_step": {"trial": trial, "up": True},
        "largest_push": {"trial": trial},
        "largest_roughness": {"trial": trial, "seed": 0},
        "largest_slope": {"trial": trial, "uphill": True},
        "linearize_contact": {**there, "torque": np.zeros(robot.nu), "active": active},
        "linearize_impact": {**there, "active": active},
        "load_gait": {"path": "gait.json"},
        "load_gait_family": {"path": "family.json", "robot": robot},
        "load_robot": {"name_or_path": "bravo7"},
        "load_run": {"path": "run.nc"},
        "load_snapshot": {"path": "kept.npz"},
        "make_invariant": {"gait": PhasedGait()},
        "mimic": {"path": "walk.csv"},
        "monodromy": walked,
        "compare_planners": {"robot": robot},
        "optimize_gait": {"robot": robot},
        "plan_motion": {"robot": robot, "step_length": 0.3, "step_duration": 0.7},
        "report": {"runs": [], "path": "report.html"},
        "run_derivatives": {"simulation": hs.Simulation(**walked), "until": 0.001},
        "saltation_matrix": {"reset": ONE, "gradient": FLAT, "before": FLAT, "after": FLAT},
        "simulate": {**walked, "duration": 0.1},
        "simulate_batch": {**walked, "duration": 0.1},
        "solve_contact": {"delassus": ONE, "free": FLAT, "friction": 0.5},
        "solve_quadratic_program": {"hessian": ONE, "gradient": FLAT},
        "step_derivatives": {"simulation": hs.Simulation(**walked)},
        "zero_dynamics": {"gait": PhasedGait()},
    }


RESULTS = """ActiveContacts BatchResult CampaignResults DisturbanceResponse Floquet Gait GaitFamily
Gradient Largest
LimitCycle ModeChange Monodromy Motion PhasedGait PlannerComparison Robot Run RunDerivatives
Snapshot SpatialRobot StepDerivatives StepFamily ZeroDynamics"""
"""What functions return, or `from_gait` and the like make."""
TOLD_APART = """Bundle Constraint ContactPhase EndOfRun GaitLQR GroundShape MotionLQR MotionTracking
SteppingConstraints VirtualConstraints ZeroMomentPointRegulation array builtin_robots cell
controller number part watch"""
"""Declarations of controllers, laws, classes to derive from, and the viewer, whose own tests have
this."""
WRONG = ("0.5", None, object(), ["a"], {"a": 1}, 1j, b"x", [[1, [2]]], 2.5, hs.load_robot)


def functions() -> list[str]:
    found = {
        name
        for name in hs._HOME
        if not name.endswith(("Error", "Warning"))
        and not isinstance(getattr(hs, name), enum.EnumMeta)
    }
    return sorted(found.difference(RESULTS.split(), TOLD_APART.split()))


@pytest.mark.parametrize("name", functions())
def test_another_thing_than_is_taken_is_refused_in_words(name: str) -> None:
    function, given = getattr(hs, name), usual()[name]
    tried = 0
    for parameter in inspect.signature(function).parameters.values():
        kinds = _kinds(parameter.annotation)
        for wrong in WRONG if kinds else ():
            if _is_any(wrong, kinds):
                continue
            tried += 1
            with pytest.raises(hs.HeelstrikeError, match=rf"\b{parameter.name}\b"):
                function(**{**given, parameter.name: wrong})
    assert tried


STATE = walking.bravo7().reference_state()


def simulation() -> hs.Simulation:
    return hs.Simulation(walking.bravo7(), state=STATE)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: hs.optimize_gait("bravo7"), r"robot must be a Robot, got 'bravo7' \(str\); hs.l"),  # type: ignore[arg-type]
        (
            lambda: hs.simulate(walking.bravo7(), state=STATE, duration="2"),  # type: ignore[arg-type]
            r"duration must be a number, got '2' \(str\)",
        ),
        (lambda: hs.Ground(friction="a"), "friction must be numbers, got 'a'"),
        (
            lambda: walking.bravo7().state(position=[0.1]),  # type: ignore[arg-type]
            r"position must be a mapping or None, got \[0.1\] \(list\)",
        ),
        (lambda: walking.bravo7().positions("a"), "state must be a State, got 'a'"),  # type: ignore[arg-type]
        (lambda: walking.bravo7().standing(2), "ground must be a Ground, got 2"),  # type: ignore[arg-type]
        (
            lambda: hs.Ground.stairs(rise="a", tread=0.3, count=3),  # type: ignore[arg-type]
            "rise must be a number",
        ),
        (
            lambda: hs.Ground.rough(amplitude=0.1, spacing=1, length=2, seed=-1),
            "a seed from 0 on",
        ),
        (lambda: hs.load_robot("bravo7", floating=1), "floating must be True or False, got 1"),  # type: ignore[arg-type]
        (lambda: hs.load_robot("bravo7", package_path=[2]), "a folder of package_path must be"),  # type: ignore[list-item]
        (lambda: simulation().advance("1"), r"until must be a number, got '1'"),  # type: ignore[arg-type]
        (lambda: simulation().apply(1), "push must be"),  # type: ignore[arg-type]
        (lambda: hs.control.controlled_robot("bravo7"), "robot must be a Robot"),  # type: ignore[arg-type]
        (lambda: hs.dynamics.mass_matrix("bravo7", [0.0]), "robot must be a Robot"),  # type: ignore[arg-type]
        (lambda: hs.dynamics.mass_matrix(walking.bravo7(), "a"), "q must be numbers, got 'a'"),
        (lambda: hs.controller(3), "a controller must be a function, got 3"),  # type: ignore[call-overload]
        (lambda: hs.controller(endings="fell")(print), "endings must be several texts, got 'fell'"),
        (
            lambda: hs.simulate_batch(
                walking.bravo7(), parameters={"k": ["a"]}, state=[STATE], duration=0.01
            ),
            "parameters: k must be numbers",
        ),
    ],
)
def test_what_is_said(call: Callable[[], object], said: str) -> None:
    with pytest.raises(hs.HeelstrikeError, match=said):
        call()


def test_annotations_that_are_not_known_let_everything_pass() -> None:
    @takes(hs.SimulationError)
    def anything(
        one: Mapping[str, tuple[int, Sequence[str]]] | None,
        two: hs.TimeStepping | Protocolled,
        *three: float,
        **four: float,
    ) -> tuple[object, ...]:
        return one, two, three, four

    assert anything({"a": 1}, "a", "b", c="d") == ({"a": 1}, "a", ("b",), {"c": "d"})  # type: ignore[dict-item,arg-type]
    with pytest.raises(hs.SimulationError, match="one must be a mapping or None, got 2"):
        anything(2, "a")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'two'"):
        anything(None)  # type: ignore[call-arg]


class Protocolled:
    """A kind that the package does not know."""


def test_numbers_are_numbers_of_numpy_too() -> None:
    for friction in (np.float64(0.5), np.float32(0.5), np.int64(1), [0.5], np.array(0.5)):
        hs.Ground(friction=friction)
    check_fields(hs.EventDriven(rtol=np.float64(1e-6)), hs.SimulationError)
    assert hs.TimeStepping(step=np.float64(1e-3)) == hs.TimeStepping(step=1e-3)


@pytest.mark.parametrize("value", [0.546302489843790, 0.0333333333333, 0.25, 12345.6, 1.0])
@pytest.mark.parametrize("digits", [3, 4])
def test_what_is_told_can_be_asked_for(value: float, digits: int) -> None:
    least, most = float(at_least(value, digits)), float(at_most(value, digits))
    assert most <= value <= least
    assert least - most <= 10.0 ** (1 - digits) * value
