"""Left and right: found by name, believed only when the numbers agree."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.robot.mirror import Mirror
from heelstrike.robot.model import NUMBERS, Floats, Integers, Model, label
from heelstrike.robot.robot import Foot

TOLERANCE = 1e-6
"""Relative difference up to which numbers of left and right are the same (files round)."""

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_OTHER = str.maketrans("lrLR", "rlRL")


def find_mirror(
    model: Model,
    joint_names: tuple[str, ...],
    link_names: tuple[str, ...],
    feet: tuple[Foot, ...],
    friction: Sequence[float],
) -> tuple[Mirror | None, list[str]]:
    """Find the exchange of left and right, and check it on every number of the robot.

    Sides are recognised by the words left, right, l, r in the names of joints (or else of links),
    in any case and position: ``left_hip``, ``HipRight``, ``l_knee``. One side may go without:
    ``foot`` is the counterpart of ``foot_left``.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    joint_names, link_names : tuple of str
        Names of its coordinates and links.
    feet : tuple of Foot
        Its feet.
    friction : sequence of nc float
        Friction of every contact point according to the robot's file.

    Returns
    -------
    mirror : Mirror or None
        None if no names pair up, or if a pair differs.
    differences : list of str
        In what, with the numbers.
    """
    joint = _pairs(joint_names)
    if joint is None:
        joint = _pairs(_numbered(link_names))
    if joint is None:
        return None, []
    mirror = Mirror(
        joint, _signs(model, joint), _contact_pairs(model, joint), np.zeros(0, np.int64),
        model.reference,
    )  # fmt: skip
    findings = [
        *_unpaired(joint_names, joint),
        *_differing_joints(model, mirror, joint_names),
        *_differing_actuators(model, mirror, joint_names),
        *_differing_contacts(model, mirror, friction, link_names),
    ]
    if findings:
        return None, list(dict.fromkeys(findings))  # two points of a foot may say the same
    by_link = {foot.link: i for i, foot in enumerate(feet)}
    foot = np.array([by_link[int(joint[foot.link])] for foot in feet], dtype=np.int64)
    return replace(mirror, foot=foot), []


def _side(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Split a name into its side ("" if none) and the rest.

    A bare first letter, as in lhip, counts only if `names` has the other side's, rhip.
    """
    words = [word.lower() for word in _WORDS.findall(name)]
    for k, word in enumerate(words):
        side = _SIDES.get(word) or next((s for s in ("left", "right") if word.startswith(s)), "")
        if side:
            words[k : k + 1] = [] if word in _SIDES else [word.removeprefix(side)]
            return side, " ".join(words)
    if name[:1].translate(_OTHER) + name[1:] in names and name[:1].lower() in _SIDES:
        return _SIDES[name[0].lower()], name[1:].lower()
    return "", " ".join(words)


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
    """Nearest contact point on the counterpart of the link of every contact point."""
    result = np.arange(len(model.contact_link))
    for i, link in enumerate(model.contact_link):
        there = np.flatnonzero(model.contact_link == joint[link])
        if len(there) and joint[link] != link:
            apart = model.contact_position[there] - model.contact_position[i]
            change = np.abs(model.contact_radius[there] - model.contact_radius[i])
            result[i] = there[np.argmin(np.hypot(*apart.T) + change)]
    return result


def _unpaired(names: Sequence[str], joint: Integers) -> Iterator[str]:
    for i, name in enumerate(names):
        side, _ = _side(name, names)
        if side and joint[i] == i:
            yield f"{name} has no counterpart"


def _differing_joints(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    joint, parent = mirror.joint, model.parent
    for i, j in enumerate(joint):
        expected = joint[parent[i]] if parent[i] >= 0 else -1
        if parent[j] != expected:
            yield f"{names[i]} and {names[j]} hang on links that are not counterparts"
    ranges = (
        np.transpose([model.lower, model.upper]),
        np.transpose(mirror.ranges(model.lower, model.upper)),
    )
    rests = model.rest, mirror.position(model.rest)
    for i, j in enumerate(joint):
        if j <= i:
            continue
        pair = f"of {names[i]} and {names[j]}"
        if not _same(model.axis[i], mirror.sign[i] * model.axis[j]):
            yield f"axis {pair} (not parallel)"
        compared = [
            (label(name), *getattr(model, name)[[i, j]])
            for name, number in NUMBERS.items()
            if number.alike
        ]
        start = model.reference[i]
        compared.append(("range", *(ends[i] - start for ends in ranges)))
        if model.stiffness[i] or model.stiffness[j]:
            compared.append(("rest of the spring", *(rest[i] - start for rest in rests)))
        yield from _unequal(compared, pair)


def _differing_actuators(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    limits = dict(
        zip(
            model.actuator_joint.tolist(),
            np.transpose([model.torque_lower, model.torque_upper]),
            strict=True,
        )
    )
    for i, j in enumerate(mirror.joint.tolist()):
        if i in limits and j not in limits:
            yield f"{names[i]} has an actuator, {names[j]} has none"
        elif j > i and i in limits:
            image = np.sort(mirror.sign[i] * limits[j])
            yield from _unequal(
                [("torque limits", limits[i], image)], f"of {names[i]} and {names[j]}"
            )


def _differing_contacts(
    model: Model, mirror: Mirror, friction: Sequence[float], names: Sequence[str]
) -> Iterator[str]:
    joint = mirror.joint
    for i, j in enumerate(joint):
        here, there = (int(np.sum(model.contact_link == k)) for k in (i, j))
        if i < j and here != there:
            yield f"number of contact points on {names[i]} and {names[j]} ({here}, {there})"
    for i, j in enumerate(mirror.contact.tolist()):
        link, other = model.contact_link[i], joint[model.contact_link[i]]
        if model.contact_link[j] != other or link > other:
            continue  # no counterpart at all (told above), or told from the other side
        compared: list[tuple[Any, ...]] = [
            ("radius of the contact points", *model.contact_radius[[i, j]]),
            ("friction of the contact points", friction[i], friction[j]),
        ]
        places = ("contact points", *model.contact_position[[i, j]])
        alone = mirror.contact[j] != i
        pair = f"of {names[link]} and {names[other]}"
        yield from _unequal([places], pair, alone=alone)
        yield from _unequal(compared, pair)


def _unequal(
    compared: Iterable[tuple[Any, ...]], pair: str, *, alone: bool = False
) -> Iterator[str]:
    """Tell which numbers (what, on this side, on the other) are not the same, or stand alone."""
    for what, here, there in compared:
        if alone or not _same(here, there):
            yield f"{what} {pair} ({_text(here)}, {_text(there)})"


def _same(a: ArrayLike, b: ArrayLike) -> bool:
    """Whether numbers are equal but for rounding; what is infinite equals only itself."""
    a, b = np.asarray(a), np.asarray(b)
    with np.errstate(invalid="ignore"):
        near = np.abs(a - b) <= TOLERANCE * np.maximum(np.abs(a), np.abs(b)) + 1e-9
    return bool(np.all(near & np.isfinite(a) & np.isfinite(b) | (a == b)))


def _text(value: ArrayLike) -> str:
    numbers = [f"{number:.9g}" for number in np.atleast_1d(np.asarray(value, dtype=np.float64))]
    return numbers[0] if len(numbers) == 1 else f"[{', '.join(numbers)}]"
