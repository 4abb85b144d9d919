"""Contact laws by themselves: bounds, derivatives, dissipation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heelstrike.compiler.compilation import uncompiled
from heelstrike.errors import SimulationError
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)

NORMAL = [HuntCrossley(), HuntCrossley(exponent=1.0, dissipation=0.0), KelvinVoigt()]
FRICTION = [RegularisedFriction(), BristleFriction()]

depths = st.floats(-1e-3, -1e-9)
speeds = st.floats(-2.0, 2.0)
bends = st.floats(-1e-3, 1e-3)
loads = st.floats(0.0, 1e4)
coefficients = st.floats(0.0, 2.0)


def force_of(law: Any, *point: float) -> Any:
    """What the kernel of a law says, in plain Python."""
    return uncompiled(type(law).force)(law, *point)


@pytest.mark.parametrize("law", NORMAL)
@given(gap=depths, speed=speeds)
def test_the_ground_never_pulls_and_loses_what_it_does_not_store(
    law: HuntCrossley | KelvinVoigt, gap: float, speed: float
) -> None:
    """F ≥ 0, and the power taken is at least the growth of the energy."""
    force, _, _ = force_of(law, gap, speed)
    assert force >= 0.0
    spring = law.stiffness * (-gap) ** getattr(law, "exponent", 1.0)
    assert (force - spring) * -speed >= -1e-12 * spring * abs(speed)


@pytest.mark.parametrize("law", FRICTION)
@given(mu=coefficients, load=loads, speed=speeds, bend=bends)
def test_friction_stays_in_the_cone_and_dissipates(
    law: RegularisedFriction | BristleFriction, mu: float, load: float, speed: float, bend: float
) -> None:
    """|F_t| ≤ μ F_n, and −F_t v ≥ d/dt (k s² / 2)."""
    (force, *_), (rate, *_), _ = force_of(law, mu, load, speed, bend)
    assert abs(force) <= mu * load
    stored = law.stiffness * bend * rate if isinstance(law, BristleFriction) else 0.0
    size = abs(force * speed) + abs(stored)
    assert -force * speed - stored >= -1e-12 * size


@pytest.mark.parametrize("law", NORMAL)
@given(gap=st.floats(-1e-3, -1e-6), speed=speeds)
def test_derivatives_of_the_normal_force(
    law: HuntCrossley | KelvinVoigt, gap: float, speed: float
) -> None:
    """Against central differences; skipped at the kink where the force vanishes."""

    def force(gap: float, speed: float) -> float:
        return float(force_of(law, gap, speed)[0])

    value, by_gap, by_speed = force_of(law, gap, speed)
    d = 1e-4 * abs(gap)
    e = 1e-5
    ends = (
        force(gap - d, speed),
        force(gap + d, speed),
        force(gap, speed - e),
        force(gap, speed + e),
    )
    if min(value, *ends) == 0.0:
        return
    assert (ends[1] - ends[0]) / (2 * d) == pytest.approx(by_gap, rel=1e-6, abs=1e-9 * value / d)
    assert (ends[3] - ends[2]) / (2 * e) == pytest.approx(by_speed, rel=1e-6, abs=1e-9 * value / e)


@pytest.mark.parametrize("law", [RegularisedFriction(speed=0.1), BristleFriction()])
@given(mu=st.floats(0.1, 2.0), load=st.floats(1.0, 1e4), speed=speeds, bend=bends)
def test_derivatives_of_friction(
    law: RegularisedFriction | BristleFriction, mu: float, load: float, speed: float, bend: float
) -> None:
    """Against central differences; skipped where the bristle is about to slide or to hold."""
    steps = np.array([1e-4 * load, 1e-4, 1e-8])

    def both(point: np.ndarray) -> np.ndarray:
        said, rate, _ = force_of(law, mu, *point)
        return np.array([said[0], rate[0]])

    at = np.array([load, speed, bend])
    said, rate, _ = force_of(law, mu, *at)
    if isinstance(law, BristleFriction):
        wanted = abs(law.stiffness * bend + law.damping * speed)
        if abs(wanted - mu * load) < 0.01 * mu * load + 10.0:
            return
    found = np.array(
        [
            (both(at + d) - both(at - d)) / (2 * h)
            for d, h in zip(np.diag(steps), steps, strict=True)
        ]
    )
    sizes = np.abs(both(at))
    given_partials = np.array([said[1:], rate[1:]]).T
    rounding = 1e-12 * (sizes + 1.0)[None, :] / steps[:, None]
    smooth = 1e-5 * np.abs(given_partials) + 1e-3 * (sizes / 0.1)[None, :] * [[0.0], [1e-3], [0.0]]
    assert np.all(np.abs(found - given_partials) <= rounding + smooth)


def test_defaults_carry_a_walker_within_a_tenth_of_a_millimetre() -> None:
    """75 kg on the two corners of one foot."""
    load = 0.5 * 75.0 * 9.81
    for law in (HuntCrossley(), KelvinVoigt()):
        assert 1e-5 < law.sink(load) < 1e-4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HuntCrossley(stiffness=0.0), "stiffness"),
        (lambda: HuntCrossley(stiffness=float("nan")), "stiffness"),
        (lambda: HuntCrossley(dissipation=-1.0), "dissipation"),
        (lambda: HuntCrossley(exponent=0.5), "exponent"),
        (lambda: KelvinVoigt(stiffness=-1.0), "stiffness"),
        (lambda: KelvinVoigt(damping=float("inf")), "damping"),
        (lambda: KelvinVoigt.from_sink(weight=1.0, sink=0.0, restitution=0.5), "sink"),
        (lambda: KelvinVoigt.from_sink(weight=1.0, sink=1e-3, restitution=0.0), "restitution"),
        (
            lambda: HuntCrossley.from_sink(weight=1.0, sink=1e-3, restitution=1.1, speed=1.0),
            "restitution",
        ),
        (lambda: HuntCrossley().restitution(0.0), "speed"),
        (lambda: RegularisedFriction(speed=0.0), "speed"),
        (lambda: RegularisedFriction().creep(1.0), "use of friction"),
        (lambda: BristleFriction(stiffness=0.0), "stiffness"),
        (lambda: BristleFriction(damping=0.0), "damping"),
    ],
)
def test_parameters_are_checked(make: object, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("law", "gap", "speed", "expected"),
    [
        # k δⁿ (1 + 3/2 a δ̇): going in, at rest, coming out.
        (HuntCrossley(stiffness=1e6, dissipation=0.4, exponent=1.0), -1e-3, -0.5, 1300.0),
        (HuntCrossley(stiffness=1e6, dissipation=0.4, exponent=2.0), -1e-3, 0.0, 1.0),
        (HuntCrossley(stiffness=1e6, dissipation=0.4, exponent=1.0), -1e-3, 0.5, 700.0),
        (KelvinVoigt(stiffness=1e6, damping=200.0), -1e-3, -0.5, 1100.0),
        (KelvinVoigt(stiffness=1e6, damping=200.0), -1e-3, 0.5, 900.0),
        (KelvinVoigt(stiffness=1e6, damping=200.0), -1e-3, 6.0, 0.0),
    ],
)
def test_normal_force_by_hand(
    law: HuntCrossley | KelvinVoigt, gap: float, speed: float, expected: float
) -> None:
    force, _, _ = force_of(law, gap, speed)
    assert force == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("law", "speed", "bend", "expected"),
    [
        # −μ F_n v / √(v² + v_s²) with μ F_n = 50 N.
        (RegularisedFriction(speed=0.4), 0.3, 0.0, (-30.0, 0.0)),
        (RegularisedFriction(speed=0.4), -0.3, 0.0, (30.0, 0.0)),
        # The bristle holds with k s + c v, and bends with the point; or slides.
        (BristleFriction(stiffness=1e4, damping=100.0), 0.1, 2e-3, (-30.0, 0.1)),
        (BristleFriction(stiffness=1e4, damping=100.0), 0.9, 2e-3, (-50.0, 0.3)),
        (BristleFriction(stiffness=1e4, damping=100.0), -0.9, -2e-3, (50.0, -0.3)),
    ],
)
def test_friction_by_hand(
    law: RegularisedFriction | BristleFriction,
    speed: float,
    bend: float,
    expected: tuple[float, float],
) -> None:
    (force, *_), (rate, *_), slides = force_of(law, 0.5, 100.0, speed, bend)
    assert (force, rate) == pytest.approx(expected, rel=1e-12)
    beyond = abs(speed) > law.speed if isinstance(law, RegularisedFriction) else abs(force) == 50.0
    assert slides == beyond
