"""A periodic gait: the phases of one step, and their mirror images for the next."""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.margins import Margins
from heelstrike.gait.polynomials import evaluated
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.model import NUMBERS, Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.gait.motion.motion import Motion


class Footing(enum.Enum):
    """How a foot stands: flat, so that the ground bears a moment, or on a point, without one."""

    FLAT = "flat"
    POINT = "point"


@dataclass(frozen=True, eq=False, kw_only=True)
class Phase:
    """A part of a step in which the same feet stand in the same way.

    Raises
    ------
    GaitError
        If numbers are missing, not finite or contradict each other.
    """

    contacts: Mapping[int, Footing]
    """The feet that stand in the first step, by their index in ``robot.feet``, and how."""
    breakpoints: Floats
    """(K + 1,) Times, since the beginning of the phase, between which one polynomial holds, in
    s."""
    pieces: Floats
    """(K, d + 1, nu) Coefficients, lowest first, of the joints' polynomials in the time since the
    beginning of each piece. A cubic (paper eq. 41) is one piece of degree d = 3."""
    pitch_pieces: Floats | None = None
    """(K, d + 1) The same for the trunk's pitch, where no flat foot makes it follow from the
    joints."""

    def __post_init__(self) -> None:
        if not self.contacts:
            raise GaitError("gait: a phase needs at least one foot that stands")
        if not set(self.contacts) <= {0, 1}:
            raise GaitError(f"gait: stance_foot must be 0 or 1, got {sorted(self.contacts)}")
        for name in ("breakpoints", "pieces", "pitch_pieces"):
            if getattr(self, name) is not None:
                _store(self, name)
        contacts = {int(foot): footing for foot, footing in self.contacts.items()}
        object.__setattr__(self, "contacts", contacts)
        count, shape = self.breakpoints.size - 1, self.pieces.shape
        if self.breakpoints.ndim != 1 or len(shape) != 3 or shape[0] != count or 0 in shape:
            raise GaitError(
                f"gait: {count + 1} breakpoints need pieces of shape ({count}, degree + 1, "
                f"joints), got {shape}"
            )
        if self.pitch_pieces is not None and self.pitch_pieces.shape != shape[:2]:
            raise GaitError(
                f"gait: pitch_pieces must have shape {shape[:2]}, got {self.pitch_pieces.shape}"
            )
        if self.breakpoints[0] != 0.0 or np.any(np.diff(self.breakpoints) <= 0.0):
            raise GaitError(
                "gait: a phase's breakpoints must rise from 0; its duration be positive"
            )


