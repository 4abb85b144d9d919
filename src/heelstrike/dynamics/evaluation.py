"""From what a person hands in to what the kernels work on: checked vectors, links, workspaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.dynamics import kernels
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot

Floats = NDArray[np.float64]


def joint_vector(robot: Robot, name: str, value: ArrayLike) -> Floats:
    """Return a vector over the coordinates, (nv,), or raise a `RobotError` that names them."""
    return _vector(robot, name, value, robot.joint_names)


def torque_vector(robot: Robot, value: ArrayLike) -> Floats:
    """Return a vector over the actuators, (nu,), or raise a `RobotError` that names them."""
    return _vector(robot, "torque", value, robot.actuator_names)


def _vector(robot: Robot, name: str, value: ArrayLike, entries: tuple[str, ...]) -> Floats:
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (len(entries),):
        raise RobotError(
            f"{name} of robot {robot.name!r} must have {len(entries)} entries "
            f"({', '.join(entries)}), got shape {vector.shape}"
        )
    return vector


def plane_vector(name: str, value: ArrayLike) -> Floats:
    """Return a point or vector (x, z) of the plane, (2,), or raise a `RobotError`."""
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (2,) or not np.all(np.isfinite(vector)):
        raise RobotError(f"{name} must be two finite numbers (x, z) in metres, got {value!r}")
    return vector


def link_index(robot: Robot, link: int | str) -> int:
    """Return the index of a link given by its index or by the name of its body.

    A body with several joints is a chain of links of one name; the last of them carries the body.

    Raises
    ------
    RobotError
        If the robot has no such link.
    """
    if isinstance(link, str):
        places = [i for i, name in enumerate(robot.link_names) if name == link]
        if places:
            return places[-1]
    elif -robot.nv <= int(link) < robot.nv:
        return int(link) % robot.nv
    raise RobotError(
        f"robot {robot.name!r} has no link {link!r}; its links are "
        f"{', '.join(dict.fromkeys(robot.link_names))} (or 0 to {robot.nv - 1})"
    )


def contact_indices(robot: Robot, contacts: object) -> tuple[int, ...]:
    """Return indices of contact points given by index or name, in the order given.

    Raises
    ------
    RobotError
        If the robot has no such contact point.
    """
    given = (contacts,) if isinstance(contacts, str | int | np.integer) else tuple(contacts)  # type: ignore[arg-type]
    found: list[int] = []
    for contact in given:
        if isinstance(contact, str) and contact in robot.contact_names:
            found.append(robot.contact_names.index(contact))
        elif not isinstance(contact, str) and 0 <= int(contact) < robot.nc:
            found.append(int(contact))
        else:
            raise RobotError(
                f"robot {robot.name!r} has no contact point {contact!r}; it has "
                f"{', '.join(robot.contact_names) or 'none'}"
            )
    return tuple(dict.fromkeys(found))


def evaluated(robot: Robot, q: ArrayLike, v: ArrayLike | None = None) -> Workspace:
    """Workspace with kinematics (and velocities, if `v` is given) of a state."""
    work = workspace(robot.nv)
    kernels.forward_kinematics(robot.model, joint_vector(robot, "q", q), work)
    velocity = np.zeros(robot.nv) if v is None else joint_vector(robot, "v", v)
    kernels.link_velocities(robot.model, velocity, work)
    return work
