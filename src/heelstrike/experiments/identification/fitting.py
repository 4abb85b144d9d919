"""Motion and parameters fitted together: what was measured of each is as likely as can be.

Joints move along splines. Their coefficients c, the base parameters β and the delay d of the motors
make the errors

    of encoders    θ(t) − measured
    of motors      Y(θ, θ̇, θ̈) β + springs − Γ(t − d)
    of the ground  Y_b β − J_bᵀ f, where forces f are measured

least in sum of squares, each over its standard deviation: maximum likelihood for noise that is
normal. Accelerations are no data, so that their noise, which is large, biases nothing, as it does
where they are put into the regression as if they were known. What the file says counts as an
observation, too, as inexact as a part may be other than it is written: it keeps what the motion
hardly tells from wandering off while the rest is looked for. Newton's method by Gauss; of each
piece of the motion the coefficients are eliminated.

Intervals are to hold in 95 % of all recordings of a robot, whatever its file says. With the file as
an observation K, errors have the covariance H⁻¹ (H − K) H⁻¹ plus a bias H⁻¹ K (file − truth), not
H⁻¹. So a last step takes it out again, but for a rest that keeps what no motion tells finite.

H is too large by what noise of the curves makes of it. The moment of inertia of a foot shows where
the foot turns faster and faster; one that does not tells nothing, but a curve that noise has moved
turns it. Along the true motion H is smaller by C, on average, and there the gradient of the sum of
squares has the slope H − C, though it is as noisy as H says. Of combinations whose H is C in more
than a small part, nothing is told: what the curves say there is left out, and value and tolerance
of the file stay. Where the sum of squares is larger than the noise that was told explains, all
noise is taken for as much larger: of the motors, of the ground and of the curves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.experiments.identification.base_parameters import BaseParameters
from heelstrike.experiments.identification.equations import Columns, Equations, Slopes
from heelstrike.experiments.identification.standing import Piece
from heelstrike.experiments.people.splines import DEGREE, Splines
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import RobotLog
from heelstrike.robot.model import Floats

ORDERS = range(4)
"""Derivatives of joints that are looked at: the third tells what a delay does."""
RESTING = 5.0
"""Standard deviations of encoders that a joint moves from knot to knot, above which it is known
which way: where it may rest, its dry friction may be anything up to its size."""
SETTLED_FIT = 0.02
"""Standard deviations by which no parameter changes any more."""
ROUNDED_RISE = 1e-7
"""Rise of the mean square that is rounding."""
SHORTEST_STEP = 1e-3
"""Part of a step below which it is taken, whatever comes of it."""
FAINT = 1e-3
"""Part of what the file says that is left in the end: of a number whose deviation is `TOLD` of that
beforehand it moves a hundredth of a percent."""
NOISE_ALONE = 0.1
"""Part of the information on a combination that noise of the curves makes, above which the motion
tells nothing of it: on a walk of bravo7, 0.02 at most for all but the moments of inertia of its
feet, where it is 0.3 to 1 and more."""
DRAWS, SEED = 4, 0
"""Moves of the curves by chance, each to both sides, of which what they add is the mean."""
SURPRISE = 4.0
"""Standard deviations by which the sum of squares is too large for the noise that was told."""
MOST_STEPS = 60
"""Steps that are tried: most motions need six."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what is measured."""

    encoder: Floats
    """(k,) Of the joints (rad, m)."""
    torque: float
    """Of the torques (N m, N): what motors do otherwise than is logged."""
    force: float
    """Of the forces of each contact point, along each axis (N)."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The most likely parameters."""

    values: Floats
    """(b,) Base parameters."""
    covariance: Floats
    """(b, b) For noise as large as the errors are, if that is surprisingly larger than told."""
    delay: float
    """Of the motors (s)."""
    delay_deviation: float
    """Its standard deviation (s); zero if it was not looked for, NaN if a longer one than
    those looked for is likelier."""
    misfit: float
    """Sum of squares over its expectation: about 1 where noise is what it is said to be."""
    degrees: int
    """Degrees of freedom of that sum."""
    torque: tuple[tuple[Floats, Floats, Floats], ...]
    """Of each piece times (n,), torques that were measured and those that the parameters make of
    the motion, (n, k) each."""


