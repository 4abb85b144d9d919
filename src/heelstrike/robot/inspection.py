"""What a robot consists of, and what is wrong with it."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.assembly import DIFFERENT, UNLIKELY, link_origins
from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.looks import is_file
from heelstrike.robot.files.options import LoadOptions, Options
from heelstrike.robot.files.reading import read_bodies, read_mjcf
from heelstrike.robot.library import (
    NO_CONTACTS,
    NO_MOTORS,
    builtin_robots,
    load_planar_robot,
    load_robot,
)
from heelstrike.robot.loops import coupling_words, latch_words
from heelstrike.robot.model import NUMBERS, PROPERTIES, SCALES, Floats, Integers, Number, label
from heelstrike.robot.named_tree import Foot, NamedTree
from heelstrike.robot.plausibility import (
    Finding,
    FindingKind,
    is_possible,
    unlikely_numbers,
)
from heelstrike.robot.robot import Robot
from heelstrike.robot.sides.symmetry import find_mirror
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.warning import RobotWarning
from heelstrike.tolerances import LEVEL_SOLE

LEG_ROUNDING = 1e-12
"""Metres, of sums along a leg."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """The result of an inspection of a robot."""

    source: str
    """What was looked at."""
    robot: Robot | SpatialRobot | None
    """The robot, None if the file gives none. If the file holds impossible inertias, it is the
    robot with the nearest possible ones: to look at, not to simulate."""
    findings: tuple[Finding, ...]
    """What looks wrong, nothing for a sound robot."""
    loadable: bool = True
    """Whether :func:`load_robot` takes the file as it is."""

    @property
    def sound(self) -> bool:
        """Whether nothing looks wrong."""
        return not self.findings

    def text(self) -> str:
        """Return everything in words: tree, masses, limits, contact points, findings."""
        parts = [] if self.robot is None else [_words(self.robot)]
        if self.findings:
            parts.append("\n".join(["findings", *(f"  - {found}" for found in self.findings)]))
        else:
            parts.append("findings\n  none")
        if not self.loadable:
            parts.append("load_robot refuses this file as it is.")
        return "\n\n".join(parts)

    def __str__(self) -> str:
        return self.text()


@takes(RobotError)
def inspect_robot(
    robot: Robot | SpatialRobot | str | os.PathLike[str], **how: Unpack[LoadOptions]
) -> Inspection:
    """Inspect a robot for common mistakes.

    Left and right that differ; inertias that violate the triangle inequality (the sum of two
    principal moments is never less than the third); links that move without mass; feet of different
    friction; contact points above the sole; limits that leave the reference configuration out.

    Parameters
    ----------
    robot : Robot, SpatialRobot, str or path
        A robot, the name of a built-in one, or the path of an MJCF or URDF file. A file tells more
        than a robot: a planar robot has forgotten its moments of inertia in space.
    **how : LoadOptions
        As for :func:`load_robot`.

    Returns
    -------
    Inspection
        What was found, in words and as data.

    Raises
    ------
    RobotError
        If there is no such robot, or its file cannot be read at all.

    Examples
    --------
    >>> import heelstrike as hs
    >>> hs.inspect_robot("bravo7").sound
    True
    """
    if isinstance(robot, Robot):
        Options(**how)  # which says what is wrong with them
        return Inspection(robot.source or robot.name, robot, tuple(_of_robot(robot)))
    if isinstance(robot, SpatialRobot):
        Options(**how)
        return Inspection(robot.source or robot.name, robot, ())
    path = _file(robot)
    findings: list[Finding] = []
    refused: RobotError | None = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RobotWarning)
        try:
            found: Robot | SpatialRobot | None = load_planar_robot(robot, **how)
        except RobotError as error:
            if path is None:
                raise
            said_in_plane = len(caught)
            found = _in_space(path, how)
            refused = error if found is None else None
            # What was said of the robot that it is not.
            del caught[slice(said_in_plane, None) if found is None else slice(said_in_plane)]
        if path is not None:
            findings += _of_inertias(path, how, whole=isinstance(found, SpatialRobot))
        if refused is not None and path is not None:
            try:
                found = read_mjcf(path, lenient=True, **how)
            except RobotError as still:
                findings.append(Finding(FindingKind.FILE, str(still)))
            if not findings:
                raise refused
    said = dict.fromkeys(str(one.message) for one in caught if one.category is RobotWarning)
    findings += [
        Finding(FindingKind.FILE, words)
        for words in said
        if not any(told in words for told in TOLD)
    ]
    if isinstance(found, Robot):
        findings += _of_robot(found)
    return Inspection(str(robot), found, tuple(dict.fromkeys(findings)), refused is None)


def _in_space(path: Path, how: LoadOptions) -> SpatialRobot | None:
    """Robot of three dimensions out of a file, None of one whose trunk does not move freely.

    Such a one is a robot of the plane, of which a joint has slipped out of it.
    """
    try:
        robot: Robot | SpatialRobot = load_robot(path, **how)
    except RobotError:
        return None
    return robot if isinstance(robot, SpatialRobot) and robot.floating else None


IN_SPACE = "They are taken as they are."
IN_PLANE_ONLY = "In the plane only the moment about its normal acts, which is taken as it is."

TOLD = (DIFFERENT, UNLIKELY, NO_MOTORS, NO_CONTACTS)
"""Remarks of the reader that inspection makes by itself."""


def _file(robot: str | os.PathLike[str]) -> Path | None:
    """Path of a robot that comes from a file, None for a built-in robot or where none is."""
    if not isinstance(robot, str | os.PathLike) or robot in builtin_robots():
        return None
    path = Path(os.fspath(robot))
    return path if is_file(path) else None


def _of_inertias(path: Path, how: LoadOptions, *, whole: bool) -> Iterator[Finding]:
    """Inertias that the file states in three dimensions and no body can have; masses of zero."""
    for name, mass, tensor in read_bodies(path, Options(**how)):
        if not mass >= MASSLESS:
            yield Finding(FindingKind.MASS, f"body {name!r} has the mass {mass:g} kg.")
        # Who states no other moment than one means a planar robot.
        planar = np.count_nonzero(tensor) == 1
        if np.all(np.isfinite(tensor)) and not is_possible(tensor) and not planar:
            given = ", ".join(f"{moment:.4g}" for moment in np.linalg.eigvalsh(tensor))
            yield Finding(
                FindingKind.INERTIA,
                f"body {name!r} has the principal moments {given} kg m². No body has: none is "
                "negative, and the sum of two is at least the third. "
                + (IN_SPACE if whole else IN_PLANE_ONLY),
            )


def _of_robot(robot: Robot) -> Iterator[Finding]:
    names = robot.joint_names, robot.link_names
    _, differences = find_mirror(robot.model, *names, robot.feet)
    yield from (Finding(FindingKind.ASYMMETRY, difference) for difference in differences)
    yield from _missing_masses(robot)
    yield from unlikely_numbers(robot.model, link_origins(robot.model), *names)
    yield from _ranges(robot)
    yield from _frictions(robot)
    yield from _soles(robot)


def _missing_masses(robot: Robot) -> Iterator[Finding]:
    """Find massless links that are bodies of their own, and do not only carry a second joint."""
    from heelstrike.robot.files.saving.mjcf import body_links  # brings all that reads files along

    for link in body_links(robot):
        if robot.model.mass[link] == 0.0:
            yield Finding(
                FindingKind.MASS,
                f"link {robot.link_names[link]!r} moves, by joint {robot.joint_names[link]!r}, and "
                "has no mass.",
            )


def _frictions(robot: Robot) -> Iterator[Finding]:
    if not robot.contact_friction:
        return
    by_foot = {
        foot.name: sorted({robot.contact_friction[i] for i in foot.contacts}) for foot in robot.feet
    }
    if len({tuple(values) for values in by_foot.values()}) > 1:
        told = ", ".join(
            f"{name} {' and '.join(f'{value:g}' for value in values)}"
            for name, values in by_foot.items()
        )
        yield Finding(FindingKind.FRICTION, f"{told}.")


def _soles(robot: Robot) -> Iterator[Finding]:
    """Find contact points that cannot touch flat ground together with the rest of their foot."""
    bottoms = _bottoms(robot)
    heights = []
    for foot in robot.feet:
        points = bottoms[list(foot.contacts)]
        heights.append(float(points[:, 1].min()))
        if _is_wheel(points):
            continue
        for contact, height in zip(foot.contacts, points[:, 1] - heights[-1], strict=True):
            if height > LEVEL_SOLE:
                yield Finding(
                    FindingKind.CONTACT,
                    f"{robot.contact_names[contact]} is {1e3 * height:.3g} mm above the sole of "
                    f"{foot.name} as the robot stands in its file.",
                )
    if not robot.feet:
        yield Finding(FindingKind.FOOT, "no link ends a leg and has contact points.")
    if heights and max(heights) - min(heights) > LEVEL_SOLE:
        told = ", ".join(
            f"{foot.name} {height:.4g} m" for foot, height in zip(robot.feet, heights, strict=True)
        )
        yield Finding(
            FindingKind.FOOT, f"the soles are not level as the robot stands in its file: {told}."
        )


def _is_wheel(points: Floats) -> bool:
    """Whether points lie around a link, as spokes do, and not along a sole."""
    return len(points) > 2 and bool(np.ptp(points[:, 1]) > 0.5 * np.ptp(points[:, 0]))


def _bottoms(robot: Robot) -> Floats:
    """Lowest points (x, z) of the contact discs in the reference configuration, (nc, 2)."""
    model = robot.model
    points: Floats = link_origins(model)[model.contact_link] + model.contact_position
    points[:, 1] -= model.contact_radius
    points[np.abs(points) < LEG_ROUNDING] = 0.0
    return points


def _ranges(robot: Robot) -> Iterator[Finding]:
    """Find joints that stand outside their range, as the knees of some robots do at zero."""
    model = robot.model
    for joint, name in enumerate(robot.joint_names):
        low, start, high = model.lower[joint], model.reference[joint], model.upper[joint]
        if not low <= start <= high:
            yield Finding(
                FindingKind.LIMIT,
                f"{name} stands at {start:.4g} in the file, outside its range {low:.4g} … "
                f"{high:.4g}: start a simulation from another state.",
            )


# In words


def _words(robot: Robot | SpatialRobot) -> str:
    if isinstance(robot, Robot):
        return _description(robot)
    from heelstrike.robot.spatial.inspection import spatial_description

    return spatial_description(robot)


def _description(robot: Robot) -> str:
    points = _bottoms(robot)
    lines = [
        f"{robot.name}: {robot.total_mass:.6g} kg, {robot.nv} coordinates, {robot.nu} actuators, "
        f"{robot.nc} contact points",
        "base: " + ("floats (x, z, pitch)" if robot.floating else "does not float as x, z, pitch"),
        f"left and right: {'alike' if robot.mirror is not None else 'not alike, or not named'}",
        f"drives: {_drives(robot)}",
        "",
        *_table(robot),
        "",
        "feet: " + (", ".join(_foot_words(foot, points) for foot in robot.feet) or "none"),
    ]
    if robot.nc:
        lines.append("contact points (x, z of the lowest point as the robot stands in its file)")
        for i, name in enumerate(robot.contact_names):
            radius = f", radius {robot.model.contact_radius[i]:g} m"
            lines.append(
                f"  {name}: {points[i, 0]:.4g}, {points[i, 1]:.4g} m"
                + (radius if robot.model.contact_radius[i] else "")
                + (f", friction {robot.contact_friction[i]:g}" if robot.contact_friction else "")
                + _scale_words(robot, i)
            )
    lines += [f"closed loop: {name}" for name in robot.loop_names]
    lines += [f"coupled: {coupling_words(robot, k)}" for k in range(robot.model.couplings)]
    lines += [f"latch: {latch_words(robot, k)}" for k in range(robot.model.latches)]
    lines += [f"brake: {words}" for words in _brake_words(robot)]
    if robot.locked:
        lines += ["", "locked joints of the file", *_of_locked(robot)]
    return "\n".join(lines)


def _brake_words(robot: Robot) -> Iterator[str]:
    """The joints with a brake, and beyond what it slips."""
    model = robot.model
    for name, joint, limit in zip(
        robot.brake_names, model.brake_joint, model.brake_limit, strict=True
    ):
        unit = "N m" if model.axis[joint, 0] else "N"
        yield name + (f", slips beyond {limit:g} {unit}" if math.isfinite(limit) else "")


def _scale_words(robot: Robot, contact: int) -> str:
    """What the ground's coefficients are multiplied by under a contact point, where not by one."""
    scales = {name: getattr(robot.model, name)[contact] for name in SCALES}
    return "".join(f", {label(name)} {x:g}" for name, x in scales.items() if x != 1.0)


