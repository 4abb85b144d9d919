"""What a viewer gets of an instant: one vector of numbers, whose layout it is told once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from heelstrike.analysis.friction import friction_use
from heelstrike.analysis.intervals import event_impulse, mean_between, mean_over_intervals
from heelstrike.analysis.motion import Motion, in_world, run_motion
from heelstrike.analysis.support import foot_sums
from heelstrike.analysis.zero_moment_point import zero_moment_point, zero_moment_point_limits
from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.dynamics import center_of_mass, contact_positions, link_poses
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import legs
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.push import Push
from heelstrike.sim.run import Run
from heelstrike.view.live.layout import (
    MOST_PUSHES,
    FrameLayout,
    acting_pushes,
    only,
    slider,
)
from heelstrike.view.page.curves import DASHED, Plot, Trace, alike, side_of
from heelstrike.view.page.motion import frames as drawn
from heelstrike.view.style import limits_in_words

ROOM = 0.15
"""Share of a sole's length that its plot shows beyond either end."""


class Layout(FrameLayout):
    """The frames of a robot in the plane.

    Parameters
    ----------
    robot : Robot
        The robot.
    """

    def __init__(self, robot: Robot) -> None:
        nc, feet = robot.nc, len(robot.feet)
        self.joints = movable(robot)
        widths = {
            "time": 1, "pose": 3 * robot.nl, "point": 2 * nc, "normal": 2 * nc, "force": 2 * nc,
            "friction": nc, "center": 2, "capture": 2, "pressure": 2, "support": 4,
            "push": 4 * MOST_PUSHES, "joint": len(self.joints), "torque": robot.nu,
            "ahead": feet, "pressing": feet, "dragging": feet, "used": feet,
            "energy": 3,
        }  # fmt: skip
        super().__init__(robot, widths)

    def frames(self, run: Run, rows: Sequence[int], pushes: Iterable[Push]) -> Floats:
        """Return the frames of some rows but the first; see `FrameLayout`."""
        rows_shown = np.asarray(rows[1:], dtype=np.int64)
        forces = mean_forces(run, np.asarray(rows, dtype=np.int64))
        each = only(run, rows_shown, contact_force=forces)
        every = np.arange(len(rows_shown))
        motion = run_motion(each)
        zmp = zero_moment_point(each, motion=motion)
        sums = foot_sums(each, each.contact_force)
        found = {
            **drawn(each, every, motion, zmp),
            "time": each.time,
            "force": each.world_force,
            "push": self._pushes(run.time[np.asarray(rows[:-1])], each.time, motion, pushes),
            "joint": each.position[:, self.joints],
            "torque": each.torque,
            "ahead": zmp.foot,
            "pressing": sums[..., 0] if sums.size else np.zeros((len(every), 0)),
            "dragging": sums[..., 1] if sums.size else np.zeros((len(every), 0)),
            "used": friction_use(each).foot,
            "energy": np.stack(
                (motion.kinetic, motion.potential, motion.kinetic + motion.potential), axis=-1
            ),
        }
        return self.table(len(every), found)

    def still(self, state: State, ground: Ground) -> Floats:
        """Return the frame of a robot of which nothing is known but where it is, (1, width)."""
        robot, poses = self.robot, link_poses(self.robot, state.q)
        seen = contact_kinematics(robot, state.q, state.v, ground)
        known: dict[str, Any] = {
            "time": 0.0,
            "pose": np.column_stack((poses.origin, poses.angle)),
            "point": contact_positions(robot, state.q),
            "normal": seen.normal,
            "force": np.zeros((robot.nc, 2)),
            "center": center_of_mass(robot, state.q),
            "joint": state.q[self.joints],
            "torque": np.zeros(robot.nu),
        }
        return self.table(1, known)

    def _pushes(
        self, since: Floats, until: Floats, motion: Motion, pushes: Iterable[Push]
    ) -> Floats:
        """Where those pushes act that did between some times, (n, 4 a push) in m and N, or NaN."""
        table = np.full((len(until), MOST_PUSHES, 4), np.nan)
        for row, place, push in acting_pushes(since, until, pushes):
            link, point = push.place(self.robot)
            pose = motion.link_origin[row, link], motion.link_angle[row, link]
            table[row, place] = (*in_world(*pose, np.array(point)), *push.force)
        return table

    def plots(self) -> Iterator[Plot]:
        """Plots beside the picture, each curve with its place in a frame."""
        robot, model = self.robot, self.robot.model
        names = [robot.joint_names[joint] for joint in self.joints]
        yield from self._of_joints("joint", self.joints, names)
        limits = np.column_stack((model.torque_lower, model.torque_upper))
        yield from self._of_joints("torque", model.actuator_joint, robot.actuator_names, limits)
        if robot.feet:
            heel, toe = zero_moment_point_limits(robot)
            room = ROOM * max(toe - heel, 1e-3)
            yield self.of_feet(
                "ahead", "zero moment point, from ankle", "m", [("heel", heel), ("toe", toe)],
                span=(heel - room, toe + room) if toe > heel else None,
            )  # fmt: skip
            yield self.pressing()
            yield self.of_feet(
                "dragging", "tangential force", "N",
                usual=(-0.5 * robot.weight, 0.5 * robot.weight),
            )  # fmt: skip
            yield self.using()
        yield from self.energies()

    def sliders(self) -> list[dict[str, Any]]:
        """Joints that a viewer can move, with the ends of their ranges."""
        model = self.robot.model
        return [
            slider(
                self.robot.joint_names[joint], hinge=bool(model.axis[joint, 0] != 0.0),
                ends=(float(model.lower[joint]), float(model.upper[joint])),
                at=self.begin["joint"] + i,
            )
            for i, joint in enumerate(self.joints.tolist())
        ]  # fmt: skip

    def _of_joints(
        self, field: str, joints: Integers, names: Sequence[str], ends: Floats | None = None
    ) -> Iterator[Plot]:
        """One panel for the joints that differ by their side only, such as both knees."""
        leg, turns = legs(self.robot)[joints], self.robot.model.axis[joints, 0] != 0.0
        for name, several in alike(names, np.arange(len(joints))).items():
            for kind in dict.fromkeys(turns[several].tolist()):
                which = [i for i in several if turns[i] == kind]
                levels = [] if ends is None else dict.fromkeys(ends[which].ravel().tolist())
                limits = [level for level in levels if np.isfinite(level)]
                effort = "" if ends is None else " torque" if kind else " force"
                units = ("rad", "m") if ends is None else ("N m", "N")
                traces = [
                    Trace(
                        None, side_of(names[i]), int(leg[i]), DASHED if leg[i] > 0 else 0,
                        at=self.begin[field] + i,
                    )
                    for i in which
                ]  # fmt: skip
                yield Plot(
                    name + effort, units[not kind], traces, [("limit", level) for level in limits],
                    steps=ends is not None, note=limits_in_words(limits),
                    group="joints" if ends is None else "torques",
                )  # fmt: skip


