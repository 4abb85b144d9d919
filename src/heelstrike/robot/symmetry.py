"""Left and right: found by name, believed only when the numbers agree."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.errors import RobotError
from heelstrike.robot.mirror import Mirror
from heelstrike.robot.model import NUMBERS, Floats, Integers, Model, label
from heelstrike.robot.robot import Foot
from heelstrike.robot.warning import warn

TOLERANCE = 1e-4
"""Relative difference up to which numbers of left and right are the same: files round, and those
who draw the parts round each side for itself."""

SAME_PLACE = 1e-5
"""Metres up to which places on the left and on the right are the same."""

ROUND_OFF = 1e-9  # of other numbers, in their units

PLACES = ("offset", "center_of_mass")

SHOWN = 6  # how many differences a message lists before it counts the rest

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_OTHER = {"l": "r", "r": "l"}
# Legs of robots with more than two: FL for front left, and likewise rear, back, hind, middle.
_CORNERS: dict[str, tuple[str, str]] = {
    **{place + side: (side, place) for place in "frbhm" for side in "lr"},
    **{side + place: (side, place) for place in "fbhm" for side in "lr"},
    "lr": ("l", "r"),
}


def find_mirror(
    model: Model,
    joint_names: tuple[str, ...],
    link_names: tuple[str, ...],
    feet: tuple[Foot, ...],
    source: str,
) -> Mirror | None:
    """Find the exchange of left and right, and check it on every number that acts.

    Sides are recognised by the words left, right, l, r in the names of joints (or else of links),
    in any case and position: ``left_hip``, ``HipRight``, ``l_knee``, ``knee_L``, and by words like
    FL and RR for legs at corners. One side may go without: ``foot`` is the counterpart of
    ``foot_left``. The friction of contact points does not act: the ground's does.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    joint_names, link_names : tuple of str
        Names of its coordinates and links.
    feet : tuple of Foot
        Its feet.
    source : str
        What to call the robot in messages.

    Returns
    -------
    Mirror or None
        None if no names pair up, which is silent, or if a pair differs, which earns a
        `RobotWarning` with the numbers in which it does.
    """
    joint = _joint_pairs(joint_names, link_names)
    if joint is None:
        return None
    sign = _signs(model, joint)
    contact = _contact_pairs(model, joint)
    differences = list(_structure(model, joint, sign, contact, joint_names, link_names))
    if differences:
        shown, more = "; ".join(differences[:SHOWN]), len(differences) - SHOWN
        tail = f"; and {more} more" if more > 0 else ""
        warn(
            f"{source}: left and right differ, so the robot has no mirror image: {shown}{tail}. "
            "Gaits whose steps mirror each other need two equal legs, as load_robot makes them "
            'with mirror="average".'
        )
        return None
    by_link = {foot.link: i for i, foot in enumerate(feet)}
    foot = np.array([by_link[int(joint[foot.link])] for foot in feet], dtype=np.int64)
    return Mirror(joint, sign, contact, foot)


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
    joint = _joint_pairs(joint_names, link_names)
    if joint is None:
        raise RobotError(
            f'{source}: mirror="average" needs to know left from right by the names of joints or '
            "links, such as left_hip and right_hip."
        )
    sign, contact = _signs(model, joint), _contact_pairs(model, joint)
    changes = dict(_means(model, joint, sign, contact))
    result = model.replaced(**{name: mean for name, (mean, _, _) in changes.items()})
    left = list(_structure(result, joint, sign, contact, joint_names, link_names))
    if left:
        raise RobotError(
            f'{source}: mirror="average" cannot make left and right equal: '
            f"{'; '.join(left[:SHOWN])}."
        )
    said = [
        f"{label(name)} by {_text(difference)} ({joint_names[place]})"
        for name, (_, difference, place) in changes.items()
        if difference > 0.0
    ]
    if said:
        warn(
            f"{source}: left and right are made equal by their means. They differed in "
            f"{', '.join(said)}."
        )
    return result


def _means(
    model: Model, joint: Integers, sign: Floats, contact: Integers
) -> Iterator[tuple[str, tuple[Floats, float, int]]]:
    """Mean of left and right for every number, their largest difference and where it is."""

    def mean(values: Floats, mirrored: Floats, floor: float) -> tuple[Floats, float, int]:
        equal = values == mirrored
        with np.errstate(invalid="ignore"):
            apart = np.where(equal, 0.0, np.abs(values - mirrored))
            middle = np.where(equal, values, 0.5 * (values + mirrored))
        rows = apart.reshape(len(apart), -1).max(axis=1, initial=0.0)
        size = np.abs(np.where(np.isfinite(values), values, 0.0)).reshape(len(apart), -1)
        rows[rows <= TOLERANCE * size.max(axis=1, initial=0.0) + floor] = 0.0
        place = int(rows.argmax()) if len(rows) else 0
        return middle, float(rows[place]) if len(rows) else 0.0, place

    for name, number in NUMBERS.items():
        if number.alike:
            values = getattr(model, name)
            yield name, mean(values, values[joint], SAME_PLACE if name in PLACES else ROUND_OFF)
    yield "axis", mean(model.axis, sign[:, None] * model.axis[joint], TOLERANCE)
    about = model.reference
    ends = np.stack((model.lower - about, model.upper - about))
    there = sign * ends[:, joint]
    there = np.where(sign < 0.0, there[::-1], there)
    for name, here, other in (("lower", ends[0], there[0]), ("upper", ends[1], there[1])):
        middle, difference, place = mean(here, other, ROUND_OFF)
        yield name, (middle + about, difference, place)
    rest = np.where(model.stiffness > 0.0, model.rest - about, 0.0)
    middle, difference, place = mean(rest, sign * rest[joint], ROUND_OFF)
    yield "rest", (np.where(model.stiffness > 0.0, middle + about, model.rest), difference, place)
    of_joint = {int(k): i for i, k in enumerate(model.actuator_joint)}
    pair = [of_joint.get(int(joint[k]), i) for i, k in enumerate(model.actuator_joint)]
    turned = sign[model.actuator_joint] < 0.0
    low, high = model.torque_lower, model.torque_upper
    for name, here, other in (
        ("torque_lower", low, np.where(turned, -high[pair], low[pair])),
        ("torque_upper", high, np.where(turned, -low[pair], high[pair])),
    ):
        middle, difference, place = mean(here, other, ROUND_OFF)
        index = int(model.actuator_joint[place]) if len(pair) else 0
        yield name, (middle, difference, index)
    for name in ("contact_position", "contact_radius"):
        values = getattr(model, name)
        middle, difference, place = mean(values, values[contact], SAME_PLACE)
        index = int(model.contact_link[place]) if len(contact) else 0
        yield name, (middle, difference, index)


def _structure(
    model: Model,
    joint: Integers,
    sign: Floats,
    contact: Integers,
    joint_names: tuple[str, ...],
    link_names: tuple[str, ...],
) -> Iterator[str]:
    """What still differs, each once."""
    yield from dict.fromkeys(
        (
            *_unpaired(joint_names, joint),
            *_differing_joints(model, joint, sign, joint_names),
            *_differing_actuators(model, joint, sign, joint_names),
            *_differing_contacts(model, joint, contact, link_names),
        )
    )


def counterparts(names: Sequence[str]) -> Integers:
    """Index of the counterpart of every name on the other side, its own where it has none.

    Parameters
    ----------
    names : sequence of str
        Names of joints, links or bodies.
    """
    pairs = _pairs(names)
    return np.arange(len(names)) if pairs is None else pairs


def _joint_pairs(joint_names: Sequence[str], link_names: Sequence[str]) -> Integers | None:
    joint = _pairs(joint_names)
    return _pairs(_numbered(link_names)) if joint is None else joint


def _side(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Split a name into its side ("" if none) and the rest.

    A bare first letter, as in lhip, counts only if `names` has the other side's, rhip.
    """
    corner = _corner(name, names)
    if corner is not None:
        return corner
    words = [word.lower() for word in _WORDS.findall(name)]
    side = ""
    rest: list[str] = []
    for word in words:
        if not side and word in _SIDES:
            side = _SIDES[word]
        elif not side and len(word) > 4 and word.startswith("left"):
            side, rest = "left", [*rest, word[4:]]
        elif not side and len(word) > 5 and word.startswith("right"):
            side, rest = "right", [*rest, word[5:]]
        else:
            rest.append(word)
    letter = name[:1].lower()
    if not side and letter in _OTHER and _swapped(name) in names:
        return _SIDES[letter], name[1:].lower()
    return side, " ".join(rest)


