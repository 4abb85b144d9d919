"""From arrays and names to a `Robot`: its feet, its mirror image, and what no robot may be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.contact_points import ContactPoint
from heelstrike.robot.model import NUMBERS, Floats, Model, Number
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.plausibility import unlikely_numbers
from heelstrike.robot.robot import LockedJoint, Robot
from heelstrike.robot.sides.averaging import averaged
from heelstrike.robot.sides.symmetry import find_mirror
from heelstrike.robot.warning import warn
from heelstrike.wording import some_of

if TYPE_CHECKING:
    from heelstrike.robot.spatial.model import SpatialModel

LARGEST_NUMBER = 1e10
"""Largest length, mass, inertia … of a robot in SI units; MuJoCo's own bound on a state."""

UNLIKELY = "numbers that are unlikely"
DIFFERENT = "left and right differ"
SINGULAR_MASS = 1e-12
"""Smallest eigenvalue of a mass matrix, of diagonal 1, up to which it is singular: rounding."""
SHARE = 0.1  # of a motion without mass, from which a joint is named
SHOWN = 6  # how many findings a message lists before it counts the rest


def assembled(
    name: str,
    model: Model,
    *,
    joint_names: tuple[str, ...],
    link_names: tuple[str, ...],
    actuator_names: tuple[str, ...],
    points: Sequence[ContactPoint],
    source: str,
    locked: tuple[LockedJoint, ...] = (),
    average: bool = False,
) -> Robot:
    """Make a robot of its numbers and names.

    Parameters
    ----------
    name : str
        Name of the robot.
    model : Model
        Its numbers.
    joint_names, link_names, actuator_names : tuple of str
        Its names.
    points : sequence of ContactPoint
        The contact points of the model, in its order.
    source : str
        What to call the robot in messages.
    locked : tuple of LockedJoint
        Joints of its file that do not move.
    average : bool
        Make left and right equal.

    Raises
    ------
    RobotError
        If a number is NaN or absurdly large, joints move no mass, or a motor never turns.

    Warns
    -----
    RobotWarning
        If left and right differ, the base floats by joints in an unusual order, or numbers look as
        if they were in another unit.
    """
    refuse_impossible_numbers(model, NUMBERS, source)
    if average:
        model = averaged(model, joint_names, link_names, source)
    origin = link_origins(model)
    _refuse_joints_without_inertia(model, joint_names, source)
    _refuse_motors_without_speed(model, joint_names, source)
    unlikely = [one.message for one in unlikely_numbers(model, origin, joint_names, link_names)]
    if unlikely:
        more = f" And {len(unlikely) - SHOWN} more." if len(unlikely) > SHOWN else ""
        warn(f"{source}: {UNLIKELY}: {' '.join(unlikely[:SHOWN])}{more}")
    feet = find_feet(model, link_names, origin)
    friction = tuple(point.friction for point in points)
    mirror, differences = find_mirror(model, joint_names, link_names, feet)
    if differences:
        warn(
            f"{source}: {DIFFERENT}, so the robot has no mirror image: "
            f"{some_of(differences, SHOWN, '; ')}. Gaits whose steps mirror each other need two "
            'equal legs, as load_robot makes them with mirror="average".'
        )
    return Robot(
        name=name,
        model=model,
        joint_names=joint_names,
        link_names=link_names,
        actuator_names=actuator_names,
        contact_names=name_contacts(model, link_names, feet),
        feet=feet,
        mirror=mirror,
        floating=_is_floating(model, source),
        contact_friction=friction,
        source=source,
        locked=locked,
    )


def find_feet(model: Model, names: tuple[str, ...], origin: Floats) -> tuple[Foot, ...]:
    """Find the links that end a leg: leaves of the tree with contact points, low on the robot.

    Low means that, in the reference configuration, the lowest contact point of the link is below
    the middle between the lowest one of the robot and the robot's centre of mass. So hands and the
    ends of a tail are not feet; the shanks of a robot with point feet are.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    names : tuple of str
        Name of every link.
    origin : (nl, 2) float
        World position of the link frames in the reference configuration.
    """
    if not model.nc:
        return ()
    center = model.mass @ (origin + model.center_of_mass) / model.mass.sum()
    bottom = (origin[model.contact_link] + model.contact_position)[:, 1] - model.contact_radius
    return low_leaves(model, names, bottom, float(center[1]))


def low_leaves(
    model: Model | SpatialModel, names: tuple[str, ...], bottom: Floats, height: float
) -> tuple[Foot, ...]:
    """Return the leaves that are as low as feet; see :func:`find_feet`.

    Parameters
    ----------
    model : Model or SpatialModel
        The robot's arrays.
    names : tuple of str
        Name of every link.
    bottom : (nc,) float
        Height of the lowest point of every contact in the reference configuration (m).
    height : float
        That of the centre of mass.
    """
    low = bottom.min() + 0.5 * max(0.0, height - float(bottom.min()))
    leaves = np.setdiff1d(model.contact_link, model.parent).tolist()
    contacts = {link: np.flatnonzero(model.contact_link == link) for link in leaves}
    return tuple(
        Foot(names[link], link, tuple(contacts[link].tolist()))
        for link in leaves
        if bottom[contacts[link]].min() <= low
    )


def name_contacts(model: Model, names: tuple[str, ...], feet: tuple[Foot, ...]) -> tuple[str, ...]:
    """Call the two ends of a foot heel and toe, and number the points of everything else.

    Contact points are in the order of their links, and of x on a link.
    """
    ends = {foot.link: foot.contacts for foot in feet if len(foot.contacts) == 2}
    result = []
    for link in np.unique(model.contact_link).tolist():
        x = model.contact_position[model.contact_link == link, 0]
        sole = link in ends and x[1] - x[0] > 1e-6
        endings = ("heel", "toe") if sole else range(len(x))
        result += [f"{names[link]}_{ending}" for ending in endings]
    return tuple(result)


