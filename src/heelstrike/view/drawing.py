"""The shape of a robot as line segments: what figures, animations and portraits are made of.

A robot is drawn by the outlines of its links (`Robot.outlines`). Links without outlines, and the
drawings of a terminal, are made from the tree alone: a bone from every link to the links it
carries, a sole through the contact points (or spokes to them, where they lie around the joint), and
a bone to twice the distance of the centre of mass where a link ends, so that a trunk has a height.
Massless links, the carriers of a floating base, are not drawn.
"""

from __future__ import annotations

import enum
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from heelstrike.analysis.motion import in_world
from heelstrike.contact.ground import Ground
from heelstrike.dynamics import LinkPoses, link_poses
from heelstrike.errors import ViewError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import NamedTree, legs
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import are_around
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.push import Push
from heelstrike.tolerances import NO_BONE
from heelstrike.view.bars import bars
from heelstrike.view.style import (
    FORCE_COLOR,
    INK,
    ORANGE,
    PALE,
    foot_color,
    in_words,
    legend_above,
    new_figure,
    save_figure,
    styled,
)

Bone = tuple[int, Floats, int, Floats, float]  # link, place, link, place, width

DISC_CORNERS = 16
THICKEST = 15.0  # points, of a bone that has the whole mass
THINNEST = 2.5
DISC_WIDTH = 1.2
RIM_WIDTH = 0.6  # of the light line round an outline
WIDTH_SHARE = 0.74  # of the height of a portrait that the robot may take in width
PUSH_LENGTH = 0.15  # of the size of a portrait
LEGS_APART = 0.3  # rad that each leg of a portrait is turned at its root


class Side(enum.IntEnum):
    """Where a bone is, in the order of drawing: the viewer stands to the robot's right."""

    FAR = 0
    MIDDLE = 1
    NEAR = 2


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Line segments fixed to the links of a robot."""

    link: Integers
    """(ns, 2) Link of each end of each segment."""
    local: Floats
    """(ns, 2, 2) Place (x, z) of each end in the frame of its link, in m."""
    width: Floats
    """(ns,) Line width in points."""
    side: Integers
    """(ns,) `Side` of each segment."""
    foot: Integers
    """(ns,) Index of the foot at the end of the segment's leg, -1 for the trunk."""
    pieces: tuple[slice, ...] = ()
    """Segments that go round an outline, or are a bone, in the order of drawing; empty where all
    are bones."""

    @property
    def colors(self) -> list[str]:
        """Colour of each segment: legs as their feet, the rest dark."""
        return [foot_color(foot) for foot in self.foot]

    def segments(self, origin: Floats, angle: Floats) -> Floats:
        """Place the segments in the world.

        Parameters
        ----------
        origin : (..., nv, 2) float
            Positions of the link frames, in m.
        angle : (..., nv) float
            Rotations of the links about +y, in rad.

        Returns
        -------
        (..., ns, 2, 2) float
            Segments, ends, (x, z).
        """
        return in_world(origin[..., self.link, :], angle[..., self.link], self.local)

    def drawn(self, segments: Floats, scale: float = 1.0) -> LineCollection | PolyCollection:
        """What to draw, from segments (ns, 2, 2) in the world and a factor of all widths."""
        if not self.pieces:
            return LineCollection(
                list(segments),
                colors=self.colors,
                linewidths=scale * self.width,
                capstyle="round",
                zorder=3,
            )
        first = [piece.start for piece in self.pieces]
        colors = [self.colors[i] for i in first]
        bone = [piece.stop - piece.start == 1 for piece in self.pieces]
        return PolyCollection(
            self._corners(segments),
            facecolors=colors,
            edgecolors=[c if thin else "white" for c, thin in zip(colors, bone, strict=True)],
            linewidths=scale * self.width[first],
            joinstyle="round",
            zorder=3,
        )

    def move(self, drawn: LineCollection | PolyCollection, segments: Floats) -> None:
        """Move what was drawn to other segments."""
        if isinstance(drawn, LineCollection):
            drawn.set_segments(list(segments))
        else:
            drawn.set_verts(self._corners(segments))

    def _corners(self, segments: Floats) -> list[Floats]:
        if not len(segments):
            return []
        return [
            segments[piece, 0] if piece.stop - piece.start > 1 else segments[piece.start]
            for piece in self.pieces
        ]


