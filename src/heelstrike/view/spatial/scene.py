"""What ``space.js`` draws: what of a robot does not change, what moves, and curves over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from heelstrike.analysis.spatial.friction import face_friction
from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.robot.model import Floats
from heelstrike.robot.named_tree import legs
from heelstrike.robot.spatial.model import HINGE, SLIDE
from heelstrike.robot.spatial.robot import SpatialRobot, quaternion_places
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.page.curves import DASHED, Plot, Trace, alike, side_of
from heelstrike.view.page.rows import Rows
from heelstrike.view.page.scene import DIGITS
from heelstrike.view.spatial.body import SpatialBody, body_in_space
from heelstrike.view.spatial.forces import (
    force_groups,
    group_names,
    middle_of_pressure,
    shown_forces,
)
from heelstrike.view.spatial.stage import corners_of_boxes
from heelstrike.view.style import in_words, limits_in_words

MOST_EDGES = 16
"""Corners of a support polygon that a page shows; of more every second or third."""


def scene_in_space(robot: SpatialRobot, ground: SpatialGround) -> dict[str, Any]:
    """Describe a robot in space and its ground in numbers and names that JSON has.

    Its members are those that ``space.js`` lists.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    ground : SpatialGround
        What it moves on.
    """
    body = body_in_space(robot)
    model = robot.model
    foot_of = {i: index for index, foot in enumerate(robot.feet) for i in foot.contacts}
    normal = np.asarray(ground.normal, dtype=np.float64)
    places = corners_of_boxes(ground)
    return {
        "dimension": 3,
        "robot": robot.name,
        "tree": {
            "parent": model.parent.tolist(),
            "kind": model.joint_kind.tolist(),
            "first": model.first_position.tolist(),
            **{
                name: np.round(getattr(model, name), 2 * DIGITS).tolist()
                for name in ("axis", "offset", "turn", "reference")
            },
        },
        "solids": _solids(body, robot.nl),
        "contacts": [
            {"name": in_words(name), "foot": foot_of.get(int(group[0]), -1)}
            for name, group in zip(group_names(robot), force_groups(robot), strict=True)
        ],
        "feet": [{"name": in_words(foot.name)} for foot in robot.feet],
        "size": round(body.size, DIGITS),
        "highest": round(body.size, DIGITS),
        "weight": float(robot.weight),
        "ground": {
            "normal": (normal / np.linalg.norm(normal)).tolist(),
            "height": float(ground.height),
            "boxes": np.round(places.reshape(-1, 24), DIGITS).tolist(),
        },
    }


def _solids(body: SpatialBody, links: int) -> list[dict[str, Any]]:
    """Corners and triangles link by link."""
    found = []
    owner = body.link[body.faces[:, 0]] if len(body.faces) else np.zeros(0, dtype=np.int64)
    for link in range(links):
        own = np.flatnonzero(body.link == link)
        faces = np.flatnonzero(owner == link)
        if not len(faces):
            continue
        place = np.zeros(len(body.corners), dtype=np.int64)
        place[own] = np.arange(len(own))
        found.append(
            {
                "link": link,
                "foot": int(body.foot[faces[0]]),
                "corners": np.round(body.corners[own], 4).ravel().tolist(),
                "faces": place[body.faces[faces]].ravel().tolist(),
            }
        )
    return found


def moving_columns(run: SpatialRun, rows: Rows) -> dict[str, Floats]:
    """Return what ``space.js`` draws in each row shown, by the names that it has there."""
    motion, found = link_motion(run, rows), spatial_zero_moment_point(run, rows)
    forces = shown_forces(run, rows)
    floor = 1e-6 * max(run.robot.weight, 1e-300)
    pressed = forces.normal > floor
    friction = face_friction(run, rows)
    columns = {
        "position": _continuous(run, rows),
        "center": motion.center_of_mass,
        "capture": found.capture_point,
        "pressure": middle_of_pressure(forces, run.robot.weight),
        "support": polygon_table(found.polygon),
    }
    for i, group in enumerate(force_groups(run.robot)):
        ever = pressed[:, i]
        columns[f"place {i}"] = np.where(ever[:, None], forces.place[:, i], np.nan)
        columns[f"force {i}"] = np.where(ever[:, None], forces.force[:, i], 0.0)
        columns[f"normal {i}"] = run.contact_normal[rows, group[0]]
        columns[f"friction {i}"] = friction[:, group[0]]
    return columns


def _continuous(run: SpatialRun, rows: Rows) -> Floats:
    """Positions in which quaternions do not change their sign, which means nothing."""
    position = run.position[rows].copy()
    for first in quaternion_places(run.robot.model):
        each = position[:, first : first + 4]
        same = np.where((each[1:] * each[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
        position[1:, first : first + 4] *= np.cumprod(same)[:, None]
    return position


def polygon_table(polygons: tuple[Floats, ...], least: int = 0) -> Floats:
    """Corners of all polygons as one table (n, 3 k), NaN behind the last; k ≥ `least`."""
    fewer = [each[:: -(-len(each) // MOST_EDGES) or 1] for each in polygons]
    most = max((len(each) for each in fewer), default=0)
    table = np.full((len(fewer), max(most, least, 1), 3), np.nan)
    for row, corners in enumerate(fewer):
        table[row, : len(corners)] = corners
    return table.reshape(len(fewer), -1)


def spatial_plots(run: SpatialRun, rows: Rows) -> list[Plot]:
    """Make the panels of a run in space: feet, centre of mass, joints, torques."""
    return [*_feet(run, rows), *_center(run, rows), *_joints(run, rows)]


def _feet(run: SpatialRun, rows: Rows) -> list[Plot]:
    robot = run.robot
    if not robot.nc:
        return []
    forces = shown_forces(run, rows)
    groups = force_groups(robot)
    feet = robot.feet
    traces = []
    for i, foot in enumerate(feet):
        own = [g for g, group in enumerate(groups) if int(group[0]) in foot.contacts]
        total = forces.normal[:, own].sum(axis=1)
        traces.append(Trace(total, in_words(foot.name), i, i and DASHED))
    if not feet:
        traces.append(Trace(forces.normal.sum(axis=1), "robot"))
    found = spatial_zero_moment_point(run, rows)
    usual = np.concatenate([each.values for each in traces if each.values is not None])
    top = max(1.3 * robot.weight, 1.15 * float(np.quantile(usual, 0.97)))
    return [
        Plot(
            "normal force", "N", traces, [("weight", robot.weight)],
            span=(-0.05 * top, top) if top > 0.0 else None, steps=True, group="feet",
        ),
        Plot(
            "zero moment point inside the support polygon", "m", [Trace(found.margin, "")],
            [("edge", 0.0)], group="feet",
        ),
    ]  # fmt: skip


def _center(run: SpatialRun, rows: Rows) -> list[Plot]:
    motion = link_motion(run, rows)
    axes = ("x", "y", "z")
    return [
        Plot(
            "centre of mass since the start", "m",
            [
                Trace((motion.center_of_mass - motion.center_of_mass[:1])[:, k], axes[k], -1, 0, k)
                for k in range(3)
            ],
            group="centre of mass",
        ),
        Plot(
            "velocity of the centre of mass", "m/s",
            [Trace(motion.center_of_mass_velocity[:, k], axes[k], -1, 0, k) for k in range(3)],
            group="centre of mass",
        ),
    ]  # fmt: skip


def _joints(run: SpatialRun, rows: Rows) -> list[Plot]:
    return joint_plots(
        run.robot,
        lambda place: {"values": run.position[rows, place]},
        lambda motor: {"values": run.torque[rows, motor]},
    )


Numbers = Callable[[int], dict[str, Any]]


def joint_plots(
    robot: SpatialRobot, position: Numbers, torque: Numbers, *, limited: bool = False
) -> list[Plot]:
    """Make the panels of what motors drive, left and right together.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    position, torque : callable
        Return the numbers of a position and of a motor, as a `Trace` has them, by their indices.
    limited : bool
        Whether limits of the torques are drawn.
    """
    model = robot.model
    if not robot.nu:
        return []
    joint = model.velocity_joint[model.actuator_velocity]
    leg = legs(robot)[joint]
    names = [
        in_words(robot.velocity_names[k]).removesuffix(" joint")
        for k in model.actuator_velocity.tolist()
    ]
    place = model.first_position[joint].tolist()
    kind = model.joint_kind[joint]
    found = []
    for name, several in alike(names, np.arange(robot.nu)).items():
        look: dict[int, dict[str, Any]] = {
            i: {"label": side_of(names[i]), "foot": int(leg[i]), "dash": n}
            for n, i in enumerate(several)
        }
        if len(several) == 1:
            look[several[0]]["label"] = ""  # the title says it
        if all(kind[several] >= SLIDE):
            unit = "rad" if kind[several[0]] == HINGE else "m"
            traces = [Trace(**{"values": None} | position(place[i]) | look[i]) for i in several]
            found.append(Plot(name, unit, traces, group="joints"))
        unit = "N" if kind[several[0]] == SLIDE else "N m"
        traces = [Trace(**{"values": None} | torque(i) | look[i]) for i in several]
        ends = np.array([(model.torque_lower[i], model.torque_upper[i]) for i in several])
        levels = [float(level) for level in np.unique(ends[np.isfinite(ends)])] if limited else []
        found.append(Plot(
            f"{name} torque", unit, traces, [("limit", level) for level in levels], steps=True,
            note=limits_in_words(levels), group="torques",
        ))  # fmt: skip
    return found
