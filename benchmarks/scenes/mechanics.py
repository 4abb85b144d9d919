"""Mechanics of a planar tree in plain numpy, over all rows of a record at once.

Derived from the positions of the centres of mass alone: with their Jacobians J_i and the constant
rows w_i of the links' rotations,

    M = Σ m_i J_iᵀJ_i + I_i w_i w_iᵀ + diag(armature),    H = Σ m_i J_iᵀ (J̇_i v − g)

(in the plane a turning link has no gyroscopic moment). No recursion over forces, no factorisation
along the tree, no reference point: nothing is shared with the kernels of the simulator but the
meaning of the robot's numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Tree:
    """A planar tree by its numbers.

    Parameters
    ----------
    numbers : object
        Has ``parent``, ``axis``, ``offset``, ``reference``, ``mass``, ``center_of_mass``,
        ``inertia``, ``armature``, ``damping``, ``stiffness``, ``rest`` and ``gravity`` as a robot's
        ``model`` has them.
    """

    def __init__(self, numbers: Any) -> None:
        self.numbers = numbers
        self.parent = np.asarray(numbers.parent)
        self.size = len(self.parent)
        self.axis = np.asarray(numbers.axis, dtype=float)
        self.above = np.zeros((self.size, self.size))
        """Whether joint j moves link i."""
        for link in range(self.size):
            joint = link
            while joint >= 0:
                self.above[link, joint] = 1.0
                joint = int(self.parent[joint])
        self.turn = self.above * self.axis[:, 0]
        """Rotation of link i about +y per unit of coordinate j."""


def turned(angle: Array, vector: Array) -> Array:
    """Vector (x, z) turned about +y: a positive angle leans it forward."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, z = vector[..., 0], vector[..., 1]
    return np.stack((cosine * x + sine * z, cosine * z - sine * x), axis=-1)


def across(vector: Array) -> Array:
    """Velocity of the end of a vector (x, z) per unit of rotation about +y."""
    return np.stack((vector[..., 1], -vector[..., 0]), axis=-1)


class Poses:
    """Poses of a tree at T states.

    Parameters
    ----------
    tree : Tree
        The tree.
    q : (T, n) float
        Coordinates.

    Attributes
    ----------
    angle : (T, n) float
        Rotations of the links.
    origin, slide : (T, n, 2) float
        Origins of the links, and directions of the slides (zero for hinges), in the world.
    center : (T, n, 2) float
        Centres of mass.
    """

    def __init__(self, tree: Tree, q: Array) -> None:
        numbers = tree.numbers
        moved = q - numbers.reference
        self.tree = tree
        self.angle = moved @ tree.turn.T
        origin, slide = [], []
        for link, parent in enumerate(tree.parent):
            along = np.asarray(tree.axis[link, 1:])
            place = numbers.offset[link] + moved[:, link, None] * along
            if parent < 0:
                origin.append(place)
                slide.append(np.broadcast_to(along, place.shape))
            else:
                origin.append(origin[parent] + turned(self.angle[:, parent], place))
                slide.append(turned(self.angle[:, parent], np.broadcast_to(along, place.shape)))
        self.origin = np.stack(origin, axis=1)
        self.slide = np.stack(slide, axis=1)
        self.center = self.points(np.arange(tree.size), numbers.center_of_mass)

    def points(self, link: Array, local: Array) -> Array:
        """World positions (T, p, 2) of points of links."""
        return self.origin[:, link] + turned(self.angle[:, link], np.asarray(local))

    def local(self, link: int, position: Array) -> Array:
        """Where a world position (2,) is on a link in the first state, in its frame."""
        return turned(-self.angle[0, link], position - self.origin[0, link])

    def jacobian(self, link: Array, position: Array) -> Array:
        """Jacobians (T, p, 2, n) of points of links that are now at `position` (T, p, 2)."""
        arm = position[:, :, None] - self.origin[:, None]
        columns = self.tree.axis[:, 0, None] * across(arm) + self.slide[:, None]
        return np.swapaxes(columns * self.tree.above[link][None, :, :, None], 2, 3)

    def bias_acceleration(self, v: Array, link: Array, position: Array) -> Array:
        """Accelerations J̇v (T, p, 2) of points of links while v (T, n) does not change."""
        tree = self.tree
        rate = v @ tree.turn.T
        origin: list[Array] = []
        for i, parent in enumerate(tree.parent):
            if parent < 0:
                origin.append(np.zeros_like(self.origin[:, i]))
                continue
            turning = rate[:, parent, None]
            arm = self.origin[:, i] - self.origin[:, parent]
            gliding = self.slide[:, i] * v[:, i, None]
            origin.append(origin[parent] - turning**2 * arm + 2.0 * turning * across(gliding))
        base = np.stack(origin, axis=1)[:, link]
        return base - rate[:, link, None] ** 2 * (position - self.origin[:, link])

    def mass_matrix(self) -> Array:
        """Mass matrices (T, n, n)."""
        numbers, tree = self.tree.numbers, self.tree
        jacobian = self.jacobian(np.arange(tree.size), self.center)
        flat = jacobian.reshape(len(jacobian), -1, tree.size)
        weight = np.repeat(numbers.mass, 2)
        matrix = np.swapaxes(flat * weight[:, None], 1, 2) @ flat
        return matrix + (tree.turn.T * numbers.inertia) @ tree.turn + np.diag(numbers.armature)

    def bias_force(self, v: Array) -> Array:
        """Centrifugal, Coriolis and gravitational forces H (T, n)."""
        numbers, tree = self.tree.numbers, self.tree
        links = np.arange(tree.size)
        pull = self.bias_acceleration(v, links, self.center) - numbers.gravity
        jacobian = self.jacobian(links, self.center)
        return np.einsum("tpcn,tpc,p->tn", jacobian, pull, numbers.mass, optimize=True)

    def potential_energy(self, q: Array) -> Array:
        """Energy (T,) in the field of gravity and in the joint springs."""
        numbers = self.tree.numbers
        height = -np.einsum("tpc,c,p->t", self.center, numbers.gravity, numbers.mass)
        return height + 0.5 * (q - numbers.rest) ** 2 @ numbers.stiffness


