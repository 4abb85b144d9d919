"""Random contact problems in space that have a solution.

Contacts join rigid bodies to the ground or to each other, or rows are drawn at random. A velocity
that separates all contacts is drawn first, and the normals are laid round it: the velocity of each
contact lies within the dual of its cone, so that a solution exists whatever the free velocity is
(Acary, Cadoux, Lemaréchal and Malick 2011). Ranks go from 3 to full, masses from 1 to 1e4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SpatialProblem:
    """A contact problem in space and where it comes from."""

    kind: str
    delassus: Floats
    free: Floats
    friction: Floats
    jacobian: Floats  # (3 nc, nv)
    mass: Floats  # (nv,) of a diagonal mass matrix
    separating: Floats  # (nv,) velocity that separates all contacts

    @property
    def count(self) -> int:
        return self.friction.size


def frame(normal: Floats) -> Floats:
    """Rows: a normal, and two tangents perpendicular to it."""
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    return np.array([normal, first, np.cross(normal, first)])


def turned_towards(rng: np.random.Generator, speed: Floats, friction: float) -> Floats:
    """A frame in whose dual cone a velocity lies, with some room: normal > 1.1 μ tangential."""
    direction = speed / np.linalg.norm(speed)
    widest = np.arctan(1.0 / (1.1 * friction))
    angle = rng.uniform(0.0, min(widest, 1.4))
    axis = frame(direction)[1]
    spin = rng.uniform(0.0, 2.0 * np.pi)
    side = np.cos(spin) * axis + np.sin(spin) * np.cross(direction, axis)
    normal = np.cos(angle) * direction + np.sin(angle) * side
    rows = frame(normal / np.linalg.norm(normal))
    assert rows[0] @ speed > friction * np.linalg.norm(rows[1:] @ speed)
    return rows


def cross_matrix(arm: Floats) -> Floats:
    return np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])


def random_spatial_problem(rng: np.random.Generator, contacts: int | None = None) -> SpatialProblem:
    """Draw a contact problem of so many contacts, 1 to 16 if not given."""
    count = int(rng.integers(1, 17)) if contacts is None else contacts
    friction = 10.0 ** rng.uniform(-1.0, np.log10(2.0), count)
    if rng.random() < 0.3:
        friction[:] = friction[0]
    kind = str(rng.choice(["bodies", "rows"]))
    raw = np.zeros((count, 3, 0))
    if kind == "bodies":
        bodies = int(rng.integers(1, max(2, count // 2 + 1)))
        heavy = 10.0 ** rng.uniform(0.0, 4.0, bodies)
        size = 10.0 ** rng.uniform(-1.0, 0.0, bodies)
        parts = [
            np.r_[[m] * 3, m * s**2 * rng.uniform(0.1, 0.5, 3)]
            for m, s in zip(heavy, size, strict=True)
        ]
        mass = np.concatenate(parts)
        raw = np.zeros((count, 3, 6 * bodies))
        for k in range(count):
            one = int(rng.integers(bodies))
            arm = size[one] * rng.uniform(-1.0, 1.0, 3)
            raw[k][:, 6 * one : 6 * one + 6] = np.hstack([np.eye(3), -cross_matrix(arm)])
            other = int(rng.integers(bodies))
            if other != one and rng.random() < 0.4:
                arm = size[other] * rng.uniform(-1.0, 1.0, 3)
                raw[k][:, 6 * other : 6 * other + 6] = -np.hstack([np.eye(3), -cross_matrix(arm)])
    else:
        freedoms = int(rng.integers(3, 3 * count + 1))
        mass = 10.0 ** rng.uniform(0.0, 4.0, freedoms)
        raw = rng.normal(size=(count, 3, freedoms))
    separating = rng.normal(size=mass.size) / np.sqrt(mass)
    rows = [
        turned_towards(rng, part @ separating, mu) @ part
        for part, mu in zip(raw, friction, strict=True)
    ]
    jacobian = np.concatenate(rows)
    velocity = rng.normal(size=mass.size) / np.sqrt(mass)
    half = jacobian / np.sqrt(mass)
    delassus = half @ half.T
    return SpatialProblem(
        kind=kind,
        delassus=0.5 * (delassus + delassus.T),
        free=jacobian @ velocity,
        friction=friction,
        jacobian=jacobian,
        mass=mass,
        separating=separating,
    )
