"""Published robots loaded whole, in three dimensions, and judged by other engines.

    python -m corpus.space CLONES --scratch DIR [--only TEXT] [--page corpus/space.md]

in the folder `benchmarks`, like `python -m corpus`. Every file of `robots.csv` is loaded with
`dimension=3`; its mass, mass matrix, bias force and the place of its centre of mass at random
states are compared with MuJoCo's reading of an MJCF file, and with Pinocchio's of a URDF. Positions
and velocities are MuJoCo's; of Pinocchio's free joint the linear velocity is in body axes, and the
quaternion ends with its real part.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from corpus.clones import Published, extracted
from corpus.judging import HEAD, Outcome, counts, judge_all, refused, share, shortened, text_of
from corpus.peers import Refused, mechanics
from heelstrike import dynamics
from heelstrike.errors import HeelstrikeError
from heelstrike.robot import SpatialRobot, load_robot
from heelstrike.robot.spatial.robot import quaternion_places

Floats = NDArray[np.float64]
LOOKS = ("mesh", "texture", "material", "keyframe", "sensor", "skin")
TOLERANCE = 1e-11
STATES = 5


Answers = dict[str, Any]


def without_meshes(path: Path) -> str:
    """An MJCF file without what is looked at, or is not there, and words that MuJoCo has forgotten.

    Raises
    ------
    Refused
        If a body has its mass from a mesh.
    """
    root = ElementTree.parse(path).getroot()
    for body in root.iter("body"):
        if body.find("inertial") is None and any("mesh" in geom.attrib for geom in body):
            raise Refused(f"body {body.get('name')!r} may have its mass from a mesh")
    for element in root.iter():
        element.attrib.pop("material", None)
        element.attrib.pop("sensornoise", None)
        for child in list(element):
            hull = child.tag == "geom" and "mesh" in (child.get("type"), *child.attrib)
            if hull or child.tag in LOOKS:
                element.remove(child)
    return ElementTree.tostring(root, encoding="unicode")


class MuJoCo:
    """MJCF, by the engine that defines it."""

    name = "MuJoCo"

    def __init__(self, path: Path, robot: SpatialRobot) -> None:
        import mujoco

        try:
            self.model = mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, mujoco.FatalError) as error:
            if "<include" in path.read_text(encoding="utf-8", errors="replace"):
                raise Refused(str(error)) from error
            self.name = "MuJoCo, without meshes"
            try:
                self.model = mujoco.MjModel.from_xml_string(without_meshes(path))
            except (ValueError, mujoco.FatalError) as other:
                raise Refused(f"{error}; {other}") from other
        if (self.model.nq, self.model.nv) != (robot.nq, robot.nv):
            raise Refused(f"MuJoCo has {self.model.nq} positions and {self.model.nv} velocities")
        self.data = mujoco.MjData(self.model)

    def answers(self, q: Floats, v: Floats) -> Answers:
        """What the engine makes of a state."""
        import mujoco

        model, data = self.model, self.data
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        moving = model.body_weldid > 0
        mass = model.body_mass[moving]
        return {
            "mass": mass.sum(),
            "mass matrix": full,
            "bias force": data.qfrc_bias,
            "centre of mass": mass @ data.xipos[moving] / mass.sum(),
        }


class Pinocchio:
    """URDF, by urdfdom and Pinocchio."""

    name = "Pinocchio"

    def __init__(self, text: str, robot: SpatialRobot) -> None:
        import pinocchio as pin

        self.pin, self.robot = pin, robot
        root = [pin.JointModelFreeFlyer()] if robot.floating else []
        try:
            self.model = pin.buildModelFromXML(mechanics(text), *root)
        except (ValueError, RuntimeError) as error:
            raise Refused(str(error)) from error
        known = {*robot.joint_names, "root_joint"}
        fixed = [self.model.getJointId(each) for each in self.model.names[1:] if each not in known]
        if fixed:  # what moves no mass
            try:
                self.model = pin.buildReducedModel(self.model, fixed, pin.neutral(self.model))
            except ValueError as error:  # joints and links of one name
                raise Refused(str(error)) from error
        if self.model.nv != robot.nv:
            raise Refused(f"Pinocchio has {self.model.nv} velocities")
        self.data = self.model.createData()
        self.first = [self._place(name) for name in robot.joint_names]

    def _place(self, name: str) -> Any:
        """The engine's joint of that name; its root is ours, however both are called."""
        if self.robot.floating and name == self.robot.joint_names[0]:
            return self.model.joints[1]
        if not self.model.existJointName(name):
            raise Refused(f"Pinocchio has no joint {name!r}")
        return self.model.joints[self.model.getJointId(name)]

    def answers(self, q: Floats, v: Floats) -> Answers:
        """What the engine makes of a state, along our velocities."""
        pin, model, data, robot = self.pin, self.model, self.data, self.robot
        theirs_q, size = pin.neutral(model), robot.nv
        velocity = np.zeros((size, size))  # theirs of ours
        drift = np.zeros(size)  # their acceleration where ours is zero
        places = zip(
            robot.model.first_position, robot.model.first_velocity, self.first, strict=True
        )
        for at, to, joint in places:
            if joint.nv == 6:
                w, x, y, z = q[at + 3 : at + 7]
                theirs_q[joint.idx_q : joint.idx_q + 7] = [*q[at : at + 3], x, y, z, w]
                turn = pin.Quaternion(w, x, y, z).toRotationMatrix()
                velocity[joint.idx_v : joint.idx_v + 3, to : to + 3] = turn.T
                velocity[joint.idx_v + 3 : joint.idx_v + 6, to + 3 : to + 6] = np.eye(3)
                drift[joint.idx_v : joint.idx_v + 3] = -np.cross(
                    v[to + 3 : to + 6], turn.T @ v[to : to + 3]
                )
                continue
            angle = q[at]
            own = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            theirs_q[joint.idx_q : joint.idx_q + joint.nq] = own
            velocity[joint.idx_v, to] = 1.0
        theirs_v = velocity @ v
        full = pin.crba(model, data, theirs_q)
        full = np.triu(full) + np.triu(full, 1).T
        bias = pin.rnea(model, data, theirs_q, theirs_v, drift)
        center = pin.centerOfMass(model, data, theirs_q)
        return {
            "mass": sum(inertia.mass for inertia in list(model.inertias)[1:]),
            "mass matrix": velocity.T @ full @ velocity + np.diag(robot.model.armature),
            "bias force": velocity.T @ bias,
            "centre of mass": center,
        }


