"""A compiled file seen in the plane: what moves in it, where everything is, what is locked.

Robots of three dimensions are made planar here: a root that floats in the plane in the place of a
free one, joints that leave the plane locked where the user wants them.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.options import FORWARD, Options
from heelstrike.robot.files.posture import (
    BALL,
    FREE,
    HINGE,
    LONGEST_TRAIN,
    SLIDE,
    followers,
    joint_name,
    positions,
    turn,
)
from heelstrike.robot.files.snapping import IN_PLANE, snap
from heelstrike.robot.files.spatial import asymmetry, nothing_to_keep, refuse_spatial_joints
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import LockedJoint
from heelstrike.wording import some_of

KINDS = ("free", "ball", "slide", "hinge")
MANY = 12  # joints that are named in a remark
SHOWN = 4  # how many culprits a message lists before it counts the rest
ROOT = ("root_x", "root_z", "root_pitch")
_PLANAR = ("_TX", "_TY", "_RZ")  # what MuJoCo makes of URDF's planar joint
X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Coordinate:
    """One degree of freedom of the planar robot."""

    name: str
    """Name of its joint."""
    body: int
    """Body of the file that it moves."""
    hinge: bool
    """Whether it turns about y, or slides in x–z."""
    axis: Floats
    anchor: Floats
    """axis, anchor: (3,) Axis and place in the world, in the reference configuration."""
    reference: float
    """Its value there."""
    joint: int = -1
    """Joint of the file, -1 if it is one of a root that the file has not."""
    sense: float = 1.0
    """-1 if it counts the other way round than that joint."""


@dataclass(frozen=True)
class Plane:
    """A file seen in the plane."""

    model: Any
    """``mujoco.MjModel``: the compiled file, turned forward, its axes snapped into the plane."""
    pose: Any
    """``mujoco.MjData``: world poses of joints, bodies and geoms in the reference configuration."""
    coordinates: tuple[Coordinate, ...]
    """What moves, in the order of the file."""
    locked: tuple[LockedJoint, ...]
    """What does not."""
    remarks: tuple[str, ...]
    """What the user should know."""


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
    pose.qpos[:] = positions(model, options, label)
    turn(model, pose, FORWARD[forward])
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
    coupled = list(followers(model))
    why = dict.fromkeys(spatial, "leaves the plane")
    for _ in coupled[:LONGEST_TRAIN]:
        for follower, leader, _ in coupled:
            if keeps[follower] and (leader < 0 or not keeps[leader]):
                keeps[follower] = False
                why[follower] = f"follows {joint_name(model, leader)}" if leader >= 0 else "is held"
    if not options.projected:
        refuse_spatial_joints(model, pose, spatial, bool(keeps.any()), label)
    found = tuple(_coordinates(model, pose, keeps, floating))
    coordinates = _in_order(found, model)
    if options.projected and (spatial or any(_is_free(model, body) for body in floating)):
        if spatial and not any(one.joint >= 0 for one in coordinates):
            raise RobotError(
                f"{label}: no joint of this robot moves in the x–z plane, so there is nothing to "
                f"project. {nothing_to_keep(model, pose)}"
            )
        # The joints that stay mark the middle: those of one side have twins on the other.
        joints = [one for one in coordinates if one.joint >= 0] or coordinates
        places = [float(one.anchor[1]) for one in joints]
        middle = 0.5 * (min(places) + max(places))
        lateral = asymmetry(model, pose, [one.body for one in coordinates], middle, label)
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
        turned = [f"{joint_name(model, joint)} by {by:.2g}" for joint, by in snapped.items()]
        names = some_of(turned, MANY)
        yield f"axes that miss the x–z plane by rounding are turned into it (rad): {names}."


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
    words = some_of([joint.name for joint in locked], SHOWN)
    number = f"{len(locked)} joints are" if len(locked) > 1 else "1 joint is"
    if options.projected:
        yield (
            f"projected onto the x–z plane; {number} locked: {words}. "
            "Robot.locked is their table. What the robot does out of this plane (roll, yaw, side "
            "steps) is left out."
        )
    else:
        yield f"{words} cannot move, for equality constraints hold them: they are locked."


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
                joint_name(model, joint),
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
        name=joint_name(model, joint),
        link=model.body(model.jnt_bodyid[joint]).name,
        kind=KINDS[kind],
        axis=(0.0, 0.0, 0.0) if kind in (FREE, BALL) else (x, y, z),
        position=0.0 if kind in (FREE, BALL) else float(pose.qpos[model.jnt_qposadr[joint]]),
        reason="keeps its pitch only" if kind == BALL else why,
    )


def _is_free(model: Any, body: int) -> bool:
    return bool(model.body_jntnum[body] == 1 and model.jnt_type[model.body_jntadr[body]] == FREE)


def _is_planar(model: Any, body: int) -> bool:
    """Whether a body depends on what MuJoCo makes of URDF's planar joint."""
    first = model.body_jntadr[body]
    names = [model.joint(first + k).name for k in range(model.body_jntnum[body])]
    return tuple(name[-3:] for name in names) == _PLANAR and len({n[:-3] for n in names}) == 1
