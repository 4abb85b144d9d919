"""What the kernels of a robot in space cost: kinematics, equations, rows of its feet.

    python benchmarks/spatial_kernels.py ROBOT [--points 8]

ROBOT is a file or a built-in name. Times are the best of several rounds of processor time, in
microseconds; the rows are those of the first contact points of its feet that are spheres, or of
all their points if none is.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from machine import load

import heelstrike as hs
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial import equations, kinematics, rows
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel

ROUNDS, CALLS = 9, 2000
UP = (0.0, 0.0, 1.0)
LEVEL = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@kernel
def moving(
    calls: int, model: SpatialModel, q: Floats, v: Floats, work: SpatialWorkspace, bias: Floats
) -> None:
    """Kinematics, bias force and composite inertias."""
    for _ in range(calls):
        kinematics.forward_kinematics(model, q, work)
        kinematics.link_velocities(model, v, work)
        equations.bias_force(model, work, bias)
        equations.composite_inertias(model, work)


@kernel
def mass(calls: int, model: SpatialModel, work: SpatialWorkspace, tree: TreeFactor) -> None:
    """Composite inertias and rows of the mass matrix."""
    for _ in range(calls):
        equations.mass_rows(model, work, tree.matrix)


@kernel
def factor(calls: int, model: SpatialModel, v: Floats, tree: TreeFactor, x: Floats) -> None:
    """Factor of the mass matrix, and one solution with it."""
    for _ in range(calls):
        equations.factorize(model, tree)
        for k in range(model.nv):
            x[k] = v[k]
        equations.solve_factorized(model, tree, x)


@kernel
def point_rows(
    calls: int, model: SpatialModel, work: SpatialWorkspace, contacts: Integers, along: Floats
) -> None:
    """Rows of contact points."""
    for _ in range(calls):
        for c in range(contacts.shape[0]):
            point = rows.contact_point(model, work, contacts[c], UP)
            link = model.contact_link[contacts[c]]
            rows.write_point_rows(model, work, link, point, LEVEL, 3 * c, along)


@kernel
def whitened(
    calls: int, model: SpatialModel, tree: TreeFactor, last: Integers, along: Floats
) -> None:
    """Rows times the inverse factor."""
    for _ in range(calls):
        for c in range(last.shape[0]):
            rows.whiten_rows(model, tree, last[c], 3 * c, 3, along)


@kernel
def delassus(
    calls: int, model: SpatialModel, first: Integers, last: Integers, along: Floats, matrix: Floats
) -> None:
    """Delassus matrix from the ancestors that blocks share."""
    for _ in range(calls):
        rows.write_delassus(model, last.shape[0], first, last, along, matrix)


def microseconds(timed: Callable[..., None], *arguments: Any) -> float:
    """Return the time of a call, the best of some rounds."""
    timed(1, *arguments)
    best = np.inf
    for _ in range(ROUNDS):
        begin = time.process_time()
        timed(CALLS, *arguments)
        best = min(best, time.process_time() - begin)
    return 1e6 * best / CALLS


def main() -> None:
    """Time the kernels."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot")
    parser.add_argument("--points", type=int, default=8)
    given = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hs.RobotWarning)
        robot = hs.load_robot(given.robot, dimension=3)
    model = robot.model
    own = [contact for foot in robot.feet for contact in foot.contacts]
    spheres = [contact for contact in own if model.contact_radius[contact] > 0.0]
    contacts = np.array((spheres or own)[: given.points], dtype=np.int64)
    last = model.last_velocity[model.contact_link[contacts]]
    first = 3 * np.arange(len(contacts) + 1)
    work = SpatialWorkspace.allocate(model.extents)
    tree = TreeFactor.allocate(model.extents)
    bias, x = np.zeros((2, robot.nv))
    along = np.zeros((3 * len(contacts), model.longest))
    matrix = np.zeros((3 * len(contacts), 3 * len(contacts)))
    q, v = model.reference, np.random.default_rng(0).normal(size=robot.nv)
    rows_of = np.zeros_like(along)
    times = {
        "kinematics, bias, composite inertias": (moving, model, q, v, work, bias),
        "mass matrix": (mass, model, work, tree),
        "LTDL and a solution": (factor, model, v, tree, x),
        f"rows of {len(contacts)} points": (point_rows, model, work, contacts, along),
        "the same, whitened": (whitened, model, tree, last, rows_of),
        f"Delassus {len(matrix)} x {len(matrix)}": (delassus, model, first, last, along, matrix),
    }
    print(robot, f"load {load():.1f}")
    for name, (timed, *arguments) in times.items():
        print(f"{name:40} {microseconds(timed, *arguments):6.2f} us", flush=True)


if __name__ == "__main__":
    main()
