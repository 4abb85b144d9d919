"""Random contact problems with the physics left in: planar robots that touch the ground.

A floating body carries a random tree of hinged links; some of them touch a ground with flat feet,
points, the same vertex twice or wedges, and some hinges rest on stops. Masses may differ by seven
orders of magnitude. The free term is chosen so that a solution exists: either it is a velocity of
the robot (a solution exists by the theory of Lemke's method for copositive matrices) or it is
made from a solution, on the edges of the cones and of the complementarity on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """A contact problem and where it comes from."""

    kind: str
    delassus: Floats
    free: Floats
    friction: Floats
    jacobian: Floats  # (2 nc, nv)
    mass_matrix: Floats  # (nv, nv)

    @property
    def count(self) -> int:
        return self.friction.size


def random_problem(rng: np.random.Generator, contacts: int | None = None) -> Problem:
    """Draw a contact problem with ``contacts`` contacts, 1 to 8 if not given."""
    count = int(rng.integers(1, 9)) if contacts is None else contacts
    ill_scaled = rng.random() < 0.4
    links = int(rng.integers(1, 6))
    span = 3.5 if ill_scaled else 0.7
    centre = 0.5 if ill_scaled else 0.3
    mass = 10.0 ** (centre + span * rng.uniform(-1.0, 1.0, links))
    length = 10.0 ** rng.uniform(-1.0, 0.3, links)
    inertia = mass * length**2 * rng.uniform(0.02, 0.3, links)
    parent = [-1] + [int(rng.integers(0, i)) for i in range(1, links)]
    tidy = rng.random() < 0.3  # right angles and round numbers: ties everywhere
    nv = 3 + links - 1

    joint = np.zeros((links, 2))
    com = np.zeros((links, 2))
    paths: list[list[int]] = []
    for i in range(links):
        angle = np.pi / 2 * rng.integers(4) if tidy else rng.uniform(0.0, 2 * np.pi)
        heading = np.round(np.array([np.cos(angle), np.sin(angle)]), 12)
        if i == 0:
            joint[i], path = np.zeros(2), []
        else:
            above = com[parent[i]]
            joint[i] = above + length[parent[i]] * (0.5 * (above - joint[parent[i]]))
            path = [*paths[parent[i]], i]
        com[i] = joint[i] + 0.5 * length[i] * heading
        paths.append(path)

    def point_jacobian(link: int, point: Floats) -> Floats:
        rows = np.zeros((2, nv))
        rows[0, 0] = rows[1, 1] = 1.0
        for j in (0, *paths[link]):
            arm = point - joint[j]
            rows[:, 2 + j] = (arm[1], -arm[0])
        return rows

    M = np.zeros((nv, nv))
    for i in range(links):
        rows = point_jacobian(i, com[i])
        turn = np.zeros(nv)
        turn[2] = 1.0
        turn[[2 + j for j in paths[i]]] = 1.0
        M += mass[i] * rows.T @ rows + inertia[i] * np.outer(turn, turn)

    friction_kind = rng.integers(4)
    one_friction = float(rng.choice([0.0, 0.3, 0.75, 1.0, 2.0])) if friction_kind else -1.0
    slopes = rng.random() < 0.25
    J = np.zeros((2 * count, nv))
    friction = np.zeros(count)
    contact = 0
    while contact < count:
        link = int(rng.integers(links))
        kind = rng.choice(["flat", "flat", "flat3", "point", "twice", "stop"])
        if kind == "stop" and links == 1:
            kind = "point"
        if kind == "stop":
            hinge = int(rng.integers(1, links))
            J[2 * contact, 2 + hinge] = rng.choice([-1.0, 1.0])
            contact += 1
            continue
        size = {"flat": 2, "flat3": 3, "point": 1, "twice": 2}[str(kind)]
        size = min(size, count - contact)
        reach = length[link]
        start = com[link] + reach * (
            rng.choice([-0.5, 0.5], 2) if tidy else rng.uniform(-1.0, 1.0, 2)
        )
        tilt = rng.uniform(-0.4, 0.4) if slopes else 0.0
        normal = np.array([np.sin(tilt), np.cos(tilt)])
        tangent = np.array([np.cos(tilt), -np.sin(tilt)])
        foot = reach * (0.25 if tidy else rng.uniform(0.05, 0.6))
        for k in range(size):
            point = start if kind == "twice" else start + k * foot * tangent
            rows = point_jacobian(link, point)
            J[2 * contact] = normal @ rows
            J[2 * contact + 1] = tangent @ rows
            if friction_kind == 0:
                friction[contact] = rng.uniform(0.0, 2.0) * (rng.random() < 0.85)
            else:
                friction[contact] = one_friction
            contact += 1

    root = np.linalg.cholesky(M)
    X = np.linalg.solve(root, J.T)
    G = X.T @ X
    G = 0.5 * (G + G.T)
    for k in range(count):  # stops have no tangential direction at all
        if not J[2 * k + 1].any():
            G[2 * k + 1] = G[:, 2 * k + 1] = 0.0

    speed = 10.0 ** rng.uniform(-3.0, 1.0)
    v = speed * rng.standard_normal(nv)
    case = rng.choice(["falling", "resting", "made", "made"])
    if case == "falling":
        b = J @ v
        if rng.random() < 0.3:
            gaps = rng.random(count) * (rng.random(count) < 0.5)
            b[::2] += speed * gaps
    elif case == "resting":
        weight = np.zeros(nv)
        for i in range(links):
            weight -= mass[i] * 9.81 * point_jacobian(i, com[i])[1]
        if rng.random() < 0.5:
            weight += rng.standard_normal(nv) * np.abs(weight).max()
        b = J @ np.linalg.solve(M, 1e-3 * weight)
    else:
        b = _made(rng, G, J, friction, v)
    return Problem(
        f"{case}{'/ill-scaled' if ill_scaled else ''}{'/tidy' if tidy else ''}",
        G,
        b,
        friction,
        J,
        M,
    )


def hard_problem(rng: np.random.Generator, contacts: int | None = None) -> tuple[Problem, Floats]:
    """Draw a problem that no robot need have; return it and the impulse it was planted from.

    Rows of the Jacobian are random, many depend on others exactly or nearly (down to 1e-8), and are
    as long as masses 1e8 apart make them. Friction goes up to 1000. Half of the free velocities are
    planted: made from a solution on edges and corners of the cones, often of impulses that almost
    cancel. The others are drawn, and the impulse returned is NaN; many of these problems have no
    solution.
    """
    count = int(rng.integers(1, 9)) if contacts is None else contacts
    rows = 2 * count
    nv = int(rng.integers(1, rows + 3))
    J = rng.standard_normal((rows, nv))
    if rng.random() < 0.5:
        J *= rng.random((rows, nv)) < 0.6
    if rng.random() < 0.3:
        J = np.round(4.0 * J) / 4.0
    closeness = rng.choice([0.0, 0.0, 1.0, 1.0]) * 10.0 ** rng.uniform(-8.0, 0.0)
    for row in range(1, rows):
        if rng.random() < 0.3:
            other = int(rng.integers(row))
            J[row] = rng.choice([-1.0, 1.0]) * J[other] + closeness * rng.standard_normal(nv)
    spread = rng.choice([0.0, 2.0, 4.0])
    J *= 10.0 ** rng.uniform(-spread, spread, nv)
    friction = 10.0 ** rng.uniform(-2.0, rng.choice([0.5, 3.0]), count)
    friction[rng.random(count) < 0.15] = 0.0
    planted = rng.random() < 0.5
    impulse = np.full(rows, np.nan)
    if planted:
        root = np.sqrt(np.sum(J * J, axis=1))
        push = np.divide(1.0, root, out=np.ones(rows), where=root > 0.0)
        velocity = np.zeros(rows)
        impulse = np.zeros(rows)
        for k in range(count):
            n, t = 2 * k, 2 * k + 1
            if rng.random() < 0.3:
                velocity[n] = root[n] * rng.random() * (rng.random() < 0.8)
                velocity[t] = root[t] * rng.standard_normal()
                continue
            impulse[n] = push[n] * rng.random() * 10.0 ** rng.uniform(-1.0, 1.0)
            limit = friction[k] * impulse[n]
            if rng.random() < 0.4:
                velocity[t] = root[t] * rng.standard_normal()
                impulse[t] = -limit * np.sign(velocity[t])
            else:
                impulse[t] = limit * (rng.uniform(-1.0, 1.0) if rng.random() < 0.7 else 1.0)
        if rng.random() < 0.5 and impulse.any():  # almost an internal force
            rest = 10.0 ** rng.uniform(-10.0, 0.0)
            J -= (1.0 - rest) * np.outer(impulse, impulse @ J) / (impulse @ impulse)
            velocity *= rest
    G = J @ J.T
    G = 0.5 * (G + G.T)
    if planted:
        b = velocity - G @ impulse
    else:
        b = J @ rng.standard_normal(nv)
        if rng.random() < 0.5:
            b += rng.choice([1e-6, 1e-2, 1.0]) * np.abs(b).max() * rng.standard_normal(rows)
    return Problem("planted" if planted else "drawn", G, b, friction, J, np.eye(nv)), impulse


def _made(rng: np.random.Generator, G: Floats, J: Floats, friction: Floats, v: Floats) -> Floats:
    """Return the free term of a problem whose solution is drawn first, degenerate on purpose."""
    count = friction.size
    closed = rng.random(count) < 0.7
    normals = J[::2][closed]
    if normals.size:
        _, values, right = np.linalg.svd(normals)
        rank = int(np.sum(values > 1e-10 * values.max()))
        null = right[rank:]
        v = null.T @ (null @ v)
    if rng.random() < 0.3:
        v = np.zeros_like(v)
    w = J @ v
    size = np.abs(J) @ np.abs(v)
    impulse = np.zeros(2 * count)
    offset = np.zeros(2 * count)
    unit = (1.0 + np.abs(w).max()) / max(np.diag(G)[::2].max(), 1e-12)
    for k in range(count):
        n, t = 2 * k, 2 * k + 1
        if not closed[k]:
            offset[n] = max(0.0, -w[n]) + (rng.random() < 0.7) * rng.random()
            continue
        impulse[n] = unit * rng.random() * (rng.random() < 0.8)
        limit = friction[k] * impulse[n]
        if abs(w[t]) > 1e-9 * size[t]:
            impulse[t] = -limit * np.sign(w[t])
        else:
            impulse[t] = limit * (
                rng.choice([-1.0, 1.0]) if rng.random() < 0.3 else rng.uniform(-1.0, 1.0)
            )
    return w + offset - G @ impulse
