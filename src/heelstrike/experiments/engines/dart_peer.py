"""DART's side of a comparison: boxed linear complementarity, a World stepped from Python."""

from __future__ import annotations

from typing import Any

import dartpy
import numpy as np

from heelstrike.experiments.engines.links import links, space
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

LEAST_RADIUS = 1e-4
"""Least radius of a contact point, in m: its collision detectors want spheres of some size."""
LEAST_MASS = 1e-12
"""Mass (kg) and inertia (kg m²) that stand for none."""


class DartPeer(Peer):
    """A scenario in DART. Springs and dampers are those of its joints.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    detector : str
        Of collisions: ``"DART"``, its own and the quickest, ``"FCL"``, ``"ODE"`` or ``"BULLET"``.
    split : bool
        Whether penetrations are taken back apart from velocities.
    """

    settling = 0.2
    lacks = ("armature",)

    def __init__(
        self, scenario: Scenario, step: float, *, detector: str = "DART", split: bool = False
    ) -> None:
        super().__init__(scenario, step)
        self._world, self._robot = _world(scenario, step, detector)
        self._world.getConstraintSolver().setSplitImpulseEnabled(split)
        model = scenario.robot.model
        self._forces = np.zeros((len(self.commands), scenario.robot.nv))
        self._forces[:, model.actuator_joint] = self.commands

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        self._world.reset()
        self._robot.setPositions(q)
        self._robot.setVelocities(v)
        self._robot.setCommands(self._forces[0])

    def simulate(self, steps: int) -> None:
        """Simulate some steps, each with a call from Python: it has no loop of its own."""
        step, command = self._world.step, self._robot.setCommands
        if len(self._forces) == 1:
            for _ in range(steps):
                step(False)  # and keep the commands
            return
        for forces in self._forces[self.done : self.done + steps]:
            command(forces)
            step(False)

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        return self._robot.getPositions(), self._robot.getVelocities()

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        self._forces = np.zeros((1, self.scenario.robot.nv))
        self._forces[0, self.scenario.robot.model.actuator_joint] = torque
        self._robot.setCommands(self._forces[0])

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        found = np.zeros((self.scenario.robot.nc, 2))
        for contact in self._world.getLastCollisionResult().getContacts():
            first = contact.collisionObject1.getShapeFrame().getName()
            second = contact.collisionObject2.getShapeFrame().getName()
            # It acts on the first of the two.
            own, sign = (first, 1.0) if first.isdigit() else (second, -1.0)
            found[int(own)] += sign * contact.force[2], sign * contact.force[0]
        return found

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact in the last step."""
        found = self._world.getLastCollisionResult().getContacts()
        return [(abs(float(each.force[2])), float(each.penetrationDepth)) for each in found]


def _world(scenario: Scenario, step: float, detector: str) -> tuple[Any, Any]:
    world = dartpy.simulation.World()
    world.setGravity(space(scenario.robot.model.gravity))
    world.setTimeStep(step)
    awake = dartpy.simulation.DeactivationOptions()
    awake.mEnabled = False  # what rests would be skipped
    world.setDeactivationOptions(awake)
    detectors = dartpy.simulation.CollisionDetectorType
    world.setCollisionDetector(getattr(detectors, detector))
    skeleton = _skeleton(scenario)
    world.addSkeleton(_ground(scenario))
    world.addSkeleton(skeleton)
    return world, skeleton


def _ground(scenario: Scenario) -> Any:
    ground = dartpy.dynamics.Skeleton("ground")
    _, floor = ground.createWeldJointAndBodyNodePair()
    block = floor.createShapeNode(dartpy.dynamics.BoxShape([100.0, 10.0, 1.0]))
    block.setRelativeTranslation([0.0, 0.0, -0.5])
    _touch(block, scenario.friction, 1.0)  # restitutions are multiplied
    ground.setMobile(False)
    return ground


def _skeleton(scenario: Scenario) -> Any:
    """Links, joints, contact points, springs and dampers."""
    robot, feedback = scenario.robot, scenario.feedback
    model = robot.model
    dynamics = dartpy.dynamics
    skeleton = dynamics.Skeleton("robot")
    bodies: list[Any] = []
    for link in links(robot, least_radius=LEAST_RADIUS):
        parent = bodies[link.parent] if link.parent >= 0 else None
        kind = "Revolute" if link.hinge else "Prismatic"
        properties = getattr(dynamics, f"{kind}JointProperties")()
        properties.mAxis = link.axis
        joined = getattr(skeleton, f"create{kind}JointAndBodyNodePair")
        joint, body = joined(parent, properties)
        place = dartpy.math.Isometry3()
        place.set_translation(link.place)
        joint.setTransformFromParentBodyNode(place)
        inertia = np.diag([max(link.inertia, LEAST_MASS)] * 3)
        body.setInertia(dynamics.Inertia(max(link.mass, LEAST_MASS), link.center, inertia))
        joint.setDampingCoefficient(0, link.damping)
        if np.isfinite(link.lower) or np.isfinite(link.upper):
            joint.setPositionLowerLimit(0, link.lower)
            joint.setPositionUpperLimit(0, link.upper)
            joint.setLimitEnforcement(True)
        for (center, radius), contact in zip(link.points, link.contacts, strict=True):
            shape = body.createShapeNode(dynamics.SphereShape(radius))
            shape.setName(str(contact))
            shape.setRelativeTranslation(center)
            _touch(shape, scenario.friction, scenario.restitution)
        bodies.append(body)
    if feedback is not None:
        for i, driven in enumerate(model.actuator_joint):
            joint = skeleton.getJoint(int(driven))
            joint.setSpringStiffness(0, float(feedback.parameters.kp[i]))
            joint.setRestPosition(0, float(-model.reference[driven]))
            joint.setDampingCoefficient(0, float(feedback.parameters.kd[i] + model.damping[driven]))
    skeleton.disableSelfCollisionCheck()
    return skeleton


def _touch(shape: Any, friction: float, restitution: float) -> None:
    shape.createCollisionAspect()
    aspect = shape.createDynamicsAspect()
    aspect.setFrictionCoeff(friction)
    aspect.setRestitutionCoeff(restitution)


ENGINE = Engine(
    label="DART",
    note="a call from Python a step, for want of another way, two when walking, timed too",
    peer=DartPeer,
)