def _drives(robot: Robot) -> str:
    """What moves the joints, in a line."""
    sprung = [robot.joint_names[joint] for joint in np.flatnonzero(robot.model.stiffness)]
    told = f"motors at {robot.nu} joints" if robot.nu else "no motors"
    told += f"; speed-torque lines at {', '.join(_lines(robot))}" if _lines(robot) else ""
    told += f"; springs at {', '.join(sprung)}" if sprung else ""
    return told + ("" if robot.nc else "; no contact points, so it can swing or fly but not stand")


def _lines(robot: Robot) -> list[str]:
    """Joints whose motors have a speed-torque line, with its full voltage if that is known."""
    model, lines = robot.model, []
    for joint in model.actuator_joint[np.isfinite(model.stall_torque[model.actuator_joint])]:
        stall, free = model.stall_torque[joint], model.no_load_speed[joint]
        volts = np.sqrt(model.winding_resistance[joint] * stall * free)
        known = 0.0 < volts < np.inf
        lines.append(robot.joint_names[joint] + (f" ({volts:.3g} V)" if known else ""))
    return lines


def _of_locked(robot: Robot) -> list[str]:
    rows: list[tuple[str, ...]] = [("joint", "moves", "kind", "axis", "at", "why")]
    for one in robot.locked:
        axis = ", ".join(f"{value:.3g}" for value in one.axis) if any(one.axis) else ""
        rows.append((one.name, one.link, one.kind, axis, f"{one.position:.4g}", one.reason))
    return aligned(rows)


