"""Costs and constraints that depend on rates of torques, on forces of points, and on the phase."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait import Instant
from heelstrike.gait.motion.program import looked_at

PHASES = [
    hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
    hs.ContactPhase(duration=(0.05, 0.3), pieces=2),
]
ASKED = {"speed": 2.0, "starts": 1, "refine": False}
INSTANTS = 400
SOFT = 0.02
"""Time (s) that weighs rates of torques beside torques."""
COUNTED = 0.02
"""Share by which sums over Gauss points may differ from those over many instants."""
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


def test_rates_of_torques_are_limited(rabbit: hs.Robot, usual: hs.Motion) -> None:
    before = max(np.abs(each).max() for each in rates(rabbit, usual))
    most = 0.5 * before

    def slow(now: Instant) -> casadi.SX:
        return casadi.vertcat(1.0 - now.torque_rate / most, 1.0 + now.torque_rate / most)

    motion = hs.optimize_motion(rabbit, PHASES, **ASKED, constraint=slow, warm_start=usual)
    # Were torques to jump between pieces, differences over so short a time would be far larger.
    assert max(np.abs(each).max() for each in rates(rabbit, motion)) < BETWEEN * most
    assert motion.cost / motion.distance > usual.cost / usual.distance


def test_where_rates_matter_every_piece_is_looked_at_where_it_begins() -> None:
    """Rates jump there: what holds at the end of one piece need not hold on."""
    for rated, begun in ((False, [0]), (True, [0, 1, 2])):
        grid = looked_at(3, rated)
        assert grid.piece[grid.share == 0.0].tolist() == begun
        assert grid.piece[grid.share == 1.0].tolist() == [0, 1, 2]


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
        pressed = now.point_force[foot, 1] / rabbit.weight
        return 20.0 * (1.0 - now.share) + (1.0 - now.stands[foot]) + room - pressed

    motion = hs.optimize_motion(rabbit, PHASES, **ASKED, constraint=unloaded, warm_start=usual)
    last, before = (
        each.phases[0].forces(each.phases[0].duration)[foot, 0] for each in (motion, usual)
    )
    assert last < 2.0 * room * rabbit.weight
    assert before > 0.1 * rabbit.weight
