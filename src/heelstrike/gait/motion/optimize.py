"""Motions of several phases, of least cost (direct collocation of all coordinates)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import are_numbers, one_of, positive, shown, takes
from heelstrike.dynamics import (
    contact_positions,
    link_poses,
    loop_displacement,
    loop_jacobian,
    point_jacobian,
)
from heelstrike.errors import GaitError, GaitNotFoundError, InfeasibleGaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.cost import Cost, OwnConstraint, OwnCost, costs_of
from heelstrike.gait.cost_rate import undefined
from heelstrike.gait.gait import fingerprint
from heelstrike.gait.motion.closing import Follower
from heelstrike.gait.motion.guess import guess_of
from heelstrike.gait.motion.instant import MotionFunctions
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.phases import ContactPhase, Standing
from heelstrike.gait.motion.program import (
    EQUATIONS,
    STAGES,
    MotionProgram,
    beginnings,
    endings,
    gauss_points,
    looked_at,
    path_variables,
    phases_of,
)
from heelstrike.gait.motion.request import MotionRequest, Repeat
from heelstrike.gait.motion.rows import Kind
from heelstrike.gait.polynomials import Instants
from heelstrike.gait.program import CLOSE, FEASIBLE
from heelstrike.gait.request import check_slope
from heelstrike.robot.loops import refuse_loops, row_names
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.robot.state import State
from heelstrike.robot.warning import warn

STARTS = ((0.0, 0.95), (0.1, 0.9), (0.0, 0.85))
"""Leans of the trunk (rad) and heights, as shares of that on straight legs, to start from."""
ROUNDS = 5
"""How often instants are added where limits fail between the Gauss points."""
FINER = 5
"""Instants between which limits are checked, for each Gauss point."""
BESIDE = 2
"""How many of them lie between one at which a limit fails and the next that are added with it."""
OWN_FINER = 5
"""How many times as many these are for constraints of one's own, which may have corners. Odd: each
instant of the others is in the middle of some."""


class GaitWarning(UserWarning):
    """A motion was designed, but it is not all that was wanted."""


@takes(GaitError)
def optimize_motion(
    robot: Robot,
    phases: Sequence[ContactPhase],
    *,
    repeat: Repeat | str = "mirrored",
    distance: float | tuple[float, float] | None = None,
    duration: float | None = None,
    speed: float | None = None,
    start: State | None = None,
    end: State | None = None,
    friction: float = 0.75,
    clearance: float = 0.03,
    slope: float = 0.0,
    force_margin: float = 0.0,
    landing_speed: float = 0.0,
    cost: Cost | str | Mapping[Cost | str, float] | OwnCost = "torque",
    constraint: OwnConstraint | None = None,
    warm_start: Motion | None = None,
    guess: Callable[[float], ArrayLike] | None = None,
    refine: bool = True,
    starts: int = len(STARTS),
    progress: Callable[[float], None] | None = None,
) -> Motion:
    """Find the motion of least cost through phases with given contacts.

    All coordinates are polynomials of degree 5 on pieces of each phase, which satisfy the equations
    of motion and those of the contacts at four Gauss points of each (direct collocation, of order
    8 at the ends of pieces). Forces of the ground are unknowns, so that phases on two feet choose
    how these share the load. Where points come down that did not stand before, there is a plastic
    impact (paper eq. 20-22) of all points of the next phase, which pushes and stays in the friction
    cone; points that leave do so freely. All derivatives are exact.

    Parameters
    ----------
    robot : Robot
        A floating robot. Closed loops and coupled joints hold, by forces that are unknowns, too;
        joints may lack motors.
    phases : sequence of ContactPhase
        What stands in each phase, and its least and greatest duration.
    repeat : Repeat or its value
        Whether the motion goes on with its mirror image, with itself, or never.
    distance : float or (float, float), optional
        How far the trunk moves along the ground (m), or the least and the greatest.
    duration : float, optional
        Duration of all phases (s).
    speed : float, optional
        Mean speed along the ground (m/s).
    start, end : State, optional
        States at the beginning and at the end of a motion that never repeats.
    friction : float
        Coefficient of friction.
    clearance : float
        Height (m) of a hump above which all points of a foot in the air stay. Points of a foot that
        stands on others only stay above the ground.
    slope : float
        Angle (rad) at which the ground ascends ahead; negative if it descends.
    force_margin : float
        Least normal force (N) at both ends of a sole that stands flat: it keeps the zero moment
        point off its edges, so that a law that follows the motion can correct it.
    landing_speed : float
        Least speed towards the ground (m/s) of points that come down. What lands slowly lands late,
        or early, by small errors.
    cost : str, mapping or function
        As for :func:`~heelstrike.gait.optimize.optimize_gait`; per metre where neither the distance
        nor speed and duration are fixed.
    constraint : function, optional
        Of an :class:`~heelstrike.gait.Instant`, to expressions of CasADi that are not to be
        negative at any time: the height of a foot over an obstacle, say. What is zero while a foot
        stands leaves the optimiser no room; let it be positive there.
    warm_start : Motion, optional
        A motion of the robot through the same phases to start from. Others are tried only if this
        one leads nowhere.
    guess : callable, optional
        Of a time (s) since the beginning, to positions of all coordinates (nv,), in m and rad: what
        the motion may be like, to start from. Only this one is tried then.
    refine : bool
        Whether pieces and instants are added until nothing slips, and limits hold, between those
        that are looked at; and pieces halved until the motion closes to 1e-8, by `closes_to`. That
        integrates the motion each time, which takes about a second, and far longer where an
        integrator can hardly go on. Not all motions close so nearly: a `GaitWarning` tells of those
        that do not. Without, it is a quick sketch to start others from.
    starts : int
        Starting points that are tried until one leads to an optimum; between two given states there
        is one.
    progress : callable, optional
        Called now and then with the fraction of the work that is done.

    Returns
    -------
    Motion
        The motion, with its margins.

    Raises
    ------
    GaitError
        If the robot cannot move this way or an argument makes no sense.
    GaitNotFoundError
        If no motion was found; the message names the constraints that are violated most.

    Warns
    -----
    GaitWarning
        If it was to be refined, but does not close to 1e-8.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("rabbit")
    >>> run = [hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
    ...        hs.ContactPhase(duration=(0.05, 0.3), pieces=3)]
    >>> motion = hs.optimize_motion(robot, run, speed=2.0)
    >>> [phase.contacts for phase in motion.phases]
    [('right_tibia_0',), ()]
    """
    request = checked_request(
        robot, phases, repeat=repeat, distance=distance, duration=duration, speed=speed,
        start=start, end=end, friction=friction, clearance=clearance, slope=slope, cost=cost,
        force_margin=force_margin, landing_speed=landing_speed, guess=guess,
    )  # fmt: skip
    if not 1 <= starts <= len(STARTS):
        raise GaitError(f"starts must be from 1 to {len(STARTS)}, got {starts!r}")
    if constraint is not None and not callable(constraint):
        raise GaitError(f"constraint must be a function of an instant, got {shown(constraint)}")
    report = progress or (lambda _: None)
    free = request.distance[0] < request.distance[1] and (
        request.speed is None or request.total is None
    )
    functions = MotionFunctions(
        robot, request.cost, per_metre=free and request.repeat is not Repeat.NEVER,
        constraint=constraint,
    )  # fmt: skip
    grids = tuple(
        looked_at(phase.pieces, jumps=bool(functions.jumps.any())) for phase in request.phases
    )
    program = MotionProgram(request, functions, grids)
    report(0.1)
    found = _solved_to_corners(program, warm_start, starts, report)
    if refine:
        found = _refined(found)
        report(0.9)
    motion = motion_of(found.program, found.program.polished(found.unknowns), found.optimal)
    if refine:
        motion = _closed(found, motion, report)
        if not motion.closes_to <= PROMISED:
            warn(_open(motion.closes_to), GaitWarning, again=True)
    report(1.0)
    return motion


@dataclass(frozen=True, eq=False)
class _Found:
    """Unknowns of a program that satisfy all constraints."""

    program: MotionProgram
    """The program."""
    unknowns: Floats
    """Its unknowns."""
    multipliers: Floats | None
    """Its multipliers, if it was solved and not only polished."""
    optimal: bool
    """Whether it is an optimum."""


def checked_request(
    robot: Robot, phases: Sequence[ContactPhase], *, repeat: Any, distance: Any, duration: Any,
    speed: Any, cost: Any, **others: Any,
) -> MotionRequest:  # fmt: skip
    """Check what is asked; raise a `GaitError` that says what cannot be."""
    refuse_loops(robot, "motion design", GaitError, loops=False)
    if np.any(robot.model.loop_link < 0):
        raise GaitError(
            f"robot {robot.name!r}: a closed loop ties it to the world, so that it cannot walk"
        )
    if robot.constraints:
        raise GaitError(
            "motion design does not support constraints from outside: use the robot without them"
        )
    if not robot.floating:
        raise GaitError(f"motion design needs a floating robot; robot {robot.name!r} is not one")
    goes_on = one_of(Repeat, "repeat", repeat, GaitError)
    if goes_on is Repeat.MIRRORED and robot.mirror is None:
        raise GaitError(
            f"robot {robot.name!r} has no mirror image; ask for a whole cycle, with repeat='same'"
        )
    if len(phases) == 0 or not all(isinstance(each, ContactPhase) for each in phases):
        raise GaitError("phases must be one ContactPhase or more, in their order")
    speed, duration = (
        None if value is None else positive(name, value, GaitError)
        for name, value in (("speed", speed), ("duration", duration))
    )
    for name in ("friction", "clearance", "force_margin", "landing_speed"):
        if not (np.isfinite(others[name]) and others[name] >= 0.0):
            raise GaitError(f"{name} must not be negative or infinite, got {others[name]}")
    if not abs(others["slope"]) < STEEPEST:
        raise GaitError(f"slope must be between -{STEEPEST} and {STEEPEST} rad")
    fixed = goes_on is Repeat.NEVER
    if fixed != (others["start"] is not None) or (others["end"] is not None and not fixed):
        raise GaitError(
            "a motion that never repeats needs start, and may have end; one that "
            "repeats takes neither"
        )
    if fixed and (speed is not None or distance is not None):
        raise GaitError("a motion that never repeats has no speed or distance; give start and end")
    low, high = _distances(distance, speed, duration, fixed)
    shortest, longest = (sum(phase.duration[k] for phase in phases) for k in range(2))
    if duration is not None and not shortest <= duration <= longest * (1.0 + 1e-12):
        raise GaitError(
            f"the phases last from {shortest:.6g} to {longest:.6g} s together; a duration of "
            f"{duration:.6g} s is beyond that"
        )
    if speed is not None:
        least = max(low / speed, shortest if duration is None else duration)
        most = min(high / speed, longest if duration is None else duration)
        if least > most * (1.0 + 1e-12):
            raise GaitError(
                f"at {speed:.6g} m/s a distance from {low:.6g} to {high:.6g} m takes from "
                f"{low / speed:.6g} to {high / speed:.6g} s; the phases last from {shortest:.6g} "
                f"to {longest:.6g} s together"
            )
    request = MotionRequest(
        robot=robot, phases=tuple(phases), repeat=goes_on, cost=costs_of(cost), speed=speed,
        total=duration, distance=(low, high), **others,
    )  # fmt: skip
    request = _check_states(request)
    if goes_on is not Repeat.NEVER:
        _check_repetition(request)
    return request


def _check_repetition(request: MotionRequest) -> None:
    """Refuse a motion that repeats where the ground cannot carry the weight, or feet not move."""
    robot, model = request.robot, request.robot.model
    if not any(each.points for each in request.standing):
        raise GaitError("a motion that repeats needs a phase in which something stands")
    if model.gravity[0] == 0.0 and model.gravity[1] < 0.0:
        check_slope(robot, request.slope, request.friction, float(model.friction_scale.max()))
        _check_force_margin(request)
    low, high = request.distance
    asked = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
    if request.speed is not None:
        asked = f"{request.speed:g} m/s"
    for i in sorted(request.always_standing):
        moves = request.speed is not None or not low <= 0.0 <= high
        if moves and model.contact_radius[i] == 0.0:
            raise InfeasibleGaitError(
                f"{robot.contact_names[i]!r} stands in all phases, and as the motion repeats: it "
                f"covers no distance, and {asked} are asked for. Add a phase in which it is in the "
                "air, or ask for a distance of 0."
            )


def _check_force_margin(request: MotionRequest) -> None:
    """Refuse forces on soles that are more than the weight, which the ground carries on average."""
    ends = min(
        sum(request.force_margin_of(p, point) > 0.0 for point in each.normal)
        for p, each in enumerate(request.standing)
    )
    carried = request.robot.weight * float(np.cos(request.slope))
    if ends * request.force_margin > carried:
        raise InfeasibleGaitError(
            f"force_margin = {request.force_margin:g} N at each of {ends} ends of soles or more at "
            f"all times is more than the {carried:g} N of the robot's weight that the ground "
            f"carries on average. Ask for less than {carried / ends:g} N."
        )


def _check_states(request: MotionRequest) -> MotionRequest:
    """Refuse given states in which what stands is not on the ground, or not where it was.

    Returned is the request for states in which all of that holds to rounding: by what a given state
    misses a contact or a loop, the motion could not close.
    """
    robot, told, given = request.robot, dict[str, Floats](), dict[str, Any]()
    along = np.array([np.cos(request.slope), np.sin(request.slope)])
    up = np.array([-along[1], along[0]])
    names = robot.contact_names
    for name, state, stands in (
        ("start", request.start, request.standing[0]),
        ("end", request.end, request.standing[-1]),
    ):
        if state is None:
            continue
        if not (np.all(np.isfinite(state.q)) and np.all(np.isfinite(state.v))):
            raise GaitError(f"{name} must have finite positions and velocities")
        beyond = np.maximum(robot.model.lower - state.q, state.q - robot.model.upper)
        if beyond.max() > ON_THE_GROUND:
            j = int(np.argmax(beyond))
            raise GaitError(
                f"at the {name} {robot.joint_names[j]} is at {state.q[j]:.3g}, beyond its range "
                f"from {robot.model.lower[j]:.3g} to {robot.model.upper[j]:.3g}. Give a state "
                "within the ranges of all joints."
            )
        centers = contact_positions(robot, state.q)
        heights = centers @ up - robot.model.contact_radius
        for i in sorted(stands.points):
            if abs(heights[i]) > ON_THE_GROUND:
                raise GaitError(
                    f"{names[i]!r} stands, but at the {name} it is "
                    f"{heights[i]:.3g} m away from the ground. Give a state in which it touches."
                )
        rows = _ground_rows(robot, state.q, along) @ state.v
        for i in sorted(stands.points):
            if np.abs(rows[i]).max() > ON_THE_GROUND:
                raise GaitError(
                    f"{names[i]!r} stands, but at the {name} it moves at "
                    f"{np.abs(rows[i]).max():.3g} m/s. Give a state in which it rests."
                )
        speeds = loop_jacobian(robot, state.q) @ state.v
        apart = loop_displacement(robot, state.q)
        for row, away, speed in zip(row_names(robot), apart, speeds, strict=True):
            unit = "m" if row.startswith("loop") else "rad or m"
            if abs(away) > ON_THE_GROUND:
                raise GaitError(
                    f"at the {name} the {row} is open by {abs(away):.3g} {unit}. Close the state "
                    "with robot.closed."
                )
            if abs(speed) > ON_THE_GROUND:
                raise GaitError(
                    f"at the {name} the {row} opens at {abs(speed):.3g} {unit} per s. Give "
                    "velocities of all joints that belong together; robot.closed finds them."
                )
        places = {i: told["start"][i] for i in request.never_lifted} if told else {}
        for i, place in places.items():
            moved = float(centers[i] @ along) - place
            if robot.model.contact_radius[i] == 0.0 and abs(moved) > ON_THE_GROUND:
                raise GaitError(
                    f"{names[i]!r} stands all the time, but from start to end it "
                    f"would have to move by {moved:.3g} m. Move one of the states."
                )
        given[name] = settled(robot, state, stands, along, places)
        told[name] = contact_positions(robot, given[name].q) @ along
    return replace(request, **given)


def settled(
    robot: Robot, state: State, stands: Standing, along: Floats, places: Mapping[int, float]
) -> State:
    """Return the nearest state in which points rest on the ground and loops are closed.

    Parameters
    ----------
    robot : Robot
        The robot.
    state : State
        The state, nearly that already.
    stands : Standing
        What holds it.
    along : (2,) array
        Direction along the ground.
    places : mapping of int to float
        Where points are along the ground (m), of those of which this is known.
    """
    up = np.array([-along[1], along[0]])
    known = [i for i in stands.tangent if i in places and not robot.model.contact_radius[i]]
    normal, q = list(stands.normal), state.q.copy()
    for _ in range(SETTLING):
        centers, rows = contact_positions(robot, q), _ground_rows(robot, q, along)
        away = [centers[normal] @ up - robot.model.contact_radius[normal]]
        away += [centers[known] @ along - [places[i] for i in known], loop_displacement(robot, q)]
        slopes = np.vstack([rows[normal, 0], rows[known, 1], loop_jacobian(robot, q)])
        q -= np.linalg.pinv(slopes) @ np.concatenate(away)
    rows = _ground_rows(robot, q, along).reshape(-1, robot.nv)[stands.forces]
    held = np.vstack([rows, loop_jacobian(robot, q)])
    return State(q, state.v - np.linalg.pinv(held) @ (held @ state.v))


def _ground_rows(robot: Robot, q: Floats, along: Floats) -> Floats:
    """Jacobian of the points next to the ground, away from it and along it, (nc, 2, nv)."""
    model, angles = robot.model, link_poses(robot, q).angle
    frame = np.array([[-along[1], along[0]], along])
    rows = np.zeros((robot.nc, 2, robot.nv))
    for i, link in enumerate(model.contact_link.tolist()):
        cosine, sine = np.cos(angles[link]), np.sin(angles[link])
        down = -model.contact_radius[i] * frame[0]
        local = np.array([[cosine, -sine], [sine, cosine]]) @ down + model.contact_position[i]
        rows[i] = frame @ point_jacobian(robot, q, link, local)[:2]
    return rows


SETTLING = 3
"""Steps of Newton's method that put a state on the ground."""
ON_THE_GROUND = 1e-6
"""Distance (m) within which a point touches, or is where it was."""
STEEPEST = 1.0
"""Slope (rad) from which on no motion is looked for."""
FARTHEST = 5.0
"""Greatest distance (m) of a motion that may choose it."""