def generalised(jacobian: Array, force: Array) -> Array:
    """Generalised force (T, n) of forces (T, p, 2) along the rows of a Jacobian (T, p, 2, n)."""
    return np.einsum("tpcn,tpc->tn", jacobian, force, optimize=True)


def rates(jacobian: Array, v: Array) -> Array:
    """Velocities (T, p, 2) along the rows of a Jacobian."""
    return np.einsum("tpcn,tn->tpc", jacobian, v, optimize=True)


class Metric:
    """Sizes of velocities and forces that no choice of coordinates or units changes.

    With M = L Lᵀ a velocity has the size |Lᵀv| = √(2 × kinetic energy), a generalised impulse p the
    size |L⁻¹p| of the velocity that it makes. A row J of a Jacobian weighs √(J M⁻¹ Jᵀ): |J v| is
    never more than that times the size of v.
    """

    def __init__(self, matrix: Array) -> None:
        self.matrix = matrix
        self.root = np.linalg.cholesky(matrix)

    def of_velocity(self, v: Array) -> Array:
        """Sizes (T,) of velocities (T, n)."""
        return np.linalg.norm(np.einsum("tij,ti->tj", self.root, v), axis=1)

    def of_force(self, force: Array) -> Array:
        """Sizes (T,) of generalised forces or impulses (T, n)."""
        return np.linalg.norm(np.linalg.solve(self.root, force[..., None])[..., 0], axis=1)

    def accelerated(self, force: Array) -> Array:
        """M⁻¹ times generalised forces (T, n)."""
        return np.linalg.solve(self.matrix, force[..., None])[..., 0]

    def weight(self, jacobian: Array) -> Array:
        """Weights (T, p, 2) of the rows of a Jacobian (T, p, 2, n)."""
        rows = jacobian.reshape(len(jacobian), -1, jacobian.shape[-1])
        half = np.linalg.solve(self.root, np.swapaxes(rows, 1, 2))
        return np.linalg.norm(half, axis=1).reshape(jacobian.shape[:3])

    def joint_weight(self) -> Array:
        """Weights (T, n) of the rows that are one coordinate each."""
        inverse = np.linalg.inv(self.root)
        return np.linalg.norm(inverse, axis=1)
