"""A compiled file seen in the plane: what moves in it, where everything is, what is locked.

Robots of three dimensions are made planar here: a root that floats in the plane in the place of a
free one, joints that leave the plane locked where the user wants them.
"""

from __future__ import annotations

import copy
import difflib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import RobotError
from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.options import FORWARD, Options
from heelstrike.robot.files.snapping import IN_PLANE, snap
from heelstrike.robot.robot import LockedJoint
from heelstrike.robot.symmetry import counterparts

Floats = NDArray[np.float64]

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
KINDS = ("free", "ball", "slide", "hinge")
MANY = 12  # joints that are named in a remark
SHOWN = 4  # how many culprits a message lists before it counts the rest
LATERAL = (1e-2, 5e-2)
"""Asymmetry (share of the robot's size or moment of inertia) from which a projection is doubtful,
and up to which it is made at all. Cables and connectors of a symmetric design make a few parts in a
thousand."""

ROOT = ("root_x", "root_z", "root_pitch")
_PLANAR = ("_TX", "_TY", "_RZ")  # what MuJoCo makes of URDF's planar joint
X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Coordinate:
    """One degree of freedom of the planar robot.

    Attributes
    ----------
    name : str
        Name of its joint.
    body : int
        Body of the file that it moves.
    hinge : bool
        Whether it turns about y, or slides in x–z.
    axis, anchor : (3,) float
        Axis and place in the world, in the reference configuration.
    reference : float
        Its value there.
    joint : int
        Joint of the file, -1 if it is one of a root that the file has not.
    sense : float
        -1 if it counts the other way round than that joint.
    """

    name: str
    body: int
    hinge: bool
    axis: Floats
    anchor: Floats
    reference: float
    joint: int = -1
    sense: float = 1.0


@dataclass(frozen=True)
class Plane:
    """A file seen in the plane.

    Attributes
    ----------
    model : mujoco.MjModel
        The compiled file, turned forward, its axes snapped into the plane.
    pose : mujoco.MjData
        World poses of joints, bodies and geoms in the reference configuration.
    coordinates : tuple of Coordinate
        What moves, in the order of the file.
    locked : tuple of LockedJoint
        What does not.
    remarks : tuple of str
        What the user should know.
    """

    model: Any
    pose: Any
    coordinates: tuple[Coordinate, ...]
    locked: tuple[LockedJoint, ...]
    remarks: tuple[str, ...]


def flatten(model: Any, options: Options, label: str, *, hanging: bool = False) -> Plane:
    """See a compiled file in the plane in which it moves.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file, which is left as it is.
    options : Options
        What the user asks for. If that is no direction, +x is tried, and if the robot does not move
        in that plane, +y.
    label : str
        What to call the file in messages.
    hanging : bool
        Whether a trunk that nothing holds is only fixed because the format has no other way.

    Raises
    ------
    RobotError
        If a joint leaves the plane and may not be locked, no joint stays in it, the robot is not
        symmetric about it, or `options` name what the file has not.
    """
    if options.forward is not None:
        return _seen(model, options.forward, options, label, hanging)
    try:
        return _seen(model, "x", options, label, hanging)
    except RobotError:
        try:
            plane = _seen(model, "y", options, label, hanging)
        except RobotError:
            plane = None
        if plane is None or not _keeps_the_pitch(plane):
            raise
    told = (
        "this robot moves in its y–z plane only. It is turned so that its y is forward, as "
        'forward="y" does.'
    )
    return replace(plane, remarks=(told, *plane.remarks))


def _keeps_the_pitch(plane: Plane) -> bool:
    """Whether a turned robot keeps at least as many joints as it has roll joints to lose."""
    kept = sum(one.joint >= 0 for one in plane.coordinates)
    return kept > 0 and kept >= sum(abs(joint.axis[0]) > 0.9 for joint in plane.locked)


