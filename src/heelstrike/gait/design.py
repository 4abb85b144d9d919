"""From a request to a gait: optima from several starts, the best of them held at all times."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np

from heelstrike.blas_threads import one_blas_thread
from heelstrike.errors import GaitNotFoundError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.cost_rate import undefined
from heelstrike.gait.gait import Footing, Gait, Phase, actuated_joints, fingerprint
from heelstrike.gait.infeasible import ATTEMPTS, nearest_to_feasible
from heelstrike.gait.margins import Margins
from heelstrike.gait.program import Program, Solution, coarse, first_instants
from heelstrike.gait.refinement import checked_instants, held_between_nodes, solved_again
from heelstrike.gait.request import Request
from heelstrike.gait.starts import starts
from heelstrike.gait.transcription import Group, transcribed
from heelstrike.robot.model import Floats
from heelstrike.robot.motors import torque_range
from heelstrike.robot.state import State

SAME_COST = 1e-6
"""Relative difference of the costs of two optima of the coarse grid from which on they differ."""
NEARLY_SAME = 0.1
"""Distance between motions on two grids, relative to their size, within which they count as one:
the same optimum is off by 0.04, another one by more than 1, of the robot that has several."""
NEARLY_SAME_COST = 1e-3
"""Relative difference of the costs of the same optimum on two grids: that of the coarse one has ten
digits in most gaits."""
NEARLY_BEST = 0.1
"""How much dearer than the best of them one may be, relative to it, that is solved on the whole
grid, too: there the order may be another."""


@one_blas_thread()
def designed(request: Request, profile: ClearanceProfile, report: Callable[[float], None]) -> Gait:
    """Design a gait whose swing foot keeps above a profile; `report` is told the share of it.

    If there is no such gait, this takes the least time where another profile is left to try, which
    asks less of the foot.
    """
    program = Program(request, transcribed(request), profile, *first_instants(request))
    report(0.05)
    best = _best_of_starts(program, report)
    unknowns, optimal = held_between_nodes(program, best)
    if not np.isfinite(program.cost(unknowns)):
        raise undefined("cost", "of a gait that meets the request")
    report(1.0)
    return designed_gait(program, unknowns, optimal)


@one_blas_thread()
def between(request: Request, corners: Sequence[tuple[Gait, float]]) -> Gait:
    """Gait between others: the optimum near the mean of their motions, which count by weights.

    If none is reached, nor with the request's further profiles, the mean is changed as little as
    makes it satisfy all equations of a step.
    """
    profiles = {gait.clearance_profile for gait, _ in corners}
    profile = ClearanceProfile.SMOOTH if len(profiles) > 1 else profiles.pop()
    program = Program(request, transcribed(request), profile, *first_instants(request))
    mean = np.sum([weight * program.resampled(gait) for gait, weight in corners], axis=0)
    mean = program.in_bounds(mean)
    given = request.profiles
    further = given[given.index(profile) + 1 :] if profile in given else ()  # ask less of the foot
    for each in (program, *(replace(program, profile=other) for other in further)):
        near = replace(each, near=True).solve(mean)
        if near.converged:
            with suppress(GaitNotFoundError):  # it breaks limits between the instants
                return designed_gait(each, *held_between_nodes(each, near, near_only=True))
    return designed_gait(program, program.polished(mean, within_limits=False), optimal=False)


def _best_of_starts(program: Program, report: Callable[[float], None]) -> Solution:
    request = program.request
    if request.warm_start is not None:
        near = replace(program, near=True)
        solution = near.solve(near.resampled(request.warm_start))
        report(0.8)
        if solution.converged:
            return solution
    rough = coarse(program)
    begun = list(islice(starts(request), request.starts))
    guesses = [rough.sampled(start) for start in begun]
    if not any(np.isfinite(rough.at(guess).objective) for guess in guesses):
        raise undefined("cost", "of any motion from which the optimiser starts")
    solutions = [replace(rough, hasty=True).solve(guesses[0])]
    inside: list[Solution] = []
    if not solutions[0].converged:
        # Perhaps no start can succeed, which ends here in an error that tells why. Otherwise a
        # point that satisfies all constraints is as good a start as can be.
        last = program.profile is request.profiles[-1]
        feasible = nearest_to_feasible(rough, ATTEMPTS if last else 1)
        inside = [replace(rough, inside=True).solve(feasible)]
        solutions = [rough.solve(guesses[0])]
    whole: list[Solution] = []
    # Where the parabola is too much for the foot, there often are several optima, of which the
    # coarse grid may have but one.
    hard = rough is not program and program.profile is ClearanceProfile.SMOOTH
    for k, guess in enumerate(guesses[1:]):
        report(0.05 + 0.7 * (k + 1) / len(guesses))
        last = k + 2 == len(guesses)
        if hard and last and _agree((*inside, *solutions)):
            whole.append(program.solve(program.sampled(begun[-1])))
        else:
            solutions.append(rough.solve(guess))
    report(0.75)
    good = [solution for solution in (*inside, *solutions) if solution.converged]
    if rough is not program and good:
        # Optima that only the whole grid has are looked for, too.
        lost = [start for start, at in zip(begun, solutions, strict=False) if not at.converged]
        near = replace(program, near=True)
        if not (whole and whole[0].converged and _nearly_same(whole[0], good[0])):
            whole += [near.solve(each.unknowns) for each in _different(good)]
        whole += [program.solve(program.sampled(start)) for start in lost]
        if found := [solution for solution in whole if solution.converged]:
            return min(found, key=lambda solution: solution.objective)
    # Without an optimum, the best of the points that satisfy all constraints is better than none.
    good = good or [rough.at(feasible), *filter(rough.satisfied_by, (*inside, *solutions))]
    best = min(good, key=lambda solution: solution.objective)
    return best if rough is program else solved_again(program, best.unknowns)


def _agree(solutions: Sequence[Solution]) -> bool:
    """Whether all of two or more are optima that cost the same."""
    costs = np.array([each.objective for each in solutions])
    optima = costs.size > 1 and all(each.converged for each in solutions)
    return bool(optima and np.ptp(costs) <= SAME_COST * np.abs(costs).min())


def _nearly_same(one: Solution, other: Solution) -> bool:
    """Whether motions on two grids are nearly the same, and cost nearly the same."""
    a, b = one.unknowns, other.unknowns
    near = np.linalg.norm(a - b) <= NEARLY_SAME * np.linalg.norm(b)
    dearer = abs(one.objective - other.objective)
    return bool(near and dearer <= NEARLY_SAME_COST * abs(other.objective))


def _different(optima: Sequence[Solution]) -> list[Solution]:
    """Return one of those that cost the same each, of those that are nearly as good as the best."""
    kept: list[Solution] = []
    for each in sorted(optima, key=lambda solution: solution.objective):
        if not kept or (
            each.objective > (1.0 + SAME_COST) * kept[-1].objective
            and each.objective <= (1.0 + NEARLY_BEST) * kept[0].objective
        ):
            kept.append(each)
    return kept


def designed_gait(program: Program, unknowns: Floats, optimal: bool) -> Gait:
    """Gait with the given unknowns, its joints in the order of the actuators."""
    transcription, request = program.transcription, program.request
    robot, stance, ground = request.robot, request.stance, request.under_foot
    joint = robot.model.actuator_joint
    pieces = program.pieces(unknowns)
    end, _, start_velocity, duration, length = touchdown = program.at_touchdown(unknowns)
    impulse = np.zeros(3)
    if request.impact:
        impulse[: stance.held] = np.array(transcription.landing(*touchdown[:3], ground)[0]).ravel()
    state = (np.array(part).ravel() for part in transcription.start(end, start_velocity, ground))
    phase = Phase(
        contacts={stance.foot: Footing.FLAT if stance.flat else Footing.POINT},
        breakpoints=float(duration) * np.linspace(0.0, 1.0, len(pieces) + 1),
        pieces=pieces[:, :, [transcription.free.index(j) for j in joint]],
        pitch_pieces=None if stance.flat else pieces[:, :, 0],
    )
    legs = request.mirror.among(joint)
    return Gait(
        robot=robot.name,
        fingerprint=fingerprint(robot),
        joint_names=actuated_joints(robot),
        step_length=float(length),
        phases=(phase,),
        mirror_joint=legs.joint,
        mirror_sign=legs.sign,
        mirror_offset=legs.offset,
        initial_state=State(*state),
        cost=program.effort(unknowns),
        spent=program.cost(unknowns),
        optimal=optimal,
        slope=request.slope,
        rise=request.rise,
        friction=request.friction,
        clearance=request.clearance,
        clearance_profile=program.profile,
        touchdown_impulse=impulse[[1, 0, 2]],
        margins=margins_of(program, unknowns),
    )


def margins_of(program: Program, unknowns: Floats) -> Margins:
    """Worst values at the instants at which a program was checked, from the motion itself."""
    transcription, request = program.transcription, program.request
    model, ground = request.robot.model, request.under_foot
    fine = checked_instants(program)
    motion = program.motion(unknowns, fine)
    wrench, torque, heights, position = (
        np.array(part)
        for part in transcription.motion.map(fine.share.size)(*motion, unknowns[-1], ground)
    )
    half = request.stance.half_length
    actuator = np.argsort(model.actuator_joint)
    velocity = np.zeros((fine.share.size, model.nv))
    velocity[:, request.drive.driven] = motion[1][-request.robot.nu :].T
    lower, upper = (ends[:, actuator].T for ends in torque_range(model, velocity))
    limits = np.minimum(upper - torque, torque - lower)
    ranges = np.minimum(request.upper[3:, None] - position, position - request.lower[3:, None])
    end = program.at_touchdown(unknowns)
    impulse, landing, lift = (
        np.array(part).ravel() for part in transcription.landing(*end[:3], ground)
    )
    touchdown = np.array(transcription.touchdown(*end, ground)).ravel()
    groups = np.array([row.kind for row in transcription.touchdown_rows])
    placed = (groups == Group.TOUCHDOWN_PLACE) | (groups == Group.TOUCHDOWN_ANGLE)
    periodic = (groups == Group.IMPACT) | (groups == Group.PERIODIC)
    return Margins(
        normal_force=float(wrench[1].min()),
        friction_use=_use(wrench, request.cone),
        zero_moment_point=_inside(wrench, half),
        clearance=float((heights - program.clearance(fine)).min()),
        joint_range=float(ranges.min()),
        torque=float(limits.min()),
        peak_torque=float(np.abs(torque).max()),
        impulse=float(impulse[1]) if request.impact else 0.0,
        impulse_friction_use=_use(impulse, request.cone) if request.impact else 0.0,
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