def body(robot: Robot) -> Skeleton:
    """Make what a robot is drawn by: outlines, and bones of the links that have none.

    A foot whose outlines do not reach up to its ankle has both; other outlines that stand apart
    from each other or from the joints are connected by bars.
    """
    bones = skeleton(robot)
    if not robot.outlines:
        return bones
    shaped = {outline.link for outline in robot.outlines}
    hanging = {foot.link for foot in robot.feet if not _reaches_joint(robot, foot.link)}
    shaped -= hanging
    side = _sides(robot)
    parts = [
        (bones.link[i : i + 1], bones.local[i : i + 1], float(bones.width[i]))
        for i, link in enumerate(bones.link[:, 0])
        if int(link) not in shaped
    ]
    joining = [bar for bar in bars(robot) if bar.link not in hanging]
    for outline in (*joining, *robot.outlines):
        rim = outline.rim()
        edges = np.stack((rim, np.roll(rim, -1, axis=0)), axis=1)
        parts.append((np.full((len(rim), 2), outline.link), edges, RIM_WIDTH))
    parts.sort(key=lambda part: side[part[0][0, 0]])
    ends = np.cumsum([len(links) for links, _, _ in parts]).tolist()
    links = np.concatenate([links for links, _, _ in parts])
    return Skeleton(
        link=links,
        local=np.concatenate([local for _, local, _ in parts]),
        width=np.concatenate([np.full(len(links), width) for links, _, width in parts]),
        side=side[links[:, 0]],
        foot=legs(robot)[links[:, 0]],
        pieces=tuple(slice(start, end) for start, end in pairwise((0, *ends))),
    )


def _reaches_joint(robot: Robot, link: int) -> bool:
    """Whether the outlines of a link go round its joint, the origin of its axes."""
    rims = [outline.rim() for outline in robot.outlines if outline.link == link]
    return any(np.all((rim.min(axis=0) <= 0.0) & (rim.max(axis=0) >= 0.0)) for rim in rims)


def skeleton(robot: Robot) -> Skeleton:
    """Make the line segments of a robot, those in front last."""
    model = robot.model
    reference = link_poses(robot, model.reference).origin
    share = np.cbrt(model.mass / max(robot.total_mass, 1e-12))
    width = np.maximum(THINNEST, THICKEST * share)
    side = _sides(robot)
    massive = np.flatnonzero(model.mass).tolist()
    bones = [bone for i in massive for bone in _bones(robot, i, reference, float(width[i]))]
    bones.sort(key=lambda bone: side[bone[0]])
    links = np.array([(a, b) for a, _, b, _, _ in bones], dtype=np.int64).reshape(-1, 2)
    return Skeleton(
        link=links,
        local=np.array([(p, r) for _, p, _, r, _ in bones], dtype=np.float64).reshape(-1, 2, 2),
        width=np.array([bone[4] for bone in bones], dtype=np.float64),
        side=side[links[:, 0]],
        foot=legs(robot)[links[:, 0]],
    )


def _bones(robot: Robot, link: int, reference: Floats, width: float) -> list[Bone]:
    """Bones of a link that has a mass."""
    model = robot.model
    center, nowhere = model.center_of_mass[link], np.zeros(2)
    # The frame of a slide may be anywhere; that of a hinge is on the link.
    home = nowhere if model.axis[link, 0] != 0.0 else center
    children = np.flatnonzero(model.parent == link)
    joints = reference[children] - reference[link]
    if _is_trunk(robot, link, joints):
        end = 2.0 * center - joints[0]
        return [(link, joints[0], link, end, width)] if _apart(center, joints[0]) else []
    bones: list[Bone] = [
        (link, home, int(child), nowhere, width)
        for child, place in zip(children, joints, strict=True)
        if _apart(place, home)
    ]
    contacts = np.flatnonzero(model.contact_link == link)
    points = model.contact_position[contacts]
    thickness = width
    if bones:
        lines = [(home, p) for p in points if all(_apart(p, end) for end in (home, *joints))]
    elif are_around(points):
        lines, thickness = [(home, p) for p in points], THINNEST
    else:
        lines = _outline(points)
    bones += [(link, start, link, end, thickness) for start, end in lines]
    for point, radius in zip(points, model.contact_radius[contacts], strict=True):
        if radius > NO_BONE:
            rim = _disc(point, float(radius))
            bones += [(link, start, link, end, DISC_WIDTH) for start, end in rim]
    if not bones and _apart(center, home):
        bones = [(link, nowhere, link, 2.0 * center, width)]
    return bones


