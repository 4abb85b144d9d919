"""From the bodies and joints of a file to the planar links of a `Model`, and what else joins them.

Closed loops and coupled joints are the equality constraints ``connect`` and ``joint`` of MJCF, and
URDF's ``mimic``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from heelstrike.field_texts import dataclass
from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.posture import followers
from heelstrike.robot.model import POWERS, Floats, Integers
from heelstrike.tolerances import ONE_POINT

MOST_JOINTS = 1000
LATCH, BRAKE = "latch", "brake"
"""What custom data of latches and brakes are called."""


@dataclass(frozen=True)
class Links:
    """The kinematic tree and inertia of a robot."""

    numbers: dict[str, Any]
    """Numbers of `Model`: the tree and the inertia of its links."""
    origin: Floats
    """(nl, 2) World position of the link frames in the reference configuration."""
    of_body: Integers
    """(nbody,) Link that each body of the file belongs to; -1 for what is fixed to the world."""
    names: tuple[str, ...]
    """Body that each link moves."""

    @property
    def axis(self) -> Floats:
        """Motion of every joint per unit of its coordinate."""
        axis: Floats = self.numbers["axis"]
        return axis


def read_links(file: MujocoFile) -> Links:
    """Turn the bodies of a robot seen in the plane into links of one degree of freedom each.

    A body with several joints becomes a chain of links and its mass goes to the last; a body
    without joints is welded to the link of its parent. Frames are parallel to the world in the
    reference configuration, so the orientations that the file gives its bodies never matter.

    Raises
    ------
    RobotError
        If there is no joint at all, or too many.
    """
    model, coordinates = file.model, file.coordinates
    if not coordinates:
        raise file.error(
            "the robot has no joints, so nothing can move. A body that floats needs three: "
            "slide along x, slide along z, hinge about y; did the root <body> lose its <joint>s?"
        )
    if len(coordinates) > MOST_JOINTS:
        raise file.error(
            f"the robot has {len(coordinates)} joints; heelstrike takes up to {MOST_JOINTS}, whose "
            "equations are dense."
        )
    of_body = np.full(model.nbody, -1, dtype=np.int64)
    parent = np.empty(len(coordinates), dtype=np.int64)
    moves: dict[int, list[int]] = {}
    for index, one in enumerate(coordinates):
        moves.setdefault(one.body, []).append(index)
    for body in range(1, model.nbody):
        link = of_body[model.body_parentid[body]]
        for index in moves.get(body, ()):
            parent[index] = link
            link = index
        of_body[body] = link

    origin = np.array([one.anchor[::2] for one in coordinates])
    offset = origin - np.where((parent >= 0)[:, None], origin[parent], 0.0)
    tree = {"parent": parent, "axis": _axes(file), "offset": offset}
    names = tuple(file.name("body", one.body) for one in coordinates)
    return Links(tree | _inertia(file, of_body, origin), origin, of_body, names)


def _axes(file: MujocoFile) -> Floats:
    """Motion per unit of each coordinate as (rotation about y, translation x, z)."""
    hinge = np.array([one.hinge for one in file.coordinates])[:, None]
    axes = np.array([one.axis for one in file.coordinates])
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
    about_y[about_y < MASSLESS] = 0.0

    def total(values: Floats) -> Floats:
        return np.bincount(link, values, minlength=len(origin)).astype(np.float64)

    mass = total(body_mass)
    moment = np.column_stack([total(body_mass * position[:, k]) for k in range(2)])
    center = np.divide(moment, mass[:, None], out=np.zeros_like(moment), where=mass[:, None] > 0)
    distance = ((position - center[link]) ** 2).sum(axis=1)
    inertia = total(about_y + body_mass * distance)
    return {"mass": mass, "center_of_mass": center, "inertia": inertia}


def read_loops(file: MujocoFile, links: Links) -> dict[str, Any]:
    """Return what holds beside the joints, as numbers of :class:`~heelstrike.robot.model.Model`."""
    loops: dict[tuple[Any, ...], tuple[Any, Any]] = {}
    for ends, places in _connections(file, links):
        rounded = np.round(np.ravel(places) / ONE_POINT).astype(np.int64)
        loops.setdefault((*ends, *rounded.tolist()), (ends, places))
    couplings = list(_couplings(file))
    latches = list(_latches(file, links))
    brakes = list(_brakes(file))
    return {
        "loop_link": [ends for ends, _ in loops.values()],
        "loop_position": [places for _, places in loops.values()],
        "coupling_joint": [joints for joints, _ in couplings],
        "coupling_polynomial": [factors for _, factors in couplings],
        "latch_joint": [joint for joint, _, _ in latches],
        "latch_side": [side for _, side, _ in latches],
        "latch_release": [link for _, _, link in latches],
        "brake_joint": [joint for joint, _ in brakes],
        "brake_limit": [limit for _, limit in brakes],
    }


def is_modelled(file: MujocoFile, one: int) -> bool:
    """Whether an equality constraint of the file is held here, or holds nothing that moves."""
    import mujoco

    model = file.model
    if int(model.eq_type[one]) == mujoco.mjtEq.mjEQ_CONNECT or not model.eq_active0[one]:
        return True
    if int(model.eq_type[one]) == mujoco.mjtEq.mjEQ_JOINT:
        moving = {each.joint for each in file.coordinates}
        joint, leader = int(model.eq_obj1id[one]), int(model.eq_obj2id[one])
        return joint not in moving or leader < 0 or leader in moving
    return False


def _connections(file: MujocoFile, links: Links) -> Iterator[tuple[tuple[int, int], Floats]]:
    """Two links of each loop, and where its hinge is on each of them."""
    import mujoco

    model, pose = file.model, file.pose
    if file.disabled("equality"):
        return
    for one in range(model.neq):
        if model.eq_type[one] != mujoco.mjtEq.mjEQ_CONNECT or not model.eq_active0[one]:
            continue
        things = int(model.eq_obj1id[one]), int(model.eq_obj2id[one])
        if model.eq_objtype[one] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = tuple(int(model.site_bodyid[site]) for site in things)
            within = model.site_pos[list(things)]
        else:
            bodies, within = things, model.eq_data[one, :6].reshape(2, 3)
        ends = int(links.of_body[bodies[0]]), int(links.of_body[bodies[1]])
        if ends[0] == ends[1]:
            continue  # what is one part is together anyway
        places = np.zeros((2, 2))
        for k in range(2):
            turned = pose.xmat[bodies[k]].reshape(3, 3) @ within[k]
            places[k] = (pose.xpos[bodies[k]] + turned)[::2]
            if ends[k] >= 0:
                places[k] -= links.origin[ends[k]]
        if ends[0] < 0:  # the first is a link, the second may be the world
            ends, places = ends[::-1], places[::-1]
        yield ends, places


def _couplings(file: MujocoFile) -> Iterator[tuple[tuple[int, int], Floats]]:
    """Coordinates that follow others (-1: none), with polynomials about their references."""
    model = file.model
    place = {one.joint: i for i, one in enumerate(file.coordinates) if one.joint >= 0}
    for joint, leader, factors in followers(model):
        if joint not in place or (leader >= 0 and leader not in place):
            continue
        own = file.coordinates[place[joint]]
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        moved = own.sense * own.reference - zero
        polynomial: Any = Polynomial(factors)
        if leader >= 0:
            its = file.coordinates[place[leader]]
            zero = float(model.qpos0[model.jnt_qposadr[leader]])
            there = its.sense * its.reference - zero
            polynomial = polynomial(Polynomial([there, its.sense]))
        else:
            polynomial = Polynomial(factors[:1])
        found = np.zeros(POWERS)
        found[: len(polynomial.coef)] = own.sense * polynomial.coef
        found[0] -= own.sense * moved
        yield (place[joint], place.get(leader, -1)), found


def _latches(file: MujocoFile, links: Links) -> Iterator[tuple[int, int, int]]:
    """Joint, end and releasing link of latches, custom data called ``latch:JOINT:LINK``.

    Raises
    ------
    RobotError
        If there is no such joint or link, or no limit at that end.
    """
    place = {one.name: i for i, one in enumerate(file.coordinates)}
    for told, (side, *_) in file.custom(LATCH):
        joint, _, release = told.partition(":")
        bodies = [b for b in range(file.model.nbody) if release and file.name("body", b) == release]
        if joint not in place or side not in (1.0, -1.0) or (release and not bodies):
            raise file.error(
                f"the latch {told!r} in <custom> is called latch:JOINT:LINK after a joint and the "
                "link whose touchdown lets it go, and is 1 or -1 for the end of the range: "
                f"there is no such joint or link, or its data are {side:g}."
            )
        yield place[joint], int(side), int(links.of_body[bodies[0]]) if bodies else -1


def _brakes(file: MujocoFile) -> Iterator[tuple[int, float]]:
    """Joints with a brake, and the most that it holds: custom data called ``brake:JOINT``.

    The first number is 1, the second is that limit; without a second there is none.

    Raises
    ------
    RobotError
        If there is no such joint, or the brake would hold nothing.
    """
    place = {one.name: i for i, one in enumerate(file.coordinates)}
    for joint, (_, *told) in file.custom(BRAKE):
        if joint not in place:
            raise file.error(
                f"the brake {joint!r} in <custom> is called brake:JOINT after a joint: there is no "
                "such joint."
            )
        limit = float(told[0]) if told else math.inf
        if not limit > 0.0:
            raise file.error(
                f"the brake {joint!r} in <custom> needs a positive limit: its data are 1 and, if "
                f"it slips, the torque at which it does, which is {limit:g}."
            )
        yield place[joint], limit
