"""How far a gait stays from everything that would make it fall, slip, hit or break."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from heelstrike.gait.program import Program

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Margins:
    """Worst values of a gait over one step, found on a grid finer than the optimiser's.

    Attributes
    ----------
    normal_force : float
        Least normal force of the ground on the stance foot, in N.
    friction_use : float
        Largest |tangential force| / (friction coefficient times normal force); at most 1.
    zero_moment_point : float
        Least distance of the zero moment point from the ends of the sole, in m; 0 on a point.
    clearance : float
        Least height of the swing foot's contact points above the clearance profile, in m.
    joint_range : float
        Least distance of a joint from the end of its range, the robot's or a narrower one that was
        asked for, in rad (m for a slide); infinite if no joint has one.
    torque : float
        Least distance of a torque from its limit, in N m (N for a slide); infinite if there are
        no limits.
    peak_torque : float
        Largest torque (N m) or force (N).
    impulse : float
        Normal impulse of the ground at touchdown, in N s.
    impulse_friction_use : float
        |Tangential impulse| / (friction coefficient times normal impulse); at most 1.
    impulse_center : float
        Distance of the impulse's centre of pressure from the ends of the landing sole, in m.
    landing_velocity : float
        Largest vertical velocity of the landing foot's contact points just before touchdown, in
        m/s; not positive.
    lift_velocity : float
        Least vertical velocity of the rear foot's contact points just after touchdown, in m/s;
        not negative.
    touchdown_error : float
        How far (m, rad) the landing foot is from its place flat on the ground.
    impact_error : float
        Residual of the equations of the impact, relative to the robot's weight (s m).
    """

    normal_force: float = field(metadata={"unit": "N"})
    friction_use: float
    zero_moment_point: float = field(metadata={"unit": "m"})
    clearance: float = field(metadata={"unit": "m"})
    joint_range: float = field(metadata={"unit": "rad"})
    torque: float = field(metadata={"unit": "Nm"})
    peak_torque: float = field(metadata={"unit": "Nm"})
    impulse: float = field(metadata={"unit": "Ns"})
    impulse_friction_use: float
    impulse_center: float = field(metadata={"unit": "m"})
    landing_velocity: float = field(metadata={"unit": "m_per_s"})
    lift_velocity: float = field(metadata={"unit": "m_per_s"})
    touchdown_error: float
    impact_error: float


def margins_of(program: Program, unknowns: Floats) -> Margins:
    """Worst values at the instants at which a program was checked, from the motion itself."""
    from heelstrike.gait.refinement import checked_instants
    from heelstrike.gait.transcription import Group

    transcription, request = program.transcription, program.request
    model = request.robot.model
    fine = checked_instants(program)
    motion = program.motion(unknowns, fine)
    wrench, torque, heights = (
        np.array(part) for part in transcription.motion.map(fine.share.size)(*motion)
    )
    position = motion[0][-request.robot.nu :]
    half = request.stance.half_length
    actuator = np.argsort(model.actuator_joint)
    limits = np.minimum(
        model.torque_upper[actuator, None] - torque, torque - model.torque_lower[actuator, None]
    )
    ranges = np.minimum(request.upper[3:, None] - position, position - request.lower[3:, None])
    end = program.at_touchdown(unknowns)
    impulse, landing, lift = (np.array(part).ravel() for part in transcription.landing(*end[:3]))
    touchdown = np.array(transcription.touchdown(*end)).ravel()
    groups = np.array([row.group for row in transcription.touchdown_rows])
    placed = (groups == Group.TOUCHDOWN_PLACE) | (groups == Group.TOUCHDOWN_ANGLE)
    periodic = (groups == Group.IMPACT) | (groups == Group.PERIODIC)
    return Margins(
        normal_force=float(wrench[1].min()),
        friction_use=_use(wrench, request.friction),
        zero_moment_point=_inside(wrench, half),
        clearance=float((heights - program.clearance(fine)).min()),
        joint_range=float(ranges.min()),
        torque=float(limits.min()),
        peak_torque=float(np.abs(torque).max()),
        impulse=float(impulse[1]) if request.impact else 0.0,
        impulse_friction_use=_use(impulse, request.friction) if request.impact else 0.0,
        impulse_center=_inside(impulse, half) if request.impact else half,
        landing_velocity=float(landing.max()),
        lift_velocity=float(lift.min()),
        touchdown_error=float(np.abs(touchdown[placed]).max()),
        impact_error=float(np.abs(touchdown[periodic]).max()),
    )


def _use(wrench: Floats, friction: float) -> float:
    """Largest share of the friction cone in use."""
    if friction == 0.0:
        return 0.0 if not np.any(wrench[0]) else math.inf
    return float((np.abs(wrench[0]) / (friction * wrench[1])).max())


def _inside(wrench: Floats, half_length: float) -> float:
    """Least distance of the centre of pressure from the ends of the sole (m)."""
    moment = wrench[2:].sum(axis=0)  # none on a point foot
    return float((half_length - np.abs(moment / wrench[1])).min())