def _distances(
    distance: Any, speed: float | None, duration: float | None, fixed: bool
) -> tuple[float, float]:
    """Least and greatest distance."""
    if fixed:
        return 0.0, 0.0
    if distance is None:
        if speed is None:
            raise GaitError("give the distance or the speed of a motion that repeats")
        return 0.0, FARTHEST
    given = distance if are_numbers(distance) and not isinstance(distance, bool) else np.nan
    bounds = np.atleast_1d(np.asarray(given, dtype=np.float64))
    bounds = np.repeat(bounds, 2) if bounds.size == 1 else bounds
    if bounds.shape != (2,) or not np.all(np.isfinite(bounds)) or bounds[0] > bounds[1]:
        raise GaitError(f"distance must be a number (m), or the least and greatest, got {distance}")
    if bounds[0] < 0.0 < bounds[1]:
        raise GaitError("a distance is forwards or backwards; its bounds must not have both signs")
    if speed is not None and bounds[1] < 0.0:
        raise GaitError(
            f"a speed is forwards, and a distance of {distance} m is backwards. Give the distance "
            "and a duration."
        )
    if speed is not None and duration is not None and bounds[0] == bounds[1]:
        raise GaitError("give two of distance, duration and speed, not all three")
    return float(bounds[0]), float(bounds[1])


