"""What the motors spend: the paper's torque cost (eq. 40), their work, the cost of transport."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.intervals import mean_over_intervals
from heelstrike.analysis.motion import Motion, run_motion
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.model import BALL, HINGE
from heelstrike.sim.dimension import AnyRobot
from heelstrike.sim.run import AnyRun, Run

SHORTEST_WAY = 1e-3
"""Distance (m) below which energy a distance means nothing."""


def torque_cost(run: AnyRun, *, start: float = -np.inf, end: float = np.inf) -> float:
    """∫ ΓᵀΓ dt over the rows from `start` to `end` (s), in N²m²s (paper eq. 40).

    Where torques are held from row to row, the sum is the integral.

    Parameters
    ----------
    run : Run
        The run.
    start, end : float
        Rows from and up to these times (s); all by default.

    Returns
    -------
    float
        Cost in N²m²s.
    """
    held = np.diff(run.time)
    square = mean_over_intervals(run, run.torque**2).sum(axis=1)
    inside = (run.time[:-1] >= start) & (run.time[:-1] < end)
    return float((square * held)[inside].sum())


def actuator_power(run: AnyRun) -> Floats:
    """Mean mechanical power τ ω of every actuator from each row to the next, (nt − 1, nu), in W.

    The velocity is the mean of the two rows, which makes the work of an impulsive step exact.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.

    Returns
    -------
    (nt - 1, nu) float
        Mean power from each row to the next, in W.
    """
    speed = run.velocity[:, run.robot.driven]
    return np.asarray(mean_over_intervals(run, run.torque) * 0.5 * (speed[:-1] + speed[1:]))


def turning(robot: AnyRobot) -> NDArray[np.bool_]:
    """Which velocities of a robot turn something, (nv,)."""
    if isinstance(robot, Robot):
        return np.asarray(robot.model.axis[:, 0] != 0.0)
    kind = robot.model.joint_kind[robot.model.velocity_joint]
    return np.asarray((kind == BALL) | (kind == HINGE))


def torque_bounds(run: AnyRun) -> tuple[Floats, Floats]:
    """Least and largest torque (nt, nu) that the motors can give in each row.

    They are the limits of the robot, and the speed-torque line where a motor has one.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.

    Returns
    -------
    lower, upper : (nt, nu) float
        N m, N of a slide; infinite without a limit.
    """
    model = run.robot.model
    lower = np.broadcast_to(model.torque_lower, run.torque.shape)
    upper = np.broadcast_to(model.torque_upper, run.torque.shape)
    moved = run.robot.driven
    stall = model.stall_torque[moved]
    with np.errstate(invalid="ignore"):
        drag = np.where(
            np.isfinite(stall), stall / model.no_load_speed[moved] * run.velocity[:, moved], 0.0
        )
    return np.maximum(lower, -stall - drag), np.minimum(upper, stall - drag)


@dataclass(frozen=True)
class CostOfTransport:
    """Energy spent a unit of weight and distance, without dimension."""

    absolute: float
    """∫ Σ |τ ω| dt / (m g d): braking costs as much as driving."""
    positive: float
    """∫ Σ max(τ ω, 0) dt / (m g d): braking is free."""
    distance: float
    """d, how far the centre of mass moved along x, in m."""


def cost_of_transport(run: Run, *, motion: Motion | None = None) -> CostOfTransport:
    """Mechanical cost of transport of a run.

    NaN if the robot has no weight or its centre of mass moved less than 1 mm.

    Parameters
    ----------
    run : Run
        The run.
    motion : Motion, optional
        Its motion, if already at hand.

    Returns
    -------
    CostOfTransport
        Energy a unit of weight and distance.
    """
    return transport_over(run, distance_travelled(run, motion=motion))


def transport_over(run: AnyRun, distance: float) -> CostOfTransport:
    """Mechanical cost of transport of a run over a distance (m); see :func:`cost_of_transport`."""
    held = np.diff(run.time)[:, None]
    power = actuator_power(run)
    scale = run.robot.weight * abs(distance)
    if not (run.robot.weight > 0.0 and abs(distance) > SHORTEST_WAY):
        scale = float("nan")
    return CostOfTransport(
        absolute=float((np.abs(power) * held).sum() / scale),
        positive=float((np.maximum(power, 0.0) * held).sum() / scale),
        distance=distance,
    )


def distance_travelled(run: Run, *, motion: Motion | None = None) -> float:
    """How far the centre of mass moved along x over a run, in m; negative backwards.

    Parameters
    ----------
    run : Run
        The run.
    motion : Motion, optional
        Its motion, if already at hand.

    Returns
    -------
    float
        Metres along x.
    """
    if not len(run.time):
        return 0.0
    center = (run_motion(run) if motion is None else motion).center_of_mass
    return float(center[-1, 0] - center[0, 0])