def _seen(model: Any, forward: str, options: Options, label: str, hanging: bool) -> Plane:
    import mujoco

    model = copy.copy(model)
    pose = mujoco.MjData(model)
    pose.qpos[:] = _positions(model, options, label)
    _turn(model, pose, FORWARD[forward])
    mujoco.mj_kinematics(model, pose)
    snapped = snap(model, pose)
    mujoco.mj_kinematics(model, pose)
    floating = _floating_bodies(model, pose, options, label, hanging)
    keeps = _keeps(model, pose, floating)
    spatial = [
        joint
        for joint in range(model.njnt)
        if not keeps[joint] and model.jnt_bodyid[joint] not in floating
    ]
    followers = list(_followers(model))
    why = dict.fromkeys(spatial, "leaves the plane")
    for _ in followers:
        for follower, leader, _ in followers:
            if keeps[follower] and (leader < 0 or not keeps[leader]):
                keeps[follower] = False
                why[follower] = f"follows {_name(model, leader)}" if leader >= 0 else "is held"
    if not options.projected:
        _refuse_spatial_joints(model, pose, spatial, label)
    found = tuple(_coordinates(model, pose, keeps, floating))
    coordinates = _in_order(found, model)
    if options.projected and (spatial or any(_is_free(model, body) for body in floating)):
        if spatial and not any(one.joint >= 0 for one in coordinates):
            raise RobotError(
                f"{label}: no joint of this robot moves in the x–z plane, so there is nothing to "
                "project. Turn it so that it walks along x, with its pitch joints about y."
            )
        lateral = _asymmetry(model, pose, coordinates, label)
    else:
        lateral = []
    locked = tuple(_locked(model, pose, joint, why[joint]) for joint in sorted(why))
    remarks = [*_of_snapped(model, snapped), *_of_locked(locked, options), *lateral]
    remarks += _of_root(model, floating)
    if coordinates is not found:
        remarks.append(
            "the trunk floats by joints in another order or sense than slide along x, slide along "
            f"z, hinge about y; here they are {', '.join(one.name for one in coordinates[:3])}, "
            "positive forward, upward and leaning forward."
        )
    return Plane(model, pose, coordinates, locked, tuple(remarks))


def _of_snapped(model: Any, snapped: dict[int, float]) -> Iterator[str]:
    if snapped:
        shown = list(snapped)[:MANY]
        names = ", ".join(f"{_name(model, joint)} by {snapped[joint]:.2g}" for joint in shown)
        more = f" and {len(snapped) - MANY} more" if len(snapped) > MANY else ""
        yield f"axes that miss the x–z plane by rounding are turned into it (rad): {names}{more}."


def _of_root(model: Any, floating: list[int]) -> Iterator[str]:
    """What joints had that give way to a floating root."""
    for body in floating:
        first, number = model.body_jntadr[body], model.body_jntnum[body]
        held = [
            joint
            for joint in range(first, first + number)
            if model.jnt_limited[joint]
            or model.dof_damping[model.jnt_dofadr[joint]]
            or model.dof_frictionloss[model.jnt_dofadr[joint]]
        ]
        if held:
            yield (
                f"{model.body(body).name or 'the trunk'} floats; the limits, damping and friction "
                "that the file gives its root joint are left out."
            )


def _of_locked(locked: tuple[LockedJoint, ...], options: Options) -> Iterator[str]:
    if not locked:
        return
    words = ", ".join(joint.name for joint in locked[:SHOWN])
    more = f" and {len(locked) - SHOWN} more" if len(locked) > SHOWN else ""
    if options.projected:
        yield (
            f"projected onto the x–z plane; {len(locked)} joints are locked: {words}{more}. "
            "Robot.locked is their table. What the robot does out of this plane (roll, yaw, side "
            "steps) is left out."
        )
    else:
        yield f"{words}{more} cannot move, for equality constraints hold them: they are locked."


# Where the joints are


