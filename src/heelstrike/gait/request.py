"""What is asked of the optimiser, checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from heelstrike.arguments import at_least, at_most, one_of
from heelstrike.dynamics.queries.following import Drive, drive_of
from heelstrike.errors import GaitError, InfeasibleGaitError, RobotError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.cost import costs_of
from heelstrike.gait.gait import Gait
from heelstrike.gait.sole import reach, sole, standing_height
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sides.mirror import Mirror

JointRanges = Mapping[str, tuple[float, float]]
"""Lowest and highest position (rad, m for a slide) of joints by name."""

STANCE_FOOT = 0
"""Index of the foot that stands during the first step."""

NODES = 26
"""Default intervals of the Gauss-Lobatto grid of a step on flat feet."""
MESH = 12
"""Default intervals of the mesh of a step on point feet."""

STEP_UNITS = {"step_length": "m", "step_duration": "s", "speed": "m/s"}
"""What may be asked of a step."""
NUMBERS = {
    **STEP_UNITS,
    **dict.fromkeys(("friction", "clearance", "zmp_margin", "force_margin"), ""),
    "joint_speed_limit": "rad/s",
}
"""Numbers that are asked for: the unit of one that must be positive; others are not negative."""

STEEPEST = 1.0
"""Slope (rad) from which on no gait is looked for."""

SHORTEST_STEP, LONGEST_STEP = 0.2, 40.0
"""Step durations that are considered, in units of the pendulum time sqrt(height / gravity)."""
SHORTEST_FREE, LONGEST_FREE = 0.5, 8.0
"""The same where the optimiser chooses the duration."""
LEAST_FREE_LENGTH = 0.05
"""Least step length, in standing heights, where the optimiser chooses it."""


@dataclass(eq=False, kw_only=True)
class Request:
    """A request for a gait, checked: the arguments of :func:`heelstrike.gait.optimize_gait`.

    What follows from the others is filled in: the margins and intervals that were not given, and
    where two of length, duration and speed fix the step, its length and duration, without a speed.

    Attributes
    ----------
    mirror : Mirror
        The robot's exchange of left and right.
    drive : Drive
        Which joints have motors, and which follow from these by closed loops and couplings.
    stance, swing : Sole
        The feet in the first step.
    height : float
        Height (m) of the trunk above the soles when the robot stands in its reference
        configuration.
    lower, upper : (nv,) arrays
        Ends of the ranges that the joints keep to (rad, m for a slide).
    reach : float
        Upper bound of the distance between the feet (m).
    profiles : tuple of ClearanceProfile
        Shapes of the swing foot's clearance, to be tried in this order.

    Raises
    ------
    GaitError
        If the robot cannot walk this way or an argument makes no sense.
    InfeasibleGaitError
        If the step is longer than the legs reach.
    """

    robot: Robot
    step_length: float | None
    step_duration: float | None
    speed: float | None
    friction: float
    clearance: float
    clearance_profile: ClearanceProfile | str | None
    zmp_margin: float
    force_margin: float
    joint_speed_limit: float
    joint_ranges: JointRanges | None
    impact: bool
    intervals: int
    starts: int
    slope: float = 0.0
    rise: float = 0.0
    cost: Any = "torque"
    warm_start: Gait | None = None

    def __post_init__(self) -> None:
        robot = self.robot
        refuse_loops(robot, "gait design", GaitError, loops=False)
        self.mirror, self.drive = _mirror_of(robot), _drive_of(robot)
        self.lower, self.upper = ranges_kept(robot, self.mirror, self.joint_ranges)
        self.stance, self.swing = sole(robot, STANCE_FOOT), sole(robot, 1 - STANCE_FOOT)
        self.height = standing_height(robot, self.stance)
        self.reach = reach(robot, (self.stance, self.swing), self.lower, self.upper)
        self.profiles = _profiles(self.clearance_profile, self.impact, self.warm_start)
        flat = self.stance.flat
        if not flat and self.zmp_margin is not None:
            raise GaitError(
                f"robot {robot.name!r} has point feet: the zero moment point is where they stand, "
                "and zmp_margin means nothing. Leave it out."
            )
        defaults = {
            "zmp_margin": 0.2 * self.stance.half_length,
            "force_margin": 0.1 * robot.weight,
            "intervals": NODES if flat else MESH,
        }
        for name, value in defaults.items():
            if getattr(self, name) is None:
                setattr(self, name, value)
        for name, unit in NUMBERS.items():
            self._check_number(name, unit)
        for name, least, most in (("intervals", 10 if flat else 4, 1000), ("starts", 1, 100)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer):
                raise GaitError(f"{name} must be a whole number, got {value!r}")
            if not least <= value <= most:
                raise GaitError(f"{name} must be between {least} and {most}, got {value}")
        self._check_ground()
        self._check_warm_start()
        self.cost = costs_of(self.cost)
        self._check_step()
        if flat and self.zmp_margin >= self.stance.half_length:
            raise GaitError(
                f"zmp_margin = {self.zmp_margin:g} m is too large: the sole reaches only "
                f"{self.stance.half_length:g} m to each side of its middle. Ask for "
                "less."
            )
        self._check_weight()

    def _check_weight(self) -> None:
        """Refuse forces that cannot carry the weight: over a step, that is what the ground does."""
        robot, carried = self.robot, self.robot.weight * float(np.cos(self.slope))
        if self.force_margin >= carried:
            more = f"the robot's weight, {robot.weight:g} N, which"
            if self.slope:
                more = f"the {carried:g} N of the robot's weight that, across this slope,"
            # On less steep ground there may be such a gait.
            refused = GaitError if self.force_margin >= robot.weight else InfeasibleGaitError
            raise refused(
                f"force_margin = {self.force_margin:g} N is more than {more} the ground carries on "
                "average. Ask for less."
            )
        check_slope(robot, self.slope, self.friction, self._scale)

    def _check_number(self, name: str, unit: str) -> None:
        """Make a number a float, once it is one: positive, of some unit, or not negative."""
        value = getattr(self, name)
        if value is None:
            return
        number = isinstance(value, int | float | np.integer | np.floating)
        finite = number and not isinstance(value, bool) and math.isfinite(value)
        free = name == "joint_speed_limit" and value == math.inf
        if not (finite or free) or not (value > 0.0 if unit else value >= 0.0):
            what = f"a positive number ({unit})" if unit else "a number that is not negative"
            raise GaitError(f"{name} must be {what}, got {value!r}")
        setattr(self, name, float(value))

    def _check_ground(self) -> None:
        """Make slope and rise floats, once they are ground that can be walked upon."""
        for name, unit, most in (("slope", "rad", STEEPEST), ("rise", "m", self.reach)):
            value = getattr(self, name)
            number = isinstance(value, int | float | np.integer | np.floating)
            if isinstance(value, bool) or not number or not abs(value) < most:
                raise GaitError(
                    f"{name} must be a number between {-most:.3g} and {most:.3g} {unit}, positive "
                    f"if the ground ascends ahead, got {value!r}"
                )
            setattr(self, name, float(value))
        if self.slope and self.rise:
            raise GaitError(
                "slope and rise are both given. On a slope the feet are turned by it and rise is "
                "zero; on stairs they are level and slope is zero. Leave one of them out."
            )

    def _check_warm_start(self) -> None:
        """Refuse a gait of other joints, or on other feet, to start from."""
        gait = self.warm_start
        if gait is None:
            return
        gait.check_joints(self.robot)
        if gait.point_feet == self.stance.flat or len(gait.phases) != 1:
            raise GaitError(
                f"warm_start: {gait!r} does not walk in single support on the feet of robot "
                f"{self.robot.name!r}. Start from a gait that optimize_gait designed for it."
            )

    def _check_step(self) -> None:
        """Fill in what two of length, duration and speed say of the third, and look at them."""
        length, duration, speed = self.step_length, self.step_duration, self.speed
        if speed is not None and duration is not None and length is not None:
            raise GaitError(
                "step_length, step_duration and speed are all given; the speed is the length over "
                "the duration, so give two of them at most."
            )
        if speed is not None and duration is not None:
            length, self.speed = speed * duration, None
        elif speed is not None and length is not None:
            duration, self.speed = length / speed, None
        self.step_length, self.step_duration = length, duration
        if length is not None and np.hypot(length, self.rise) >= self.reach:
            raise InfeasibleGaitError(
                f"robot {self.robot.name!r} cannot take a step of {length:g} m: stretched flat "
                f"out, its legs put the feet less than {self.reach:.4g} m apart."
            )
        shortest, longest = (k * self.pendulum_time for k in (SHORTEST_STEP, LONGEST_STEP))
        if duration is not None and not shortest <= duration <= longest:
            raise InfeasibleGaitError(
                f"a step of {duration:g} s is out of range for robot {self.robot.name!r}: with a "
                f"trunk {self.height:.3g} m above the ground, steps between {shortest:.2g} s and "
                f"{longest:.2g} s are considered."
            )

    @property
    def under_foot(self) -> Floats:
        """(2,) Slope of the ground (rad), and rise of the next foothold over that plane (m)."""
        return np.array([self.slope, self.rise])

    @property
    def cone(self) -> float:
        """Coefficient of friction under the feet: that of the ground, as their points scale it."""
        return self.friction * self._scale

    @property
    def _scale(self) -> float:
        """What friction of the ground is multiplied by under the feet."""
        under = [i for foot in self.robot.feet for i in foot.contacts]
        return float(self.robot.model.friction_scale[under].min())

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
        given = [name for name in STEP_UNITS if getattr(self, name) is not None]
        asked = [f"{name} = {getattr(self, name):g} {STEP_UNITS[name]}" for name in given]
        ground = {"slope": (self.slope, "rad"), "rise": (self.rise, "m")}
        asked += [f"{name} = {value:g} {unit}" for name, (value, unit) in ground.items() if value]
        return ", ".join([*asked, f"friction = {self.friction:g}"])


def check_slope(robot: Robot, slope: float, friction: float, scale: float) -> None:
    """Refuse slopes on which friction cannot carry a robot that repeats its motion.

    In the mean over a repetition the ground carries the weight, by forces and by impulses of
    landings, and the mean of what is in a cone is in it, too. Gravity points down.

    Parameters
    ----------
    robot : Robot
        The robot.
    slope : float
        Angle of the ground (rad).
    friction : float
        Coefficient of friction of the ground.
    scale : float
        What that is multiplied by under the feet.

    Raises
    ------
    InfeasibleGaitError
        If friction is too small.
    """
    steepest = float(np.arctan(friction * scale))
    if abs(slope) > steepest:
        asked = "no friction is enough where it is multiplied by 0 under the feet."
        if scale > 0.0:
            least = float(np.tan(abs(slope))) / scale
            asked = (
                f"the ground needs friction of at least {at_least(least)}. Ask for that, or for "
                f"slopes up to {at_most(steepest)} rad."
            )
        raise InfeasibleGaitError(
            f"robot {robot.name!r} cannot stay on a slope of {slope:g} rad with friction = "
            f"{friction:g}: to carry its weight there, {asked}"
        )


def _profiles(
    profile: ClearanceProfile | str | None, impact: bool, start: Gait | None
) -> tuple[ClearanceProfile, ...]:
    if profile is None:
        both = (ClearanceProfile.PARABOLA, ClearanceProfile.SMOOTH)
        flat = start is not None and start.clearance_profile is ClearanceProfile.SMOOTH
        return both if impact and not flat else both[1:]
    return (one_of(ClearanceProfile, "clearance_profile", profile, GaitError),)


def _mirror_of(robot: Robot) -> Mirror:
    """Return the mirror image of a robot that can walk, or refuse another."""
    name = f"robot {robot.name!r}"
    if robot.constraints:
        raise GaitError(
            f"{name} is held by constraints from outside, of which no gait knows: design the gait "
            "for the robot without them"
        )
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
    if not np.hypot(*robot.model.gravity) > 0.0 or robot.model.gravity[0] != 0.0:
        raise GaitError(
            f"{name}: gravity is {robot.model.gravity} m/s²; a gait on level ground needs it "
            "to point down."
        )
    return mirror


def _drive_of(robot: Robot) -> Drive:
    """Return which joints have motors and which follow from them, or refuse a robot."""
    name, model = f"robot {robot.name!r}", robot.model
    driven = np.sort(model.actuator_joint).tolist()
    passive = [robot.joint_names[j] for j in range(3, robot.nv) if j not in driven]
    trunk = [robot.joint_names[j] for j in driven if j < 3]
    tree = not model.loops + model.couplings
    if trunk or (tree and driven != list(range(3, robot.nv))):
        raise GaitError(
            f"{name}: the optimiser needs a motor at every joint and none at the trunk; "
            + (f"without one: {', '.join(passive)}. " if passive else "")
            + (f"driven although of the trunk: {', '.join(trunk)}." if trunk else "")
        )
    if np.any(model.loop_link < 0):
        raise GaitError(f"{name}: a closed loop ties it to the world, so that it cannot walk.")
    try:
        return drive_of(robot)
    except RobotError as error:
        raise GaitError(f"{error} A gait needs one motor for each way in which joints move.") from (
            None
        )


def ranges_kept(robot: Robot, mirror: Mirror, asked: JointRanges | None) -> tuple[Floats, Floats]:
    """Lowest and highest position of every coordinate, (nv,) each: the robot's ranges and `asked`.

    Every step of a gait mirrors the one before, so that what is asked of a joint holds for its
    counterpart on the other side, too.

    Parameters
    ----------
    robot : Robot
        The robot.
    mirror : Mirror
        Its exchange of left and right.
    asked : mapping of str to (float, float), optional
        Ranges by the names of joints (rad, m for a slide); an infinite end leaves the robot's own.

    Raises
    ------
    GaitError
        If there is no joint of that name, or if a range is none or has no part in the robot's.
    """
    model = robot.model
    lower, upper = model.lower, model.upper
    joints = {name: j for j, name in enumerate(robot.joint_names) if j > 2}
    try:
        named: dict[str, Any] = dict(asked or {})
    except (TypeError, ValueError):
        raise GaitError(
            f"joint_ranges must give ranges by the names of joints, got {asked!r}"
        ) from None
    for name, given in named.items():
        if name not in joints:
            raise GaitError(
                f"joint_ranges: robot {robot.name!r} has no joint {name!r}; its joints are "
                f"{', '.join(joints)}."
            )
        j, (low, high) = joints[name], _ends(name, given)
        ends = np.full((2, robot.nv), [[-np.inf], [np.inf]])
        ends[:, j] = low, high
        for ranges in (ends, mirror.ranges(*ends)):
            lower, upper = np.maximum(lower, ranges[0]), np.minimum(upper, ranges[1])
        pair = [j, mirror.joint[j]]
        if np.any(lower[pair] >= upper[pair]):
            raise GaitError(
                f"joint_ranges: {name!r} from {low:g} to {high:g} has no part in the range that "
                f"robot {robot.name!r} gives it, {model.lower[j]:g} to {model.upper[j]:g}, or in "
                "what is asked of its counterpart."
            )
    return lower, upper


def _ends(name: str, ends: Any) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in ends)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not low < high:
        raise GaitError(
            f"joint_ranges: {name!r} needs its lowest and highest position, two numbers in rising "
            f"order (rad; m for a slide), got {ends!r}"
        )
    return low, high
