"""The same files read by other engines: mass and forces along the coordinates of a planar robot.

Nothing here knows heelstrike's reader. A file is read in three dimensions by the engine whose
format it is; the rows of its velocities that the planar robot has are added up: joints by their
names, a floating trunk along the forward direction, upwards and about the normal of the plane. What
a projection locks rests at the position that is named.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ROOT = ("root_x", "root_z", "root_pitch")
FREE, BALL = 0, 1  # MuJoCo's mjtJoint
UP = np.array([0.0, 0.0, 1.0])


class Refused(Exception):  # noqa: N818 (what happened, not an error of ours)
    """The engine cannot read the file, or has not what the robot has."""


def peer_of(path: Path, text: str, forward: Floats, floating: bool) -> Peer:
    """Return the engine that reads a file: MuJoCo MJCF, Pinocchio URDF, Drake SDF and the rest.

    Parameters
    ----------
    path : Path
        The file, for what it refers to.
    text : str
        What is in it, macros expanded.
    forward : (3,) float
        Where the robot walks in the file.
    floating : bool
        Whether a trunk that nothing holds floats.
    """
    if "<mujoco" in text and "<robot" not in text:
        return MuJoCo(path, forward)
    if "<sdf" in text:
        return Drake(path, text, "sdf", forward, True)
    text = mechanics(text)
    try:
        return Pinocchio(text, forward, floating)
    except Refused:
        return Drake(path, text, "urdf", forward, floating)


def mechanics(text: str) -> str:
    """A URDF without shapes and drives, whose oddities keep engines from the rest."""
    plain = re.sub(r"\sxmlns=[\"'][^\"']*[\"']", "", text[text.index("<robot") :].rstrip("\0 \n"))
    root = ElementTree.fromstring(plain)
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for inertia in root.iter("inertia"):  # urdfdom drops a link of which one product is ""
        for name, value in inertia.attrib.items():
            inertia.set(name, value or "0")
    for joint in root.iter("joint"):
        if joint.get("type") in ("revolute", "prismatic"):  # urdfdom wants limits, which do nothing
            for limit in joint.findall("limit"):
                joint.remove(limit)
            free = {"lower": "-100", "upper": "100", "effort": "1", "velocity": "1"}
            ElementTree.SubElement(joint, "limit", free)
    for link in root.iter("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
    return ElementTree.tostring(root, encoding="unicode")


class Peer:
    """A robot in three dimensions.

    Attributes
    ----------
    name : str
        The engine.
    mass : float
        Mass of all that moves (kg).
    forward, normal : (3,) float
        Where the robot walks, and the axis of its pitch.
    """

    name = ""
    mass = 0.0

    def __init__(self, forward: Floats) -> None:
        self.forward = forward
        self.normal = np.cross(UP, forward)

    def along(self, q: Mapping[str, float], v: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Mass matrix without armature and bias force, along the coordinates of `q`."""
        raise NotImplementedError