def _known(program: MotionProgram, motion: Motion | None) -> list[Floats]:
    """Unknowns of a motion that is given to start from."""
    if motion is None:
        return []
    if not isinstance(motion, Motion):
        raise GaitError(f"warm_start must be a Motion or None, got {shown(motion)}")
    request = program.request
    motion.check_robot(request.robot)
    names = request.robot.contact_names
    asked = [tuple(names[i] for i in sorted(each.points)) for each in request.standing]
    given = [each.contacts for each in motion.phases]
    if asked != given or motion.repeat is not request.repeat:
        raise GaitError(
            f"warm_start must go through the phases that are asked for, {asked}, and repeat as "
            f"they do; it goes through {given}"
        )
    return [_packed(motion.phases, motion.distance, program)]


def _solved(
    program: MotionProgram, known: list[Floats], starts: int, report: Callable[[float], None]
) -> _Found:
    """Unknowns of an optimum, or of a motion that satisfies all constraints."""
    nearest, least = np.zeros(0), np.inf
    feasible: _Found | None = None
    if program.request.end is not None or program.request.guess is not None:
        starts = 1  # the straight way from one state to the other, or that which is known
    drawn = (guess_of(program, lean=lean, lowered=lowered) for lean, lowered in STARTS[:starts])
    for k, start in enumerate(chain(known, drawn)):
        if not all(np.all(np.isfinite(np.array(each))) for each in program.value(start)):
            continue  # only functions of one's own have no value
        unknowns, multipliers, told = program.solve(start)
        if told["return_status"] == "Solve_Succeeded":
            return _Found(program, unknowns, multipliers, True)
        missing = float(np.abs(program.violations(unknowns)).max())
        if missing <= FEASIBLE and feasible is None:
            feasible = _Found(program, unknowns, multipliers, False)
        if missing < least or not nearest.size:
            nearest, least = unknowns, missing
        report(0.1 + 0.6 * (k + 1) / starts)
    if feasible is not None:
        return feasible
    if not nearest.size:
        raise undefined("cost or constraint", "of any motion from which the optimiser starts")
    raise GaitNotFoundError(_not_found(program, nearest))


