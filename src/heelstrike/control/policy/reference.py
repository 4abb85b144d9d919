"""A motion that a policy follows: what a robot does over a stride, for each of some speeds.

Actions of such a policy are added to the torques that follow the motion: those of the motion
itself, and of springs and dampers between the joints and where they should be. It observes how far
the robot is off the motion.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, part
from heelstrike.compiler.compilation import kernel
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

Spot = tuple[int, int, float, int, int, float]
"""Rows of the speeds below and above and the share of the latter; the same of phases."""

OBSERVED = 3
"""Numbers that are observed of it: commanded speed, sine and cosine of the phase."""

TOLD = 3
"""Numbers that are commanded beside the actions: speed, phase, and since when they hold."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Motion of a robot over a stride of two steps, which repeats itself.

    Raises
    ------
    ControllerError
        If shapes do not fit, or a number is not finite or out of range.
    """

    speed: Floats
    """(k,) Speeds (m/s) in rising order. Between them motions are interpolated; what is commanded
    beyond them follows the outermost one."""
    stride: Floats
    """(k,) Duration of a stride at each (s)."""
    motion: Floats
    """(k, m, nq + nv + nu) At m evenly spaced phases of a stride positions and velocities of all
    coordinates and torques of the actuators (m, rad; m/s, rad/s; N m)."""
    stiffness: Floats
    damping: Floats
    """stiffness, damping: (nu,) Of springs and dampers between joints and motion (N m/rad,
    N m s/rad)."""
    period: float
    """Seconds from one reading of the joints to the next."""

    def __post_init__(self) -> None:
        for name in ("speed", "stride", "motion", "stiffness", "damping"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if not np.isfinite(values).all() or not values.size:
                raise ControllerError(f"{name} of a reference must be finite numbers")
            object.__setattr__(self, name, values)
        count, nu = self.speed.size, self.stiffness.size
        shapes = [each.shape for each in (self.speed, self.stride, self.damping)]
        fits = shapes == [(count,), (count,), (nu,)] and self.stiffness.ndim == 1
        if not fits or self.motion.ndim != 3 or len(self.motion) != count:
            raise ControllerError(
                f"a reference of {count} speeds and {nu} joints has motions of shape ({count}, m, "
                f"nq + nv + {nu}), got {self.motion.shape} with {shapes[1]} strides"
            )
        rises, lasts = (np.diff(self.speed) > 0.0).all(), (self.stride > 0.0).all()
        if not (rises and lasts and 0.0 < self.period < np.inf):
            raise ControllerError(
                "speeds of a reference must rise, strides and period must be positive"
            )

    def numbers(self) -> Following:
        """Return it as kernels see it.

        Returns
        -------
        Following
            Its numbers.
        """
        return Following(
            speed=self.speed, stride=self.stride, motion=self.motion, stiffness=self.stiffness,
            damping=self.damping,
        )  # fmt: skip


class Following(Bundle):
    """Numbers of a motion that is followed; of none without speeds."""

    speed: Floats = array("speeds")
    stride: Floats = array("speeds")
    motion: Floats = array("speeds", "phases", "numbers")
    stiffness: Floats = array("nu")
    damping: Floats = array("nu")
    """speed, stride, motion, stiffness, damping: As of :class:`Reference`."""


@kernel
def spot(speeds: Floats, phases: int, speed: float, phase: float) -> Spot:
    """Find where in a table a speed and a phase (strides) are."""
    last = speeds.shape[0] - 1
    row, share = 0, 0.0
    while row < last - 1 and speed >= speeds[row + 1]:
        row += 1
    above = min(row + 1, last)
    if above > row:
        share = (speed - speeds[row]) / (speeds[above] - speeds[row])
        share = min(max(share, 0.0), 1.0)
    place = (phase - math.floor(phase)) * phases
    column = int(place)
    return row, above, share, column % phases, (column + 1) % phases, place - column


@kernel
def between(table: Floats, at: Spot, i: int) -> float:
    """Interpolate entry `i` of a table of speeds and phases."""
    row, above, share, column, following, part_of = at
    low = table[row, column, i] + part_of * (table[row, following, i] - table[row, column, i])
    high = table[above, column, i] + part_of * (
        table[above, following, i] - table[above, column, i]
    )
    return low + share * (high - low)


@kernel
def stride_at(following: Following, speed: float) -> float:
    """Duration of a stride (s) at a speed."""
    row, above, share, _, _, _ = spot(following.speed, 1, speed, 0.0)
    return following.stride[row] + share * (following.stride[above] - following.stride[row])


@kernel
def follow(
    following: Following, speed: float, phase: float, robot: Any, q: Floats, v: Floats,
    torque: Floats,
) -> None:  # fmt: skip
    """Write the torques that make actuated joints of a robot, as laws see it, follow the motion."""
    at = spot(following.speed, following.motion.shape[1], speed, phase)
    nq, nv = q.shape[0], v.shape[0]
    for i in range(torque.shape[0]):
        j, k = robot.driven_position(i), robot.driven_velocity(i)
        torque[i] = (
            between(following.motion, at, nq + nv + i)
            + following.stiffness[i] * (between(following.motion, at, j) - q[j])
            + following.damping[i] * (between(following.motion, at, nq + k) - v[k])
        )


class Followed(Bundle):
    """Numbers of :class:`HeldAction`."""

    following: Following = part(Following)
    gear: Floats = array("nu")
    """Torque for an action of 1 (N m)."""
    command: Floats = array("nu + 3")
    """Actions, each from -1 to 1; then commanded speed (m/s), phase (strides) and the time (s)
    since when they hold."""


@controller
def held_action(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Followed, torque: Floats
) -> None:
    """Follow a motion; add the actions that were commanded last."""
    nu, command = torque.shape[0], parameters.command
    speed, since = float(command[nu]), float(command[nu + 2])
    phase = float(command[nu + 1]) + (t - since) / stride_at(parameters.following, speed)
    follow(parameters.following, speed, phase, robot, state.q, state.v, torque)
    for i in range(nu):
        torque[i] += parameters.gear[i] * min(max(command[i], -1.0), 1.0)


class HeldAction(Law):
    """Follows a motion, with actions from outside added that are held until others come.

    Parameters
    ----------
    reference : Reference
        The motion.
    gear : (nu,) float
        Torque of each actuator for an action of 1 (N m).
    """

    commanded = "command"

    def __init__(self, reference: Reference, gear: Floats) -> None:
        numbers = Followed(
            following=reference.numbers(), gear=np.asarray(gear, dtype=np.float64),
            command=np.zeros(len(gear) + TOLD),
        )  # fmt: skip
        super().__init__(held_action, numbers, period=reference.period)