def _foot_words(foot: Foot, points: Floats) -> str:
    length = np.ptp(points[list(foot.contacts), 0])
    return f"{foot.name} ({len(foot.contacts)} points, {length:.3g} m long)"


def _table(robot: Robot) -> list[str]:
    headings = [
        ("joint", "moves", "kind", "mass kg", "inertia", "centre m", "range", "torque", "more"),
        ("", "", "", "", "kg m²", "x, z", "rad, m", "N m, N", ""),
    ]
    rows: list[tuple[str, ...]] = [*headings]
    rows += [_row(robot, joint, indent) for joint, indent in tree(robot.model.parent)]
    return aligned(rows)


def aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Lines of a table, its columns as wide as they need be."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def tree(parents: Integers) -> Iterator[tuple[int, str]]:
    """Joints in the order of the tree, each with the lines that lead to it."""
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(parents.tolist()):
        children.setdefault(parent, []).append(joint)
    # A stack, since a chain may be longer than Python recurses.
    stack = [(joint, "", "") for joint in reversed(children.get(-1, []))]
    while stack:
        joint, lead, below = stack.pop()
        yield joint, lead
        own = children.get(joint, [])
        for child in reversed(own):
            branch, line = ("└ ", "  ") if child == own[-1] else ("├ ", "│ ")
            if len(own) == 1:
                branch = line = ""  # a chain needs no lines
            stack.append((child, below + branch, below + line))


