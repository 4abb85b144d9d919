"""A motion of several phases, as polynomials of all coordinates, with the forces that hold it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import fingerprint
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.polynomials import evaluated, gauss
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionPhase:
    """A part of a motion in which the same contact points stand."""

    contacts: tuple[str, ...]
    """The contact points that stand; none in flight."""
    breakpoints: Floats
    """(K + 1,) Times since the beginning of the phase between which one polynomial holds, in s."""
    pieces: Floats
    """(K, d + 1, nv) Coefficients of all coordinates, lowest first, in the time since the beginning
    of each of K pieces."""
    force: Floats
    """(K, s, nc, 2) Forces of the ground on all contact points, away from it and along it (N), at
    the s Gauss points of each piece. Of a flat foot, only the first and the last point push, and
    the first alone exerts what is along the ground: how points share that does not matter."""
    impulse: Floats
    """(nc, 2) Impulses (N s) at the end of the phase, likewise; zero where no point comes down."""
    loop_force: Floats = field(default_factory=lambda: np.zeros((0, 0, 0)))
    """(K, s, rows) Forces of closed loops and coupled joints at the Gauss points (N, N m), row by
    row of :func:`~heelstrike.dynamics.loop_jacobian`; of no size where the robot has none."""
    loop_impulse: Floats = field(default_factory=lambda: np.zeros(0))
    """(rows,) Their impulses at the end of the phase (N s, N m s)."""

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Take up a pickled phase, also one from before forces of loops were kept."""
        nothing = {"loop_force": np.zeros((0, 0, 0)), "loop_impulse": np.zeros(0)}
        self.__dict__.update({**nothing, **state})

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return float(self.breakpoints[-1])

    def coordinates(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Coordinates at times in the phase, or a derivative, (..., nv).

        Parameters
        ----------
        t : array_like
            Times since the beginning of the phase (s).
        order : int
            0 for positions, 1 for velocities, 2 for accelerations.

        Returns
        -------
        (..., nv) float
            In m and rad, per s or per s².
        """
        return evaluated(self.pieces, self.breakpoints, np.asarray(t, np.float64), order)

    def forces(self, t: ArrayLike) -> Floats:
        """Forces of the ground at times in the phase, (..., nc, 2).

        Parameters
        ----------
        t : array_like
            Times since the beginning of the phase (s).

        Returns
        -------
        (..., nc, 2) float
            Away from the ground and along it (N), of the polynomial through those at the Gauss
            points.
        """
        time = np.asarray(t, np.float64)
        return evaluated(self.force_pieces, self.breakpoints, time, 0).reshape(
            *time.shape, *self.force.shape[2:]
        )

    @cached_property
    def force_pieces(self) -> Floats:
        """Coefficients of the forces, lowest first, in the time of each piece, (K, s, 2 nc)."""
        return self._through(self.force)

    def loop_forces(self, t: ArrayLike) -> Floats:
        """Forces of closed loops and coupled joints at times in the phase, (..., rows).

        Parameters
        ----------
        t : array_like
            Times since the beginning of the phase (s).

        Returns
        -------
        (..., rows) float
            In N and N m, of the polynomial through those at the Gauss points.
        """
        return evaluated(self.loop_force_pieces, self.breakpoints, np.asarray(t, np.float64), 0)

    @cached_property
    def loop_force_pieces(self) -> Floats:
        """Coefficients of the forces of loops, lowest first, likewise, (K, s, rows)."""
        return self._through(self.loop_force)

    def _through(self, values: Floats) -> Floats:
        """Coefficients of polynomials through values at the Gauss points of pieces, (K, s, n)."""
        count, stages = self.force.shape[:2]
        nodes, _ = gauss(stages)
        times = np.diff(self.breakpoints)[:, None] * nodes
        powers = times[..., None] ** np.arange(stages)
        given = values.reshape(count, stages, values.size // (count * stages))
        return np.asarray(np.linalg.solve(powers, given), np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion(ShownInNotebooks):
    """A motion of a robot through several phases, and how it repeats."""

    robot: str
    """Name of the robot it was designed for."""
    fingerprint: str
    """:func:`~heelstrike.gait.gait.fingerprint` of that robot."""
    phases: tuple[MotionPhase, ...]
    """The phases, one after the other."""
    repeat: Repeat
    """How it goes on after the last."""
    distance: float
    """How far (m) the trunk moves along the ground."""
    slope: float
    """Angle (rad) at which the ground ascends ahead."""
    friction: float
    """Coefficient of friction it was designed for."""
    mirror_joint: Integers
    mirror_sign: Floats
    mirror_offset: Floats
    """mirror_joint, mirror_sign, mirror_offset: (nv,) Mirrored positions are
    ``mirror_sign * q[mirror_joint] + mirror_offset``."""
    mirror_contact: Integers
    """(nc,) Counterpart of every contact point."""
    initial_state: State
    """All coordinates at the beginning, just after whatever landed there."""
    cost: float
    """∫ΓᵀΓ dt over all phases, in N²m²s."""
    spent: float
    """What the optimiser was asked to make least, over all phases, in its own unit: not per
    metre."""
    optimal: bool
    """Whether it is an optimum; if not, it satisfies all constraints nevertheless. Pieces that are
    halved until the motion closes keep the word on the pieces before."""
    margins: Mapping[str, float]
    """Smallest distance from every kind of limit along the phases, in its unit; those of landings
    are not among them."""
    closes_to: float = np.nan
    """Largest difference (m, rad, m/s, rad/s) between the state in which the motion goes on and
    that to which the robot comes, integrated from the first state on under computed torque; NaN
    where nobody looked."""
    rise: float = 0.0
    """By how much (m) the ground is higher from one repetition to the next, on level stairs."""

    @property
    def duration(self) -> float:
        """Duration of all phases (s)."""
        return float(self.ends[-1])  # not a sum that is rounded otherwise: phases fill it exactly

    @property
    def speed(self) -> float:
        """Mean speed along the ground (m/s)."""
        return self.distance / self.duration

    @cached_property
    def ends(self) -> Floats:
        """Times at which the phases end, (phases,), in s."""
        return np.cumsum([phase.duration for phase in self.phases])

    @takes(GaitError)
    def position(self, t: ArrayLike) -> Floats:
        """All coordinates at times of the motion, (..., nv).

        Parameters
        ----------
        t : array_like
            Times (s) since the beginning, of any shape. One that repeats goes on forever, and back
            in time; one that does not rests before and after.

        Returns
        -------
        (..., nv) float
            Positions (m, rad).
        """
        return self._whole(t, 0)

    @takes(GaitError)
    def velocity(self, t: ArrayLike) -> Floats:
        """Velocities at times of the motion, (..., nv): just after a landing, at one.

        Parameters
        ----------
        t : array_like
            Times (s) since the beginning, of any shape.

        Returns
        -------
        (..., nv) float
            Velocities (m/s, rad/s).
        """
        return self._whole(t, 1)

    @takes(GaitError)
    def acceleration(self, t: ArrayLike) -> Floats:
        """Accelerations at times of the motion, (..., nv).

        Parameters
        ----------
        t : array_like
            Times (s) since the beginning, of any shape.

        Returns
        -------
        (..., nv) float
            Accelerations (m/s², rad/s²).
        """
        return self._whole(t, 2)

    def _whole(self, t: ArrayLike, order: int) -> Floats:
        time = np.asarray(t, dtype=np.float64)
        cycle = np.floor(time / self.duration)
        if self.repeat is Repeat.NEVER:
            cycle = np.zeros_like(cycle)
        inside = time - cycle * self.duration
        rests = (inside < 0.0) | (inside > self.duration)
        inside = np.clip(inside, 0.0, self.duration)
        last = len(self.phases) - 1
        phase = np.minimum(np.searchsorted(self.ends, inside, side="right"), last)
        value = np.zeros((*time.shape, self.mirror_sign.size))
        starts = self.ends - [each.duration for each in self.phases]
        for p, each in enumerate(self.phases):
            here = phase == p
            value[here] = each.coordinates(inside[here] - starts[p], order=order)
        if order and self.repeat is Repeat.NEVER:
            value[rests] = 0.0
        return self.repeated(value, cycle, order=order)

    def repeated(self, value: Floats, cycle: Floats, *, order: int = 0) -> Floats:
        """Coordinates of the first cycle as they are in others, (..., nv).

        Parameters
        ----------
        value : (..., nv) float
            Coordinates in the first cycle, or a derivative.
        cycle : (...) float
            How many cycles later, whole numbers.
        order : int
            0 for positions, 1 for velocities, 2 for accelerations.

        Returns
        -------
        (..., nv) float
            Mirrored, where the motion repeats so, and moved along the ground.
        """
        found, many = value.copy(), np.asarray(cycle)[..., None]
        if self.repeat is Repeat.MIRRORED:
            image = self.mirror_sign * value[..., self.mirror_joint]
            image = image + self.mirror_offset if order == 0 else image
            found = np.where(many % 2 == 1, image, found)
        if order == 0:
            along = self.distance * np.array([np.cos(self.slope), np.sin(self.slope)])
            found[..., :2] += many * (along + np.array([0.0, self.rise]))
        return found

    def check_robot(self, robot: Robot) -> None:
        """Raise a `GaitError` unless the motion was designed for a robot.

        Parameters
        ----------
        robot : Robot
            The robot.

        Raises
        ------
        GaitError
            That names both.
        """
        if self.fingerprint != fingerprint(robot):
            other = (
                f"not for robot {robot.name!r}"
                if robot.name != self.robot
                else "whose masses, lengths or other numbers were different from now"
            )
            raise GaitError(
                f"this motion was designed for robot {self.robot!r}, {other}. Load the robot that "
                "it was designed for, or design a new motion."
            )

    @takes(GaitError)
    def save(
        self,
        path: str | PathLike[str],
        *,
        robot: Robot | None = None,
        rate: float = 1000.0,
        cycles: int = 1,
        joints: Sequence[str] | None = None,
        degrees: bool = False,
    ) -> None:
        """Write the motion to a readable JSON file; :func:`load_motion` reads it back unchanged.

        Where the name ends in .csv or .tsv, write a table of the positions of driven joints over
        time instead, for a robot or another program. ``heelstrike check`` and
        :func:`~heelstrike.gait.recordings.motion.load_recorded_motion` read it, to the last bit.

        Parameters
        ----------
        path : str or path
            File to write.
        robot : Robot, optional
            The robot whose joints a table names; a table needs it.
        rate : float
            Rows a second of a table.
        cycles : int
            How often the motion is in a table; one that repeats with its mirror image is in it
            twice as often, and one that never repeats once.
        joints : sequence of str, optional
            Joints of a table, in their order; all driven ones by default.
        degrees : bool
            Whether angles of a table are in degrees.

        Raises
        ------
        GaitError
            If the file cannot be written, there is no such joint, or the robot of a table is
            missing or another.
        """
        from heelstrike.gait.motion.file import save_motion
        from heelstrike.gait.recordings.saving import is_table, save_joints, times_at

        if not is_table(path):
            save_motion(self, path)
            return
        if robot is None:
            raise GaitError("a table of a motion names the joints: give robot, whose motion it is")
        self.check_robot(robot)
        often = {Repeat.MIRRORED: 2 * cycles, Repeat.SAME: cycles, Repeat.NEVER: 1}[self.repeat]
        time = times_at(rate, often * self.duration)
        driven = robot.model.actuator_joint
        save_joints(
            path, robot.actuator_names, time, self.position(time)[:, driven],
            hinges=(robot.model.axis[driven, 0] != 0.0).tolist(), joints=joints, degrees=degrees,
        )  # fmt: skip

    def __repr__(self) -> str:
        count = len(self.phases)
        return (
            f"Motion({self.robot!r}: {count} phase{'s' * (count != 1)}, {self.distance:.3g} m in "
            f"{self.duration:.3g} s, cost {self.cost:.6g} N²m²s"
            f"{'' if self.optimal else '; feasible, not optimal'})"
        )
