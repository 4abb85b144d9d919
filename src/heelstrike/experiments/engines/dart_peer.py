"""DART's side of a comparison: boxed linear complementarity, a World stepped from Python."""

from __future__ import annotations

from typing import Any

import dartpy
import numpy as np

from heelstrike.experiments.engines.links import links, space
from heelstrike.experiments.engines.peer import Engine, Peer, Touching
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot import State

RADIUS = 1e-4
"""Least radius of a contact point, in m: its collision detectors want spheres of some size."""
MASSLESS = 1e-12
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
    """

    settling = 0.2
    lacks = ("armature",)

    def __init__(self, scenario: Scenario, step: float, *, detector: str = "DART") -> None:
        super().__init__(scenario, step)
        self._world, self._robot = _world(scenario, step, detector)
        model = scenario.robot.model
        self._forces = np.zeros((len(self.commands), scenario.robot.nv))
        self._forces[:, model.actuator_joint] = self.commands
        self._step = 0

    def restart(self) -> None:
        """Go back to `start`, at time 0."""
        self._world.reset()
        self._robot.setPositions(self.start.q - self.scenario.robot.model.reference)
        self._robot.setVelocities(self.start.v)
        self._robot.setCommands(self._forces[0])
        self._step = 0

    def advance(self, steps: int) -> None:
        """Simulate some steps, each with a call from Python: it has no loop of its own."""
        step = self._world.step
        if len(self._forces) == 1:
            for _ in range(steps):
                step(False)  # and keep the commands
        else:
            command = self._robot.setCommands
            for forces in self._forces[self._step : self._step + steps]:
                command(forces)
                step(False)
        self._step += steps

    def state(self) -> State:
        """Where it is now."""
        position = self._robot.getPositions() + self.scenario.robot.model.reference
        return State(position, np.array(self._robot.getVelocities()))

    def touching(self) -> Touching:
        """How it touched the ground in the last step."""
        contacts = self._world.getLastCollisionResult().getContacts()
        force = sum(abs(float(contact.force[2])) for contact in contacts)
        depth = max((float(contact.penetrationDepth) for contact in contacts), default=0.0)
        return Touching(len(contacts), force, depth)


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
    world.addSkeleton(_ground(scenario.friction))
    world.addSkeleton(skeleton)
    return world, skeleton


def _ground(friction: float) -> Any:
    ground = dartpy.dynamics.Skeleton("ground")
    _, floor = ground.createWeldJointAndBodyNodePair()
    block = floor.createShapeNode(dartpy.dynamics.BoxShape([100.0, 10.0, 1.0]))
    block.setRelativeTranslation([0.0, 0.0, -0.5])
    _touch(block, friction)
    ground.setMobile(False)
    return ground


def _skeleton(scenario: Scenario) -> Any:
    """Links, joints, contact points, springs and dampers."""
    robot, feedback = scenario.robot, scenario.feedback
    model = robot.model
    dynamics = dartpy.dynamics
    skeleton = dynamics.Skeleton("robot")
    bodies: list[Any] = []
    for link in links(robot, least_radius=RADIUS):
        parent = bodies[link.parent] if link.parent >= 0 else None
        if link.hinge:
            hinge = dynamics.RevoluteJointProperties()
            hinge.mAxis = link.axis
            joint, body = skeleton.createRevoluteJointAndBodyNodePair(parent, hinge)
        else:
            slide = dynamics.PrismaticJointProperties()
            slide.mAxis = link.axis
            joint, body = skeleton.createPrismaticJointAndBodyNodePair(parent, slide)
        place = dartpy.math.Isometry3()
        place.set_translation(link.place)
        joint.setTransformFromParentBodyNode(place)
        inertia = np.diag([max(link.inertia, MASSLESS)] * 3)
        body.setInertia(dynamics.Inertia(max(link.mass, MASSLESS), link.center, inertia))
        joint.setDampingCoefficient(0, link.damping)
        if np.isfinite(link.lower) or np.isfinite(link.upper):
            joint.setPositionLowerLimit(0, link.lower)
            joint.setPositionUpperLimit(0, link.upper)
            joint.setLimitEnforcement(True)
        for center, radius in link.points:
            shape = body.createShapeNode(dynamics.SphereShape(radius))
            shape.setRelativeTranslation(center)
            _touch(shape, scenario.friction)
        bodies.append(body)
    if feedback is not None:
        for i, driven in enumerate(model.actuator_joint):
            joint = skeleton.getJoint(int(driven))
            joint.setSpringStiffness(0, float(feedback.parameters.kp[i]))
            joint.setRestPosition(0, float(-model.reference[driven]))
            joint.setDampingCoefficient(0, float(feedback.parameters.kd[i] + model.damping[driven]))
    skeleton.disableSelfCollisionCheck()
    return skeleton


def _touch(shape: Any, friction: float) -> None:
    shape.createCollisionAspect()
    shape.createDynamicsAspect().setFrictionCoeff(friction)


ENGINE = Engine(
    label="DART",
    note="a call from Python a step, for want of another way, two when walking, timed too",
    peer=DartPeer,
)