def _apart(a: Floats, b: Floats) -> bool:
    return bool(np.hypot(*(a - b)) > NO_BONE)


def _is_trunk(robot: Robot, link: int, joints: Floats) -> bool:
    """Whether a link floats and carries all its children in one place, its hip.

    It is drawn from there to as far beyond its centre of mass; its frame may be anywhere.
    """
    model = robot.model
    parent = model.parent[link]
    return bool(
        parent >= 0
        and model.mass[parent] == 0.0
        and len(joints) > 0
        and np.ptp(joints, axis=0).max() <= NO_BONE
        and link not in model.contact_link
    )


def _outline(points: Floats) -> list[tuple[Floats, Floats]]:
    """Closed line from a link's origin through its contact points, or a line to the only one."""
    if not len(points):
        return []
    corners = [np.zeros(2), *points]
    if len(points) > 1:
        corners.append(np.zeros(2))
    return [(a, b) for a, b in pairwise(corners) if _apart(a, b)]


def _disc(center: Floats, radius: float) -> list[tuple[Floats, Floats]]:
    turn = np.linspace(0.0, 2.0 * np.pi, DISC_CORNERS + 1)
    rim = center + radius * np.column_stack((np.cos(turn), np.sin(turn)))
    return list(pairwise(rim))


def leg_labels(robot: NamedTree) -> list[tuple[str, str]]:
    """Colours of the legs with the names of their feet; none for a robot of one leg."""
    if len(robot.feet) < 2:
        return []
    return [(foot_color(i), in_words(foot.name)) for i, foot in enumerate(robot.feet)]


def _sides(robot: Robot) -> Integers:
    """Near and far links. Of two mirrored ones the left one, or else the later one, is far."""
    side = np.full(robot.nv, int(Side.MIDDLE))
    if robot.mirror is None:
        return side
    for link, other in enumerate(robot.mirror.joint):
        if link == other:
            continue
        first, second = (_says_left(robot, int(i)) for i in (link, other))
        far = first if first != second else link > other
        side[link] = Side.FAR if far else Side.NEAR
    return side


def _says_left(robot: Robot, link: int) -> bool:
    return "left" in f"{robot.joint_names[link]} {robot.link_names[link]}".lower()


def robot_picture(
    robot: Robot | SpatialRobot,
    path: str | os.PathLike[str],
    *,
    ground: Ground | None = None,
    pushes: Sequence[Push] = (),
) -> Path:
    """Write a portrait of a robot, standing as in its file but with its legs apart.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot. One in space stands as in its file, without pushes, on level ground.
    path : str or path
        Picture to write: .png, .pdf or .svg.
    ground : Ground, optional
        Ground on which it stands instead, as :meth:`heelstrike.Robot.standing` puts it there.
    pushes : sequence of Push
        Pushes to draw, as arrows that end at what they push.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ViewError
        If the file cannot be written, or a robot in space has a ground or pushes.
    RobotError
        If there is a ground, and the robot cannot stand on any.
    SimulationError
        If the robot has no such link as is pushed.
    """
    if isinstance(robot, SpatialRobot):
        from heelstrike.view.spatial.portrait import portrait_in_space

        if ground is not None or pushes:
            raise ViewError("ground and pushes are drawn with robots in the plane only")
        return portrait_in_space(robot, path)
    model = robot.model
    q = legs_apart(robot) if ground is None else robot.standing(ground).q
    poses = link_poses(robot, q)
    if ground is None and robot.floating and robot.nc:  # stand on z = 0
        q[1] -= standing_height(robot, q)
        poses = link_poses(robot, q)
    shape = body(robot)
    segments = shape.segments(poses.origin, poses.angle)
    low, high = extent(segments)
    width, height = high - low
    size = max(float(height), float(width) / WIDTH_SHARE, 1e-3)
    with styled():
        page = new_figure(4.6, 5.8)
        axes = page.add_subplot()
        axes.add_collection(shape.drawn(segments))
        massive = np.flatnonzero(model.mass > 0.0)
        joints = [i for i in massive if model.axis[i, 0] != 0.0 and model.parent[i] >= 0]
        points = _contact_bottoms(robot, poses.origin, poses.angle)
        marks: dict[str, tuple[Floats, str, dict[str, Any]]] = {
            "joint": (poses.origin[joints], "o", {"color": "white", "mec": INK, "zorder": 5}),
            "centre of mass": (
                poses.center_of_mass[massive], "P", {"color": ORANGE, "mec": "white", "ms": 7}
            ),
            "contact point": (points, "^", {"color": INK}),
        }  # fmt: skip
        for label, (places, marker, look) in marks.items():
            if len(places):
                axes.plot(*places.T, marker, label=label, **({"ms": 5, "zorder": 6} | look))
        middle = 0.5 * float(low[0] + high[0])
        left, right = middle - 0.42 * size, middle + 0.42 * size
        if ground is None:
            height = float(points[:, 1].min()) if len(points) else float(low[1])
            surface = np.array([[left, height], [right, height]])
        else:
            surface = ground.outline(left, right)
        bottom = float(surface[:, 1].min()) - 0.06 * size
        axes.fill_between(surface[:, 0], surface[:, 1], bottom, color=PALE, lw=0.0, zorder=0)
        _draw_pushes(axes, robot, poses, pushes, size)
        axes.set(
            xlim=(left, right),
            ylim=(bottom, high[1] + 0.06 * size),
            xlabel="x (m)",
            ylabel="z (m)",
            aspect="equal",
        )
        page.suptitle(
            f"{robot.name}: {robot.total_mass:.4g} kg,\n"
            f"{robot.nv} coordinates, {robot.nu} actuators"
        )
        legend_above(axes)
        return save_figure(page, path)


