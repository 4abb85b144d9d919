"""Gaits on point feet: what direct collocation found holds at all times and through the impact.

Nothing here comes from the optimiser but the polynomials: forces and torques follow from them by
inverse dynamics with contact, the impact from momentum.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.contact.queries.inverse_dynamics import ContactInverseDynamics
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait import ClearanceProfile, Footing
from heelstrike.gait.polynomials import gauss
from heelstrike.gait.program import SETTINGS, Program, Solution

STEP = {"step_length": 0.25, "step_duration": 0.6, "clearance": 0.02, "friction": 0.6, "starts": 1}
POINTS = 4  # Gauss points in every interval


@pytest.fixture(scope="module")
def rabbit() -> hs.Robot:
    return hs.load_robot("rabbit")


@pytest.fixture(scope="module")
def round_rabbit(rabbit: hs.Robot) -> hs.Robot:
    """The same robot on discs of 5 cm: its feet roll."""
    model = rabbit.model.replaced(contact_radius=np.full(2, 0.05))
    return dataclasses.replace(rabbit, model=model)


@pytest.fixture(scope="module")
def rabbit_gait(rabbit: hs.Robot) -> hs.Gait:
    return hs.optimize_gait(rabbit, **STEP)


@pytest.fixture(scope="module", params=["sharp", "round"])
def walker(
    request: pytest.FixtureRequest, rabbit: hs.Robot, rabbit_gait: hs.Gait
) -> tuple[hs.Robot, hs.Gait]:
    if request.param == "sharp":
        return rabbit, rabbit_gait
    robot = request.getfixturevalue("round_rabbit")
    return robot, hs.optimize_gait(robot, **STEP)


def motion(robot: hs.Robot, gait: hs.Gait, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All coordinates of the first step, with derivatives: the stance foot rolls or pivots."""
    stance = robot.feet[gait.stance_foot]
    contact = stance.contacts[0]
    radius = robot.model.contact_radius[contact]

    def posture(time: float) -> np.ndarray:
        q = robot.model.reference.copy()
        q[robot.model.actuator_joint] = gait.in_step(time)
        q[2] = gait.pitch(time)
        turned = dynamics.link_poses(robot, q).angle[stance.link]
        q[:2] += [radius * turned, radius] - dynamics.contact_positions(robot, q)[contact]
        return q

    q = posture(t)
    q[0] += gait.initial_state.q[0] - posture(0.0)[0]

    def completed(order: int, target: np.ndarray) -> np.ndarray:
        full = np.zeros(robot.nv)
        full[robot.model.actuator_joint] = gait.in_step(t, order=order)
        full[2] = gait.pitch(t, order=order)
        rows = dynamics.contact_jacobian(robot, q)[contact]
        full[:2] = np.linalg.solve(rows[:, :2], target - rows @ full)
        return full

    v = completed(1, np.zeros(2))
    drift = dynamics.contact_bias_acceleration(robot, q, v)[contact]
    return q, v, completed(2, -drift)


def forces(
    robot: hs.Robot, gait: hs.Gait, times: np.ndarray
) -> Iterator[tuple[np.ndarray, ContactInverseDynamics]]:
    stance = robot.feet[gait.stance_foot].contacts
    ground = hs.Ground(friction=gait.friction)
    for t in times:
        q, v, a = motion(robot, gait, t)
        yield (
            q,
            hs.contact_inverse_dynamics(robot, q, v, a, contacts=stance, ground=ground),
        )


def gauss_times(gait: hs.Gait) -> np.ndarray:
    """Times at which the equations of motion hold exactly."""
    nodes, _ = gauss(POINTS)
    begin, length = gait.breakpoints[:-1], np.diff(gait.breakpoints)
    return (begin[:, None] + length[:, None] * nodes).ravel()


def test_motors_and_ground_are_enough(walker: tuple[hs.Robot, hs.Gait]) -> None:
    """Collocation: at the Gauss points the stance ankle exerts no moment, to the solver's 1e-8."""
    robot, gait = walker
    for _, needed in forces(robot, gait, gauss_times(gait)):
        assert np.abs(needed.missing_force).max() <= 1e-6
        assert not needed.pulling.any()
        assert needed.friction_use.max() <= 1.0
        assert not needed.torque_excess.any()


