"""Gaits around one gait: for slopes, and with the feet farther before or behind the hips.

On a slope the walk is sheared: every point of the hips' and the swing foot's paths is raised by the
slope times how far it is before the stance foot, so that the robot is as upright as on level
ground, and the step ends as it began. Where it goes over to the next, two numbers stay: on which
slope it walks, and how far the hips are held back along their path, which takes speed off it
(M. H. Raibert 1986, *Legged robots that balance*, puts the foot before the hip for that).
Legs that would be too short for it make the hips sink. Joints follow by inverse kinematics.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import Chebyshev

from heelstrike import dynamics
from heelstrike.contact.ground import Ground
from heelstrike.dynamics import leg_joints
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.gait.phased.series import fitted
from heelstrike.gait.phased.surface import Surface, make_invariant
from heelstrike.robot.model import Floats

# Postures of a step that are changed, for each coefficient that is fitted to them.
POSTURES = 6
# Degree of the series of the energy.
LEVELS = 32
# On slopes the hips are brought forward by no more than this part of the largest shift.
SOUGHT = 0.6


class Postures:
    """Postures of a gait over its step, and what they are like on other ground.

    Parameters
    ----------
    gait : PhasedGait
        The gait.
    """

    def __init__(self, gait: PhasedGait) -> None:
        self.gait = gait
        surface, robot = Surface(gait), gait.robot
        phases = np.linspace(*gait.phase_range, POSTURES * len(gait.coefficients) + 1)
        self._legs = (gait.stance_foot, 1 - gait.stance_foot)
        hips = [leg_joints(robot)[leg][0] for leg in self._legs]
        self._q = np.array([surface.position(theta) for theta in phases])
        self._feet = np.array([surface.feet(q) for q in self._q])
        self._hips = np.array(
            [[dynamics.point_position(robot, q, hip, (0.0, 0.0)) for hip in hips] for q in self._q]
        )
        self._length = np.hypot(*np.moveaxis(self._hips - self._feet, -1, 0)).max()

    def changed(self, slope: float, shift: float) -> PhasedGait:
        """Return the gait for a slope (its tangent), the hips held back by a shift (m).

        Raises
        ------
        GaitError
            If the legs do not get there, or the phase does not rise.
        """
        robot, gait = self.gait.robot, self.gait
        feet, hips = self._feet.copy(), self._hips.copy()
        feet[..., 1] += slope * feet[..., 0]
        raised = slope * (hips[:, 0, 0] - shift)
        hips[..., 0] -= shift
        hips[..., 1] += raised[:, None]
        ahead, above = np.moveaxis(hips - feet, -1, 0)
        # Beyond their length no height helps; inverse kinematics says what is missing.
        reach = np.sqrt(np.maximum(self._length**2 - ahead**2, 0.0))
        sunk = max(0.0, float(np.max(above - reach)))
        q = self._q.copy()
        q[:, 0] -= shift
        q[:, 1] += raised - sunk
        for row, places in zip(q, feet, strict=True):
            for leg, place in zip(self._legs, places, strict=True):
                found = dynamics.inverse_kinematics(robot, row, leg, place)
                if not found.reached:
                    raise GaitError(
                        f"on a slope of {slope:.3g} with the hips held back by {shift:.3g} m a leg "
                        f"of robot {robot.name!r} misses its place by {found.residual:.2g} m; ask "
                        "for less, or for a gait with more bent knees"
                    )
                row[:] = found.q
        theta = q @ gait.phase
        if not np.all(np.diff(theta) > 0.0):
            raise GaitError(
                f"on a slope of {slope:.3g} with the hips held back by {shift:.3g} m the phase "
                "does not rise throughout; ask for less, or for a gait with more bent knees"
            )
        x = 2.0 * (theta - theta[0]) / (theta[-1] - theta[0]) - 1.0
        joints = q[:, robot.model.actuator_joint]
        from scipy.interpolate import CubicSpline  # takes half a second to import

        slopes = CubicSpline(x, joints).derivative()(np.array([-1.0, 1.0]))
        return replace(
            gait,
            phase_range=(float(theta[0]), float(theta[-1])),
            coefficients=fitted(x, joints, slopes, len(gait.coefficients) - 1),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class StepFamily:
    """A gait and its like, for slopes and with the hips held back or brought forward.

    All numbers of a gait in between are quadratic in slope and shift, through nine gaits.
    """

    gait: PhasedGait
    """The gait in the middle, for level ground."""
    slope: float
    """Steepest slope that the family is for, up and down (tangent)."""
    shift: float
    """How far the hips are held back or brought forward at most (m), besides what the slope
    needs."""
    middle: Floats
    half: Floats
    """middle, half: (3, 3) Middle of the range of the phase and half its width (rad), by powers of
    the slope, as part of the steepest, and of the shift, likewise."""
    coefficients: Floats
    """(3, 3, terms, nu) Chebyshev series of the joints, likewise."""
    rate: float
    """Rate of the phase just after touchdown of the walk that repeats on level ground (rad/s)."""
    energy: Floats
    """(3, levels) Chebyshev series over a step of σ²/2 of the walk that repeats, σ the angular
    momentum about the stance foot, by powers of the slope ((kg m²/s)²)."""

    @classmethod
    def around(cls, gait: PhasedGait, *, slope: float = 0.15, shift: float = 0.1) -> StepFamily:
        """Find the family of a gait.

        On slopes the hips are besides brought forward as far as it takes to walk with the energy
        of level ground.

        Parameters
        ----------
        gait : PhasedGait
            A gait for level ground that repeats. Its knees should stay bent (``joint_ranges`` of
            :func:`~heelstrike.optimize_gait`): straight legs have nothing to give.
        slope : float
            Steepest slope (tangent).
        shift : float
            Largest shift of the hips (m).

        Returns
        -------
        StepFamily
            The family.

        Raises
        ------
        GaitError
            If numbers are not positive, the gait does not repeat, or the robot's legs do not allow
            for as much.
        """
        if not isinstance(gait, PhasedGait):
            raise GaitError(
                f"a family is one around a PhasedGait, got {type(gait).__name__}; "
                "hs.PhasedGait.from_gait(robot, gait) makes one"
            )
        numbers = all(isinstance(x, (int, float, np.floating)) for x in (slope, shift))
        if not (numbers and 0.0 < slope < 1.0 and 0.0 < shift < np.inf):
            raise GaitError(
                "a family needs a steepest slope between 0 and 1 and a positive largest shift; got "
                f"slope={slope!r}, shift={shift!r}"
            )
        postures = Postures(gait)
        wanted = _energy(gait, 0.0)
        gaits, energies = {}, {}
        for tangent in (0.0, -slope, slope):  # on level ground it shows at once if legs are short
            own = 0.0 if tangent == 0.0 else _equal_shift(postures, tangent, shift, wanted.level)
            row = [postures.changed(tangent, own + each) for each in (-shift, 0.0, shift)]
            if tangent == 0.0:
                row[1] = gait
            energies[tangent], gaits[tangent] = _energy(row[1], tangent).series, row
        slopes = (-slope, 0.0, slope)
        ranges = np.array([[each.phase_range for each in gaits[tangent]] for tangent in slopes])
        series = np.array([[each.coefficients for each in gaits[tangent]] for tangent in slopes])
        return cls(
            gait=gait,
            slope=float(slope),
            shift=float(shift),
            middle=_powers(_powers(0.5 * ranges.sum(axis=-1), 0), 1),
            half=_powers(_powers(0.5 * np.diff(ranges, axis=-1)[..., 0], 0), 1),
            coefficients=_powers(_powers(series, 0), 1),
            rate=wanted.rate,
            energy=_powers(np.array([energies[tangent] for tangent in slopes]), 0),
        )

    def coefficients_on_both_feet(self) -> Floats:
        """Return the series of the joints on either foot.

        Returns
        -------
        (2, 3, 3, terms, nu) float
            `coefficients` while foot 0 and foot 1 stand.
        """
        both = np.stack([self.coefficients, self.coefficients @ self.gait.joint_mirror().T])
        # What is constant in the mirror image belongs to the gait in the middle alone.
        both[1, 0, 0] = self.gait.coefficients_on_both_feet()[1 - self.gait.stance_foot]
        return both if self.gait.stance_foot == 0 else both[::-1].copy()

    def at(self, slope: float, shift: float = 0.0) -> PhasedGait:
        """Return a gait of the family.

        Parameters
        ----------
        slope : float
            Tangent of the slope; within the family's.
        shift : float
            How far the hips are held back (m); within the family's.

        Returns
        -------
        PhasedGait
            The gait.

        Raises
        ------
        GaitError
            If the family does not reach so far.
        """
        b, t = slope / self.slope, shift / self.shift
        if not max(abs(b), abs(t)) <= 1.0 + 1e-12:
            raise GaitError(
                f"this family is for slopes up to {self.slope:g} and shifts up to {self.shift:g} m;"
                f" got {slope:g} and {shift:g} m"
            )
        powers = np.outer([1.0, b, b * b], [1.0, t, t * t])
        middle, half = (float(np.sum(powers * each)) for each in (self.middle, self.half))
        coefficients = np.tensordot(powers, self.coefficients, 2)
        return replace(
            self.gait, phase_range=(middle - half, middle + half), coefficients=coefficients
        )


def _powers(values: Floats, axis: int) -> Floats:
    """Coefficients of the quadratics through values at −1, 0 and 1 along an axis."""
    low, zero, high = np.moveaxis(values, axis, 0)
    return np.stack([zero, 0.5 * (high - low), 0.5 * (high + low) - zero], axis=axis)


@dataclass(frozen=True)
class _Energy:
    """σ²/2 of the walk that repeats: before touchdown, and as a series over the step.

    And the rate of the phase with which the step begins.
    """

    level: float
    rate: float
    series: Floats


def _energy(gait: PhasedGait, slope: float) -> _Energy:
    """Find the energy of a gait on the slope that it is for."""
    ground = Ground(slope=float(np.arctan(slope)))
    surface = Surface(make_invariant(gait, ground), ground)
    end = surface.touchdown()
    _, added = surface.motion(end)
    kept = end.momentum**2
    level = float(added(end.before)) / (1.0 - kept)
    first, last = gait.phase_range
    series = Chebyshev.interpolate(
        lambda x: kept * level + added(0.5 * (first + last) + 0.5 * (last - first) * x), LEVELS
    )
    if kept >= 1.0 or series(np.linspace(-1.0, 1.0, 101)).min() <= 0.0:
        raise GaitError(
            f"the gait of robot {gait.robot.name!r} for a slope of {slope:.3g} does not repeat: it "
            "loses more speed than it gains, or falls back. Ask for a smaller slope or a faster "
            "gait."
        )
    rate = end.rate * np.sqrt(2.0 * level) / surface.inertia(end.before)
    return _Energy(level, float(rate), np.asarray(series.coef, dtype=np.float64))


def _equal_shift(postures: Postures, slope: float, most: float, level: float) -> float:
    """Find the shift of the hips with which a slope is walked with the energy of level ground."""
    ground = Ground(slope=float(np.arctan(slope)))

    def missing(shift: float) -> float:
        try:
            surface = Surface(make_invariant(postures.changed(slope, shift), ground), ground)
        except GaitError as error:
            raise GaitError(
                f"on a slope of {slope:.3g} with the hips held back by {shift:.3g} m: {error}; ask "
                "for a smaller slope, or for a gait with more bent knees (joint_ranges)"
            ) from error
        end = surface.touchdown()
        _, added = surface.motion(end)
        return float(added(end.before)) / (1.0 - end.momentum**2) - level

    ends = (-SOUGHT * most, SOUGHT * most)
    if not missing(ends[0]) > 0.0 > missing(ends[1]):
        raise GaitError(
            f"no shift of the hips up to {ends[1]:.3g} m keeps the energy of the walk of robot "
            f"{postures.gait.robot.name!r} on a slope of {slope:.3g}; ask for a smaller slope"
        )
    from scipy.optimize import brentq  # takes half a second to import

    return float(brentq(missing, *ends, xtol=1e-4))
