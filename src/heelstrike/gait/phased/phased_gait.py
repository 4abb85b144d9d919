"""A gait over a phase variable: where the joints are when the robot is so far in its step.

θ = c · q + const. rises from one touchdown to the next, for instance the angle of the stance leg
against the vertical. Where time told a gait what to do, θ does: q_actuated = h_d(θ), the *virtual
constraints* of Westervelt, Grizzle and Koditschek (2003), *Hybrid zero dynamics of planar biped
walkers*, IEEE Transactions on Automatic Control 48(1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike

from heelstrike import dynamics
from heelstrike.arguments import check_fields
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import Gait
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.phased.series import fitted, interpolated
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sides.mirror import Mirror

# A contact point with a smaller radius (m) is a point; files of MuJoCo's format want a positive.
POINT_FOOT = 1e-9
# Instants of a step at which a gait in time is looked at, for each coefficient that is fitted.
INSTANTS = 8


@dataclass(frozen=True, eq=False, kw_only=True)
class PhasedGait:
    """Joint positions over a phase of the robot, for a robot that stands on points.

    Raises
    ------
    GaitError
        If the robot is another kind of robot, or numbers contradict each other.
    """

    robot: Robot
    """A floating robot with two mirrored feet of one contact point each, all joints actuated."""
    stance_foot: int = 0
    """Index in ``robot.feet`` of the foot that stands; on the other one everything is mirrored."""
    phase: Floats
    """(nv,) The phase is θ = phase · q, in rad. It must contain the trunk's pitch and neither x nor
    z."""
    phase_range: tuple[float, float]
    """θ at the beginning and at the end of a step."""
    coefficients: Floats
    """(terms, nu) Chebyshev series of the actuated joints over the range, those of T₀ first
    (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, GaitError)
        check_robot(self.robot)
        _check_foot(self.stance_foot)
        phase = np.array(self.phase, dtype=np.float64)
        coefficients = np.array(self.coefficients, dtype=np.float64)
        first, last = (float(end) for end in self.phase_range)
        if phase.shape != (self.robot.nv,) or not np.all(np.isfinite(phase)):
            raise GaitError(f"phase must be {self.robot.nv} finite numbers, got {self.phase!r}")
        if np.any(phase[:2] != 0.0) or phase[2] == 0.0:
            raise GaitError(
                "a phase must contain the trunk's pitch, which no motor moves, and not its x or z: "
                f"got {phase[0]:g} x + {phase[1]:g} z + {phase[2]:g} pitch"
            )
        if coefficients.ndim != 2 or coefficients.shape[1] != self.robot.nu:
            raise GaitError(
                f"coefficients must have shape (terms, {self.robot.nu}), got {coefficients.shape}"
            )
        if not (np.all(np.isfinite(coefficients)) and -np.inf < first < last < np.inf):
            raise GaitError(
                f"a phase must rise: phase_range {self.phase_range} and all coefficients must be "
                "finite numbers"
            )
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "phase_range", (first, last))

    @classmethod
    def from_bezier(
        cls,
        robot: Robot,
        points: ArrayLike,
        *,
        phase: Mapping[str, float] | None = None,
        phase_range: tuple[float, float],
        stance_foot: int = 0,
    ) -> PhasedGait:
        """Make a gait of Bézier curves, as virtual constraints are usually published.

        Parameters
        ----------
        robot : Robot
            The robot.
        points : (nu, degree + 1) array
            Coefficients of the Bernstein polynomials of s = (θ − θ₀)/(θ₁ − θ₀), in the order of the
            actuators (rad).
        phase : mapping of str to float, optional
            Factors of the coordinates in θ, by joint name; by default those of the angle of the
            line from stance foot to hip near the reference posture.
        phase_range : (2,) float
            θ₀ and θ₁ (rad).
        stance_foot : int
            Foot that stands.

        Returns
        -------
        PhasedGait
            The gait.

        Raises
        ------
        GaitError
            If the robot or the numbers do not fit.
        """
        factors = phase_of(robot, stance_foot, phase)
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[0] != robot.nu:
            raise GaitError(
                f"points must have a row of Bézier coefficients for each of the {robot.nu} "
                f"actuators, got shape {points.shape}"
            )
        degree = points.shape[1] - 1
        order = np.arange(degree + 1)
        choices = np.array([math.comb(degree, each) for each in order])

        def bezier(x: Floats) -> Floats:
            s = 0.5 * (x[:, None] + 1.0)
            curve: Floats = (choices * s**order * (1.0 - s) ** (degree - order)) @ points.T
            return curve

        return cls(
            robot=robot,
            stance_foot=stance_foot,
            phase=factors,
            phase_range=phase_range,
            coefficients=interpolated(bezier, degree),
        )

    @classmethod
    def from_gait(
        cls,
        robot: Robot,
        gait: Gait | Motion,
        *,
        phase: Mapping[str, float] | None = None,
        degree: int = 24,
    ) -> PhasedGait:
        """Read a gait in time over a phase instead.

        Both ends of the step, values and slopes, are those of the gait; between them the series of
        that degree with the least squared error is taken.

        Parameters
        ----------
        robot : Robot
            The robot.
        gait : Gait or Motion
            A gait on point feet, designed for it; or a motion that stands on one point foot and
            goes on with its mirror image.
        phase : mapping of str to float, optional
            As in :meth:`from_bezier`.
        degree : int
            Degree of the polynomials, 3 or more.

        Returns
        -------
        PhasedGait
            The gait.

        Raises
        ------
        GaitError
            If the gait is on flat feet or of another robot, or the phase does not rise throughout.
        """
        for name, given, kind in (("robot", robot, Robot), ("gait", gait, Gait | Motion)):
            if not isinstance(given, kind):
                raise GaitError(
                    f"{name} must be a {name.capitalize()}, got {type(given).__name__}: "
                    "from_gait(robot, gait)"
                )
        check_robot(robot)
        if isinstance(gait, Motion):
            stance_foot, duration, at = _course_of_motion(robot, gait)
        else:
            stance_foot, duration, at = _course_of_gait(robot, gait)
        if not (isinstance(degree, (int, np.integer)) and degree >= 3):
            raise GaitError(
                f"degree must be a whole number, 3 or more to meet both ends of a step; got "
                f"{degree!r}"
            )
        factors = phase_of(robot, stance_foot, phase)
        time = np.linspace(0.0, duration, INSTANTS * (degree + 1) + 1)
        driven = robot.model.actuator_joint
        place, speed = at(time, 0), at(time, 1)
        theta, rate = place @ factors, speed @ factors
        if not np.all(rate > 0.0):
            raise GaitError(
                f"the phase does not rise at {time[np.argmax(rate <= 0.0)]:.4g} s of the step; "
                "name other factors (phase=)"
            )
        ends = np.array([theta[0], theta[-1]])
        x = 2.0 * (theta - ends[0]) / (ends[1] - ends[0]) - 1.0
        slopes = 0.5 * (ends[1] - ends[0]) * speed[[0, -1]][:, driven]
        slopes = slopes / rate[[0, -1], None]
        return cls(
            robot=robot,
            stance_foot=stance_foot,
            phase=factors,
            phase_range=(float(ends[0]), float(ends[1])),
            coefficients=fitted(x, place[:, driven], slopes, degree),
        )

    def joints(self, theta: ArrayLike, *, order: int = 0) -> Floats:
        """Return joint positions at a phase, or their derivatives by θ, (..., nu).

        Parameters
        ----------
        theta : array_like
            Phases (rad), of any shape.
        order : int
            0 for positions, 1 and 2 for derivatives.

        Returns
        -------
        (..., nu) float
            Positions (rad), or derivatives.
        """
        theta = np.asarray(theta, dtype=np.float64)
        series = [
            Chebyshev(one, domain=list(self.phase_range)).deriv(order)
            for one in self.coefficients.T
        ]
        return np.stack([one(theta) for one in series], axis=-1)

    def phase_at(self, q: ArrayLike) -> float:
        """Return the phase of a position.

        Parameters
        ----------
        q : (nq,) array
            Position in which `stance_foot` stands.

        Returns
        -------
        float
            θ in rad.
        """
        return float(self.phase @ np.asarray(q, dtype=np.float64))

    def joint_mirror(self) -> Floats:
        """Return the matrix that mirrors errors or velocities of the actuated joints.

        Returns
        -------
        (nu, nu) float
            Of entries -1, 0 and 1.
        """
        mirror = self._mirror
        matrix = np.zeros((self.robot.nu, self.robot.nu))
        matrix[np.arange(self.robot.nu), mirror.joint] = mirror.sign
        return matrix

    def on_both_feet(self) -> tuple[Floats, Floats]:
        """Return the phase on either foot.

        Returns
        -------
        (2, nv) and (2,) float
            Factors of the coordinates while foot 0 and foot 1 stand, and what is constant (rad).
        """
        mirror = self.robot.mirror
        assert mirror is not None  # see check_robot
        factors, constant = np.zeros((2, self.robot.nv)), np.zeros(2)
        factors[self.stance_foot] = self.phase
        np.add.at(factors[1 - self.stance_foot], mirror.joint, self.phase * mirror.sign)
        constant[1 - self.stance_foot] = self.phase @ mirror.offset
        return factors, constant

    def coefficients_on_both_feet(self) -> Floats:
        """Return the series of the joints on either foot.

        Returns
        -------
        (2, terms, nu) float
            `coefficients` while foot 0 and foot 1 stand.
        """
        mirrored = self.coefficients @ self.joint_mirror().T
        mirrored[0] += self._mirror.offset
        both = [self.coefficients, mirrored]
        return np.array(both if self.stance_foot == 0 else both[::-1])

    @property
    def _mirror(self) -> Mirror:
        """Mirror of vectors over the actuated joints."""
        mirror = self.robot.mirror
        assert mirror is not None  # see check_robot
        return mirror.among(self.robot.model.actuator_joint)

    def with_start(self, theta: float, position: Floats, slope: Floats) -> PhasedGait:
        """Return a gait that begins elsewhere and ends as this one.

        Parameters
        ----------
        theta : float
            Phase at the beginning (rad).
        position, slope : (nu,) float
            Joint positions there (rad), and their derivatives by θ.

        Returns
        -------
        PhasedGait
            This gait and the cubic that changes its beginning.
        """
        last = self.phase_range[1]
        width = last - theta
        missing = position - self.joints(theta)
        bend = width * (slope - self.joints(theta, order=1))

        def changed(x: Floats) -> Floats:
            s = 0.5 * (x[:, None] + 1.0)
            cubic = (1.0 - s) ** 2 * ((1.0 + 2.0 * s) * missing + s * bend)
            return self.joints(theta + width * s[:, 0]) + cubic

        degree = max(len(self.coefficients) - 1, 3)
        return replace(self, phase_range=(theta, last), coefficients=interpolated(changed, degree))

    def with_end(self, theta: float) -> PhasedGait:
        """Return the same gait on a range of the phase that ends elsewhere.

        Parameters
        ----------
        theta : float
            Phase at the end (rad).

        Returns
        -------
        PhasedGait
            The gait.
        """
        first = self.phase_range[0]
        half = 0.5 * (theta - first)
        coefficients = interpolated(
            lambda x: self.joints(first + half * (x + 1.0)), len(self.coefficients) - 1
        )
        return replace(self, phase_range=(first, theta), coefficients=coefficients)


