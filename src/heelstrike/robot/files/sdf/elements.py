"""What SDF elements hold: numbers, words and poses, read strictly, and the elements that are known.

After the definition at http://sdformat.org/spec. A number that is none, an element given twice, or
a misspelt one would otherwise be another robot in silence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.model import Floats
from heelstrike.wording import meant

# Elements that are read, and others of the format, which say nothing about mechanics.
KNOWN = {
    "model": "pose static link joint frame model include | plugin self_collide allow_auto_disable "
    "enable_wind gripper enable_wind",
    "link": "pose inertial collision gravity | visual sensor plugin kinematic must_be_base_link "
    "self_collide velocity_decay enable_wind light battery projector audio_source audio_sink "
    "particle_emitter",
    "inertial": "pose mass inertia | density fluid_added_mass auto_inertia_params",
    "inertia": "ixx iyy izz ixy ixz iyz",
    "collision": "pose geometry surface | laser_retro max_contacts density auto_inertia_params",
    "geometry": "box sphere cylinder capsule ellipsoid mesh plane | empty cone heightmap image "
    "polyline",
    "box": "size",
    "sphere": "radius",
    "cylinder": "radius length",
    "capsule": "radius length",
    "ellipsoid": "radii",
    "mesh": "uri scale | submesh convex_decomposition optimization",
    "joint": "parent child pose axis axis2 | physics sensor plugin gearbox_ratio "
    "gearbox_reference_body thread_pitch screw_thread_pitch gearbox_reference_body",
    "axis": "xyz limit dynamics use_parent_model_frame initial_position mimic",
    "axis2": "xyz limit dynamics use_parent_model_frame initial_position mimic",
    "limit": "lower upper effort velocity | stiffness dissipation",
    "dynamics": "damping friction spring_reference spring_stiffness",
    "frame": "pose",
    "surface": "friction contact | bounce soft_contact",
    "friction": "ode | torsional bullet",
    "contact": "collide_bitmask | collide_without_contact collide_without_contact_bitmask "
    "category_bitmask poissons_ratio elastic_modulus ode bullet",
    "ode": "mu | mu2 fdir1 slip1 slip2",
}

ONE = {"pose", "inertial", "mass", "inertia", "geometry", "parent", "child", "axis", "axis2"} | {
    *("xyz", "limit", "dynamics", "static", "size", "radius", "length", "radii", "uri", "scale"),
    *("lower", "upper", "effort", "velocity", "damping", "friction", "gravity"),
    *("spring_reference", "spring_stiffness", "use_parent_model_frame", "surface"),
    *("ixx", "iyy", "izz", "ixy", "ixz", "iyz"),
}
"""Elements of which a parent has one at most."""


def error(element: Element, label: str, what: str) -> RobotError:
    """Return an error that names the line of an element."""
    return RobotError(f"{label}: line {getattr(element, 'line', 0)}: {what}")


def check(element: Element, label: str) -> Iterator[str]:
    """Refuse what is given twice; yield what is unknown, which may be a misspelling.

    Raises
    ------
    RobotError
        With the line.
    """
    tag = element.tag
    read, _, other = KNOWN.get(tag, "").partition("|")
    known = {*read.split(), *other.split()}
    seen = set()
    for child in element:
        if child.tag in seen and child.tag in ONE:
            raise error(child, label, f"<{tag}> has two <{child.tag}>. Keep one.")
        seen.add(child.tag)
        if ":" not in child.tag and child.tag not in known:
            guess = meant(child.tag, {tag: f"<{tag}>" for tag in known}, " (did you mean {}?)")
            yield f"<{child.tag[:60]}> in <{tag}>, line {getattr(child, 'line', 0)}{guess}"
        elif child.tag in read.split():
            yield from check(child, label)


def word(parent: Element, tag: str, default: str = "") -> str:
    """Return the text of a child."""
    text = parent.findtext(tag)
    return default if text is None else text.strip()


def truth(parent: Element, tag: str, label: str, default: bool = False) -> bool:
    """Return whether a child says yes."""
    said = word(parent, tag).lower()
    if said in ("", "true", "1", "false", "0"):
        return said in ("true", "1") if said else default
    raise error(parent, label, f"<{tag}> is {said[:60]!r}, neither true nor false.")


def number(parent: Element, tag: str, default: float, label: str, *, least: float = -math.inf,
           endless: bool = False) -> float:  # fmt: skip
    """Return the number that a child holds, the format's default if there is none."""
    # Not find(): it would look up the prefix of drake:….
    child = next((each for each in parent if each.tag == tag), None)
    if child is None:
        return default
    value = float(numbers(child, 1, label, endless=endless)[0])
    if value < least:
        raise error(child, label, f"<{tag}> is {value:g}; it must not be less than {least:g}.")
    return value


def numbers(element: Element, count: int, label: str, *, endless: bool = False) -> Floats:
    """Return the numbers in an element.

    Raises
    ------
    RobotError
        If they are others than `count` finite numbers.
    """
    text = element.text or ""
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or "_" in text or not text.isascii():
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise error(element, label, f"<{element.tag}> is {text.strip()[:60]!r}, not {wanted}.")
    if np.isnan(values).any() or (np.isinf(values).any() and not endless):
        raise error(element, label, f"<{element.tag}> is {text.strip()[:60]!r}, which is not a "
                    "finite number.")  # fmt: skip
    return values


def transform(element: Element | None, label: str) -> Floats:
    """Return the (4, 4) matrix of a ``<pose>``, the identity if there is none."""
    result = np.eye(4)
    if element is None or not (element.text or "").strip():
        return result
    if element.get("rotation_format", "euler_rpy") == "quat_xyzw":
        x, y, z, *given = numbers(element, 7, label)
        length = float(np.linalg.norm(given))
        if length == 0.0:
            raise error(element, label, "the quaternion of <pose> is zero, which is no rotation.")
        result[:3, :3] = _of_quaternion(np.array(given) / length)
    elif element.get("rotation_format", "euler_rpy") == "euler_rpy":
        x, y, z, *angles = numbers(element, 6, label)
        if element.get("degrees", "false") in ("true", "1"):
            angles = np.radians(angles).tolist()
        result[:3, :3] = rotation(*angles)
    else:
        raise error(element, label, "the rotation_format of <pose> is none that SDF has.")
    result[:3, 3] = x, y, z
    return result


def inverse(place: Floats) -> Floats:
    """Return the pose that undoes another."""
    result = np.eye(4)
    result[:3, :3] = place[:3, :3].T
    result[:3, 3] = -place[:3, :3].T @ place[:3, 3]
    return result


def rotation(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the matrix of a rotation about the fixed axes x, y, z, in this order."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _of_quaternion(xyzw: Floats) -> Floats:
    x, y, z, w = xyzw
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
