"""From the bodies and joints of a file to the planar links of a `Model`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.urdf import MASSLESS
from heelstrike.robot.model import Floats, Integers

IN_PLANE = 1e-6
"""How far (as the sine of an angle) an axis may stand off the plane before it is refused."""

MOST_JOINTS = 1000

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
SHOWN = 4  # how many culprits a message lists before it counts the rest


@dataclass(frozen=True)
class Links:
    """The kinematic tree and inertia of a robot.

    Attributes
    ----------
    numbers : dict of str to array
        Numbers of `Model`: the tree and the inertia of its links.
    origin : (nl, 2) float
        World position of the link frames in the reference configuration.
    of_body : (nbody,) int
        Link that each body of the file belongs to; -1 for what is fixed to the world.
    names : tuple of str
        Body that each link moves.
    """

    numbers: dict[str, Any]
    origin: Floats
    of_body: Integers
    names: tuple[str, ...]

    @property
    def axis(self) -> Floats:
        """Motion of every joint per unit of its coordinate."""
        axis: Floats = self.numbers["axis"]
        return axis


def read_links(file: MujocoFile) -> Links:
    """Turn the bodies of a planar robot into links of one degree of freedom each.

    A body with several joints becomes a chain of links and its mass goes to the last; a body
    without joints is welded to the link of its parent. Frames are parallel to the world in the
    reference configuration, so the orientations that the file gives its bodies never matter.

    Raises
    ------
    RobotError
        If there is no joint at all, or one that leaves the x–z plane.
    """
    model, pose = file.model, file.pose
    if model.njnt == 0:
        raise file.error(
            "the robot has no joints, so nothing can move. A body that floats needs three: "
            "slide along x, slide along z, hinge about y; did the root <body> lose its <joint>s?"
        )
    if model.njnt > MOST_JOINTS:
        raise file.error(
            f"the robot has {model.njnt} joints; heelstrike takes up to {MOST_JOINTS}, whose "
            "equations are dense."
        )
    _refuse_spatial_joints(file)

    joint_body = np.asarray(model.jnt_bodyid)
    of_body = np.full(model.nbody, -1, dtype=np.int64)
    parent = np.empty(model.njnt, dtype=np.int64)
    for body in range(1, model.nbody):
        link = of_body[model.body_parentid[body]]
        for joint in np.flatnonzero(joint_body == body):
            parent[joint] = link
            link = joint
        of_body[body] = link

    origin = np.ascontiguousarray(pose.xanchor[:, ::2])
    offset = origin - np.where((parent >= 0)[:, None], origin[parent], 0.0)
    tree = {"parent": parent, "axis": _axes(file), "offset": offset}
    names = tuple(file.name("body", body) for body in joint_body)
    return Links(tree | _inertia(file, of_body, origin), origin, of_body, names)


def _refuse_spatial_joints(file: MujocoFile) -> None:
    """Raise an error that names the joints which leave the plane, if there are any."""
    model, axes = file.model, file.pose.xaxis
    spatial = []
    for joint, kind in enumerate(model.jnt_type):
        name, body = file.name("joint", joint), file.name("body", model.jnt_bodyid[joint])
        direction = "({:.3g}, {:.3g}, {:.3g})".format(*(axes[joint] + 0.0))
        if kind == FREE:
            raise file.error(
                f"{name!r} of body {body!r} is a free joint, which moves in three dimensions. For "
                "a robot in the x–z plane give the body three joints instead: slide along x, slide "
                "along z, hinge about y, in this order; or load it with floating=True, which does "
                "so, or with projected=True, which also locks all joints that leave the plane."
            )
        if kind == BALL:
            spatial.append(f"{name!r} of body {body!r} is a ball joint")
        elif kind == HINGE and np.hypot(axes[joint, 0], axes[joint, 2]) > IN_PLANE:
            spatial.append(f"{name!r} of body {body!r} turns about {direction}")
        elif kind == SLIDE and abs(axes[joint, 1]) > IN_PLANE:
            spatial.append(f"{name!r} of body {body!r} slides along {direction}")
    if not spatial:
        return
    shown = "; ".join(f"joint {one}" for one in spatial[:SHOWN])
    more = f"; and {len(spatial) - SHOWN} more" if len(spatial) > SHOWN else ""
    hinges = axes[model.jnt_type == HINGE]
    parallel = (
        len(hinges) > 0
        and BALL not in model.jnt_type
        and np.abs(np.cross(hinges, hinges[0])).max() < IN_PLANE
    )
    mend = (
        "All its hinges are parallel: turn the robot so that they point along y."
        if parallel
        else "Remove these joints (or weld them) to keep the motion in the plane, or load the "
        "robot with projected=True, which locks them."
    )
    raise file.error(
        "this robot leaves the x–z plane; heelstrike simulates planar robots, whose hinges turn "
        f"about y and whose slides stay in x–z. In its reference configuration, {shown}{more}. "
        f"{mend}"
    )


def _axes(file: MujocoFile) -> Floats:
    """Motion per unit of each coordinate as (rotation about y, translation x, z)."""
    hinge = (file.model.jnt_type == HINGE)[:, None]
    axes = file.pose.xaxis
    turn = np.column_stack([np.sign(axes[:, 1]), np.zeros((len(axes), 2))])
    direction = axes[:, ::2].copy()
    direction[np.abs(direction) < 1e-12] = 0.0  # round-off of the file's rotations
    length = np.where(hinge, 1.0, np.hypot(*direction.T)[:, None])
    slide = np.column_stack([np.zeros(len(axes)), direction / length])
    return np.where(hinge, turn, slide)


def _inertia(file: MujocoFile, of_body: Integers, origin: Floats) -> dict[str, Floats]:
    """Mass, centre of mass (link frame) and inertia of every link, its welded bodies combined."""
    model, pose = file.model, file.pose
    moving = of_body >= 0
    link = of_body[moving]
    body_mass = model.body_mass[moving].copy()
    position = pose.xipos[moving, ::2] - origin[link]
    # Only the moment about y of the rotated inertia tensor acts in the plane.
    about_y = ((pose.ximat[moving, 3:6] ** 2) * model.body_inertia[moving]).sum(axis=1)
    nothing = body_mass < MASSLESS
    body_mass[nothing] = 0.0
    about_y[nothing & (about_y < MASSLESS)] = 0.0

    def total(values: Floats) -> Floats:
        return np.bincount(link, values, minlength=len(origin)).astype(np.float64)

    mass = total(body_mass)
    moment = np.column_stack([total(body_mass * position[:, k]) for k in range(2)])
    center = np.divide(moment, mass[:, None], out=np.zeros_like(moment), where=mass[:, None] > 0)
    distance = ((position - center[link]) ** 2).sum(axis=1)
    inertia = total(about_y + body_mass * distance)
    return {"mass": mass, "center_of_mass": center, "inertia": inertia}
