"""Bullet's side of a comparison: a multibody, sequential impulses, its own joint controllers."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pybullet

from heelstrike.experiments.engines.links import Link, links
from heelstrike.experiments.engines.peer import Engine, Peer, Touching
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot import State

RADIUS = 1e-4
"""Least radius of a contact point, in m: Bullet's own margins are larger than nothing."""
NO_LIMIT = 1e9


ITERATIONS = 50
"""Sweeps of its solver over the contacts in a step, its default. Ten times as many change the error
of a walk by less than 1e-3 of it."""


class BulletPeer(Peer):
    """A scenario in Bullet.

    Its controller of springs and dampers (PD_CONTROL) runs in C++, but adds its torques to those of
    the substeps before, so that with it each step is a call. Without it all steps are substeps of
    one call. What changes of the commands over time, Python sets before each step.
    """

    settling = 0.2
    lacks = ("armature",)

    def __init__(self, scenario: Scenario, step: float) -> None:
        super().__init__(scenario, step)
        self._client = pybullet.connect(pybullet.DIRECT)
        self._body = self._build()
        robot = scenario.robot
        self._driven = [int(joint) for joint in robot.model.actuator_joint]
        self._one_call = scenario.feedback is None and not np.any(robot.model.damping)
        self._substeps = 0
        self._step = 0
        # What changes of the commands is added in every step to what its controllers do.
        varying = len(self.commands) > 1
        self._torques = (self.commands - self.commands[0]).tolist() if varying else []

    def __del__(self) -> None:
        """Let go of the engine's world."""
        with contextlib.suppress(Exception):
            pybullet.disconnect(self._client)

    def _build(self) -> int:
        client, robot = self._client, self.scenario.robot
        model = robot.model
        pybullet.setGravity(model.gravity[0], 0.0, model.gravity[1], physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.step,
            numSubSteps=0,
            numSolverIterations=ITERATIONS,
            physicsClientId=client,
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        ground = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
        chain = links(robot, least_radius=RADIUS)
        count = len(chain)
        none, straight = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]
        body = pybullet.createMultiBody(
            baseMass=0.0,
            linkMasses=[link.mass for link in chain],
            linkCollisionShapeIndices=[self._shape(link.points) for link in chain],
            linkVisualShapeIndices=[-1] * count,
            linkPositions=[link.place for link in chain],
            linkOrientations=[straight] * count,
            linkInertialFramePositions=[link.center for link in chain],
            linkInertialFrameOrientations=[straight] * count,
            linkParentIndices=[link.parent + 1 for link in chain],
            linkJointTypes=[
                pybullet.JOINT_REVOLUTE if link.hinge else pybullet.JOINT_PRISMATIC
                for link in chain
            ],
            linkJointAxis=[link.axis for link in chain],
            basePosition=none,
            physicsClientId=client,
        )
        # The friction of two bodies is the product of theirs.
        pybullet.changeDynamics(
            ground, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=client
        )
        for i, link in enumerate(chain):
            self._set_dynamics(body, i, link)
            for other in range(i):  # points meet the ground only
                pybullet.setCollisionFilterPair(body, body, i, other, 0, physicsClientId=client)
        return int(body)

    def _set_dynamics(self, body: int, i: int, link: Link) -> None:
        """Tell it what it cannot be told when a link is made, and undo its defaults."""
        limits = {}
        if np.isfinite(link.lower) and np.isfinite(link.upper):
            limits = {"jointLowerLimit": link.lower, "jointUpperLimit": link.upper}
        client = self._client
        pybullet.changeDynamics(
            body,
            i,
            localInertiaDiagonal=[link.inertia] * 3,
            lateralFriction=self.scenario.friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=link.damping,
            **limits,
            physicsClientId=client,
        )
        # In one call with others, this takes their effect from them.
        pybullet.changeDynamics(body, i, maxJointVelocity=NO_LIMIT, physicsClientId=client)
        pybullet.setJointMotorControl2(
            body, i, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
        )

    def _shape(self, points: Any) -> int:
        if not points:
            return -1
        return int(
            pybullet.createCollisionShapeArray(
                shapeTypes=[pybullet.GEOM_SPHERE] * len(points),
                radii=[radius for _, radius in points],
                collisionFramePositions=[center for center, _ in points],
                physicsClientId=self._client,
            )
        )

    def restart(self) -> None:
        """Go back to `start`, at time 0."""
        q = self.start.q - self.scenario.robot.model.reference
        for i in range(len(q)):
            pybullet.resetJointState(
                self._body, i, q[i], self.start.v[i], physicsClientId=self._client
            )
        self._step = 0
        if self.scenario.feedback is not None:
            self._set_law()

    def _set_law(self) -> None:
        """Tell its controllers Γ = kp (θ* − θ) + kd (ω − θ̇) with ω such that it is our law."""
        feedback = self.scenario.feedback
        assert feedback is not None
        model, driven = self.scenario.robot.model, self._driven
        rest = self.start.q[driven]
        speed = (self.commands[0] - feedback.parameters.kp * rest) / feedback.parameters.kd
        limit = np.full(len(driven), NO_LIMIT)
        if len(self.commands) == 1:  # otherwise it is not all of the torque
            limit = np.minimum(model.torque_upper, NO_LIMIT)
        pybullet.setJointMotorControlArray(
            self._body,
            driven,
            pybullet.PD_CONTROL,
            targetPositions=rest - model.reference[driven],
            targetVelocities=speed,
            positionGains=feedback.parameters.kp,
            velocityGains=feedback.parameters.kd,
            forces=limit,
            physicsClientId=self._client,
        )

    def advance(self, steps: int) -> None:
        """Simulate some steps: in one call, or each with its own."""
        client = self._client
        if self._one_call:
            self._ask_for(0 if steps == 1 else steps)
            pybullet.stepSimulation(physicsClientId=client)
        elif not self._torques:
            for _ in range(steps):
                pybullet.stepSimulation(physicsClientId=client)
        else:
            for torques in self._torques[self._step : self._step + steps]:
                pybullet.setJointMotorControlArray(
                    self._body,
                    self._driven,
                    pybullet.TORQUE_CONTROL,
                    forces=torques,
                    physicsClientId=client,
                )
                pybullet.stepSimulation(physicsClientId=client)
        self._step += steps

    def _ask_for(self, substeps: int) -> None:
        if substeps != self._substeps:
            pybullet.setPhysicsEngineParameter(
                fixedTimeStep=self.step * max(substeps, 1),
                numSubSteps=substeps,
                physicsClientId=self._client,
            )
            self._substeps = substeps

    def state(self) -> State:
        """Where it is now."""
        robot = self.scenario.robot
        joints = pybullet.getJointStates(self._body, range(robot.nv), physicsClientId=self._client)
        q = np.array([joint[0] for joint in joints]) + robot.model.reference
        return State(q, np.array([joint[1] for joint in joints]))

    def touching(self) -> Touching:
        """How it touched the ground in the last step."""
        contacts = pybullet.getContactPoints(bodyA=self._body, physicsClientId=self._client)
        depth = max((-contact[8] for contact in contacts), default=0.0)
        return Touching(len(contacts), sum(contact[9] for contact in contacts), depth)


ENGINE = Engine(
    label="Bullet",
    note="a call from Python a step where its joints are controlled, two when walking, timed too",
    peer=BulletPeer,
)
