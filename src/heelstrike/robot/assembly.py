"""From arrays and names to a `Robot`: its feet, its mirror image, and what no robot may be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.contact_points import ContactPoint
from heelstrike.robot.model import NUMBERS, Floats, Model, label
from heelstrike.robot.plausibility import unlikely_numbers
from heelstrike.robot.robot import Foot, LockedJoint, Robot
from heelstrike.robot.sides.averaging import averaged
from heelstrike.robot.sides.symmetry import find_mirror
from heelstrike.robot.warning import warn

LARGEST_NUMBER = 1e10
"""Largest length, mass, inertia … of a robot in SI units; MuJoCo's own bound on a state."""

UNLIKELY = "numbers that are unlikely"
DIFFERENT = "left and right differ"
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
        If a number is NaN or absurdly large, a joint moves no mass, or a motor never turns.

    Warns
    -----
    RobotWarning
        If left and right differ, the base floats by joints in an unusual order, or numbers look as
        if they were in another unit.
    """
    _refuse_impossible_numbers(model, source)
    if average:
        model = averaged(model, joint_names, link_names, source)
    origin = link_origins(model)
    _refuse_joints_without_inertia(model, origin, joint_names, source)
    _refuse_motors_without_speed(model, joint_names, source)
    unlikely = [one.message for one in unlikely_numbers(model, origin, joint_names, link_names)]
    if unlikely:
        more = f" And {len(unlikely) - SHOWN} more." if len(unlikely) > SHOWN else ""
        warn(f"{source}: {UNLIKELY}: {' '.join(unlikely[:SHOWN])}{more}")
    feet = find_feet(model, link_names, origin)
    friction = tuple(point.friction for point in points)
    mirror, differences = find_mirror(model, joint_names, link_names, feet)
    if differences:
        more = f"; and {len(differences) - SHOWN} more" if len(differences) > SHOWN else ""
        warn(
            f"{source}: {DIFFERENT}, so the robot has no mirror image: "
            f"{'; '.join(differences[:SHOWN])}{more}. Gaits whose steps mirror each other need two "
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
    low = bottom.min() + 0.5 * max(0.0, float(center[1] - bottom.min()))
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


def _refuse_impossible_numbers(model: Model, source: str) -> None:
    """Refuse NaN, and what is infinite or huge where only a limit may be."""
    for field, values in model.members().items():
        infinite = NUMBERS[field].infinite
        bad = np.isnan(values) if infinite else ~(np.abs(values) <= LARGEST_NUMBER)
        if np.any(bad):
            raise RobotError(
                f"{source}: the {label(field)} of the robot is not a number below "
                f"{LARGEST_NUMBER:g}. Look for NaN or a misplaced exponent in the file."
            )


def _refuse_joints_without_inertia(
    model: Model, origin: Floats, joint_names: tuple[str, ...], source: str
) -> None:
    """Refuse a joint whose acceleration no mass resists: its equation of motion says 0 = 0."""
    resistance = model.armature.copy()
    for link in range(len(model.parent)):
        center = origin[link] + model.center_of_mass[link]
        joint = link
        while joint >= 0:
            if model.axis[joint, 0]:
                arm = center - origin[joint]
                resistance[joint] += model.inertia[link] + model.mass[link] * (arm @ arm)
            else:
                resistance[joint] += model.mass[link]
            joint = int(model.parent[joint])
    idle = np.flatnonzero(~(resistance > 0.0))
    if len(idle):
        raise RobotError(
            f"{source}: joint {joint_names[idle[0]]!r} moves no mass and has no armature, so that "
            "nothing resists it. Give the link that it moves a mass and a moment of inertia."
        )


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