def _corner(name: str, names: Sequence[str]) -> tuple[str, str] | None:
    """Side and rest of a name with a word like FL, if `names` has the other side's."""
    for found in _WORDS.finditer(name):
        word = found.group()
        if word.lower() not in _CORNERS:
            continue
        side, place = _CORNERS[word.lower()]
        for other, (far, where) in _CORNERS.items():
            swapped = other.upper() if word.isupper() else other
            twin = name[: found.start()] + swapped + name[found.end() :]
            if far != side and where == place and twin in names:
                rest = f"{name[: found.start()]}{place} {name[found.end() :]}"
                return _SIDES[side], rest.lower()
    return None


def _swapped(name: str) -> str:
    other = _OTHER[name[0].lower()]
    return (other.upper() if name[0].isupper() else other) + name[1:]


def _numbered(names: Sequence[str]) -> tuple[str, ...]:
    """Tell the links of one body apart by their place in the chain."""
    return tuple(f"{name} {names[:i].count(name)}" for i, name in enumerate(names))


def _pairs(names: Sequence[str]) -> Integers | None:
    """Index of every name's counterpart, its own if it has none; None if nothing pairs up."""
    sides: dict[str, dict[str, int]] = {}
    for i, name in enumerate(names):
        side, rest = _side(name, names)
        sides.setdefault(rest, {})[side] = i
    result = np.arange(len(names))
    for group in sides.values():
        pair = [group[side] for side in ("left", "right") if side in group]
        if len(pair) == 1 and "" in group:
            pair.append(group[""])
        if len(pair) == 2:
            result[pair] = pair[::-1]
    return result if np.any(result != np.arange(len(names))) else None


