"""From the unknowns of the program to the gait, with its margins to all constraints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heelstrike.gait.gait import Gait, actuated_joints, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.program import Program
from heelstrike.gait.refinement import checked_phases
from heelstrike.gait.transcription import Group
from heelstrike.robot.state import State

Floats = NDArray[np.float64]


def designed_gait(program: Program, unknowns: Floats) -> Gait:
    """Gait with the given unknowns, its joints in the order of the actuators."""
    transcription = program.transcription
    request, robot = transcription.request, transcription.request.robot
    mirror = robot.mirror
    assert mirror is not None
    joint = robot.model.actuator_joint
    actuator_of = {int(j): k for k, j in enumerate(joint)}
    end, end_velocity, start_velocity = np.split(unknowns[:-2], 3)
    duration, length = (float(value) for value in unknowns[-2:])
    reference, sign = robot.model.reference, mirror.sign
    offset = reference - sign * reference[mirror.joint]
    order = joint - 3
    counterpart = np.array([actuator_of[int(mirror.joint[j])] for j in joint])
    mirror_sign, mirror_offset = sign[joint], offset[joint]
    end = end[order]
    q, v = (np.array(part).ravel() for part in transcription.start(unknowns))
    impulse_x, impulse_z, impulse_moment = np.array(transcription.landing(unknowns)[0]).ravel()
    impulse = [impulse_z, impulse_x, impulse_moment] if request.impact else [0.0, 0.0, 0.0]
    costs, _ = transcription.path.value.map(program.phases.size)(unknowns, program.phases[None, :])
    cost = float(np.array(costs).ravel() @ program.weights)
    return Gait(
        robot=robot.name,
        fingerprint=fingerprint(robot),
        joint_names=actuated_joints(robot),
        step_length=length,
        step_duration=duration,
        start_position=mirror_sign * end[counterpart] + mirror_offset,
        end_position=end,
        start_velocity=start_velocity[order],
        end_velocity=end_velocity[order],
        mirror_joint=counterpart,
        mirror_sign=mirror_sign,
        mirror_offset=mirror_offset,
        stance_foot=request.stance.foot,
        initial_state=State(q, v),
        cost=cost * length if request.free_step else cost,
        friction=request.friction,
        clearance=request.clearance,
        clearance_profile=program.profile,
        touchdown_impulse=np.array(impulse),
        margins=_margins(program, unknowns),
    )


def _margins(program: Program, unknowns: Floats) -> Margins:
    """Worst values on the fine grid, from the motion itself."""
    transcription = program.transcription
    request, robot = transcription.request, transcription.request.robot
    model = robot.model
    fine = checked_phases(program)
    wrench, torque, heights, position = (
        np.array(part) for part in transcription.motion.map(fine.size)(unknowns, fine[None, :])
    )
    force_x, force_z, moment = wrench
    half = request.stance.half_length
    actuator = np.argsort(model.actuator_joint)
    limits = np.minimum(
        model.torque_upper[actuator, None] - torque, torque - model.torque_lower[actuator, None]
    )
    ranges = np.minimum(request.upper[3:, None] - position, position - request.lower[3:, None])
    profile = program.clearance(fine)
    off_ground = np.isfinite(profile)
    impulse, landing, lift = (np.array(part).ravel() for part in transcription.landing(unknowns))
    touchdown = np.array(transcription.touchdown.value(unknowns)[1]).ravel()
    periodic = [row.group in (Group.IMPACT, Group.PERIODIC) for row in transcription.touchdown.rows]
    return Margins(
        normal_force=float(force_z.min()),
        friction_use=_use(force_x, force_z, request.friction),
        zero_moment_point=float((half - np.abs(moment / force_z)).min()),
        clearance=float((heights - profile)[:, off_ground].min()),
        joint_range=float(ranges.min()),
        torque=float(limits.min()),
        peak_torque=float(np.abs(torque).max()),
        impulse=float(impulse[1]) if request.impact else 0.0,
        impulse_friction_use=(
            _use(impulse[:1], impulse[1:2], request.friction) if request.impact else 0.0
        ),
        impulse_center=half - abs(float(impulse[2] / impulse[1])) if request.impact else half,
        landing_velocity=float(landing.max()),
        lift_velocity=float(lift.min()),
        touchdown_error=float(np.abs(touchdown[:3]).max()),
        impact_error=float(np.abs(touchdown[periodic]).max()),
    )


def _use(tangential: Floats, normal: Floats, friction: float) -> float:
    """Largest share of the friction cone in use."""
    if friction == 0.0:
        return 0.0 if not np.any(tangential) else math.inf
    return float((np.abs(tangential) / (friction * normal)).max())
