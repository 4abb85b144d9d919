"""The optimised gaits: cost, constraints at all times, periodicity, and requests that fail."""

from __future__ import annotations

import dataclasses
import math
import re
import threading
from functools import cache
from typing import Any

import numpy as np
import pytest
from gait_motion import (
    Instant,
    contact_heights,
    contact_rates,
    foot_jacobian,
    instant,
    place,
)
from robot_cases import builtin_xml

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait import ClearanceProfile, design
from heelstrike.gait.program import Solution
from heelstrike.robot import read_mjcf

# Length (m), duration (s) and cost (N²m²s) of gaits found for bravo7 by others before
# (reference/robots.md), with a swing clearance of at least 0.03·4s(1−s) m at 25 intervals.
REFERENCE = [(0.30, 0.70, 90.3), (0.20, 0.80, 84.5), (0.40, 0.60, 305), (0.40, 0.50, 379)]
REFERENCE += [(0.50, 0.60, 901)]

FINE = 521  # points of the check: the optimiser has 27, so that this is more than ten times finer

GAITS: dict[str, dict[str, Any]] = {
    "bravo7": {"step_length": 0.30, "step_duration": 0.70},
    "bravo7 fast": {"step_length": 0.50, "step_duration": 0.60},
    "bravo7 slippery": {"step_length": 0.30, "step_duration": 0.70, "friction": 0.1},
    "bravo7 without impact": {
        "step_length": 0.20,
        "step_duration": 0.80,
        "clearance": 0.01,
        "impact": False,
    },
    "spring_flamingo": {"step_length": 0.40, "step_duration": 0.60, "clearance": 0.01},
    # No gait keeps above a parabola of this height.
    "spring_flamingo higher": {"step_length": 0.40, "step_duration": 0.60},
}


@cache
def designed(robot: str, **request: Any) -> hs.Gait:
    """Gait of a built-in robot."""
    asked = {"starts": 1} | request  # what is asked here holds for any optimum
    return hs.optimize_gait(hs.load_robot(robot), **asked)


@dataclasses.dataclass(frozen=True)
class Walked:
    """A gait with its motion on a fine grid."""

    robot: hs.Robot
    gait: hs.Gait
    phase: np.ndarray
    instants: list[Instant]
    last: Instant


@pytest.fixture(scope="module", params=GAITS)
def walked(request: pytest.FixtureRequest) -> Walked:
    robot = hs.load_robot(request.param.split()[0])
    gait = designed(robot.name, **GAITS[request.param])
    phase = np.linspace(0.0, 1.0, FINE)
    last = instant(robot, gait, gait.step_duration, end=True)
    instants = [instant(robot, gait, s * gait.step_duration) for s in phase[:-1]]
    return Walked(robot, gait, phase, [*instants, last], last)


@pytest.mark.parametrize(("length", "duration", "cost"), REFERENCE)
def test_no_worse_than_the_reference(
    bravo7: hs.Robot, length: float, duration: float, cost: float
) -> None:
    gait = designed("bravo7", step_length=length, step_duration=duration, starts=3)
    assert gait.cost <= cost
    assert gait.clearance_profile is ClearanceProfile.PARABOLA
    # The reference's own clearance holds at its nodes: the profile is rounded off before them.
    for s in np.arange(1, 25) / 25:
        heights = contact_heights(bravo7, instant(bravo7, gait, s * duration).q, 1)
        assert heights.min() >= 0.03 * 4.0 * s * (1.0 - s)


def test_cost_is_the_integral_of_the_squared_torques(walked: Walked) -> None:
    effort = np.array([i.torque @ i.torque for i in walked.instants])
    weights = np.ones(FINE)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    simpson = walked.gait.step_duration * (weights @ effort) / (3.0 * (FINE - 1))
    assert walked.gait.cost == pytest.approx(simpson, rel=1e-8)


