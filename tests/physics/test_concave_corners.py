"""Points and discs in concave corners of the ground under time stepping, by hand calculation.

Both faces of a corner push. Their forces are recorded as one, in the frame of the nearer face, at
the place where the resultant leaves the disc: so forces and moments of a record balance.
"""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import Scheme

G, MASS = 9.81, 2.0
BOUNDING = (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED)
GROOVE = ((-1.0, 1.0), (0.0, 0.0), (2.0, 1.0))
"""45° down, 26.6° up: x + z = 0 and z = x / 2."""
WALL = ((-1.0, 0.0), (0.0, 0.0), (0.0, 0.5), (1.0, 0.5))


def disc(radius: float) -> hs.Robot:
    builder = hs.RobotBuilder("disc", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    fall = builder.slide("z", rail, direction=(0, 1), mass=0.0)
    body = builder.hinge("turn", fall, mass=MASS, inertia=0.5 * MASS * max(radius, 0.1) ** 2)
    builder.contact(body, (0.0, 0.0), radius=radius)
    return builder.build()


def simulated(
    scheme: Scheme, profile: object, friction: float, radius: float, q: list[float], v: list[float],
    duration: float,
) -> hs.Run:  # fmt: skip
    return hs.simulate(
        disc(radius),
        state=hs.State(np.array(q), np.array(v)),
        duration=duration,
        method=hs.TimeStepping(step=1e-3, scheme=scheme),
        ground=hs.Ground(friction=friction, profile=profile),
    )


def world_force(run: hs.Run) -> np.ndarray:
    """Contact force of the only point in world axes (T, 2)."""
    normal, force = run.contact_normal[:, 0], run.contact_force[:, 0]
    tangent = np.stack((normal[:, 1], -normal[:, 0]), axis=1)
    return normal * force[:, :1] + tangent * force[:, 1:]


@pytest.mark.parametrize("scheme", BOUNDING)
def test_point_pressed_into_a_groove_is_carried_by_both_faces(scheme: Scheme) -> None:
    """Without friction N₁ (1, 1)/√2 + N₂ (−1, 2)/√5 = m g ẑ: N₁ = √2 m g / 3, N₂ = √5 m g / 3.

    Along the left face, whose own friction is none, only N₂ can push: 3/√10 of it.
    """
    run = simulated(scheme, GROOVE, 0.0, 0.0, [-0.1, 0.1, 0.0], [0.0, 0.0, 0.0], 2.0)
    assert run.completed
    np.testing.assert_allclose(run.position[-1, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(world_force(run)[-1], [0.0, MASS * G], atol=1e-9)
    # Its part along the face that it is not on is that of the other.
    along = {
        -1: np.sqrt(5.0) / 3.0 * 3.0 / np.sqrt(10.0),
        1: np.sqrt(2.0) / 3.0 * 3.0 / np.sqrt(10),
    }
    side = -1 if run.contact_normal[-1, 0, 0] > 0.0 else 1
    assert abs(run.contact_force[-1, 0, 1]) == pytest.approx(along[side] * MASS * G, rel=1e-9)
    assert run.gap.min() >= -1e-12


@pytest.mark.parametrize("scheme", BOUNDING)
def test_point_that_slides_into_a_wall_stops_at_it(scheme: Scheme) -> None:
    """The wall takes m v; the point is never beyond it, and stays."""
    run = simulated(scheme, WALL, 0.0, 0.0, [-0.1005, 0.0, 0.0], [1.0, 0.0, 0.0], 0.2)
    assert run.position[:, 0].max() <= 1e-12
    assert run.position[:, 1].max() == 0.0
    np.testing.assert_allclose(run.position[-1, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-12)
    taken = 1e-3 * world_force(run)[:-1, 0].sum()
    assert taken == pytest.approx(-MASS * 1.0, rel=1e-9)


@pytest.mark.parametrize("scheme", BOUNDING)
def test_disc_slides_down_to_a_wall_and_lies_on_both(scheme: Scheme) -> None:
    """On a slope of −0.3 rad, at a wall: the centre is a radius away from both.

    Without friction both forces go through the centre, and so does their resultant, m g upwards: it
    leaves the disc at its lowest point.
    """
    angle, radius = 0.3, 0.1
    profile = [[-2.0, 2.0 * np.tan(angle)], [0.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    normal = np.array([np.sin(angle), np.cos(angle)])
    start = np.array([-0.5, 0.5 * np.tan(angle)]) + radius * normal
    run = simulated(scheme, profile, 0.0, radius, [*start, 0.0], [0.0, 0.0, 0.0], 1.0)
    height = (radius - normal[0] * -radius) / normal[1]
    np.testing.assert_allclose(run.position[-1, :2], [-radius, height], atol=1e-9)
    np.testing.assert_allclose(world_force(run)[-1], [0.0, MASS * G], atol=1e-6)
    np.testing.assert_allclose(run.contact_point[-1, 0], [-radius, height - radius], atol=1e-8)


@pytest.mark.parametrize("scheme", BOUNDING)
def test_record_of_a_disc_that_spins_in_a_groove_balances(scheme: Scheme) -> None:
    """m Δv = h (F − m g ẑ) and I Δω = h (p − c) × F, in every step, with friction on both faces.

    A positive turn is about +y, from z to x: its moment is Δz F_x − Δx F_z.
    """
    radius, step = 0.1, 1e-3
    center = [0.0197453049, 0.1216760513]
    run = simulated(scheme, GROOVE, 0.3, radius, [*center, 0.0], [0.0, 0.0, 30.0], 0.2)
    force, point = world_force(run)[:-1], run.contact_point[:-1, 0]
    np.testing.assert_allclose(
        MASS * np.diff(run.velocity[:, :2], axis=0) / step + [0.0, MASS * G], force, atol=1e-8
    )
    arm = point - run.position[:-1, :2]
    moment = arm[:, 1] * force[:, 0] - arm[:, 0] * force[:, 1]
    inertia = 0.5 * MASS * radius**2
    np.testing.assert_allclose(inertia * np.diff(run.velocity[:, 2]) / step, moment, atol=1e-8)
    # It slips on both faces in the beginning: friction of both brakes it.
    assert moment[0] < -1.5 * 0.3 * radius * MASS * G / np.sqrt(2.0)
    assert np.abs(run.position[:, :2] - center).max() < 1e-9


def test_disc_braked_by_both_faces_stops_when_they_have_taken_its_spin() -> None:
    """A right angle, 45° to either side; both frictions act against the slip.

    Forces along x and z give N₁ = m g (1 − μ) / (√2 (1 + μ²)) and N₂ = m g (1 + μ) / (√2 (1 + μ²)),
    or the other way round. The spin falls by r μ (N₁ + N₂) / I = 2 √2 μ g / (r (1 + μ²)).
    """
    mu, radius, spin = 0.3, 0.1, 30.0
    profile = [[-1.0, 1.0], [0.0, 0.0], [1.0, 1.0]]
    height = radius * np.sqrt(2.0)
    run = simulated(
        Scheme.IMPACT_RESOLVED, profile, mu, radius, [0.0, height, 0.0], [0.0, 0.0, spin], 0.5
    )
    falls = 2.0 * np.sqrt(2.0) * mu * G / (radius * (1.0 + mu**2))
    early = run.time < spin / falls - 2e-3
    np.testing.assert_allclose(run.velocity[early, 2], spin - falls * run.time[early], rtol=1e-8)
    assert abs(run.velocity[-1, 2]) <= 1e-9
