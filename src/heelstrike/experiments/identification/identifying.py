"""identify(): what a robot is, from what it measured as it moved, and what that does not tell."""

from __future__ import annotations

import math

import numpy as np

from heelstrike.arguments import takes
from heelstrike.blas_threads import one_blas_thread
from heelstrike.errors import SimulationError
from heelstrike.experiments.identification.base_parameters import BaseParameters, base_parameters
from heelstrike.experiments.identification.equations import Equations
from heelstrike.experiments.identification.fitting import Fit, Fitting, Noise
from heelstrike.experiments.identification.measured import measured_by
from heelstrike.experiments.identification.sliding import (
    GroundFriction,
    ground_friction,
    may_slide,
    sliding,
)
from heelstrike.experiments.identification.standing import LEAST_SAMPLES, Piece, pieces_of
from heelstrike.experiments.identification.unknowns import Unknowns
from heelstrike.experiments.people.splines import Splines
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import RobotLog
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run
from heelstrike.wording import some_of

COVERING = 1.959964
"""Standard deviations of an interval that holds in 95 %."""
KNOTS = 0.06
"""Time between two knots of the motion (s): robots that walk do not change faster."""
TOLD = 0.3
"""Part of the standard deviation beforehand above which a motion tells little of a number."""
SHOWN = 3
"""Others of a combination that a line shows."""


@dataclass(frozen=True)
class IdentifiedNumber:
    """A base parameter: a number of the robot, or several that act as one."""

    name: str
    """What it is named after, as ``moment of inertia of left_thigh``."""
    unit: str
    """Its unit."""
    value: float
    """Most likely value."""
    deviation: float
    """Its standard deviation."""
    assumed: float
    """What the robot's file says."""
    others: tuple[tuple[float, str], ...] = ()
    """What is in it, too: shares of other numbers that no motion tells apart from it."""
    told: bool = True
    """Whether the motion tells anything of it."""

    @property
    def low(self) -> float:
        """Lower end of the interval that holds in 95 %."""
        return self.value - COVERING * self.deviation

    @property
    def high(self) -> float:
        """Its upper end."""
        return self.value + COVERING * self.deviation

    def __str__(self) -> str:
        shares = [f"{factor:+.3g} {name}" for factor, name in self.others]
        more = f" ({some_of(shares, SHOWN)})" if shares else ""
        half = COVERING * self.deviation
        return (
            f"{self.name}{more}: {self.value:.5g} ± {half:.2g} {self.unit}, "
            f"{self.assumed:.5g} in the file"
        )


@dataclass(frozen=True, eq=False)
class Identified:
    """What a motion tells of a robot."""

    numbers: tuple[IdentifiedNumber, ...]
    """Base parameters."""
    covariance: Floats
    """(n, n) Of their values."""
    delay: float
    """Of the motors (s); NaN if it was not looked for."""
    delay_deviation: float
    """Its standard deviation (s); NaN if the delay is at the end of those looked for."""
    friction: GroundFriction
    """What is told of the ground."""
    hidden: tuple[str, ...]
    """What the motion does not tell, in words."""
    misfit: float
    """Mean square of the errors over what the noise explains: about 1 where all is as it was
    said."""
    seconds: float
    """Time in which the equations were known (s)."""
    joints: tuple[str, ...]
    """Names of the joints that were measured."""
    torque: tuple[tuple[Floats, Floats, Floats], ...]
    """Of each piece of the motion times (n,), torques that were measured and those that follow from
    the motion, (n, joints) each."""

    def __str__(self) -> str:
        lines = [str(each) for each in self.numbers if each.told]
        if not (math.isnan(self.delay) or math.isnan(self.delay_deviation)):
            half = 1e3 * COVERING * self.delay_deviation
            lines.append(f"delay of the motors: {1e3 * self.delay:.4g} ± {half:.2g} ms")
        lines.append(str(self.friction))
        lines += [f"not told: {each}" for each in self.hidden]
        lines.append(
            f"errors are {math.sqrt(self.misfit):.3g} of what the noise explains, over "
            f"{self.seconds:.3g} s"
        )
        return "\n".join(lines)


