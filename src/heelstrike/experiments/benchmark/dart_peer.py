"""DART's side of a comparison: boxed linear complementarity, a World stepped from Python."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import dartpy
import numpy as np

from heelstrike.experiments.benchmark.links import links, space
from heelstrike.experiments.benchmark.peer import Engine, Peer, Setting, Touching
from heelstrike.experiments.benchmark.scenarios import FRICTION, Scenario
from heelstrike.robot import State

RADIUS = 1e-4
"""Least radius of a contact point, in m: its collision detectors want spheres of some size."""
MASSLESS = 1e-12
"""Mass (kg) and inertia (kg m²) that stand for none."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How DART is asked to simulate.

    Attributes
    ----------
    step : float
        Seconds.
    detector : str
        Of collisions: ``"DART"``, its own and the quickest, ``"FCL"``, ``"ODE"`` or ``"BULLET"``.
    """

    step: float
    detector: str = "DART"


class DartPeer(Peer):
    """A scenario in DART. Springs and dampers are those of its joints."""

    settling = 0.2
    lacks = ("armature",)

    def __init__(self, scenario: Scenario, options: Options) -> None:
        super().__init__(scenario, options.step)
        self._world, self._robot = _world(scenario, options)
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


def _world(scenario: Scenario, options: Options) -> tuple[Any, Any]:
    world = dartpy.simulation.World()
    world.setGravity(space(scenario.robot.model.gravity))
    world.setTimeStep(options.step)
    awake = dartpy.simulation.DeactivationOptions()
    awake.mEnabled = False  # what rests would be skipped
    world.setDeactivationOptions(awake)
    detectors = dartpy.simulation.CollisionDetectorType
    world.setCollisionDetector(getattr(detectors, options.detector))
    skeleton = _skeleton(scenario)
    world.addSkeleton(_ground())
    world.addSkeleton(skeleton)
    return world, skeleton


def _ground() -> Any:
    ground = dartpy.dynamics.Skeleton("ground")
    _, floor = ground.createWeldJointAndBodyNodePair()
    block = floor.createShapeNode(dartpy.dynamics.BoxShape([100.0, 10.0, 1.0]))
    block.setRelativeTranslation([0.0, 0.0, -0.5])
    _touch(block)
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
            _touch(shape)
        bodies.append(body)
    if feedback is not None:
        for i, driven in enumerate(model.actuator_joint):
            joint = skeleton.getJoint(int(driven))
            joint.setSpringStiffness(0, float(feedback.parameters.kp[i]))
            joint.setRestPosition(0, float(-model.reference[driven]))
            joint.setDampingCoefficient(0, float(feedback.parameters.kd[i] + model.damping[driven]))
    skeleton.disableSelfCollisionCheck()
    return skeleton


def _touch(shape: Any) -> None:
    shape.createCollisionAspect()
    shape.createDynamicsAspect().setFrictionCoeff(FRICTION)


def _settings(quick: bool) -> Iterator[Setting]:
    # With its own detector the error grows again below 20 µs; with FCL it falls on with the step.
    ways: dict[str, Sequence[float]] = {"DART": (1e-3,)}
    if not quick:
        ways = {"DART": (1e-3, 1e-4, 2e-5), "FCL": (1e-3, 1e-4, 3e-6)}
    for detector, steps in ways.items():
        for step in steps:
            options = Options(step=step, detector=detector)
            yield Setting(
                f"DART, collisions by {detector}",
                f"h {step:.0e} s",
                lambda scenario, options=options: DartPeer(scenario, options),  # type: ignore[misc]
            )


ENGINE = Engine(
    label="DART",
    note="a call from Python a step, for want of another way, two when walking, timed too",
    peer=lambda scenario, step: DartPeer(scenario, Options(step=step)),
    settings=_settings,
)
