"""Where in a step an event is: also long before the first place at which the step is looked at."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim import EventKind
from heelstrike.sim.event_driven.location import NO_EVENT, lowest_place, may_cross
from heelstrike.sim.event_driven.rows import is_inside

GRAVITY, STIFFNESS = 9.81, 1e4


def hopper() -> hs.Robot:
    """A foot of 1 kg with another kilogram on a spring above it, which move up and down."""
    builder = hs.RobotBuilder("hopper")
    foot = builder.slide("foot", None, direction=(0, 1), mass=1.0)
    builder.slide("body", foot, direction=(0, 1), mass=1.0, stiffness=STIFFNESS)
    builder.contact(foot, (0.0, 0.0))
    return builder.build()


def test_a_foot_that_leaves_comes_back_and_leaves_within_a_quarter_of_a_step_is_seen() -> None:
    """It leaves with 2e-6 m/s under 0.5 m/s² downwards, which a jerk of 7500 m/s³ turns round.

    Left to itself it would be in the ground after 8 µs, by 1.2 nm, and be out of it after 0.2 ms:
    before the first sample of a step of 1 ms. It stands instead until the spring lifts it, of which
    the length obeys u'' = -g - u k/m.
    """
    pull, rise = (GRAVITY - 0.5) / STIFFNESS, 0.75
    run = hs.simulate(
        hopper(), state=hs.State([0.0, pull], [2e-6, rise]), duration=1e-3,
        method=hs.EventDriven(output_period=1e-5), stop_when_fallen=False,
    )  # fmt: skip
    turns, sag = np.sqrt(STIFFNESS), GRAVITY / STIFFNESS
    length = lambda t: (  # noqa: E731
        -sag + (pull + sag) * np.cos(turns * t) + rise / turns * np.sin(turns * t)
    )
    lifts = brentq(lambda t: STIFFNESS * length(t) - GRAVITY, 0.0, 2e-4, xtol=1e-15)
    assert run.certificates.penetration <= 1e-10
    assert [event.kind for event in run.events][-1] is EventKind.LIFTOFF
    # The spring lengthened by 2e-6 m/s for 8 µs less, which is 2e-10 s of its way.
    assert run.events[-1].time == pytest.approx(lifts, abs=1e-9)


def test_the_lowest_place_of_a_cubic_is_found_where_it_is_below_zero() -> None:
    """Of cubics through random ends with random rates, against their values on a fine grid."""
    draw = np.random.default_rng(3)
    part = np.linspace(0.0, 1.0, 20001)
    below = 0
    for _ in range(300):
        before, value = draw.uniform(0.0, 0.3, size=2) * draw.integers(0, 2, size=2)
        rate, later = draw.normal(size=2)
        rise = value - before
        cubic = before + part * (rate + part * (3.0 * rise - 2.0 * rate - later))
        cubic += part**3 * (rate + later - 2.0 * rise)
        place = int(np.argmin(cubic))
        found = lowest_place(before, rate, value, later)
        if cubic[place] < -1e-6:
            below += 1
            assert found == pytest.approx(part[place], abs=1e-4)
        elif cubic[place] > 0.0:
            assert found == NO_EVENT
    assert below > 50


def test_no_gap_is_passed_over_that_a_cubic_takes_below_zero() -> None:
    """Of two open points with the same ends; one far above what its rates take away is."""
    draw = np.random.default_rng(4)
    part, span, below, passed = np.linspace(0.0, 1.0, 2001), 2.5e-3, 0, 0
    modes = SimpleNamespace(watched=2, closed=[0, 0], slide=[0, 0])
    samples = SimpleNamespace()
    for _ in range(300):
        before, value = draw.uniform(0.0, 0.4, size=2)
        rate, later = draw.normal(size=2)
        rise = value - before
        cubic = before + part * (rate + part * (3.0 * rise - 2.0 * rate - later))
        cubic += part**3 * (rate + later - 2.0 * rise)
        samples.before, samples.sample = [9.0, 1.0, before, 1.0], [9.0, 1.0, value, 1.0]
        samples.before_rate = [rate / span, 0.0, rate / span, 0.0]
        samples.sample_rate = [later / span, 0.0, later / span, 0.0]
        asked = uncompiled(may_cross)(2, span, modes, samples)
        assert asked or cubic.min() > 0.8 * min(before, value)
        below += cubic.min() < 0.0
        passed += not asked
        assert not uncompiled(may_cross)(0, span, modes, samples)
        assert not uncompiled(may_cross)(1, span, modes, samples)
    assert below > 30
    assert passed > 30


def test_what_is_not_above_zero_at_both_samples_is_looked_at() -> None:
    modes = SimpleNamespace(watched=1, closed=[1], slide=[0])
    samples = SimpleNamespace(before_rate=[0.0, 0.0], sample_rate=[0.0, 0.0])
    for before, value in [(-1e-12, 1.0), (0.0, 1.0), (1.0, 0.0), (1.0, -1e-12), (1.0, np.nan)]:
        samples.before, samples.sample = [before, before], [value, value]
        assert uncompiled(may_cross)(0, 1.0, modes, samples)
        assert uncompiled(may_cross)(1, 1.0, modes, samples)


def test_a_stop_touched_and_left_between_two_samples_is_seen() -> None:
    """An arm rises from its stop, falls back on it and is pulled away again, all within a step.

    Its torque is that of the motion c t (t - 2.9 ms) (t - 3.4 ms), which is 1e-6 rad beyond the
    stop in between. The second step is of 10 ms and begins at 1 ms, when the arm still rises; the
    first sample in it is at 3.5 ms, when it does again.
    """
    builder = hs.RobotBuilder("arm", gravity=0.0)
    builder.hinge(
        "arm", None, mass=1.0, inertia=1.0, center_of_mass=(0.0, 0.0), torque=1e4,
        limits=(0.0, np.inf),
    )  # fmt: skip

    @hs.controller
    def pull(t, state, contacts, robot, torque):  # type: ignore[no-untyped-def]
        torque[0] = 5e3 * (6.0 * t - 2.0 * 6.3e-3)

    run = hs.simulate(
        builder.build(), pull(), state=hs.State([0.0], [5e3 * 2.9e-3 * 3.4e-3]), duration=0.05,
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    touches = [event.time for event in run.events if event.kind is EventKind.JOINT_STOP]
    assert touches == pytest.approx([2.9e-3], abs=1e-9)
    assert run.position[:, 0].min() >= -1e-10


def test_a_step_ends_at_a_row_inside_it_only() -> None:
    """A row may be due where the step begins, but for rounding: it cannot be cut down to that."""
    assert is_inside(0.3004, 0.3, 1e-3)
    assert not is_inside(0.1 * 3, 0.3, 1e-3)
    assert not is_inside(0.3 + 0.9995e-3, 0.3, 1e-3)


def thrown(radius: float, speed: float, profile: list[list[float]]) -> hs.Run:
    builder = hs.RobotBuilder("puck")
    disc = builder.floating_base("puck", mass=1.0, inertia=0.01)
    builder.contact(disc, (0.0, 0.0), radius=radius)
    return hs.simulate(
        builder.build(), state=hs.State([0.0, 0.06, 0.0], [speed, 0.3, 0.0]), duration=0.035,
        method=hs.EventDriven(), ground=hs.Ground(profile=profile), stop_when_fallen=False,
    )  # fmt: skip


@pytest.mark.parametrize(("radius", "speed"), [(0.001, 20.0), (0.01, 10.0), (0.05, 20.0)])
def test_a_disc_does_not_go_through_a_thin_wall_between_two_samples(
    radius: float, speed: float
) -> None:
    """It is on both sides of a wall of 5 mm at its foot, and nowhere near it at any sample."""
    wall = [[-5.0, 0.0], [0.3, 0.0], [0.3025, 0.1], [0.305, 0.0], [5.0, 0.0]]
    run = thrown(radius, speed, wall)
    assert run.certificates.penetration <= 1e-10
    height = 0.06 + 0.3 * run.events[0].time - 0.5 * GRAVITY * run.events[0].time ** 2
    slant = np.hypot(1.0, 0.0025 / 0.1)  # of the wall's face, off which the centre is a radius
    reached = 0.3 + 0.0025 / 0.1 * height - radius * slant
    assert speed * run.events[0].time == pytest.approx(reached, abs=1e-9)


def test_a_point_that_passes_many_faces_between_two_samples_is_stopped_by_the_last() -> None:
    """Over the teeth of a comb, 2 mm each, to one that is longer: 41 faces in a sample's time."""
    teeth = [[0.1 + 0.004 * i, 0.0 if i % 2 == 0 else 0.055] for i in range(101)]
    teeth[41][1] = 0.1
    run = thrown(0.0, 20.0, [[-5.0, 0.0], *teeth, [5.0, 0.0]])
    assert run.certificates.penetration <= 1e-10
    assert 20.0 * run.events[0].time == pytest.approx(0.2625, abs=5e-4)


def test_the_tip_of_what_spins_fast_is_not_in_the_ground_between_two_samples() -> None:
    """A rod of 0.4 m in free fall, 70 turns a second: its smooth motion would allow any step."""
    builder = hs.RobotBuilder("rod")
    rod = builder.floating_base("rod", mass=1.0, inertia=0.01)
    for end in (-0.2, 0.2):
        builder.contact(rod, (end, 0.0))
    run = hs.simulate(
        builder.build(), state=hs.State([0.0, 0.64, 1.2], [0.0, 0.0, 450.0]), duration=0.32,
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    low = lambda t: 0.64 - 0.5 * GRAVITY * t**2 - 0.2 * abs(np.sin(1.2 + 450.0 * t))  # noqa: E731
    times = np.linspace(0.0, 0.32, 320001)
    inside = int(np.argmax(low(times) < 0.0))
    assert run.events[0].time == pytest.approx(
        brentq(low, times[inside - 1], times[inside], xtol=1e-15), abs=1e-9
    )
