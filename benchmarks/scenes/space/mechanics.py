"""Mechanics of a tree in space in plain numpy, over all rows of a record at once.

Derived from the positions of the centres of mass and the rotations of the links alone: with the
Jacobians J_i of the former, those W_i of the angular velocities ω_i (in world axes), and the
tensors of inertia I_i turned into the world,

    M = Σ m_i J_iᵀJ_i + W_iᵀ I_i W_i + diag(armature),
    H = Σ m_i J_iᵀ (J̇_i v − g) + W_iᵀ (I_i Ẇ_i v + ω_i × I_i ω_i).

No recursion over forces, no factorisation along the tree, no reference point: nothing is shared
with the kernels of the simulator but the meaning of the robot's numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

FREE, BALL, SLIDE, HINGE = range(4)
"""Kinds of joints, by the numbers that MuJoCo gives them."""


def product(one: Array, other: Array) -> Array:
    """Quaternion that turns by `other` and then by `one`, real part first."""
    a, b, c, d = np.moveaxis(one, -1, 0)
    w, x, y, z = np.moveaxis(other, -1, 0)
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def quaternion(vector: Array) -> Array:
    """Quaternion of a rotation vector (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate(
        (np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * vector), axis=-1
    )


def turn(start: Array, end: Array) -> Array:
    """Rotation vector (..., 3), in the axes of the start, of the shorter way to the end."""
    back = start * np.array([1.0, -1.0, -1.0, -1.0])
    between = product(back, end)
    between = np.where(between[..., :1] < 0.0, -between, between)
    sine = np.linalg.norm(between[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, between[..., :1])
    small = sine < 1e-9
    return between[..., 1:] * np.where(small, 2.0, angle / np.where(small, 1.0, sine))


def matrix(unit: Array) -> Array:
    """Rotation matrix (..., 3, 3) of a quaternion."""
    w, x, y, z = np.moveaxis(unit / np.linalg.norm(unit, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def along(rotation: Array, vector: Array) -> Array:
    """Turn vectors (..., 3) by rotation matrices."""
    return np.einsum("...ij,...j->...i", rotation, vector)


class SpatialTree:
    """A tree in space by its numbers.

    Parameters
    ----------
    numbers : object
        Has the fields of a robot's ``model`` in space.
    """

    def __init__(self, numbers: Any) -> None:
        self.numbers = numbers
        self.parent = [int(each) for each in numbers.parent]
        self.kind = [int(each) for each in numbers.joint_kind]
        self.first_q = [int(each) for each in numbers.first_position]
        self.first_v = [int(each) for each in numbers.first_velocity]
        self.size, self.nv, self.nq = len(self.parent), int(numbers.nv), int(numbers.nq)
        self.count = [(6, 3, 1, 1)[kind] for kind in self.kind]
        self.above = np.zeros((self.size, self.nv))
        """Whether velocity k moves link i."""
        for link in range(self.size):
            joint = link
            while joint >= 0:
                first = self.first_v[joint]
                self.above[link, first : first + self.count[joint]] = 1.0
                joint = self.parent[joint]

    def moved(self, q: Array, v: Array, time: float) -> Array:
        """Positions (T, nq) after a time at constant velocities (T, nv)."""
        result = q.copy()
        for link, kind in enumerate(self.kind):
            at, to = self.first_q[link], self.first_v[link]
            if kind == FREE:
                result[:, at : at + 3] += time * v[:, to : to + 3]
                at, to = at + 3, to + 3
            if kind in (FREE, BALL):
                turned = quaternion(time * v[:, to : to + 3])
                unit = product(q[:, at : at + 4], turned)
                result[:, at : at + 4] = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
            else:
                result[:, at] += time * v[:, to]
        return result

    def difference(self, start: Array, end: Array) -> Array:
        """Velocities (T, nv) that take positions to others in a unit of time."""
        found = np.zeros((len(start), self.nv))
        for link, kind in enumerate(self.kind):
            at, to = self.first_q[link], self.first_v[link]
            if kind == FREE:
                found[:, to : to + 3] = end[:, at : at + 3] - start[:, at : at + 3]
                at, to = at + 3, to + 3
            if kind in (FREE, BALL):
                found[:, to : to + 3] = turn(start[:, at : at + 4], end[:, at : at + 4])
            else:
                found[:, to] = end[:, at] - start[:, at]
        return found

    def springs(self, q: Array) -> tuple[Array, Array]:
        """Generalised force (T, nv) and energy (T,) of the joint springs."""
        rest = np.broadcast_to(self.numbers.rest, q.shape)
        stretched = self.difference(rest, q)
        back = self.difference(q, rest)
        stiffness = np.zeros(self.nv)
        for link, first in enumerate(self.first_v):
            stiffness[first : first + self.count[link]] = self.numbers.stiffness[link]
        return stiffness * back, 0.5 * stretched**2 @ stiffness


class SpatialPoses:
    """Poses of a tree at T states.

    Parameters
    ----------
    tree : SpatialTree
        The tree.
    q : (T, nq) float
        Positions.

    Attributes
    ----------
    rotation : (T, nl, 3, 3) float
        Axes of the links in the world, as columns.
    origin : (T, nl, 3) float
        Origins of the links.
    turning, gliding : (T, nv, 3) float
        Angular velocity and velocity of the own link, per unit of each velocity.
    pivot : (T, nv, 3) float
        What each velocity turns about.
    center : (T, nl, 3) float
        Centres of mass.
    """

    def __init__(self, tree: SpatialTree, q: Array) -> None:
        numbers, rows = tree.numbers, len(q)
        self.tree = tree
        self.rotation = np.zeros((rows, tree.size, 3, 3))
        self.origin = np.zeros((rows, tree.size, 3))
        self.turning = np.zeros((rows, tree.nv, 3))
        self.gliding = np.zeros((rows, tree.nv, 3))
        self.pivot = np.zeros((rows, tree.nv, 3))
        for link, (kind, parent) in enumerate(zip(tree.kind, tree.parent, strict=True)):
            at, to = tree.first_q[link], tree.first_v[link]
            base = self.rotation[:, parent] if parent >= 0 else np.broadcast_to(
                np.eye(3), (rows, 3, 3)
            )  # fmt: skip
            place = self.origin[:, parent] if parent >= 0 else np.zeros((rows, 3))
            axis = np.asarray(numbers.axis[link], dtype=float)
            origin, own = place + along(base, numbers.offset[link]), base
            if kind == FREE:
                origin, own = q[:, at : at + 3], matrix(q[:, at + 3 : at + 7])
                self.gliding[:, to : to + 3] = np.eye(3)
                self.turning[:, to + 3 : to + 6] = np.swapaxes(own, 1, 2)
            elif kind == BALL:
                own = base @ matrix(np.asarray(numbers.turn[link])) @ matrix(q[:, at : at + 4])
                self.turning[:, to : to + 3] = np.swapaxes(own, 1, 2)
            elif kind == SLIDE:
                self.gliding[:, to] = along(base, axis)
                moved = q[:, at] - numbers.reference[at]
                origin = origin + moved[:, None] * self.gliding[:, to]
            else:
                self.turning[:, to] = along(base, axis)
                angle = q[:, at] - numbers.reference[at]
                own = base @ matrix(quaternion(angle[:, None] * axis))
            self.rotation[:, link], self.origin[:, link] = own, origin
            self.pivot[:, to : to + tree.count[link]] = origin[:, None]
        self.center = self.points(np.arange(tree.size), numbers.center_of_mass)

    def points(self, link: Array, local: Array) -> Array:
        """World positions (T, p, 3) of points of links."""
        return self.origin[:, link] + along(self.rotation[:, link], np.asarray(local))

    def jacobian(self, link: Array, position: Array) -> Array:
        """Jacobians (T, p, 3, nv) of points of links that are now at `position` (T, p, 3)."""
        arm = position[:, :, None] - self.pivot[:, None]
        columns = np.cross(self.turning[:, None], arm) + self.gliding[:, None]
        return np.swapaxes(columns * self.tree.above[link][None, :, :, None], 2, 3)

    def angular(self) -> Array:
        """Jacobians (T, nl, 3, nv) of the angular velocities of the links, in world axes."""
        return np.swapaxes(self.turning[:, None] * self.tree.above[None, :, :, None], 2, 3)

    def inertia(self) -> Array:
        """Tensors of inertia (T, nl, 3, 3) about the centres of mass, in world axes."""
        xx, yy, zz, xy, xz, yz = np.asarray(self.tree.numbers.inertia).T
        own = np.stack(
            [np.stack(row, axis=-1) for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))], axis=-2
        )
        return self.rotation @ own @ np.swapaxes(self.rotation, 2, 3)

    def biases(self, v: Array) -> tuple[Array, Array, Array]:
        """Angular velocities, and accelerations of rotations and origins where v does not change.

        (T, nl, 3) each. Angular velocities of joints that are told in body axes turn with the body,
        those of hinges with the parent: either way ω × (what the joint adds) is what that makes.
        """
        tree = self.tree
        shape = (len(v), tree.size, 3)
        rate, spin, fall = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        for link, (kind, parent) in enumerate(zip(tree.kind, tree.parent, strict=True)):
            part = slice(tree.first_v[link], tree.first_v[link] + tree.count[link])
            added = np.einsum("tki,tk->ti", self.turning[:, part], v[:, part])
            if parent < 0:
                rate[:, link] = added  # the world neither turns nor accelerates
                continue
            turns, arm = rate[:, parent], self.origin[:, link] - self.origin[:, parent]
            glides = np.einsum("tki,tk->ti", self.gliding[:, part], v[:, part])
            rate[:, link] = turns + added
            spin[:, link] = spin[:, parent] + np.cross(turns, added)
            fall[:, link] = (
                fall[:, parent] + np.cross(spin[:, parent], arm)
                + np.cross(turns, np.cross(turns, arm)) + 2.0 * np.cross(turns, glides)
            )  # fmt: skip
            assert kind != FREE  # a free joint has no parent
        return rate, spin, fall

    def mass_matrix(self) -> Array:
        """Mass matrices (T, nv, nv)."""
        numbers = self.tree.numbers
        jacobian, angular = self.jacobian(np.arange(self.tree.size), self.center), self.angular()
        matrix_of = np.einsum("tpci,tpcj,p->tij", jacobian, jacobian, numbers.mass, optimize=True)
        turned = self.inertia() @ angular
        matrix_of += np.einsum("tpci,tpcj->tij", angular, turned, optimize=True)
        return matrix_of + np.diag(numbers.armature)

    def bias_force(self, v: Array) -> Array:
        """Centrifugal, Coriolis and gravitational forces H (T, nv)."""
        numbers = self.tree.numbers
        rate, spin, fall = self.biases(v)
        arm = self.center - self.origin
        pull = fall + np.cross(spin, arm) + np.cross(rate, np.cross(rate, arm)) - numbers.gravity
        jacobian = self.jacobian(np.arange(self.tree.size), self.center)
        force = np.einsum("tpcn,tpc,p->tn", jacobian, pull, numbers.mass, optimize=True)
        inertia = self.inertia()
        moment = along(inertia, spin) + np.cross(rate, along(inertia, rate))
        return force + np.einsum("tpcn,tpc->tn", self.angular(), moment, optimize=True)

    def potential_energy(self, q: Array) -> Array:
        """Energy (T,) in the field of gravity and in the joint springs."""
        numbers = self.tree.numbers
        height = -np.einsum("tpc,c,p->t", self.center, numbers.gravity, numbers.mass)
        return height + self.tree.springs(q)[1]
