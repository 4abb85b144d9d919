"""Left and right: found by name, believed only when the numbers agree."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.robot.model import NUMBERS, SCALES, Floats, Integers, Model, label
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.tolerances import MIRRORED_PLACE

TOLERANCE = 1e-4
"""Relative difference up to which numbers of left and right are the same: files round, and those
who draw the parts round each side for itself."""

MIRRORED_NUMBER = 1e-9  # of other numbers, in their units
FLOOR = {"offset": MIRRORED_PLACE, "center_of_mass": MIRRORED_PLACE}

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_OTHER = str.maketrans("lrLR", "rlRL")
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
) -> tuple[Mirror | None, list[str]]:
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

    Returns
    -------
    mirror : Mirror or None
        None if no names pair up, or if a pair differs.
    differences : list of str
        In what, with the numbers.
    """
    mirror = named_mirror(model, joint_names, link_names)
    if mirror is None:
        return None, []
    found = differences(model, mirror, joint_names, link_names)
    if found:
        return None, found
    by_link = {foot.link: i for i, foot in enumerate(feet)}
    foot = np.array([by_link[int(mirror.joint[foot.link])] for foot in feet], dtype=np.int64)
    return replace(mirror, foot=foot), []


def named_mirror(
    model: Model, joint_names: Sequence[str], link_names: Sequence[str]
) -> Mirror | None:
    """Return the exchange of left and right that names tell, without feet; None if they do not."""
    joint = _pairs(joint_names)
    if joint is None:
        joint = _pairs(_numbered(link_names))
    if joint is None:
        return None
    contact = _contact_pairs(model, joint)
    return Mirror(joint, _signs(model, joint), contact, np.zeros(0, np.int64), model.reference)


def differences(
    model: Model, mirror: Mirror, joint_names: Sequence[str], link_names: Sequence[str]
) -> list[str]:
    """In what left and right differ, with the numbers, each once."""
    findings = [
        *_unpaired(joint_names, mirror.joint),
        *_differing_joints(model, mirror, joint_names),
        *_differing_actuators(model, mirror, joint_names),
        *_differing_contacts(model, mirror, link_names),
        *_differing_loops(model, mirror, link_names),
        *_differing_couplings(model, mirror, joint_names),
        *_differing_latches(model, mirror, joint_names),
        *_differing_brakes(model, mirror, joint_names),
    ]
    return list(dict.fromkeys(findings))  # two points of a foot may say the same


def counterparts(names: Sequence[str]) -> Integers:
    """Index of the counterpart of every name on the other side, its own where it has none.

    Parameters
    ----------
    names : sequence of str
        Names of joints, links or bodies.
    """
    pairs = _pairs(names)
    return np.arange(len(names)) if pairs is None else pairs


