"""Bullet's side of a comparison: a multibody, sequential impulses, its own joint controllers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from heelstrike.dynamics import contact_positions
from heelstrike.experiments.engines.links import Link, links
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

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

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    **options
        Of ``setPhysicsEngineParameter``.
    """

    settling = 0.2
    lacks = ("armature",)

    def __init__(self, scenario: Scenario, step: float, **options: float) -> None:
        super().__init__(scenario, step)
        self._engine = BulletClient(pybullet.DIRECT)
        self._options = {"numSolverIterations": ITERATIONS} | options
        self._body = self._build()
        robot = scenario.robot
        self._driven = [int(joint) for joint in robot.model.actuator_joint]
        self._one_call = scenario.feedback is None and not np.any(robot.model.damping)
        self._substeps = 0
        # What changes of the commands is added in every step to what its controllers do.
        self._torque: list[float] | None = None
        varying = len(self.commands) > 1
        self._torques = (self.commands - self.commands[0]).tolist() if varying else []

    def _build(self) -> int:
        engine, robot = self._engine, self.scenario.robot
        gravity = robot.model.gravity
        engine.setGravity(gravity[0], 0.0, gravity[1])
        engine.setPhysicsEngineParameter(fixedTimeStep=self.step, numSubSteps=0, **self._options)
        ground = engine.createMultiBody(0.0, engine.createCollisionShape(pybullet.GEOM_PLANE))
        chain = links(robot, least_radius=RADIUS)
        straight = [[0.0, 0.0, 0.0, 1.0]] * len(chain)
        kinds = (pybullet.JOINT_PRISMATIC, pybullet.JOINT_REVOLUTE)
        body = engine.createMultiBody(
            baseMass=0.0,
            linkMasses=[link.mass for link in chain],
            linkCollisionShapeIndices=[self._shape(link.points) for link in chain],
            linkVisualShapeIndices=[-1] * len(chain),
            linkPositions=[link.place for link in chain],
            linkOrientations=straight,
            linkInertialFramePositions=[link.center for link in chain],
            linkInertialFrameOrientations=straight,
            linkParentIndices=[link.parent + 1 for link in chain],
            linkJointTypes=[kinds[link.hinge] for link in chain],
            linkJointAxis=[link.axis for link in chain],
            basePosition=[0.0, 0.0, 0.0],
        )
        # Friction and restitution of two bodies are the products of theirs.
        engine.changeDynamics(ground, -1, lateralFriction=1.0, restitution=1.0)
        for i, link in enumerate(chain):
            self._set_dynamics(body, i, link)
            for other in range(i):  # points meet the ground only
                engine.setCollisionFilterPair(body, body, i, other, 0)
        return int(body)

    def _set_dynamics(self, body: int, i: int, link: Link) -> None:
        """Tell it what it cannot be told when a link is made, and undo its defaults."""
        limits = {}
        if np.isfinite(link.lower) and np.isfinite(link.upper):
            limits = {"jointLowerLimit": link.lower, "jointUpperLimit": link.upper}
        self._engine.changeDynamics(
            body,
            i,
            localInertiaDiagonal=[link.inertia] * 3,
            lateralFriction=self.scenario.friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=self.scenario.restitution,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=link.damping,
            **limits,
        )
        # In one call with others, this takes their effect from them.
        self._engine.changeDynamics(body, i, maxJointVelocity=NO_LIMIT)
        self._engine.setJointMotorControl2(body, i, pybullet.VELOCITY_CONTROL, force=0.0)

    def _shape(self, points: Any) -> int:
        if not points:
            return -1
        shape = self._engine.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_SPHERE] * len(points),
            radii=[radius for _, radius in points],
            collisionFramePositions=[center for center, _ in points],
        )
        return int(shape)

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        for i in range(len(q)):
            self._engine.resetJointState(self._body, i, q[i], v[i])
        self._torque = None
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
        self._engine.setJointMotorControlArray(
            self._body,
            driven,
            pybullet.PD_CONTROL,
            targetPositions=rest - model.reference[driven],
            targetVelocities=speed,
            positionGains=feedback.parameters.kp,
            velocityGains=feedback.parameters.kd,
            forces=limit,
        )

    def simulate(self, steps: int) -> None:
        """Simulate some steps: in one call, or each with its own."""
        step, control = self._engine.stepSimulation, self._engine.setJointMotorControlArray
        if self._one_call and self._torque is None:
            self._ask_for(0 if steps == 1 else steps)
            step()
        elif self._torque is not None:
            for _ in range(steps):  # it forgets torques after each
                control(self._body, self._driven, pybullet.TORQUE_CONTROL, forces=self._torque)
                step()
        elif not self._torques:
            for _ in range(steps):
                step()
        else:
            for torques in self._torques[self.done : self.done + steps]:
                control(self._body, self._driven, pybullet.TORQUE_CONTROL, forces=torques)
                step()

    def _ask_for(self, substeps: int) -> None:
        if substeps != self._substeps:
            self._engine.setPhysicsEngineParameter(
                fixedTimeStep=self.step * max(substeps, 1), numSubSteps=substeps
            )
            self._substeps = substeps

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        joints = self._engine.getJointStates(self._body, range(self.scenario.robot.nv))
        q, v, *_ = zip(*joints, strict=True)
        return np.array(q), np.array(v)

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact in the last step."""
        found = self._engine.getContactPoints(bodyA=self._body)
        return [(contact[9], -contact[8]) for contact in found]

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        self._ask_for(0)
        self._torque = np.asarray(torque).tolist()

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        robot = self.scenario.robot
        found = np.zeros((robot.nc, 2))
        touching = self._engine.getContactPoints(bodyA=self._body)
        if not touching:
            return found
        q, _ = self.coordinates()
        places = contact_positions(robot, q + self.zero)
        for contact in touching:
            own = np.flatnonzero(robot.model.contact_link == contact[3])
            near = own[np.argmin(np.abs(places[own, 0] - contact[5][0]))]
            force = np.multiply(contact[9], contact[7])
            force += np.multiply(contact[10], contact[11]) + np.multiply(contact[12], contact[13])
            found[near] += force[2], force[0]
        return found


ENGINE = Engine(
    label="Bullet",
    note="a call from Python a step where its joints are controlled, two when walking, timed too",
    peer=BulletPeer,
)