def _signs(model: Model, joint: Integers) -> Floats:
    """-1 where the axes of a pair are opposite, +1 elsewhere (also where they do not match)."""
    opposite = np.all(np.abs(model.axis[joint] + model.axis) < TOLERANCE, axis=1)
    return np.where(opposite, -1.0, 1.0)


def _contact_pairs(model: Model, joint: Integers) -> Integers:
    """Counterpart of every contact point: those of two links are matched as near as they can be."""
    from scipy.optimize import linear_sum_assignment

    result = np.arange(len(model.contact_link))
    for link, other in enumerate(joint):
        if link >= other:
            continue
        here, there = (np.flatnonzero(model.contact_link == one) for one in (link, other))
        apart = model.contact_position[here][:, None] - model.contact_position[there]
        change = np.abs(model.contact_radius[here][:, None] - model.contact_radius[there])
        one, twin = linear_sum_assignment(np.hypot(apart[..., 0], apart[..., 1]) + change)
        result[here[one]], result[there[twin]] = there[twin], here[one]
    return result


def _unpaired(names: Sequence[str], joint: Integers) -> Iterator[str]:
    for i, name in enumerate(names):
        side, _ = _side(name, names)
        if side and joint[i] == i:
            yield f"{name} has no counterpart"


def _differing_joints(
    model: Model, joint: Integers, sign: Floats, names: Sequence[str]
) -> Iterator[str]:
    parent = model.parent
    for i, j in enumerate(joint):
        expected = joint[parent[i]] if parent[i] >= 0 else -1
        if parent[j] != expected:
            yield f"{names[i]} and {names[j]} hang on links that are not counterparts"
    for i, j in enumerate(joint):
        if j <= i:
            continue
        pair = f"of {names[i]} and {names[j]}"
        if not _same(model.axis[i], sign[i] * model.axis[j]):
            yield f"axis {pair} (not parallel)"
        for name in (name for name, number in NUMBERS.items() if number.alike):
            a, b = getattr(model, name)[i], getattr(model, name)[j]
            if not _same(a, b, SAME_PLACE if name in PLACES else ROUND_OFF):
                yield f"{label(name)} {pair} ({_text(a)}, {_text(b)})"
        turned = slice(None) if sign[i] > 0 else slice(None, None, -1)
        range_i = np.array([model.lower[i], model.upper[i]]) - model.reference[i]
        range_j = sign[i] * (np.array([model.lower[j], model.upper[j]]) - model.reference[j])
        if not _same(range_i, range_j[turned]):
            yield f"range {pair} ({_text(range_i)}, {_text(range_j[turned])})"
        if model.stiffness[i] or model.stiffness[j]:
            rest_i = model.rest[i] - model.reference[i]
            rest_j = sign[i] * (model.rest[j] - model.reference[j])
            if not _same(rest_i, rest_j):
                yield f"rest of the spring {pair} ({_text(rest_i)}, {_text(rest_j)})"


