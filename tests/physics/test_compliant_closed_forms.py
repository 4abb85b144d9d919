"""Compliant ground against what its laws say in closed form.

Tolerances of 1e-6 and below are what the integration leaves at `TIGHT`; where a larger one stands,
the test says what it is.
"""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import block, disc, point

import heelstrike as hs
from heelstrike.sim import EventKind
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    NormalLaw,
    RegularisedFriction,
)
from heelstrike.sim.compliant.method import Compliant

G = 9.81
TIGHT = {"rtol": 1e-9, "atol": 1e-11}
LAWS = [
    HuntCrossley(stiffness=1e7, dissipation=2.0),
    HuntCrossley(stiffness=1e9, dissipation=2.0, exponent=2.2),
    KelvinVoigt(stiffness=1e5, damping=300.0),
]


def settled(law: NormalLaw, mass: float) -> hs.State:
    """Return a point of the given mass at rest at its static sink."""
    return hs.State(np.array([0.0, -law.sink(mass * G)]), np.zeros(2))


@pytest.mark.parametrize("law", LAWS)
def test_static_sink(law: NormalLaw) -> None:
    """A point left on the ground comes to rest where the law carries its weight."""
    run = hs.simulate(
        point(mass=3.0),
        state=hs.State(np.zeros(2), np.zeros(2)),
        duration=20.0,
        method=Compliant(law=law, step=0.1, **TIGHT),
    )
    sink = law.sink(3.0 * G)
    # Hunt-Crossley's damping fades with the motion, which dies out like exp(−α g t / 2).
    assert -run.gap[-1, 0] == pytest.approx(sink, rel=1e-6)
    assert run.contact_force[-1, 0, 0] == pytest.approx(3.0 * G, rel=1e-6)


def impact(
    law: NormalLaw, mass: float, speed: float, *, step: float = 1e-4, duration: float = 0.1
) -> hs.Run:
    """A point hits the ground, after 0.2 ms without gravity."""
    return hs.simulate(
        point(mass=mass, gravity=0.0),
        state=hs.State(np.array([0.0, 2e-4 * speed]), np.array([0.0, -speed])),
        duration=duration,
        method=Compliant(law=law, step=step, **TIGHT),
    )


@pytest.mark.parametrize("damping", [0.0, 50.0, 300.0, 632.4555320336759, 2000.0])
def test_restitution_of_kelvin_voigt(damping: float) -> None:
    """e = exp(−2 ζ acos ζ / √(1 − ζ²)), under-, critically (k = 1e5, m = 1) and overdamped."""
    law = KelvinVoigt(stiffness=1e5, damping=damping)
    run = impact(law, 1.0, 0.5)
    assert run.velocity[-1, 1] / 0.5 == pytest.approx(law.restitution(1.0), abs=1e-7)
    zeta = damping / (2.0 * np.sqrt(1e5))
    if zeta < 1.0:
        exact = np.exp(-2.0 * zeta * np.arccos(zeta) / np.sqrt(1.0 - zeta**2))
        assert law.restitution(1.0) == pytest.approx(exact, rel=1e-9)


def test_contact_time_of_kelvin_voigt() -> None:
    """Half a period π √(m/k) without damping, between the events; with it, while the force acts."""
    law = KelvinVoigt(stiffness=1e5, damping=0.0)
    run = impact(law, 2.0, 0.5)
    down, up = run.events
    assert (down.kind, up.kind) == (EventKind.TOUCHDOWN, EventKind.LIFTOFF)
    assert down.time == pytest.approx(2e-4, abs=1e-9)
    assert up.time - down.time == pytest.approx(np.pi * np.sqrt(2.0 / 1e5), abs=1e-7)
    assert law.contact_time(2.0) == pytest.approx(np.pi * np.sqrt(2.0 / 1e5), rel=1e-12)
    damped = KelvinVoigt(stiffness=1e5, damping=200.0)
    run = impact(damped, 2.0, 0.5, step=1e-5)
    pressed = run.time[run.contact_force[:, 0, 0] > 0.0]
    assert pressed[-1] - pressed[0] == pytest.approx(damped.contact_time(2.0), abs=2e-5)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.5])
@pytest.mark.parametrize("mass", [0.5, 20.0])
def test_restitution_of_hunt_crossley(exponent: float, mass: float) -> None:
    """It depends on the speed alone, not on mass, stiffness or exponent."""
    law = HuntCrossley(stiffness=1e7, dissipation=3.0, exponent=exponent)
    run = impact(law, mass, 0.4, duration=1.0)
    assert run.velocity[-1, 1] / 0.4 == pytest.approx(law.restitution(0.4), abs=1e-6)