def _side(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Split a name into its side ("" if none) and the rest.

    A bare first letter, as in lhip, counts only if `names` has the other side's, rhip.
    """
    corner = _corner(name, names)
    if corner is not None:
        return corner
    words = [word.lower() for word in _WORDS.findall(name)]
    for k, word in enumerate(words):
        side = _SIDES.get(word) or next((s for s in ("left", "right") if word.startswith(s)), "")
        if side:
            words[k : k + 1] = [] if word in _SIDES else [word.removeprefix(side)]
            return side, " ".join(words)
    if name[:1].translate(_OTHER) + name[1:] in names and name[:1].lower() in _SIDES:
        return _SIDES[name[0].lower()], name[1:].lower()
    return "", " ".join(words)


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
    """Counterpart of every contact point: of two links, the nearest points first."""
    result = np.arange(len(model.contact_link))
    for link, other in enumerate(joint):
        here, there = (np.flatnonzero(model.contact_link == one) for one in (link, other))
        if link >= other or not len(here) or not len(there):
            continue
        apart = model.contact_position[here][:, None] - model.contact_position[there]
        change = np.abs(model.contact_radius[here][:, None] - model.contact_radius[there])
        distance = np.hypot(apart[..., 0], apart[..., 1]) + change
        missing = min(distance.shape)
        for place in np.argsort(distance, axis=None, kind="stable"):
            one, twin = here[place // len(there)], there[place % len(there)]
            if result[one] == one and result[twin] == twin:
                result[one], result[twin] = twin, one
                missing -= 1
            if not missing:
                break
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
            yield f"{names[i]} and {names[j]} are attached to links that are not counterparts"
    ranges = (
        np.transpose([model.lower, model.upper]),
        np.transpose(mirror.ranges(model.lower, model.upper)),
    )
    rests = model.rest, mirror.position(model.rest)
    for i, j in enumerate(joint):
        if j <= i:
            continue
        pair = f"of {names[i]} and {names[j]}"
        if not same(model.axis[i], mirror.sign[i] * model.axis[j]):
            yield f"axis {pair} (not parallel)"
        compared: list[tuple[Any, ...]] = [
            (label(name), *getattr(model, name)[[i, j]], FLOOR.get(name, MIRRORED_NUMBER))
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


def _differing_contacts(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    joint = mirror.joint
    for i, j in enumerate(joint):
        here, there = (int(np.sum(model.contact_link == k)) for k in (i, j))
        if i < j and here != there:
            yield f"number of contact points on {names[i]} and {names[j]} ({here}, {there})"
    for i, j in enumerate(mirror.contact.tolist()):
        link, other = model.contact_link[i], joint[model.contact_link[i]]
        if model.contact_link[j] != other or link > other:
            continue  # no counterpart at all (told above), or told from the other side
        compared = [
            ("contact points", *model.contact_position[[i, j]], MIRRORED_PLACE),
            ("radius of the contact points", *model.contact_radius[[i, j]], MIRRORED_PLACE),
            *((label(name), *getattr(model, name)[[i, j]]) for name in SCALES),
        ]
        yield from _unequal(compared, f"of {names[link]} and {names[other]}")


def _differing_loops(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    """Tell which loops have no mirror image; their two ends may be the other way round."""
    image = np.append(mirror.joint, -1)  # the world is its own

    def is_image(one: int, other: int) -> bool:
        ends, places = model.loop_link[other], model.loop_position[other]
        return any(
            np.array_equal(image[model.loop_link[one]], ends[::way])
            and same(model.loop_position[one], places[::way], MIRRORED_PLACE)
            for way in (1, -1)
        )

    for one in range(model.loops):
        if not any(is_image(one, other) for other in range(model.loops)):
            joined = " and ".join([*names, "the world"][link] for link in model.loop_link[one])
            yield f"the loop of {joined} has no mirror image"


def _differing_couplings(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    image = np.append(mirror.joint, -1)
    known = {
        tuple(joints): factors
        for joints, factors in zip(
            model.coupling_joint.tolist(), model.coupling_polynomial, strict=True
        )
    }
    for (joint, leader), factors in known.items():
        its = known.get((int(image[joint]), int(image[leader])))
        sense = mirror.sign[leader] if leader >= 0 else 1.0
        mirrored = mirror.sign[joint] * factors * sense ** np.arange(len(factors))
        if its is None or not same(mirrored, its):
            yield f"how {names[joint]} follows has no mirror image"


def _differing_latches(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    image = np.append(mirror.joint, -1)
    ends = zip(
        model.latch_joint.tolist(),
        model.latch_side.tolist(),
        model.latch_release.tolist(),
        strict=True,
    )
    known = list(ends)
    for joint, side, release in known:
        its = int(image[joint]), int(side * mirror.sign[joint]), int(image[release])
        if its not in known:
            yield f"the latch of {names[joint]} has no mirror image"


def _differing_brakes(model: Model, mirror: Mirror, names: Sequence[str]) -> Iterator[str]:
    limits = dict(zip(model.brake_joint.tolist(), model.brake_limit.tolist(), strict=True))
    for joint in sorted(limits):
        its = int(mirror.joint[joint])
        if its not in limits:
            yield f"{names[joint]} has a brake, {names[its]} has none"
        elif joint < its and not same(limits[joint], limits[its]):
            yield (
                f"limits of the brakes of {names[joint]} and {names[its]} ({limits[joint]:g}, "
                f"{limits[its]:g})"
            )


def _unequal(compared: Iterable[tuple[Any, ...]], pair: str) -> Iterator[str]:
    """Tell which numbers (what, on this side, on the other, how small they may be) differ."""
    for what, here, there, *floor in compared:
        if not same(here, there, *floor):
            yield f"{what} {pair} ({text_of(here)}, {text_of(there)})"


def same(a: ArrayLike, b: ArrayLike, floor: float = MIRRORED_NUMBER) -> bool:
    """Whether numbers are equal but for rounding; what is infinite equals only itself.

    Those of a vector are measured by its largest.
    """
    a, b = np.asarray(a), np.asarray(b)
    with np.errstate(invalid="ignore"):
        finite = np.isfinite(a) & np.isfinite(b)
        size = np.max(np.where(finite, np.maximum(np.abs(a), np.abs(b)), 0.0), initial=0.0)
        near = np.abs(a - b) <= TOLERANCE * size + floor
    return bool(np.all(near & finite | (a == b)))


def text_of(value: ArrayLike) -> str:
    """Return a number or vector as messages write it."""
    numbers = [f"{number:.9g}" for number in np.atleast_1d(np.asarray(value, dtype=np.float64))]
    return numbers[0] if len(numbers) == 1 else f"[{', '.join(numbers)}]"
