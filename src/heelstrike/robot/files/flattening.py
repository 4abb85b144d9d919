"""Robots of three dimensions made planar: a root that floats in the plane, joints locked.

These are edits of a parsed file before MuJoCo compiles it, done only where the user asks for them
or where URDF has no other way to say what is meant.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import RobotError
from heelstrike.robot.warning import warn

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
IN_PLANE = 1e-6  # sine of an angle
LATERAL = 1e-2
"""Asymmetry (share of the robot's size or moment of inertia) up to which a robot may be projected:
cables and connectors of a symmetric design make a few parts in a thousand."""

ROOT = ("root_x", "root_z", "root_pitch")
_PLANAR = ("_TX", "_TY", "_RZ")  # what MuJoCo makes of URDF's planar joint


def float_in_plane(spec: Any, label: str) -> None:
    """Put the first body of a file on slide x, slide z and hinge y, whatever held it before.

    Parameters
    ----------
    spec : mujoco.MjSpec
        The parsed file.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If it has none or several bodies that are fixed or free.
    """
    able = [
        body
        for body in spec.worldbody.bodies
        if not body.joints or _is_free(body) or _is_planar(body)
    ]
    if len(able) != 1:
        raise RobotError(
            f"{label}: floating=True makes the one body that the file fixes to the world (or "
            f"leaves free) float in the plane; here are {len(able)} such bodies. Give the trunk "
            "its joints in the file: slide along x, slide along z, hinge about y."
        )
    _put_on_planar_root(spec, able[0])


def mend_planar_root(spec: Any) -> None:
    """Give the root that URDF's planar joint holds in x–z the coordinates x, z and pitch."""
    for body in spec.worldbody.bodies:
        if _is_planar(body):
            turn = _turn(spec, body)
            normal = turn @ np.asarray(body.joints[2].axis)
            if np.hypot(normal[0], normal[2]) < IN_PLANE * np.linalg.norm(normal):
                _put_on_planar_root(spec, body)


def project(spec: Any, label: str) -> None:
    """Lock the joints that leave the x–z plane, and let a free root float in the plane.

    Raises
    ------
    RobotError
        If no joint stays in the plane, or the robot is not symmetric about it.

    Warns
    -----
    RobotWarning
        With the joints that are locked.
    """
    import mujoco

    # What refers to joints or to the number of coordinates, and is no part of a robot.
    for thing in [*spec.sensors, *spec.keys]:
        spec.delete(thing)
    for body in spec.worldbody.bodies:
        if _is_free(body):
            _put_on_planar_root(spec, body)
    mend_planar_root(spec)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they come again when the result is compiled
        model = spec.compile()
    if model.njnt == 0:
        return  # no robot at all, which the reader says better
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    locked = [
        joint
        for joint in spec.joints
        if joint.type in (FREE, BALL) or _leaves_plane(int(joint.type), data.xaxis[joint.id])
    ]
    if locked and all(joint in locked or joint.name in ROOT for joint in spec.joints):
        raise RobotError(
            f"{label}: no joint of this robot moves in the x–z plane, so there is nothing to "
            "project. Turn it so that it walks along x, with its pitch joints about y."
        )
    _refuse_asymmetry(model, data, label)
    names = {joint.name for joint in locked}
    for actuator in list(spec.actuators):
        if actuator.target in names:
            spec.delete(actuator)
    told = [joint.name or f"a joint of {joint.parent.name}" for joint in locked]
    for joint in locked:
        spec.delete(joint)
    if told:
        warn(
            f"{label}: projected onto the x–z plane; locked where they stand: {', '.join(told)}. "
            "What the robot does out of this plane (roll, yaw, side steps) is left out."
        )


def _refuse_asymmetry(model: Any, data: Any, label: str) -> None:
    """Refuse a robot whose mass lies to one side: moving in the plane would turn it out of it."""
    moving = np.arange(model.nbody) > 0
    mass = model.body_mass[moving]
    place = data.xipos[moving]
    center = mass @ place / mass.sum()
    arm = place - center
    turn = data.ximat[moving].reshape(-1, 3, 3)
    inertia = np.einsum("bij,bj,bkj->ik", turn, model.body_inertia[moving], turn)
    inertia += np.einsum("b,bi,bi->", mass, arm, arm) * np.eye(3) - np.einsum(
        "b,bi,bj->ij", mass, arm, arm
    )
    size = float(np.sqrt(inertia[1, 1] / mass.sum()))
    root = data.xpos[1]
    aside = float(center[1] - root[1])
    if abs(aside) > LATERAL * size:
        raise RobotError(
            f"{label}: it cannot be projected onto the x–z plane, because its centre of mass is "
            f"{aside:.3g} m to the side of its trunk: left and right weigh differently."
        )
    product = float(np.abs(inertia[1, ::2]).max())
    if product > LATERAL * inertia[1, 1]:
        raise RobotError(
            f"{label}: it cannot be projected onto the x–z plane, because its products of inertia "
            f"with y ({product:.3g} kg m² against {inertia[1, 1]:.3g} kg m²) turn it out of that "
            "plane as soon as it pitches: left and right are not mirror images in this posture."
        )


def _leaves_plane(kind: int, axis: NDArray[np.float64]) -> bool:
    if kind == HINGE:
        return bool(np.hypot(axis[0], axis[2]) > IN_PLANE)
    return bool(abs(axis[1]) > IN_PLANE)


def _is_free(body: Any) -> bool:
    return len(body.joints) == 1 and body.joints[0].type == FREE


def _is_planar(body: Any) -> bool:
    endings = tuple(joint.name[-3:] for joint in body.joints)
    return endings == _PLANAR and len({joint.name[:-3] for joint in body.joints}) == 1


def _put_on_planar_root(spec: Any, body: Any) -> None:
    import mujoco

    turn, (x, _, z) = _turn(spec, body), body.pos
    for joint in list(body.joints):
        spec.delete(joint)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis, reference in (
        (ROOT[0], slide, (1.0, 0.0, 0.0), x),
        (ROOT[1], slide, (0.0, 0.0, 1.0), z),
        (ROOT[2], hinge, (0.0, 1.0, 0.0), 0.0),
    ):
        # MuJoCo wants axes in the frame of the body, and this joint without the file's defaults.
        added = body.add_joint(name=name, type=kind, axis=turn.T @ np.array(axis), ref=reference)
        added.damping = np.zeros_like(added.damping)
        added.stiffness = np.zeros_like(added.stiffness)
        added.armature = 0.0
        added.frictionloss = 0.0
        added.limited = mujoco.mjtLimited.mjLIMITED_FALSE


def _turn(spec: Any, body: Any) -> NDArray[np.float64]:
    """World axes of a body that hangs on the world, as columns."""
    import mujoco

    matrix = np.zeros(9)
    quaternion = np.array(body.quat, dtype=np.float64)
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:  # given by angles or axes
        compiler = spec.compiler
        quaternion[:] = mujoco.MjSpec.resolve_orientation(
            degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=body.alt
        )
    mujoco.mju_normalize4(quaternion)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
