"""Plan a walk by the cart-table model, and give it all joints by inverse kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heelstrike.arguments import at_least, at_most, one_of, positive, takes
from heelstrike.dynamics import center_of_mass, leg_joints, link_poses
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait.cart_table.center_of_mass import Planner, followed
from heelstrike.gait.cart_table.forces import shared_forces, zero_moment_point
from heelstrike.gait.cart_table.step import Planned, Step, lowest
from heelstrike.gait.motion.instant import MotionFunctions
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.motion.optimize import checked_request, motion_of
from heelstrike.gait.motion.phases import ContactPhase
from heelstrike.gait.motion.program import (
    STAGES,
    MotionProgram,
    beginnings,
    endings,
    gauss_points,
    looked_at,
    phases_of,
)
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import sole

STRETCHED = 0.985
"""Length of a leg, as a share of the straight one, up to which inverse kinematics is well posed."""
HEIGHTS = np.arange(0.99, 0.7, -0.01)
"""Heights of the centre of mass that are tried, as shares of that of the standing robot."""
PIECES = (8, 16)
"""Pieces of polynomials in double and in single support."""
ROUGH = 1e3
"""Coefficient of friction with which nothing slips."""
SHORTEST_PART = 0.02
"""Duration (s) of double and of single support from which on the plan, which has a sample every
5 ms, knows of them."""
SMALLER = (0.5, 0.25, 0.1)
"""Shares of clearance and length at which steps are tried where legs do not reach."""
COARSER = 4
"""Each of so many heights is tried then, by the quicker planner: what is told is one that goes."""
LOOKED_AT = 10
"""Each of so many samples of a step is looked at for whether legs reach."""
SHORTEST, LONGEST = 0.1, 10.0
"""Durations (s) of steps that are planned."""
CORRECTIONS = 2
"""Times that the plan is corrected by the zero moment point of the whole robot."""


@takes(GaitError)
def plan_motion(
    robot: Robot,
    *,
    step_length: float,
    step_duration: float,
    planner: Planner | str = "preview",
    double_support: float = 0.2,
    height: float | None = None,
    clearance: float = 0.05,
    friction: float = 0.75,
    corrections: int = CORRECTIONS,
) -> Motion:
    """Plan a walk on flat feet by its zero moment point, as most humanoids are made to walk.

    The zero moment point stays in the middle of the foot that stands, and moves from foot to foot
    while both do. The centre of mass follows from it by the cart-table model at constant height,
    the joints from that and the feet by inverse kinematics with an upright trunk. Torques and
    forces follow by inverse dynamics of the whole robot; two feet share the load for the least
    squared torque. Nothing is optimised otherwise: :func:`~heelstrike.optimize_motion` does that.

    Parameters
    ----------
    robot : Robot
        A robot with two flat feet on legs of three driven joints.
    step_length : float
        Distance (m) between the feet.
    step_duration : float
        Duration (s) of a step, double support included.
    planner : Planner or its value
        How the centre of mass is planned: ``"preview"`` or ``"capture_point"``.
    double_support : float
        Part of the step in which both feet stand.
    height : float, optional
        Height of the centre of mass (m); by default the greatest at which no leg is stretched.
    clearance : float
        Height (m) of the swing foot half-way.
    friction : float
        Coefficient of friction.
    corrections : int
        How often the plan is corrected by the difference between the zero moment point of the whole
        robot and that of the cart (Kajita's second stage).

    Returns
    -------
    Motion
        The walk; :class:`~heelstrike.MotionTracking` follows it.

    Raises
    ------
    GaitError
        If the robot cannot walk so, or an argument makes no sense.
    InfeasibleGaitError
        If the legs are too short, or the ground would have to pull.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> walk = hs.plan_motion(robot, step_length=0.3, step_duration=0.7)
    >>> [len(phase.contacts) for phase in walk.phases]
    [4, 2]
    """
    way = one_of(Planner, "planner", planner, GaitError)
    _check_numbers(step_length, step_duration, double_support, height, clearance, corrections)
    both = double_support * step_duration
    front, rear = (foot.name for foot in robot.feet) if len(robot.feet) == 2 else ("", "")
    _check_robot(robot)
    phases = [
        ContactPhase(front, rear, duration=(both, both), pieces=PIECES[0]),
        ContactPhase(front, duration=(step_duration - both,) * 2, pieces=PIECES[1]),
    ]
    request = checked_request(
        robot, phases, repeat="mirrored", distance=step_length, duration=step_duration, speed=None,
        start=None, end=None, friction=friction, clearance=0.0, slope=0.0, cost="torque",
        force_margin=0.0, landing_speed=0.0,
    )  # fmt: skip
    program = MotionProgram(
        request, MotionFunctions(robot, request.cost, per_metre=False),
        tuple(looked_at(phase.pieces) for phase in phases),
    )  # fmt: skip
    step = Step(robot, step_length, step_duration, both, clearance)
    planned = _planned(step, way, height, corrections)
    return motion_of(program, program.polished(_unknowns(program, planned, friction)), False)


def _check_numbers(
    step_length: float, step_duration: float, double_support: float, height: float | None,
    clearance: float, corrections: int,
) -> None:  # fmt: skip
    for name, value, unit in (
        ("step_length", step_length, "m"), ("step_duration", step_duration, "s"),
        ("height", 1.0 if height is None else height, "m"), ("clearance", clearance, "m"),
    ):  # fmt: skip
        positive(name, value, GaitError, unit)
    if not SHORTEST <= step_duration <= LONGEST:
        raise GaitError(
            f"step_duration must be from {SHORTEST:g} to {LONGEST:g} s, got {step_duration:g}"
        )
    least = SHORTEST_PART / step_duration
    if np.ndim(double_support) or not least <= double_support <= 1.0 - least:
        raise GaitError(
            f"double_support is a part of the step, between {at_least(least, 3)} and "
            f"{at_most(1.0 - least, 3)} of one of {step_duration:g} s, so that the plan sees both "
            f"parts; got {double_support}"
        )
    if not (isinstance(corrections, int | np.integer) and 0 <= corrections <= 10):
        raise GaitError(f"corrections must be a whole number from 0 to 10, got {corrections!r}")


def _check_robot(robot: Robot) -> None:
    refuse_loops(robot, "a planned walk", GaitError)
    legs = leg_joints(robot) if len(robot.feet) == 2 else ()
    flat = all(sole(robot, foot).toe > sole(robot, foot).heel for foot in robot.feet)
    if not (flat and [len(leg) for leg in legs] == [3, 3] and robot.nv == 9 and robot.floating):
        raise GaitError(
            "a planned walk needs a trunk on two legs of three driven joints with flat "
            f"feet, and no other joints; robot {robot.name!r} differs. Use "
            "hs.optimize_motion for it."
        )


def _planned(step: Step, planner: Planner, height: float | None, corrections: int) -> Planned:
    """Plan at a height, or at the greatest at which no leg is stretched."""
    robot = step.robot
    state = robot.reference_state()
    soles = [sole(robot, foot) for foot in robot.feet]
    standing = float(center_of_mass(robot, state.q)[1]) - lowest(robot, state.q, soles)
    if height is not None:
        try:
            planned = _corrected(step, planner, height, corrections)
            q, _, _ = planned.coordinates(step.samples[::LOOKED_AT])
            if beyond := _beyond(planned, q):
                raise InfeasibleGaitError(beyond)
        except (InfeasibleGaitError, np.linalg.LinAlgError) as error:
            said = _at_another(step, planner, height, standing, corrections, error)
            raise InfeasibleGaitError(said) from None
        return planned
    found = _highest(step, planner, standing, corrections)
    if found is not None:
        return found
    short = (
        f"the legs of robot {robot.name!r}, within the ranges of their joints, are too short for "
        f"steps of {step.length:.3g} m with a clearance of {step.clearance:.3g} m at any height of "
        f"the centre of mass from {HEIGHTS[-1] * standing:.3g} m on."
    )
    for name, told in (("clearance", "clearance"), ("length", "step_length")):
        for share in SMALLER:
            value = share * getattr(step, name)
            other = replace(step, **{name: value})
            if _highest(other, Planner.CAPTURE_POINT, standing, 0, HEIGHTS[::COARSER]) is not None:
                reach = f"They reach with {told} = {at_most(value, 3)} m."
                raise InfeasibleGaitError(f"{short} {reach}")
    raise InfeasibleGaitError(f"{short} Ask for shorter steps and less clearance.")


def _at_another(
    step: Step, planner: Planner, height: float, standing: float, corrections: int,
    error: Exception,
) -> str:  # fmt: skip
    """Say what is wrong at a height, and at which legs reach."""
    wrong = str(error)
    if not isinstance(error, InfeasibleGaitError):  # a matrix without an inverse
        wrong = (
            f"with the centre of mass at {height:.3g} m a leg of robot {step.robot.name!r} is "
            "straight or folded up, so that its joints do not follow from the feet."
        )
    found = _highest(step, planner, standing, corrections)
    if found is None:
        return f"{wrong} Leave the height out, and you are told which steps the legs reach."
    return f"{wrong} They reach with height = {found.height:.3g} m."


def _highest(
    step: Step, planner: Planner, standing: float, corrections: int, heights: Floats = HEIGHTS
) -> Planned | None:
    """Plan at the greatest height at which no leg is stretched, if there is one."""
    for share in heights:
        try:
            planned = _corrected(step, planner, share * standing, 0)
            q, _, _ = planned.coordinates(step.samples[::LOOKED_AT])
            if _stretched(step.robot, q) <= STRETCHED and not _beyond(planned, q):
                if corrections:
                    planned = _corrected(step, planner, share * standing, corrections)
                return planned
        except (InfeasibleGaitError, np.linalg.LinAlgError):
            continue
    return None


def _beyond(planned: Planned, q: Floats) -> str:
    """Say which joint leaves its range in postures of the step; nothing if none does."""
    model, names = planned.step.robot.model, planned.step.robot.joint_names
    for j in model.actuator_joint.tolist():
        least, most = float(q[:, j].min()), float(q[:, j].max())
        if least < model.lower[j] or most > model.upper[j]:
            return (
                f"with the centre of mass at {planned.height:.3g} m {names[j]} would go from "
                f"{least:.3g} to {most:.3g}, beyond its range from {model.lower[j]:.3g} to "
                f"{model.upper[j]:.3g}."
            )
    return ""


def _stretched(robot: Robot, q: Floats) -> float:
    """Greatest length of a leg in postures, from hip to ankle, as a share of the straight one."""
    most = 0.0
    for row in q:
        origins = link_poses(robot, row).origin
        for hip, knee, ankle in leg_joints(robot):
            straight = np.hypot(*(origins[knee] - origins[hip]))
            straight += np.hypot(*(origins[ankle] - origins[knee]))
            most = max(most, float(np.hypot(*(origins[ankle] - origins[hip])) / straight))
    return most


def _corrected(step: Step, planner: Planner, height: float, corrections: int) -> Planned:
    """Plan; then plan again for what the whole robot's zero moment point was off."""
    gravity = -float(step.robot.model.gravity[1])
    times = step.samples
    wanted = step.wanted(times)
    asked = wanted.copy()
    for _ in range(corrections):
        planned = Planned(step, height, followed(planner, times, asked, height, gravity))
        asked = asked + wanted - zero_moment_point(step.robot, *planned.coordinates(times))
        asked[-1] = asked[0] + step.length
    return Planned(step, height, followed(planner, times, asked, height, gravity))


def _unknowns(program: MotionProgram, planned: Planned, friction: float) -> Floats:
    """Unknowns of a motion program for a plan."""
    step = planned.step
    durations = np.array([step.both, step.duration - step.both])
    begin = planned.coordinates(np.zeros(1))[0][0, 0]  # where it begins does not matter
    positions, velocities, accelerations, forces = [], [], [], []
    for p, phase in enumerate(program.request.phases):
        ends, starts, inner = (
            (p > 0) * step.both + durations[p] * phases_of(grid_of(phase.pieces))
            for grid_of in (endings, beginnings, gauss_points)
        )
        q = planned.coordinates(ends)[0].T
        q[0] -= begin
        positions.append(q)
        velocities.append(planned.coordinates(starts)[1].T)
        motion = planned.coordinates(inner)
        accelerations.append(motion[2].T.reshape(-1, phase.pieces, STAGES))
        found = []
        for t, *state in zip(inner.tolist(), *motion, strict=True):
            force = shared_forces(step.robot, program.request.standing[p], friction, *state)
            if force is None:
                raise InfeasibleGaitError(_not_carried(step, program, p, t, state))
            found.append(force)
        forces.append(np.array(found).T)
    return program.packed(positions, velocities, accelerations, forces, durations, step.length)


def _not_carried(
    step: Step, program: MotionProgram, p: int, t: float, state: Sequence[Floats]
) -> str:
    """Say why the ground cannot move the robot so at a time of the step (s)."""
    robot = step.robot
    if shared_forces(robot, program.request.standing[p], ROUGH, *state) is not None:
        return (
            f"at {t:.3g} s of the step friction would have to exceed its limit. Ask for more "
            "friction, or for slower or shorter steps."
        )
    there = zero_moment_point(robot, *(each[None] for each in state))[0]
    return (
        f"at {t:.3g} s of the step the ground would have to pull: the zero moment point is "
        f"{there:.3g} m ahead of the middle of the front foot. Ask for slower or shorter steps, "
        "for more double support, or for more corrections."
    )
