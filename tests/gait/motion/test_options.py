"""What may be asked of a motion beside its phases: margins, landings, costs over time, a start."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from harness import Cable

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Instant
from heelstrike.gait.motion.optimize import checked_request
from heelstrike.gait.motion.request import MotionRequest

FASTER = 0.5
"""Speed at which points come down, in m/s."""


def asked(**more: object) -> dict:
    return {"distance": 0.25, "friction": 0.75, "starts": 1, "refine": False, **more}


@pytest.fixture(scope="module")
def flat(bravo7: hs.Robot) -> hs.Motion:
    return hs.optimize_motion(bravo7, step(), **asked())


def step() -> list[hs.ContactPhase]:
    return [hs.ContactPhase("right_foot", duration=0.7, pieces=4)]


def test_soles_bear_a_margin_at_both_ends(bravo7: hs.Robot, flat: hs.Motion) -> None:
    margin = 0.4 * bravo7.weight
    motion = hs.optimize_motion(bravo7, step(), **asked(force_margin=margin))
    ends = list(bravo7.feet[0].contacts)
    assert motion.phases[0].force[:, :, ends, 0].min() > margin - 1e-3
    assert flat.phases[0].force[:, :, ends, 0].min() < margin
    assert motion.cost >= flat.cost


def test_points_come_down_at_a_least_speed(bravo7: hs.Robot, flat: hs.Motion) -> None:
    motion = hs.optimize_motion(bravo7, step(), **asked(landing_speed=FASTER))

    def slowest(found: hs.Motion) -> float:
        last = found.phases[-1]
        q, v = (last.coordinates(last.duration, order=order) for order in range(2))
        landing = list(bravo7.feet[1].contacts)
        rows = dynamics.contact_jacobian(bravo7, q, landing)[:, 0]
        return float(-(rows @ v).max())

    assert slowest(motion) > FASTER - 1e-3
    assert slowest(flat) < FASTER


def test_a_cost_that_knows_the_time(bravo7: hs.Robot, flat: hs.Motion) -> None:
    """The swing knee follows a curve over time, as nearly as its limits let it."""
    knee = bravo7.joint_names.index("left_knee")

    def wanted(t: object, lib: object) -> object:
        return 0.5 + 0.4 * lib.sin(2.0 * np.pi * t / 1.4)  # type: ignore[attr-defined]

    def far(now: Instant) -> casadi.SX:
        away = now.position[knee] - wanted(now.time, casadi)
        return away**2 + 1e-7 * casadi.sumsqr(now.torque) + 1e-9 * casadi.sumsqr(now.acceleration)

    near = hs.optimize_motion(bravo7, step(), **asked(cost=far, warm_start=flat))
    time = np.linspace(0.05, 0.65, 50)
    away, before = (
        np.abs(each.position(time)[:, knee] - wanted(time, np)).max() for each in (near, flat)
    )
    assert away < 0.1 * before


def test_equations_hold_to_rounding(bravo7: hs.Robot, flat: hs.Motion) -> None:
    from heelstrike.experiments.people.nearest import residual_of

    assert residual_of(bravo7, flat) < 1e-9


def test_a_start_and_what_is_none(bravo7: hs.Robot, flat: hs.Motion) -> None:
    again = hs.optimize_motion(bravo7, step(), **asked(warm_start=flat))
    assert again.cost == pytest.approx(flat.cost, rel=1e-4)
    drawn = hs.optimize_motion(bravo7, step(), **asked(guess=flat.position))
    assert drawn.cost == pytest.approx(flat.cost, rel=1e-4)
    other = [hs.ContactPhase("right_foot_toe", duration=0.7)]
    with pytest.raises(GaitError, match="must go through the phases"):
        hs.optimize_motion(bravo7, other, **asked(warm_start=flat))
    with pytest.raises(GaitError, match="warm_start must be a Motion"):
        hs.optimize_motion(bravo7, step(), **asked(warm_start="flat.json"))
    with pytest.raises(GaitError, match="guess must return 9 finite positions"):
        hs.optimize_motion(bravo7, step(), **asked(guess=lambda t: [t]))
    with pytest.raises(GaitError, match="landing_speed must not be negative"):
        hs.optimize_motion(bravo7, step(), **asked(landing_speed=-1.0))


def test_a_constraint_of_ones_own(bravo7: hs.Robot, flat: hs.Motion) -> None:
    """In the middle of a swing the sole is 8 cm high, which costs more."""
    highest = 0.08

    def high(now: Instant) -> casadi.SX:
        middle = 1.0 - ((now.time - 0.35) / 0.1) ** 2
        least = (highest + 0.01) * casadi.fmax(middle, 0.0) ** 3 - 0.01
        return casadi.vertcat(now.points[2, 1] - least, now.points[3, 1] - least)

    lifted = hs.optimize_motion(bravo7, step(), **asked(constraint=high, warm_start=flat))
    heights, before = (
        dynamics.contact_positions(bravo7, each.position(0.35))[2:, 1] for each in (lifted, flat)
    )
    assert before.min() < 0.9 * highest
    assert heights.min() > highest - 1e-3
    assert lifted.cost > flat.cost


def test_what_a_given_state_misses_is_mended(bravo7: hs.Robot) -> None:
    """By less than 1e-6 it is put on the ground, to rounding: else the motion could not close."""
    from heelstrike.gait.motion.optimize import settled
    from heelstrike.gait.motion.phases import standing

    rng, along = np.random.default_rng(3), np.array([np.cos(0.1), np.sin(0.1)])
    state = bravo7.reference_state()
    q = state.q + 1e-7 * rng.standard_normal(bravo7.nv)
    q[:2] -= dynamics.contact_positions(bravo7, q)[:2].mean(axis=0)
    q[2] -= 0.1
    q[:2] -= dynamics.contact_positions(bravo7, q)[:2].mean(axis=0)
    foot = list(bravo7.feet[0].contacts)
    stands = standing(bravo7, foot)
    given = hs.State(q, 1e-7 * rng.standard_normal(bravo7.nv))
    found = settled(bravo7, given, stands, along, {foot[0]: -0.1})
    places = dynamics.contact_positions(bravo7, found.q)[foot]
    np.testing.assert_allclose(places @ [-along[1], along[0]], 0.0, atol=1e-14)
    assert places[0] @ along == pytest.approx(-0.1, abs=1e-14)
    after = dynamics.contact_positions(bravo7, found.q + 1e-3 * found.v)[foot]
    np.testing.assert_allclose(after, places, atol=1e-15)
    assert np.abs(found.q - q).max() < 1e-5


def test_a_loop_to_the_world_is_refused() -> None:
    build = hs.RobotBuilder("tied")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=1.0, inertia=0.1)
    foot = build.hinge("hip", trunk, mass=1.0, inertia=0.1, torque=10.0)
    build.contact(foot, (0.0, -1.0))
    build.loop(foot, None, at=(0.0, -1.0))
    with pytest.raises(GaitError, match="a closed loop ties it to the world"):
        hs.optimize_motion(
            build.build(), [hs.ContactPhase("hip")], repeat="same", distance=0.1, duration=0.5
        )


@pytest.mark.parametrize(
    ("constraint", "said"),
    [
        (0.1, "constraint must be a function of an instant"),
        (lambda now: now.nothing, "the constraint function failed"),
        (lambda now: casadi.SX.sym("own"), "the constraint function uses symbols .* own"),
    ],
)
def test_constraints_that_are_none(bravo7: hs.Robot, constraint: object, said: str) -> None:
    with pytest.raises(hs.GaitError, match=said):
        hs.optimize_motion(bravo7, step(), **asked(constraint=constraint))


def request_of(robot: hs.Robot, phases: list[hs.ContactPhase], **more: object) -> MotionRequest:
    usual = {
        "distance": 0.4, "duration": None, "speed": None, "start": None, "end": None,
        "friction": 0.75, "clearance": 0.1, "slope": 0.0, "cost": "torque", "force_margin": 20.0,
        "landing_speed": 0.0, "repeat": "mirrored",
    }  # fmt: skip
    return checked_request(robot, phases, **(usual | more))  # type: ignore[arg-type]


def test_margins_are_of_soles_that_stand_flat(bravo7: hs.Robot) -> None:
    """Of both ends of one; a point that stands alone has none, though it may not pull."""
    heel, toe = bravo7.feet[0].contacts
    phases = [hs.ContactPhase("right_foot"), hs.ContactPhase(bravo7.contact_names[toe])]
    request = request_of(bravo7, phases)
    assert [request.force_margin_of(0, i) for i in (heel, toe)] == [20.0, 20.0]
    assert request.force_margin_of(1, toe) == 0.0


def test_feet_in_the_air_are_asked_for_a_hump_over_all_their_phases(bravo7: hs.Robot) -> None:
    """From the ground to the ground, half-way the clearance; where a point leaves, nothing yet."""
    shares = np.array([0.0, 0.5, 1.0])
    other = bravo7.feet[1].contacts[0]
    one = request_of(bravo7, [hs.ContactPhase("right_foot")])
    np.testing.assert_allclose(one.clearance_of(0, other, shares), [-np.inf, 0.1, -np.inf])
    two = request_of(bravo7, [hs.ContactPhase("right_foot"), hs.ContactPhase("right_foot")])
    begin, end = (two.clearance_of(p, other, shares) for p in range(2))
    assert begin[0] == end[2] == -np.inf
    assert begin[2] == end[0] == pytest.approx(0.1)
    assert begin[1] == pytest.approx(end[1])
    assert 0.0 < begin[1] < 0.1
    heel, toe = bravo7.feet[0].contacts
    rolls = [hs.ContactPhase("right_foot"), hs.ContactPhase(bravo7.contact_names[toe])]
    np.testing.assert_allclose(  # the heel lifts, and its foot stands on
        request_of(bravo7, rolls).clearance_of(1, heel, shares)[:2], [-np.inf, 0.0]
    )


@pytest.mark.parametrize("given", [(0.3, 0.5), 0.4])
def test_durations_of_a_phase_are_its_bounds(given: object) -> None:
    phase = hs.ContactPhase("right_foot", duration=given, pieces=3)  # type: ignore[arg-type]
    assert phase.duration == (given if isinstance(given, tuple) else (0.4, 0.4))
    assert (phase.contacts, phase.pieces) == (("right_foot",), 3)


def test_robots_that_something_else_holds_are_refused(bravo7: hs.Robot) -> None:
    held = hs.constrained(bravo7, Cable("trunk", length=1.0))
    with pytest.raises(GaitError, match="does not support constraints from outside"):
        request_of(held, step())
