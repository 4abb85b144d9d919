"""The optimal gait: least ∫ΓᵀΓ dt over one periodic step (paper section 4.2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Gait, actuated_joints, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.request import checked_request
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.gait.program import Program, Solution

Floats = NDArray[np.float64]

FINER = 10
"""Constraints are checked on a grid this many times finer than the optimiser's."""
ROUNDS = 8
"""Times that phases are added where a constraint is violated between the nodes of the grid."""


def optimize_gait(
    robot: Robot,
    *,
    step_length: float | None = None,
    step_duration: float | None = None,
    speed: float | None = None,
    friction: float = 0.75,
    clearance: float = 0.03,
    clearance_profile: ClearanceProfile | str | None = None,
    zmp_margin: float | None = None,
    force_margin: float | None = None,
    joint_speed_limit: float = math.inf,
    impact: bool = True,
    intervals: int = 26,
    starts: int = 3,
    progress: Callable[[float], None] | None = None,
) -> Gait:
    """Find the periodic gait of least torque cost ∫ΓᵀΓ dt (paper eq. 40-43).

    Every actuated joint follows one cubic polynomial a step; every step mirrors the one before
    (eq. 13). The robot always stands on one flat foot (eq. 11), in single support. The unknowns
    are joint positions and velocities at the ends of the step. Where length and duration of the
    step are not both fixed, they are unknowns too and the cost *per metre* is minimised: the cost
    alone would be least for a robot that stands still.

    The constraints hold at all times, not only at the nodes of a grid: they are checked between
    the nodes, and phases are added where they fail, until none is violated by more than 1e-6
    (m, rad; relative to the weight or the torque limit for forces).

    Parameters
    ----------
    robot : Robot
        A floating, mirror-symmetric robot with two feet that can stand flat (two contact points or
        more each) and a motor at every joint. Its joint ranges and torque limits are respected.
    step_length : float, optional
        Distance between the feet when both are on the ground (m): the body moves so far a step.
    step_duration : float, optional
        Duration of a step (s).
    speed : float, optional
        Walking speed (m/s), alone or with one of the two above.
    friction : float
        Coefficient of friction; the stance foot and the landing impulse stay inside the cone.
    clearance : float
        Greatest height (m) of the profile above which all contact points of the swing foot stay.
    clearance_profile : ClearanceProfile or its name, optional
        Shape of that profile. By default a parabola, or, where no gait keeps above that and for
        gaits without impact, a hump that is flat at both ends; the gait says which.
    zmp_margin : float, optional
        Distance (m) of the zero moment point, and of the centre of the landing impulse, from the
        ends of the sole. A tenth of the sole's length by default.
    force_margin : float, optional
        Least normal force on the stance foot (N). A tenth of the weight by default.
    joint_speed_limit : float
        Largest joint speed (rad/s).
    impact : bool
        Whether the swing foot may land with velocity: the landing is then a plastic impact, whose
        impulse is unilateral, inside the friction cone and the sole, and leaves the rear foot free
        to lift (eq. 20-22). Otherwise it must come to rest as it lands.
    intervals : int
        Intervals of the Gauss-Lobatto grid for quadrature and constraints.
    starts : int
        Starting points; the best of the optima reached from them is kept.
    progress : callable, optional
        Called now and then with the fraction of the work that is done.

    Returns
    -------
    Gait
        The gait, with its margins to all constraints.

    Raises
    ------
    GaitError
        If the robot cannot walk this way or an argument makes no sense.
    InfeasibleGaitError
        If no gait meets the request; the message names the constraints in conflict and by how much
        they are violated at the least.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    >>> gait.position([0.0, 0.35]).shape
    (2, 6)
    """
    request = checked_request(
        robot,
        step_length=step_length,
        step_duration=step_duration,
        speed=speed,
        friction=friction,
        clearance=clearance,
        clearance_profile=clearance_profile,
        zmp_margin=zmp_margin,
        force_margin=force_margin,
        joint_speed_limit=joint_speed_limit,
        impact=impact,
        intervals=intervals,
        starts=starts,
    )
    # CasADi is loaded only now: importing heelstrike, or loading a saved gait, does without it.
    from heelstrike.gait.program import Program, lobatto
    from heelstrike.gait.transcription import Transcription

    report = progress or _silent
    transcription = Transcription(request)
    nodes, weights = lobatto(request.intervals)
    *others, last = (
        Program(transcription, nodes, weights, profile=profile) for profile in request.profiles
    )
    for program in others:
        try:
            return _designed(program, report)
        except InfeasibleGaitError:
            continue  # the last profile asks least of the swing foot
    return _designed(last, report)


def _designed(program: Program, report: Callable[[float], None]) -> Gait:
    report(0.05)
    best = _best_of_starts(program, report)
    unknowns = _hold_between_nodes(program, best)
    report(1.0)
    return _gait(program, unknowns)


def _silent(fraction: float) -> None:
    """Report to nobody."""
    del fraction


