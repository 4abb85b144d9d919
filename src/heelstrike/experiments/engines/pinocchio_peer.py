"""Pinocchio's part of a step: forward dynamics without contact, by the articulated-body algorithm.

Pinocchio has no simulation loop. Its function for batches runs in compiled code on one thread here,
so that no time of Python is in what is measured. Contacts, control and integration are not in it
either: it is a part of a step, and comparing it with whole steps flatters it.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
import pinocchio

from heelstrike.dynamics import forward_dynamics
from heelstrike.experiments.engines.links import links, space
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

BATCH = 2000
ERROR = 1e-9
"""Largest difference from our accelerations, relative to the largest of them."""


class ForwardDynamics:
    """Accelerations of a robot about the start of a scenario, many at a time.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario) -> None:
        robot = scenario.robot
        self._robot = robot
        self._pool = pinocchio.ModelPool(model_of(scenario), 1)
        rng = np.random.default_rng(0)
        shape = (robot.nv, BATCH)
        self._q = np.asfortranarray(scenario.state.q[:, None] + 0.1 * rng.standard_normal(shape))
        self._v = np.asfortranarray(rng.standard_normal(shape))
        self._force = np.asfortranarray(10.0 * rng.standard_normal(shape))
        self._theirs = np.asfortranarray(self._q - robot.model.reference[:, None])
        self._acceleration = np.zeros(shape, order="F")

    def run(self) -> float:
        """Compute all of them; return the seconds that one takes."""
        begin = perf_counter()
        pinocchio.abaInParallel(
            1, self._pool, self._theirs, self._v, self._force, self._acceleration
        )
        return (perf_counter() - begin) / BATCH

    def check(self) -> dict[str, float]:
        """Compare some of them with ours.

        Raises
        ------
        InvalidRunError
            If they are not the same.
        """
        self.run()
        worst = 0.0
        for k in range(10):
            ours = forward_dynamics(self._robot, self._q[:, k], self._v[:, k], self._force[:, k])
            scale = max(1.0, float(np.max(np.abs(ours))))
            worst = max(worst, float(np.max(np.abs(ours - self._acceleration[:, k]))) / scale)
        if not worst <= ERROR:
            raise InvalidRunError(f"its accelerations differ by {worst:.1e} of the largest")
        return {"acceleration_error": worst}


def model_of(scenario: Scenario) -> Any:
    """Return Pinocchio's model of the robot of a scenario, link by link.

    Parameters
    ----------
    scenario : Scenario
        What is simulated.
    """
    robot = scenario.robot
    model = pinocchio.Model()
    for i, link in enumerate(links(robot)):
        place = pinocchio.SE3(np.eye(3), link.place)
        index = model.addJoint(link.parent + 1, _joint(link.hinge, link.axis), place, f"joint{i}")
        inertia = np.diag([link.inertia] * 3)
        body = pinocchio.Inertia(link.mass, link.center, inertia)
        model.appendBodyToJoint(index, body, pinocchio.SE3.Identity())
    model.gravity.linear = space(robot.model.gravity)
    model.armature = robot.model.armature.copy()
    return model


def _joint(hinge: bool, axis: Floats) -> Any:
    """Its quickest joint about or along an axis."""
    if hinge:
        if axis[1] == 1.0:
            return pinocchio.JointModelRY()
        return pinocchio.JointModelRevoluteUnaligned(axis)
    if axis[0] == 1.0:
        return pinocchio.JointModelPX()
    if axis[2] == 1.0:
        return pinocchio.JointModelPZ()
    return pinocchio.JointModelPrismaticUnaligned(axis)