def _positions(model: Any, options: Options, label: str) -> Floats:
    """Positions of all joints: those of the file, the pose asked for, and what follows from it."""
    q = np.array(model.qpos0, dtype=np.float64)
    names = {_name(model, joint): joint for joint in range(model.njnt)}
    pose = options.pose or {}
    for name, value in pose.items():
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            guess = f" Did you mean {near[0]!r}?" if near else ""
            raise RobotError(f"{label}: pose names {name!r}, and there is no such joint.{guess}")
        joint = names[name]
        if model.jnt_type[joint] not in (SLIDE, HINGE):
            raise RobotError(f"{label}: pose names {name!r}, a joint that no one number moves.")
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
        if not low - IN_PLANE <= value <= high + IN_PLANE:
            raise RobotError(
                f"{label}: pose puts joint {name!r} at {value:g}, outside its range {low:.4g} … "
                f"{high:.4g} (rad, m)."
            )
        q[model.jnt_qposadr[joint]] = value
    followers = list(_followers(model))
    for _ in followers:  # one may follow another
        for joint, leader, factors in followers:
            if _name(model, joint) not in pose:
                place = model.jnt_qposadr[joint]
                there = 0.0
                if leader >= 0:
                    address = model.jnt_qposadr[leader]
                    there = float(q[address] - model.qpos0[address])
                q[place] = model.qpos0[place] + sum(c * there**k for k, c in enumerate(factors))
    return q


def _followers(model: Any) -> Iterator[tuple[int, int, Floats]]:
    """Joints that the file couples to others (-1: to nothing), with polynomials of their motion."""
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY):
        return
    for one in range(model.neq):
        joint = int(model.eq_obj1id[one])
        if (
            model.eq_type[one] == mujoco.mjtEq.mjEQ_JOINT
            and model.eq_active0[one]
            and model.jnt_type[joint] in (SLIDE, HINGE)
        ):
            yield joint, int(model.eq_obj2id[one]), np.array(model.eq_data[one, :5])


def _turn(model: Any, pose: Any, quarters: int) -> None:
    """Turn everything that hangs on the world by quarters of a turn, so that it looks along x."""
    import mujoco

    if quarters == 0:
        return
    angle = -0.5 * np.pi * quarters
    c, s = round(np.cos(angle)), round(np.sin(angle))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    quaternion = np.array([np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)])

    def turned(before: Floats) -> Floats:
        after = np.zeros(4)
        mujoco.mju_mulQuat(after, quaternion, np.asarray(before, dtype=np.float64))
        return after

    for body in np.flatnonzero(model.body_parentid == 0)[1:]:
        model.body_pos[body] = turn @ model.body_pos[body]
        model.body_quat[body] = turned(model.body_quat[body])
        joint = model.body_jntadr[body]
        if joint >= 0 and model.jnt_type[joint] == FREE:
            place = model.jnt_qposadr[joint]
            pose.qpos[place : place + 3] = turn @ pose.qpos[place : place + 3]
            pose.qpos[place + 3 : place + 7] = turned(pose.qpos[place + 3 : place + 7])
    model.opt.gravity[:] = turn @ model.opt.gravity


# What moves in the plane


def _floating_bodies(
    model: Any, pose: Any, options: Options, label: str, hanging: bool
) -> list[int]:
    """Bodies whose own joints, if any, give way to slide x, slide z and hinge y."""
    top = [int(body) for body in np.flatnonzero(model.body_parentid == 0) if body > 0]
    free = [body for body in top if _is_free(model, body)]
    planar = [body for body in top if _is_planar(model, body)]
    fixed = [body for body in top if model.body_jntnum[body] == 0]
    if options.floating:
        able = [*free, *planar, *fixed]
        if len(able) > 1:  # scenery has no joints
            moving = set(model.body_rootid[model.jnt_bodyid].tolist())
            able = [body for body in able if body in moving] or able
        if len(able) != 1:
            raise RobotError(
                f"{label}: floating=True makes the one body that the file fixes to the world (or "
                f"leaves free) float in the plane; here are {len(able)} such bodies. Give the "
                "trunk its joints in the file: slide along x, slide along z, hinge about y."
            )
        return able
    upright = []
    for body in planar:
        normal = pose.xaxis[model.body_jntadr[body] + 2]
        if np.hypot(normal[0], normal[2]) <= IN_PLANE:
            upright.append(body)
    # Where no joint moves anything, or the robot is one of space, the trunk is meant to float.
    if hanging and len(fixed) == len(top) == 1 and (options.projected or model.njnt == 0):
        return fixed
    return [*free, *upright] if options.projected else upright