@dataclass(frozen=True, eq=False, kw_only=True)
class Gait(ShownInNotebooks):
    """A walk in which every step mirrors the one before (paper eq. 13, 41-43).

    Joint arrays are in the order of the robot's actuators, ``robot.model.actuator_joint``.

    Raises
    ------
    GaitError
        If numbers are missing, not finite or contradict each other.
    """

    robot: str
    """Name of the robot it was designed for."""
    fingerprint: str
    """:func:`fingerprint` of that robot."""
    joint_names: tuple[str, ...]
    """The nu actuated joints."""
    step_length: float
    """Distance (m) between the feet when both are on the ground: how far the body moves a step."""
    phases: tuple[Phase, ...]
    """The first step, phase by phase."""
    mirror_joint: Integers
    """(nu,) Counterpart of every joint on the other side."""
    mirror_sign: Floats
    mirror_offset: Floats
    """mirror_sign, mirror_offset: (nu,) Mirrored positions are ``mirror_sign * q[mirror_joint] +
    mirror_offset``."""
    initial_state: State
    """All coordinates at the beginning of the first step, just after touchdown, with the middle of
    the stance sole, or the point on which the robot stands, at the origin of the world."""
    cost: float
    """∫ΓᵀΓ dt over one step, in N²m²s (paper eq. 40)."""
    friction: float
    """Coefficient of friction it was designed for."""
    clearance: float
    """Greatest height of the swing foot's clearance profile, in m."""
    clearance_profile: ClearanceProfile
    """Shape of that profile."""
    touchdown_impulse: Floats
    """(3,) Impulse of the ground on the landing foot at the middle of its sole: normal (N s),
    tangential (N s), moment about +y (N m s). Zero for a gait without impact."""
    margins: Margins
    """How far the gait stays from its constraints."""
    slope: float = 0.0
    """Angle (rad) at which the ground it was designed for ascends ahead."""
    spent: float | None = None
    """What the optimiser was asked to make least, over one step, in its own unit; None in gaits of
    which only the torque cost is known."""
    optimal: bool = True
    """Whether it is an optimum. A gait of :func:`heelstrike.optimize_gait` that is not
    satisfies all constraints nevertheless; a better one may exist. One of
    :meth:`heelstrike.GaitFamily.at` that is not satisfies the equations of a step, but may break
    limits; `margins` tells how far."""
    rise: float = 0.0
    """By how much (m) every foothold is higher than the one before, on level stairs."""

    def __post_init__(self) -> None:
        nu = len(self.joint_names)
        for name, size in (("mirror_sign", nu), ("mirror_offset", nu), ("touchdown_impulse", 3)):
            _store(self, name, (size,))
        counterpart = np.asarray(self.mirror_joint)
        if not np.array_equal(np.sort(counterpart), np.arange(nu)):
            raise GaitError(f"gait: mirror_joint must be a permutation of {nu} joints")
        object.__setattr__(self, "mirror_joint", counterpart.astype(np.int64))
        if not np.all(np.abs(self.mirror_sign) == 1.0):
            raise GaitError("gait: mirror_sign must hold +1 and -1 only")
        for name in ("step_length", "friction", "clearance", "cost"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise GaitError(f"gait: {name} must be a number that is not negative, got {value}")
        if self.step_length == 0.0:
            raise GaitError("gait: step_length must be positive")
        if not self.phases or any(phase.pieces.shape[2] != nu for phase in self.phases):
            raise GaitError(f"gait: it needs one phase or more, each with pieces of {nu} joints")
        state = self.initial_state
        if state.q.ndim != 1 or state.q.size <= nu or not np.all(np.isfinite(state.q)):
            raise GaitError("gait: the initial position must be finite, with trunk and joints")
        if state.v.shape != state.q.shape or not np.all(np.isfinite(state.v)):
            raise GaitError("gait: the initial velocity must be finite and as long as the position")

    @cached_property
    def breakpoints(self) -> Floats:
        """Times of the first step between which one polynomial holds, (K + 1,), in s."""
        inner = [np.zeros(1)]
        for phase in self.phases:
            inner.append(inner[-1][-1] + phase.breakpoints[1:])
        return np.concatenate(inner)

    @cached_property
    def pieces(self) -> Floats:
        """Coefficients of the joints' polynomials of all phases, (K, d + 1, nu)."""
        return _joined([phase.pieces for phase in self.phases])

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients of the only polynomial a joint in the first step, (d + 1, nu).

        Raises
        ------
        GaitError
            If there are several, see `pieces`.
        """
        return _only(self.pieces)

    @property
    def point_feet(self) -> bool:
        """Whether the robot always stands on points, which makes it underactuated."""
        return all(Footing.FLAT not in phase.contacts.values() for phase in self.phases)

    @property
    def stance_foot(self) -> int:
        """Index in ``robot.feet`` of the foot that stands from the beginning of the first step."""
        return min(self.phases[0].contacts)

    @property
    def step_duration(self) -> float:
        """Duration T of a step, in s."""
        return float(self.breakpoints[-1])

    @property
    def start_position(self) -> Floats:
        """Joint positions q(0) at the beginning of the first step, (nu,)."""
        return self.in_step(0.0)

    @property
    def end_position(self) -> Floats:
        """Joint positions q(T) at the end of the first step, (nu,)."""
        return self.in_step(self.step_duration)

    @property
    def start_velocity(self) -> Floats:
        """Joint velocities just after the last touchdown, (nu,)."""
        return self.in_step(0.0, order=1)

    @property
    def end_velocity(self) -> Floats:
        """Joint velocities just before the next touchdown, (nu,)."""
        return self.in_step(self.step_duration, order=1)

    def mirrored_pieces(self) -> Floats:
        """Coefficients of the steps on the other foot, (K, d + 1, nu)."""
        mirrored = self.mirrored(self.pieces, order=1)
        mirrored[:, 0] += self.mirror_offset
        return mirrored

    def mirrored_coefficients(self, robot: Robot | None = None) -> Floats:
        """Coefficients of the only polynomial a joint of the steps on the other foot, (d + 1, nu).

        Parameters
        ----------
        robot : Robot, optional
            The robot that is to walk; its actuated joints must be those of the gait.

        Returns
        -------
        (d + 1, nu) float
            Lowest power first.

        Raises
        ------
        GaitError
            If the gait does not fit the robot, or has several polynomials a joint.
        """
        if robot is not None:
            self.check_joints(robot)
        return _only(self.mirrored_pieces())

    def check_joints(self, robot: Robot) -> None:
        """Raise a `GaitError` unless the gait moves exactly the actuated joints of a robot.

        Parameters
        ----------
        robot : Robot
            The robot.

        Raises
        ------
        GaitError
            That names the joints.
        """
        joints = actuated_joints(robot)
        if joints != self.joint_names:
            raise GaitError(
                f"this gait of robot {self.robot!r} moves the joints "
                f"({', '.join(self.joint_names)}); robot {robot.name!r} has actuators at "
                f"({', '.join(joints)}). Use the robot the gait was designed for, or design a new "
                "gait with optimize_gait."
            )

    @takes(GaitError)
    def position(self, t: ArrayLike) -> Floats:
        """Joint positions at times of the walk, (..., nu), in rad.

        Parameters
        ----------
        t : array_like
            Times in s, of any shape; the first step begins at 0. The paper's polynomials end at T
            (eq. 41): the walk goes on with the mirrored step, then with the first again, and so
            also back in time.

        Returns
        -------
        (..., nu) float
            Positions (rad).
        """
        return self._walk(t, 0)

    @takes(GaitError)
    def velocity(self, t: ArrayLike) -> Floats:
        """Joint velocities at times of the walk, (..., nu), in rad/s.

        At a touchdown this is the velocity just after the impact. See :meth:`position`.

        Parameters
        ----------
        t : array
            Times of the walk (s), of any shape.

        Returns
        -------
        (..., nu) float
            Velocities (rad/s).
        """
        return self._walk(t, 1)

    @takes(GaitError)
    def acceleration(self, t: ArrayLike) -> Floats:
        """Joint accelerations at times of the walk, (..., nu), in rad/s². See :meth:`position`.

        Parameters
        ----------
        t : array
            Times of the walk (s), of any shape.

        Returns
        -------
        (..., nu) float
            Accelerations (rad/s²).
        """
        return self._walk(t, 2)

    def in_step(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Joint motion of the first step, (..., nu), its polynomials going on beyond the ends.

        Parameters
        ----------
        t : array_like
            Times in s, of any shape.
        order : int
            0 for positions, 1 for velocities, 2 for accelerations.

        Returns
        -------
        (..., nu) float
            In rad, rad/s or rad/s².
        """
        return evaluated(self.pieces, self.breakpoints, np.asarray(t, np.float64), order)

    def pitch(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Pitch of the trunk (rad), or a derivative, at times of the first step, (...).

        On point feet no motor acts on it; it moves as the dynamics demands when the joints follow
        their polynomials exactly.

        Parameters
        ----------
        t : array
            Times of the step (s), of any shape.
        order : int
            0 for the pitch, 1 for its rate, 2 for its acceleration.

        Returns
        -------
        (...) float
            In rad, rad/s or rad/s².

        Raises
        ------
        GaitError
            On flat feet, where it follows from the joints.
        """
        pitches = [phase.pitch_pieces for phase in self.phases]
        given = [pieces[..., None] for pieces in pitches if pieces is not None]
        if len(given) < len(pitches):
            raise GaitError(
                "on flat feet the trunk's pitch follows from the joints; use in_step()."
            )
        return evaluated(_joined(given), self.breakpoints, np.asarray(t, np.float64), order)[..., 0]

    def mirrored(self, joints: Floats, *, order: int = 0) -> Floats:
        """Mirror image of joint positions, or of a derivative of them, (..., nu).

        Parameters
        ----------
        joints : (..., nu) float
            Positions, or a derivative.
        order : int
            0 for positions, 1 or more for derivatives, which have no offset.

        Returns
        -------
        (..., nu) float
            Those of the mirror image.
        """
        image: Floats = self.mirror_sign * joints[..., self.mirror_joint]
        return image + self.mirror_offset if order == 0 else image

    def motion(self, robot: Robot) -> Motion:
        """Return the same walk as a motion of all coordinates, with the forces of the ground.

        Parameters
        ----------
        robot : Robot
            The robot that the gait was designed for.

        Returns
        -------
        Motion
            One step that repeats with its mirror image: what laws about motions of any phases, as
            :class:`~heelstrike.MotionLQR`, follow.

        Raises
        ------
        GaitError
            If the gait is of another robot, or stands on both feet.
        """
        from heelstrike.gait.motion.from_gait import motion_of_gait

        return motion_of_gait(robot, self)

    def _walk(self, t: ArrayLike, order: int) -> Floats:
        time = np.asarray(t, dtype=np.float64)
        step = np.floor(time / self.step_duration)
        value = self.in_step(time - step * self.step_duration, order=order)
        odd = (step % 2 == 1)[..., None]
        result: Floats = np.where(odd, self.mirrored(value, order=order), value)
        return result

    @takes(GaitError)
    def save(
        self,
        path: str | PathLike[str],
        *,
        rate: float = 1000.0,
        steps: int = 2,
        joints: Sequence[str] | None = None,
        degrees: bool = False,
    ) -> None:
        """Write the gait to a readable JSON file; :func:`load_gait` reads it back unchanged.

        Where the name ends in .csv or .tsv, write a table of joint positions over time instead, for
        a robot or another program. ``heelstrike check`` and
        :func:`~heelstrike.gait.recordings.motion.load_recorded_motion` read it, to the last bit.

        Parameters
        ----------
        path : str or path
            File to write.
        rate : float
            Rows a second of a table.
        steps : int
            Steps that are in a table; two are a whole cycle.
        joints : sequence of str, optional
            Joints of a table, in their order; all driven ones by default.
        degrees : bool
            Whether angles of a table are in degrees.

        Raises
        ------
        GaitError
            If the file cannot be written, or there is no such joint.
        """
        from heelstrike.gait.file import save_gait
        from heelstrike.gait.recordings.saving import is_table, save_joints, times_at

        if not is_table(path):
            save_gait(self, path)
            return
        time = times_at(rate, steps * self.step_duration)
        # No joint of a gait says whether it turns; a slide is no joint of a leg that walks.
        save_joints(
            path, self.joint_names, time, self.position(time),
            hinges=[True] * len(self.joint_names), joints=joints, degrees=degrees,
        )  # fmt: skip

    def __repr__(self) -> str:
        return (
            f"Gait({self.robot!r}: {self.step_length:g} m in {self.step_duration:g} s, "
            f"cost {self.cost:.6g} N²m²s{'' if self.optimal else '; feasible, not optimal'})"
        )


def _store(owner: Phase | Gait, name: str, shape: tuple[int, ...] | None = None) -> None:
    """Keep a copy of an array, once it is finite and of the right shape."""
    value = np.array(getattr(owner, name), dtype=np.float64)
    if shape not in (None, value.shape) or not np.all(np.isfinite(value)):
        numbers = "" if shape is None else f"{shape[0]} "
        raise GaitError(f"gait: {name} must hold {numbers}finite numbers, got {value}")
    object.__setattr__(owner, name, value)


def _only(pieces: Floats) -> Floats:
    if len(pieces) > 1:
        raise GaitError(
            "a gait of piecewise polynomials has no single set of coefficients; use its pieces, or "
            "position(), velocity() and acceleration()."
        )
    only: Floats = pieces[0]
    return only


def _joined(phases: list[Floats]) -> Floats:
    """Pieces of all phases one after the other, with zeros for higher powers that some lack."""
    terms = max(pieces.shape[1] for pieces in phases)
    padded = [np.pad(p, ((0, 0), (0, terms - p.shape[1]), (0, 0))) for p in phases]
    return np.concatenate(padded)


def actuated_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the actuated joints of a robot, in the order of its actuators."""
    return tuple(robot.joint_names[j] for j in robot.model.actuator_joint)


YOUNGER = frozenset(
    {
        "stall_torque", "no_load_speed", "winding_resistance",
        "loop_link", "loop_position", "coupling_joint", "coupling_polynomial",
        "latch_joint", "latch_side", "latch_release", "friction_scale", "restitution_scale",
        "brake_joint", "brake_limit",
    }
)  # fmt: skip
"""Numbers of a robot that are younger than the first gaits in files."""


def fingerprint(robot: Robot) -> str:
    """Short text that tells robots with different numbers apart.

    Numbers enter with nine digits, so that it is the same on every machine; those that are younger
    than files only where a robot has them, so that files of robots without them stay good.
    """
    digest = hashlib.sha256()
    for field, value in robot.model.members().items():
        if field in YOUNGER and np.all(np.asarray(value) == NUMBERS[field].default):
            continue
        numbers = " ".join(f"{x + 0.0:.9g}" for x in np.ravel(np.asarray(value, dtype=np.float64)))
        digest.update(f"{field} {numbers};".encode())
    return digest.hexdigest()[:16]
