"""Points and discs on smooth ground of somebody's own, against closed forms and quadrature.

A mass that slides without friction in the bowl z = c x² / 2 from rest at x = A keeps its energy,
and comes back after

    T = 4 ∫ ds / v = 4 / √(g c) ∫ √(1 + c² A² sin² φ) dφ = 4 / √(g c) E(−c² A²)

with the complete elliptic integral E. The centre of a disc of radius r goes along the parallel of
the bowl, shorter by 1 − k r; one that rolls is heavier by I / r².
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from bowl import Bowl, Waves
from scipy.integrate import quad
from scipy.special import ellipe

import heelstrike as hs
from heelstrike.robot import Robot

G, MASS, START, CURVATURE = 9.81, 2.0, 0.4, 1.5
BOWL = Bowl(CURVATURE)
EXACT = hs.EventDriven(rtol=1e-10, atol=1e-12)


def slider(radius: float = 0.0, inertia: float = 0.5) -> Robot:
    builder = hs.RobotBuilder("slider", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    fall = builder.slide("z", rail, direction=(0, 1), mass=0.0)
    body = builder.hinge("turn", fall, mass=MASS, inertia=inertia)
    builder.contact(body, (0.0, 0.0), radius=radius)
    return builder.build()


def center_at(foot: float, radius: float) -> list[float]:
    """Centre of a disc that touches the bowl at x = `foot`."""
    slope = CURVATURE * foot
    length = math.hypot(1.0, slope)
    height = 0.5 * CURVATURE * foot**2
    return [foot - radius * slope / length, height + radius / length, 0.0]


def period(radius: float, heavier: float) -> float:
    """Period of a disc, by quadrature over where it touches; `heavier` is I / (m r²)."""
    top = center_at(START, radius)[1]

    def slowness(angle: float) -> float:
        foot = START * math.sin(angle)
        squared = 1.0 + (CURVATURE * foot) ** 2
        way = math.sqrt(squared) * (1.0 - radius * CURVATURE / squared**1.5)
        speed = math.sqrt(2.0 * G * (top - center_at(foot, radius)[1]) / (1.0 + heavier))
        return way * START * math.cos(angle) / speed

    return 4.0 * quad(slowness, 0.0, 0.5 * math.pi - 1e-9, epsabs=1e-11, limit=200)[0]


def slide(method: hs.Method, duration: float, radius: float = 0.0, friction: float = 0.0) -> hs.Run:
    robot = slider(radius, 0.5 * MASS * radius**2 if radius else 0.5)
    run = hs.simulate(
        robot, state=hs.State(center_at(START, radius), [0.0] * 3), duration=duration,
        method=method, ground=hs.Ground(shape=BOWL, friction=friction),
    )  # fmt: skip
    assert run.completed, run.message
    return run


def energy(run: hs.Run) -> np.ndarray:
    inertia = [MASS, MASS, run.robot.model.inertia[2]]
    return 0.5 * run.velocity**2 @ inertia + MASS * G * run.position[:, 1]


def test_the_quadrature_is_the_elliptic_integral() -> None:
    exact = 4.0 / math.sqrt(G * CURVATURE) * ellipe(-((CURVATURE * START) ** 2))
    assert period(0.0, 0.0) == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(
    ("radius", "friction"), [(0.0, 0.0), (0.15, 0.0), (0.15, 5.0)], ids=["point", "disc", "rolls"]
)
def test_a_mass_comes_back_after_its_period(radius: float, friction: float) -> None:
    """Event-driven, at the tolerance; the disc that rolls has 3/2 of its mass."""
    run = slide(EXACT, period(radius, 0.5 if friction else 0.0), radius, friction)
    total = energy(run)
    np.testing.assert_allclose(total, total[0], rtol=2e-8)
    np.testing.assert_allclose(run.position[-1, :2], run.position[0, :2], atol=1e-7)
    assert np.abs(run.gap).max() < 1e-9
    assert run.certificates.penetration < 1e-9


@pytest.mark.parametrize("radius", [0.0, 0.15])
def test_time_stepping_converges_to_it(radius: float) -> None:
    """To second order in the way, since the chord of a step is asked for, not its tangent.

    The gap is left to third order in the step by that: v³ h³ times the rate of the curvature.
    """
    once = period(radius, 0.0)
    found = []
    for steps in (400, 800):
        run = slide(hs.TimeStepping(step=once / steps), once, radius)
        assert np.abs(run.gap).max() < 1e-5
        found.append(abs(run.position[-1, 0] - run.position[0, 0]))
    assert found[1] < 2e-3
    assert found[1] < 0.6 * found[0] or found[1] < 1e-5


def test_compliant_ground_gives_way_beneath_it() -> None:
    once = period(0.0, 0.0)
    run = slide(hs.Compliant(), once)
    assert run.position[-1, 0] == pytest.approx(START, abs=2e-3)
    assert 0.0 < run.certificates.penetration < 1e-3


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(), hs.Compliant()], ids=str)
def test_friction_holds_where_the_slope_is_less(method: hs.Method) -> None:
    """At rest where dz/dx = c x is less than μ, and sliding where it is more."""
    for place, holds in ((0.3, True), (0.5, False)):
        run = hs.simulate(
            slider(), state=hs.State([place, 0.5 * CURVATURE * place**2, 0.0], [0.0] * 3),
            duration=0.1, method=method, ground=hs.Ground(shape=BOWL, friction=0.6),
        )  # fmt: skip
        slope = math.atan(CURVATURE * place)
        way = 0.5 * G * 0.01 * (math.sin(slope) - 0.6 * math.cos(slope)) * math.cos(slope)
        moved = place - run.position[-1, 0]
        assert moved == pytest.approx(0.0 if holds else way, abs=1e-4 if holds else 0.05 * way)


def test_the_distance_is_that_of_the_nearest_place() -> None:
    """Against the least of a million places; normals point from there, on either side."""
    ground = hs.Ground(shape=Waves())
    x = np.linspace(-3.0, 3.0, 1_000_001)
    z = ground.height(x)
    for place in ((0.3, 0.1), (0.3, -0.05), (1.1, 0.02), (-2.0, 0.5)):
        at = hs.contact_kinematics(slider(0.01), [*place, 0.0], [0.0] * 3, ground)
        apart = np.hypot(x - place[0], z - place[1])
        side = 1.0 if place[1] > float(ground.height(place[0])) else -1.0
        assert at.gap[0] == pytest.approx(side * apart.min() - 0.01, abs=1e-9)
        nearest = int(np.argmin(apart))
        away = side * (np.array(place) - [x[nearest], z[nearest]]) / apart.min()
        np.testing.assert_allclose(at.normal[0], away, atol=1e-4)


def test_its_curvature_is_how_gaps_accelerate() -> None:
    """J̇ v, against differences of the gap along a straight way."""
    robot, ground = slider(0.05), hs.Ground(shape=Waves(0.05, 4.0))
    start, speed, ahead = np.array([0.2, 0.2, 0.0]), np.array([1.3, -0.4, 2.0]), 1e-4
    gaps = [
        hs.contact_kinematics(robot, start + k * ahead * speed, speed, ground).gap[0]
        for k in (-1, 0, 1)
    ]
    at = hs.contact_kinematics(robot, start, speed, ground)
    rate = (gaps[2] - gaps[0]) / (2.0 * ahead)
    assert at.velocity[0, 0] == pytest.approx(rate, rel=1e-7)
    second = (gaps[2] - 2.0 * gaps[1] + gaps[0]) / ahead**2
    assert at.bias_acceleration[0, 0] == pytest.approx(second, rel=1e-5)


def test_a_robot_is_put_on_it() -> None:
    for radius in (0.0, 0.05):
        ground = hs.Ground(shape=Waves())
        put = slider(radius).placed(hs.State([0.7, 1.0, 0.0], [0.0] * 3), ground)
        gap = hs.contact_kinematics(slider(radius), put.q, put.v, ground).gap
        np.testing.assert_allclose(gap, 0.0, atol=1e-12)


def test_a_run_on_it_is_kept_and_gone_on_with(tmp_path: Path) -> None:
    method = hs.TimeStepping(step=1e-3)
    run = slide(method, 0.05)
    path = run.save(tmp_path / "run.nc")
    again = hs.load_run(path, classes=[Bowl])
    assert again.ground.shape == BOWL
    np.testing.assert_array_equal(again.gap, run.gap)
    with pytest.raises(hs.RunFileError, match=r"shape 'Bowl'.*classes=\[Bowl\]"):
        hs.load_run(path)
    assert run.final is not None
    more = hs.simulate(run.robot, state=run.final, duration=0.01, method=method)
    whole = slide(method, 0.06)
    np.testing.assert_array_equal(more.position[-1], whole.position[-1])
    assert "Bowl" in repr(run.ground)


def test_shapes_that_are_none() -> None:
    class Bare(hs.GroundShape):
        pass

    for ground, words in (
        ({"shape": 3.0}, "shape must be a GroundShape"),
        ({"shape": BOWL, "slope": 0.1}, "a shape, or a slope or a profile"),
        ({"shape": Bowl(math.nan)}, "must be finite everywhere"),
    ):
        with pytest.raises(hs.SimulationError, match=words):
            hs.Ground(**ground)  # type: ignore[arg-type]
    with pytest.raises(hs.SimulationError, match="Bare has no kernel: write height"):
        hs.Ground(shape=Bare())
