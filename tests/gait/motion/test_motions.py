"""Motions of several phases, judged by equations of motion that share no code with their design."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait import MotionPhase
from heelstrike.gait.polynomials import gauss

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

STEEP = 0.08
GENTLE = 0.1
"""Impulse (N s) of a foot that is set down at rest: rounding decides when."""


@pytest.fixture(scope="module")
def rabbit() -> hs.Robot:
    return hs.load_robot("rabbit")


@pytest.fixture(scope="module")
def running(rabbit: hs.Robot) -> hs.Motion:
    phases = [
        hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
        hs.ContactPhase(duration=(0.05, 0.3), pieces=3),
    ]
    return hs.optimize_motion(rabbit, phases, speed=2.0, starts=1)


@pytest.fixture(scope="module")
def uphill(bravo7: hs.Robot) -> hs.Motion:
    phases = [hs.ContactPhase("right_foot", duration=0.7, pieces=4)]
    return hs.optimize_motion(bravo7, phases, distance=0.25, slope=STEEP, starts=1)


@pytest.fixture(scope="module")
def limping(rabbit: hs.Robot) -> hs.Motion:
    phases = [
        hs.ContactPhase("right_tibia", duration=(0.55, 0.8)),
        hs.ContactPhase("left_tibia", duration=(0.2, 0.5)),
    ]
    return hs.optimize_motion(rabbit, phases, distance=0.5, duration=1.0, repeat="same", starts=1)


@pytest.fixture(scope="module")
def rising(bravo7: hs.Robot) -> hs.Motion:
    """From bent knees on both feet to nearly straight ones."""
    low, high = (crouched(bravo7, knee) for knee in (0.9, 0.3))
    both = hs.ContactPhase("right_foot", "left_foot", duration=(0.5, 0.9), pieces=4)
    return hs.optimize_motion(bravo7, [both], repeat="never", start=low, end=high, starts=1)


@pytest.fixture(scope="module")
def planned(bravo7: hs.Robot) -> hs.Motion:
    """No optimum: planned by its zero moment point."""
    return hs.plan_motion(bravo7, step_length=0.3, step_duration=0.7)


def crouched(robot: hs.Robot, knee: float) -> hs.State:
    """Standing still on both flat feet, their soles at the origin."""
    q = robot.reference_state().q.copy()
    for side in ("right", "left"):
        for name, angle in (("hip", -knee / 2.0), ("knee", knee), ("ankle", -knee / 2.0)):
            q[robot.joint_names.index(f"{side}_{name}")] += angle
    q[:2] -= dynamics.contact_positions(robot, q).mean(axis=0)
    assert np.ptp(dynamics.contact_positions(robot, q)[:, 1]) < 1e-9
    return hs.State(q, np.zeros(robot.nv))


MOTIONS = ("running", "uphill", "limping", "rising", "planned")


def robot_of(name: str, request: pytest.FixtureRequest) -> hs.Robot:
    robot: hs.Robot = request.getfixturevalue(
        "rabbit" if name in ("running", "limping") else "bravo7"
    )
    return robot


def frame(motion: hs.Motion) -> np.ndarray:
    """Rows: away from the ground, along it."""
    cosine, sine = np.cos(motion.slope), np.sin(motion.slope)
    return np.array([[-sine, cosine], [cosine, sine]])


def gauss_times(phase: MotionPhase) -> np.ndarray:
    nodes, _ = gauss(phase.force.shape[1])
    begins = phase.breakpoints[:-1, None]
    return np.asarray(begins + np.diff(phase.breakpoints)[:, None] * nodes).ravel()


@pytest.mark.parametrize("name", MOTIONS)
def test_equations_of_motion_hold(name: str, request: pytest.FixtureRequest) -> None:
    """A v̇ + H = forces, on the coordinates without a motor, at the Gauss points."""
    motion, robot = request.getfixturevalue(name), robot_of(name, request)
    free = np.setdiff1d(np.arange(robot.nv), robot.model.actuator_joint)
    for phase in motion.phases:
        times = gauss_times(phase)
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        for q, v, a, force in zip(*moved, phase.forces(times), strict=True):
            needed = dynamics.mass_matrix(robot, q) @ a + dynamics.bias_force(robot, q, v)
            needed -= dynamics.passive_force(robot, q, v)
            for i, pushed in enumerate(force @ frame(motion)):
                link = int(robot.model.contact_link[i])
                local = robot.model.contact_position[i]
                needed -= dynamics.point_jacobian(robot, q, link, local)[:2].T @ pushed
            assert np.abs(needed[free]).max() < 1e-6 * robot.weight


@pytest.mark.parametrize("name", MOTIONS)
def test_what_stands_stays(name: str, request: pytest.FixtureRequest) -> None:
    """Points that stand neither slide nor leave, at any time: to the order of the method."""
    motion, robot = request.getfixturevalue(name), robot_of(name, request)
    for phase in motion.phases:
        points = [robot.contact_names.index(each) for each in phase.contacts]
        if not points:
            continue
        places = np.array(
            [
                dynamics.contact_positions(robot, q)[points]
                for q in phase.coordinates(np.linspace(0.0, phase.duration, 50))
            ]
        )
        assert np.ptp(places, axis=0).max() < 2e-5
        heights = places @ frame(motion)[0]
        assert np.ptp(heights) < 2e-5


@pytest.mark.parametrize("name", MOTIONS)
def test_the_ground_pushes_inside_its_cone(name: str, request: pytest.FixtureRequest) -> None:
    motion, robot = request.getfixturevalue(name), robot_of(name, request)
    for phase in motion.phases:
        force = phase.forces(np.linspace(0.0, phase.duration, 60))
        assert force[..., 0].min() > -1e-5 * robot.weight
        for foot in robot.feet:
            normal, tangent = force[:, list(foot.contacts)].sum(axis=1).T
            assert np.all(np.abs(tangent) <= motion.friction * normal + 1e-5 * robot.weight)
        stands = [robot.contact_names.index(each) for each in phase.contacts]
        assert not force[:, np.setdiff1d(np.arange(robot.nc), stands)].any()


def test_momentum_through_a_landing(rabbit: hs.Robot, running: hs.Motion) -> None:
    """A (v⁺ − v⁻) is what the impulse of the landing point makes, and the point stops."""
    last = running.phases[-1]
    q, before = (last.coordinates(last.duration, order=order) for order in range(2))
    after = running.velocity(running.duration)  # of the mirror image that follows
    rows = dynamics.contact_jacobian(rabbit, q)
    pushed = sum(rows[i].T @ last.impulse[i] for i in range(rabbit.nc))
    momentum = dynamics.mass_matrix(rabbit, q) @ (after - before)
    np.testing.assert_allclose(momentum, pushed, atol=1e-6 * rabbit.weight)
    landed = rabbit.contact_names.index("left_tibia_0")
    np.testing.assert_allclose(rows[landed] @ after, 0.0, atol=1e-6)
    assert last.impulse[landed, 0] > 0.0


def test_it_goes_on_with_its_mirror_image(rabbit: hs.Robot, running: hs.Motion) -> None:
    mirror = rabbit.mirror
    assert mirror is not None
    times = np.linspace(0.0, 0.95, 20) * running.duration
    there, later = running.position(times), running.position(times + running.duration)
    later[:, 0] -= running.distance
    np.testing.assert_allclose(later, mirror.position(there), atol=1e-9)
    assert running.speed == pytest.approx(2.0, rel=1e-9)
    twice = running.position(times + 2.0 * running.duration)
    np.testing.assert_allclose(twice[:, 1:], there[:, 1:], atol=1e-9)


def test_one_that_limps_repeats_itself(limping: hs.Motion) -> None:
    later = limping.position(limping.duration + 0.1)
    later[0] -= limping.distance
    np.testing.assert_allclose(later, limping.position(0.1), atol=1e-9)


def test_one_that_never_repeats_begins_and_ends_as_asked(
    bravo7: hs.Robot, rising: hs.Motion
) -> None:
    low, high = (crouched(bravo7, knee) for knee in (0.9, 0.3))
    np.testing.assert_allclose(rising.position(-1.0), low.q, atol=1e-9)
    np.testing.assert_allclose(rising.position(rising.duration + 1.0), high.q, atol=1e-7)
    np.testing.assert_allclose(rising.velocity(rising.duration), 0.0, atol=1e-6)
    np.testing.assert_array_equal(rising.velocity(rising.duration + 1.0), 0.0)


def test_more_freedom_costs_less(bravo7: hs.Robot, gait: hs.Gait) -> None:
    """The cubics of a gait are among the polynomials of a motion, its margins apart."""
    phases = [hs.ContactPhase("right_foot", duration=gait.step_duration, pieces=4)]
    motion = hs.optimize_motion(bravo7, phases, distance=gait.step_length, starts=1)
    assert motion.cost < gait.cost


def test_cost_is_the_integral_of_torque_squared(rabbit: hs.Robot, running: hs.Motion) -> None:
    """By torques of inverse dynamics, integrated by the midpoint rule."""
    total = 0.0
    for phase in running.phases:
        times = phase.duration * (np.arange(400) + 0.5) / 400
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        for q, v, a, force in zip(*moved, phase.forces(times), strict=True):
            needed = dynamics.mass_matrix(rabbit, q) @ a + dynamics.bias_force(rabbit, q, v)
            rows = dynamics.contact_jacobian(rabbit, q)
            needed -= np.einsum("ikj,ik->j", rows, force)
            torque = needed[rabbit.model.actuator_joint]
            total += phase.duration / 400 * float(torque @ torque)
    assert running.cost == pytest.approx(total, rel=1e-4)


def test_saved_and_read_back_unchanged(
    rabbit: hs.Robot, running: hs.Motion, tmp_path: Path
) -> None:
    running.save(tmp_path / "run.json")
    again = hs.load_motion(tmp_path / "run.json", rabbit)
    times = np.linspace(-0.3, 1.2, 40)
    np.testing.assert_array_equal(again.position(times), running.position(times))
    np.testing.assert_array_equal(again.phases[0].force, running.phases[0].force)
    np.testing.assert_array_equal(again.phases[1].impulse, running.phases[1].impulse)
    assert repr(again) == repr(running)
    assert (again.repeat, again.margins) == (running.repeat, running.margins)
    with pytest.raises(hs.GaitError, match="designed for robot 'rabbit'"):
        hs.load_motion(tmp_path / "run.json", hs.load_robot("walker2d"))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"phases": []}, "one ContactPhase or more"),
        ({"phases": [hs.ContactPhase("right_paw")]}, "no foot or contact point 'right_paw'"),
        ({"phases": [hs.ContactPhase()]}, "in which something stands"),
        ({"repeat": "sometimes"}, "'mirrored', 'same', 'never'"),
        ({"repeat": "never", "speed": None}, "needs start, and may have end"),
        ({"speed": None}, "give the distance or the speed"),
        ({"speed": -1.0}, "speed must be a positive number"),
        ({"duration": 0.4, "distance": 0.3}, "not all three"),
        ({"duration": 9.0}, "beyond that"),
        ({"friction": -0.1}, "friction must not be negative"),
        ({"slope": 1.2}, "slope must be between"),
        ({"slope": np.nan}, "slope must be between"),
        ({"distance": "x", "speed": None}, "distance must be a number"),
        ({"distance": (-0.3, 0.3), "speed": None}, "must not have both signs"),
        ({"distance": 9.0, "speed": 0.5}, "the phases last from"),
        ({"starts": 0}, "starts must be from 1"),
        ({"cost": "money"}, "cost must be one of"),
    ],
)
def test_what_makes_no_sense_is_refused(rabbit: hs.Robot, asked: dict, said: str) -> None:
    given = {"phases": [hs.ContactPhase("right_tibia")], "speed": 0.5, **asked}
    with pytest.raises(hs.GaitError, match=said):
        hs.optimize_motion(rabbit, **given)


def test_pieces_may_be_numbers_of_numpy() -> None:
    assert hs.ContactPhase("right_foot", pieces=np.int64(4)).pieces == 4


def test_velocities_repeat_without_a_rest(running: hs.Motion) -> None:
    """Rounding of times that are nearly multiples of the duration stops nothing."""
    times = running.duration * np.arange(1, 200)
    for t in (times, np.nextafter(times, 0.0), np.cumsum(np.full(200, running.duration))):
        assert np.abs(running.velocity(t)[:, 0]).min() > 1.0


def test_a_guess_is_taken_between_two_states_as_well(bravo7: hs.Robot) -> None:
    low, high = (crouched(bravo7, knee) for knee in (0.9, 0.3))
    both = hs.ContactPhase("right_foot", "left_foot", duration=(0.5, 0.9), pieces=4)
    asked = []

    def guess(time: float) -> np.ndarray:
        asked.append(time)
        return low.q + (high.q - low.q) * min(time / 0.5, 1.0)

    hs.optimize_motion(bravo7, [both], repeat="never", start=low, end=high, starts=1, guess=guess)
    assert asked


def test_states_that_do_not_stand_are_refused(bravo7: hs.Robot) -> None:
    """What stands must be on the ground, and be where it was."""
    low, high = (crouched(bravo7, knee) for knee in (0.9, 0.3))
    both = hs.ContactPhase("right_foot", "left_foot", duration=(0.5, 0.9), pieces=4)
    lifted, moved = high.q.copy(), high.q.copy()
    lifted[1] += 0.01
    moved[0] += 0.01
    sliding = high.v.copy()
    sliding[0] = 0.2
    for q, v, said in (
        (lifted, high.v, "0.01 m away from the ground"),
        (moved, high.v, "would have to move by 0.01"),
        (high.q, sliding, "moves at 0.2 m/s"),
    ):
        with pytest.raises(hs.GaitError, match=said):
            hs.optimize_motion(
                bravo7, [both], repeat="never", start=low, end=hs.State(q, v), starts=1
            )


@pytest.mark.parametrize("duration", ["fast", {}, True, 0.0, (0.3, 0.1), (0.1, 0.2, 0.3), np.nan])
def test_durations_are_refused(duration: object) -> None:
    with pytest.raises(hs.GaitError, match="duration of a phase"):
        hs.ContactPhase("right_foot", duration=duration)  # type: ignore[arg-type]


def test_what_is_not_found_names_its_constraints(rabbit: hs.Robot) -> None:
    """Two metres of a step with legs of 0.8 m."""
    phases = [hs.ContactPhase("right_tibia", duration=0.6, pieces=4)]
    with pytest.raises(hs.GaitNotFoundError, match="does not mean that there is none") as caught:
        hs.optimize_motion(rabbit, phases, distance=2.0, starts=1)
    assert "in phase 1" in str(caught.value)


# Followed by MotionTracking


def followed(
    robot: hs.Robot, motion: hs.Motion, method: object, cycles: float = 1.0, **gains: float
) -> hs.Run:
    run = hs.simulate(
        robot,
        hs.MotionTracking(robot, motion, **gains),
        state=motion.initial_state,
        duration=cycles * motion.duration,
        method=method,
        ground=hs.Ground(friction=motion.friction, slope=motion.slope),
    )
    assert run.completed, run.message
    return run


def largest_error(run: hs.Run, motion: hs.Motion) -> float:
    """Of a coordinate in the first cycle, at rows that are not just at a touchdown."""
    apart = run.time < motion.duration
    apart &= np.abs(run.time % motion.duration - motion.duration) > 1e-4
    return float(np.abs(run.position - motion.position(run.time))[apart].max())


@pytest.mark.parametrize("name", MOTIONS)
def test_event_driven_it_moves_as_designed(name: str, request: pytest.FixtureRequest) -> None:
    """In each phase what is to stand stands, and phases end when they are to end."""
    motion, robot = request.getfixturevalue(name), robot_of(name, request)
    run = followed(robot, motion, hs.EventDriven(rtol=1e-9, atol=1e-11), 1.05)
    assert largest_error(run, motion) < 3e-5
    down = [e.time for e in run.events if e.kind is hs.sim.EventKind.TOUCHDOWN]
    planned = [
        end
        for end, phase in zip(motion.ends, motion.phases, strict=True)
        if np.abs(phase.impulse).max() > GENTLE and end < run.time[-1] - 1e-9
    ]
    assert planned or name in ("rising", "planned")
    for end in planned:
        assert min(abs(t - end) for t in down) < 1e-5
    for end, phase in zip(motion.ends, motion.phases, strict=True):
        row = np.searchsorted(run.time, end - 0.5 * phase.duration)
        touching = {robot.contact_names[i] for i in np.flatnonzero(run.contact_force[row, :, 0])}
        assert touching == set(phase.contacts)


def test_time_stepping_comes_near(limping: hs.Motion, rabbit: hs.Robot) -> None:
    """The difference falls with the step."""
    errors = [
        largest_error(followed(rabbit, limping, hs.TimeStepping(step=step), 0.95), limping)
        for step in (1e-3, 2.5e-4)
    ]
    assert errors[0] < 0.02
    assert errors[1] < 0.4 * errors[0]


def test_two_feet_share_the_load_as_the_motion_says(bravo7: hs.Robot, rising: hs.Motion) -> None:
    """Normal forces of each foot follow the motion's, though the feet could share otherwise."""
    run = followed(bravo7, rising, hs.EventDriven(), 0.99)
    rows = np.flatnonzero((run.time > 0.05) & (run.time < 0.95 * rising.duration))[::5]
    wanted = rising.phases[0].forces(run.time[rows])
    for foot in bravo7.feet:
        points = list(foot.contacts)
        found = run.contact_force[rows][:, points, 0].sum(axis=1)
        np.testing.assert_allclose(found, wanted[:, points, 0].sum(axis=1), atol=1.0)