def _draw_pushes(
    axes: Axes, robot: Robot, poses: LinkPoses, pushes: Sequence[Push], size: float
) -> None:
    """Draw pushes as arrows of one length that end where they act, with their forces."""
    for push in pushes:
        link, place = push.place(robot)
        x, z = in_world(poses.origin[link], poses.angle[link], np.array(place)).tolist()
        strength = float(np.linalg.norm(push.force))
        along = (np.array(push.force) / (strength or 1.0)).tolist()
        arrow = {"arrowstyle": "-|>", "color": FORCE_COLOR, "lw": 2.0}
        axes.annotate(
            f"{strength:.4g} N",
            (x, z),
            xytext=(x - PUSH_LENGTH * size * along[0], z - PUSH_LENGTH * size * along[1]),
            arrowprops=arrow,
            color=FORCE_COLOR,
            ha="right" if along[0] > 0.0 else "left",
            va="center",
            zorder=7,
        )


def legs_apart(robot: Robot) -> Floats:
    """Reference configuration with two legs spread, so that both are seen, feet level."""
    model = robot.model
    q = model.reference.copy()
    if len(robot.feet) != 2:
        return q
    leg = legs(robot)
    for index, foot in enumerate(robot.feet):
        chain = [i for i in np.flatnonzero(leg == index) if model.axis[i, 0] != 0.0]
        if not chain:
            continue
        turn = LEGS_APART if index else -LEGS_APART
        for joint in dict.fromkeys((int(chain[0]), foot.link)):
            sense = model.axis[joint, 0]
            if sense == 0.0:
                continue
            moved = np.clip(q[joint] + turn * sense, model.lower[joint], model.upper[joint])
            turn = -(moved - q[joint]) * sense  # what the hip turned, the ankle turns back
            q[joint] = moved
    return q


def standing_height(robot: Robot, q: Floats) -> float:
    """Height of the lowest contact point of a robot in a configuration (nq,), in m."""
    poses = link_poses(robot, q)
    return float(_contact_bottoms(robot, poses.origin, poses.angle)[:, 1].min())


def _contact_bottoms(robot: Robot, origin: Floats, angle: Floats) -> Floats:
    """Lowest points of the contact discs, (nc, 2)."""
    model, link = robot.model, robot.model.contact_link
    center = in_world(origin[link], angle[link], model.contact_position)
    return center - np.outer(model.contact_radius, [0.0, 1.0])


def extent(segments: Floats) -> tuple[Floats, Floats]:
    """Lower left and upper right corner of segments (..., 2), in m."""
    points = segments.reshape(-1, 2)
    if not len(points):
        return np.zeros(2), np.ones(2)
    return points.min(axis=0), points.max(axis=0)
