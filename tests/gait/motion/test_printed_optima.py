"""Gaits with printed optima (M. P. Kelly 2016), found again or bettered.

What is found is one of the gaits among which the printed one is least. Its cost is integrated here
by MuJoCo's inverse dynamics, at many more instants than the design looks at: a cost that swings
between these would be seen.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from closing import lacking, mechanics_of
from printed_limits import audit
from printed_optima import FAR, PRINTED, RUNNER, SLOWEST, WALKER, WEIGHT, Biped, found

from heelstrike.gait import Instant

INSTANTS = 400
REACHED = {"run": 1.005, "run, the other": 1.005, "walk": 1.0}
"""Cost in units of the printed one: his stored forces cost 1.0036, 1.0025 and 1.039."""
BETWEEN = 1.3
"""Shares of the limits of rates that are used between the instants of the design."""


@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTED)
def test_a_printed_gait_is_reached(name: str) -> None:
    printed, motion = PRINTED[name], found(name)
    biped, robot = printed.biped, printed.biped.robot()
    mechanics = mechanics_of(robot, 0.0)
    assert motion.optimal
    assert robot.weight == pytest.approx(WEIGHT, rel=1e-5)
    assert robot.model.mass.max() == biped.hip
    assert lacking(mechanics, motion) < 1e-8 * WEIGHT
    spent, driven = 0.0, robot.model.actuator_joint
    for phase in motion.phases:
        for t in phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS:
            q, v, a = (phase.coordinates(t, order=order) for order in range(3))
            now, force = mechanics.at(q, v), phase.forces(t)
            needed = now.mass @ a + now.force - np.einsum("ikj,ik->j", now.jacobian, force)
            powers = biped.powers(needed[driven], v[driven])
            spent += phase.duration / INSTANTS * float(np.abs(powers).sum())
            assert np.all(np.abs(needed[driven]) < 1.01 * biped.sizes)
    assert spent / (WEIGHT * motion.distance) < REACHED[name] * printed.cost
    told = audit(biped, motion)
    for what in ("rate of leg", "rate of hip", "growth", "turning"):
        assert told.used[what] < BETWEEN


def instant(
    biped: Biped, torque: list[float], rate: list[float], load: float, share: float
) -> Instant:
    """An instant of a run in stance, the left foot in the air, legs upright and at rest."""
    still = np.zeros(7)
    still[6] = -0.1
    return Instant(
        position=casadi.DM(still), velocity=casadi.DM.zeros(7), torque=casadi.DM(torque),
        motor_velocity=casadi.DM.zeros(4), force=casadi.DM.zeros(2),
        points=casadi.DM([[0.0, 0.0], [0.0, 0.1]]),
        point_force=casadi.DM([[load, 0.0], [0.0, 0.0]]),
        stands=casadi.DM([1.0, 0.0]), share=casadi.DM(share), torque_rate=casadi.DM(rate),
    )  # fmt: skip


def test_limits_are_his() -> None:
    """Each limit of a run, at what it allows and a little more."""
    big = RUNNER.sizes
    assert big == pytest.approx(np.array([0.5, 4.0, 0.5, 4.0]) * WEIGHT)
    for k in range(4):
        for more, kept in ((0.999, True), (1.001, False)):
            rate = np.zeros(4)
            rate[k] = -more * big[k] / SLOWEST
            now = instant(RUNNER, [0.0] * 4, rate.tolist(), WEIGHT, 0.5)
            assert bool(casadi.mmin(RUNNER.kept(now, 0.6)) >= 0.0) is kept
    for share, load, kept in (
        (1.0, 0.5e-3, True), (1.0, 2e-3, False), (0.5, 0.4 * FAR, True),
    ):  # fmt: skip
        now = instant(RUNNER, [0.0] * 4, [0.0] * 4, load * WEIGHT, share)
        assert bool(casadi.mmin(RUNNER.kept(now, 0.6)) >= 0.0) is kept
    for torque, kept in (([9.0, 0.0, -9.0, 0.0], True), ([9.0, 0.0, -8.9, 0.0], False)):
        now = instant(RUNNER, torque, [0.0] * 4, WEIGHT, 0.5)
        assert bool(casadi.mmin(RUNNER.kept(now, 0.6)) >= 0.0) is kept
    low = replace(
        instant(RUNNER, [0.0] * 4, [0.0] * 4, WEIGHT, 0.5),
        points=casadi.DM([[0.0, 0.0], [0.0, 0.019]]),
    )
    assert float(casadi.mmin(RUNNER.kept(low, 0.6))) < 0.0


def test_the_hip_spends_what_both_legs_move() -> None:
    """Legs that swing alike spend nothing; those that part spend the torque times how fast."""
    alike = RUNNER.powers(np.array([3.0, 0.0, -3.0, 0.0]), np.array([1.0, 0.0, 1.0, 0.0]))
    apart = RUNNER.powers(np.array([3.0, 0.0, -3.0, 0.0]), np.array([1.0, 2.0, -1.0, 0.0]))
    assert alike == pytest.approx([0.0, 0.0, 0.0])
    assert apart == pytest.approx([6.0, 0.0, 0.0])
    assert len(WALKER.powers(np.zeros(6), np.zeros(6))) == 5