def link_origins(model: Model) -> Floats:
    """World position (x, z) of the link frames in the reference configuration, (nv, 2)."""
    origin = model.offset.copy()
    for link, parent in enumerate(model.parent):
        if parent >= 0:
            origin[link] += origin[parent]
    return origin


def refuse_impossible_numbers(
    model: Model | SpatialModel, numbers: Mapping[str, Number], source: str
) -> None:
    """Refuse NaN, and what is infinite or huge where only a limit may be."""
    for name, values in model.members().items():
        number = numbers[name]
        bad = np.isnan(values) if number.infinite else ~(np.abs(values) <= LARGEST_NUMBER)
        if np.any(bad):
            words = number.label or name.replace("_", " ")
            raise RobotError(
                f"{source}: the {words} of the robot is not a number below {LARGEST_NUMBER:g}. "
                "Look for NaN or a misplaced exponent in the file."
            )


def refuse_idle_joint(joint: str, source: str) -> None:
    """Refuse a joint whose acceleration no mass resists."""
    raise RobotError(
        f"{source}: joint {joint!r} moves no mass and has no armature, so that nothing resists it. "
        "Give the link that it moves a mass and moments of inertia, or make it a fixed joint."
    )


def _refuse_joints_without_inertia(model: Model, joint_names: tuple[str, ...], source: str) -> None:
    """Refuse joints whose acceleration no mass resists: their equations of motion say 0 = 0.

    Such are joints that move no mass, and joints in a row that move it in the same way, as two
    hinges at one place with a massless link between them: the mass matrix is singular.
    """
    resistance = _mass_matrix(model, np.zeros(model.nj)).diagonal()
    idle = np.flatnonzero(~(resistance > 0.0))
    if len(idle):
        refuse_idle_joint(joint_names[idle[0]], source)
    floats = list(model.parent[:3]) == [-1, 0, 1]
    if np.all(model.inertia[2 * floats :] > 0.0):
        return
    matrix = _mass_matrix(model, 1.0 + np.sqrt(np.arange(model.nj)))  # in line by no chance
    scale = np.sqrt(np.maximum(matrix.diagonal(), resistance))
    least, motions = np.linalg.eigh(matrix / np.outer(scale, scale))
    if least[0] <= SINGULAR_MASS:
        free = np.flatnonzero(np.abs(motions[:, 0]) > SHARE)
        raise RobotError(
            f"{source}: joints {' and '.join(repr(joint_names[joint]) for joint in free)} can move "
            "together without moving any mass, so that nothing resists that. Give the link between "
            "them a mass and a moment of inertia, or one of them an armature, or make one a fixed "
            "joint."
        )


def _mass_matrix(model: Model, position: Floats) -> Floats:
    """Mass matrix (nv, nv) with the hinges at angles from the reference, the slides at it."""
    count = model.nj
    turn, place = np.zeros(count), np.zeros((count, 2))
    moved = np.zeros((count, count), dtype=bool)  # by which joints each link is moved
    motion = np.zeros((count, 3, count))  # of the links' centres of mass: rotation, x, z
    slide = np.zeros((count, 2))
    for link, parent in enumerate(model.parent):
        above = turn[parent] if parent >= 0 else 0.0
        base = place[parent] if parent >= 0 else np.zeros(2)
        moved[link] = moved[parent] if parent >= 0 else False
        moved[link, link] = True
        place[link] = base + _turned(model.offset[link], above)
        slide[link] = _turned(model.axis[link, 1:], above)
        turn[link] = above + model.axis[link, 0] * position[link]
        arm = place[link] + _turned(model.center_of_mass[link], turn[link]) - place
        sense = model.axis[:, 0]
        every = np.array([sense, sense * arm[:, 1] + slide[:, 0], slide[:, 1] - sense * arm[:, 0]])
        motion[link] = np.where(moved[link], every, 0.0)
    weight = np.sqrt(np.stack([model.inertia, model.mass, model.mass], axis=1))
    weighted = (weight[:, :, None] * motion).reshape(3 * count, count)
    matrix: Floats = weighted.T @ weighted + np.diag(model.armature)
    return matrix


def _turned(vector: Floats, angle: float) -> Floats:
    """Turn (x, z) about +y."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])


def _refuse_motors_without_speed(model: Model, joint_names: tuple[str, ...], source: str) -> None:
    """Refuse a motor whose torque has fallen to zero at no speed at all."""
    still = np.flatnonzero(model.no_load_speed == 0.0)
    if len(still):
        raise RobotError(
            f"{source}: the no-load speed of the motor at joint {joint_names[still[0]]!r} is 0, at "
            "which it never turns. Leave it out if it is not known."
        )


def _is_floating(model: Model, source: str) -> bool:
    """Whether the robot begins with unactuated slide x, slide z and hinge y of its trunk.

    Warn if it floats by three such joints in another order: gaits and controllers expect this one.
    """
    if len(model.parent) < 3 or list(model.parent[:3]) != [-1, 0, 1]:
        return False
    alone = all(np.count_nonzero(model.parent == k) == 1 for k in (-1, 0, 1))
    if not alone or np.any(model.mass[:2]) or np.any(model.actuator_joint < 3):
        return False
    first = model.axis[:3]
    if np.array_equal(first, [[0, 1, 0], [0, 0, 1], [1, 0, 0]]):
        return True
    if np.count_nonzero(first[:, 0]) == 1 and np.linalg.matrix_rank(first) == 3:
        warn(
            f"{source}: the first body floats, but not by slide along x, slide along z, hinge "
            "about y in this order and sense; gaits and walking controllers need them so."
        )
    return False
