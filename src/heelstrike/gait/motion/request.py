"""What is asked of a motion, checked before anything is computed."""

from __future__ import annotations

import enum
from collections.abc import Callable
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from heelstrike.field_texts import dataclass
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.motion.phases import ContactPhase, Standing, points_of, standing
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State


class Repeat(enum.Enum):
    """How a motion repeats after its last phase.

    ``MIRRORED``: with its mirror image, as a walk whose steps are alike; ``SAME``: with itself, as
    one that limps; ``NEVER``: not at all, as standing up.
    """

    MIRRORED = "mirrored"
    SAME = "same"
    NEVER = "never"


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionRequest:
    """A request for a motion, checked."""

    robot: Robot
    """The robot."""
    phases: tuple[ContactPhase, ...]
    """The phases."""
    repeat: Repeat
    """How it goes on."""
    friction: float
    """Coefficient of friction."""
    clearance: float
    """How high points in the air are half-way (m)."""
    slope: float
    """Angle (rad) at which the ground ascends ahead."""
    force_margin: float
    """Least normal force (N) at both ends of a sole that stands flat."""
    landing_speed: float
    """Least speed towards the ground (m/s) of points that come down."""
    cost: Any
    """What is minimised."""
    speed: float | None
    """Mean speed (m/s)."""
    total: float | None
    """Duration of all phases (s)."""
    distance: tuple[float, float]
    """Least and largest distance (m) that it covers."""
    start: State | None = None
    """State at the beginning of a motion that never repeats."""
    end: State | None = None
    """State at its end."""
    guess: Callable[[float], ArrayLike] | None = None
    """Positions at times of the motion, to start from."""

    @cached_property
    def standing(self) -> list[Standing]:
        """What holds the robot in each phase."""
        return [standing(self.robot, points_of(self.robot, phase)) for phase in self.phases]

    @cached_property
    def never_lifted(self) -> frozenset[int]:
        """Points that stand in all phases: where they are at the beginning, they stay."""
        return frozenset.intersection(*(each.points for each in self.standing))

    @cached_property
    def always_standing(self) -> frozenset[int]:
        """Points of a motion that repeats which stand in all phases of all repetitions."""
        if self.repeat is not Repeat.MIRRORED:
            return self.never_lifted
        assert self.robot.mirror is not None
        counterpart = self.robot.mirror.contact
        return frozenset(i for i in self.never_lifted if int(counterpart[i]) in self.never_lifted)

    @cached_property
    def standing_after(self) -> Standing:
        """What holds it after the last phase, as it goes on."""
        first = self.standing[0]
        if self.repeat is Repeat.MIRRORED:
            assert self.robot.mirror is not None
            points = [int(self.robot.mirror.contact[i]) for i in first.points]
            return standing(self.robot, points)
        return first

    @cached_property
    def usual(self) -> Floats:
        """Durations (s) from which the optimiser starts, (phases,)."""
        bounds = np.array([phase.duration for phase in self.phases])
        middle = np.sqrt(bounds[:, 0] * np.minimum(bounds[:, 1], 0.8))
        middle = np.clip(middle, bounds[:, 0], bounds[:, 1])
        if self.total is not None:
            middle = np.clip(middle * self.total / middle.sum(), bounds[:, 0], bounds[:, 1])
        return middle

    def shift(self, distance: Any) -> Any:
        """By how much a motion moves the trunk, (nv,), that covers a distance along the ground."""
        unit = np.zeros(self.robot.nv)
        unit[0], unit[1] = np.cos(self.slope), np.sin(self.slope)
        return casadi.DM(unit) * distance

    def start_position(self, end: Any, distance: Any) -> Any:
        """Positions at the beginning, (nv,), of those at the end."""
        if self.repeat is Repeat.NEVER:
            assert self.start is not None
            return casadi.DM(self.start.q)
        moved = end - self.shift(distance)
        if self.repeat is Repeat.SAME:
            return moved
        assert self.robot.mirror is not None
        return self.robot.mirror.position(moved)

    def wrapped_velocity(self, start: Any) -> Any:
        """Velocity after the last phase, (nv,), of that at the beginning."""
        if self.repeat is Repeat.SAME:
            return start
        assert self.robot.mirror is not None
        return self.robot.mirror.velocity(start)

    def force_margin_of(self, p: int, point: int) -> float:
        """Least normal force (N) of a point that stands in a phase: none where it stands alone."""
        link = self.robot.model.contact_link
        ends = [i for i in self.standing[p].normal if link[i] == link[point]]
        return self.force_margin if len(ends) > 1 else 0.0

    def clearance_of(self, p: int, point: int, shares: Floats) -> Floats:
        """Least height (m) of a point that is in the air at shares of a phase.

        Where its whole foot is in the air, a hump over all phases in which it is, each counted the
        same: flat at both ends, since a point that is let go begins at rest. Elsewhere zero.
        """
        link = self.robot.model.contact_link
        foot = frozenset(np.flatnonzero(link == link[point]).tolist())
        height = np.zeros(shares.shape)
        if foot.isdisjoint(self.standing[p].points):
            before, after = self._in_the_air(p, foot)
            place = (before + shares) / (before + 1 + after)
            height = self.clearance * ClearanceProfile.SMOOTH.height(place)
        # It comes from the ground or goes to it where it stands in the phase before or after.
        own = frozenset([point])
        leaves = (shares == 0.0) & (not self._is_up(p - 1, own))
        lands = (shares == 1.0) & (not self._is_up(p + 1, own))
        return np.where(leaves | lands, -np.inf, height)

    def _is_up(self, step: int, points: frozenset[int]) -> bool:
        """Whether none of some points stands in a phase, of all repetitions; beyond the ends no."""
        cycle, phase = divmod(step, len(self.phases))
        if cycle and self.repeat is Repeat.NEVER:
            return False
        if cycle % 2 and self.repeat is Repeat.MIRRORED:
            assert self.robot.mirror is not None
            points = frozenset(int(self.robot.mirror.contact[i]) for i in points)
        return points.isdisjoint(self.standing[phase].points)

    def _in_the_air(self, p: int, foot: frozenset[int]) -> tuple[int, int]:
        """How many phases a foot has been in the air before one, and will be after."""
        most = 2 * len(self.phases)
        before = next(k for k in range(most + 1) if k == most or not self._is_up(p - 1 - k, foot))
        after = next(k for k in range(most + 1) if k == most or not self._is_up(p + 1 + k, foot))
        return before, after
