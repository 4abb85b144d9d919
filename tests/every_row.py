"""A robot with rows of nearly every kind, and memory in which nobody has written yet."""

from __future__ import annotations

import numpy as np

from heelstrike.robot import Robot, RobotBuilder
from heelstrike.sim.contacts.rows import DRY_JOINT, STOP, lay_out_rows
from heelstrike.sim.memory import Memory, allocate_memory


def every_kind() -> Robot:
    """Two points, four stops, two dry joints, a loop, a coupling and two brakes."""
    build = RobotBuilder("every kind")
    build.floating_base("trunk", mass=1.0, inertia=0.1)
    build.hinge("hip", "trunk", mass=1.0, inertia=0.1, limits=(-1.0, np.inf))
    build.hinge("knee", "hip", at=(0.0, -0.5), mass=1.0, inertia=0.1, limits=(-2.0, 0.5))
    build.hinge("arm", "trunk", mass=1.0, inertia=0.1, dry_friction=0.3, limits=(-np.inf, 3.0))
    build.hinge("hand", "arm", at=(0.5, 0.0), mass=1.0, inertia=0.1)
    build.contact("knee", (0.0, -1.0))
    build.contact("trunk", (0.0, 0.2))
    build.loop("hand", "trunk", at=(0.5, 0.0))
    build.couple("hand", "arm")
    build.latch("knee", "upper")
    build.brake("hip")
    build.brake("hand", limit=2.0)
    return build.build()


ROBOT = every_kind()
HIP, KNEE, ARM, HAND = (ROBOT.joint_index(name) for name in ("hip", "knee", "arm", "hand"))
ROWS = lay_out_rows(ROBOT)
STOPS = range(int(ROWS.first[STOP]), int(ROWS.end[STOP]))
"""Lower of the hip; lower and upper of the knee; upper of the arm."""
DRY = range(int(ROWS.first[DRY_JOINT]), int(ROWS.end[DRY_JOINT]))
"""Arm and hand."""


def memory_of(robot: Robot = ROBOT) -> Memory:
    """Memory in which what nobody has written is 77."""
    memory = allocate_memory(robot)
    assembly = memory.assembly
    for each in (
        assembly.problem.free, assembly.problem.bound, assembly.directions.jacobian,
        assembly.answer.impulse, assembly.answer.velocity,
    ):  # fmt: skip
        each[:] = 77.0
    for whole in (assembly.candidate, assembly.answer.mode, assembly.begin, assembly.until):
        whole[:] = 77
    assembly.problem.first[0] = 0
    return memory