def test_moment_between_the_points_falls_with_the_mesh(rabbit: hs.Robot) -> None:
    """Accelerations of degree 3 that are exact at four points miss by O(h⁴) between them."""
    missing = []
    for intervals in (6, 12):
        gait = hs.optimize_gait(rabbit, **STEP, intervals=intervals)
        times = np.linspace(0.0, gait.step_duration, 121)[:-1]
        worst = max(np.abs(needed.missing_force).max() for _, needed in forces(rabbit, gait, times))
        missing.append(worst)
    assert missing[1] <= 1e-3 * rabbit.weight  # N m, of a robot 0.8 m tall
    assert np.log2(missing[0] / missing[1]) >= 3.0


def test_cost_is_the_integral_of_the_squared_torques(
    walker: tuple[hs.Robot, hs.Gait],
) -> None:
    robot, gait = walker
    weights = np.tile(gauss(POINTS)[1], gait.breakpoints.size - 1)
    effort = [n.torque @ n.torque for _, n in forces(robot, gait, gauss_times(gait))]
    h = gait.step_duration / (gait.breakpoints.size - 1)
    assert gait.cost == pytest.approx(h * float(weights @ effort), rel=1e-9)


def test_swing_foot_keeps_clear(walker: tuple[hs.Robot, hs.Gait]) -> None:
    robot, gait = walker
    contact = robot.feet[1 - gait.stance_foot].contacts[0]
    for phase in np.linspace(0.0, 1.0, 121)[1:-1]:
        q, _, _ = motion(robot, gait, phase * gait.step_duration)
        height = dynamics.contact_positions(robot, q)[contact, 1]
        height -= robot.model.contact_radius[contact]
        assert height >= gait.clearance * gait.clearance_profile.height(phase) - 1e-7


def test_margins_are_the_worst_of_the_motion(walker: tuple[hs.Robot, hs.Gait]) -> None:
    """Found again on a grid of its own, with both sides of every joint between the pieces."""
    robot, gait = walker
    model, margins = robot.model, gait.margins
    inside = np.linspace(0.0, gait.step_duration, 200)[1:-1]
    ends = gait.breakpoints
    times = np.concatenate([inside, ends[:-1] + 1e-9, ends[1:] - 1e-9])
    found = list(forces(robot, gait, times))
    torque = np.array([needed.torque for _, needed in found])
    load = np.array([needed.contact_force[0] for _, needed in found])
    joints = np.array([q[3:] for q, _ in found])
    assert margins.peak_torque == pytest.approx(np.abs(torque).max(), rel=1e-2)
    limit = np.minimum(model.torque_upper - torque, torque - model.torque_lower).min()
    assert margins.torque == pytest.approx(limit, rel=1e-2)
    assert margins.normal_force == pytest.approx(load[:, 0].min(), rel=1e-2)
    use = (np.abs(load[:, 1]) / (gait.friction * load[:, 0])).max()
    assert margins.friction_use == pytest.approx(use, rel=1e-2)
    free = np.minimum(model.upper[3:] - joints, joints - model.lower[3:]).min()
    assert margins.joint_range == pytest.approx(free, abs=5e-3)


def test_pieces_join(walker: tuple[hs.Robot, hs.Gait]) -> None:
    _, gait = walker
    inner, tiny = gait.breakpoints[1:-1], 1e-12
    for order in (0, 1):
        before = gait.in_step(inner - tiny, order=order)
        after = gait.in_step(inner + tiny, order=order)
        np.testing.assert_allclose(after, before, atol=1e-8)
        before, after = (gait.pitch(inner + side * tiny, order=order) for side in (-1.0, 1.0))
        np.testing.assert_allclose(after, before, atol=1e-8)
    np.testing.assert_allclose(gait.in_step(0.0), gait.start_position, atol=1e-9)
    np.testing.assert_allclose(gait.in_step(gait.step_duration), gait.end_position, atol=1e-9)


