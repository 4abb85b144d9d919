"""Costs and constraints that depend on rates of torques, on forces of points, and on the phase."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
import pytest
from numpy.polynomial import Chebyshev

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait import Instant
from heelstrike.gait.cost import costs_of
from heelstrike.gait.motion.instant import MotionFunctions

PHASES = [
    hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
    hs.ContactPhase(duration=(0.05, 0.3), pieces=2),
]
ASKED = {"speed": 2.0, "starts": 1, "refine": False}
INSTANTS = 400
DEGREE = 15
"""Degree of polynomials that are torques on a piece, to rounding."""
CLOSED = 1e-8
ALLOWED = 1e-4
"""Share by which a limit may be exceeded between the instants at which it holds, once refined."""
SOFT = 0.02
"""Time (s) that weighs rates of torques beside torques."""
COUNTED = 0.02
"""Share by which sums over Gauss points may differ from those over many instants."""
SLOWER = 0.35
"""Share of the usual rates that is allowed. Rates are then greatest where pieces begin: 4 % more
than this if they are limited in the pieces and at their ends only."""
KEPT = 1e-6
"""Share by which a limit may be exceeded at instants at which it holds."""
BETWEEN = 1.05
"""Limits hold at instants; between them they are nearly kept."""


@pytest.fixture(scope="module")
def rabbit() -> hs.Robot:
    return hs.load_robot("rabbit")


@pytest.fixture(scope="module")
def usual(rabbit: hs.Robot) -> hs.Motion:
    return hs.optimize_motion(rabbit, PHASES, **ASKED)


def torques(robot: hs.Robot, phase: hs.gait.MotionPhase, times: np.ndarray) -> np.ndarray:
    """Torques by inverse dynamics, (N, nu)."""
    found = []
    for t in times:
        q, v, a = (phase.coordinates(t, order=order) for order in range(3))
        pushed = np.einsum("ikj,ik->j", dynamics.contact_jacobian(robot, q), phase.forces(t))
        found.append((dynamics.inverse_dynamics(robot, q, v, a) - pushed)[3:])
    return np.array(found)


def rates(robot: hs.Robot, motion: hs.Motion) -> list[np.ndarray]:
    """Differences of torques over those of time, of each phase."""
    found = []
    for phase in motion.phases:
        times = np.linspace(0.0, phase.duration, INSTANTS)
        moved = torques(robot, phase, times)
        found.append(np.diff(moved, axis=0) / np.diff(times)[:, None])
    return found


def rates_where_pieces_begin(robot: hs.Robot, motion: hs.Motion) -> np.ndarray:
    """Derivatives of the torques just after the beginning of every piece, (N, nu)."""
    found = []
    for phase in motion.phases:
        for begin, end in pairwise(phase.breakpoints):
            # Within a piece torques are smooth: polynomials of high degree go on to its ends.
            inside = 0.5 - 0.5 * np.cos(np.pi * (np.arange(DEGREE + 5) + 0.5) / (DEGREE + 5))
            times = begin + (end - begin) * inside
            found.append(
                [
                    Chebyshev.fit(times, torque, DEGREE, domain=(begin, end)).deriv()(begin)
                    for torque in torques(robot, phase, times).T
                ]
            )
    return np.array(found)


def slower(most: float) -> Callable[[Instant], casadi.SX]:
    """Limit the rates of all torques."""
    return lambda now: casadi.vertcat(1.0 - now.torque_rate / most, 1.0 + now.torque_rate / most)


def test_rates_of_torques_are_limited(rabbit: hs.Robot, usual: hs.Motion) -> None:
    before = max(np.abs(each).max() for each in rates(rabbit, usual))
    most = SLOWER * before
    motion = hs.optimize_motion(rabbit, PHASES, **ASKED, constraint=slower(most), warm_start=usual)
    # Were torques to jump between pieces, differences over so short a time would be far larger.
    assert max(np.abs(each).max() for each in rates(rabbit, motion)) < BETWEEN * most
    assert motion.cost / motion.distance > usual.cost / usual.distance
    # Rates jump where pieces join, so that they are limited on both sides.
    assert np.abs(rates_where_pieces_begin(rabbit, motion)).max() < (1.0 + KEPT) * most


@pytest.mark.slow
def test_limited_rates_are_refined(rabbit: hs.Robot, usual: hs.Motion) -> None:
    most = SLOWER * max(np.abs(each).max() for each in rates(rabbit, usual))
    asked = ASKED | {"refine": True}
    motion = hs.optimize_motion(rabbit, PHASES, **asked, constraint=slower(most), warm_start=usual)
    assert motion.closes_to < CLOSED
    assert max(np.abs(each).max() for each in rates(rabbit, motion)) < (1.0 + ALLOWED) * most
    assert np.abs(rates_where_pieces_begin(rabbit, motion)).max() < (1.0 + ALLOWED) * most


def test_rates_that_nobody_asks_for_are_not_traced(rabbit: hs.Robot, monkeypatch: Any) -> None:
    def traced(*_: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(MotionFunctions, "_build_joining", traced)
    functions = MotionFunctions(rabbit, costs_of("torque"), per_metre=False)
    assert not functions.rated
    with pytest.raises(AssertionError):
        MotionFunctions(rabbit, lambda now: casadi.sumsqr(now.torque_rate), per_metre=False)


def test_gaits_of_one_step_say_what_they_do_not_know(rabbit: hs.Robot) -> None:
    with pytest.raises(hs.GaitError, match=r"Only instants of motions .* have .*torque_rate"):
        hs.optimize_gait(
            rabbit, step_length=0.3, step_duration=0.5,
            cost=lambda now: casadi.sumsqr(now.torque_rate),
        )  # fmt: skip


def test_rates_of_torques_are_a_cost(rabbit: hs.Robot, usual: hs.Motion) -> None:
    def soft(now: Instant) -> casadi.SX:
        return casadi.sumsqr(now.torque) + casadi.sumsqr(SOFT * now.torque_rate)

    motion = hs.optimize_motion(rabbit, PHASES, **ASKED, cost=soft, warm_start=usual)

    def spent(of: hs.Motion) -> float:
        times = [phase.duration / (INSTANTS - 1) for phase in of.phases]
        of_phases = zip(rates(rabbit, of), times, strict=True)
        return SOFT**2 * sum(float((rate**2).sum()) * dt for rate, dt in of_phases)

    assert motion.optimal
    assert motion.spent == pytest.approx(motion.cost + spent(motion), rel=COUNTED)
    assert spent(motion) / motion.distance < 0.7 * spent(usual) / usual.distance


def test_a_foot_is_unloaded_before_it_leaves(rabbit: hs.Robot, usual: hs.Motion) -> None:
    """Only where it stands, and at the end of the phase."""
    foot, room = rabbit.contact_names.index(usual.phases[0].contacts[0]), 1e-3

    def unloaded(now: Instant) -> casadi.SX:
        pressed = now.point_force[foot, 0] / rabbit.weight
        return 20.0 * (1.0 - now.share) + (1.0 - now.stands[foot]) + room - pressed

    motion = hs.optimize_motion(rabbit, PHASES, **ASKED, constraint=unloaded, warm_start=usual)
    last, before = (
        each.phases[0].forces(each.phases[0].duration)[foot, 0] for each in (motion, usual)
    )
    assert last < 2.0 * room * rabbit.weight
    assert before > 0.1 * rabbit.weight