def test_where_a_joint_counts_from_is_nothing_to_the_gait(bravo7: hs.Robot, gait: hs.Gait) -> None:
    """One knee's angle is zero elsewhere than the other's: the same walk in other numbers."""
    shift = np.zeros(9)
    shift[4] = 0.3
    model = bravo7.model.replaced(
        reference=bravo7.model.reference + shift,
        lower=bravo7.model.lower + shift,
        upper=bravo7.model.upper + shift,
    )
    robot = dataclasses.replace(bravo7, model=model)
    found = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    assert found.cost == pytest.approx(gait.cost, rel=1e-6)
    times = np.linspace(0.0, 1.4, 9)  # two steps
    moved = shift[bravo7.model.actuator_joint]
    np.testing.assert_allclose(found.position(times), gait.position(times) + moved, atol=1e-5)


@pytest.mark.parametrize("asked", [{"step_length": 0.25}, {"speed": 0.4}], ids=str)
def test_cost_of_a_free_step_is_that_of_the_step(bravo7: hs.Robot, asked: dict[str, Any]) -> None:
    """Its cost per metre is what was least; what is told is ∫ΓᵀΓ dt all the same."""
    gait = hs.optimize_gait(bravo7, **asked, starts=1)
    assert abs(gait.step_length - 1.0) > 0.1  # no metre, which would be the same
    nodes, weights = np.polynomial.legendre.leggauss(24)
    times = 0.5 * gait.step_duration * (nodes + 1.0)
    effort = [torque @ torque for torque in (instant(bravo7, gait, t).torque for t in times)]
    assert gait.cost == pytest.approx(0.5 * gait.step_duration * (weights @ effort), rel=1e-6)


def test_forces_at_all_times(walked: Walked) -> None:
    robot, gait = walked.robot, walked.gait
    x, z, moment = np.array([i.wrench for i in walked.instants]).T
    assert z.min() >= 0.1 * robot.weight
    assert (np.abs(x) / z).max() <= gait.friction
    contacts = list(robot.feet[0].contacts)
    half = 0.5 * np.ptp(robot.model.contact_position[contacts, 0])
    assert np.abs(-moment / z).max() <= half - 0.2 * half  # a tenth of the sole from its ends
    margins = gait.margins
    assert margins.normal_force == pytest.approx(z.min(), rel=1e-4)
    assert margins.friction_use == pytest.approx((np.abs(x) / z).max() / gait.friction, rel=1e-4)
    assert margins.zero_moment_point == pytest.approx(half - np.abs(moment / z).max(), abs=1e-5)


def test_swing_foot_above_its_profile_at_all_times(walked: Walked) -> None:
    gait = walked.gait
    heights = np.array([contact_heights(walked.robot, i.q, 1) for i in walked.instants])
    above = heights.min(axis=1) - gait.clearance * gait.clearance_profile.height(walked.phase)
    # One micrometre is kept in reserve at the optimiser's grid for what lies between its nodes.
    assert above[1:-1].min() >= 0.0
    assert gait.margins.clearance >= 0.0
    assert gait.margins.clearance == pytest.approx(above[1:-1].min(), abs=2e-6)


def test_joint_ranges_and_torque_limits_at_all_times(walked: Walked) -> None:
    model = walked.robot.model
    q = np.array([i.q for i in walked.instants])
    assert np.all(q >= model.lower)
    assert np.all(q <= model.upper)
    torque = np.array([i.torque for i in walked.instants])
    assert np.all(torque >= model.torque_lower)
    assert np.all(torque <= model.torque_upper)
    assert walked.gait.margins.peak_torque == pytest.approx(np.abs(torque).max(), rel=1e-4)


def test_touchdown_one_step_ahead_and_flat(walked: Walked) -> None:
    robot, gait, q = walked.robot, walked.gait, walked.last.q
    np.testing.assert_allclose(place(robot, q, 1), [gait.step_length, 0.0], atol=1e-12)
    np.testing.assert_allclose(contact_heights(robot, q, 1), 0.0, atol=1e-12)
    assert contact_rates(robot, q, walked.last.v, 1).max() <= 1e-12