_MORE = {"stiffness": "spring", "speed_limit": "speed"}
"""Short words for numbers of joints that are shown where there are any."""


def _row(robot: Robot, joint: int, indent: str) -> tuple[str, ...]:
    model = robot.model
    turn = model.axis[joint, 0]
    kind = (
        f"hinge {'+' if turn > 0 else '-'}y"
        if turn
        else f"slide {model.axis[joint, 1] + 0.0:.3g}, {model.axis[joint, 2] + 0.0:.3g}"
    )
    mass = model.mass[joint]
    driven = np.flatnonzero(model.actuator_joint == joint)
    extra = [
        f"{_MORE.get(name, label(name))} {getattr(model, name)[joint]:.4g}"
        for name, number in PROPERTIES.items()
        if number.shape == ("nv",) and getattr(model, name)[joint] != number.default
    ]
    center = model.center_of_mass[joint] + 0.0
    return (
        indent + robot.joint_names[joint],
        robot.link_names[joint],
        kind,
        f"{mass:.5g}" if mass else "",
        f"{model.inertia[joint]:.4g}" if mass else "",
        f"{center[0]:.4g}, {center[1]:.4g}" if mass else "",
        span(model.lower[joint], model.upper[joint]),
        span(model.torque_lower[driven[0]], model.torque_upper[driven[0]]) if len(driven) else "",
        ", ".join(extra),
    )


