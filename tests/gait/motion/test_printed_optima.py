"""Gaits with printed optima (M. P. Kelly 2016), found again or bettered.

The robot has no torque at the ankle, speed and step are given: what is found is one of the gaits
among which the printed one is least. Its cost is integrated here by MuJoCo's inverse dynamics.
"""

from __future__ import annotations

import numpy as np
import pytest
from closing import lacking, mechanics_of
from printed_optima import HIP, LONGEST, PRINTED, SHORTEST, WEIGHT, found, telescoping_biped

INSTANTS = 400
SIDES = ("right", "left")
SMALL = 1e-3  # m, between the instants at which ranges are held


@pytest.mark.parametrize("name", [*list(PRINTED)[:1], *(
    pytest.param(each, marks=pytest.mark.slow) for each in list(PRINTED)[1:]
)])  # fmt: skip
def test_a_printed_run_is_reached(name: str) -> None:
    robot, printed, motion = telescoping_biped(), PRINTED[name], found(name)
    mechanics = mechanics_of(robot, 0.0)
    assert motion.optimal
    assert robot.weight == pytest.approx(WEIGHT)
    assert robot.model.mass.max() == HIP
    assert lacking(mechanics, motion) < 1e-8 * WEIGHT
    spent, driven = 0.0, robot.model.actuator_joint
    for phase in motion.phases:
        assert phase.duration >= 0.02 - 1e-9
        for t in phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS:
            q, v, a = (phase.coordinates(t, order=order) for order in range(3))
            now, force = mechanics.at(q, v), phase.forces(t)
            needed = now.mass @ a + now.force - np.einsum("ikj,ik->j", now.jacobian, force)
            spent += phase.duration / INSTANTS * float(np.abs(needed * v)[driven].sum())
            legs = LONGEST + q[[robot.joint_names.index(f"{side}_leg") for side in SIDES]]
            assert np.all((legs > SHORTEST - SMALL) & (legs < LONGEST + SMALL))
    assert 1.2 <= motion.speed <= 2.0
    assert spent / (WEIGHT * motion.distance) < printed.cost