@takes(SimulationError)
@one_blas_thread()
def identify(
    robot: Robot,
    log: RobotLog | Run,
    *,
    encoder_noise: float | None = None,
    torque_noise: float = 0.2,
    force_noise: float = 2.0,
    knots: float = KNOTS,
    longest_delay: float = 0.0,
) -> Identified:
    """Tell masses, moments, friction and delay of a robot from what it measured as it moved.

    Motion and numbers are fitted together, by maximum likelihood. A robot that floats is looked at
    where it stands flat on one foot; forces of the ground are used where they are measured, and
    eliminated where they are not. Where the robot's trunk was measured too, friction of the ground
    follows from points that slide.

    Parameters
    ----------
    robot : Robot
        The robot as its file has it: its lengths are right, its masses and friction need not be.
    log : RobotLog or Run
        What it measured; :func:`~heelstrike.gait.recordings.robot_log.load_robot_log` reads it.
    encoder_noise : float, optional
        Standard deviation of the positions of joints (rad, m); by default told by their roughness.
    torque_noise : float
        That of torques (N m, N): what motors do otherwise than is logged.
    force_noise : float
        That of forces of each contact point, along each axis (N).
    knots : float
        Time between two knots of the splines that the motion is described by (s).
    longest_delay : float
        Longest delay of the motors that is looked for (s): torques are commands, which act later.
        Zero looks for none.

    Returns
    -------
    Identified
        Base parameters with intervals, and what the motion does not tell.

    Raises
    ------
    SimulationError
        If the motion tells nothing, or does not fit the robot at all.
    RobotError
        If the robot has closed loops, or floats and has no flat feet.

    Examples
    --------
    A pendulum of 0.9 kg m and 0.41 kg m², whose file says something else.

    >>> import numpy as np
    >>> import heelstrike as hs
    >>> from heelstrike.experiments.identification import RobotLog
    >>> build = hs.RobotBuilder("pendulum")
    >>> rod = build.hinge(
    ...     "pivot", None, link="rod", mass=2.0, inertia=0.05, center_of_mass=(0, -0.4), torque=99
    ... )
    >>> time = np.linspace(0.0, 4.0, 1000)
    >>> angle = 0.9 * np.sin(4.0 * time)
    >>> torque = -16.0 * 0.41 * angle + 9.81 * 0.9 * np.sin(angle)
    >>> log = RobotLog(time, angle[:, None], torque[:, None])
    >>> found = hs.identify(build.build(), log, encoder_noise=1e-5, torque_noise=0.01)
    >>> [f"{each.value:.2f} {each.unit}" for each in found.numbers if each.name.startswith("first")]
    ['-0.00 kg m', '-0.90 kg m']
    """
    for name, noise in (("torque_noise", torque_noise), ("force_noise", force_noise),
                        ("knots", knots), ("encoder_noise", encoder_noise)):  # fmt: skip
        if noise is not None and not 0.0 < noise < math.inf:
            raise SimulationError(f"{name} must be a positive number, got {noise}")
    if not 0.0 <= longest_delay < math.inf:
        raise SimulationError(f"longest_delay must be zero or more, got {longest_delay}")
    measured = measured_by(robot, log)
    equations = Equations(robot)
    pieces = pieces_of(equations, measured, force_noise)
    names = robot.joint_names[equations.first :]
    encoder = _encoder_noise(measured, pieces, knots, encoder_noise, names)
    slides = sliding(equations, measured, encoder, force_noise)
    friction = ground_friction(equations, measured, slides, force_noise)
    moving = may_slide(equations, measured, slides, friction)
    pieces = pieces_of(equations, measured, force_noise, moving)
    if not pieces:
        raise SimulationError(_why_none(equations))
    pieces = _with_commands(measured, pieces, longest_delay)
    feet = sorted({piece.foot for piece in pieces}, key=str)
    forces = measured.force is not None and bool(equations.first)
    base = base_parameters(equations, feet, ground=forces)
    known = equations.unknowns.of(robot.model)
    fitting = Fitting(
        equations, measured, pieces, base, Noise(encoder, torque_noise, force_noise),
        knots=knots, longest_delay=longest_delay,
    )  # fmt: skip
    try:
        fit = fitting.solve(known)
    except np.linalg.LinAlgError as error:
        raise SimulationError(
            f"the equations of this motion have no single answer ({error}): it does not fit the "
            "robot, or a noise is told much too small. Look whether columns have the right units"
        ) from error
    numbers = _numbers(equations.unknowns, base, known, fit)
    return Identified(
        numbers=numbers,
        covariance=fit.covariance,
        delay=fit.delay if longest_delay > 0.0 else math.nan,
        delay_deviation=fit.delay_deviation,
        friction=friction,
        hidden=(
            *_hidden(equations.unknowns, base, numbers),
            *_cut_short(fit),
        ),
        misfit=fit.misfit,
        seconds=float(sum(measured.time[p.end - 1] - measured.time[p.first] for p in pieces)),
        joints=names,
        torque=fit.torque,
    )


