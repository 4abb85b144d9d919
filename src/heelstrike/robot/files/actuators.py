"""From the actuators of a file to torques at joints."""

from __future__ import annotations

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.posture import BALL
from heelstrike.robot.files.ros.drives import EFFORT, Drive, drives_of
from heelstrike.robot.files.snapping import IN_PLANE
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.warning import warn

DRIVES_JOINT = (0, 1)  # MuJoCo's mjTRN_JOINT and mjTRN_JOINTINPARENT, alike for hinge and slide
FIXED_GAIN = 0  # mjGAIN_FIXED: force = gain * control
AFFINE_GAIN = 1
NO_BIAS = 0
AFFINE_BIAS = 1
NO_ACTIVATION = 0
LINEAR_ACTIVATION = (0, 1, 2, 3)  # none, integrator, filter, exact filter


@dataclass(frozen=True)
class Actuators:
    """Which coordinates are driven, and how hard."""

    joint: Integers
    """(nu,) Coordinate that each actuator drives."""
    lower: Floats
    upper: Floats
    """lower, upper: (nu,) Limits of the torque or force at the joint; infinite where there are
    none."""
    names: tuple[str, ...]
    """Names of the actuators."""
    armature: Floats
    damping: Floats
    """armature, damping: (nv,) Rotor inertia and damping of the motors, seen at the joints."""


def read_actuators(file: MujocoFile) -> Actuators:
    """Read the torque limits at the joints; a controller of ours commands torques, not ``ctrl``.

    Position and velocity servos are taken as plain motors, with a warning: heelstrike's
    controllers command the torque, so the servo's own law would act twice.

    Raises
    ------
    RobotError
        If an actuator does not act on a joint, is a muscle or the like, or shares its joint.
    """
    model = file.model
    place = {one.joint: index for index, one in enumerate(file.coordinates) if one.joint >= 0}
    if file.is_urdf and model.nu == 0:
        return _from_urdf(file, place)
    driven: list[int] = []  # coordinates
    actuators: list[int] = []
    gears: list[float] = []
    limits: list[tuple[float, float]] = []
    names: list[str] = []
    for actuator in range(len(model.actuator_trntype)):
        joint = _driven_joint(file, actuator)
        name = file.name("actuator", actuator)
        if joint not in place:
            continue  # it is locked
        index = place[joint]
        gear = _gear(file, actuator, index)
        if gear is None:
            continue  # it only turns a ball joint out of the plane
        if index in driven:
            other = names[driven.index(index)]
            raise file.error(
                f"joint {file.name('joint', joint)!r} is driven by two actuators, {other!r} and "
                f"{name!r}. Keep one, with the torque limits of both together."
            )
        driven.append(index)
        actuators.append(actuator)
        gears.append(gear)
        limits.append(_torque_limits(file, actuator, joint, gear))
        names.append(file.given_name("actuator", actuator) or file.coordinates[index].name)
    _tell_of_laws(file, actuators)
    squared = np.square(gears)
    return _assembled(
        file,
        driven,
        np.array(limits, dtype=np.float64).reshape(-1, 2),
        names,
        armature=squared * _of_actuators(file, "actuator_armature", actuators),
        damping=squared * _of_actuators(file, "actuator_damping", actuators),
    )


def _from_urdf(file: MujocoFile, place: dict[int, int]) -> Actuators:
    """Drive what the transmissions of a URDF name, without any every joint with an effort limit."""
    model = file.model
    drives = drives_of(file.xml, file.source)
    index = {file.given_name("joint", joint): joint for joint in place}
    known = {joint.get("name", "") for joint in file.xml.iterfind("joint")}
    unknown = [name for name in drives if name not in known]
    if unknown:
        raise file.error(f"a transmission drives joint {unknown[0]!r}, but there is none.")
    limited = {name for name, joint in index.items() if model.jnt_actfrclimited[joint]}
    named = [name for name in index if name in drives] if drives else []
    joints = sorted(named or limited, key=lambda name: place[index[name]])
    limits, used = [], []
    for name in joints:
        drive = drives.get(name) or Drive()
        torque = np.array([drive.lower, drive.upper])
        if name in limited:
            torque = _intersect(torque, model.jnt_actfrcrange[index[name]])
        if not torque[0] < torque[1]:
            raise file.error(f"the limits of the torque of joint {name!r} contradict each other.")
        limits.append(torque)
        used.append(drive)
    _tell_of_drives(file, joints, used, limits, limited if named else set())
    return _assembled(
        file,
        [place[index[name]] for name in joints],
        np.array(limits, dtype=np.float64).reshape(-1, 2),
        joints,
        armature=np.array([drive.armature for drive in used]),
        damping=np.zeros(len(joints)),
    )


def _tell_of_drives(
    file: MujocoFile, joints: list[str], drives: list[Drive], limits: list[Floats], idle: set[str]
) -> None:
    """Say what the file means otherwise than it is taken, or leaves open."""
    told = {
        "are commanded by position or velocity in the file. They are loaded as motors that exert "
        "the torque a heelstrike controller asks for": [
            name
            for name, drive in zip(joints, drives, strict=True)
            if drive.commands and EFFORT not in drive.commands
        ],
        "are driven by several transmissions: one motor is made of them, with the inertia of all": [
            name for name, drive in zip(joints, drives, strict=True) if drive.motors > 1
        ],
        "have a motor and no effort limit: its torque is unlimited": [
            name
            for name, torque in zip(joints, limits, strict=True)
            if not np.isfinite(torque).any()
        ],
        "have an effort limit and no transmission, in a file that gives others one: no motor "
        "drives them": sorted(idle.difference(joints)),
    }
    for what, names in told.items():
        if names:
            warn(f"{file.source}: joints {', '.join(names)} {what}.")


