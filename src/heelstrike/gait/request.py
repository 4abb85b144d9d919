"""What is asked of the optimiser, checked before anything is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.joint_ranges import JointRanges, ranges_kept
from heelstrike.gait.sole import Sole, point_sole, sole
from heelstrike.robot.robot import Robot

STANCE_FOOT = 0
"""Index of the foot that stands during the first step."""

NODES = 26
"""Default intervals of the Gauss-Lobatto grid of a step on flat feet."""
MESH = 12
"""Default intervals of the mesh of a step on point feet."""

SHORTEST, LONGEST = 0.2, 40.0
"""Step durations that are considered, in units of the pendulum time sqrt(height / gravity)."""
SHORTEST_FREE, LONGEST_FREE = 0.5, 8.0
"""The same where the optimiser chooses the duration."""
LEAST_FREE_LENGTH = 0.05
"""Least step length, in standing heights, where the optimiser chooses it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """A checked request for a gait; lengths in m, times in s, forces in N.

    Attributes
    ----------
    robot : Robot
        The robot.
    stance, swing : Sole
        Its feet in the first step.
    height : float
        Height of the trunk above the soles when the robot stands in its reference configuration.
    reach : float
        Upper bound of the distance between the feet.
    step_length, step_duration, speed : float or None
        What is prescribed. The speed is None if it follows from the other two.
    friction, clearance, zmp_margin, force_margin, joint_speed_limit : float
        Options, with their defaults filled in.
    lower, upper : (nv,) arrays
        Ends of the ranges that the joints keep to (rad, m for a slide).
    profiles : tuple of ClearanceProfile
        Shapes of the swing foot's clearance, to be tried in this order.
    impact : bool
        Whether the foot lands with an impact.
    intervals, starts : int
        Size of the grid and number of starting points.
    """

    robot: Robot
    stance: Sole
    swing: Sole
    height: float
    reach: float
    step_length: float | None
    step_duration: float | None
    speed: float | None
    friction: float
    clearance: float
    zmp_margin: float
    force_margin: float
    joint_speed_limit: float
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    profiles: tuple[ClearanceProfile, ...]
    impact: bool
    intervals: int
    starts: int

    @property
    def point_feet(self) -> bool:
        """Whether the robot stands on points, without a moment of the ground."""
        return self.stance.half_length == 0.0

    @property
    def pendulum_time(self) -> float:
        """Time scale sqrt(height / gravity), in s."""
        return float(np.sqrt(self.height / np.hypot(*self.robot.model.gravity)))

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Least and greatest step length, equal if it was given (m)."""
        if self.step_length is not None:
            return self.step_length, self.step_length
        return LEAST_FREE_LENGTH * self.height, self.reach

    @property
    def duration_bounds(self) -> tuple[float, float]:
        """Least and greatest step duration, equal if it was given (s)."""
        if self.step_duration is not None:
            return self.step_duration, self.step_duration
        return SHORTEST_FREE * self.pendulum_time, LONGEST_FREE * self.pendulum_time

    @property
    def free_step(self) -> bool:
        """Whether the optimiser chooses the length or the duration of the step."""
        return self.step_length is None or self.step_duration is None

    def __str__(self) -> str:
        asked = [
            f"{name} = {value:g} {unit}"
            for name, value, unit in (
                ("step_length", self.step_length, "m"),
                ("step_duration", self.step_duration, "s"),
                ("speed", self.speed, "m/s"),
            )
            if value is not None
        ]
        return ", ".join([*asked, f"friction = {self.friction:g}"])


def checked_request(
    robot: Robot,
    *,
    step_length: float | None,
    step_duration: float | None,
    speed: float | None,
    friction: float,
    clearance: float,
    clearance_profile: ClearanceProfile | str | None,
    zmp_margin: float | None,
    force_margin: float | None,
    joint_speed_limit: float,
    joint_ranges: JointRanges | None,
    impact: bool,
    intervals: int | None,
    starts: int,
) -> Request:
    """Check the arguments of :func:`heelstrike.gait.optimize_gait` and fill in defaults.

    Raises
    ------
    GaitError
        If the robot cannot walk this way or an argument makes no sense.
    InfeasibleGaitError
        If the step is longer than the legs reach.
    """
    _check_robot(robot)
    lower, upper = ranges_kept(robot, joint_ranges)
    points = all(len(foot.contacts) == 1 for foot in robot.feet)
    find = point_sole if points else sole
    stance, swing = find(robot, STANCE_FOOT), find(robot, 1 - STANCE_FOOT)
    _positive("step_length", step_length, "m")
    _positive("step_duration", step_duration, "s")
    _positive("speed", speed, "m/s")
    if step_length is not None and step_duration is not None and speed is not None:
        raise GaitError(
            "step_length, step_duration and speed are all given; the speed is the length over the "
            "duration, so give two of them at most."
        )
    if speed is not None and step_duration is not None:
        step_length = speed * step_duration
    elif speed is not None and step_length is not None:
        step_duration = step_length / speed
    if step_length is not None and step_duration is not None:
        speed = None  # it has done its work
    _not_negative("friction", friction)
    _not_negative("clearance", clearance)
    _positive("joint_speed_limit", joint_speed_limit, "rad/s", infinite=True)
    if points and zmp_margin is not None:
        raise GaitError(
            f"robot {robot.name!r} has point feet: the zero moment point is where they stand, and "
            "zmp_margin means nothing. Leave it out."
        )
    zmp_margin = 0.2 * stance.half_length if zmp_margin is None else zmp_margin
    _not_negative("zmp_margin", zmp_margin)
    if zmp_margin >= stance.half_length and not points:
        raise GaitError(
            f"zmp_margin = {zmp_margin:g} m leaves nothing of the sole, which reaches "
            f"{stance.half_length:g} m to each side of its middle."
        )
    force_margin = 0.1 * robot.weight if force_margin is None else force_margin
    _not_negative("force_margin", force_margin)
    if force_margin >= robot.weight:
        raise GaitError(
            f"force_margin = {force_margin:g} N is more than the robot's weight, "
            f"{robot.weight:g} N, which the ground carries on average."
        )
    if intervals is None:
        intervals = MESH if points else NODES
    _whole("intervals", intervals, 4 if points else 10, 1000)
    _whole("starts", starts, 1, 100)
    height = _standing_height(robot, stance)
    request = Request(
        robot=robot,
        stance=stance,
        swing=swing,
        height=height,
        reach=_reach(robot, stance, swing, lower, upper),
        step_length=None if step_length is None else float(step_length),
        step_duration=None if step_duration is None else float(step_duration),
        speed=None if speed is None else float(speed),
        friction=float(friction),
        clearance=float(clearance),
        zmp_margin=float(zmp_margin),
        force_margin=float(force_margin),
        joint_speed_limit=float(joint_speed_limit),
        lower=lower,
        upper=upper,
        profiles=_profiles(clearance_profile, impact),
        impact=bool(impact),
        intervals=int(intervals),
        starts=int(starts),
    )
    _check_scale(request)
    return request


def _profiles(profile: ClearanceProfile | str | None, impact: bool) -> tuple[ClearanceProfile, ...]:
    if profile is None:
        both = (ClearanceProfile.PARABOLA, ClearanceProfile.SMOOTH)
        return both if impact else both[1:]
    try:
        return (ClearanceProfile(profile),)
    except ValueError:
        names = ", ".join(repr(known.value) for known in ClearanceProfile)
        raise GaitError(f"clearance_profile must be one of {names}, got {profile!r}") from None


def _check_robot(robot: Robot) -> None:
    name = f"robot {robot.name!r}"
    if not robot.floating:
        raise GaitError(
            f"{name} has no floating trunk: its first three coordinates must be the trunk's x, z "
            "and pitch for it to walk."
        )
    if robot.nc == 0:
        raise GaitError(f"{name} has no contact points, so it cannot stand. Give it feet.")
    if len(robot.feet) != 2:
        raise GaitError(f"{name} has {len(robot.feet)} feet; a gait is designed for two.")
    mirror = robot.mirror
    if mirror is None or mirror.foot.tolist() != [1, 0]:
        raise GaitError(
            f"{name} is not symmetric: its left and right legs do not mirror each other, and every "
            "step of a gait mirrors the one before."
        )
    if np.any(mirror.joint[:3] != np.arange(3)) or np.any(mirror.sign[:3] != 1.0):
        raise GaitError(f"{name}: the mirror image must leave the trunk's coordinates alone.")
    driven = np.sort(robot.model.actuator_joint).tolist()
    if driven != list(range(3, robot.nv)):
        passive = [robot.joint_names[j] for j in range(3, robot.nv) if j not in driven]
        trunk = [robot.joint_names[j] for j in driven if j < 3]
        raise GaitError(
            f"{name}: the optimiser needs a motor at every joint and none at the trunk; "
            + (f"without one: {', '.join(passive)}. " if passive else "")
            + (f"driven although of the trunk: {', '.join(trunk)}." if trunk else "")
        )
    if not np.hypot(*robot.model.gravity) > 0.0 or robot.model.gravity[0] != 0.0:
        raise GaitError(
            f"{name}: gravity is {robot.model.gravity} m/s²; a gait on level ground needs it "
            "to point down."
        )


def _check_scale(request: Request) -> None:
    length, duration = request.step_length, request.step_duration
    if length is not None and length >= request.reach:
        raise InfeasibleGaitError(
            f"robot {request.robot.name!r} cannot take a step of {length:g} m: stretched flat out, "
            f"its legs put the feet less than {request.reach:.4g} m apart."
        )
    shortest, longest = (k * request.pendulum_time for k in (SHORTEST, LONGEST))
    if duration is not None and not shortest <= duration <= longest:
        raise InfeasibleGaitError(
            f"a step of {duration:g} s is out of range for robot {request.robot.name!r}: with a "
            f"trunk {request.height:.3g} m above the ground, steps between {shortest:.2g} s and "
            f"{longest:.2g} s are considered."
        )


def _positive(name: str, value: float | None, unit: str, *, infinite: bool = False) -> None:
    if value is None:
        return
    if not _is_number(value) or not (value > 0.0 and (infinite or math.isfinite(value))):
        raise GaitError(f"{name} must be a positive number ({unit}), got {value!r}")


def _not_negative(name: str, value: float) -> None:
    if not _is_number(value) or not (value >= 0.0 and math.isfinite(value)):
        raise GaitError(f"{name} must be a number that is not negative, got {value!r}")


def _whole(name: str, value: int, lowest: int, highest: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise GaitError(f"{name} must be a whole number, got {value!r}")
    if not lowest <= value <= highest:
        raise GaitError(f"{name} must be between {lowest} and {highest}, got {value}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _standing_height(robot: Robot, stance: Sole) -> float:
    """Height of the trunk above a sole in the reference configuration, in m."""
    model = robot.model
    ground = np.zeros(2)
    link = stance.link
    ground += _turned(stance.point, stance.angle)
    while link > 2:
        ground += model.offset[link]
        link = model.parent[link]
    height = -float(ground[1])
    if not height > 0.0:
        raise GaitError(
            f"robot {robot.name!r}: in its reference configuration the trunk is not above the "
            "feet; give the robot's file a configuration in which it stands."
        )
    return height


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])


def _reach(
    robot: Robot,
    stance: Sole,
    swing: Sole,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
) -> float:
    """Distance of the feet with both legs in one line, an upper bound of any step (m)."""
    model = robot.model
    chains = []
    for foot in (stance, swing):
        chain = []
        link = foot.link
        while link >= 0:
            chain.append(link)
            link = int(model.parent[link])
        chains.append(chain)
    common = set(chains[0]) & set(chains[1])
    total = 0.0
    hips = []
    for chain in chains:
        for link in chain:
            if link in common:
                break
            # The last offset is from the trunk to the hip: only the distance of the hips counts.
            if model.parent[link] in common:
                hips.append(model.offset[link])
            else:
                total += float(np.hypot(*model.offset[link]))
            if model.axis[link, 0] == 0.0:
                span = np.abs([lower[link], upper[link]] - model.reference[link])
                total += float(span.max())
    return total + float(np.hypot(*(hips[0] - hips[1])))