def test_the_impact_gives_the_next_steps_velocity(walked: Walked) -> None:
    """Eq. 22 in closed form, mirrored, is the velocity at which the step began."""
    robot, gait, q, v = walked.robot, walked.gait, walked.last.q, walked.last.v
    jacobian = foot_jacobian(robot, q, 1)
    inverse = np.linalg.inv(dynamics.mass_matrix(robot, q))
    impulse = -np.linalg.solve(jacobian @ inverse @ jacobian.T, jacobian @ v)
    after = v + inverse @ jacobian.T @ impulse
    mirror = robot.mirror
    assert mirror is not None
    mirrored = mirror.sign * after[mirror.joint]
    np.testing.assert_allclose(mirrored, gait.initial_state.v, atol=1e-10)
    joints = robot.model.actuator_joint
    np.testing.assert_allclose(mirrored[joints], gait.start_velocity, atol=1e-10)
    x, z, moment = impulse
    np.testing.assert_allclose(gait.touchdown_impulse, [z, x, moment], atol=1e-10)
    assert contact_rates(robot, q, after, 0).min() >= -2e-6  # the rear foot's stated tolerance
    if gait.margins.impulse > 0.0:
        assert z > 0.0
        assert abs(x) <= gait.friction * z * (1.0 + 1e-5)
        assert abs(moment / z) <= sole_half(robot)
    else:
        np.testing.assert_allclose(impulse, 0.0, atol=1e-9)
        np.testing.assert_allclose(after, v, atol=1e-9)


def sole_half(robot: hs.Robot) -> float:
    return 0.5 * float(np.ptp(robot.model.contact_position[list(robot.feet[0].contacts), 0]))


def test_the_contact_problem_agrees_that_the_rear_foot_lifts(
    bravo7: hs.Robot, gait: hs.Gait
) -> None:
    """All four vertices may take an impulse: only those of the landing foot do (eq. 20-22)."""
    last = instant(bravo7, gait, gait.step_duration, end=True)
    rows = []
    for link, local in zip(bravo7.model.contact_link, bravo7.model.contact_position, strict=True):
        x_row, z_row, _ = dynamics.point_jacobian(bravo7, last.q, int(link), local)
        rows += [z_row, x_row]
    jacobian = np.array(rows)
    inverse = np.linalg.inv(dynamics.mass_matrix(bravo7, last.q))
    solved = hs.solve_contact(jacobian @ inverse @ jacobian.T, jacobian @ last.v, gait.friction)
    impulse = solved.impulse
    np.testing.assert_allclose(impulse[:2], 0.0, atol=1e-8)
    assert impulse[:, 0].sum() == pytest.approx(gait.touchdown_impulse[0], rel=1e-8)
    assert impulse[:, 1].sum() == pytest.approx(gait.touchdown_impulse[1], rel=1e-8)


def test_initial_state_stands_on_both_feet(walked: Walked) -> None:
    robot, gait, state = walked.robot, walked.gait, walked.gait.initial_state
    np.testing.assert_allclose(place(robot, state.q, 0), 0.0, atol=1e-12)
    np.testing.assert_allclose(place(robot, state.q, 1), [-gait.step_length, 0.0], atol=1e-12)
    for foot in range(2):
        np.testing.assert_allclose(contact_heights(robot, state.q, foot), 0.0, atol=1e-12)
    np.testing.assert_allclose(foot_jacobian(robot, state.q, 0) @ state.v, 0.0, atol=1e-12)
    joints = robot.model.actuator_joint
    np.testing.assert_allclose(state.q[joints], gait.start_position, atol=1e-15)
    np.testing.assert_allclose(state.v[joints], gait.start_velocity, atol=1e-15)


def test_the_body_moves_one_step_length_a_step(walked: Walked) -> None:
    start, end = walked.gait.initial_state.q, walked.last.q
    assert end[0] - start[0] == pytest.approx(walked.gait.step_length, abs=1e-10)
    np.testing.assert_allclose(end[1:3], start[1:3], atol=1e-10)