def test_feedback_brings_joints_back(bravo7: hs.Robot, uphill: hs.Motion) -> None:
    """Joints of a flat foot obey ë + kd ė + kp e = 0, whatever the motion."""
    state = uphill.initial_state
    knee = int(bravo7.model.actuator_joint[-2])  # of the leg in the air
    v = state.v.copy()
    rises = dynamics.contact_jacobian(bravo7, state.q)[-1, 0, knee]
    faster = 0.05 * float(np.sign(rises))
    v[knee] += faster
    law = hs.MotionTracking(bravo7, uphill, kp=400.0, kd=40.0)
    ground = hs.Ground(friction=uphill.friction, slope=uphill.slope)
    start, method = hs.State(state.q, v), hs.EventDriven()
    run = hs.simulate(bravo7, law, state=start, duration=0.1, method=method, ground=ground)
    gone = run.position[:, knee] - uphill.position(run.time)[:, knee]
    critical = faster * run.time * np.exp(-20.0 * run.time)
    assert np.abs(critical).max() > 9e-4
    np.testing.assert_allclose(gone, critical, atol=1e-5)


def test_a_motion_of_another_robot_is_refused(running: hs.Motion, bravo7: hs.Robot) -> None:
    with pytest.raises(hs.GaitError, match="designed for robot 'rabbit'"):
        hs.MotionTracking(bravo7, running)


@pytest.mark.parametrize("name", ["robot", "motion", "kp", "kd"])
def test_other_things_are_refused_by_name(rabbit: hs.Robot, running: hs.Motion, name: str) -> None:
    for wrong in (None, "0.5", [1, 2]):
        given = {"robot": rabbit, "motion": running, name: wrong}
        with pytest.raises(hs.HeelstrikeError, match=rf"\b{name}\b"):
            hs.MotionTracking(**given)