class MuJoCo(Peer):
    """MJCF, by the engine that defines it."""

    name = "MuJoCo"

    def __init__(self, path: Path, forward: Floats) -> None:
        import mujoco

        super().__init__(forward)
        try:
            self.model = mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, mujoco.FatalError) as error:
            raise Refused(str(error)) from error
        self.data = mujoco.MjData(self.model)
        self.mass = float(self.model.body_mass[self.model.body_weldid > 0].sum())
        self.free = np.flatnonzero(self.model.jnt_type == FREE)
        mujoco.mj_kinematics(self.model, self.data)
        self.reference = self.data.xmat.reshape(-1, 3, 3).copy()

    def along(self, q: Mapping[str, float], v: Mapping[str, float]) -> tuple[Floats, Floats]:
        """See :class:`Peer`."""
        import mujoco

        model, data = self.model, self.data
        data.qpos[:] = model.qpos0
        select = np.zeros((model.nv, len(q)))
        for column, (name, value) in enumerate(q.items()):
            if name in ROOT and len(self.free):
                self._root(name, value, select[:, column])
                continue
            joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            joint = joint if joint >= 0 else self._nameless(name)
            if model.jnt_type[joint] == BALL:
                self._ball(joint, value, select[:, column])
            else:
                data.qpos[model.jnt_qposadr[joint]] = value
                select[model.jnt_dofadr[joint], column] = 1.0
        data.qvel[:] = select @ np.array(list(v.values()))
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        full -= np.diag(model.dof_armature)
        return select.T @ full @ select, select.T @ data.qfrc_bias

    def _root(self, name: str, value: float, column: Floats) -> None:
        import mujoco

        position = self.model.jnt_qposadr[self.free[0]]
        velocity = self.model.jnt_dofadr[self.free[0]]
        start = self.model.qpos0[position : position + 7]
        here = self.data.qpos[position : position + 7]
        if name == ROOT[2]:
            turn, result, axes = np.zeros(4), np.zeros(4), np.zeros(9)
            mujoco.mju_axisAngle2Quat(turn, self.normal, value)
            mujoco.mju_mulQuat(result, turn, start[3:])
            here[3:] = result
            mujoco.mju_quat2Mat(axes, start[3:])
            column[velocity + 3 : velocity + 6] = axes.reshape(3, 3).T @ self.normal
        else:
            direction = self.forward if name == ROOT[0] else UP
            here[:3] += direction * (value - direction @ start[:3])
            column[velocity : velocity + 3] = direction

    def _ball(self, joint: int, value: float, column: Floats) -> None:
        """Turn a ball joint about the normal, which is one axis in the frame of its body."""
        import mujoco

        turn, result = np.zeros(4), np.zeros(4)
        axis = self.reference[self.model.jnt_bodyid[joint]].T @ self.normal
        position, velocity = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
        mujoco.mju_axisAngle2Quat(turn, axis, value)
        mujoco.mju_mulQuat(result, self.model.qpos0[position : position + 4], turn)
        self.data.qpos[position : position + 4] = result
        column[velocity : velocity + 3] = axis

    def _nameless(self, name: str) -> int:
        """Joint without a name on the body of that name."""
        import mujoco

        stem, _, number = name.rpartition("_")
        for body_name, place in ((name, 0), (stem, int(number) if number.isdigit() else -1)):
            body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, body_name)
            if body >= 0 and 0 <= place < self.model.body_jntnum[body]:
                return int(self.model.body_jntadr[body]) + place
        raise Refused(f"there is no joint {name!r}")


