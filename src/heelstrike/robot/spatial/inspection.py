"""What a robot in space consists of, in words and as data."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from heelstrike.robot.inspection import aligned, facts_of_joints, facts_of_parts, span, tree
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import FREE, HINGE, SLIDE, SPATIAL_NUMBERS, JointKind
from heelstrike.robot.spatial.robot import SpatialRobot

_MORE = {
    "armature": "armature",
    "damping": "damping",
    "dry_friction": "dry friction",
    "speed_limit": "speed",
    "stall_torque": "stall torque",
    "no_load_speed": "no-load speed",
}
"""Numbers of joints that are shown where there are any, and how they are called."""


def spatial_description(robot: SpatialRobot) -> str:
    """Return a robot in words: tree, masses, limits, feet and contact points of every link."""
    model = robot.model
    free = sum(kind == FREE for kind in model.joint_kind.tolist())
    lines = [
        f"{robot.name}: {robot.total_mass:.6g} kg, in space, {robot.nq} positions, {robot.nv} "
        f"velocities, {robot.nu} actuators, {robot.nc} contact points",
        "base: " + ("moves freely" if robot.floating else "is held"),
    ]
    if free > 1:
        lines.append(f"{free} bodies move freely")
    if not robot.nc:
        lines.append("no contact points, so it can swing or fly but not stand")
    headings = [
        (
            "joint",
            "moves",
            "kind",
            "mass kg",
            "inertia kg m²",
            "centre m",
            "range",
            "torque",
            "more",
        ),
        ("", "", "", "", "about x, y, z", "x, y, z", "rad, m", "N m, N", ""),
    ]
    rows: list[tuple[str, ...]] = [*headings]
    rows += [_row(robot, joint, lead) for joint, lead in tree(model.parent)]
    feet = [f"{foot.name} ({len(foot.contacts)} points)" for foot in robot.feet]
    lines += ["", *aligned(rows), "", "feet: " + (", ".join(feet) or "none")]
    if robot.nc:
        lines.append("contact points (links, how many, how far they reach from the joint)")
        for link in np.flatnonzero(np.diff(model.first_contact)).tolist():
            lines.append(f"  {robot.link_names[link]}: {_point_words(robot, link)}")
    return "\n".join(lines)


def _row(robot: SpatialRobot, joint: int, lead: str) -> tuple[str, ...]:
    model = robot.model
    kind = int(model.joint_kind[joint])
    mass = float(model.mass[joint])
    own = range(model.first_velocity[joint], model.last_velocity[joint] + 1)
    driven = np.flatnonzero(np.isin(model.actuator_velocity, list(own)))
    limits = (HINGE, SLIDE)
    return (
        lead + robot.joint_names[joint],
        robot.link_names[joint],
        _kind(kind, model.axis[joint]),
        f"{mass:.5g}" if mass else "",
        _numbers(model.inertia[joint, :3]) if mass else "",
        _numbers(model.center_of_mass[joint]) if mass else "",
        span(model.lower[joint], model.upper[joint]) if kind in limits else _cone(robot, joint),
        span(model.torque_lower[driven[0]], model.torque_upper[driven[0]]) if len(driven) else "",
        ", ".join(_extra(robot, joint, list(own))),
    )


def _kind(kind: int, axis: Floats) -> str:
    name = JointKind(kind).name.lower()
    return f"{name} {_numbers(axis)}" if kind in (HINGE, SLIDE) else name


def _cone(robot: SpatialRobot, joint: int) -> str:
    most = float(robot.model.upper[joint])
    return "free" if math.isinf(most) else f"up to {most:.4g}"


def _numbers(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values + 0.0)


def _extra(robot: SpatialRobot, joint: int, own: list[int]) -> list[str]:
    """What a joint has that most have not; of several velocities the largest."""
    model = robot.model
    found = []
    if model.stiffness[joint]:
        found.append(f"spring {model.stiffness[joint]:.4g}")
    for name, words in _MORE.items():
        values = getattr(model, name)[own]
        given = values[np.isfinite(values) & (values != 0.0)]
        if len(given):
            found.append(f"{words} {given.max():.4g}")
    return found


def _point_words(robot: SpatialRobot, link: int) -> str:
    model = robot.model
    own = slice(int(model.first_contact[link]), int(model.first_contact[link + 1]))
    rims = int(np.count_nonzero(model.contact_rim[own]))
    count = own.stop - own.start
    radii = np.unique(model.contact_radius[own])
    words = f"{count}, {model.reach[link]:.3g} m"
    words += f", {rims} of them rims" if rims else ""
    return words + (f", radius {', '.join(f'{each:g}' for each in radii)} m" if radii.any() else "")


def spatial_facts(robot: SpatialRobot) -> dict[str, Any]:
    """Return a robot as plain numbers and words, for JSON. Infinity becomes None."""
    model = robot.model
    return {
        "name": robot.name,
        "dimension": 3,
        "mass_kg": robot.total_mass,
        "floating": robot.floating,
        "joints": list(robot.joint_names),
        "joint_kinds": [JointKind(kind).name.lower() for kind in model.joint_kind.tolist()],
        "joint_axes": model.axis.tolist(),
        "positions": list(robot.position_names),
        "velocities": list(robot.velocity_names),
        **facts_of_parts(robot),
        **facts_of_joints(robot, SPATIAL_NUMBERS),
    }
