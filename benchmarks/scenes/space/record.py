"""The mechanics at the rows of a run in space, for the judge of time stepping."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.findings import Findings
from scenes.mechanics import Metric, generalised, rates
from scenes.record import REACH, SAME_PLACE
from scenes.space.ground import Terrain
from scenes.space.mechanics import BALL, HINGE, SLIDE, SpatialPoses, SpatialTree, turn
from scenes.space.scene import gaps_of

Array = NDArray[Any]

SAME_WAY = 1e-5
"""Normals agree within this."""
SINK = 1e-6
"""Depth (m) in a face that is not the recorded one."""
BESIDE_ITS_WAY = 1e-10
"""Change of position (m, rad) from which on positions moved with another velocity than that behind
the step."""
NEAR_BOTH = 1e-3
"""A point that is this near (m) to two faces, or comes so near in a step, may be pushed by both."""


def frames(normal: Array) -> Array:
    """Normal, t1 and t2 (..., 3, 3) in rows: t1 is x less its part along the normal, or y."""
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    first = x - normal * normal[..., :1]
    length = np.linalg.norm(first, axis=-1, keepdims=True)
    first = np.where(length < 1e-12, y, first / np.where(length < 1e-12, 1.0, length))
    return np.stack((normal, first, np.cross(normal, first)), axis=-2)


LEFT_IN_THE_GROUND = 1e-4
"""What is no deeper in the ground than this (m) may be left there where there is no way out."""


class SpatialRows:
    """The rows of a run in space with the mechanics of each, by this package alone.

    Parameters
    ----------
    run : heelstrike.sim.spatial.SpatialRun
        The record. Of the robot only its numbers are read.
    terrain : Terrain
        The ground.

    Attributes
    ----------
    cornered : (T, nc) bool
        Where the force of a contact point may be that of two faces.
    speed_in_wedge, deepest_in_wedge : float
        Normal speed (m/s) that is enough in a step which is excused, and the largest depth (m) that
        it may leave: what touches need not bounce or come out, but must not go in.
    """

    speed_in_wedge, deepest_in_wedge = 0.0, LEFT_IN_THE_GROUND

    def __init__(self, run: Any, terrain: Terrain) -> None:
        model = run.robot.model
        self.run, self.model, self.terrain = run, model, terrain
        self.time, self.q, self.v = run.time, run.position, run.velocity
        self.gap, self.normal, self.force = run.gap, run.contact_normal, run.contact_force
        self.tree = SpatialTree(model)
        self.poses = SpatialPoses(self.tree, self.q)
        self.center = self.poses.points(model.contact_link, model.contact_position)
        self.gaps, self.ways, self.points = gaps_of(terrain, self.poses, model)
        self.foot = run.contact_point - self.gap[..., None] * self.normal
        self.frame = frames(self.normal)
        world = self.poses.jacobian(model.contact_link, self.foot)
        self.jacobian = self.acting = np.einsum("tcij,tcjn->tcin", self.frame, world)
        self.matrix = self.poses.mass_matrix()
        self.metric = Metric(self.matrix)
        self.smooth = self.tree.springs(self.q)[0] - self.poses.bias_force(self.v)
        self.smooth -= model.damping * self.v
        self.driven = model.actuator_velocity
        np.add.at(self.smooth, (slice(None), self.driven), run.torque)
        ground = run.ground
        shape = self.gap.shape
        self.low = self.high = np.broadcast_to(ground.friction * model.friction_scale, shape)
        bounces = np.broadcast_to(ground.restitution * model.restitution_scale, shape)
        self.measured = SimpleNamespace(restitution=bounces)
        self.slip = run.slip
        self.contacts = tuple(run.robot.contact_names)
        self.joints = tuple(run.robot.velocity_names)
        self.cornered = self._beside_two()
        nothing = np.zeros_like(self.v)
        self.ties = SimpleNamespace(
            force=lambda: nothing, latched=np.zeros_like(self.v, dtype=bool),
            judge=lambda *_, **__: None,
        )  # fmt: skip
        self.of_balls = np.zeros(self.tree.nv, dtype=bool)
        for joint, kind in enumerate(self.tree.kind):
            if kind == BALL:
                first = self.tree.first_v[joint]
                self.of_balls[first : first + 3] = True
        self.coordinate = np.zeros_like(self.v)
        self.lower, self.upper = (np.full(self.tree.nv, end) for end in (-np.inf, np.inf))
        for joint, kind in enumerate(self.tree.kind):
            if kind in (SLIDE, HINGE):
                at, to = self.tree.first_q[joint], self.tree.first_v[joint]
                self.coordinate[:, to] = self.q[:, at]
                self.lower[to], self.upper[to] = model.lower[joint], model.upper[joint]

    def _beside_two(self) -> Array:
        """Where points are near to two faces, or may come there within the step."""
        if len(self.gaps) < 2:
            return np.zeros(self.gap.shape, dtype=bool)
        ahead = np.concatenate((self.points[:, 1:], self.points[:, -1:]), axis=1)
        moved = np.linalg.norm(ahead - self.points, axis=-1).max(axis=0)
        second = np.sort(self.gaps, axis=0)[1]
        return np.asarray(second < NEAR_BOTH + 2.0 * moved)

    def chord(self, h: float, some: Array) -> Array:
        """Velocities with which positions moved in some steps of length h."""
        return self.tree.difference(self.q[:-1][some], self.q[1:][some]) / h

    def missed(self, h: float, velocity: Array) -> Array:
        """How far positions (T − 1, nv) are from where velocities lead in steps of length h."""
        there = self.tree.moved(self.q[:-1], velocity, h)
        size = 1.0 + np.abs(self.tree.difference(np.broadcast_to(self.model.reference, there.shape),
                                                 there))  # fmt: skip
        return np.abs(self.tree.difference(there, self.q[1:])) / size

    def wedges(self, touching: float) -> Array:
        """Steps (T − 1,) that need not close gaps of what touches, or bounce.

        A run in space only counts them. As many are taken as it counts, those that are farthest
        from the speed that gaps and restitution ask for. How much that excuses is bounded.
        """
        found = np.zeros(len(self.time) - 1, dtype=bool)
        count = int(self.run.certificates.relaxed)
        if not count or not len(found):
            return found
        h = float(self.run.method.step)
        chord = self.chord(h, np.ones(len(found), dtype=bool))
        bounces = np.any(self.missed(h, self.v[1:]) > BESIDE_ITS_WAY, axis=1)[:, None]
        own = self.jacobian[:, :, 0], self.gap, self.force[..., 0], self.measured.restitution
        bounds = [tuple(each[:-1] for each in own)]
        bounds += [
            (row[:-1, None], gap[:-1, None], force[:-1, None], np.zeros((len(found), 1)))
            for row, gap, force in self._stops()
        ]
        short = np.zeros(len(found))
        for row, gap, force, e in bounds:
            moved, before, after = (
                np.einsum("tpn,tn->tp", row, v) for v in (chord, self.v[:-1], self.v[1:])
            )
            left = np.where(gap < 0.0, -gap / h - moved, 0.0)
            pressed = (force > 0.0) & (gap <= touching) & ~bounces  # else it is the impact's force
            left = np.maximum(left, np.where(pressed, np.abs(gap / h + moved), 0.0))
            closed = bounces & (force > 0.0) & (np.minimum(gap, gap + h * moved) <= touching)
            left = np.maximum(left, np.where(closed, -e * before - after, 0.0))
            short = np.maximum(short, left.max(axis=1, initial=0.0))
        worst = np.argsort(-short)[:count]
        found[worst[short[worst] > 0.0]] = True
        return found

    def _stops(self) -> Iterator[tuple[Array, Array, Array]]:
        """Row (T, nv), gap (T,) and force (T,) of every end of the range of a joint."""
        for _, row, gap, force in self.stops_of_balls():
            yield row, gap, force
        for side, limit in ((1.0, self.lower), (-1.0, self.upper)):
            for k in np.flatnonzero(np.isfinite(limit)).tolist():
                row = np.zeros_like(self.v)
                row[:, k] = side
                gap = side * (self.coordinate[:, k] - limit[k])
                yield row, gap, side * self.run.stop_torque[:, k]

    def fastest(self, speed: Array, velocity: Array) -> Array:
        """Speeds (T − 1, nc) of the points at the faces that they are near to, at a velocity.

        A ball that spins comes to a wall with another speed than to the floor. `speed` is that at
        the face that is told.
        """
        feet = (self.points - self.gaps[..., None] * self.ways)[:, :-1]
        found = speed.copy()
        for row in np.flatnonzero(self.cornered[:-1].any(axis=1)).tolist():
            some = np.flatnonzero(self.cornered[row])
            poses = SpatialPoses(self.tree, self.q[row : row + 1])
            for each in feet[:, row][:, some]:
                jacobian = poses.jacobian(self.model.contact_link[some], each[None])[0]
                fast = np.linalg.norm(jacobian @ velocity[row], axis=-1)
                found[row, some] = np.maximum(found[row, some], fast)
        return found

    def push(self, share: Array) -> Array:
        """Generalised force (T, nv) of the pushes, each acting with a share (T, pushes)."""
        total = np.zeros_like(self.v)
        for i, one in enumerate(self.run.pushes):
            names = self.run.robot.link_names
            link = np.array([max(k for k, name in enumerate(names) if name == one.link)])
            place = self.poses.points(link, np.array([one.point]))
            force = np.broadcast_to(np.array(one.force), (len(self.time), 1, 3))
            total += share[:, i, None] * generalised(self.poses.jacobian(link, place), force)
        return total

    def stops_of_balls(self) -> Iterator[tuple[str, Array, Array, Array]]:
        """Name, row (T, nv), gap (T,) and force (T,) of the stop of each ball joint.

        The gap is what is left of the angle; the row leads back to where it has not turned.
        """
        upright = np.array([1.0, 0.0, 0.0, 0.0])
        for joint, kind in enumerate(self.tree.kind):
            if kind != BALL or not np.isfinite(self.model.upper[joint]):
                continue
            at, first = self.tree.first_q[joint], self.tree.first_v[joint]
            unit = self.q[:, at : at + 4]
            turned = turn(np.broadcast_to(upright, unit.shape), unit)
            angle = np.linalg.norm(turned, axis=1)
            row = np.zeros_like(self.v)
            row[:, first : first + 3] = -turned / np.maximum(angle, 1e-12)[:, None]
            force = np.einsum("tn,tn->t", row, self.run.stop_torque)
            yield self.joints[first], row, self.model.upper[joint] - angle, force

    def lowered(self) -> Array:
        """How much farther (T − 1, nc) below its centre the lowest place of a rim is after a step.

        It is R s below, of a rim of radius R whose axis makes an angle of sine s with the normal.
        """
        model = self.model
        axis = np.einsum(
            "tcij,cj->tci", self.poses.rotation[:, model.contact_link], model.contact_axis
        )
        before, after = (
            np.linalg.norm(np.cross(each, self.normal[:-1]), axis=-1)
            for each in (axis[:-1], axis[1:])
        )
        return np.asarray(model.contact_rim * (after - before))

    def explained(self, left: Array) -> Array:
        """Generalised impulses (T − 1, nv) less what the record leaves open.

        Of a point at two faces it has the resultant, as if all of it acted at the face below: how
        much of it acts at the other, elsewhere on the point, is open.
        """
        left = left.copy()
        pressed = self.cornered[:-1] & (np.abs(self.force[:-1]).max(axis=-1) > 0.0)
        for row in np.flatnonzero(pressed.any(axis=1)).tolist():
            some = np.flatnonzero(pressed[row])
            link = self.model.contact_link[some]
            one = slice(row, row + 1)
            poses = SpatialPoses(self.tree, self.q[one])
            here = poses.jacobian(link, self.foot[one][:, some])
            feet = self.points - self.gaps[..., None] * self.ways
            others = [poses.jacobian(link, feet[f][one][:, some]) - here for f in range(len(feet))]
            arms = np.concatenate([each.reshape(-1, self.tree.nv) for each in others])
            left[row] -= arms.T @ np.linalg.lstsq(arms.T, left[row], rcond=1e-9)[0]
        return left

    def geometry(self, found: Findings) -> None:
        """Hold what the record says of contact points against their own measure."""
        size = 1.0 + np.abs(self.foot).max(axis=-1, initial=0.0)
        apart = np.linalg.norm(self.ways - self.normal, axis=-1)
        face = (apart + np.abs(self.gaps - self.gap)).argmin(axis=0)[None]
        own, way = (np.take_along_axis(each, face, axis=0)[0] for each in (self.gaps, apart))
        point = np.take_along_axis(self.points, face[..., None], axis=0)[0]
        near = np.abs(self.gap) < REACH
        names, time = self.contacts, self.time
        found.look("recorded gap", np.where(near, np.abs(self.gap - own) / size, 0.0), SAME_PLACE,
                   time, names)  # fmt: skip
        found.look("recorded normal", np.where(near, way, 0.0), SAME_WAY, time, names)
        away = np.linalg.norm(point - self.run.contact_point, axis=-1)
        found.look("recorded place", np.where(near, away / size, 0.0), SAME_PLACE, time, names)
        # What is recorded is the face below a point; a wall beside it is watched, and not told of.
        deeper = np.minimum(self.gap, 0.0) - self.gaps.min(axis=0)
        found.look("in another face", deeper, SINK, time, names)
        unit = max(
            (abs(float(np.linalg.norm(self.q[:, at : at + 4], axis=1).max()) - 1.0)
             for at in self._quaternions()), default=0.0,
        )  # fmt: skip
        found.look("length of quaternions", np.array([unit]), 1e-12, time)

    def _quaternions(self) -> list[int]:
        return [
            at + (0 if kind == BALL else 3)
            for at, kind in zip(self.tree.first_q, self.tree.kind, strict=True)
            if kind <= BALL
        ]

    def energy(self) -> tuple[Array, Array]:
        """Kinetic and potential energy (T,)."""
        kinetic = 0.5 * self.metric.of_velocity(self.v) ** 2
        return kinetic, self.poses.potential_energy(self.q)

    def speed(self) -> Array:
        """Velocities (T, nc, 3) of the feet of the contact points along normal and tangents."""
        return rates(self.jacobian, self.v)