def _keeps(model: Any, pose: Any, floating: list[int]) -> NDArray[np.bool_]:
    """Which joints of the file move in the plane, as they are."""
    axis, kind = pose.xaxis, model.jnt_type
    keeps = ((kind == HINGE) & (np.hypot(axis[:, 0], axis[:, 2]) <= IN_PLANE)) | (
        (kind == SLIDE) & (np.abs(axis[:, 1]) <= IN_PLANE)
    )
    keeps[np.isin(model.jnt_bodyid, floating)] = False
    return np.asarray(keeps, dtype=np.bool_)


def _coordinates(
    model: Any, pose: Any, keeps: NDArray[np.bool_], floating: list[int]
) -> Iterator[Coordinate]:
    for body in range(1, model.nbody):
        if body in floating:
            lead = "" if body == floating[0] else f"{model.body(body).name}_"
            place = np.array(pose.xpos[body])
            values = (place[0], place[2], 0.0)
            for name, axis, value in zip(ROOT, (X, Z, Y), values, strict=True):
                yield Coordinate(lead + name, body, name == ROOT[2], axis, place, float(value))
            continue
        first = model.body_jntadr[body]
        for joint in range(first, first + model.body_jntnum[body]):
            kind = model.jnt_type[joint]
            if not keeps[joint] and kind != BALL:
                continue
            yield Coordinate(
                _name(model, joint),
                body,
                kind != SLIDE,
                Y if kind == BALL else np.array(pose.xaxis[joint]),
                np.array(pose.xanchor[joint]),
                0.0 if kind == BALL else float(pose.qpos[model.jnt_qposadr[joint]]),
                int(joint),
            )


def _in_order(coordinates: tuple[Coordinate, ...], model: Any) -> tuple[Coordinate, ...]:
    """Put a floating root into the order and senses slide x, slide z, hinge y.

    Its slides carry nothing, so that their order and senses change no more than their names.
    """
    root = list(coordinates[:3])
    if len(root) < 3 or [one.hinge for one in root] != [False, False, True]:
        return coordinates
    bodies = [one.body for one in root]
    alone = all(
        model.body_mass[body] < MASSLESS
        and model.body_geomnum[body] == 0
        and np.count_nonzero(model.body_parentid == body) == 1
        for body in set(bodies[:2]) - {bodies[2]}
    )
    chain = [0, *dict.fromkeys(bodies)]
    alone &= all(model.body_parentid[b] == a for a, b in pairwise(chain))
    driven = {int(joint) for joint in model.actuator_trnid[:, 0]} & {one.joint for one in root}
    slides = np.array([one.axis for one in root[:2]])
    which = np.abs(slides[:, [0, 2]]).argmax(axis=1)
    along = np.abs(slides[[0, 1], [[0, 2][k] for k in which]]) > 1.0 - 1e-9
    if not alone or driven or set(which) != {0, 1} or not np.all(along):
        return coordinates
    if which[0] == 0 and not any(
        one.axis @ axis < 0.0 for one, axis in zip(root, (X, Z, Y), strict=True)
    ):
        return coordinates
    if which[0] == 1:
        first, second = root[:2]
        root[:2] = replace(second, body=first.body), replace(first, body=second.body)
    for k, axis in enumerate((X, Z, Y)):
        if root[k].axis @ axis < 0.0:
            one = root[k]
            root[k] = replace(one, axis=-one.axis, reference=-one.reference, sense=-one.sense)
    return (*root, *coordinates[3:])


def _locked(model: Any, pose: Any, joint: int, why: str) -> LockedJoint:
    kind = int(model.jnt_type[joint])
    x, y, z = (float(value) for value in np.round(pose.xaxis[joint], 12) + 0.0)
    return LockedJoint(
        name=_name(model, joint),
        link=model.body(model.jnt_bodyid[joint]).name,
        kind=KINDS[kind],
        axis=(0.0, 0.0, 0.0) if kind in (FREE, BALL) else (x, y, z),
        position=0.0 if kind in (FREE, BALL) else float(pose.qpos[model.jnt_qposadr[joint]]),
        reason="keeps its pitch only" if kind == BALL else why,
    )


