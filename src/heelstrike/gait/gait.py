"""A periodic gait: one step as a cubic polynomial a joint, and its mirror image for the next."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.errors import GaitError
from heelstrike.gait import cubic
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.margins import Margins
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Gait:
    """A walk in which every step mirrors the one before (paper eq. 13, 41-43).

    Joint arrays are in the order of the robot's actuators, ``robot.model.actuator_joint``.

    Attributes
    ----------
    robot : str
        Name of the robot it was designed for.
    fingerprint : str
        :func:`fingerprint` of that robot.
    joint_names : tuple of nu str
        Actuated joints.
    step_length : float
        Distance (m) between the feet when both are on the ground: how far the body moves a step.
    step_duration : float
        Duration T of a step, in s.
    start_position, end_position : (nu,) float
        Joint positions q(0) and q(T) of the first step, in rad.
    start_velocity, end_velocity : (nu,) float
        Joint velocities just after the last touchdown and just before the next, in rad/s.
    mirror_joint : (nu,) int
        Counterpart of every joint on the other side.
    mirror_sign, mirror_offset : (nu,) float
        Mirrored positions are ``mirror_sign * q[mirror_joint] + mirror_offset``.
    stance_foot : int
        Index in ``robot.feet`` of the foot that stands during the first step.
    initial_state : State
        All coordinates at the beginning of the first step, just after touchdown, with the middle
        of the stance sole at the origin of the world.
    cost : float
        ∫ΓᵀΓ dt over one step, in N²m²s (paper eq. 40).
    friction : float
        Coefficient of friction it was designed for.
    clearance : float
        Greatest height of the swing foot's clearance profile, in m.
    clearance_profile : ClearanceProfile
        Shape of that profile.
    touchdown_impulse : (3,) float
        Impulse of the ground on the landing foot at the middle of its sole: normal (N s),
        tangential (N s), moment about +y (N m s). Zero for a gait without impact.
    margins : Margins
        How far the gait stays from its constraints.

    Raises
    ------
    GaitError
        If numbers are missing, not finite or contradict each other.
    """

    robot: str
    fingerprint: str
    joint_names: tuple[str, ...]
    step_length: float
    step_duration: float
    start_position: Floats
    end_position: Floats
    start_velocity: Floats
    end_velocity: Floats
    mirror_joint: NDArray[np.int64]
    mirror_sign: Floats
    mirror_offset: Floats
    stance_foot: int
    initial_state: State
    cost: float
    friction: float
    clearance: float
    clearance_profile: ClearanceProfile
    touchdown_impulse: Floats
    margins: Margins

    def __post_init__(self) -> None:
        nu = len(self.joint_names)
        for name in (
            "start_position",
            "end_position",
            "start_velocity",
            "end_velocity",
            "mirror_sign",
            "mirror_offset",
        ):
            _store_vector(self, name, nu)
        _store_vector(self, "touchdown_impulse", 3)
        counterpart = np.array(self.mirror_joint, dtype=np.int64)
        if counterpart.shape != (nu,) or set(counterpart.tolist()) != set(range(nu)):
            raise GaitError(f"gait: mirror_joint must be a permutation of {nu} joints")
        object.__setattr__(self, "mirror_joint", counterpart)
        if not np.all(np.abs(self.mirror_sign) == 1.0):
            raise GaitError("gait: mirror_sign must hold +1 and -1 only")
        for name in ("step_length", "step_duration", "friction", "clearance", "cost"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise GaitError(f"gait: {name} must be a number that is not negative, got {value}")
        if self.step_length == 0.0 or self.step_duration == 0.0:
            raise GaitError("gait: step_length and step_duration must be positive")
        if self.stance_foot not in (0, 1):
            raise GaitError(f"gait: stance_foot must be 0 or 1, got {self.stance_foot}")
        state = self.initial_state
        if state.q.ndim != 1 or state.q.size <= nu or not np.all(np.isfinite(state.q)):
            raise GaitError("gait: the initial position must be finite, with trunk and joints")
        if state.v.shape != state.q.shape or not np.all(np.isfinite(state.v)):
            raise GaitError("gait: the initial velocity must be finite and as long as the position")

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients a0 … a3 of the joints' polynomials in the first step, (4, nu)."""
        return np.stack(
            cubic.coefficients(
                self.start_position,
                self.end_position,
                self.start_velocity,
                self.end_velocity,
                self.step_duration,
            )
        )

    def mirrored_coefficients(self, robot: Robot | None = None) -> Floats:
        """Coefficients of the steps on the other foot, (4, nu).

        Parameters
        ----------
        robot : Robot, optional
            The robot that is to walk; its actuated joints must be those of the gait.

        Raises
        ------
        GaitError
            If the gait does not fit the robot.
        """
        if robot is not None:
            self.check_joints(robot)
        mirrored: Floats = self.mirror_sign * self.coefficients[:, self.mirror_joint]
        mirrored[0] += self.mirror_offset
        return mirrored

    def check_joints(self, robot: Robot) -> None:
        """Raise a `GaitError` unless the gait moves exactly the actuated joints of a robot."""
        joints = actuated_joints(robot)
        if joints != self.joint_names:
            raise GaitError(
                f"this gait of robot {self.robot!r} moves the joints "
                f"({', '.join(self.joint_names)}); robot {robot.name!r} has actuators at "
                f"({', '.join(joints)}). Use the robot the gait was designed for, or design a new "
                "gait with optimize_gait."
            )

    def position(self, t: ArrayLike) -> Floats:
        """Joint positions at times of the walk, (..., nu), in rad.

        Parameters
        ----------
        t : array_like
            Times in s, of any shape; the first step begins at 0. The paper's polynomials end at T
            (eq. 41): the walk goes on with the mirrored step, then with the first again, and so
            also back in time.
        """
        return self._walk(t, 0, offset=self.mirror_offset)

    def velocity(self, t: ArrayLike) -> Floats:
        """Joint velocities at times of the walk, (..., nu), in rad/s.

        At a touchdown this is the velocity just after the impact. See :meth:`position`.
        """
        return self._walk(t, 1)

    def acceleration(self, t: ArrayLike) -> Floats:
        """Joint accelerations at times of the walk, (..., nu), in rad/s². See :meth:`position`."""
        return self._walk(t, 2)

    def in_step(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Joint motion of the first step, (..., nu), its polynomials going on beyond the ends.

        Parameters
        ----------
        t : array_like
            Times in s, of any shape.
        order : int
            0 for positions, 1 for velocities, 2 for accelerations.
        """
        polynomial: Any = (cubic.position, cubic.velocity, cubic.acceleration)[order]
        value: Floats = polynomial(
            self.coefficients, np.asarray(t, dtype=np.float64)[..., None]
        ) + np.zeros(len(self.joint_names))
        return value

    def mirrored(self, joints: Floats, *, order: int = 0) -> Floats:
        """Mirror image of joint positions, or of a derivative of them, (..., nu)."""
        image: Floats = self.mirror_sign * joints[..., self.mirror_joint]
        return image + self.mirror_offset if order == 0 else image

    def _walk(self, t: ArrayLike, order: int, *, offset: Floats | float = 0.0) -> Floats:
        time = np.asarray(t, dtype=np.float64)
        step = np.floor(time / self.step_duration)
        value = self.in_step(time - step * self.step_duration, order=order)
        mirrored = self.mirror_sign * value[..., self.mirror_joint] + offset
        result: Floats = np.where((step % 2 == 1)[..., None], mirrored, value)
        return result

    def save(self, path: str | PathLike[str]) -> None:
        """Write the gait to a readable JSON file; :func:`load_gait` reads it back unchanged.

        Raises
        ------
        GaitError
            If the file cannot be written.
        """
        from heelstrike.gait.file import save_gait

        save_gait(self, path)

    def __repr__(self) -> str:
        return (
            f"Gait({self.robot!r}: {self.step_length:g} m in {self.step_duration:g} s, "
            f"cost {self.cost:.6g} N²m²s)"
        )


def _store_vector(gait: Gait, name: str, size: int) -> None:
    value = np.array(getattr(gait, name), dtype=np.float64)
    if value.shape != (size,) or not np.all(np.isfinite(value)):
        raise GaitError(f"gait: {name} must hold {size} finite numbers, got {value}")
    object.__setattr__(gait, name, value)


def actuated_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the actuated joints of a robot, in the order of its actuators."""
    return tuple(robot.joint_names[j] for j in robot.model.actuator_joint)


def fingerprint(robot: Robot) -> str:
    """Short text that tells robots with different numbers apart.

    Numbers enter with nine digits, so that it is the same on every machine.
    """
    digest = hashlib.sha256()
    for field, value in robot.model.members().items():
        numbers = " ".join(f"{x + 0.0:.9g}" for x in np.ravel(np.asarray(value, dtype=np.float64)))
        digest.update(f"{field} {numbers};".encode())
    return digest.hexdigest()[:16]