def _solved_to_corners(
    program: MotionProgram, motion: Motion | None, starts: int, report: Callable[[float], None]
) -> _Found:
    """Unknowns of an optimum likewise; where costs have corners, first with these rounded off."""
    if program.functions.spending is None:
        return _solved(program, _known(program, motion), starts, report)
    sketch = replace(program, rounded=True)
    try:
        found = _solved(sketch, _known(sketch, motion), starts, report)
    except GaitNotFoundError:
        return _solved(program, _known(program, motion), starts, report)
    start = _resampled(sketch, found.unknowns, program)
    sketched = _Found(program, start, None, False)
    try:
        exact = _again(replace(program, near=CLOSE), start, None)
    except GaitNotFoundError:
        return sketched
    return exact if exact.optimal else min(sketched, exact, key=_cost_of)


def _cost_of(found: _Found) -> float:
    """Cost, with no more than what is spent, whatever its bounds are."""
    return float(found.program.value(found.program.counted(found.unknowns))[0])


def _not_found(program: MotionProgram, unknowns: Floats) -> str:
    """Say which constraints are violated most where the optimiser came nearest."""
    missing = np.abs(program.violations(unknowns))[program.linear :]
    lines: list[str] = []
    for k in np.argsort(-missing)[:50]:
        row, phase, _ = program.labels[k]
        text = f"{row.kind.text} ({row.subject}) in phase {phase + 1}"
        if missing[k] > FEASIBLE and not any(line.startswith(text) for line in lines):
            lines.append(f"{text}: {missing[k] * row.unit:.3g} {row.kind.unit}".rstrip())
    if not lines:
        lines.append("pieces and phases that join, and what is asked of the whole motion")
    own = any(line.startswith(Kind.OWN.text) for line in lines[:4])
    advice = "Ask less of your own constraint, or give" if own else "Give"
    return (
        "no such motion was found, which does not mean that there is none. Where the optimiser "
        f"came nearest, these are violated: {'; '.join(lines[:4])}. {advice} the phases more time, "
        "more friction, a shorter distance, or durations nearer to what you expect."
    )