Course = Callable[[Floats, int], Floats]
"""Of times of a step and an order, to coordinates or derivatives of them, (times, nv); where the
trunk is is left out."""


def _course_of_gait(robot: Robot, gait: Gait) -> tuple[int, float, Course]:
    """Foot that stands in a gait, duration of its step (s), and what it does."""
    gait.check_joints(robot)
    if not gait.point_feet:
        raise GaitError(
            "virtual constraints are for gaits on point feet: on a flat foot nothing is left "
            "without a motor, and ComputedTorque follows the gait"
        )

    def at(time: Floats, order: int) -> Floats:
        whole = np.zeros((len(time), robot.nv))
        whole[:, 2] = gait.pitch(time, order=order)
        whole[:, robot.model.actuator_joint] = gait.in_step(time, order=order)
        return whole

    return gait.stance_foot, gait.step_duration, at


def _course_of_motion(robot: Robot, motion: Motion) -> tuple[int, float, Course]:
    """Return the same of a motion that is such a step."""
    motion.check_robot(robot)
    stand = [{robot.contact_names.index(name) for name in one.contacts} for one in motion.phases]
    feet = [foot for foot, each in enumerate(robot.feet) if stand[0] == set(each.contacts)]
    if len(motion.phases) > 1 or not feet or motion.repeat is not Repeat.MIRRORED:
        raise GaitError(
            "virtual constraints need one phase variable for all of a step, which one foot and its "
            "mirror image take in turn; in flight or on two feet there is none. This motion has "
            f"{len(motion.phases)} phases on {', '.join(map(str, map(len, stand)))} points; "
            "hs.MotionLQR follows it"
        )
    (phase,) = motion.phases

    def at(time: Floats, order: int) -> Floats:
        whole = phase.coordinates(time, order=order)
        whole[:, :2] = 0.0
        return whole

    return feet[0], phase.duration, at