@pytest.mark.usefixtures("afresh")
def test_same_request_same_numbers(bravo7: hs.Robot, gait: hs.Gait) -> None:
    """In a thread, too, where Ctrl-C is not looked for; and the progress that is told."""
    found, told = list[hs.Gait](), list[float]()

    def design() -> None:
        step: dict[str, Any] = {"step_length": 0.30, "step_duration": 0.70, "friction": 0.75}
        found.append(hs.optimize_gait(bravo7, **step, progress=told.append))

    thread = threading.Thread(target=design)
    thread.start()
    thread.join()
    (again,) = found
    np.testing.assert_array_equal(again.coefficients, gait.coefficients)
    assert again.margins == gait.margins
    assert told == sorted(told)
    assert told[0] < 0.2
    assert told[-1] == 1.0


def test_joints_of_other_senses_and_orders_make_no_difference(gait: hs.Gait) -> None:
    """The same robot described otherwise: left joints reversed, motors in another order."""
    xml = builtin_xml("bravo7")
    ranges = {"hip": "-90 90", "knee": "-130 10", "ankle": "-60 60"}
    for joint, span in ranges.items():
        xml = xml.replace(
            f'<joint name="left_{joint}" class="{joint}"/>',
            f'<joint name="left_{joint}" class="{joint}" axis="0 -1 0" range="{span}"/>',
        )
    actuators = re.findall(r"\s*<motor name=.*/>", xml)
    assert len(actuators) == 6
    for line in actuators:
        xml = xml.replace(line, "", 1)
    xml = xml.replace(
        "<actuator>", "<actuator>" + "".join(actuators[k] for k in (4, 0, 5, 2, 1, 3))
    )
    robot = read_mjcf(xml, name="bravo7 otherwise")
    assert robot.mirror is not None
    assert set(robot.mirror.sign[3:]) == {-1.0}
    other = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    assert other.cost == pytest.approx(gait.cost, rel=1e-6)
    assert other.joint_names == tuple(gait.joint_names[k] for k in (4, 0, 5, 2, 1, 3))
    sense = [-1.0 if name.startswith("left") else 1.0 for name in other.joint_names]
    for t in (0.0, 0.35, 1.0):
        expected = sense * gait.position(t)[[4, 0, 5, 2, 1, 3]]
        np.testing.assert_allclose(other.position(t), expected, atol=1e-4)
    end = instant(robot, other, other.step_duration, end=True)
    np.testing.assert_allclose(place(robot, end.q, 1), [0.3, 0.0], atol=1e-12)


@pytest.mark.slow
def test_the_optimiser_chooses_the_step_for_a_speed(bravo7: hs.Robot, gait: hs.Gait) -> None:
    speed = gait.step_length / gait.step_duration
    chosen = hs.optimize_gait(bravo7, speed=speed, friction=0.75, starts=1)
    assert chosen.step_length / chosen.step_duration == pytest.approx(speed, rel=1e-9)
    assert chosen.cost / chosen.step_length < gait.cost / gait.step_length
    free = hs.optimize_gait(bravo7, starts=1)
    assert free.cost / free.step_length < chosen.cost / chosen.step_length


def test_speed_with_length_or_duration_fixes_the_step(bravo7: hs.Robot, gait: hs.Gait) -> None:
    by_length = hs.optimize_gait(bravo7, speed=0.3 / 0.7, step_length=0.3, starts=1)
    by_duration = hs.optimize_gait(bravo7, speed=0.3 / 0.7, step_duration=0.7, starts=1)
    for found in (by_length, by_duration):
        assert found.step_length == pytest.approx(0.3, rel=1e-12)
        assert found.step_duration == pytest.approx(0.7, rel=1e-12)
        assert found.cost == pytest.approx(gait.cost, rel=1e-6)


