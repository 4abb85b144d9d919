"""What may be unknown of a robot: numbers in which the equations of motion are linear."""

from __future__ import annotations

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import root_size
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot

OF_A_LINK = ("mass", "first moment x", "first moment z", "moment of inertia")
"""Of a link about the origin of its frame, in its axes: m, m c, and J = I + m |c|²."""
OF_A_JOINT = ("rotor inertia", "damping", "dry friction")
RUBS = 0.1
"""Part of a robot's weight at the end of a link that its joint may lose to friction, at 1 rad/s."""
LAID = ("mass", "center_of_mass", "inertia", "armature", "damping", "dry_friction")
"""Numbers of a model that tell what is unknown."""
UNITS = {
    "mass": ("kg", "kg"), "first moment x": ("kg m", "kg m"), "first moment z": ("kg m", "kg m"),
    "moment of inertia": ("kg m²", "kg m²"), "rotor inertia": ("kg m²", "kg"),
    "damping": ("N m s/rad", "N s/m"), "dry friction": ("N m", "N"),
}  # fmt: skip
"""Units: of a link or hinge, and of a slide."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Masses, first moments and moments of inertia of links, and friction of joints."""

    links: Integers
    """(k,) Links that have a mass."""
    joints: Integers
    """(m,) Joints that are measured: all but those of a trunk that floats."""
    kinds: tuple[str, ...]
    """What each of the 4 k + 3 m is."""
    parts: tuple[str, ...]
    """Link or joint that each is of."""
    units: tuple[str, ...]
    """Unit of each."""
    size: Floats
    """(4 k + 3 m,) How large one of its kind is in such a robot."""

    def __len__(self) -> int:
        return len(self.kinds)

    @property
    def names(self) -> tuple[str, ...]:
        """Names, as ``mass of left_thigh``."""
        return tuple(f"{kind} of {part}" for kind, part in zip(self.kinds, self.parts, strict=True))

    def of(self, model: Model) -> Floats:
        """Return what a model says that they are, (4 k + 3 m,).

        Parameters
        ----------
        model : Model
            A model of the same structure.
        """
        mass, center = model.mass[self.links], model.center_of_mass[self.links]
        about = model.inertia[self.links] + mass * np.sum(center**2, axis=1)
        links = np.column_stack([mass, mass[:, None] * center, about])
        of_joints = [model.armature, model.damping, model.dry_friction]
        joints = np.column_stack([each[self.joints] for each in of_joints])
        return np.concatenate([links.ravel(), joints.ravel()])

    def laid_on(self, robot: Robot, values: Floats) -> dict[str, Floats]:
        """Return the numbers of a model, `LAID`, that has other values, possible ones or not.

        Parameters
        ----------
        robot : Robot
            The robot.
        values : (4 k + 3 m,) array
            The values.
        """
        model = robot.model
        links, joints = np.split(values, [4 * len(self.links)])
        mass, hx, hz, about = links.reshape(-1, 4).T
        armature, damping, dry = joints.reshape(-1, len(OF_A_JOINT)).T
        found = {name: np.array(getattr(model, name)) for name in LAID}
        found["mass"][self.links] = mass
        found["center_of_mass"][self.links] = np.column_stack([hx, hz]) / mass[:, None]
        found["inertia"][self.links] = about - (hx**2 + hz**2) / mass
        found["armature"][self.joints] = armature
        found["damping"][self.joints] = damping
        found["dry_friction"][self.joints] = dry
        return found


def unknowns_of(robot: Robot) -> Unknowns:
    """List what may be unknown of a robot.

    Raises
    ------
    RobotError
        If no link has a mass.
    """
    model = robot.model
    links = np.flatnonzero(model.mass > 0.0)
    joints = np.arange(root_size(robot), robot.nv)
    if not len(links):
        raise RobotError(f"robot {robot.name!r}: no link has a mass, so there is none to identify")
    kinds = OF_A_LINK * len(links) + OF_A_JOINT * len(joints)
    parts = [robot.link_names[i] for i in links.tolist() for _ in OF_A_LINK]
    parts += [robot.joint_names[j] for j in joints.tolist() for _ in OF_A_JOINT]
    slides = [False] * (len(OF_A_LINK) * len(links))
    slides += [bool(model.axis[j, 0] == 0.0) for j in joints for _ in OF_A_JOINT]
    units = tuple(UNITS[kind][slide] for kind, slide in zip(kinds, slides, strict=True))
    size = np.concatenate([_sizes_of_link(model, i) for i in links.tolist()]
                          + [_sizes_of_joint(model, j) for j in joints.tolist()])  # fmt: skip
    return Unknowns(links, joints, tuple(kinds), tuple(parts), units, size)


def _sizes_of_link(model: Model, link: int) -> Floats:
    """How large mass, first moments and moment of inertia of a link may be."""
    mass, length = float(model.mass[link]), _length(model, link)
    return np.array([mass, mass * length, mass * length, mass * length**2])


def _sizes_of_joint(model: Model, joint: int) -> Floats:
    """How large rotor, damping and dry friction of a joint may be, by what it moves."""
    moved = [joint]
    for i in range(joint + 1, model.nl):
        if model.parent[i] in moved:
            moved.append(i)
    mass, length = float(model.mass[moved].sum()), max(_length(model, i) for i in moved)
    gravity = max(float(np.hypot(*model.gravity)), 1.0)
    if model.axis[joint, 0] == 0.0:
        return np.array([mass, RUBS * mass * gravity, RUBS * mass * gravity])
    torque = RUBS * float(model.mass.sum()) * gravity * length
    return np.array([mass * length**2, torque, torque])


def _length(model: Model, link: int) -> float:
    """Length of a link: how far its centre of mass, next joints and contact points are."""
    children = model.offset[model.parent == link]
    points = model.contact_position[model.contact_link == link]
    places = np.vstack([model.center_of_mass[link : link + 1], children, points])
    own = float(np.linalg.norm(places, axis=1).max())
    return own if own > 0.0 else float(np.linalg.norm(model.offset, axis=1).max())
