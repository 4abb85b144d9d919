"""PhysX's side of a comparison: an articulation in reduced coordinates, by way of SAPIEN.

PhysX computes in single precision, and tells the normal impulses of its contacts alone.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from heelstrike.dynamics import contact_positions
from heelstrike.experiments.engines.links import links, space
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of the graphics that it does not find
    import sapien
    from sapien import physx

SMALL_SPHERE = 1e-4
"""Least radius of a contact point, in m: its spheres have some size."""
NEARLY_NOTHING = 1e-6
"""Mass (kg) and inertia (kg m²) of what has none: a millionth of the lightest link."""
FAST = 1e6
"""Speed that nothing reaches, in m/s and rad/s."""
HEAVY_ROOT = 1.0
"""Mass (kg) of the root, which is fixed."""


class PhysxPeer(Peer):
    """A scenario in PhysX.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    tgs : bool
        Whether its temporal Gauss-Seidel solves, else its projected one.
    positions, velocities : int
        Iterations of the solver.
    offset : float
        Distance from which on a contact is looked for, in m.
    every : bool
        Whether friction is in every iteration.
    """

    settling = 0.2
    tells_friction = False
    float32 = True

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        tgs: bool = True,
        positions: int = 10,
        velocities: int = 1,
        offset: float = 0.01,
        every: bool = True,
    ) -> None:
        super().__init__(scenario, step)
        physx.set_scene_config(
            gravity=space(scenario.robot.model.gravity),
            bounce_threshold=0.0 if scenario.restitution else 2.0,
            enable_tgs=tgs,
            enable_friction_every_iteration=every,
        )
        physx.set_body_config(positions, velocities, 0.0)
        physx.set_shape_config(contact_offset=offset, rest_offset=0.0)
        self._system = physx.PhysxCpuSystem()
        self._scene = sapien.Scene([self._system])
        self._system.timestep = step
        self._scene.add_ground(
            0.0, render=False,
            material=physx.PhysxMaterial(
                scenario.friction, scenario.friction, scenario.restitution
            ),
        )  # fmt: skip
        self._links = self._build()
        self._robot = self._links[0].articulation
        names = [joint.name for joint in self._robot.active_joints]
        self._order = np.array([names.index(str(i)) for i in range(scenario.robot.nv)])
        self._driven = self._order[scenario.robot.model.actuator_joint]
        self._force = np.zeros(scenario.robot.nv, dtype=np.float32)
        self._damping = scenario.robot.model.damping

    def _build(self) -> list[Any]:
        scenario = self.scenario
        material = physx.PhysxMaterial(scenario.friction, scenario.friction, scenario.restitution)
        root = physx.PhysxArticulationLinkComponent(None)
        entity = sapien.Entity()
        entity.add_component(root)
        root.joint.type = "fixed"
        _weigh(root, HEAVY_ROOT, np.zeros(3), HEAVY_ROOT)
        made, entities = [root], [entity]
        armature = scenario.robot.model.armature
        for i, link in enumerate(links(scenario.robot, least_radius=SMALL_SPHERE)):
            body = physx.PhysxArticulationLinkComponent(made[link.parent + 1])
            entity = sapien.Entity()
            entity.add_component(body)
            body.name = str(i)
            joint = body.joint
            joint.name = str(i)
            joint.type = "revolute_unwrapped" if link.hinge else "prismatic"
            turned = _turn(link.axis)
            joint.pose_in_parent = sapien.Pose(link.place, turned)
            joint.pose_in_child = sapien.Pose(np.zeros(3), turned)
            joint.limit = np.array([[link.lower, link.upper]], dtype=np.float32)
            joint.set_friction(0.0)
            joint.set_drive_property(0.0, 0.0)
            joint.set_armature(np.array([armature[i]], dtype=np.float32))
            joint.set_max_velocity(FAST)
            for center, radius in link.points:
                shape = physx.PhysxCollisionShapeSphere(radius, material)
                shape.set_local_pose(sapien.Pose(center))
                shape.set_collision_groups([1, 1, 2, 7])  # alike: they do not meet each other
                body.attach(shape)
            _weigh(
                body, max(link.mass, NEARLY_NOTHING), link.center, max(link.inertia, NEARLY_NOTHING)
            )
            made.append(body)
            entities.append(entity)
        for each in entities:
            self._scene.add_entity(each)
        return made

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        self._put = np.array(q), np.array(v)
        for values, into in ((q, self._robot.set_qpos), (v, self._robot.set_qvel)):
            ordered = np.zeros(len(values), dtype=np.float32)
            ordered[self._order] = values
            into(ordered)

    def simulate(self, steps: int) -> None:
        """Simulate some steps, each with a call from Python."""
        damped = bool(np.any(self._damping))
        for k in range(steps):
            self.hold_by_law(k)
            force = self._force
            if damped:
                force = force.copy()
                force[self._order] -= self._damping * self.coordinates()[1]
            self._robot.set_qf(force)
            self._system.step()

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        q = np.asarray(self._robot.get_qpos(), dtype=np.float64)[self._order]
        return q, np.asarray(self._robot.get_qvel(), dtype=np.float64)[self._order]

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        self._force = np.zeros(self.scenario.robot.nv, dtype=np.float32)
        self._force[self._driven] = torque

    def forces(self) -> Floats:
        """Forces on the contact points in the last step, without friction: it tells none."""
        robot = self.scenario.robot
        found = np.zeros((robot.nc, 2))
        places = None
        for point, link in self._points():
            if places is None:
                places = contact_positions(robot, self.coordinates()[0] + self.zero)
            own = np.flatnonzero(robot.model.contact_link == link)
            near = own[np.argmin(np.abs(places[own, 0] - point.position[0]))]
            found[near, 0] += abs(float(point.impulse[2])) / self.step
        return found

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact in the last step."""
        return [
            (abs(float(point.impulse[2])) / self.step, -float(point.separation))
            for point, _ in self._points()
        ]

    def _points(self) -> list[tuple[Any, int]]:
        """Points that press, and the links that they are on."""
        found = []
        for contact in self._system.get_contacts():
            names = [body.name for body in contact.bodies]
            link = next(int(name) for name in names if name.isdigit())
            found += [(point, link) for point in contact.points if np.any(point.impulse)]
        return found


def _weigh(body: Any, mass: float, center: Floats, inertia: float) -> None:
    body.set_mass(mass)
    body.set_cmass_local_pose(sapien.Pose(center))
    body.set_inertia([inertia] * 3)
    body.set_linear_damping(0.0)
    body.set_angular_damping(0.0)
    body.set_max_linear_velocity(FAST)
    body.set_max_angular_velocity(FAST)


def _turn(axis: Floats) -> Floats:
    """Quaternion, real part first, that takes the x axis to another: that of a joint's frame."""
    real = 1.0 + axis[0]
    if real < 1e-9:
        return np.array([0.0, 0.0, 0.0, 1.0])
    turn = np.array([real, 0.0, -axis[2], axis[1]])
    return np.asarray(turn / np.linalg.norm(turn))


ENGINE = Engine(
    label="PhysX",
    note="through SAPIEN, two calls from Python a step",
    peer=PhysxPeer,
)