def span(low: float, high: float) -> str:
    """Write a range."""
    if np.isinf(low) and np.isinf(high):
        return "free"
    if low == -high:
        return f"± {high:.4g}"
    return f"{low:.4g} … {high:.4g}"


def facts(inspection: Inspection) -> dict[str, Any]:
    """Return an inspection as plain numbers and words, for JSON. Infinity becomes None."""
    robot = inspection.robot
    result: dict[str, Any] = {
        "source": inspection.source,
        "loadable": inspection.loadable,
        "findings": [
            {"kind": found.kind.value, "message": found.message} for found in inspection.findings
        ],
    }
    if robot is None:
        return result
    if isinstance(robot, SpatialRobot):
        from heelstrike.robot.spatial.inspection import spatial_facts

        return result | spatial_facts(robot)
    return {
        **result,
        "name": robot.name,
        "mass_kg": robot.total_mass,
        "floating": robot.floating,
        "symmetric": robot.mirror is not None,
        "coordinates": list(robot.joint_names),
        **facts_of_parts(robot),
        "locked": [asdict(one) for one in robot.locked],
        "loops": list(robot.loop_names),
        "couplings": [coupling_words(robot, k) for k in range(robot.model.couplings)],
        "latches": [latch_words(robot, k) for k in range(robot.model.latches)],
        "brakes": list(robot.brake_names),
        "brake_limits": _finite_or_none(robot.model.brake_limit),
        **facts_of_joints(robot, NUMBERS),
    }


def facts_of_parts(robot: NamedTree) -> dict[str, Any]:
    """Return the links, actuators, contact points and feet of a robot, for JSON."""
    model = robot.model
    return {
        "links": list(robot.link_names),
        "parent": model.parent.tolist(),
        "link_mass_kg": model.mass.tolist(),
        "link_inertia_kg_m2": model.inertia.tolist(),
        "link_center_of_mass_m": model.center_of_mass.tolist(),
        "actuators": list(robot.actuator_names),
        "contact_points": list(robot.contact_names),
        **{name: getattr(model, name).tolist() for name in SCALES},
        "feet": [foot.name for foot in robot.feet],
    }


def facts_of_joints(robot: NamedTree, numbers: Mapping[str, Number]) -> dict[str, Any]:
    """Return the numbers of the joints of a robot, for JSON. Infinity becomes None."""
    return {
        name: _finite_or_none(getattr(robot.model, name))
        for name, number in numbers.items()
        if number.shape in (("nq",), ("nv",), ("nu",), ("nj",)) and number.kind is float
    }


def _finite_or_none(values: Floats) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
