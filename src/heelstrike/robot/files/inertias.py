"""Inertias that no body in space can have, and that are good enough for us.

Of a planar robot only the moment about the plane's normal acts. Files of planar robots often give
no other, or round them until no body could have them, and parsers refuse such bodies or replace
their moments. Here such a tensor is taken out of the file before it is compiled, and its moment
about the normal put into the compiled robot; of a robot in space, all of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.files.snapping import IN_PLANE
from heelstrike.robot.model import Floats
from heelstrike.robot.plausibility import is_possible
from heelstrike.robot.warning import warn

MASSLESS = 1e-14  # kg, kg m²; no link that is meant to weigh anything weighs less
MOMENT_MARGIN = 1e-9  # share of the largest moment by which parsers may judge otherwise than we do


def stated_tensor(body: Any) -> Floats | None:
    """Return the tensor of inertia (3, 3) that a file states of a body, in axes of its own."""
    if not body.explicitinertial or body.id == 0:
        return None
    full = np.array(body.fullinertia, dtype=np.float64)
    if np.isnan(full[0]):  # given by its principal moments
        return np.diag(np.array(body.inertia, dtype=np.float64))
    xx, yy, zz, xy, xz, yz = full
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def take_out(spec: Any) -> list[tuple[Any, Floats]]:
    """Replace tensors that a parser may refuse by spheres of about their size; return them.

    Parameters
    ----------
    spec : mujoco.MjSpec
        The parsed file, which is changed.

    Returns
    -------
    list of (mujoco.MjsBody, (3, 3) float)
        The bodies and their tensors; none if the file asks for others than it states.
    """
    import mujoco

    taken: list[tuple[Any, Floats]] = []
    weighed = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if weighed or spec.compiler.balanceinertia:
        return taken
    for body in spec.bodies:
        tensor = stated_tensor(body)
        if tensor is None or not np.all(np.isfinite(tensor)):
            continue
        low, middle, high = np.linalg.eigvalsh(tensor)
        if low > MOMENT_MARGIN * high and low + middle >= (1.0 + MOMENT_MARGIN) * high:
            continue
        taken.append((body, tensor))
        body.fullinertia[0] = np.nan
        body.inertia[:] = _size(tensor)
    return taken


def put_back(
    model: Any, pose: Any, taken: list[tuple[Any, Floats]], least: float, label: str
) -> None:
    """Give bodies the moments about the plane's normal that their file states.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file, which is changed.
    pose : mujoco.MjData
        Its pose, in which y is the normal.
    taken : list
        What `take_out` returned.
    least : float
        The least moment that the file lets a body have.
    label : str
        What to call the file in messages.

    Raises
    ------
    RobotError
        If such a moment is negative.

    Warns
    -----
    RobotWarning
        Of tensors that say something about other axes which no body can have.
    """
    impossible = []
    for name, place, tensor, share in _stand_ins(model, taken, least):
        normal = pose.ximat[place].reshape(3, 3)[1]
        moment = float(normal @ tensor @ normal)
        if _is_negative(moment, tensor):
            raise RobotError(
                f"{label}: body {name!r} has the moment of inertia {moment:.6g} kg m² about the "
                "normal of the plane in which the robot moves. It must not be negative."
            )
        model.body_inertia[place] = max(moment, least) * share
        if not is_possible(tensor) and not _is_planar(tensor, normal, moment):
            impossible.append(name)
    _tell_of_impossible(
        impossible,
        label,
        "Only the moments about the normal of the plane act here; they are taken as they are.",
    )


def put_back_whole(model: Any, taken: list[tuple[Any, Floats]], least: float, label: str) -> None:
    """Give bodies of a robot in space the tensors that their file states, possible or not.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file, which is changed.
    taken : list
        What `take_out` returned.
    least : float
        The least moment that the file lets a body have.
    label : str
        What to call the file in messages.

    Raises
    ------
    RobotError
        If a principal moment is negative.

    Warns
    -----
    RobotWarning
        Of tensors that no body can have.
    """
    import mujoco

    impossible = []
    for name, place, tensor, share in _stand_ins(model, taken, least):
        moments, axes = np.linalg.eigh(tensor)
        if _is_negative(moments[0], tensor):
            raise RobotError(
                f"{label}: body {name!r} has the principal moment of inertia {moments[0]:.6g} "
                "kg m². It must not be negative."
            )
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] = -axes[:, 0]
        own, turned = np.zeros(4), np.zeros(4)
        mujoco.mju_mat2Quat(own, np.ascontiguousarray(axes).ravel())
        mujoco.mju_mulQuat(turned, np.array(model.body_iquat[place]), own)
        model.body_iquat[place] = turned
        model.body_sameframe[place] = 0  # else its axes count as those of the body
        model.body_inertia[place] = np.maximum(moments, least) * share
        if not is_possible(tensor):
            impossible.append(name)
    _tell_of_impossible(impossible, label, "They are taken as they are.")


def _stand_ins(
    model: Any, taken: list[tuple[Any, Floats]], least: float
) -> Iterator[tuple[str, int, Floats, float]]:
    """Yield name, number and tensor of bodies, and by how much the parser scaled its stand-in.

    A file may ask for another mass of the whole, and what is less than the least was lifted to it.
    """
    for body, tensor in taken:
        share = float(model.body_inertia[body.id, 0]) / max(_size(tensor), least)
        yield body.name or f"body {body.id}", body.id, tensor, share


def _is_negative(moment: float, tensor: Floats) -> bool:
    return moment < -MOMENT_MARGIN * _size(tensor) - MASSLESS


def _tell_of_impossible(names: list[str], label: str, taken_as: str) -> None:
    if names:
        warn(
            f"{label}: no body has the inertia that the file gives {', '.join(names)}: moments are "
            f"not negative, and none is more than the sum of the other two. {taken_as}"
        )


def refuse_missing(model: Any, pose: Any, missing: dict[str, list[str]], label: str) -> None:
    """Refuse moments that a URDF leaves out, where they act in the plane.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file.
    pose : mujoco.MjData
        Its pose, in which y is the normal.
    missing : dict of str to list of str
        Names of the moments that links lack.
    label : str
        What to call the file in messages.

    Raises
    ------
    RobotError
        With the link and the moment.
    """
    for link, moments in missing.items():
        normal = pose.ximat[model.body(link).id].reshape(3, 3)[1]
        for moment in moments:
            if abs(normal["xyz".index(moment[-1])]) > IN_PLANE:
                raise RobotError(
                    f"{label}: <inertia> of link {link!r} lacks {moment!r}, which acts in the "
                    "plane. Give it."
                )


def _size(tensor: Floats) -> float:
    return float(np.abs(np.linalg.eigvalsh(tensor)).max()) or 1.0


def _is_planar(tensor: Floats, normal: Floats, moment: float) -> bool:
    """Whether a tensor has the moment about the plane's normal and nothing else."""
    rest = tensor - moment * np.outer(normal, normal)
    return bool(np.abs(rest).max() <= 1e-6 * abs(moment))
