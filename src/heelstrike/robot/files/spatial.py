"""Robots that cannot be seen in the plane: joints that leave it, mass that would turn out of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.files.posture import BALL, FREE, HINGE
from heelstrike.robot.files.snapping import IN_PLANE
from heelstrike.robot.sides.symmetry import counterparts
from heelstrike.wording import some_of

SHOWN = 4  # how many culprits a message lists before it counts the rest

DOUBTFUL = 1e-2
"""Asymmetry (share of the robot's size or moment of inertia) from which a projection is doubtful.
Cables and connectors of a symmetric design make a few parts in a thousand."""

MOST_ASIDE = 5e-2
"""Share of its size up to which the centre of mass of a projected robot may lie to one side."""


class LeavesPlaneError(RobotError):
    """A robot cannot be seen in the plane, for joints of it leave it."""


def refuse_spatial_joints(
    model: Any, pose: Any, spatial: list[int], stays: bool, label: str
) -> None:
    """Raise a `LeavesPlaneError` that names the joints which leave the plane, if there are any.

    `stays` is whether any joint of the file moves in it.
    """
    axes = pose.xaxis
    free = [joint for joint in spatial if model.jnt_type[joint] == FREE]
    said = []
    if len(free) == len(spatial):
        mend = "or load it with floating=True, which does so."
    elif stays:
        mend = (
            "or load it with projected=True, which does so and locks the joints that leave the "
            "plane."
        )
    else:
        mend = f"but none of its other joints moves in that plane. {nothing_to_keep(model, pose)}"
    for joint in spatial:
        kind = model.jnt_type[joint]
        name = model.joint(joint).name or f"joint {joint}"
        body = model.body(model.jnt_bodyid[joint]).name or f"body {model.jnt_bodyid[joint]}"
        direction = "({:.3g}, {:.3g}, {:.3g})".format(*(axes[joint] + 0.0))
        if kind == FREE:
            raise LeavesPlaneError(
                f"{label}: {name!r} of body {body!r} is a free joint, which moves in three "
                "dimensions. For a robot in the x–z plane give the body three joints instead: "
                f"slide along x, slide along z, hinge about y, in this order; {mend}"
            )
        if kind == BALL:
            said.append(f"{name!r} of body {body!r} is a ball joint")
        elif kind == HINGE:
            said.append(f"{name!r} of body {body!r} turns about {direction}")
        else:
            said.append(f"{name!r} of body {body!r} slides along {direction}")
    if not said:
        return
    shown = some_of([f"joint {one}" for one in said], SHOWN, "; ")
    mend = (
        "Remove these joints (or weld them) to keep the motion in the plane, or load the robot "
        "with projected=True, which locks them."
        if stays or BALL in model.jnt_type
        else nothing_to_keep(model, pose)
    )
    raise LeavesPlaneError(
        f"{label}: this robot leaves the x–z plane; heelstrike simulates planar robots, whose "
        "hinges turn about y and whose slides stay in x–z. In its reference configuration, "
        f"{shown}. {mend}"
    )


def nothing_to_keep(model: Any, pose: Any) -> str:
    """Say why no joint of a robot moves in the plane, and what can be done about that."""
    axes = pose.xaxis[model.jnt_type == HINGE]
    level = axes[np.abs(axes[:, 2]) <= IN_PLANE]
    # How far from y they are, about z: 0 to 180 degrees, of which both ends are the same.
    turns = np.degrees(np.arctan2(-level[:, 0], level[:, 1])) % 180.0
    several = sorted({round(float(turn), 1) % 180.0 for turn in turns})
    if not several:
        return (
            "None of its joints turns about a level axis, as those must that carry a walking robot "
            "in one plane."
        )
    if len(several) == 1:
        return (
            "All its level hinges are parallel: turn the robot in its file by "
            f"{-several[0]:g} degrees about z, so that they point along y."
        )
    words = some_of([f"{turn:g}" for turn in several], SHOWN)
    upright = np.flatnonzero((model.jnt_type == HINGE) & (np.abs(pose.xaxis[:, 2]) > 0.9))
    pose_words = (
        f" Joints about z, as {model.joint(upright[0]).name!r}, can turn its legs until they "
        "do: give their angles as the pose."
        if len(upright)
        else ""
    )
    return (
        f"Its hinges lie at angles of {words} degrees to y: its legs move in upright planes "
        "that differ, and no turn of the whole robot makes one of them. heelstrike simulates "
        f"robots whose legs move in parallel planes.{pose_words}"
    )


def asymmetry(model: Any, pose: Any, bodies: Sequence[int], middle: float, label: str) -> list[str]:
    """Refuse a robot whose mass lies to one side: moving in the plane would turn it out of it.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file.
    pose : mujoco.MjData
        Its pose.
    bodies : sequence of int
        Bodies that move.
    middle : float
        Where the plane of symmetry is, along y (m).
    label : str
        What to call the file in messages.

    Returns
    -------
    list of str
        What to say of a small asymmetry.

    Raises
    ------
    RobotError
        If it is a large one, or the plane has the left behind the right.
    """
    moving = np.isin(model.body_rootid, model.body_rootid[np.asarray(bodies)])
    names = [model.body(body).name for body in np.flatnonzero(moving)]
    mass = model.body_mass[moving]
    if not mass.sum() > 0.0:
        return []  # which the reader says better
    place = pose.xipos[moving]
    apart = np.abs(place - place[counterparts(names)]).sum(axis=0)
    if apart[0] > apart[1]:
        raise RobotError(
            f"{label}: it cannot be projected onto the x–z plane, because its left and right lie "
            'one behind the other there. Does it walk along y? forward="y" turns it.'
        )
    center = mass @ place / mass.sum()
    arm = place - center
    turn = pose.ximat[moving].reshape(-1, 3, 3)
    inertia = np.einsum("bij,bj,bkj->ik", turn, model.body_inertia[moving], turn)
    inertia += np.einsum("b,bi,bi->", mass, arm, arm) * np.eye(3) - np.einsum(
        "b,bi,bj->ij", mass, arm, arm
    )
    if not inertia[1, 1] > 0.0:
        return []
    size = float(np.sqrt(inertia[1, 1] / mass.sum()))
    aside = float(center[1] - middle)
    product = float(np.abs(inertia[1, ::2]).max())
    found = [
        (
            abs(aside) / size,
            MOST_ASIDE,
            f"its centre of mass is {aside:.3g} m to the side of its middle: left and right weigh "
            "differently",
        ),
        (
            product / float(inertia[1, 1]),
            DOUBTFUL,
            f"its products of inertia with y ({product:.3g} kg m² against {inertia[1, 1]:.3g} kg "
            "m²) turn it out of that plane as soon as it pitches: left and right are not mirror "
            "images in this posture",
        ),
    ]
    for share, most, words in found:
        if share > most:
            raise RobotError(
                f"{label}: it cannot be projected onto the x–z plane, because {words}."
            )
    return [
        f"the projection is rough, because {words}."
        for share, _, words in found
        if share > DOUBTFUL
    ]