class Fitting:
    """A motion whose parameters are looked for.

    Parameters
    ----------
    equations : Equations
        Of the robot.
    log : RobotLog
        What was measured.
    pieces : sequence of Piece
        Where the equations are known.
    base : BaseParameters
        What can be told.
    noise : Noise
        How exact measurements are.
    knots : float
        Time between two knots of the splines (s).
    longest_delay : float
        Longest delay that is looked for (s); zero for none.
    """

    def __init__(
        self, equations: Equations, log: RobotLog, pieces: Sequence[Piece], base: BaseParameters,
        noise: Noise, *, knots: float, longest_delay: float,
    ) -> None:  # fmt: skip
        self.equations, self.log, self.base, self.noise = equations, log, base, noise
        self.longest = longest_delay
        self._pieces = [_Stretch(self, piece, knots) for piece in pieces]

    def solve(self, values: Floats) -> Fit:
        """Find the most likely parameters.

        Parameters
        ----------
        values : (unknowns,) array
            Where to begin: what the robot's file says.

        Raises
        ------
        SimulationError
            If they are not found.
        """
        size = len(self.base.chosen)
        free = size + (self.longest > 0.0)
        before = self.base.matrix * self.equations.unknowns.size
        known = np.zeros((free, free))
        known[:size, :size] = np.linalg.inv(before @ before.T)
        known[size:, size:] = self.longest**-2 if free > size else 0.0
        begun = np.zeros(free)  # base parameters, and the delay if it is looked for
        begun[:size] = self.base.matrix @ values
        there = begun.copy()
        least, part = np.inf, 1.0
        for _ in range(MOST_STEPS):
            found = self._evaluated(values, there)
            matrix, squares = found.matrix + known, found.squares
            right = found.right + known @ (there - begun)
            away = squares + float((there - begun) @ known @ (there - begun))
            if away > least + ROUNDED_RISE * found.rows and part > SHORTEST_STEP:
                part *= 0.5  # too far: a shorter step from where it began
            else:
                least, part = away, 1.0
                covariance = np.asarray(np.linalg.inv(matrix), np.float64)
                step = -covariance @ right
                held = self._goes_beyond(there[size:], step[size:])
                if held:  # the others are looked for with the longest delay
                    covariance = np.zeros((free, free))
                    covariance[:size, :size] = np.linalg.inv(matrix[:size, :size])
                    step = -covariance @ right
                deviation = np.sqrt(np.diag(covariance))
                if np.all(np.abs(step) <= SETTLED_FIT * deviation):
                    own = slice(0, size if held else free)
                    degrees = found.rows - free - sum(piece.size for piece in self._pieces)
                    noise = self._made_by_noise(values, there)
                    there[own], covariance = _without_file(
                        found.matrix[own, own], noise[own, own], known[own, own], there[own],
                        begun[own], _surprise(squares / degrees, degrees),
                    )  # fmt: skip
                    deviation = np.sqrt(np.diag(covariance))
                    return Fit(
                        there[:size], covariance[:size, :size], float(there[size:].sum()),
                        np.nan if held else float(deviation[size:].sum()),
                        squares / degrees, degrees,
                        tuple(piece.compared for piece in self._pieces),
                    )  # fmt: skip
                start = there, [(each.coefficients, each.change(step)) for each in self._pieces]
            there = start[0] + part * step
            there[size:] = np.clip(there[size:], -self.longest, self.longest)
            for piece, (coefficients, change) in zip(self._pieces, start[1], strict=True):
                piece.coefficients = coefficients + part * change
        raise SimulationError(
            "the parameters do not settle: the motion does not fit the robot. Look whether columns "
            "have the right units and signs, and whether the feet stand flat"
        )

    def _goes_beyond(self, delay: Floats, step: Floats) -> bool:
        """Whether a delay, if there is one, is at the end of those looked for, and goes on."""
        return bool(np.any((np.abs(delay) >= self.longest) & (delay * step > 0.0)))

    def _evaluated(self, values: Floats, there: Floats) -> _Normal:
        """Return the normal equations of the parameters at some of them."""
        size = len(self.base.chosen)
        assumed, delay = self.assumed(values, there[:size]), float(there[size:].sum())
        found = _Normal(np.zeros((len(there), len(there))), np.zeros(len(there)), 0.0, 0)
        for piece in self._pieces:
            found = found.plus(piece.reduced(assumed, there[:size], delay, len(there)))
        return found

    def _made_by_noise(self, values: Floats, there: Floats) -> Floats:
        """Return what noise of the curves makes of the information, on average, (free, free)."""
        size = len(self.base.chosen)
        assumed, delay = self.assumed(values, there[:size]), float(there[size:].sum())
        found: Floats = np.zeros((len(there), len(there)))
        for piece in self._pieces:
            found += piece.made_by_noise(assumed, there[:size], delay, len(there))
        return found

    def assumed(self, values: Floats, beta: Floats) -> Floats:
        """Return values of all unknowns, near to some, that have given base parameters."""
        matrix, size = self.base.matrix, self.equations.unknowns.size
        scaled = matrix * size
        change = np.linalg.lstsq(scaled, beta - matrix @ values, rcond=None)[0]
        return values + size * change