def _again(program: MotionProgram, start: Floats, multipliers: Floats | None) -> _Found:
    """Solve from nearly an optimum.

    Where a barrier that follows the problem reaches no optimum, or one that is dearer than the
    start, one that only falls is tried, too, and the better of both is returned.

    Raises
    ------
    GaitNotFoundError
        If what is found violates a constraint.
    """

    def solved(by: MotionProgram) -> _Found:
        unknowns, prices, told = by.solve(start, multipliers)
        return _Found(program, unknowns, prices, told["return_status"] == "Solve_Succeeded")

    found = solved(program)
    if not program.falls:
        begun = _Found(program, start, None, False)
        dearer = _cost_of(found) > _cost_of(begun) + NO_DEARER * abs(_cost_of(begun))
        if not found.optimal or (dearer and _satisfied(begun)):
            falling = solved(replace(program, falling=True))
            found = min(
                (found, falling),
                key=lambda each: (not _satisfied(each), not each.optimal, _cost_of(each)),
            )
    if not _satisfied(found):
        raise GaitNotFoundError(_not_found(program, found.unknowns))
    return found


NO_DEARER = 1e-9
"""By how much more, relative to it, an optimum may cost than a start that satisfies all
constraints: both are rounded."""


def _satisfied(found: _Found) -> bool:
    """Whether all constraints of its program are satisfied."""
    return bool(np.abs(found.program.violations(found.unknowns)).max() <= FEASIBLE)


