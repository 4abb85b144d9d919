"""What a robot in space consists of, in words and numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import HINGE, SLIDE, JointKind
from heelstrike.robot.spatial.robot import SpatialRobot

HEADINGS = ("joint", "moves", "kind", "mass kg", "inertia kg m²", "range rad, m", "torque N m, N")


def spatial_text(robot: SpatialRobot) -> str:
    """Return the tree of a robot in space as a table, and what it meets the ground with."""
    feet = ", ".join(f"{foot.name} ({len(foot.contacts)} points)" for foot in robot.feet)
    lines = [
        f"{robot.name}: {robot.total_mass:.4g} kg, {robot.nq} positions, {robot.nv} velocities, "
        f"{robot.nu} actuators, {robot.nc} contact points, in space",
        f"feet: {feet or 'none'}",
        f"trunk: {'floats' if robot.floating else 'does not float'}",
        "",
    ]
    rows = [HEADINGS, *(_row(robot, joint) for joint in range(robot.nj))]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEADINGS))]
    lines += [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def _depth(robot: SpatialRobot, joint: int) -> int:
    """How many joints that several others hang on are above a joint: how far it is indented."""
    parent = robot.model.parent
    depth, above = 0, int(parent[joint])
    while above >= 0:
        depth += int(np.count_nonzero(parent == above) > 1)
        above = int(parent[above])
    return depth


def _row(robot: SpatialRobot, joint: int) -> tuple[str, ...]:
    model = robot.model
    kind = int(model.joint_kind[joint])
    word = JointKind(kind).name.lower()
    if kind in (HINGE, SLIDE):
        axis = ", ".join(f"{value:.3g}" for value in (model.axis[joint] + 0.0).round(6))
        word = f"{word} {axis}"
    first = int(model.first_velocity[joint])
    count = JointKind(kind).velocities
    driven = np.flatnonzero(
        (model.actuator_velocity >= first) & (model.actuator_velocity < first + count)
    )
    mass = float(model.mass[joint])
    inertia = ", ".join(f"{value:.3g}" for value in model.inertia[joint, :3])
    return (
        "  " * _depth(robot, joint) + robot.joint_names[joint],
        robot.link_names[joint],
        word,
        f"{mass:.4g}" if mass else "",
        inertia if mass else "",
        _span(model.lower[joint], model.upper[joint]) if kind in (HINGE, SLIDE) else "",
        _span(model.torque_lower[driven[0]], model.torque_upper[driven[0]]) if len(driven) else "",
    )


def _span(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "free"
    return f"± {high:.4g}" if low == -high else f"{low:.4g} … {high:.4g}"


def spatial_facts(robot: SpatialRobot) -> dict[str, Any]:
    """Return what a robot in space consists of as plain numbers and words; infinity is None."""
    model = robot.model

    def plain(values: Floats) -> list[float | None]:
        return [value if math.isfinite(value) else None for value in values.tolist()]

    return {
        "source": robot.source,
        "name": robot.name,
        "dimension": 3,
        "mass_kg": robot.total_mass,
        "floating": robot.floating,
        "positions": list(robot.position_names),
        "velocities": list(robot.velocity_names),
        "joints": list(robot.joint_names),
        "kinds": [JointKind(kind).name.lower() for kind in model.joint_kind.tolist()],
        "links": list(robot.link_names),
        "parent": model.parent.tolist(),
        "link_mass_kg": model.mass.tolist(),
        "link_inertia_kg_m2": model.inertia.tolist(),
        "link_center_of_mass_m": model.center_of_mass.tolist(),
        "lower": plain(model.lower),
        "upper": plain(model.upper),
        "armature": model.armature.tolist(),
        "damping": model.damping.tolist(),
        "actuators": list(robot.actuator_names),
        "torque_lower": plain(model.torque_lower),
        "torque_upper": plain(model.torque_upper),
        "contact_points": list(robot.contact_names),
        "feet": [foot.name for foot in robot.feet],
    }