def test_restitution_of_hunt_crossley_is_one_less_alpha_v() -> None:
    """Hunt and Crossley's own result, e = 1 − α v + O((α v)²)."""
    law = HuntCrossley(stiffness=1e7, dissipation=0.5)
    for speed in (1e-1, 1e-2, 1e-3):
        simulated = impact(law, 1.0, speed).velocity[-1, 1] / speed
        assert simulated == pytest.approx(1.0 - 0.5 * speed, abs=(0.5 * speed) ** 2 + 1e-6)


@pytest.mark.parametrize("restitution", [0.05, 0.5, 0.9])
def test_laws_chosen_by_sink_and_restitution(restitution: float) -> None:
    soft = HuntCrossley.from_sink(weight=100.0, sink=1e-3, restitution=restitution, speed=0.3)
    linear = KelvinVoigt.from_sink(weight=100.0, sink=1e-3, restitution=restitution)
    mass = 100.0 / 9.80665
    assert soft.sink(100.0) == pytest.approx(1e-3, rel=1e-12)
    assert linear.sink(100.0) == pytest.approx(1e-3, rel=1e-12)
    for law in (soft, linear):
        run = impact(law, mass, 0.3)
        assert run.velocity[-1, 1] / 0.3 == pytest.approx(restitution, abs=1e-6)


def test_sliding_stop() -> None:
    """From 2 m/s with μ = 0.5 a point slides v²/(2 μ g) = 0.407747 m.

    The bristle, bent by μ m g / k = 4.9 µm while it slid, then pulls the point back by as much;
    regularised friction takes ∫ √(v² + v_s²) dv / (μ g).
    """
    law = KelvinVoigt(stiffness=1e6, damping=1e3)
    exact = 2.0**2 / (2.0 * 0.5 * G)

    def distance(friction: RegularisedFriction | BristleFriction) -> float:
        state = settled(law, 1.0)
        run = hs.simulate(
            point(),
            state=hs.State(state.q, np.array([2.0, 0.0])),
            duration=2.0,
            method=Compliant(law=law, friction=friction, **TIGHT),
            ground=hs.Ground(friction=0.5),
        )
        assert run.certificates.cone <= 1e-15
        return float(run.position[-1, 0])

    bristle = BristleFriction(stiffness=1e6, damping=1e3)
    assert distance(bristle) == pytest.approx(exact - 0.5 * G / 1e6, abs=1e-8)
    scale = 0.05
    ratio = 2.0 / scale
    smooth = 0.5 * scale**2 * (ratio * np.sqrt(1.0 + ratio**2) + np.arcsinh(ratio)) / (0.5 * G)
    assert distance(RegularisedFriction(speed=scale)) == pytest.approx(smooth, abs=1e-7)


def slide(friction: RegularisedFriction | BristleFriction, mu: float, angle: float) -> hs.Run:
    """A cube set flat and at rest on a slope."""
    normal = np.array([-np.sin(angle), np.cos(angle)])
    return hs.simulate(
        block(),
        state=hs.State(np.array([*(0.05 * normal), -angle]), np.zeros(3)),
        duration=2.0,
        method=Compliant(law=KelvinVoigt(stiffness=1e5, damping=500.0), friction=friction, **TIGHT),
        ground=hs.Ground(friction=mu, slope=angle),
    )


def test_regularised_friction_creeps_at_the_speed_it_says() -> None:
    """A cube on a slope of half the friction angle needs the fraction tan θ / μ of the friction."""
    friction = RegularisedFriction(speed=1e-3)
    angle = 0.5 * np.arctan(0.75)
    run = slide(friction, 0.75, angle)
    creep = friction.creep(np.tan(angle) / 0.75)
    # Both corners creep alike, though they carry different loads.
    assert np.hypot(*run.velocity[-1, :2]) == pytest.approx(creep, rel=1e-6)
    assert run.slip_velocity[-1] == pytest.approx(-creep, rel=1e-6)


@pytest.mark.parametrize("angle", [0.1, 0.5])
def test_bristle_sticks_just_above_the_critical_friction(angle: float) -> None:
    run = slide(BristleFriction(stiffness=1e5, damping=500.0), np.tan(angle) + 1e-2, angle)
    assert np.abs(run.velocity[-1]).max() <= 1e-12


@pytest.mark.parametrize("angle", [0.1, 0.5])
def test_bristle_slides_just_below_the_critical_friction(angle: float) -> None:
    """Once the landing is over the cube accelerates by g (sin θ − μ cos θ)."""
    mu = np.tan(angle) - 1e-2
    run = slide(BristleFriction(stiffness=1e5, damping=500.0), mu, angle)
    late = run.time >= 1.0
    rise = np.polyfit(run.time[late], np.hypot(*run.velocity[late, :2].T), 1)[0]
    assert rise == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)), rel=1e-6)