def peer_of(path: Path, text: str, robot: SpatialRobot) -> MuJoCo | Pinocchio:
    """Return the engine that reads a file."""
    if "<mujoco" in text and "<robot" not in text:
        return MuJoCo(path, robot)
    if "<sdf" in text:
        raise Refused("SDF is read by neither engine")
    return Pinocchio(text, robot)


def difference(robot: SpatialRobot, peer: MuJoCo | Pinocchio) -> float:
    """Largest difference of what is compared, relative to the largest entries."""
    random = np.random.default_rng(7)
    worst = 0.0
    for _ in range(STATES):
        q = robot.model.reference + 0.5 * random.normal(size=robot.nq)
        for first in quaternion_places(robot.model):
            q[first : first + 4] /= np.linalg.norm(q[first : first + 4])
        v = random.normal(size=robot.nv)
        theirs = peer.answers(q, v)
        ours = {
            "mass": robot.total_mass,
            "mass matrix": dynamics.mass_matrix(robot, q),
            "bias force": dynamics.bias_force(robot, q, v),
            "centre of mass": dynamics.center_of_mass(robot, q),
        }
        for name, mine in ours.items():
            worst = max(worst, share(mine, theirs[name]))
    return worst


def outcome(robot: Published, clones: Path, scratch: Path) -> Outcome:
    """Load a file and have it judged."""
    path = extracted(robot, clones, scratch / "files")
    options: dict[str, Any] = {name: how for name, how in robot.how().items() if name == "xacro"}
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            loaded = load_robot(path, dimension=3, **options)
        except HeelstrikeError as error:
            return refused(robot, error, path, scratch)
    seconds = time.process_time() - start
    words = (
        f"{loaded.nv} velocities, {loaded.nu} motors, {loaded.nc} contact points, "
        f"{len(loaded.feet)} feet, {loaded.total_mass:.5g} kg"
    )
    result = Outcome(robot, words, loaded=True, seconds=seconds)
    try:
        peer = peer_of(path, text_of(path, options), loaded)
        result.engine, result.difference = peer.name, difference(loaded, peer)
    except (Refused, ElementTree.ParseError) as reason:
        result.said = shortened(reason)
    return result


def page(outcomes: list[Outcome]) -> str:
    """Return a page with all outcomes."""
    loaded, judged, equal = counts(outcomes, TOLERANCE)
    lines = [
        "# Published robots, whole",
        "",
        "Written by `python -m corpus.space` in `benchmarks`. Difference: of mass, mass matrix,",
        "bias force and centre of mass at random states from another engine's reading of the same",
        "file, as a share of the largest entry.",
        "",
        f"{loaded} of {len(outcomes)} load; {equal} of {judged} judged are equal to {TOLERANCE:g}.",
        "",
        *HEAD,
    ]
    lines += [each.line(each.engine or each.said) for each in outcomes]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(judge_all(__doc__, outcome, page, TOLERANCE, kinds=("spatial", "planar")))