def test_touchdown_and_impact_begin_the_mirrored_step(
    walker: tuple[hs.Robot, hs.Gait],
) -> None:
    """The landing point takes the whole impulse, comes to rest, and the velocities repeat."""
    robot, gait = walker
    q, v, _ = motion(robot, gait, gait.step_duration)
    start, _, _ = motion(robot, gait, 0.0)
    assert q[0] - start[0] == pytest.approx(gait.step_length, abs=1e-8)
    swing = robot.feet[1 - gait.stance_foot].contacts[0]
    center = dynamics.contact_positions(robot, q)[swing]
    assert center[1] == pytest.approx(robot.model.contact_radius[swing], abs=1e-8)
    rows = dynamics.contact_jacobian(robot, q)
    assert (rows[swing] @ v)[0] < 0.0
    response = np.linalg.solve(dynamics.mass_matrix(robot, q), rows[swing].T)
    impulse = -np.linalg.solve(rows[swing] @ response, rows[swing] @ v)
    after = v + response @ impulse
    mirror = robot.mirror
    assert mirror is not None
    np.testing.assert_allclose(mirror.sign * after[mirror.joint], gait.initial_state.v, atol=1e-6)
    np.testing.assert_allclose(gait.touchdown_impulse[:2], impulse, atol=1e-6)
    assert impulse[0] > 0.0
    assert abs(impulse[1]) <= gait.friction * impulse[0] * (1.0 + 1e-6)
    rear = robot.feet[gait.stance_foot].contacts[0]
    assert (rows[rear] @ after)[0] >= -2e-6


def test_file_keeps_every_digit(walker: tuple[hs.Robot, hs.Gait], tmp_path: Path) -> None:
    robot, gait = walker
    path = tmp_path / "gait.json"
    gait.save(path)
    loaded = hs.load_gait(path, robot)
    assert loaded.point_feet
    (there,), (here,) = gait.phases, loaded.phases
    assert here.contacts == there.contacts == {gait.stance_foot: Footing.POINT}
    for name in ("breakpoints", "pieces", "pitch_pieces"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    assert loaded.margins == gait.margins


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("breakpoints_s", None, '"breakpoints_s" is missing'),
        ("joint_pieces", None, '"joint_pieces" is missing'),
        ("joint_pieces", [[[1.0, 2.0]]], '"joint_pieces" must hold lists of 4 numbers'),
        ("joint_pieces", [[1.0]], '"joint_pieces" must hold lists of 4 numbers'),
        ("joint_pieces", [[["1"] * 4]], "must be a number"),
        ("pitch_pieces", [[0.0] * 6, [0.0]], "lists of one length"),
        ("pitch_pieces", [[0.0] * 6], "pitch_pieces must have shape"),
        ("pitch_pieces", None, '"pitch_pieces" is missing'),
        ("pitch_pieces", 0.0, '"pitch_pieces" must be a list of numbers'),
        ("breakpoints_s", [0.0, 0.6], "2 breakpoints need pieces"),
    ],
)
def test_spoilt_pieces_are_named(
    rabbit_gait: hs.Gait, tmp_path: Path, key: str, value: object, said: str
) -> None:
    path = tmp_path / "gait.json"
    rabbit_gait.save(path)
    data = json.loads(path.read_text(encoding="utf-8"))
    (phase,) = data["phases"]
    del phase[key]
    if value is not None:
        phase[key] = value
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(GaitError) as caught:
        hs.load_gait(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)


def test_without_impact_the_foot_comes_to_rest(rabbit: hs.Robot) -> None:
    gait = hs.optimize_gait(rabbit, **{**STEP, "clearance": 0.01}, impact=False)
    q, v, _ = motion(rabbit, gait, gait.step_duration)
    np.testing.assert_allclose(dynamics.contact_jacobian(rabbit, q)[1] @ v, 0.0, atol=1e-7)
    np.testing.assert_array_equal(gait.touchdown_impulse, 0.0)


def test_speed_alone(rabbit: hs.Robot) -> None:
    gait = hs.optimize_gait(rabbit, speed=0.5, friction=0.6, starts=1)
    assert gait.step_length / gait.step_duration == pytest.approx(0.5, rel=1e-7)