def _refined(found: _Found) -> _Found:
    """Add pieces where points slip, and instants where limits fail, until neither does.

    As many pieces as it takes are there before the optimum is sought on them, and the instants at
    which the motion fails that is known by then: each optimum costs far more than looking.
    """
    rounds = 0
    while rounds < ROUNDS:
        program, start, prices = found.program, found.unknowns, found.multipliers
        finer, unknowns = _without_slip(program, start)
        if finer is program:
            rounds += 1
        else:
            program, start, prices = finer, unknowns, None
        more = _with_failing(program, start, CLOSE if prices is None else CLOSER)
        if more is None and program is found.program:
            break
        priced = None if prices is None or more is None else more.multipliers_of(program, prices)
        found = _again(more or program, start, priced)
    return found


def _without_slip(program: MotionProgram, unknowns: Floats) -> tuple[MotionProgram, Floats]:
    """Double the pieces of phases in which points that stand move between the ends of pieces.

    Equations are satisfied on them by the least change of the unknowns. Pieces are doubled again
    only where points move far less by that, but still too fast.
    """
    slips = np.full(len(program.request.phases), np.inf)
    while True:
        before = [phase.pieces for phase in program.request.phases]
        now = np.array([_slip(program, unknowns, p) for p in range(len(before))])
        doubled = (now > STILL) & (now <= FAR_LESS * slips)
        pieces = [
            max(own, min(2 * own, MOST_PIECES)) if more else own
            for own, more in zip(before, doubled.tolist(), strict=True)
        ]
        if pieces == before:
            return program, unknowns
        slips = np.where(doubled, now, slips)
        finer = _with_pieces(program, pieces)
        program, unknowns = finer, finer.polished(_resampled(program, unknowns, finer))


def _with_pieces(program: MotionProgram, pieces: Sequence[int]) -> MotionProgram:
    """Return the program with so many pieces, a phase each, for a start that is nearly there."""
    request = program.request
    phases = tuple(
        ContactPhase(*phase.contacts, duration=phase.duration, pieces=count)
        for phase, count in zip(request.phases, pieces, strict=True)
    )
    jumps = bool(program.functions.jumps.any())
    return replace(
        program, request=replace(request, phases=phases),
        grids=tuple(looked_at(count, jumps=jumps) for count in pieces), near=CLOSE,
    )  # fmt: skip


def _closed(found: _Found, motion: Motion, report: Callable[[float], None]) -> Motion:
    """Halve pieces of the phases that are off most, until the motion closes, or as far as it goes.

    Where pieces are halved, both halves go on along the polynomial of the whole, and equations are
    satisfied by the least change. So nothing has corners within a piece, as optima on other meshes
    have wherever a limit begins to hold, and errors fall fast. Another optimum is sought only if a
    limit fails by more than it may between instants; if that leads nowhere, what was there before
    stays.
    """
    for k in count(1):
        follower = Follower(found.program.request.robot, motion)
        motion = replace(motion, closes_to=follower.missed())
        report(1.0 - 0.1 / (k + 1))
        if motion.closes_to <= CLOSED or not np.isfinite(motion.closes_to):
            break
        finer = _halved(found.program, follower.missed_by_phases())
        if finer is None:
            break
        try:
            found = _on_halves(finer, motion, found.optimal)
        except GaitNotFoundError:
            break
        motion = motion_of(found.program, found.unknowns, found.optimal)
    return motion


def _on_halves(finer: MotionProgram, motion: Motion, optimal: bool) -> _Found:
    """Return nearly the same motion on more pieces, its equations satisfied to rounding."""
    unknowns = finer.polished(_packed(motion.phases, motion.distance, finer))
    found = _Found(finer, unknowns, None, optimal)
    equations, limits = finer.missing(unknowns)
    if equations > FEASIBLE or limits > ALLOWED:
        found = _again(finer, unknowns, None)
    found = _held_between(found)
    if found.multipliers is None:
        return found
    return replace(found, unknowns=found.program.polished(found.unknowns))


def _open(closes_to: float) -> str:
    """Say that a motion does not close as it should."""
    missed = (
        f"misses the state in which it goes on by {closes_to:.2g} (m, rad, m/s or rad/s), more "
        f"than {PROMISED:g}"
        if np.isfinite(closes_to)
        else "cannot be integrated"
    )
    return (
        f"this motion satisfies its constraints, but followed by computed torque it {missed}; more "
        "pieces did not help. Look at its closes_to before you rely on it; other durations, or "
        "pieces of its phases, may lead to a motion that closes."
    )


def _halved(program: MotionProgram, missed: Floats) -> MotionProgram | None:
    """Return the program with twice the pieces in phases that are off most, if these may be."""
    request = program.request
    before = [phase.pieces for phase in request.phases]
    pieces = [
        2 * own if off >= OFF_MOST * missed.max() and 2 * own <= MOST_HALVED else own
        for own, off in zip(before, missed.tolist(), strict=True)
    ]
    if pieces == before:
        return None
    return _with_pieces(program, pieces)


