"""The optimal gait: least ∫ΓᵀΓ dt over one periodic step (paper section 4.2)."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from heelstrike.arguments import takes
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.cost import Cost, OwnCost
from heelstrike.gait.gait import Gait
from heelstrike.gait.kept_gait import KeptGait
from heelstrike.gait.request import JointRanges, Request
from heelstrike.robot.robot import Robot


@takes(GaitError)
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
    slope: float = 0.0,
    rise: float = 0.0,
    cost: Cost | str | Mapping[Cost | str, float] | OwnCost = "torque",
    warm_start: Gait | None = None,
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

    A gait that this machine has designed before is read from the user's cache folder, with the same
    numbers; ``HEELSTRIKE_KEEP_GAITS=0`` in the environment designs it again.

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
        Shape of that profile. By default a parabola, or, where no gait keeps above that, for
        gaits without impact and from a gait that has it, a hump that is flat at both ends; the gait
        says which.
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
    slope : float
        Angle (rad) at which the ground ascends ahead; negative if it descends. `step_length` and
        all heights are then measured along the ground and away from it.
    rise : float
        By how much (m) every foothold is higher than the one before, on level stairs whose treads
        are `step_length` deep; negative downstairs.
    cost : str, mapping or function
        What is minimised over the step, or per metre where length or duration are free:
        ``"torque"``, ``"mechanical_energy"``, ``"electrical_energy"`` (:class:`Cost`); several of
        them with their weights; or a function of an :class:`Instant` that returns the rate as an
        expression of CasADi.
    warm_start : Gait, optional
        A gait of the robot to start from, for instance one with nearly the same step. Other
        starting points are tried only if this one leads nowhere.
    intervals : int, optional
        Intervals of the Gauss-Lobatto grid for quadrature and constraints, 26 by default; on point
        feet, intervals of the collocation mesh, 12 by default.
    starts : int
        Starting points; the best of the optima reached from them is kept. On flat feet it is chosen
        on a coarser grid.
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
        If no gait can meet the request: a step longer than the legs, or out of all time.
    GaitNotFoundError
        If none was found, which does not prove that there is none; the message names the
        constraints in conflict and by how much they are violated at the least.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    >>> gait.position([0.0, 0.35]).shape
    (2, 6)
    """
    asked = dict(locals())  # all arguments, by name
    del asked["progress"]
    request = Request(**asked)
    kept = KeptGait(request)
    if (gait := kept.load()) is not None:
        if progress is not None:
            progress(1.0)
        return gait
    # CasADi is loaded only now: importing heelstrike, or loading a saved gait, does without it.
    from heelstrike.gait.design import designed

    furthest = 0.0

    def report(fraction: float) -> None:
        """Tell progress that never goes back, also when the work turns out to be more."""
        nonlocal furthest
        furthest = max(furthest, fraction)
        if progress is not None:
            progress(furthest)

    *others, last = request.profiles
    for profile in others:
        with suppress(InfeasibleGaitError):  # the last profile asks least of the swing foot
            return kept.save(designed(request, profile, report))
    return kept.save(designed(request, last, report))


def request_of(robot: Robot, **asked: Any) -> Request:
    """Return a request in which what is not asked is as :func:`optimize_gait` has it by default."""
    parameters = inspect.signature(optimize_gait).parameters
    usual = {name: each.default for name, each in parameters.items() if name != "robot"}
    del usual["progress"]
    return Request(robot=robot, **{**usual, **asked})
