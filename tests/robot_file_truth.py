"""What a robot file says, read without heelstrike: the truth that a loaded robot is held against.

MJCF is read by MuJoCo itself, which defines it. URDF is read here, from its definition
(https://wiki.ros.org/urdf/XML), in three dimensions: MuJoCo's reading of URDF is what is in doubt.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from heelstrike import dynamics
from heelstrike.robot import Robot

NO_LIMIT = 1e10
NO_MASS = 1e-14
TOLERANCE = 1e-9

Truth = dict[str, np.ndarray]


def differences(robot: Robot, text: str) -> list[str]:
    """Names of the quantities in which a robot is not what its file says."""
    q = 0.3 * np.random.default_rng(5).normal(size=robot.nq)
    truth = (urdf_truth if "<robot" in text else mjcf_truth)(text, robot.joint_names, q)
    found = what_we_have(robot, q)
    return [
        f"{key}: {found[key]} is not {truth[key]}"
        for key in truth
        if found[key].shape != truth[key].shape or not _close(found[key], truth[key])
    ]


def _close(a: np.ndarray, b: np.ndarray) -> bool:
    finite = np.abs(b[np.isfinite(b)]).max(initial=0.0)
    with np.errstate(invalid="ignore"):
        return bool(np.all((a == b) | (np.abs(a - b) <= TOLERANCE * finite + 1e-12)))


def what_we_have(robot: Robot, q: np.ndarray) -> Truth:
    model = robot.model
    torque = np.zeros((robot.nv, 2))
    torque[model.actuator_joint] = np.column_stack((model.torque_lower, model.torque_upper))
    points = np.column_stack((dynamics.contact_positions(robot, q), model.contact_radius))
    return {
        "mass matrix": dynamics.mass_matrix(robot, q),
        "gravity": dynamics.gravity_force(robot, q),
        "damping": model.damping,
        "dry friction": model.dry_friction,
        "stiffness": model.stiffness,
        "range": np.column_stack((model.lower, model.upper)),
        "speed": model.speed_limit,
        "torque": torque,
        "contact": _sorted(points),
        "friction": np.sort(robot.contact_friction),
    }


def _sorted(points: np.ndarray) -> np.ndarray:
    """Contact points in an order of their own, coinciding ones once; radii of points are 0."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    points[:, 2] = np.where(points[:, 2] <= 1e-9, 0.0, points[:, 2])
    return np.unique(np.round(points, 7), axis=0)