def _best_of_starts(program: Program, report: Callable[[float], None]) -> Solution:
    from heelstrike.gait.infeasible import nearest_to_feasible
    from heelstrike.gait.starts import starting_points

    request = program.transcription.request
    guesses = list(islice(starting_points(request), request.starts))
    solutions: list[Solution] = []
    while guesses:
        solutions.append(program.solve(guesses.pop(0)))
        if len(solutions) == 1 and not solutions[0].converged:
            # Perhaps no start can succeed, which ends here in an error that tells why. Otherwise
            # a point that satisfies all constraints is as good a start as can be.
            guesses.insert(0, nearest_to_feasible(program))
        report(0.05 + 0.75 * len(solutions) / (len(solutions) + len(guesses)))
    converged = [solution for solution in solutions if solution.converged]
    if not converged:
        raise GaitError(
            f"robot {request.robot.name!r}: the optimiser found gaits with {request}, but "
            f"did not converge to the best ({solutions[0].status}). Try more starts or intervals."
        )
    return min(converged, key=lambda solution: solution.objective)


def _hold_between_nodes(program: Program, solution: Solution) -> Floats:
    """Add phases where constraints fail between the nodes, until they hold everywhere."""
    from heelstrike.gait.infeasible import nearest_to_feasible

    fine = _subdivided(program.phases, FINER)
    for _ in range(ROUNDS):
        unknowns = _polished(program, solution.unknowns)
        missed = _missed(program, unknowns, fine)
        if not missed.size:
            return unknowns
        program = program.refined(missed)
        solution = program.solve(unknowns)
        if not solution.converged:
            solution = program.solve(nearest_to_feasible(program))
        if not solution.converged:
            break
    request = program.transcription.request
    raise InfeasibleGaitError(
        f"robot {request.robot.name!r}: a gait with {request} satisfies the constraints at "
        f"{request.intervals + 1} phases of a step but not between them ({solution.status}). Try "
        "more intervals, or a slower step."
    )


def _subdivided(nodes: Floats, parts: int) -> Floats:
    """Grid with every interval cut into equal parts."""
    share = np.arange(parts) / parts
    inner = nodes[:-1, None] + np.diff(nodes)[:, None] * share
    return np.append(inner.ravel(), nodes[-1])


def _missed(program: Program, unknowns: Floats, fine: Floats) -> Floats:
    """Phases off the grid where a constraint along the path is violated most, one a lapse."""
    path = program.transcription.path
    _, values = (np.array(part) for part in path.value.map(fine.size)(unknowns, fine[None, :]))
    lower, upper = program.path_bounds(fine)
    excess = np.maximum(lower - values, values - upper)
    missed = set()
    for row in excess:
        for k in np.flatnonzero(row > 0.0).tolist():
            left, right = max(k - 1, 0), min(k + 1, fine.size - 1)
            if row[k] >= row[left] and row[k] >= row[right]:
                missed.add(_vertex(fine[left : right + 1], row[left : right + 1]))
    return np.array(sorted(missed))


def _vertex(phases: Floats, excess: Floats) -> float:
    """Place of the maximum of the parabola through three points whose middle is the highest."""
    if phases.size < 3 or not np.all(np.isfinite(excess)):
        return float(phases[np.argmax(excess)])
    (a, b, c), (fa, fb, fc) = phases, excess
    rise, fall = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = (fall - rise) / (c - a)
    if not bend < 0.0:
        return float(b)
    return float(np.clip(0.5 * (a + b) - 0.5 * rise / bend, a, c))


def _polished(program: Program, unknowns: Floats) -> Floats:
    """Satisfy the equations at touchdown to rounding, by the least change of the unknowns."""
    touchdown = program.transcription.touchdown
    request = program.transcription.request
    equations = [k for k, row in enumerate(touchdown.rows) if row.lower == row.upper]
    target = np.array([touchdown.rows[k].lower for k in equations])
    free = np.ones(unknowns.size, dtype=bool)
    free[-2] = request.duration_bounds[0] < request.duration_bounds[1]
    free[-1] = request.length_bounds[0] < request.length_bounds[1]
    polished = unknowns.copy()
    for _ in range(3):
        value, jacobian = (np.array(part) for part in touchdown.jacobian(polished))
        residual = target - value.ravel()[equations]
        polished[free] += np.linalg.lstsq(jacobian[equations][:, free], residual, rcond=None)[0]
    return polished


def _gait(program: Program, unknowns: Floats) -> Gait:
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
    from heelstrike.gait.transcription import Group

    transcription = program.transcription
    request, robot = transcription.request, transcription.request.robot
    model = robot.model
    fine = _subdivided(program.phases[program.weights > 0.0], FINER)
    wrench, torque, heights, position = (
        np.array(part) for part in transcription.motion.map(fine.size)(unknowns, fine[None, :])
    )
    force_x, force_z, moment = wrench
    half = request.stance.half_length
    actuator = np.argsort(model.actuator_joint)
    limits = np.minimum(
        model.torque_upper[actuator, None] - torque, torque - model.torque_lower[actuator, None]
    )
    ranges = np.minimum(model.upper[3:, None] - position, position - model.lower[3:, None])
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
