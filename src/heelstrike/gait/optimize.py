"""The optimal gait: least ∫ΓᵀΓ dt over one periodic step (paper section 4.2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import InfeasibleGaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Footing, Gait, Phase, actuated_joints, fingerprint
from heelstrike.gait.margins import margins_of
from heelstrike.gait.request import JointRanges, Request
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.gait.program import Program, Solution
    from heelstrike.gait.transcription import Transcription

Floats = NDArray[np.float64]


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
    joint_ranges: JointRanges | None = None,
    impact: bool = True,
    intervals: int | None = None,
    starts: int = 3,
    progress: Callable[[float], None] | None = None,
) -> Gait:
    """Find the periodic gait of least torque cost ∫ΓᵀΓ dt (paper eq. 40-43).

    Every actuated joint follows one cubic polynomial a step; every step mirrors the one before
    (eq. 13). The robot always stands on one flat foot (eq. 11), in single support. The unknowns
    are the joints' positions at the end of the step, their velocities at its beginning and their
    accelerations. Where length and duration of the step are not both fixed, they are unknowns too
    and the cost *per metre* is minimised: the cost alone would be least for a robot that stands
    still.

    The constraints hold at all times, not only at the nodes of a grid: they are checked on a grid
    ten times finer and at the maxima between its points, and phases are added where they fail,
    until none does. A millionth (m, rad; relative to weight or torque limit for forces) is kept in
    reserve for that. At the impact the rear foot may have a velocity of 1e-6 m/s into the ground.
    Only the feet are kept off the ground, not knees or hands.

    On point feet (one contact point each) the ground exerts no moment and the robot is
    underactuated: not every motion of the joints is possible. There, joints and the trunk's pitch
    follow piecewise polynomials of degree 5, which satisfy the equation of motion that no motor
    enters at the Gauss points of every interval (direct collocation). Controllers that follow such
    a gait in time need not be stable.

    Parameters
    ----------
    robot : Robot
        A floating, mirror-symmetric robot with two feet and a motor at every joint. The feet can
        stand flat (two contact points or more each) or are points (one each). Joint ranges and
        torque limits are respected.
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
    joint_ranges : mapping of str to (float, float), optional
        Lowest and highest position of joints by name (rad, m for a slide), where it should be
        narrower than the robot's own range. It holds for the joint's counterpart on the other
        side, too: ``{"right_knee": (0.1, 1.5)}`` keeps both knees bent.
    impact : bool
        Whether the swing foot may land with velocity: the landing is then a plastic impact, whose
        impulse is unilateral, inside the friction cone and the sole, and leaves the rear foot free
        to lift (eq. 20-22). Otherwise it must come to rest as it lands.
    intervals : int, optional
        Intervals of the Gauss-Lobatto grid for quadrature and constraints, 26 by default; on point
        feet, intervals of the collocation mesh, 12 by default.
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
    asked = dict(locals())  # all arguments, by name
    report = _Forward(asked.pop("progress"))
    request = Request(**asked)
    # CasADi is loaded only now: importing heelstrike, or loading a saved gait, does without it.
    from heelstrike.gait.transcription import Transcription

    transcription = Transcription(request)
    *others, last = request.profiles
    for profile in others:
        with suppress(InfeasibleGaitError):  # the last profile asks least of the swing foot
            return _designed(transcription, profile, report)
    return _designed(transcription, last, report)


class _Forward:
    """Progress that never goes back, also when the work turns out to be more."""

    def __init__(self, progress: Callable[[float], None] | None) -> None:
        self._progress = progress
        self._furthest = 0.0

    def __call__(self, fraction: float) -> None:
        self._furthest = max(self._furthest, fraction)
        if self._progress is not None:
            self._progress(self._furthest)


def _designed(
    transcription: Transcription, profile: ClearanceProfile, report: Callable[[float], None]
) -> Gait:
    from heelstrike.gait.program import Program, first_instants
    from heelstrike.gait.refinement import held_between_nodes

    program = Program(transcription, profile, *first_instants(transcription.request))
    report(0.05)
    best = _best_of_starts(program, report)
    unknowns = held_between_nodes(program, best)
    report(1.0)
    return designed_gait(program, unknowns)


def _best_of_starts(program: Program, report: Callable[[float], None]) -> Solution:
    from heelstrike.gait.infeasible import nearest_to_feasible
    from heelstrike.gait.starts import starts

    request = program.request
    guesses = [program.sampled(start) for start in islice(starts(request), request.starts)]
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
        raise InfeasibleGaitError(
            f"robot {request.robot.name!r}: gaits with {request} exist only just: points that "
            f"satisfy all constraints were found, but no optimum ({solutions[-1].ended}). Ask "
            "for a shorter or slower step or a lower clearance of the swing foot."
        )
    return min(converged, key=lambda solution: solution.objective)


def designed_gait(program: Program, unknowns: Floats) -> Gait:
    """Gait with the given unknowns, its joints in the order of the actuators."""
    transcription, request = program.transcription, program.request
    robot, stance = request.robot, request.stance
    joint = robot.model.actuator_joint
    pieces = program.pieces(unknowns)
    end, _, start_velocity, duration, length = touchdown = program.at_touchdown(unknowns)
    impulse = np.zeros(3)
    if request.impact:
        impulse[: stance.held] = np.array(transcription.landing(*touchdown[:3])[0]).ravel()
    state = (np.array(part).ravel() for part in transcription.start(end, start_velocity))
    phase = Phase(
        contacts={stance.foot: Footing.FLAT if stance.flat else Footing.POINT},
        breakpoints=float(duration) * np.linspace(0.0, 1.0, len(pieces) + 1),
        pieces=pieces[:, :, joint - stance.held],
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
        friction=request.friction,
        clearance=request.clearance,
        clearance_profile=program.profile,
        touchdown_impulse=impulse[[1, 0, 2]],
        margins=margins_of(program, unknowns),
    )
