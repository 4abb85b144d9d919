"""Points and discs that slide and roll over corners of the ground, event driven, in closed form.

A frictionless puck of mass m slides at 1 m/s from x = −0.1 m along flat ground that turns at x = 0.
Where it rises by an angle the puck hits the slope: an impact of m v sin(angle) along its normal,
and v cos(angle) is left. Where it falls the puck flies on, v along x and g t²/2 down, and lands.
"""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import EventKind, RunStatus

G, MASS, SPEED, TURN = 9.81, 2.0, 1.0, 0.1
RADIUS = 0.1


def puck() -> hs.Robot:
    builder = hs.RobotBuilder("puck", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    builder.contact(builder.slide("z", rail, direction=(0, 1), mass=MASS), (0.0, 0.0))
    return builder.build()


def slide(rise: float, duration: float) -> hs.Run:
    run = hs.simulate(
        puck(),
        state=hs.State([-SPEED * TURN, 0.0], [SPEED, 0.0]),
        duration=duration,
        method=hs.EventDriven(),
        ground=hs.Ground(friction=0.0, profile=[[-1.0, 0.0], [0.0, 0.0], [1.0, rise]]),
    )
    assert run.status is RunStatus.COMPLETED, run.message
    return run


def impulses(run: hs.Run) -> list[tuple[float, float]]:
    return [(event.time, event.impulse[0]) for event in run.events if event.impulse[0] > 0.0]


@pytest.mark.parametrize("rise", [0.05, 0.3, 1.0])
def test_a_puck_hits_the_slope_that_it_slides_into(rise: float) -> None:
    run = slide(rise, 0.15)
    angle = np.arctan(rise)
    ((time, impulse),) = impulses(run)
    # Events are found to 1e-12 s.
    assert time == pytest.approx(TURN, abs=1e-11)
    assert impulse == pytest.approx(MASS * SPEED * np.sin(angle), rel=1e-9)
    speed = SPEED * np.cos(angle) - G * np.sin(angle) * (0.15 - TURN)
    expected = speed * np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(run.velocity[-1], expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("drop", [0.3, 1.0])
def test_a_puck_flies_off_an_edge(drop: float) -> None:
    lands = TURN + 2.0 * SPEED * drop / G
    run = slide(-drop, 0.5 * (TURN + lands))
    flown = run.time[-1] - TURN
    np.testing.assert_allclose(run.velocity[-1], [SPEED, -G * flown], rtol=0.0, atol=1e-8)
    assert not impulses(run)
    (leaves,) = [e.time for e in run.events if e.kind is EventKind.LIFTOFF]
    assert leaves == pytest.approx(TURN, abs=1e-11)
    ((lands_at, _),) = impulses(slide(-drop, lands + 0.01))
    assert lands_at == pytest.approx(lands, abs=1e-9)


def test_a_disc_pivots_on_an_edge() -> None:
    """A disc rolls off slowly: its centre goes round the corner, and its energy stays the same.

    With k² the square of its radius of gyration, ½ m (1 + k²/r²) v² + m g r cos(angle) is constant
    while it turns about the corner.
    """
    gyration = 0.5 * RADIUS**2
    builder = hs.RobotBuilder("disc", gravity=G)
    body = builder.floating_base("disc", (0.0, RADIUS), mass=MASS, inertia=MASS * gyration)
    builder.contact(body, (0.0, 0.0), radius=RADIUS)
    disc = builder.build()
    run = hs.simulate(
        disc,
        state=hs.State([-0.01, RADIUS, 0.0], [0.2, 0.0, 0.2 / RADIUS]),
        duration=0.25,
        method=hs.EventDriven(),
        ground=hs.Ground(friction=2.0, profile=[[-1.0, 0.0], [0.0, 0.0], [1.0, -1.0]]),
    )
    assert run.status is RunStatus.COMPLETED, run.message
    x, z = run.position[:, 0], run.position[:, 1]
    turning = x > 1e-6
    assert turning.sum() > 100
    np.testing.assert_allclose(np.hypot(x, z)[turning], RADIUS, rtol=0.0, atol=1e-9)
    speed = (run.velocity[:, :2] ** 2).sum(axis=1)
    energy = 0.5 * MASS * (1.0 + gyration / RADIUS**2) * speed + MASS * G * z
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    assert not [event for event in run.events if event.kind is EventKind.BRIDGE]


@pytest.mark.parametrize("beyond", [1e-6, 5e-5])
def test_a_puck_that_hops_lands_just_before_the_edge(beyond: float) -> None:
    """And would have dipped into the ground and out, between two samples that both see it rise.

    It hops with u from a height z: it is back after (u + √(u² + 2 g z)) / g, and lands on the flat
    as long as the edge is farther than that.
    """
    up, height, begin = 0.012, 2e-6, -0.5
    lands = (up + np.sqrt(up**2 + 2.0 * G * height)) / G
    edge = begin + SPEED * lands + beyond
    run = hs.simulate(
        puck(),
        state=hs.State([begin, height], [SPEED, up]),
        duration=0.01,
        method=hs.EventDriven(output_period=None),
        ground=hs.Ground(friction=0.0, profile=[[-1.0, 0.0], [edge, 0.0], [1.0, edge - 1.0]]),
    )
    assert run.status is RunStatus.COMPLETED, run.message
    ((time, impulse),) = impulses(run)
    assert time == pytest.approx(lands, abs=1e-11)
    assert impulse == pytest.approx(MASS * (G * lands - up), rel=1e-8)
    assert np.min(run.gap) > -1e-12


def test_a_face_ends_where_it_ends() -> None:
    """Not where the dense output of a long step has it: a spring drives the puck over the edge."""
    builder = hs.RobotBuilder("swing", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0, stiffness=400.0, rest=0.0)
    builder.contact(builder.slide("z", rail, direction=(0, 1), mass=MASS), (0.0, 0.0))
    rate = np.sqrt(400.0 / MASS)
    for edge in (0.0, 0.03, 0.07):
        run = hs.simulate(
            builder.build(),
            state=hs.State([-TURN, 0.0], [0.0, 0.0]),
            duration=0.3,
            method=hs.EventDriven(rtol=1e-6, atol=1e-8),
            ground=hs.Ground(friction=0.0, profile=[[-1.0, 0.0], [edge, 0.0], [1.0, edge - 1.0]]),
        )
        (leaves,) = [e.time for e in run.events if e.kind is EventKind.LIFTOFF]
        at = np.flatnonzero(run.time == leaves)[0]
        assert run.position[at, 0] == pytest.approx(edge, abs=1e-11)
        assert leaves == pytest.approx(np.arccos(-edge / TURN) / rate, abs=1e-6)
