"""The motion nearest to a person's that is exact on hard contact."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import casadi
import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.errors import GaitError, GaitNotFoundError
from heelstrike.experiments.people.retarget import Retargeted
from heelstrike.field_texts import dataclass
from heelstrike.gait.cost import Instant
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.motion.optimize import optimize_motion
from heelstrike.gait.motion.phases import ContactPhase
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

FORCE_MARGIN = 0.1
"""Share of the weight that both ends of a flat sole bear at least: the law can correct the rest."""
LANDING = 0.15
"""Least speed (m/s) at which heels, and toes as the foot rolls flat, come down."""
CLEARANCE = 0.01
"""How high a foot in the air is kept half-way, as a share of the leg: people clear little."""
SHORTER, LONGER = 0.5, 1.6
"""Shares of its recorded duration between which a phase may last."""
SHORTEST = 0.03
"""Shortest phase (s)."""
ABRUPT = 0.02
"""Time (s) whose fourth power is the weight of differences of accelerations squared, beside angles
squared: without it, blows of forces would bring angles nearer by nothing."""
EFFORT = 1e-2
"""Weight of torques squared, in units of weight times leg, beside angles squared: of motions that
are as near, that of least effort."""
SKETCH = 0.2
"""Share of the work that the motion takes from which the nearest is looked for."""
FINE = 400
"""Instants of a step at which the distance is taken."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """A motion, and how far it is from the person."""

    motion: Motion
    """The motion: a step, and its mirror image after it."""
    distance: float
    """Root mean square difference of all joints over a step, in degrees."""
    by_joint: tuple[float, ...]
    """(nu,) The same of every joint, in degrees."""
    pitch: float
    """The same of the trunk's pitch, in degrees."""
    residual: float
    """Largest force (N) or moment (N m) that the equations of the trunk lack at the instants at
    which the motion is exact (the Gauss points)."""


def nearest_motion(
    wanted: Retargeted, *, friction: float = 0.75, progress: Callable[[float], None] | None = None
) -> Nearest:
    """Find the motion of a robot nearest to what a person does, and exact on hard contact.

    First a motion of least torque through the phases of the recording (heel, flat foot, toes) is
    looked for, in its time; then, from there, the one of least ∫ Σ (q - qᵖ)² + τ⁴ (q̈ - q̈ᵖ)² dt, of
    the trunk's pitch and all joints, where qᵖ is the person and τ some hundredths of a second.
    Where a robot cannot go through these phases, it stands on flat feet.

    Parameters
    ----------
    wanted : Retargeted
        What the person does, on the robot.
    friction : float
        Coefficient of friction.
    progress : callable, optional
        Told the fraction of the work that is done.

    Returns
    -------
    Nearest
        The motion, with its distance.

    Raises
    ------
    GaitNotFoundError
        If none was found; the message names what is in conflict.
    """
    report = progress or (lambda _: None)
    robot, failure = wanted.robot, None

    def far(now: Instant) -> casadi.SX:
        person = (each(now.time, casadi) for each in (wanted.position, wanted.acceleration))
        angles, accelerations = (casadi.vertcat(*each) for each in person)
        away, faster = now.position[2:] - angles, now.acceleration[2:] - accelerations
        effort = casadi.sumsqr(now.torque / (robot.weight * wanted.stride.leg))
        return casadi.sumsqr(away) + ABRUPT**4 * casadi.sumsqr(faster) + EFFORT * effort

    plans = _plans(wanted)
    for k, phases in enumerate(plans):
        begin, share = k / len(plans), 1.0 / len(plans)
        asked: dict[str, Any] = {
            "distance": 0.5 * wanted.length, "duration": 0.5 * wanted.duration,
            "friction": friction, "force_margin": FORCE_MARGIN * robot.weight,
            "landing_speed": LANDING,
            "clearance": CLEARANCE * wanted.stride.leg,
        }  # fmt: skip
        try:
            easy = optimize_motion(
                robot, phases, **asked, refine=False,
                progress=partial(_reported, report, begin, SKETCH * share),
            )  # fmt: skip
            motion = optimize_motion(
                robot, phases, **asked, cost=far, warm_start=easy, starts=1,
                progress=partial(
                    _reported, report, begin + SKETCH * share, (1.0 - SKETCH) * share
                ),
            )  # fmt: skip
        except GaitNotFoundError as error:
            failure = failure or error
            continue
        report(1.0)
        return _measured(wanted, motion)
    assert failure is not None
    raise GaitNotFoundError(
        f"robot {robot.name!r} at {wanted.length / wanted.duration:.3g} m/s, steps of "
        f"{0.5 * wanted.length:.3g} m in {0.5 * wanted.duration:.3g} s: {failure}"
    )