class Pinocchio(Peer):
    """URDF, by urdfdom and Pinocchio."""

    name = "Pinocchio"

    def __init__(self, text: str, forward: Floats, floating: bool) -> None:
        import pinocchio as pin

        super().__init__(forward)
        self.pin = pin
        self.floating = floating
        try:
            root = (pin.JointModelFreeFlyer(),) if self.floating else ()
            self.model = pin.buildModelFromXML(text, *root)
        except (ValueError, RuntimeError) as error:
            raise Refused(str(error)) from error
        self.data = self.model.createData()
        self.model.armature[:] = 0.0
        self.model.rotorInertia[:] = 0.0
        self.mass = float(sum(inertia.mass for inertia in list(self.model.inertias)[1:]))

    def along(self, q: Mapping[str, float], v: Mapping[str, float]) -> tuple[Floats, Floats]:
        """See :class:`Peer`."""
        pin, model = self.pin, self.model
        place, select = pin.neutral(model), np.zeros((model.nv, len(q)))
        drift = np.zeros(model.nv)
        turn = pin.AngleAxis(q.get(ROOT[2], 0.0), self.normal).toRotationMatrix()
        for column, (name, value) in enumerate(q.items()):
            if name in ROOT and self.floating:
                direction = {ROOT[0]: self.forward, ROOT[1]: UP}.get(name)
                if direction is None:
                    place[3:7] = pin.Quaternion(turn).coeffs()
                    select[3:6, column] = self.normal
                else:
                    place[:3] += direction * value
                    select[:3, column] = turn.T @ direction
                continue
            if not model.existJointName(name):
                raise Refused(f"there is no joint {name!r}")
            joint = model.joints[model.getJointId(name)]
            if joint.nv != 1:
                raise Refused(f"joint {name!r} moves in more ways than one")
            if joint.nq == 2:
                place[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                place[joint.idx_q] = value
            select[joint.idx_v, column] = 1.0
        speed = select @ np.array(list(v.values()))
        if self.floating:  # its linear velocity is in axes that turn with the trunk
            drift[:3] = -np.cross(self.normal, speed[:3]) * v.get(ROOT[2], 0.0)
        full = np.array(pin.crba(model, self.data, place))
        full = np.triu(full) + np.triu(full, 1).T
        bias = pin.rnea(model, self.data, place, speed, drift)
        return select.T @ full @ select, select.T @ bias


class Drake(Peer):
    """SDF, and URDF that urdfdom refuses, by Drake."""

    name = "Drake"

    def __init__(self, path: Path, text: str, kind: str, forward: Floats, floating: bool) -> None:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        super().__init__(forward)
        self.plant = MultibodyPlant(time_step=0.0)
        parser = Parser(self.plant)
        for above in list(path.parents)[:6]:
            parser.package_map().Add(above.name, str(above)) if not parser.package_map().Contains(
                above.name
            ) else None
        try:
            (instance,) = parser.AddModelsFromString(text, kind)
            if not floating:
                self._weld(instance)
            self.plant.Finalize()
        except RuntimeError as error:
            raise Refused(str(error)[:300]) from error
        self.context = self.plant.CreateDefaultContext()
        moving = [
            body
            for body in map(self.plant.get_body, self._indices())
            if not self.plant.IsAnchored(body)
        ]
        self.mass = float(sum(body.default_mass() for body in moving))
        floating = [body for body in moving if body.is_floating_base_body()]
        self.root = floating[0] if len(floating) == 1 else None

    def _weld(self, instance: object) -> None:
        """Fix to the world what nothing holds."""
        held = {
            int(self.plant.get_joint(joint).child_body().index())
            for joint in self.plant.GetJointIndices()
        }
        for body in self.plant.GetBodyIndices(instance):
            if int(body) not in held:
                frame = self.plant.get_body(body).body_frame()
                self.plant.WeldFrames(self.plant.world_frame(), frame)

    def _indices(self) -> list[object]:
        from pydrake.multibody.tree import BodyIndex

        return [BodyIndex(i) for i in range(1, self.plant.num_bodies())]

    def along(self, q: Mapping[str, float], v: Mapping[str, float]) -> tuple[Floats, Floats]:
        """See :class:`Peer`."""
        from pydrake.common.eigen_geometry import AngleAxis
        from pydrake.math import RigidTransform, RotationMatrix

        plant, context = self.plant, self.context
        plant.SetPositions(context, plant.GetPositions(plant.CreateDefaultContext()))
        select = np.zeros((plant.num_velocities(), len(q)))
        if self.root is not None and ROOT[2] in q:
            start = self.root.EvalPoseInWorld(context)
            turn = RotationMatrix(AngleAxis(q[ROOT[2]], self.normal)) @ start.rotation()
            place = start.translation()
            for name, direction in ((ROOT[0], self.forward), (ROOT[1], UP)):
                place = place + direction * (q[name] - direction @ place)
            plant.SetFreeBodyPose(context, self.root, RigidTransform(turn, place))
        for column, (name, value) in enumerate(q.items()):
            if name in ROOT and self.root is not None:
                first = self.root.floating_velocities_start_in_v()
                motion = {ROOT[0]: (3, self.forward), ROOT[1]: (3, UP), ROOT[2]: (0, self.normal)}
                at, direction = motion[name]
                select[first + at : first + at + 3, column] = direction
                continue
            joint, part = self._joint(name)
            positions = plant.GetPositions(context)
            positions[joint.position_start() + part] = value
            plant.SetPositions(context, positions)
            select[joint.velocity_start() + part, column] = 1.0
        plant.SetVelocities(context, select @ np.array(list(v.values())))
        full = plant.CalcMassMatrixViaInverseDynamics(context)
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        for actuator in plant.GetJointActuatorIndices():
            driven = plant.get_joint_actuator(actuator)
            inertia = driven.default_rotor_inertia() * driven.default_gear_ratio() ** 2
            full[driven.joint().velocity_start(), driven.joint().velocity_start()] -= inertia
        return select.T @ full @ select, select.T @ bias

    def _joint(self, name: str) -> tuple[object, int]:
        for ending, part in (("", 0), ("_TX", 0), ("_TY", 1), ("_RZ", 2)):
            stem = name.removesuffix(ending) if ending else name
            if name.endswith(ending) and self.plant.HasJointNamed(stem):
                return self.plant.GetJointByName(stem), part
        raise Refused(f"there is no joint {name!r}")