@pytest.mark.slow
def test_options_tighten_what_they_name(bravo7: hs.Robot, gait: hs.Gait) -> None:
    step: dict[str, Any] = {"step_length": 0.30, "step_duration": 0.70, "starts": 1}
    fastest = np.abs(gait.velocity(np.linspace(0.0, 0.7, 200, endpoint=False))).max()
    slow = hs.optimize_gait(bravo7, joint_speed_limit=0.9 * fastest, **step)
    assert np.abs(slow.velocity(np.linspace(0.0, 0.699, 999))).max() <= 0.9 * fastest
    centred = hs.optimize_gait(bravo7, zmp_margin=0.09, **step)
    assert centred.margins.zero_moment_point >= 0.09
    assert centred.margins.impulse_center >= 0.09 - 1e-7
    heavy = hs.optimize_gait(bravo7, force_margin=680.0, **step)
    assert heavy.margins.normal_force >= 680.0
    high = hs.optimize_gait(bravo7, clearance=0.06, **step)
    assert high.clearance == 0.06
    for found in (slow, centred, heavy, high):
        assert found.cost > gait.cost


def test_a_profile_that_no_gait_keeps_above_gives_way_to_the_smooth_one() -> None:
    for name, profile in (
        ("spring_flamingo", ClearanceProfile.PARABOLA),
        ("spring_flamingo higher", ClearanceProfile.SMOOTH),
    ):
        gait = designed("spring_flamingo", **GAITS[name])
        assert gait.clearance_profile is profile


# One profile alone: trying two takes twice as long to find that there is no gait.
SMOOTH = {"step_length": 0.3, "step_duration": 0.70, "clearance_profile": "smooth"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("request_", "named"),
    [
        (SMOOTH | {"step_duration": 0.12}, ["friction cone of the landing impulse"]),
        (SMOOTH | {"step_length": 1.2}, ["joint range", "torque limit"]),
        ({"step_length": 0.3, "step_duration": 0.70, "clearance": 0.6}, ["clearance"]),
        ({"speed": 4.0, "clearance_profile": "smooth"}, ["zero moment point", "m in"]),
    ],
)
def test_infeasible_requests_name_the_constraints_in_conflict(
    bravo7: hs.Robot, request_: dict[str, Any], named: list[str]
) -> None:
    with pytest.raises(hs.GaitNotFoundError, match=r"not prove .* violates") as caught:
        hs.optimize_gait(bravo7, **request_, starts=1)
    message = str(caught.value)
    assert "bravo7" in message
    for name, value in request_.items():
        if not name.startswith("clearance"):
            assert f"{name} = {value:g}" in message
    for words in named:
        assert words in message
    assert re.search(r"by \d[\d.e-]* (N|m|rad)", message)


def test_a_step_beyond_the_legs_tells_their_reach(bravo7: hs.Robot) -> None:
    with pytest.raises(InfeasibleGaitError, match=r"less than 1\.768 m apart") as caught:
        hs.optimize_gait(bravo7, step_length=2.0, step_duration=0.7)
    assert not isinstance(caught.value, hs.GaitNotFoundError)  # it is proved


@pytest.mark.slow
def test_a_step_on_slippery_ground_is_found_from_a_point_that_satisfies_all(
    spring_flamingo: hs.Robot,
) -> None:
    """The first starting point leads nowhere there, and a falling barrier misses the optimum."""
    gait = hs.optimize_gait(
        spring_flamingo, step_length=0.27, step_duration=0.67, clearance=0.027, friction=0.3
    )
    assert gait.optimal
    assert gait.margins.impulse_friction_use == pytest.approx(1.0, abs=1e-4)
    assert gait.margins.friction_use <= 1.0


@pytest.mark.slow
def test_an_optimum_that_the_coarse_grid_does_not_have_is_found(spring_flamingo: hs.Robot) -> None:
    """All starts lead to one of 236.6 there; request 88 of benchmarks/gait_requests.py."""
    gait = hs.optimize_gait(
        spring_flamingo, step_length=0.28793738728, step_duration=0.71008561412, clearance=0.027,
        friction=0.72887799,
    )  # fmt: skip
    assert gait.optimal
    assert gait.cost < 201.0