def _differing_actuators(
    model: Model, joint: Integers, sign: Floats, names: Sequence[str]
) -> Iterator[str]:
    limits = {
        int(k): np.array([low, high])
        for k, low, high in zip(
            model.actuator_joint, model.torque_lower, model.torque_upper, strict=True
        )
    }
    for i, j in enumerate(joint.tolist()):
        if (i in limits) and (j not in limits):
            yield f"{names[i]} has an actuator, {names[j]} has none"
        elif j > i and i in limits:
            there = sign[i] * limits[j]
            there = there if sign[i] > 0 else there[::-1]
            if not _same(limits[i], there):
                yield (
                    f"torque limits of {names[i]} and {names[j]} "
                    f"({_text(limits[i])}, {_text(there)})"
                )


def _differing_contacts(
    model: Model,
    joint: Integers,
    contact: Integers,
    names: Sequence[str],
) -> Iterator[str]:
    for i, j in enumerate(joint):
        here, there = (int(np.sum(model.contact_link == k)) for k in (i, j))
        if i < j and here != there:
            yield f"number of contact points on {names[i]} and {names[j]} ({here}, {there})"
    for i, j in enumerate(contact.tolist()):
        link, other = model.contact_link[i], joint[model.contact_link[i]]
        if model.contact_link[j] != other or link > other:
            continue  # no counterpart at all (told above), or told from the other side
        pair = f"of {names[link]} and {names[other]}"
        for what, values, paired in (
            ("contact points", model.contact_position, contact[j] == i),
            ("radius of the contact points", model.contact_radius, True),
        ):
            a, b = values[i], values[j]
            if not (paired and _same(a, b, SAME_PLACE)):
                yield f"{what} {pair} ({_text(a)}, {_text(b)})"


def _same(a: ArrayLike, b: ArrayLike, floor: float = ROUND_OFF) -> bool:
    """Whether numbers are equal but for rounding; what is infinite equals only itself.

    Those of a vector are measured by its largest.
    """
    a, b = np.asarray(a), np.asarray(b)
    with np.errstate(invalid="ignore"):
        finite = np.isfinite(a) & np.isfinite(b)
        size = np.max(np.where(finite, np.maximum(np.abs(a), np.abs(b)), 0.0), initial=0.0)
        near = np.abs(a - b) <= TOLERANCE * size + floor
    return bool(np.all(near & finite | (a == b)))


def _text(value: ArrayLike) -> str:
    numbers = [f"{number:.9g}" for number in np.atleast_1d(np.asarray(value, dtype=np.float64))]
    return numbers[0] if len(numbers) == 1 else f"[{', '.join(numbers)}]"