def _reported(report: Callable[[float], None], begin: float, share: float, done: float) -> None:
    """Tell how much of the whole a part of it is done with."""
    report(begin + share * done)


def _plans(wanted: Retargeted) -> list[list[ContactPhase]]:
    """Phases of a step, as the person has them, and on a flat foot."""
    stride, robot = wanted.stride, wanted.robot
    foot = next(each for each in robot.feet if each.link == wanted.legs[0][-1])
    names = [robot.contact_names[i] for i in foot.contacts]
    step = 0.5 * wanted.duration
    flat_only = [ContactPhase(foot.name, duration=step, pieces=6)]
    ends = [
        (names[:1], 0.0, stride.flat, 2), ([foot.name], stride.flat, stride.raised, 4),
        (names[-1:], stride.raised, 0.5, 3),
    ]  # fmt: skip
    phases = [
        ContactPhase(
            *stands, duration=_bounds((end - begin) * wanted.duration, step), pieces=pieces
        )
        for stands, begin, end, pieces in ends
        if end > begin
    ]
    return [flat_only] if len(phases) == 1 or len(names) == 1 else [phases, flat_only]


def _bounds(duration: float, step: float) -> tuple[float, float]:
    low = max(SHORTER * duration, SHORTEST)
    return low, min(max(LONGER * duration, 2.0 * SHORTEST), step)


def _measured(wanted: Retargeted, motion: Motion) -> Nearest:
    """Return a motion with its distance from the person."""
    time = motion.duration * (np.arange(FINE) + 0.5) / FINE
    person = np.array([wanted.position(float(t)) for t in time])
    away = np.rad2deg(motion.position(time)[:, 2:] - person)
    away = np.sqrt((away**2).mean(axis=0))
    joints = away[wanted.robot.model.actuator_joint - 2]
    return Nearest(
        motion=motion,
        distance=float(np.sqrt((joints**2).mean())),
        by_joint=tuple(float(each) for each in joints),
        pitch=float(away[0]),
        residual=residual_of(wanted.robot, motion),
    )


def residual_of(robot: Robot, motion: Motion) -> float:
    """Largest force (N) or moment (N m) that the equations of undriven coordinates lack.

    Parameters
    ----------
    robot : Robot
        The robot.
    motion : Motion
        A motion on level ground.

    Returns
    -------
    float
        At the Gauss points of all phases.
    """
    from heelstrike.contact.queries.kinematics import contact_kinematics
    from heelstrike.dynamics import inverse_dynamics, passive_force
    from heelstrike.gait.polynomials import gauss

    if motion.slope:
        raise GaitError("residuals need a motion on level ground")
    idle = np.setdiff1d(np.arange(robot.nv), robot.model.actuator_joint)
    largest, ground = 0.0, Ground(friction=motion.friction)
    for phase in motion.phases:
        nodes, _ = gauss(phase.force.shape[1])
        begins, lengths = phase.breakpoints[:-1, None], np.diff(phase.breakpoints)[:, None]
        times: Floats = np.asarray(begins + lengths * nodes).ravel()
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        pushed = phase.force.reshape(len(times), -1)
        for q, v, a, force in zip(*moved, pushed, strict=True):
            rows = contact_kinematics(robot, q, v, ground).jacobian.reshape(-1, robot.nv)
            lacking = inverse_dynamics(robot, q, v, a) - passive_force(robot, q, v)
            lacking = lacking - rows.T @ force
            largest = max(largest, float(np.abs(lacking[idle]).max()))
    return largest