def _name(model: Any, joint: int) -> str:
    """Name of a joint; a nameless one is called after the body that it moves."""
    given: str = model.joint(joint).name
    if given:
        return given
    body = model.jnt_bodyid[joint]
    several = model.body_jntnum[body] > 1
    ending = f"_{joint - model.body_jntadr[body]}" if several else ""
    return (model.body(body).name or f"body {body}") + ending


# What cannot be flattened


def _refuse_spatial_joints(model: Any, pose: Any, spatial: list[int], label: str) -> None:
    """Raise an error that names the joints which leave the plane, if there are any."""
    axes = pose.xaxis
    said = []
    for joint in spatial:
        kind = model.jnt_type[joint]
        name = model.joint(joint).name or f"joint {joint}"
        body = model.body(model.jnt_bodyid[joint]).name or f"body {model.jnt_bodyid[joint]}"
        direction = "({:.3g}, {:.3g}, {:.3g})".format(*(axes[joint] + 0.0))
        if kind == FREE:
            raise RobotError(
                f"{label}: {name!r} of body {body!r} is a free joint, which moves in three "
                "dimensions. For a robot in the x–z plane give the body three joints instead: "
                "slide along x, slide along z, hinge about y, in this order; or load it with "
                "floating=True, which does so, or with projected=True, which also locks all joints "
                "that leave the plane."
            )
        if kind == BALL:
            said.append(f"{name!r} of body {body!r} is a ball joint")
        elif kind == HINGE:
            said.append(f"{name!r} of body {body!r} turns about {direction}")
        else:
            said.append(f"{name!r} of body {body!r} slides along {direction}")
    if not said:
        return
    shown = "; ".join(f"joint {one}" for one in said[:SHOWN])
    more = f"; and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
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
    raise RobotError(
        f"{label}: this robot leaves the x–z plane; heelstrike simulates planar robots, whose "
        "hinges turn about y and whose slides stay in x–z. In its reference configuration, "
        f"{shown}{more}. {mend}"
    )


def _asymmetry(model: Any, pose: Any, coordinates: tuple[Coordinate, ...], label: str) -> list[str]:
    """Refuse a robot whose mass lies to one side: moving in the plane would turn it out of it.

    Return what to say of a small asymmetry.
    """
    moving = np.isin(model.body_rootid, [model.body_rootid[one.body] for one in coordinates])
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
    size = float(np.sqrt(inertia[1, 1] / mass.sum()))
    # The joints that stay mark the middle: what is on one side has its counterpart on the other.
    joints = [one for one in coordinates if one.joint >= 0] or coordinates
    anchors = [one.anchor[1] for one in joints]
    aside = float(center[1] - 0.5 * (min(anchors) + max(anchors)))
    product = float(np.abs(inertia[1, ::2]).max())
    found = [
        (
            abs(aside) / size,
            f"its centre of mass is {aside:.3g} m to the side of its middle: left and right weigh "
            "differently",
        ),
        (
            product / float(inertia[1, 1]),
            f"its products of inertia with y ({product:.3g} kg m² against {inertia[1, 1]:.3g} kg "
            "m²) turn it out of that plane as soon as it pitches: left and right are not mirror "
            "images in this posture",
        ),
    ]
    for share, words in found:
        if share > LATERAL[1]:
            raise RobotError(
                f"{label}: it cannot be projected onto the x–z plane, because {words}."
            )
    return [
        f"the projection is rough, because {words}." for share, words in found if share > LATERAL[0]
    ]


def _is_free(model: Any, body: int) -> bool:
    return bool(model.body_jntnum[body] == 1 and model.jnt_type[model.body_jntadr[body]] == FREE)


def _is_planar(model: Any, body: int) -> bool:
    """Whether a body hangs on what MuJoCo makes of URDF's planar joint."""
    first = model.body_jntadr[body]
    names = [model.joint(first + k).name for k in range(model.body_jntnum[body])]
    return tuple(name[-3:] for name in names) == _PLANAR and len({n[:-3] for n in names}) == 1
