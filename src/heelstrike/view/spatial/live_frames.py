"""What a viewer gets of an instant in space: one vector of numbers, as in the plane."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from heelstrike.analysis.spatial.friction import face_friction, friction_used
from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.motion import centroidal_motion
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.dynamics import spatial
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import HINGE, SLIDE
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.push import Push, pushes_on
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.sim.spatial.space import SpatialLook
from heelstrike.view.live.layout import MOST_PUSHES, FrameLayout, acting_pushes, only, slider
from heelstrike.view.page.curves import Plot, Trace
from heelstrike.view.spatial.forces import (
    ShownForces,
    force_groups,
    middle_of_pressure,
    shown_forces,
)
from heelstrike.view.spatial.scene import MOST_EDGES, joint_plots, polygon_table

AXES = ("x", "y", "z")


class SpatialLayout(FrameLayout):
    """The frames of a robot in space.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    """

    def __init__(self, robot: SpatialRobot) -> None:
        self._groups = force_groups(robot)
        self._foot = [
            [g for g, group in enumerate(self._groups) if int(group[0]) in foot.contacts]
            for foot in robot.feet
        ]
        self._first = np.array([group[0] for group in self._groups], dtype=np.int64)
        groups, feet = len(self._groups), len(robot.feet)
        widths = {
            "time": 1, "position": robot.nq, "center": 3, "capture": 3, "pressure": 3,
            "support": 3 * MOST_EDGES, "place": 3 * groups, "force": 3 * groups,
            "normal": 3 * groups, "friction": groups, "push": 6 * MOST_PUSHES,
            "torque": robot.nu, "speed": 3, "margin": 1, "pressing": feet, "used": feet,
            "energy": 3,
        }  # fmt: skip
        super().__init__(robot, widths)

    def frames(self, run: SpatialRun, rows: Sequence[int], pushes: Iterable[Push]) -> Floats:
        """Return the frames of some rows but the first; see `FrameLayout`."""
        robot, every = self.robot, np.asarray(rows, dtype=np.int64)
        shown = every[1:]
        since = shown_forces(run, every, since=True)
        forces = ShownForces(since.place[1:], since.force[1:], since.normal[1:])
        each = only(run, shown)
        motion, found = centroidal_motion(each), spatial_zero_moment_point(each)
        normal = each.contact_normal[:, self._first]
        friction = face_friction(run, shown)[:, self._first]
        return self.table(len(shown), {
            "time": each.time,
            "position": each.position,
            "center": motion.center_of_mass,
            "capture": found.capture_point,
            "pressure": middle_of_pressure(forces, robot.weight),
            "support": polygon_table(found.polygon, MOST_EDGES),
            "place": forces.place,
            "force": forces.force,
            "normal": normal,
            "friction": friction,
            "push": self._pushes(each, run.time[every[:-1]], pushes),
            "torque": each.torque,
            "speed": motion.momentum[:, :3] / robot.total_mass,
            "margin": found.margin,
            **self._of_feet(friction, forces, normal),
            "energy": np.column_stack(
                (motion.kinetic, motion.potential, motion.kinetic + motion.potential)
            ),
        })  # fmt: skip

    def still(self, state: State, ground: SpatialGround) -> Floats:
        """Return the frame of a robot of which nothing is known but where it is, (1, width)."""
        groups = len(self._groups)
        return self.table(1, {
            "time": 0.0,
            "position": state.q,
            "center": spatial.center_of_mass(self.robot, state.q),
            "force": np.zeros((groups, 3)),
            "friction": SpatialLook(self.robot).friction(ground, state.q, state.v)[self._first],
            "torque": np.zeros(self.robot.nu),
        })  # fmt: skip

    def plots(self) -> Iterator[Plot]:
        """Plots beside the picture, each curve with its place in a frame."""
        begin = self.begin
        yield from joint_plots(
            self.robot,
            lambda place: {"at": begin["position"] + place},
            lambda motor: {"at": begin["torque"] + motor},
            limited=True,
        )
        if self.robot.feet:
            yield self.pressing()
            yield self.using()
        if self.robot.nc:
            inside = [Trace(None, "", at=begin["margin"])]
            yield Plot(
                "zero moment point, inside the support polygon", "m", inside, [("edge", 0.0)],
                group="feet",
            )  # fmt: skip
        yield Plot(
            "velocity of the centre of mass", "m/s",
            [Trace(None, name, color=k, at=begin["speed"] + k) for k, name in enumerate(AXES)],
            group="energy",
        )  # fmt: skip
        yield from self.energies()

    def sliders(self) -> list[dict[str, Any]]:
        """Hinges and slides, with the ends of their ranges."""
        robot, model = self.robot, self.robot.model
        return [
            slider(
                name, hinge=kind == HINGE, ends=(float(model.lower[i]), float(model.upper[i])),
                at=self.begin["position"] + int(model.first_position[i]),
            )
            for i, (name, kind) in enumerate(
                zip(robot.joint_names, model.joint_kind.tolist(), strict=True)
            )
            if kind in (HINGE, SLIDE)
        ]  # fmt: skip

    def _of_feet(self, friction: Floats, forces: ShownForces, normal: Floats) -> dict[str, Floats]:
        """Normal force of each foot, and the share of its friction that it uses."""
        sideways = forces.force - forces.normal[..., None] * normal
        count, feet = len(forces.normal), len(self._foot)
        pressing, used = np.zeros((count, feet)), np.zeros((count, feet))
        for i, own in enumerate(self._foot):
            pressing[:, i] = forces.normal[:, own].sum(axis=1)
            used[:, i], _ = friction_used(
                forces.normal[:, own], sideways[:, own], friction[:, own], 1e-6 * self.robot.weight
            )
        return {"pressing": pressing, "used": used}

    def _pushes(self, each: SpatialRun, since: Floats, pushes: Iterable[Push]) -> Floats:
        """Where those pushes act that did between some times, (n, 6 a push) in m and N, or NaN."""
        table = np.full((len(each.time), MOST_PUSHES, 6), np.nan)
        acting = list(acting_pushes(since, each.time, pushes))
        if acting:
            motion = link_motion(each)
        for row, place, push in acting:
            numbers = pushes_on(self.robot, (push,))
            link = int(numbers.link[0])
            at = motion.origin[row, link] + motion.rotation[row, link] @ numbers.point[0]
            table[row, place] = (*at, *push.force)
        return table
