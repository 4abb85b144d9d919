"""Points, soles and discs in concave corners of the ground, by hand calculation, under all methods.

A point mass m that slides along a floor with friction μ loses μ g of speed a second; a wall gives
it back e times what is left. In a frictionless valley, whose sides meet at an angle, each plastic
impact leaves cos(angle) of the speed: a geometric series with an end. A disc that rolls into a wall
climbs it: friction with the wall lifts it and takes its spin.

Event-driven these hold to the tolerance of the integration, 1e-8. Time stepping comes to them with
its step, and compliant ground with its stiffness.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import EventKind, Push

G, MASS = 9.81, 2.0
WALL = ((-1.0, 0.0), (0.0, 0.0), (0.0, 0.5), (1.0, 0.5))
GROOVE = ((-1.0, 1.0), (0.0, 0.0), (2.0, 1.0))
"""45° down, 26.6° up: x + z = 0 and z = x / 2."""
RIGHT_ANGLE = ((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0))
EXACT = hs.EventDriven(rtol=1e-10, atol=1e-12)


def puck() -> hs.Robot:
    builder = hs.RobotBuilder("puck", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    builder.contact(builder.slide("z", rail, direction=(0, 1), mass=MASS), (0.0, 0.0))
    return builder.build()


def body(points: list[tuple[float, float]], inertia: float, radius: float = 0.0) -> hs.Robot:
    """Body with its centre of mass where its coordinates are."""
    builder = hs.RobotBuilder("body", gravity=G)
    link = builder.floating_base("body", (0.0, 0.0), mass=MASS, inertia=inertia)
    for point in points:
        builder.contact(link, point, radius=radius)
    return builder.build()


def simulated(
    robot: hs.Robot, q: list[float], v: list[float], duration: float, profile: Any,
    method: Any = EXACT, **options: Any,
) -> hs.Run:  # fmt: skip
    ground = {"friction": 0.0} | {
        name: options.pop(name) for name in ("friction", "restitution") if name in options
    }
    run = hs.simulate(
        robot,
        state=hs.State(np.array(q), np.array(v)),
        duration=duration,
        method=method,
        ground=hs.Ground(profile=profile, **ground),
        stop_when_fallen=False,
        **options,
    )
    assert run.completed, run.message
    assert not [event for event in run.events if event.kind is EventKind.BRIDGE]
    return run


def mirrored(profile: Any) -> list[list[float]]:
    return [[-x, z] for x, z in reversed(profile)]


def slid_into_wall(friction: float, restitution: float, time: float) -> tuple[float, float]:
    """Place and velocity of a point that began at −0.1 m with 1 m/s towards a wall at 0."""
    brake = friction * G
    arrives = np.sqrt(1.0 - 2.0 * brake * 0.1)
    at = (1.0 - arrives) / brake if brake else 0.1
    left = restitution * arrives
    since = time - at
    if brake:
        since = min(since, left / brake)
    return -left * since + 0.5 * brake * since**2, -left + brake * since


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 0.5), (0.3, 0.0), (0.3, 0.5)])
def test_a_point_slides_into_a_wall(friction: float, restitution: float, side: float) -> None:
    profile = WALL if side > 0.0 else mirrored(WALL)
    run = simulated(
        puck(), [-0.1 * side, 0.0], [side, 0.0], 0.2, profile,
        friction=friction, restitution=restitution,
    )  # fmt: skip
    place, velocity = slid_into_wall(friction, restitution, 0.2)
    np.testing.assert_allclose(run.position[-1], [side * place, 0.0], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.velocity[-1], [side * velocity, 0.0], rtol=0.0, atol=1e-8)
    (blow,) = [event for event in run.events if event.kind is EventKind.IMPACT]
    arrives = np.sqrt(1.0 - 2.0 * friction * G * 0.1)
    # In the frame of the wall, which the row before the impact shows.
    assert blow.impulse == pytest.approx((MASS * (1.0 + restitution) * arrives, 0.0), abs=1e-8)
    row = int(np.searchsorted(run.time, blow.time - 1e-9))
    np.testing.assert_allclose(run.contact_normal[row, 0], [-side, 0.0], atol=1e-12)
    assert run.time[row] == pytest.approx(run.time[row + 1], abs=1e-12)
    assert run.gap.min() > -1e-9


def test_time_stepping_and_compliant_ground_come_to_the_point_at_the_wall() -> None:
    """First order in the step, and in one over the stiffness but for the time of the contact."""
    place, velocity = slid_into_wall(0.3, 0.0, 0.2)
    wrong = []
    for step in (1e-3, 1e-4):
        run = simulated(
            puck(), [-0.1, 0.0], [1.0, 0.0], 0.2, WALL, hs.TimeStepping(step=step), friction=0.3
        )
        apart = run.position[-1] - [place, 0.0], run.velocity[-1] - [velocity, 0.0]
        wrong.append(np.abs(apart).max())
    assert wrong[0] < 1e-3
    assert wrong[1] < 1e-10 + 0.15 * wrong[0]
    sunk = []
    for stiffness in (1e6, 1e8):
        damping = 2.0 * np.sqrt(stiffness * MASS)
        method = hs.Compliant(law=hs.KelvinVoigt(stiffness=stiffness, damping=damping))
        run = simulated(puck(), [0.0, 0.0], [0.0, 0.0], 0.2, GROOVE, method)
        # √2 m g / 3 and √5 m g / 3 press the faces in.
        n = np.array([[1.0, 1.0] / np.sqrt(2.0), [-1.0, 2.0] / np.sqrt(5.0)])
        force = np.array([np.sqrt(2.0), np.sqrt(5.0)]) * MASS * G / 3.0
        np.testing.assert_allclose(n @ run.position[-1], -force / stiffness, rtol=1e-4)
        np.testing.assert_allclose(run.world_force[-1, 0], [0.0, MASS * G], atol=1e-4)
        sunk.append(np.abs(run.position[-1]).max())
    assert sunk[1] == pytest.approx(1e-2 * sunk[0], rel=1e-3)


def test_a_point_in_a_valley_comes_to_rest_at_the_end_of_a_series() -> None:
    """It begins at rest on the right side; the angle has the cosine c = 1/√10.

    With v₀ at the first impact, c/sin α + c²/sin β of 2 v₀ / g go by from there to the next impact
    from the same side, and c² of that, and so on.
    """
    left, right, cosine = np.sin(np.pi / 4.0), 1.0 / np.sqrt(5.0), 1.0 / np.sqrt(10.0)
    length = np.hypot(0.2, 0.1)
    first = np.sqrt(2.0 * length / (G * right))
    speed = G * right * first
    rest = first + 2.0 * speed / G * (cosine / left + cosine**2 / right) / (1.0 - cosine**2)
    run = simulated(puck(), [0.2, 0.1], [0.0, 0.0], 0.6, GROOVE)
    impacts = [event for event in run.events if event.kind is EventKind.IMPACT]
    for number, event in enumerate(impacts[:6]):
        expected = MASS * speed * cosine**number * np.sin(np.arccos(cosine))
        assert event.impulse == pytest.approx((expected, 0.0), rel=1e-7, abs=1e-9)
    assert impacts[0].time == pytest.approx(first, abs=1e-8)
    (zeno,) = [event for event in run.events if event.kind is EventKind.ZENO]
    # Bounces shorter than a microsecond are not followed to their end.
    assert zeno.time == pytest.approx(rest, abs=1e-6)
    np.testing.assert_allclose(run.position[-1], 0.0, atol=1e-8)
    np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-8)


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_point_rests_in_a_groove_until_it_is_pushed_out(friction: float) -> None:
    """A push to the left takes the load off the right face, and moves the point up the left one.

    Along it, at 45°, (F (1 − μ) − m g (1 + μ)) / (√2 m) is left of the push.
    """
    force, begin, end = 3.0 * MASS * G, 0.05, 0.1
    run = simulated(
        puck(), [0.0, 0.0], [0.0, 0.0], end, GROOVE, friction=friction,
        pushes=[Push("z", force=(-force, 0.0), start=begin, duration=1.0)],
    )  # fmt: skip
    rests = run.time < begin - 1e-9
    np.testing.assert_allclose(run.position[rests], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        run.world_force[rests, 0], [[0.0, MASS * G]] * rests.sum(), atol=1e-8
    )
    rate = (force * (1.0 - friction) - MASS * G * (1.0 + friction)) / (np.sqrt(2.0) * MASS)
    way = 0.5 * rate * (end - begin) ** 2 / np.sqrt(2.0)
    np.testing.assert_allclose(run.position[-1], [-way, way], rtol=0.0, atol=1e-8)
    lifts = [event for event in run.events if event.kind is EventKind.LIFTOFF]
    assert not lifts, "it is on the ground all the time"


def test_a_sole_stands_with_its_toe_at_a_wall() -> None:
    """Pushed with F at its centre of mass, at height h above the middle: about the toe,
    2 a N_heel = m g a − F h, and the wall holds F."""
    a, h, force = 0.1, 0.2, 4.0
    foot = body([(-a, -h), (a, -h)], 0.05)
    run = simulated(
        foot, [-a, h, 0.0], [0.0, 0.0, 0.0], 0.05, WALL,
        pushes=[Push("body", force=(force, 0.0), start=0.0, duration=1.0)],
    )  # fmt: skip
    heel = (MASS * G * a - force * h) / (2.0 * a)
    settled = run.time > 0.01
    expected = [[heel, 0.0], [MASS * G - heel, -force]]
    for row in np.flatnonzero(settled):
        np.testing.assert_allclose(run.contact_force[row], expected, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.position[-1], [-a, h, 0.0], rtol=0.0, atol=1e-10)


def test_a_sole_that_slides_into_a_wall_tips_over_its_toe() -> None:
    """The toe is stopped by the wall, and held by the floor: ω = m v h / (I + m (a² + h²))."""
    a, h, inertia, speed = 0.1, 0.2, 0.05, 1.0
    foot = body([(-a, -h), (a, -h)], inertia)
    run = simulated(foot, [-a - 0.05, h, 0.0], [speed, 0.0, 0.0], 0.06, WALL)
    turn = MASS * speed * h / (inertia + MASS * (a**2 + h**2))
    (blow,) = [event for event in run.events if event.kind is EventKind.IMPACT]
    assert blow.time == pytest.approx(0.05, abs=1e-11)
    assert blow.contact == 1
    after = int(np.searchsorted(run.time, blow.time + 1e-12)) - 1
    np.testing.assert_allclose(run.velocity[after], [turn * h, turn * a, turn], rtol=0.0, atol=1e-8)
    # The resultant of both faces, in the frame of the wall: tangents of (−1, 0) point upwards.
    assert blow.impulse == pytest.approx((MASS * (speed - turn * h), MASS * turn * a), abs=1e-8)


@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_a_disc_that_rolls_into_a_wall_climbs_it(friction: float) -> None:
    """Of a full disc friction lifts it with μ m v, or with m v / 3 if it rolls up: then v_z = ω r.

    The floor has let it go; it comes down after 2 v_z / g.
    """
    radius, speed = 0.1, 1.0
    inertia = 0.5 * MASS * radius**2
    disc = body([(0.0, 0.0)], inertia, radius)
    lift = min(friction, 1.0 / 3.0) * MASS * speed
    arrives = 0.05 / speed
    lands = arrives + 2.0 * lift / MASS / G
    start = [-radius - 0.05, radius, 0.0], [speed, 0.0, speed / radius]
    run = simulated(disc, *start, 0.5 * (arrives + lands), WALL, friction=friction)
    flown = run.time[-1] - arrives
    spin = speed / radius - lift * radius / inertia
    expected = [0.0, lift / MASS - G * flown, spin]
    np.testing.assert_allclose(run.velocity[-1], expected, rtol=0.0, atol=1e-8)
    height = radius + lift / MASS * flown - 0.5 * G * flown**2
    np.testing.assert_allclose(run.position[-1, :2], [-radius, height], rtol=0.0, atol=1e-8)
    fallen = simulated(disc, *start, lands + 0.01, WALL, friction=friction)
    landings = [
        event for event in fallen.events if event.time > arrives + 1e-6 and event.impulse[0]
    ]
    assert landings[0].time == pytest.approx(lands, abs=1e-8)


def test_a_disc_that_spins_in_a_right_angle_is_braked_by_both_faces() -> None:
    """Its spin falls by 2 √2 μ g / (r (1 + μ²)) a second, and then it lies still."""
    friction, radius, spin = 0.3, 0.1, 10.0
    disc = body([(0.0, 0.0)], 0.5 * MASS * radius**2, radius)
    start = [0.0, radius * np.sqrt(2.0), 0.0], [0.0, 0.0, spin]
    falls = 2.0 * np.sqrt(2.0) * friction * G / (radius * (1.0 + friction**2))
    run = simulated(disc, *start, spin / falls + 0.02, RIGHT_ANGLE, friction=friction)
    turning = run.time < spin / falls
    np.testing.assert_allclose(
        run.velocity[turning, 2], spin - falls * run.time[turning], rtol=0.0, atol=1e-8
    )
    np.testing.assert_allclose(run.velocity[~turning], 0.0, atol=1e-8)
    assert run.time[~turning].size > 10
    # Record: forces act where they leave the disc, and their moments balance.
    arm = run.contact_point[:, 0] - run.position[:, :2]
    moment = arm[:, 1] * run.world_force[:, 0, 0] - arm[:, 0] * run.world_force[:, 0, 1]
    inner = (run.time > 0.01) & (run.time < spin / falls - 1e-6)
    inertia = 0.5 * MASS * radius**2
    np.testing.assert_allclose(moment[inner], -inertia * falls, rtol=1e-8)


def test_a_point_that_lands_in_the_corner_itself_is_stopped_by_both_faces() -> None:
    run = simulated(puck(), [0.0, 0.1], [0.0, 0.0], 0.2, GROOVE)
    lands = np.sqrt(0.2 / G)
    (blow,) = [event for event in run.events if event.kind is EventKind.TOUCHDOWN]
    assert blow.time == pytest.approx(lands, abs=1e-10)
    assert np.hypot(*blow.impulse) == pytest.approx(MASS * G * lands, rel=1e-9)
    np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-10)
    np.testing.assert_allclose(run.position[-1], 0.0, atol=1e-10)


def test_a_disc_lies_on_two_edges() -> None:
    """A gap of half its diameter: both edges press by m g / (2 cos 30°) at 30°."""
    radius = 0.1
    disc = body([(0.0, 0.0)], 0.5 * MASS * radius**2, radius)
    ditch = [[-1, 0], [-0.05, 0], [-0.05, -0.5], [0.05, -0.5], [0.05, 0], [1, 0]]
    height = np.sqrt(radius**2 - 0.05**2)
    run = simulated(disc, [0.0, height + 0.05, 0.0], [0.0] * 3, 0.3, ditch, friction=0.5)
    np.testing.assert_allclose(run.position[-1], [0.0, height, 0.0], atol=1e-10)
    np.testing.assert_allclose(run.world_force[-1, 0], [0.0, MASS * G], atol=1e-8)
    np.testing.assert_allclose(run.contact_point[-1, 0], [0.0, height - radius], atol=1e-8)


@pytest.mark.parametrize(("method", "sunk"), [(EXACT, 1e-10), (hs.Compliant(), 1e-4)])
def test_a_disc_that_fills_a_shaft_comes_down_to_its_ground(method: Any, sunk: float) -> None:
    """It is on both walls when it meets a third face."""
    radius = 0.1
    disc = body([(0.0, 0.0)], 0.5 * MASS * radius**2, radius)
    shaft = [[-1.0, 0.3], [-radius, 0.3], [-radius, 0.0], [radius, 0.0], [radius, 0.3], [1.0, 0.3]]
    run = simulated(disc, [0.0, 0.2, 0.0], [0.0] * 3, 0.4, shaft, method, friction=0.3)
    np.testing.assert_allclose(run.position[-1], [0.0, radius, 0.0], atol=sunk)
    np.testing.assert_allclose(run.world_force[-1, 0], [0.0, MASS * G], atol=1e-5)


def test_faces_that_hardly_turn_are_told_apart_by_where_the_point_is() -> None:
    """The line of a slope of 1e-7 is nearer than 1e-6 m ten centimetres before it begins."""
    run = simulated(puck(), [-0.1, 0.0], [1.0, 0.0], 0.3, [[-1.0, 0.0], [0.0, 0.0], [1.0, 1e-7]])
    before = run.position[:, 0] < -1e-9
    assert np.abs(run.position[before, 1]).max() < 1e-14
    assert run.position[-1, 1] == pytest.approx(2e-8, rel=1e-6)


def test_a_simulation_is_taken_up_again_within_a_corner(tmp_path: Any) -> None:
    """The contact with the second face is part of the state that is kept, and of what is saved."""
    setting: dict[str, Any] = {
        "state": hs.State(np.array([0.1, 0.05]), np.zeros(2)),
        "ground": hs.Ground(friction=0.2, profile=GROOVE),
        "method": hs.EventDriven(),
        "pushes": [Push("z", force=(-60.0, 0.0), start=0.6, duration=0.2)],
        "stop_when_fallen": False,
    }
    whole = hs.Simulation(puck(), **setting)
    whole.advance(0.5)
    kept = whole.snapshot()
    whole.advance(0.8)
    again = hs.Simulation(puck(), **setting)
    again.restore(kept)
    again.advance(0.8)
    np.testing.assert_array_equal(whole.state.q, again.state.q)
    np.testing.assert_array_equal(whole.state.v, again.state.v)
    assert np.abs(whole.state.q).max() > 1e-3, "the push has taken it out of the corner"


def test_a_run_in_a_corner_is_read_back_as_it_was_saved(tmp_path: Any) -> None:
    run = simulated(puck(), [0.1, 0.05], [0.0, 0.0], 0.3, GROOVE, friction=0.2)
    run.save(tmp_path / "corner.nc")
    read = hs.load_run(tmp_path / "corner.nc")
    np.testing.assert_array_equal(run.contact_force, read.contact_force)
    np.testing.assert_array_equal(run.contact_normal, read.contact_normal)
    assert [event.impulse for event in run.events] == [event.impulse for event in read.events]


def test_the_floor_pushes_where_it_is_when_a_disc_meets_a_wall() -> None:
    """The row before the impact has the wall's frame; the floor's force still acts at the bottom.

    Without friction no force has a moment about the centre of the disc.
    """
    radius = 0.1
    run = simulated(
        body([(0.0, 0.0)], 0.01, radius), [-0.2, radius, 0.0], [1.0, 0.0, 0.0], 0.15, WALL
    )
    (met,) = [event for event in run.events if event.kind is EventKind.IMPACT]
    row = int(np.flatnonzero(run.time == met.time)[0])
    normal = run.contact_normal[row, 0]
    np.testing.assert_allclose(normal, [-1.0, 0.0], atol=1e-12)
    along, across = run.contact_force[row, 0]
    force = along * normal + across * np.array([normal[1], -normal[0]])
    np.testing.assert_allclose(force, [0.0, MASS * G], atol=1e-6)
    arm = run.contact_point[row, 0] - run.position[row, :2]
    assert arm[1] * force[0] - arm[0] * force[1] == pytest.approx(0.0, abs=1e-8)