def test_what_makes_no_sense_on_points(rabbit: hs.Robot, rabbit_gait: hs.Gait) -> None:
    with pytest.raises(GaitError, match="zmp_margin means nothing"):
        hs.optimize_gait(rabbit, step_length=0.2, step_duration=0.6, zmp_margin=0.01)
    with pytest.raises(GaitError, match="no single set of coefficients"):
        _ = rabbit_gait.coefficients


@pytest.mark.slow
def test_an_impossible_gait_is_told(rabbit: hs.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SETTINGS, "max_iter", 30)  # more would only take longer
    with pytest.raises(InfeasibleGaitError, match=r"friction = 0 was found.* friction cone of the"):
        hs.optimize_gait(rabbit, **{**STEP, "friction": 0.0})


def test_where_a_joint_counts_from_is_nothing_to_the_gait(
    rabbit: hs.Robot, rabbit_gait: hs.Gait
) -> None:
    """One knee's angle is zero elsewhere than the other's: the same walk in other numbers."""
    shift = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    model = rabbit.model.replaced(
        reference=rabbit.model.reference + shift,
        lower=rabbit.model.lower + shift,
        upper=rabbit.model.upper + shift,
    )
    gait = hs.optimize_gait(dataclasses.replace(rabbit, model=model), **STEP)
    assert gait.cost == pytest.approx(rabbit_gait.cost, rel=1e-6)
    times = np.linspace(0.0, 1.2, 9)  # two steps
    moved = shift[rabbit.model.actuator_joint]
    np.testing.assert_allclose(gait.position(times), rabbit_gait.position(times) + moved, atol=1e-5)


def test_where_no_gait_keeps_above_the_parabola_the_smooth_hump_is_tried(
    rabbit: hs.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = Program.solve

    def only_smooth(program: Program, guess: np.ndarray) -> Solution:
        if program.profile is ClearanceProfile.PARABOLA:
            raise InfeasibleGaitError("no")
        return solve(program, guess)

    monkeypatch.setattr(Program, "solve", only_smooth)
    told: list[float] = []
    gait = hs.optimize_gait(rabbit, **STEP, progress=told.append)
    assert gait.clearance_profile is ClearanceProfile.SMOOTH
    assert told == sorted(told)  # though the work begins again
    assert told[0] < 0.2
    assert told[-1] == 1.0


def test_a_robot_s_own_speed_limits_hold(rabbit: hs.Robot, rabbit_gait: hs.Gait) -> None:
    """Where the free gait is fastest, nine tenths of that speed are allowed."""

    times = np.linspace(0.0, rabbit_gait.step_duration, 5001)

    def fastest(gait: hs.Gait) -> float:
        return float(np.abs(gait.in_step(times, order=1)).max())

    limit = 0.9 * fastest(rabbit_gait)
    model = rabbit.model.replaced(speed_limit=np.full(rabbit.nv, limit))
    gait = hs.optimize_gait(dataclasses.replace(rabbit, model=model), **STEP)
    # Not only at the Gauss points, between which and the end the gait without limits is fastest.
    assert fastest(gait) <= limit * (1.0 + 1e-6)
    assert gait.cost > rabbit_gait.cost


@pytest.mark.slow
def test_a_gait_keeps_to_the_lines_of_the_motors(rabbit: hs.Robot, rabbit_gait: hs.Gait) -> None:
    """Motors too slow for the gait that knows nothing of them: -τ₀ ≤ τ + τ₀/ω₀ ω ≤ τ₀."""
    lines = {"stall_torque": np.full(7, 12.0), "no_load_speed": np.full(7, 3.0)}
    slow = dataclasses.replace(rabbit, model=rabbit.model.replaced(**lines))
    times = gauss_times(rabbit_gait)
    beyond = [needed.torque_excess.max() for _, needed in forces(slow, rabbit_gait, times)]
    assert max(beyond) > 0.1
    gait = hs.optimize_gait(slow, **STEP)
    found = list(forces(slow, gait, gauss_times(gait)))
    assert max(needed.torque_excess.max() for _, needed in found) <= 1e-6
    assert 0.0 <= gait.margins.torque <= 0.1
    assert gait.cost > rabbit_gait.cost