def _surprise(misfit: float, degrees: int) -> float:
    """By how much variances are larger than the noise that was told explains."""
    return misfit if misfit > 1.0 + SURPRISE * math.sqrt(2.0 / degrees) else 1.0


def _without_file(
    seen: Floats, noise: Floats, file: Floats, there: Floats, begun: Floats, surprise: float
) -> tuple[Floats, Floats]:
    """Take what the file says out of the most likely parameters, where the motion tells them.

    Parameters
    ----------
    seen : (k, k) array
        Information of the motion on base parameters, and maybe a delay, for noise that was told.
    noise : (k, k) array
        What noise of the curves makes of it.
    file : (k, k) array
        Information of the file on them.
    there : (k,) array
        Most likely parameters.
    begun : (k,) array
        Parameters of the file.
    surprise : float
        By how much variances of noise are larger than told. Of noise that is, `noise` stays as it
        is: the curves move by more, and what they seem to tell counts for less.

    Returns
    -------
    tuple of (k,) and (k, k) arrays
        The parameters, and their covariance.
    """
    pull = file @ (there - begun)  # of the file; the motion pulls back as much, as told
    seen = seen / surprise + FAINT * file
    factor = np.linalg.cholesky(seen)
    part, turned = np.linalg.eigh(np.linalg.solve(factor, np.linalg.solve(factor, noise).T))
    ways, slopes = np.linalg.solve(factor.T, turned), factor @ turned
    told = part <= NOISE_ALONE
    onto = slopes[:, told] @ ways[:, told].T  # (k, k) Of gradients, those along what is told
    left = file - onto @ file
    rest = np.eye(len(file)) - onto
    inverse = np.linalg.inv((slopes[:, told] * (1.0 - part[told])) @ slopes[:, told].T + left)
    found = there + inverse @ ((1.0 / surprise - FAINT) * onto @ pull - rest @ pull)
    spread = slopes[:, told] @ slopes[:, told].T + left @ rest.T
    return found, inverse @ spread @ inverse.T