def _why_none(equations: Equations) -> str:
    """Why there is no piece of a motion in which the equations are known."""
    if not equations.first:
        return f"there are too few samples: at least {LEAST_SAMPLES} are wanted in each second"
    return (
        "the robot never stands flat on one foot with the other in the air for long enough; "
        "only there its equations are known. Look whether joints have the right units and signs, "
        f"and whether there are {LEAST_SAMPLES} samples in the time on one foot"
    )


def _with_commands(
    log: RobotLog, pieces: tuple[Piece, ...], longest_delay: float
) -> tuple[Piece, ...]:
    """Return the pieces in which commands act whatever the delay: none from beyond their ends."""
    lasting = [float(log.time[piece.end - 1] - log.time[piece.first]) for piece in pieces]
    found = [
        piece for piece, lasts in zip(pieces, lasting, strict=True) if lasts > 2.0 * longest_delay
    ]
    if not found:
        raise SimulationError(
            f"longest_delay is {longest_delay:g} s, and the longest piece of the motion lasts "
            f"{max(lasting):.3g} s: give less than half of that"
        )
    return tuple(found)


def _cut_short(fit: Fit) -> list[str]:
    """Say that a longer delay is likelier than all that were looked for."""
    if not math.isnan(fit.delay_deviation):
        return []
    return [
        f"delay of the motors: {1e3 * fit.delay:.4g} ms is at the end of those looked for; give a "
        "larger longest_delay"
    ]


def _encoder_noise(
    log: RobotLog, pieces: tuple[Piece, ...], knots: float, given: float | None,
    names: tuple[str, ...],
) -> Floats:  # fmt: skip
    """Return noise of encoders, (k,): what smooth motions leave, if it is not given."""
    if given is not None:
        return np.full(log.joints.shape[1], given)
    squares, count = np.zeros(log.joints.shape[1]), 0
    moves = np.zeros(log.joints.shape[1])
    for piece in pieces:
        time, joints = log.time[piece.first : piece.end], log.joints[piece.first : piece.end]
        splines = Splines(time - time[0], knots)
        squares += np.sum((joints - splines.values(splines.fitted(joints))) ** 2, axis=0)
        count += len(time) - splines.size
        moves = np.maximum(moves, np.ptp(joints, axis=0))
    if pieces and not moves.all():
        name = names[int(np.argmin(moves))]
        raise SimulationError(
            f"joint {name!r} reads the same all along, which does not tell the noise of its "
            "encoder; give encoder_noise"
        )
    return np.sqrt(np.maximum(squares / max(count, 1), np.finfo(float).tiny))


def _numbers(
    unknowns: Unknowns, base: BaseParameters, known: Floats, fit: Fit
) -> tuple[IdentifiedNumber, ...]:
    names, assumed = unknowns.names, base.matrix @ known
    deviation, before = np.sqrt(np.diag(fit.covariance)), base.deviation(unknowns.size)
    return tuple(
        IdentifiedNumber(
            name=names[k], unit=unknowns.units[k], value=float(fit.values[row]),
            deviation=float(deviation[row]), assumed=float(assumed[row]),
            others=tuple((share, names[other]) for share, other in base.shares(row)),
            told=bool(deviation[row] < TOLD * before[row]),
        )
        for row, k in enumerate(base.chosen)
    )  # fmt: skip


def _hidden(
    unknowns: Unknowns, base: BaseParameters, numbers: tuple[IdentifiedNumber, ...]
) -> list[str]:
    """Say what a motion does not tell."""
    names = unknowns.names
    found = [f"{names[k]}: no motion on these feet depends on it" for k in base.silent]
    mixed = [k for k in np.flatnonzero(base.matrix.any(axis=0)).tolist() if k not in base.chosen]
    for k in mixed:
        others = [names[base.chosen[row]] for row in np.flatnonzero(base.matrix[:, k]).tolist()]
        found.append(f"{names[k]} by itself: it acts as part of {some_of(others, SHOWN)}")
    found += [f"{each.name}: this motion hardly depends on it" for each in numbers if not each.told]
    return found
