"""The robot on a flat foot as straight-line code, for laws.

Of a floating tree of which every joint has a motor the structure tells which coordinate each row of
the held foot is solved for: x, z and the pitch of the trunk. So what holds it can be recorded, like
the equations of motion (:mod:`heelstrike.sim.contacts.straight_line`).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.recordings.recording import Program
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.dynamics.held import HeldRows
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.straight_line import has_programs

TRUNK = (0, 1, 2)
"""Coordinates of a floating trunk: x, z, and its rotation."""

SCRATCH = "kinematics.acceleration", "kinematics.force", "kinematics.composite", "held", "passive"
"""What queries of the robot on a flat foot leave nothing in that others read."""


def trunk_follows(robot: Robot) -> bool:
    """Whether trunk and nothing else follows from the joints while a foot is held flat."""
    driven = set(robot.model.actuator_joint.tolist())
    return (
        robot.floating
        and count_rows(robot.model) == 0
        and [j for j in range(robot.nv) if j not in driven] == list(TRUNK)
    )


def flat_foot_holds(robot: Robot) -> NDArray[np.int64]:
    """Return the link of each foot, and the coordinate that each of its rows is solved for."""
    return np.array([(foot.link, *TRUNK) for foot in robot.feet], np.int64).reshape(-1, 4)


def flat_foot_arguments(robot: Robot) -> dict[str, Any]:
    """Return arguments, by name, with which kernels of the robot on a flat foot are recorded."""
    coordinates, motors = np.zeros(robot.nv), np.zeros(robot.nu)
    return {
        "model": robot.model, "q": np.zeros(robot.nq), "v": coordinates,
        "kinematics": Workspace.allocate({**robot.model.extents, "components": 2}),
        "held": HeldRows.allocate(held=3, nv=robot.nv, loop_rows=0), "acceleration": motors,
        "whole": coordinates, "force": coordinates, "passive": coordinates, "torque": motors,
    }  # fmt: skip


def flat_foot_programs(
    robot: Robot, kernel: Callable[..., None], arguments: Mapping[str, Any],
    unread: tuple[str, ...] = (),
) -> tuple[int, ...]:  # fmt: skip
    """Return the addresses of a kernel on each foot; zeros where the structure does not tell all.

    Its argument ``hold`` is the foot's; nobody reads, besides scratch of laws, what is `unread`.
    """
    if not (trunk_follows(robot) and robot.feet and has_programs(robot.nv)):
        return (0,) * len(robot.feet)
    programs = []
    for foot, hold in enumerate(flat_foot_holds(robot)):
        names = inspect.signature(kernel).parameters
        given = {name: hold if name == "hold" else arguments[name] for name in names}
        name = f"{kernel.__name__}_{foot}"
        programs.append(Program(kernel, given, scratch=(*SCRATCH, *unread), name=name))
    return straight_line_code(programs)