@dataclass(frozen=True, eq=False)
class _Normal:
    """Normal equations of the parameters, the sum of squares, and of how many errors it is."""

    matrix: Floats
    right: Floats
    squares: float
    rows: int

    def plus(self, other: _Normal) -> _Normal:
        """Add those of other errors."""
        return _Normal(
            self.matrix + other.matrix, self.right + other.right, self.squares + other.squares,
            self.rows + other.rows,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Seen:
    """What was seen of a motion: its splines, joints, columns and slopes."""

    basis: Sequence[Floats]
    theta: Sequence[Floats]
    columns: Columns
    slopes: Slopes


class _Stretch:
    """A piece of the motion with the coefficients of its splines."""

    def __init__(self, whole: Fitting, piece: Piece, knots: float) -> None:
        self._whole, self._foot = whole, piece.foot
        log, rows = whole.log, slice(piece.first, piece.end)
        self._time = log.time[rows] - log.time[piece.first]
        self._begin = float(log.time[piece.first])
        self._splines = Splines(self._time, knots)
        self._apart = float(self._time[-1]) / (self._splines.size - DEGREE)
        away = np.minimum(self._time, self._time[-1] - self._time)
        self._inner = away >= whole.longest  # where commands act in here, whatever the delay
        self._measured = log.joints[rows]
        equations = whole.equations
        self._torque = np.zeros_like(self._measured)
        self._torque[:, equations.robot.model.actuator_joint - equations.first] = log.torque[rows]
        self._force = None if log.force is None or piece.foot is None else log.force[rows]
        self.coefficients = self._splines.fitted(self._measured)
        moved = np.abs(self._splines.values(self.coefficients, 1)) * self._apart
        self._moves = moved > RESTING * whole.noise.encoder
        self._answer: Floats = np.zeros(0)
        self._coupling: Floats = np.zeros((0, 0))
        self.compared: tuple[Floats, Floats, Floats] = (np.zeros(0),) * 3

    @property
    def size(self) -> int:
        """How many coefficients there are."""
        return self.coefficients.size

    def change(self, step: Floats) -> Floats:
        """Return how coefficients change with the parameters, (size, joints)."""
        change = -(self._answer + self._coupling @ step)
        return change.reshape(self.coefficients.shape)

    def reduced(self, assumed: Floats, beta: Floats, delay: float, free: int) -> _Normal:
        """Return normal equations of the parameters.

        Coefficients are eliminated, and change as :meth:`change` says.
        """
        system = self._looked_at(assumed, beta, delay, free)[0]
        self._answer, self._coupling, matrix, right = system.eliminated()
        return _Normal(matrix, right, system.squares, system.rows)

    def _looked_at(
        self, assumed: Floats, beta: Floats, delay: float, free: int
    ) -> tuple[_System, _Seen, _Seen]:
        """Return equations, and what was seen of the whole motion and of that of the motors.

        Rows of equations are many: nobody keeps them longer than for one piece.
        """
        noise, joints = self._whole.noise, self._measured.shape[1]
        system = _System(self._splines.size, joints, free)
        here = there = self._seen(self._time, assumed)
        error = (here.theta[0] - self._measured) / noise.encoder
        system.add_own(here.basis[0], error, noise.encoder)
        if not self._inner.all():
            there = self._seen(self._time[self._inner] + delay, assumed)
        self._motors(system, there, beta)
        if self._force is not None:
            self._ground(system, here, beta)
        return system, here, there

    def made_by_noise(self, assumed: Floats, beta: Floats, delay: float, free: int) -> Floats:
        """Return what noise of the curve makes of the information, on average, (free, free)."""
        system, here, there = self._looked_at(assumed, beta, delay, free)
        rng, found = np.random.default_rng(SEED), np.zeros((free, free))
        scale = None if self._force is None else self._scale(here)
        for _ in range(DRAWS):
            move = system.drawn(rng).reshape(self.coefficients.shape)
            sides = []
            for side in (move, -move):
                each = [self._of_motors(*self._moved(there, side), there.slopes.motors, free)]
                if scale is not None:
                    each.append(self._of_ground(self._moved(here, side)[0], scale, free))
                sides.append(each)
            found += system.seen([0.5 * (one - two) for one, two in zip(*sides, strict=True)])
        return np.asarray(found / DRAWS, np.float64)

    def _moved(self, seen: _Seen, move: Floats) -> tuple[Columns, Sequence[Floats]]:
        """Return columns and joints along curves whose coefficients are moved."""
        theta = [each @ (self.coefficients + move) for each in seen.basis]
        motion = theta[0], theta[1], theta[2]
        return self._whole.equations.columns(motion, self._foot), theta

    def _of_motors(
        self, at: Columns, theta: Sequence[Floats], slopes: Sequence[Floats], free: int
    ) -> Floats:
        """Derivatives of the errors of motors by the parameters, (n, joints, free)."""
        chosen = at.motors[:, :, list(self._whole.base.chosen)]
        return _with_delay(chosen, slopes, theta, free) / self._whole.noise.torque

    def _of_ground(self, at: Columns, scale: Floats, free: int) -> Floats:
        """Derivatives of the errors of the ground by the parameters, (n, b, free)."""
        chosen = scale @ at.ground[:, :, list(self._whole.base.chosen)]
        found = np.zeros((*chosen.shape[:2], free))
        found[:, :, : chosen.shape[2]] = chosen
        return found

    def _seen(self, time: Floats, assumed: Floats) -> _Seen:
        """Look at the motion at some times."""
        basis = [self._splines.basis(time, order) for order in ORDERS]
        theta = [each @ self.coefficients for each in basis]
        equations = self._whole.equations
        at = equations.columns((theta[0], theta[1], theta[2]), self._foot)
        return _Seen(basis, theta, at, equations.slopes(at, assumed, self._foot))

    def _motors(self, system: _System, seen: _Seen, beta: Floats) -> None:
        """Add the errors of motors."""
        whole, noise = self._whole, self._whole.noise
        at, slopes = seen.columns, seen.slopes.motors
        made = at.motors[:, :, list(whole.base.chosen)] @ beta + at.known
        measured = self._torque[self._inner]
        self.compared = (self._begin + self._time[self._inner], measured, made)
        system.add(
            seen.basis, (made - measured) / noise.torque, [each / noise.torque for each in slopes],
            self._of_motors(at, seen.theta, slopes, system.free), self._moves[self._inner],
        )  # fmt: skip

    def _ground(self, system: _System, seen: _Seen, beta: Floats) -> None:
        """Add the errors of forces of the ground, each along its own axes."""
        assert self._force is not None
        assert self._foot is not None
        whole = self._whole
        at, slopes = seen.columns, seen.slopes.ground
        points = list(whole.equations.soles[self._foot].contacts)
        force = self._force[:, points].reshape(len(self._time), -1)
        back, scale = self._back(at), self._scale(seen)
        made = at.ground[:, :, list(whole.base.chosen)] @ beta
        error = made - (back @ force[:, :, None])[:, :, 0]
        system.add(
            seen.basis, (scale @ error[:, :, None])[:, :, 0], [scale @ each for each in slopes],
            self._of_ground(at, scale, system.free), np.ones(error.shape, dtype=bool),
        )  # fmt: skip

    def _back(self, at: Columns) -> Floats:
        """Return what forces of the contact points of the foot do to the trunk, (n, b, held)."""
        assert self._foot is not None
        equations = self._whole.equations
        rows = at.rows[:, equations.held_rows(self._foot), : equations.first]
        return np.swapaxes(rows, 1, 2)

    def _scale(self, seen: _Seen) -> Floats:
        """Return axes of errors of the ground, over their standard deviations, (n, b, b)."""
        back = self._back(seen.columns)
        axes = np.linalg.inv(np.linalg.cholesky(back @ np.swapaxes(back, 1, 2)))
        return np.asarray(axes / self._whole.noise.force, np.float64)


def _with_delay(
    chosen: Floats, slopes: Sequence[Floats], theta: Sequence[Floats], free: int
) -> Floats:
    """Return derivatives of torques by the parameters, of which the last may be a delay."""
    size = chosen.shape[2]
    found = np.zeros((*chosen.shape[:2], free))
    found[:, :, :size] = chosen
    if free > size:
        for slope, rate in zip(slopes, theta[1:], strict=True):
            found[:, :, size] += (slope @ rate[:, :, None])[:, :, 0]
    return found


class _System:
    """Normal equations of coefficients, (size, joints) of them, and of parameters."""

    def __init__(self, size: int, joints: int, free: int) -> None:
        self.free, self.rows, self.squares = free, 0, 0.0
        self._shape = size, joints
        self._inner = np.zeros((size * joints, size * joints))
        self._outer = np.zeros((size * joints, free))
        self._corner, self._right = np.zeros((free, free)), np.zeros(free)
        self._lacks = np.zeros(size * joints)
        self._added: list[tuple[Floats, Floats]] = []  # rows, and which errors they are of

    def add_own(self, basis: Floats, error: Floats, deviation: Floats) -> None:
        """Add errors (n, joints) of the curves themselves, over their standard deviations."""
        self._inner += np.kron(basis.T @ basis, np.diag(deviation**-2.0))
        self._lacks += ((basis.T @ error) / deviation).ravel()
        self.squares += float(np.sum(error**2))
        self.rows += error.size

    def add(
        self, basis: Sequence[Floats], error: Floats, slopes: Sequence[Floats],
        parameters: Floats, counts: Floats,
    ) -> None:  # fmt: skip
        """Add errors (n, m), their derivatives by θ, θ̇, θ̈ (n, m, joints) and by parameters."""
        size, joints = self._shape
        by = sum(
            np.einsum("ia,iml->imal", each, slope)
            for each, slope in zip(basis, slopes, strict=False)
        )
        rows = np.asarray(by).reshape(-1, size * joints)[counts.ravel()]
        own, lacks = parameters.reshape(-1, self.free)[counts.ravel()], error[counts]
        self._added.append((rows, counts.ravel()))
        self._inner += rows.T @ rows
        self._outer += rows.T @ own
        self._corner += own.T @ own
        self._lacks += rows.T @ lacks
        self._right += own.T @ lacks
        self.squares += float(lacks @ lacks)
        self.rows += len(lacks)

    def eliminated(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return how coefficients follow, and normal equations of the parameters alone."""
        right = np.column_stack([self._lacks, self._outer])
        found = np.asarray(np.linalg.solve(self._inner, right), np.float64)
        answer, coupling = found[:, 0], found[:, 1:]
        return (
            answer, coupling, self._corner - self._outer.T @ coupling,
            self._right - self._outer.T @ answer,
        )  # fmt: skip

    def drawn(self, rng: np.random.Generator) -> Floats:
        """Draw what noise of all that was measured does to the coefficients, (size * joints,)."""
        factor = np.linalg.cholesky(self._inner)
        found: Floats = np.linalg.solve(factor.T, rng.standard_normal(len(factor)))
        return found

    def seen(self, several: Sequence[Floats]) -> Floats:
        """Return information (free, free) of columns (n, m, free) of each errors that were added.

        That of which the coefficients can make as much is none.
        """
        found, cross = np.zeros((self.free, self.free)), np.zeros_like(self._outer)
        for (rows, counts), columns in zip(self._added, several, strict=True):
            own = columns.reshape(-1, self.free)[counts]
            found += own.T @ own
            cross += rows.T @ own
        return found - cross.T @ np.asarray(np.linalg.solve(self._inner, cross))
