"""Costs of a gait: each is least where it was asked to be, and is the integral that it says."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from gait_motion import instant

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Cost, Instant
from heelstrike.gait.cost_rate import ROUNDED, rate_of

STEP = {"step_length": 0.30, "step_duration": 0.70, "starts": 1}


def spent(robot: hs.Robot, gait: hs.Gait) -> tuple[float, float]:
    """∫ Σ Γ² dt and ∫ Σ |P| dt of a gait, by another quadrature of other code."""
    times = np.linspace(0.0, gait.step_duration, 400, endpoint=False) + gait.step_duration / 800
    moments = [instant(robot, gait, t) for t in times]
    torque = np.array([each.torque for each in moments])
    speed = np.array([each.v[robot.model.actuator_joint] for each in moments])
    each = gait.step_duration / 400
    return float(each * (torque**2).sum()), float(each * np.abs(torque * speed).sum())


@pytest.fixture(scope="module")
def thrifty(bravo7: hs.Robot) -> hs.Gait:
    return hs.optimize_gait(bravo7, **STEP, cost="mechanical_energy")


def test_least_energy_costs_less_energy_and_more_torque(
    bravo7: hs.Robot, gait: hs.Gait, thrifty: hs.Gait
) -> None:
    torque, energy = spent(bravo7, gait)
    more, less = spent(bravo7, thrifty)
    assert less < 0.99 * energy
    assert more > 1.01 * torque
    assert gait.spent == pytest.approx(gait.cost, rel=1e-12)
    assert gait.cost == pytest.approx(torque, rel=1e-4)
    assert thrifty.cost == pytest.approx(more, rel=1e-4)


def test_what_was_spent_is_the_integral(bravo7: hs.Robot, thrifty: hs.Gait) -> None:
    """Short by what |P| is rounded off, which is at most a known power for each motor."""
    _, energy = spent(bravo7, thrifty)
    height = 0.9
    unit = bravo7.weight * height / np.sqrt(height / 9.81)
    rounded = ROUNDED * unit * 0.7 * bravo7.nu
    assert thrifty.spent is not None
    assert energy - rounded < thrifty.spent < energy + 1e-3 * energy


@pytest.mark.parametrize("power", [-300.0, -1.0, -0.01, 0.0, 0.02, 0.5, 40.0])
def test_corners_are_rounded_as_wide_as_told(power: float) -> None:
    """|P| as √(P² + ε²) − ε, and what is greater, P or zero, as half of P more than that."""
    unit = 700.0
    now = Instant(
        position=casadi.SX(1, 1), velocity=casadi.SX(1, 1), torque=casadi.SX(2.0),
        motor_velocity=casadi.SX(0.5 * power), force=casadi.SX(2, 1),
    )  # fmt: skip
    width, heat = ROUNDED * unit, np.array([0.25])

    def rate(cost: Cost, heat: Any) -> float:
        return float(casadi.DM(rate_of({cost: 3.0}, now, heat, unit)))

    mechanical = np.sqrt(power**2 + width**2) - width
    assert rate(Cost.MECHANICAL_ENERGY, None) == pytest.approx(3.0 * mechanical, rel=1e-12)
    spent = power + 1.0
    electrical = 0.5 * (spent + np.sqrt(spent**2 + width**2) - width)
    assert rate(Cost.ELECTRICAL_ENERGY, heat) == pytest.approx(3.0 * electrical, rel=1e-12)


def test_weights_and_a_function_of_ones_own_say_the_same(bravo7: hs.Robot) -> None:
    both = hs.optimize_gait(bravo7, **STEP, cost={"torque": 2.0})
    own = hs.optimize_gait(bravo7, **STEP, cost=lambda now: 2.0 * casadi.sumsqr(now.torque))
    assert own.spent == pytest.approx(both.spent, rel=1e-9)
    assert own.spent == pytest.approx(2.0 * own.cost, rel=1e-12)


def of_others(_: Any) -> Any:
    return casadi.SX.sym("mine")


def broken(_: Any) -> Any:
    raise ValueError("not today")


@pytest.mark.parametrize(
    ("cost", "words"),
    [
        ("speed", "cost must be one of 'torque'"),
        ({"torque": -1.0}, "positive weights"),
        ({}, "cost must be"),
        (3, "cost must be"),
        ("electrical_energy", "needs motors"),
        (of_others, "symbols that no instant has: mine"),
        (broken, "the cost function failed: ValueError: not today"),
        (lambda now: now.torque, "must return one number, got 6"),
    ],
)
def test_costs_that_are_none(bravo7: hs.Robot, cost: Any, words: str) -> None:
    with pytest.raises(GaitError, match=words):
        hs.optimize_gait(bravo7, **STEP, cost=cost)


def test_electrical_energy_counts_the_heat(bravo7: hs.Robot) -> None:
    """∫ Σ max(P + Γ² ω₀/τ₀, 0) dt of motors that get very hot is nearly the torque cost."""
    hot = bravo7.model.replaced(
        stall_torque=np.where(np.arange(9) > 2, 400.0, np.inf),
        no_load_speed=np.where(np.arange(9) > 2, 4e4, np.inf),
    )
    from dataclasses import replace

    robot = replace(bravo7, model=hot)
    gait = hs.optimize_gait(robot, **STEP, cost="electrical_energy")
    assert gait.spent == pytest.approx(100.0 * gait.cost, rel=0.05)