def mjcf_truth(text: str, names: tuple[str, ...], q: np.ndarray) -> Truth:
    """What MuJoCo makes of an MJCF file with motors, whose feet are spheres and capsules."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    # Not mj_forward: it would complain of singular matrices into a file in the work directory.
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_makeM(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    gravity = np.zeros(model.nv)
    mujoco.mj_comVel(model, data)
    mujoco.mj_rne(model, data, 0, gravity)
    torque = np.zeros((model.nv, 2))
    for actuator in range(model.nu):
        limits = model.actuator_ctrlrange[actuator] * model.actuator_gear[actuator, 0]
        if not model.actuator_ctrllimited[actuator]:
            limits = np.array([-np.inf, np.inf])
        torque[model.actuator_trnid[actuator, 0]] = np.sort(limits)
    speed = np.full(model.nv, np.inf)
    for k in range(model.nnumeric):
        held, _, name = model.numeric(k).name.partition(":")
        if held != "speed_limit":  # outlines, which move nothing
            continue
        speed[model.joint(name).id] = model.numeric_data[model.numeric_adr[k]]
    limited = model.jnt_limited.astype(bool)[:, None]
    moving = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] > 0]
    floor = [g for g in range(model.ngeom) if g not in moving]
    touching = [
        g
        for g in moving
        if any(
            model.geom_contype[g] & model.geom_conaffinity[f]
            or model.geom_contype[f] & model.geom_conaffinity[g]
            for f in floor
        )
    ]
    points = []
    for g in touching:
        place, (radius, half, _) = data.geom_xpos[g], model.geom_size[g]
        along = data.geom_xmat[g].reshape(3, 3)[:, 2]
        ends = (-half, half) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CAPSULE else (0.0,)
        points += [(*(place + end * along)[::2], radius) for end in ends]
    result = {
        "mass matrix": mass,
        "gravity": gravity,
        "damping": model.dof_damping,
        "dry friction": model.dof_frictionloss,
        "stiffness": model.jnt_stiffness,
        "range": _limits(np.where(limited, model.jnt_range, [-np.inf, np.inf])),
        "speed": speed,
        "torque": _limits(torque),
        "contact": _sorted(np.array(points)),
    }
    if len(points) == len(touching):
        result["friction"] = np.sort(model.geom_friction[touching, 0])
    return result


def _limits(values: np.ndarray) -> np.ndarray:
    return np.where(np.abs(values) >= NO_LIMIT, np.copysign(np.inf, values), values)


def urdf_truth(text: str, names: tuple[str, ...], q: np.ndarray) -> Truth:
    """What a URDF says, with geometric Jacobians in space; collision shapes are spheres."""
    root = ElementTree.fromstring(text)
    number = len(names)
    angle = dict(zip(names, q, strict=True))
    mass_matrix, gravity_force = np.zeros((number, number)), np.zeros(number)
    damping, friction = np.zeros(number), np.zeros(number)
    span, torque = np.tile([-np.inf, np.inf], (number, 1)), np.zeros((number, 2))
    speed = np.full(number, np.inf)
    gravity = np.array([0.0, 0.0, -9.81])
    option = root.find("mujoco/option")
    if option is not None and "gravity" in option.attrib:
        gravity = _numbers(option, "gravity", "0 0 -9.81")
    links = {link.attrib["name"]: link for link in root.iterfind("link")}
    joints = list(root.iterfind("joint"))
    children = {joint.find("child").attrib["link"] for joint in joints}  # type: ignore[union-attr]
    points: list[tuple[float, ...]] = []
    # Link, its pose, and how each coordinate moves it: (index, turns, axis, place).
    pending = [(name, np.eye(4), ()) for name in links if name not in children]
    while pending:
        name, pose, movers = pending.pop()
        _weigh(links[name], pose, movers, gravity, mass_matrix, gravity_force)
        for shape in links[name].iterfind("collision"):
            sphere = shape.find("geometry/sphere")
            if movers and sphere is not None:
                place = (pose @ _origin(shape))[:3, 3]
                points.append((place[0], place[2], float(sphere.attrib["radius"])))
        for joint in joints:
            if joint.find("parent").attrib["link"] != name:  # type: ignore[union-attr]
                continue
            there = pose @ _origin(joint)
            moved = movers
            kind = joint.attrib["type"]
            if kind != "fixed":
                assert kind in ("revolute", "continuous", "prismatic"), kind
                index = names.index(joint.attrib["name"])
                axis = _numbers(joint.find("axis"), "xyz", "1 0 0")
                axis = axis / np.linalg.norm(axis)
                moved = (*movers, (index, kind != "prismatic", there[:3, :3] @ axis, there[:3, 3]))
                there = there @ _motion(kind, axis, angle[joint.attrib["name"]])
                limit, dyn = joint.find("limit"), joint.find("dynamics")
                if limit is not None:
                    effort = float(limit.get("effort", "0"))
                    torque[index] = -effort, effort
                    speed[index] = float(limit.get("velocity", "0")) or np.inf
                    if kind != "continuous":
                        span[index] = [float(limit.attrib[end]) for end in ("lower", "upper")]
                if dyn is not None:
                    damping[index] = float(dyn.get("damping", "0"))
                    friction[index] = float(dyn.get("friction", "0"))
            child = joint.find("child").attrib["link"]  # type: ignore[union-attr]
            pending.append((child, there, moved))
    if gears := list(root.iterfind("transmission")):
        driven = [gear.find("joint").attrib["name"] for gear in gears]  # type: ignore[union-attr]
        torque[[name not in driven for name in names]] = 0.0
        for name, gear in zip(driven, gears, strict=True):
            ratio = float(gear.findtext("actuator/mechanicalReduction", "1"))
            rotor = float(gear.findtext("actuator/motorInertia", "0"))
            mass_matrix[names.index(name), names.index(name)] += ratio**2 * rotor
    return {
        "mass matrix": mass_matrix,
        "gravity": gravity_force,
        "damping": damping,
        "dry friction": friction,
        "range": _limits(span),
        "speed": _limits(speed),
        "torque": _limits(torque),
        "contact": _sorted(np.array(points)),
    }


def _weigh(
    link: Element,
    pose: np.ndarray,
    movers: tuple,
    gravity: np.ndarray,
    mass_matrix: np.ndarray,
    gravity_force: np.ndarray,
) -> None:
    inertial = link.find("inertial")
    if inertial is None or not movers:
        return
    there = pose @ _origin(inertial)
    mass = float(inertial.find("mass").attrib["value"])  # type: ignore[union-attr]
    if mass < NO_MASS:
        return
    given = inertial.find("inertia")
    assert given is not None
    xx, yy, zz, xy, xz, yz = (
        float(given.get(key, "0")) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    tensor = there[:3, :3] @ tensor @ there[:3, :3].T
    linear, angular = np.zeros((3, len(gravity_force))), np.zeros((3, len(gravity_force)))
    for index, turns, axis, place in movers:
        linear[:, index] = np.cross(axis, there[:3, 3] - place) if turns else axis
        angular[:, index] = axis if turns else 0.0
    mass_matrix += mass * linear.T @ linear + angular.T @ tensor @ angular
    gravity_force -= mass * linear.T @ gravity


def _numbers(element: Element | None, name: str, default: str) -> np.ndarray:
    text = default if element is None else element.get(name, default)
    return np.array([float(word) for word in text.split()])


def _origin(element: Element) -> np.ndarray:
    origin = element.find("origin")
    roll, pitch, yaw = _numbers(origin, "rpy", "0 0 0")
    result = np.eye(4)
    result[:3, :3] = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    result[:3, 3] = _numbers(origin, "xyz", "0 0 0")
    return result


def _turn(axis: int, angle: float) -> np.ndarray:
    return _motion("revolute", np.eye(3)[axis], angle)[:3, :3]


def _motion(kind: str, axis: np.ndarray, coordinate: float) -> np.ndarray:
    result = np.eye(4)
    if kind == "prismatic":
        result[:3, 3] = axis * coordinate
        return result
    cross = np.cross(axis, np.eye(3)).T  # times v, it is axis x v
    result[:3, :3] += np.sin(coordinate) * cross + (1.0 - np.cos(coordinate)) * cross @ cross
    return result