def _assembled(
    file: MujocoFile,
    driven: list[int],
    limits: Floats,
    names: list[str],
    armature: Floats,
    damping: Floats,
) -> Actuators:
    lower, upper = np.ascontiguousarray(limits.T)
    at_joints = np.zeros((2, len(file.coordinates)))
    at_joints[:, driven] = armature, damping
    return Actuators(np.array(driven, dtype=np.int64), lower, upper, tuple(names), *at_joints)


def _of_actuators(file: MujocoFile, field: str, actuators: list[int]) -> Floats:
    """Inertia or damping of the actuators, before their gears."""
    values = file.field(field)  # only newer versions of MuJoCo have it
    return values[actuators] if values.size else np.zeros(len(actuators))


def _gear(file: MujocoFile, actuator: int, index: int) -> float | None:
    """Gear of an actuator on its coordinate, None if it has none in the plane."""
    model, joint = file.model, file.coordinates[index].joint
    if model.jnt_type[joint] != BALL:
        return float(model.actuator_gear[actuator, 0])
    turn = file.pose.xmat[model.jnt_bodyid[joint]].reshape(3, 3)
    gear = turn @ model.actuator_gear[actuator, :3]
    return float(gear[1]) if abs(gear[1]) > IN_PLANE * float(np.linalg.norm(gear)) else None


def _driven_joint(file: MujocoFile, actuator: int) -> int:
    model, name = file.model, file.name("actuator", actuator)
    if model.actuator_trntype[actuator] not in DRIVES_JOINT:
        raise file.error(
            f"actuator {name!r} does not act on a joint. heelstrike drives joints: replace it by "
            f'<motor name="{name}" joint="…"/>.'
        )
    if (
        model.actuator_gaintype[actuator] not in (FIXED_GAIN, AFFINE_GAIN)
        or model.actuator_biastype[actuator] not in (NO_BIAS, AFFINE_BIAS)
        or model.actuator_dyntype[actuator] not in LINEAR_ACTIVATION
    ):
        raise file.error(
            f"actuator {name!r} is a muscle or another actuator with a law of its own, which "
            f"heelstrike does not simulate. Replace it by a <motor> on the same joint."
        )
    return int(model.actuator_trnid[actuator, 0])


def _law(file: MujocoFile, actuator: int) -> str:
    """Return what an actuator is if it is no motor, in words; the empty string for a motor."""
    model = file.model
    gain = float(model.actuator_gainprm[actuator, 0])
    _, stiffness, damping = (float(number) for number in model.actuator_biasprm[actuator, :3])
    filtered = model.actuator_dyntype[actuator] != NO_ACTIVATION
    if model.actuator_gaintype[actuator] == FIXED_GAIN and stiffness == -gain != 0.0:
        law = f"position servo (kp {gain:g}, kv {0.0 - damping:g})"
    elif model.actuator_gaintype[actuator] == FIXED_GAIN and damping == -gain != 0.0:
        law = f"velocity servo (kv {gain:g})"
    elif (
        model.actuator_gaintype[actuator] != FIXED_GAIN
        or model.actuator_biastype[actuator] != NO_BIAS
    ):
        law = "actuator with a law of its own"
    else:
        return "motor behind a filter" if filtered else ""
    return law + (" behind a filter" if filtered else "")


def _tell_of_laws(file: MujocoFile, actuators: list[int]) -> None:
    """Say what drives the robot in MuJoCo and is taken as a motor here."""
    laws: dict[str, list[str]] = {}
    for actuator in actuators:
        if law := _law(file, actuator):
            laws.setdefault(law, []).append(repr(file.name("actuator", actuator)))
    if laws:
        told = "; ".join(f"{', '.join(names)}: {law}" for law, names in laws.items())
        warn(
            f"{file.source}: these actuators have a control law of their own. They are loaded as "
            "motors that exert the torque a heelstrike controller asks for; only their force "
            f"limits are kept. {told}."
        )


def _torque_limits(file: MujocoFile, actuator: int, joint: int, gear: float) -> tuple[float, float]:
    """Range of the torque at the joint that control, force and joint limits leave."""
    model, name = file.model, file.name("actuator", actuator)
    if gear == 0.0:
        raise file.error(f"actuator {name!r} has gear 0 and can exert no torque.")
    force = np.array([-np.inf, np.inf])
    plain = _law(file, actuator) == ""
    if plain and model.actuator_ctrllimited[actuator] and not file.disabled("clampctrl"):
        gain = float(model.actuator_gainprm[actuator, 0])
        force = np.sort(gain * model.actuator_ctrlrange[actuator])
    if model.actuator_forcelimited[actuator]:
        force = _intersect(force, model.actuator_forcerange[actuator])
    torque = gear * (force if gear > 0.0 else force[::-1])
    if model.jnt_actfrclimited[joint]:
        torque = _intersect(torque, model.jnt_actfrcrange[joint])
    if not torque[0] < torque[1]:
        raise file.error(
            f"actuator {name!r} has contradictory limits: at its joint they leave the torque range "
            f"{torque[0]:g} to {torque[1]:g}. Check its ctrlrange, forcerange and gear."
        )
    return float(torque[0]), float(torque[1])


def _intersect(a: Floats, b: Floats) -> Floats:
    return np.array([max(a[0], b[0]), min(a[1], b[1])])
