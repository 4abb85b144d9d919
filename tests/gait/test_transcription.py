"""The optimiser's constraints at one instant against the kernels, in the units that they claim."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gait_motion import Instant, contact_heights, instant

import heelstrike as hs
from heelstrike.gait.polynomials import Instants
from heelstrike.gait.program import Program, first_instants
from heelstrike.gait.request import Request
from heelstrike.gait.transcription import Group, Transcription

RADIUS = 0.02
LEVEL = np.zeros(2)
STEP = {"step_length": 0.25, "step_duration": 0.6}
UNASKED: dict[str, Any] = {
    "speed": None, "clearance_profile": None, "zmp_margin": None, "force_margin": None,
    "impact": True, "intervals": None, "starts": 1, "joint_ranges": None,
}  # fmt: skip


@pytest.fixture(scope="module", params=["corners", "discs"])
def robot(request: pytest.FixtureRequest) -> hs.Robot:
    """Bravo7 as it is, and with discs of 2 cm in place of the corners of its soles."""
    bravo7 = hs.load_robot("bravo7")
    if request.param == "corners":
        return bravo7
    model = bravo7.model.replaced(
        contact_radius=np.full(4, RADIUS),
        contact_position=bravo7.model.contact_position + np.array([0.0, RADIUS]),
    )
    return dataclasses.replace(bravo7, model=model)


@pytest.fixture(scope="module")
def asked(robot: hs.Robot) -> Request:
    return Request(
        robot=robot, **STEP, friction=0.6, clearance=0.03, joint_speed_limit=7.0, **UNASKED
    )


@pytest.fixture(scope="module")
def program(asked: Request) -> Program:
    return Program(asked, Transcription(asked), asked.profiles[0], *first_instants(asked))


def at_phase(phase: float) -> Instants:
    return Instants(1, np.array([0]), np.array([phase]), np.array([1.0]))


def a_step(seed: int) -> tuple[np.ndarray, SimpleNamespace]:
    """Unknowns of a step and its motion, the cubics solved for as a linear system."""
    draw = np.random.default_rng(seed)
    end, end_velocity, start_velocity = draw.normal(size=(3, 6)) * [[0.3], [1.0], [1.0]]
    duration = 0.6
    start = end[[3, 4, 5, 0, 1, 2]]  # legs change places
    powers = duration ** np.arange(4)
    rates = np.array([0.0, 1.0, 2.0 * duration, 3.0 * duration**2])
    ends = np.array([[1.0, 0.0, 0.0, 0.0], powers, [0.0, 1.0, 0.0, 0.0], rates])
    cubic = np.linalg.solve(ends, [start, end, start_velocity, end_velocity])

    def motion(order: int) -> Any:
        factor = np.array([[1, 1, 1, 1], [0, 1, 2, 3], [0, 0, 2, 6]])[order]
        return lambda t: (factor * t ** np.maximum(np.arange(4) - order, 0)) @ cubic

    gait = SimpleNamespace(
        stance_foot=0, position=motion(0), velocity=motion(1), acceleration=motion(2)
    )
    # The acceleration 2 a2 + 6 a3 t in parts that are 1 and that go from -1 to 1.
    mean, rise = 2.0 * cubic[2] + 3.0 * duration * cubic[3], 3.0 * duration * cubic[3]
    return np.concatenate([end, start_velocity, mean, rise, [duration, 0.25]]), gait


def path_values(
    robot: hs.Robot, asked: Request, now: Instant
) -> dict[tuple[Group, str], tuple[float, float, float]]:
    """Value and bounds of every constraint along the path, in the units of its group."""
    x, z, moment = now.wrench
    inside = 0.1 - asked.zmp_margin
    weight = 75.0 * 9.81
    expected = {
        (Group.NORMAL_FORCE, ""): (z, 0.1 * weight, np.inf),
        (Group.FRICTION, "forward"): (0.6 * z - x, 0.0, np.inf),
        (Group.FRICTION, "backward"): (0.6 * z + x, 0.0, np.inf),
        # Distance from the end of the sole, times the share of the weight that the foot bears.
        (Group.ZERO_MOMENT_POINT, "toe"): ((inside * z + moment) / weight, 0.0, np.inf),
        (Group.ZERO_MOMENT_POINT, "heel"): ((inside * z - moment) / weight, 0.0, np.inf),
    }
    for place, height in zip((2, 3), contact_heights(robot, now.q, 1), strict=True):
        expected[Group.CLEARANCE, robot.contact_names[place]] = (height, 0.0, np.inf)
    degree = np.pi / 180.0
    ranges = {"hip": (-90.0, 90.0), "knee": (-10.0, 130.0), "ankle": (-60.0, 60.0)}
    for k, name in enumerate(robot.joint_names[3:]):
        lower, upper = (degree * angle for angle in ranges[name.split("_")[1]])
        expected[Group.JOINT_RANGE, name] = (now.q[3 + k], lower, upper)
        expected[Group.JOINT_SPEED, name] = (now.v[3 + k], -7.0, 7.0)
        expected[Group.TORQUE, name] = (now.torque[k], -300.0, 300.0)
    return expected


@pytest.mark.parametrize("seed", range(3))
def test_constraints_along_the_path(
    robot: hs.Robot, asked: Request, program: Program, seed: int
) -> None:
    unknowns, gait = a_step(seed)
    phase = 0.3 + 0.1 * seed
    now = instant(robot, gait, phase * 0.6)  # type: ignore[arg-type]
    motion = program.motion(unknowns, at_phase(phase))
    effort, values = (
        np.array(part).ravel() for part in program.transcription.path(*motion, 0.25, LEVEL)
    )
    assert effort[0] == pytest.approx(now.torque @ now.torque, rel=1e-9)
    expected = path_values(robot, asked, now)
    rows = program.transcription.path_rows
    assert {(row.kind, row.subject) for row in rows} == expected.keys()
    assert len(rows) == len(expected)
    for row, value in zip(rows, values, strict=True):
        told = np.array([value, row.lower, row.upper]) * row.unit
        np.testing.assert_allclose(
            told, expected[row.kind, row.subject], rtol=1e-9, atol=1e-9, err_msg=str(row)
        )


@pytest.mark.parametrize("seed", range(2))
def test_motion_that_is_reported(robot: hs.Robot, program: Program, seed: int) -> None:
    unknowns, gait = a_step(seed)
    now = instant(robot, gait, 0.4 * 0.6)  # type: ignore[arg-type]
    transcription, motion = program.transcription, program.motion(unknowns, at_phase(0.4))
    wrench, torque, heights, joints = (
        np.array(part).ravel() for part in transcription.motion(*motion, 0.25, LEVEL)
    )
    np.testing.assert_allclose(joints, now.q[3:], atol=1e-12)
    scale = np.abs(now.wrench).max()
    np.testing.assert_allclose(wrench, now.wrench, atol=1e-9 * scale)
    np.testing.assert_allclose(torque, now.torque, atol=1e-9 * scale)
    np.testing.assert_allclose(heights, contact_heights(robot, now.q, 1), atol=1e-12)
    np.testing.assert_allclose(motion[0].ravel(), now.q[3:], atol=1e-12)
    start = instant(robot, gait, 0.0)  # type: ignore[arg-type]
    end, _, start_velocity, _, _ = program.at_touchdown(unknowns)
    q, v = (np.array(part).ravel() for part in transcription.start(end, start_velocity, LEVEL))
    np.testing.assert_allclose(q, start.q, atol=1e-12)
    np.testing.assert_allclose(v, start.v, atol=1e-12)


def test_the_kind_of_foot_decides_about_the_moment_of_the_ground() -> None:
    """It keeps inside a sole; on a point there is none, of which one equation is left."""
    rows = {}
    for name in ("bravo7", "rabbit"):
        request = Request(
            robot=hs.load_robot(name), **STEP, friction=0.6, clearance=0.03,
            joint_speed_limit=np.inf, **UNASKED
        )  # fmt: skip
        transcription = Transcription(request)
        rows[name] = [*transcription.path_rows, *transcription.touchdown_rows]
    flat, point = ({row.kind for row in rows[name]} for name in ("bravo7", "rabbit"))
    sole = {Group.ZERO_MOMENT_POINT, Group.IMPULSE_CENTER, Group.TOUCHDOWN_ANGLE}
    assert flat - point == sole
    assert point - flat == {Group.ANKLE}
    (ankle,) = (row for row in rows["rabbit"] if row.kind is Group.ANKLE)
    assert ankle.lower == ankle.upper == 0.0


UNITS = {
    Group.NORMAL_FORCE: "N", Group.FRICTION: "N", Group.ANKLE: "N m",
    Group.ZERO_MOMENT_POINT: "m", Group.CLEARANCE: "m", Group.JOINT_RANGE: "rad",
    Group.JOINT_SPEED: "rad/s", Group.TORQUE: "N m", Group.TOUCHDOWN_PLACE: "m",
    Group.TOUCHDOWN_ANGLE: "rad", Group.LANDING: "m/s", Group.IMPACT: "N m s",
    Group.PERIODIC: "rad/s", Group.REST: "m/s", Group.IMPULSE: "N s",
    Group.IMPULSE_FRICTION: "N s", Group.IMPULSE_CENTER: "m", Group.LIFT: "m/s", Group.SPEED: "m/s",
}  # fmt: skip


def test_every_group_has_its_unit() -> None:
    assert {group: group.unit for group in Group} == UNITS


def test_swing_foot_keeps_clear_whatever_its_shape(robot: hs.Robot) -> None:
    """The lowest points of the swing foot's discs keep the clearance, all through the step."""
    gait = hs.optimize_gait(robot, **STEP, friction=0.6, clearance=0.03)
    for phase in np.linspace(0.02, 0.98, 25):
        now = instant(robot, gait, phase * gait.step_duration)
        least = gait.clearance * float(gait.clearance_profile.height(phase))
        assert contact_heights(robot, now.q, 1).min() >= least