def movable(robot: Robot) -> Integers:
    """Joints of a robot but for those that carry all of it through the world."""
    model = robot.model
    slides = (model.axis[:, 0] == 0.0) & np.isneginf(model.lower) & np.isposinf(model.upper)
    carries = np.zeros(robot.nq, dtype=bool)
    for joint in np.flatnonzero(slides):
        parent = int(model.parent[joint])
        carries[joint] = parent < 0 or carries[parent]
    carries[: 3 if robot.floating else 0] = True
    return np.flatnonzero(~carries)


def mean_forces(run: Run, rows: Integers) -> Floats:
    """Contact forces (normal, tangent) since the row before, of all of `rows` but the first, in N.

    Where no time lies between two rows, those of the later one.
    """
    held = np.diff(run.time)[:, None, None]
    gained = mean_over_intervals(run, run.contact_force) * held
    if run.method.impulses_in_events:
        jumps = event_impulse(run)
        nx, nz = run.contact_normal[:-1, :, 0], run.contact_normal[:-1, :, 1]
        along = jumps[..., 0] * nx + jumps[..., 1] * nz, jumps[..., 0] * nz - jumps[..., 1] * nx
        gained = gained + np.stack(along, axis=-1)
    return mean_between(run.time, gained, rows, run.contact_force[rows], since=True)[1:]
