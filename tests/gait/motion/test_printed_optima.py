"""Gaits with printed optima (M. P. Kelly 2016), found again or bettered.

Speed, step and some durations are given: what is found is one of the gaits among which the printed
one is least. Its cost is integrated here by MuJoCo's inverse dynamics, at many more instants than
the design looks at: a cost that swings between these would be seen.
"""

from __future__ import annotations

import numpy as np
import pytest
from closing import lacking, mechanics_of
from printed_optima import LIFTED, PRINTED, STEP, WEIGHT, found

import heelstrike as hs

INSTANTS = 400
SIDES = ("right", "left")
SMALL = 1e-3  # m, between the instants at which ranges are held
COUNTED = 0.05
"""Share of the cost by which sums over Gauss points may differ from the integral of |P|, which has
corners within pieces."""


@pytest.mark.parametrize("name", [*list(PRINTED)[:1], *(
    pytest.param(each, marks=pytest.mark.slow) for each in list(PRINTED)[1:]
)])  # fmt: skip
def test_a_printed_gait_is_reached(name: str) -> None:
    printed, motion = PRINTED[name], found(name)
    biped, robot = printed.biped, printed.biped.robot()
    mechanics = mechanics_of(robot, 0.0)
    assert motion.optimal
    assert robot.weight == pytest.approx(WEIGHT, rel=1e-5)
    assert robot.model.mass.max() == biped.hip
    assert lacking(mechanics, motion) < 1e-8 * WEIGHT
    spent, driven = 0.0, robot.model.actuator_joint
    largest = np.array([1.0 if robot.model.axis[j, 0] else 0.0 for j in driven])
    hips = np.array(["hip" in robot.joint_names[j] for j in driven])
    largest = np.where(hips, 0.5, biped.ankle) * largest * WEIGHT * biped.longest
    largest[largest == 0.0] = 4.0 * WEIGHT
    for phase in motion.phases:
        for t in phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS:
            q, v, a = (phase.coordinates(t, order=order) for order in range(3))
            now, force = mechanics.at(q, v), phase.forces(t)
            needed = now.mass @ a + now.force - np.einsum("ikj,ik->j", now.jacobian, force)
            spent += phase.duration / INSTANTS * float(np.abs(needed * v)[driven].sum())
            # Limits hold at the instants of the design; without refinement, only nearly between.
            assert np.all(np.abs(needed[driven]) < 1.05 * largest)
            legs = biped.longest + q[[robot.joint_names.index(f"{side}_leg") for side in SIDES]]
            assert np.all((legs > biped.shortest - SMALL) & (legs < biped.longest + SMALL))
    cost = spent / (WEIGHT * motion.distance)
    assert cost < printed.cost
    assert motion.spent == pytest.approx(spent, rel=COUNTED)


@pytest.mark.slow
def test_the_foot_is_lifted_as_in_the_printed_walk() -> None:
    robot, motion = PRINTED["walk"].biped.robot(), found("walk")
    single = motion.phases[1]
    for t in np.linspace(0.0, single.duration, INSTANTS):
        places = hs.dynamics.contact_positions(robot, single.coordinates(t))
        right, left = places[:2].mean(axis=0), places[2:].mean(axis=0)
        asked = 0.5 * LIFTED * (1.0 + np.cos(np.pi * (left[0] - right[0]) / STEP))
        assert left[1] > asked - 0.02 * LIFTED
