"""From the bodies and joints of a file to the links of a `SpatialModel`."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import BALL, FREE

MOST_VELOCITIES = 1000


@dataclass(frozen=True)
class SpatialLinks:
    """The kinematic tree and inertia of a robot in space."""

    numbers: dict[str, Any]
    """Numbers of `SpatialModel`: the tree and the inertia of its links."""
    origin: Floats
    """(nl, 3) World position of the link frames in the reference configuration."""
    axes: Floats
    """(nl, 3, 3) World axes of the link frames there, in columns."""
    of_body: Integers
    """(nbody,) Link that each body of the file belongs to; -1 for what is fixed to the world."""

    def within(self, file: MujocoFile, geom: int, places: Floats) -> Floats:
        """Return places (k, 3) of the frame of a geom in that of its link."""
        link = self.of_body[file.model.geom_bodyid[geom]]
        world = file.pose.geom_xpos[geom] + places @ file.pose.geom_xmat[geom].reshape(3, 3).T
        return np.asarray((world - self.origin[link]) @ self.axes[link])


def read_spatial_links(file: MujocoFile) -> SpatialLinks:
    """Turn the bodies of a file into links of one joint each, in the order of its joints.

    A body with several joints becomes a chain of links and its mass goes to the last; a body
    without joints is welded to the link of its parent.

    Raises
    ------
    RobotError
        If there is no joint at all, or too many.
    """
    model, pose = file.model, file.pose
    count = int(model.njnt)
    if not count:
        raise file.error(
            "the robot has no joints, so nothing can move. A body that moves freely has a "
            "<freejoint/>; did the root <body> lose its <joint>s?"
        )
    if model.nv > MOST_VELOCITIES:
        raise file.error(
            f"the robot has {model.nv} velocities; heelstrike takes up to {MOST_VELOCITIES}, whose "
            "equations are dense."
        )
    of_body = np.full(model.nbody, -1, dtype=np.int64)
    parent = np.full(count, -1, dtype=np.int64)
    for body in range(1, model.nbody):
        link = of_body[model.body_parentid[body]]
        first = model.body_jntadr[body]
        for joint in range(first, first + model.body_jntnum[body]):
            parent[joint] = link
            link = joint
        of_body[body] = link
    kind = np.asarray(model.jnt_type, dtype=np.int64)
    bodies = np.asarray(model.jnt_bodyid)
    origin = np.where((kind == FREE)[:, None], pose.xpos[bodies], pose.xanchor)
    axes = np.tile(np.eye(3), (count, 1, 1))
    tree: dict[str, Any] = {
        "parent": parent,
        "joint_kind": kind,
        "axis": np.zeros((count, 3)),
        "offset": np.zeros((count, 3)),
        "turn": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
    }
    for link, above in enumerate(parent.tolist()):
        base = np.eye(3) if above < 0 else axes[above]
        foot = np.zeros(3) if above < 0 else origin[above]
        axes[link] = base
        if kind[link] in (FREE, BALL):
            axes[link] = pose.xmat[bodies[link]].reshape(3, 3)
        else:
            along = base.T @ pose.xaxis[link]
            tree["axis"][link] = along / np.linalg.norm(along)
        if kind[link] == BALL:
            tree["turn"][link] = _quaternion(base.T @ axes[link])
        if kind[link] != FREE:
            tree["offset"][link] = base.T @ (origin[link] - foot)
    return SpatialLinks(tree | _inertia(file, of_body, origin, axes), origin, axes, of_body)


def _quaternion(matrix: Floats) -> Floats:
    import mujoco

    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(matrix).ravel())
    return found / np.linalg.norm(found)


def _inertia(
    file: MujocoFile, of_body: Integers, origin: Floats, axes: Floats
) -> dict[str, Floats]:
    """Mass, centre of mass and tensor of inertia of every link, its welded bodies combined."""
    model, pose = file.model, file.pose
    moving = np.flatnonzero(of_body >= 0)
    link = of_body[moving]
    frames = axes[link]
    heavy = np.where(model.body_mass[moving] < MASSLESS, 0.0, model.body_mass[moving])
    own = np.where(model.body_inertia[moving] < MASSLESS, 0.0, model.body_inertia[moving])
    turn = np.einsum("bji,bjk->bik", frames, pose.ximat[moving].reshape(-1, 3, 3))
    place = np.einsum("bji,bj->bi", frames, pose.xipos[moving] - origin[link])
    mass, moment, tensor = (np.zeros((len(origin), *rest)) for rest in ((), (3,), (3, 3)))
    np.add.at(mass, link, heavy)
    np.add.at(moment, link, heavy[:, None] * place)
    center = np.divide(moment, mass[:, None], out=np.zeros_like(moment), where=mass[:, None] > 0.0)
    arm = place - center[link]
    about = np.einsum("bi,bi->b", arm, arm)[:, None, None] * np.eye(3)
    about -= np.einsum("bi,bj->bij", arm, arm)
    turned = np.einsum("bij,bj,bkj->bik", turn, own, turn)
    np.add.at(tensor, link, turned + heavy[:, None, None] * about)
    entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    inertia = np.stack([tensor[:, i, j] for i, j in entries], axis=1)
    return {"mass": mass, "center_of_mass": center, "inertia": inertia}
