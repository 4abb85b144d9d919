"""Left and right made equal, by the mean of their numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.model import NUMBERS, SCALES, Floats, Integers, Model, label
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.robot.sides.symmetry import (
    FLOOR,
    MIRRORED_NUMBER,
    differences,
    named_mirror,
    same,
    text_of,
)
from heelstrike.robot.warning import warn
from heelstrike.tolerances import MIRRORED_PLACE

SHOWN = 6  # how many differences a message lists


def averaged(
    model: Model, joint_names: tuple[str, ...], link_names: tuple[str, ...], source: str
) -> Model:
    """Make left and right equal, by the mean of their numbers.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    joint_names, link_names : tuple of str
        Names of its coordinates and links.
    source : str
        What to call the robot in messages.

    Returns
    -------
    Model
        The arrays of the robot that is its own mirror image.

    Raises
    ------
    RobotError
        If left and right are not told apart by names, or differ in what has no mean.

    Warns
    -----
    RobotWarning
        Of the largest difference in each number, where it was more than rounding.
    """
    mirror = named_mirror(model, joint_names, link_names)
    if mirror is None:
        raise RobotError(
            f'{source}: mirror="average" needs to know left from right by the names of joints or '
            "links, such as left_hip and right_hip."
        )
    means: dict[str, Floats] = {}
    said = []
    for name, image, joint, floor in _images(model, mirror):
        values: Floats = getattr(model, name)
        with np.errstate(invalid="ignore"):
            means[name] = np.where(values == image, values, 0.5 * (values + image))
            apart = np.where(values == image, 0.0, np.abs(values - image))
        unequal = [i for i in range(len(values)) if not same(values[i], image[i], floor)]
        if unequal:
            place = max(unequal, key=lambda i: float(apart[i].max()))
            said.append(
                f"{label(name)} by {text_of(apart[place].max())} ({joint_names[joint[place]]})"
            )
    result = model.replaced(**means)
    left = differences(result, mirror, joint_names, link_names)
    if left:
        raise RobotError(
            f'{source}: mirror="average" cannot make left and right equal: '
            f"{'; '.join(left[:SHOWN])}."
        )
    if said:
        warn(
            f"{source}: left and right are made equal by their means. They differed in "
            f"{', '.join(said)}."
        )
    return result


def _images(model: Model, mirror: Mirror) -> Iterator[tuple[str, Floats, Integers, float]]:
    """Every number with its mirror image, the joints that it belongs to, and its rounding."""
    joints = np.arange(model.nv)
    for name, number in NUMBERS.items():
        if number.alike:
            yield name, getattr(model, name)[mirror.joint], joints, FLOOR.get(name, MIRRORED_NUMBER)
    lower, upper = mirror.ranges(model.lower, model.upper)
    yield "lower", lower, joints, MIRRORED_NUMBER
    yield "upper", upper, joints, MIRRORED_NUMBER
    # Where one side alone has a spring, its rest is that of both; where none has, there is none.
    sprung = model.stiffness > 0.0
    rest = np.where(sprung[mirror.joint] | ~sprung, mirror.position(model.rest), model.rest)
    yield "rest", np.where(sprung | sprung[mirror.joint], rest, model.rest), joints, MIRRORED_NUMBER
    driven = mirror.among(model.actuator_joint)
    ends = driven.velocity(model.torque_lower), driven.velocity(model.torque_upper)
    yield "torque_lower", np.minimum(*ends), model.actuator_joint, MIRRORED_NUMBER
    yield "torque_upper", np.maximum(*ends), model.actuator_joint, MIRRORED_NUMBER
    for name in ("contact_position", "contact_radius", *SCALES):
        values = mirror.at_contacts(getattr(model, name))
        yield (
            name,
            values,
            model.contact_link,
            MIRRORED_NUMBER if name in SCALES else MIRRORED_PLACE,
        )