def _slip(program: MotionProgram, unknowns: Floats, p: int) -> float:
    """Largest velocity (m/s) of a point that stands, anywhere in a phase."""
    stands = program.request.standing[p]
    rows = _rows_at(program, unknowns, p, _fine(program.request.phases[p].pieces))
    still = [
        k
        for k, row in enumerate(program.functions.path_rows)
        if (row.kind is Kind.NORMAL_STILL and row.of[0] in stands.normal)
        or (row.kind is Kind.TANGENT_STILL and row.of[0] in stands.tangent)
    ]
    return float(np.abs(rows[still]).max(initial=0.0))


def _resampled(program: MotionProgram, unknowns: Floats, finer: MotionProgram) -> Floats:
    """Unknowns of a finer program for the same motion."""
    _, _, distance = program.parts(casadi.DM(unknowns))
    return _packed(_phases(program, unknowns), float(distance), finer)


def _packed(motion: Sequence[MotionPhase], distance: float, finer: MotionProgram) -> Floats:
    """Unknowns of a program of the phases of a motion."""
    positions, velocities, accelerations, forces = [], [], [], []
    for own, phase in zip(motion, finer.request.phases, strict=True):
        at = [
            own.duration * phases_of(grid_of(phase.pieces))
            for grid_of in (endings, beginnings, gauss_points)
        ]
        positions.append(own.coordinates(at[0]).T)
        velocities.append(own.coordinates(at[1], order=1).T)
        bend = own.coordinates(at[2], order=2).T
        accelerations.append(bend.reshape(-1, phase.pieces, STAGES))
        exerted = own.forces(at[2]).reshape(at[2].size, -1)
        forces.append(np.hstack([exerted, own.loop_forces(at[2])]).T)
    durations = np.array([own.duration for own in motion])
    return finer.packed(
        positions, velocities, accelerations, forces, durations, distance,
        [np.append(own.impulse, own.loop_impulse) for own in motion[: len(finer.landings)]],
    )  # fmt: skip


PROMISED = 1e-8
"""Difference (m, rad, m/s, rad/s) beyond which a motion that was to be refined is told to miss."""
CLOSED = 3e-9
"""Difference (m, rad, m/s, rad/s) within which a motion goes on where it should: a third of what is
promised, since others integrate otherwise."""
OFF_MOST = 0.1
"""Share of the largest error of a phase from which on the pieces of another are halved, too."""
MOST_HALVED = 192
"""Pieces that a phase may come to have where they are halved, so that a motion closes."""
STILL = 3e-4
"""Velocity (m/s) that a point that stands may have between the ends of pieces."""
FAR_LESS = 0.25
"""Share of the velocity before that is left where more pieces help."""
MOST_PIECES = 48
"""Pieces of a phase beyond which the mesh is not refined."""


def _fine(pieces: int, times: int = 1) -> Instants:
    """Instants at which limits are checked, or some times as many."""
    count = times * FINER * STAGES
    share = (np.arange(count) + 0.5) / count
    return Instants.in_every_piece(pieces, share)


def _rows_at(program: MotionProgram, unknowns: Floats, p: int, grid: Instants) -> Floats:
    """Scaled constraints (rows, N) of a phase at instants."""
    _, rows = _at(program, unknowns, p, grid, program.functions.path.value)
    return rows


def _at(
    program: MotionProgram, unknowns: Floats, p: int, grid: Instants, function: Any
) -> list[Floats]:
    """Results of a function of the path of a phase at instants, (rows, N) each."""
    phases, _, distance = program.parts(casadi.DM(unknowns))
    count, request = grid.share.size, program.request
    y = path_variables(phases, p, grid, distance)
    numbers = casadi.repmat(casadi.DM([request.slope, request.friction]), 1, count)
    return [np.array(each) for each in function.map(count).call([y, numbers])]


def _held_between(found: _Found) -> _Found:
    """Add instants where limits fail between the Gauss points, until none does."""
    for _ in range(ROUNDS):
        prices = found.multipliers
        finer = _with_failing(found.program, found.unknowns, CLOSE if prices is None else CLOSER)
        if finer is None:
            break
        priced = None if prices is None else finer.multipliers_of(found.program, prices)
        found = _again(finer, found.unknowns, priced)
    return found


def _with_failing(
    program: MotionProgram, unknowns: Floats, near: float = CLOSE
) -> MotionProgram | None:
    """Return the program with the instants at which limits fail, if they do anywhere."""
    more = [_failing(program, unknowns, p) for p in range(len(program.grids))]
    if not any(each.share.size for each in more):
        return None
    grids = tuple(grid.joined(new) for grid, new in zip(program.grids, more, strict=True))
    return replace(program, grids=grids, near=near)