def test_optima_agree_that_cost_the_same() -> None:
    def at(cost: float, converged: bool = True) -> Solution:
        return Solution(np.ones(3), cost, converged, "", np.zeros(0))

    assert design._agree([at(200.0), at(200.0001)])
    assert not design._agree([at(200.0), at(200.001)])
    assert not design._agree([at(200.0), at(200.0, False)])
    assert not design._agree([at(200.0)])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"step_length": 0.0}, "step_length must be a positive number"),
        ({"step_length": -0.3}, "step_length must be a positive number"),
        ({"step_length": math.nan}, "step_length must be a positive number"),
        ({"step_length": "0.3"}, "step_length must be a number or None"),
        ({"step_duration": 0.0}, "step_duration must be a positive number"),
        ({"step_duration": math.inf}, "step_duration must be a positive number"),
        ({"step_duration": 1e-6}, "steps between"),
        ({"step_duration": 1e3}, "steps between"),
        ({"speed": -1.0}, "speed must be a positive number"),
        ({"step_length": 0.3, "step_duration": 0.7, "speed": 1.0}, "give two of them"),
        ({"friction": -0.1}, "friction must be a number that is not negative"),
        ({"friction": math.nan}, "friction must be a number that is not negative"),
        ({"friction": True}, "friction must be a number, got True"),
        ({"clearance": -0.01}, "clearance must be"),
        ({"clearance_profile": "triangle"}, "'parabola', 'smooth'"),
        ({"zmp_margin": 0.1}, "the sole reaches only"),
        ({"force_margin": 1e4}, "more than the robot's weight"),
        ({"joint_speed_limit": 0.0}, "joint_speed_limit must be"),
        ({"intervals": 3}, "intervals must be between"),
        ({"intervals": 26.5}, "intervals must be a whole number"),
        ({"starts": 0}, "starts must be between"),
    ],
)
def test_senseless_arguments_are_refused(
    bravo7: hs.Robot, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(GaitError, match=re.escape(message)):
        hs.optimize_gait(bravo7, **options)


def test_unknown_options_are_refused(bravo7: hs.Robot) -> None:
    with pytest.raises(TypeError, match="step_lenght"):
        hs.optimize_gait(bravo7, step_lenght=0.3)  # type: ignore[call-arg]


def robot_without(robot: hs.Robot, what: str) -> hs.Robot:
    if what == "floating trunk":
        return dataclasses.replace(robot, floating=False)
    if what == "second foot":
        return dataclasses.replace(robot, feet=robot.feet[:1])
    if what == "symmetry":
        return dataclasses.replace(robot, mirror=None)
    if what == "motor":
        model = robot.model.replaced(
            actuator_joint=robot.model.actuator_joint[:-1],
            torque_lower=robot.model.torque_lower[:-1],
            torque_upper=robot.model.torque_upper[:-1],
        )
        return dataclasses.replace(robot, model=model)
    if what == "gravity":
        return dataclasses.replace(robot, model=robot.model.replaced(gravity=np.zeros(2)))
    assert what == "contact points"
    model = robot.model.replaced(
        contact_link=np.zeros(0, np.int64),
        contact_position=np.zeros((0, 2)),
        contact_radius=np.zeros(0),
        friction_scale=np.zeros(0),
        restitution_scale=np.zeros(0),
    )
    return dataclasses.replace(robot, model=model, feet=())


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("floating trunk", "no floating trunk"),
        ("second foot", "1 feet"),
        ("symmetry", "not symmetric"),
        ("motor", "without one: left_ankle"),
        ("gravity", "needs it to point down"),
        ("contact points", "no contact points"),
    ],
)
def test_robots_that_cannot_walk_are_refused(bravo7: hs.Robot, what: str, message: str) -> None:
    with pytest.raises(GaitError, match=message):
        hs.optimize_gait(robot_without(bravo7, what), step_length=0.3, step_duration=0.7)
