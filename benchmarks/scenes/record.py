"""What every judge needs of a record: its numbers, and the mechanics at its rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.sim import EventKind
from scenes.findings import Findings
from scenes.mechanics import Metric, Poses, Tree, generalised, rates
from scenes.terrain import Terrain
from scenes.ties.judged import JudgedTies
from scenes.wedge import excess_over_cones

Array = NDArray[Any]

REACH = 0.2
"""Gaps above this (m) are not compared: a robot in free flight may take any ground for the nearest.
"""
SAME_PLACE = 1e-9
"""Places and gaps (m) agree within this, relative to where the robot is beyond a metre."""
IN_CONES = 1e-6
"""Forces of two faces agree with their friction within this, relative to their resultant."""


class Rows:
    """The rows of a run with the mechanics of each, by this package alone.

    Parameters
    ----------
    run : heelstrike.sim.Run
        The record. Of the robot only its numbers are read.
    corners : float
        How near (m) a point has to be to a second face, for its force to be that of both.
    instants : bool
        Whether forces are those of the instant, and not of the time to the next row. If not, a
        point may come that near by then.

    Attributes
    ----------
    q, v, time, gap, normal, force : arrays
        As recorded.
    cornered : (T, nc) bool
        Where the force of a contact point may be that of two faces of a concave corner.
    jacobian : (T, nc, 2, n) float
        Rows (normal, tangent) of the contact points under the recorded normals.
    acting : (T, nc, 2, n) float
        The same of where the recorded forces are said to act: in corners elsewhere on the disc.
    measured : Measurement
        Distances from the centres of the contact discs to the ground.
    metric : Metric
        Sizes of velocities and forces.
    ties : JudgedTies
        Loops, couplings, brakes and latches.
    smooth : (T, n) float
        Generalised force of motors, springs and dampers, less H; pushes are not in it.
    speed_in_wedge, deepest_in_wedge : float
        Normal speed (m/s) that is enough in a wedge, and the largest depth (m) that it may leave;
        in the plane the record tells which steps they are, and nothing is asked of them.
    """

    speed_in_wedge, deepest_in_wedge = -np.inf, np.inf

    def __init__(self, run: Any, corners: float = -np.inf, *, instants: bool = False) -> None:
        model = run.robot.model
        self.run, self.model = run, model
        self.time, self.q, self.v = run.time, run.position, run.velocity
        self.gap, self.normal, self.force = run.gap, run.contact_normal, run.contact_force
        self.tree = Tree(model)
        self.poses = Poses(self.tree, self.q)
        ground = run.ground.model()
        self.terrain = Terrain(ground.vertices, ground.friction, ground.restitution)
        self.center = self.poses.points(model.contact_link, model.contact_position)
        self.measured = self.terrain.measure(self.center)
        beside = self.terrain.to_corner(self.center, *(() if instants else self.ahead()))
        self.cornered = beside - model.contact_radius <= corners
        self.point = self.center - model.contact_radius[:, None] * self.normal
        world = self.poses.jacobian(model.contact_link, self.point)
        self.jacobian = self.acting = self.along(world)
        if self.cornered.any():
            acts = np.where(self.cornered[..., None], run.contact_point, self.point)
            self.acting = self.along(self.poses.jacobian(model.contact_link, acts))
        self.matrix = self.poses.mass_matrix()
        self.metric = Metric(self.matrix)
        self.ties = JudgedTies(run, self.poses, self.metric, instants=instants)
        self.speed = rates(self.jacobian, self.v)
        self.smooth = -self.poses.bias_force(self.v)
        self.smooth -= model.damping * self.v + model.stiffness * (self.q - model.rest)
        self.smooth[:, model.actuator_joint] += run.torque
        self.low, self.high = self.measured.lowest_friction, self.measured.highest_friction
        self.slip = run.slip_velocity[..., None]
        self.contacts = tuple(run.robot.contact_names)
        self.joints = tuple(run.robot.joint_names)
        self.coordinate, self.lower, self.upper = self.q, model.lower, model.upper
        self.driven = model.actuator_joint
        self.of_balls = np.zeros(self.tree.size, dtype=bool)

    def ahead(self) -> tuple[Array, Array]:
        """Where the discs are at the next row, and where they would be had they gone straight.

        The last row has none and stays where it is.
        """
        moved = np.diff(self.q, axis=0, append=self.q[-1:])
        straight = rates(self.poses.jacobian(self.model.contact_link, self.center), moved)
        return np.concatenate((self.center[1:], self.center[-1:])), self.center + straight

    def chord(self, h: float, some: Array) -> Array:
        """Velocities with which positions moved in some steps of length h."""
        chord: Array = self.ties.straight(h, some)
        return chord

    def missed(self, h: float, velocity: Array) -> Array:
        """How far positions (T − 1, n) are from where velocities lead in steps of length h."""
        there = self.ties.put_back(self.q[:-1] + h * velocity)
        missed: Array = np.abs(self.q[1:] - there) / (1.0 + np.abs(self.q[1:]))
        return missed

    def wedges(self, touching: float) -> Array:
        """Steps (T − 1,) from where the run tells of a wedge until everything is out of it."""
        time, going_on = self.time[:-1], np.zeros(len(self.time) - 1, dtype=bool)
        way = np.minimum(self.q - self.model.lower, self.model.upper - self.q)
        out = np.minimum(way.min(axis=1), self.gap.min(axis=1, initial=0.0)) >= -touching
        for event in self.run.events:
            if event.kind is EventKind.WEDGED:
                begin = int(np.argmin(np.abs(time - event.time)))
                ends = np.flatnonzero(out[begin + 1 : -1])
                going_on[begin : begin + 1 + ends[0] if len(ends) else None] = True
        return going_on

    def stops_of_balls(self) -> tuple[tuple[str, Array, Array, Array], ...]:
        """Name, row (T, n), gap (T,) and force (T,) of stops of joints with several velocities."""
        return ()

    def fastest(self, speed: Array, velocity: Array) -> Array:  # noqa: ARG002
        """Speeds of the contact points at the faces they are near to; here as at the one told."""
        return speed

    def lowered(self) -> float:
        """How much farther below its centre a contact touches after a step; a disc never."""
        return 0.0

    def explained(self, left: Array) -> Array:
        """Generalised impulses (T − 1, n) less what a record may leave open; here nothing."""
        return left

    def metric_of(self, some: slice) -> Metric:
        """Sizes at some of the rows only."""
        return Metric(self.matrix[some])

    def along(self, world: Array) -> Array:
        """Turn x and z of (T, nc, 2, ...) into normal and tangent."""
        x, z = world[:, :, 0], world[:, :, 1]
        shape = (*self.normal.shape[:2],) + (1,) * (world.ndim - 3)
        nx, nz = self.normal[..., 0].reshape(shape), self.normal[..., 1].reshape(shape)
        return np.stack((nx * x + nz * z, nz * x - nx * z), axis=2)

    def push(self, share: Array) -> Array:
        """Generalised force (T, n) of the pushes, each acting with a share (T, pushes)."""
        total = np.zeros_like(self.v)
        for i, one in enumerate(self.run.pushes):
            link, local = one.place(self.run.robot)
            links = np.array([link])
            place = self.poses.points(links, np.array([local]))
            jacobian = self.poses.jacobian(links, place)
            force = np.broadcast_to(np.array(one.force), (len(self.time), 1, 2))
            total += share[:, i, None] * generalised(jacobian, force)
        return total

    def contact_force(self) -> Array:
        """Generalised force (T, n) of the recorded forces of contacts, joints and ties."""
        pushed = generalised(self.acting, self.force) + self.ties.force()
        return pushed + self.run.stop_torque + self.run.friction_torque

    def bias_acceleration(self) -> Array:
        """Accelerations (T, nc, 2) along normal and tangent while the velocity does not change.

        Of the gap, and of the sliding velocity: the centre of a disc moves along its path, while
        the material point that touches changes. Beside a corner the normal turns with the motion.
        """
        link = self.model.contact_link
        center = self.along(self.poses.bias_acceleration(self.v, link, self.center))
        jacobian = self.poses.jacobian(link, self.center)
        moving = self.along(rates(jacobian, self.v))
        apart = np.abs(self.measured.distance)
        turning = self.measured.at_corner & (apart > 1e-6)
        center[..., 0] += np.where(turning, moving[..., 1] ** 2 / np.maximum(apart, 1e-6), 0.0)
        return center

    def geometry(self, found: Findings) -> None:
        """Hold what the record says of contact points against their own measure."""
        size = 1.0 + np.max(np.abs(self.point), axis=-1, initial=0.0)
        near = np.abs(self.measured.distance) < REACH
        own = self.measured.distance - self.model.contact_radius
        differs = np.where(near, np.abs(self.gap - own) / size, 0.0)
        found.look("recorded gap", differs, SAME_PLACE, self.time, self.contacts)
        turned = np.where(near, self.measured.disagreement(self.normal), 0.0)
        found.look("recorded normal", turned, 1e-5, self.time, self.contacts)
        away = np.linalg.norm(self.point - self.run.contact_point, axis=-1)
        beyond = np.linalg.norm(self.center - self.run.contact_point, axis=-1)
        beyond -= self.model.contact_radius
        off = np.where(self.cornered, beyond, away) / size
        for row, contact in np.argwhere(self.cornered & (off > SAME_PLACE)):
            if self.is_of_two_faces(row, contact):
                off[row, contact] = 0.0
        found.look("recorded place", off, SAME_PLACE, self.time, self.contacts)

    def is_of_two_faces(self, row: int, contact: int) -> bool:
        """Whether two faces could make a force on a disc in a corner that acts beside the disc."""
        normal, radius = self.normal[row, contact], float(self.model.contact_radius[contact])
        center = self.center[row, contact]
        faces = self.terrain.faces(center)
        if radius == 0.0 or len(faces) == 1:
            return False
        along, across = self.force[row, contact]
        force = along * normal + across * np.array([normal[1], -normal[0]])
        arm = self.run.contact_point[row, contact] - center
        moment = float(arm[0] * force[1] - arm[1] * force[0])
        normals, friction = self.terrain.normal[faces], self.terrain.friction[faces]
        return excess_over_cones(force, moment, radius, normals, friction) <= IN_CONES

    def energy(self) -> tuple[Array, Array]:
        """Kinetic and potential energy (T,)."""
        kinetic = 0.5 * self.metric.of_velocity(self.v) ** 2
        return kinetic, self.poses.potential_energy(self.q)


def excess_over_cone(force: Array, friction: Array) -> Array:
    """How far forces (..., d), normal first, pull, or exceed the friction that there is."""
    sideways = np.linalg.norm(force[..., 1:], axis=-1)
    return np.maximum(-force[..., 0], sideways - friction * force[..., 0])


def friction_that_does_not_oppose(
    force: Array, slide: Array, low: Array, high: Array, force_unit: Array, speed_unit: Array
) -> Array:
    """How far friction differs from μ λ_n against the sliding, or sliding from zero: the less.

    `force` (..., d) has the normal first; `slide` is (..., d − 1), or (...) in the plane. In space
    a force may be aslant to the sliding, which counts by how fast that is: a solver of the natural
    map knows the way of what hardly slides as little as its friction does.
    """
    normal = np.maximum(force[..., 0], 0.0)
    velocity = slide[..., None] if slide.ndim < force.ndim else slide
    speed = np.linalg.norm(velocity, axis=-1)
    way = velocity / np.where(speed > 0.0, speed, 1.0)[..., None]
    opposing = -np.einsum("...i,...i->...", way, force[..., 1:])
    across = np.linalg.norm(force[..., 1:] + opposing[..., None] * way, axis=-1)
    whole = np.linalg.norm(force[..., 1:], axis=-1)
    slant = across / np.where(whole > 0.0, whole, 1.0)
    lacks = np.maximum(np.maximum(low * normal - opposing, opposing - high * normal), 0.0)
    aslant = np.minimum(slant * speed / speed_unit, across / force_unit)
    return np.minimum(speed / speed_unit, lacks / force_unit) + aslant