def test_cube_launched_flat_never_lifts() -> None:
    """0.1 m, 6 m/s, μ = 0.5: the friction tilts it within its sink, and no corner leaves."""
    law = KelvinVoigt(stiffness=1e6, damping=1e3)
    run = hs.simulate(
        block(),
        state=hs.State(np.array([0.0, 0.05 - law.sink(0.5 * G), 0.0]), np.array([6.0, 0.0, 0.0])),
        duration=2.0,
        method=Compliant(law=law, friction=BristleFriction(stiffness=1e6, damping=1e3), **TIGHT),
        ground=hs.Ground(friction=0.5),
    )
    assert run.gap.max() <= 0.0
    assert np.abs(run.velocity[-1]).max() <= 1e-9


def test_rolling_disc() -> None:
    """A disc rolls down a slope with 2/3 g sin θ; the bristle rolls along and does not brake it."""
    angle, law = 0.2, KelvinVoigt(stiffness=1e5, damping=500.0)
    normal = np.array([-np.sin(angle), np.cos(angle)])
    run = hs.simulate(
        disc(),
        state=hs.State(
            np.array([*((0.2 - law.sink(G * np.cos(angle))) * normal), 0.0]), np.zeros(3)
        ),
        duration=2.0,
        method=Compliant(law=law, friction=BristleFriction(stiffness=1e5, damping=500.0), **TIGHT),
        ground=hs.Ground(friction=0.75, slope=angle),
    )
    late = run.time >= 1.0
    rise = np.polyfit(run.time[late], np.hypot(*run.velocity[late, :2].T), 1)[0]
    # The sunken disc rolls on a radius shorter by nothing: friction acts at its lowest point.
    assert rise == pytest.approx(2.0 / 3.0 * G * np.sin(angle), rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("friction", [RegularisedFriction(speed=1e-2), BristleFriction()])
def test_energy_is_never_created(
    law: NormalLaw, friction: RegularisedFriction | BristleFriction
) -> None:
    """A block thrown at the ground tumbles and bounces; robot and springs together only lose.

    The bristles' own energy, at most (μ F_n)²/2k, is not in the record and stays below the largest
    value it can have.
    """
    run = hs.simulate(
        block(),
        state=hs.State(np.array([0.0, 0.2, 0.4]), np.array([1.0, -0.5, 3.0])),
        duration=1.5,
        method=Compliant(law=law, friction=friction, **TIGHT),
    )
    speed, height = run.velocity, run.position[:, 1]
    inertia = 1.0 * (0.1**2 + 0.1**2) / 12.0
    energy = (
        0.5 * (speed[:, 0] ** 2 + speed[:, 1] ** 2 + inertia * speed[:, 2] ** 2)
        + G * height
        + law.stored_energy(run.gap).sum(axis=1)
    )
    hidden = 0.0
    if isinstance(friction, BristleFriction):
        hidden = 2.0 * (0.75 * run.contact_force[:, :, 0].max()) ** 2 / (2.0 * friction.stiffness)
    assert len(run.events) >= 4
    assert np.diff(energy).max() <= 1e-8 + hidden
    assert energy[-1] < 0.7 * energy[0]


def test_impulse_is_the_change_of_momentum() -> None:
    """The recorded mean forces, times the step, add up to what the motion says.

    They are trapezia over the steps of the integration, second order: 1e-4 of the impulse here.
    """
    law = HuntCrossley(stiffness=1e7, dissipation=2.0)
    run = impact(law, 2.0, 0.5)
    gained = 2.0 * (run.velocity[-1, 1] + 0.5)
    assert run.contact_force[:-1, 0, 0].sum() * 1e-4 == pytest.approx(gained, rel=1e-4)


def test_third_order_and_stable_on_stiff_ground() -> None:
    """A point oscillates on its ground; with every step accepted the error falls as h³.

    On ground 1e4 times stiffer the same steps, 100 times the period of its oscillation, damp it
    out.
    """
    loose = {"rtol": 1e9, "atol": 1e9}
    law = HuntCrossley(stiffness=1e7, dissipation=2.0)
    low = hs.State(np.array([0.0, -1.3 * law.sink(G)]), np.zeros(2))

    def end(step: float) -> float:
        run = hs.simulate(
            point(), state=low, duration=0.016, method=Compliant(law=law, step=step, **loose)
        )
        assert run.steps == round(0.016 / step)
        return float(run.position[-1, 1])

    exact = hs.simulate(
        point(),
        state=low,
        duration=0.016,
        method=Compliant(law=law, step=1e-3, rtol=1e-12, atol=1e-14),
    ).position[-1, 1]
    steps = np.array([4e-4, 2e-4, 1e-4, 5e-5])
    errors = np.array([abs(end(step) - exact) for step in steps])
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders[-1] >= 2.9, (orders, errors)

    stiff = KelvinVoigt(stiffness=1e9, damping=0.0)
    run = hs.simulate(
        point(),
        state=hs.State(np.array([0.0, -1.3 * stiff.sink(G)]), np.zeros(2)),
        duration=0.2,
        method=Compliant(law=stiff, step=1e-3, **loose),
    )
    assert run.gap[-1, 0] == pytest.approx(-stiff.sink(G), rel=1e-6)