def check_robot(robot: Robot) -> None:
    """Refuse robots on which virtual constraints leave other than one degree of freedom.

    Raises
    ------
    GaitError
        That names what is in the way.
    """
    if not robot.floating or robot.mirror is None or len(robot.feet) != 2:
        raise GaitError(
            "virtual constraints need a floating robot with two mirrored feet; "
            f"robot {robot.name!r} is not one"
        )
    driven = set(robot.model.actuator_joint.tolist())
    free = [robot.joint_names[j] for j in range(3, robot.nv) if j not in driven]
    if free or driven & {0, 1, 2}:
        raise GaitError(
            "virtual constraints need a motor at every joint and none at the trunk; robot "
            f"{robot.name!r} " + (f"has none at {', '.join(free)}" if free else "moves its trunk")
        )
    refuse_loops(robot, "virtual constraints", GaitError)
    for foot in robot.feet:
        if len(foot.contacts) != 1 or robot.model.contact_radius[foot.contacts[0]] > POINT_FOOT:
            raise GaitError(
                f"virtual constraints are for point feet; foot {foot.name!r} of robot "
                f"{robot.name!r} is none. ComputedTorque walks on flat feet."
            )


def phase_of(robot: Robot, stance_foot: int, factors: Mapping[str, float] | None) -> Floats:
    """Return the factors of a phase, (nv,): those named, or of the angle of the stance leg."""
    check_robot(robot)
    _check_foot(stance_foot)
    if factors is not None:
        if not isinstance(factors, Mapping) or not all(
            isinstance(each, (int, float, np.integer, np.floating)) for each in factors.values()
        ):
            raise GaitError(
                f"a phase is factors by the names of coordinates, {{'hip': 1.0, ...}}; got "
                f"{factors!r}"
            )
        unknown = set(factors) - set(robot.joint_names)
        if unknown:
            raise GaitError(
                f"phase names {', '.join(sorted(unknown))}; the coordinates of robot "
                f"{robot.name!r} are {', '.join(robot.joint_names)}"
            )
        return np.array([float(factors.get(name, 0.0)) for name in robot.joint_names])
    (contact,) = robot.feet[stance_foot].contacts
    leg = [int(robot.model.contact_link[contact])]
    while (parent := int(robot.model.parent[leg[-1]])) > 2:
        leg.append(parent)
    q = robot.model.reference
    link = leg[-1]  # the femur, whose origin is the hip
    hip = dynamics.point_position(robot, q, link, (0.0, 0.0))
    foot = dynamics.contact_positions(robot, q)[contact]
    rows = (
        dynamics.point_jacobian(robot, q, link, (0.0, 0.0))[:2]
        - dynamics.contact_jacobian(robot, q)[contact][::-1]
    )
    line = hip - foot
    across = np.array([line[1], -line[0]]) / (line @ line)
    phase = across @ rows
    phase[:2] = 0.0
    return np.asarray(phase, dtype=np.float64)


def _check_foot(stance_foot: int) -> None:
    if stance_foot not in (0, 1):
        raise GaitError(f"stance_foot must be 0 or 1, got {stance_foot!r}")