def _failing(program: MotionProgram, unknowns: Floats, p: int) -> Instants:
    """Return the instants of a phase at which a limit fails most, one for each piece and limit.

    And some on both sides, since next time it fails most a little beside them; but not for
    constraints of one's own, which may fail all along.
    """
    own = np.array([row.kind is Kind.OWN for row in program.functions.path_rows])
    fine = _fine(program.grids[p].pieces, OWN_FINER if np.any(own) else 1)
    rows = _rows_at(program, unknowns, p, fine)
    lower, upper = program.path_bounds(p, fine)
    if np.any(own):  # for all others the instants that they would have without
        others = np.arange(fine.share.size) % OWN_FINER != OWN_FINER // 2
        lower[np.ix_(~own, others)], upper[np.ix_(~own, others)] = -np.inf, np.inf
    missing = np.maximum(lower - rows, rows - upper)
    missing = np.where(np.isfinite(missing), missing, -np.inf)
    by_piece = missing.reshape(len(rows), fine.pieces, -1)
    fails = by_piece.max(axis=2) > ALLOWED
    count = by_piece.shape[2]
    worst, beside = by_piece.argmax(axis=2), BESIDE * count // (STAGES * FINER)
    at = np.clip([worst, worst - beside, worst + beside], 0, count - 1)
    at += count * np.arange(fine.pieces)
    bad = np.union1d(at[0, fails], at[1:, fails & ~own[:, None]])
    grid = program.grids[p]
    there = set(zip(grid.piece.tolist(), grid.share.tolist(), strict=True))
    bad = np.array([i for i in bad if (int(fine.piece[i]), float(fine.share[i])) not in there], int)
    return Instants(fine.pieces, fine.piece[bad], fine.share[bad], np.zeros(bad.size))


CLOSER = 1e-6
"""Barrier parameter with which IPOPT begins where the multipliers of an optimum are known and the
barrier only falls: 10 to 20 iterations, where without them it takes 14 to 40."""
ALLOWED = 1e-5
"""Scaled violation that a limit may have between the instants at which it is looked at."""


def motion_of(program: MotionProgram, unknowns: Floats, optimal: bool) -> Motion:
    """Return the motion with the given unknowns, its cost and its margins."""
    request, robot = program.request, program.request.robot
    _, _, distance = program.parts(casadi.DM(unknowns))
    effort, spent = 0.0, float(program.value(program.counted(unknowns))[0])
    if program.functions.per_metre:
        spent *= abs(float(distance))
    margins = dict[str, float]()
    phases = _phases(program, unknowns)
    for p, phase in enumerate(phases):
        grid = gauss_points(len(phase.pieces))
        (rates,) = _at(program, unknowns, p, grid, program.functions.effort)
        effort += float(rates.ravel() @ grid.weight) * grid.pieces
        _add_margins(program, unknowns, p, margins)
    mirror = robot.mirror or _itself(robot)
    first, far = phases[0].pieces[0], float(distance)
    if request.repeat is Repeat.NEVER:
        last = phases[-1].coordinates(phases[-1].duration)
        far = float((last - first[0])[:2] @ [np.cos(request.slope), np.sin(request.slope)])
    return Motion(
        robot=robot.name,
        fingerprint=fingerprint(robot),
        phases=tuple(phases),
        repeat=request.repeat,
        distance=far,
        slope=request.slope,
        friction=request.friction,
        mirror_joint=mirror.joint,
        mirror_sign=mirror.sign,
        mirror_offset=mirror.offset,
        mirror_contact=mirror.contact,
        initial_state=State(first[0].copy(), first[1].copy()),
        cost=effort,
        spent=spent,
        optimal=optimal,
        margins=margins,
    )


def _itself(robot: Robot) -> Mirror:
    """Mirror that changes nothing."""
    nv, nc, nf = np.arange(robot.nv), np.arange(robot.nc), np.arange(len(robot.feet))
    return Mirror(nv, np.ones(robot.nv), nc, nf, np.zeros(robot.nq))


def _phases(program: MotionProgram, unknowns: Floats) -> list[MotionPhase]:
    """Return the phases of a motion with the given unknowns."""
    request, robot = program.request, program.request.robot
    _, impulses, _ = program.parts(casadi.DM(unknowns))
    phases = []
    for p, (pieces, force, ends) in enumerate(program.pieces(unknowns)):
        struck = np.zeros(program.functions.forces)
        if p < len(impulses):
            struck = np.array(impulses[p]).ravel()
        points = 2 * robot.nc
        exerted = force.reshape(len(pieces), STAGES, -1)
        phases.append(
            MotionPhase(
                contacts=tuple(robot.contact_names[i] for i in sorted(request.standing[p].points)),
                breakpoints=ends,
                pieces=pieces,
                force=exerted[..., :points].reshape(len(pieces), STAGES, robot.nc, 2),
                impulse=struck[:points].reshape(robot.nc, 2),
                loop_force=exerted[..., points:],
                loop_impulse=struck[points:],
            )
        )
    return phases


def _add_margins(
    program: MotionProgram, unknowns: Floats, p: int, margins: dict[str, float]
) -> None:
    """Smallest distances from the limits in a phase."""
    grid = _fine(program.grids[p].pieces)
    rows = _rows_at(program, unknowns, p, grid)
    lower, upper = program.path_bounds(p, grid)
    for k, row in enumerate(program.functions.path_rows):
        if row.kind in EQUATIONS or not np.any(lower[k] < upper[k]):
            continue
        used = np.isfinite(lower[k]) | np.isfinite(upper[k])
        least = lower[k] if row.kind is Kind.HEIGHT else row.lower
        room = np.minimum(rows[k] - least, row.upper - rows[k])[used]
        if room.size:
            name = row.kind.name.lower()
            margins[name] = min(margins.get(name, np.inf), float(room.min()) * row.unit)
