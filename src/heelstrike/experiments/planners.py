"""Walks planned by the cart-table model beside the optimal gait: what they cost.

After the comparison of the paper's [28]: a walk planned by its zero moment point, with bent knees
and the centre of mass at constant height, against one of least torque.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from rich.console import Group

from heelstrike.analysis import zero_moment_point
from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
from heelstrike.analysis.told_summary import PlainEntries
from heelstrike.arguments import is_number, takes
from heelstrike.contact.ground import Ground
from heelstrike.control import ComputedTorque
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, Motion, Planner, optimize_gait, plan_motion
from heelstrike.robot import Robot
from heelstrike.sim import EventDriven, Run, simulate
from heelstrike.view.terminal import bare_table

SPEEDS = (0.2, 0.3, 0.4, 0.5, 0.6)
"""Speeds of a comparison (m/s)."""
COLUMNS = {
    "torque_cost": "∫Γ² N²m s",
    "cost_of_transport": "transport",
    "peak_torque": "peak N m",
    "zmp_margin": "ZMP margin m",
}
"""Figures of a walk and their headings."""
OPTIMUM = "optimum"
"""What the optimal gait is called."""
REACHED = 0.9
"""Share of the distance that is asked for from which on a robot has walked."""
LANDING = 5e-3
"""Time (s) around an event in which feet come to rest and the zero moment point says nothing."""
UNKNOWN = float("nan")


@dataclass(frozen=True)
class Planned:
    """A walk at one speed, as simulated."""

    planner: str
    """How it was planned."""
    speed: float
    """Speed that was asked for (m/s)."""
    walks: bool
    """Whether the robot walked all steps."""
    message: str
    """What is wrong with it; nothing if it walks."""
    torque_cost: float = UNKNOWN
    """∫ΓᵀΓ dt over the distance (N²m s)."""
    cost_of_transport: float = UNKNOWN
    """∫ Σ |τ ω| dt over weight and distance."""
    peak_torque: float = UNKNOWN
    """Largest torque (N m)."""
    zmp_margin: float = UNKNOWN
    """Least distance of the zero moment point from the ends of the sole in single support (m), but
    within `LANDING` of an event."""


@dataclass(frozen=True, eq=False)
class PlannerComparison(PlainEntries):
    """Walks of several planners over several speeds."""

    robot: str
    """Name of the robot."""
    step_duration: float
    """Duration of a step (s)."""
    walks: tuple[Planned, ...]
    """The walks, speed by speed."""

    def __rich__(self) -> Group:
        title = f"{self.robot}: planned walks"
        table = bare_table(title, ("speed m/s", "planner"), COLUMNS.values())
        for each in self.walks:
            numbers = [f"{getattr(each, name):.3g}".replace("nan", "–") for name in COLUMNS]
            table.add_row(f"{each.speed:g}", each.planner.replace("_", " "), *numbers)
        failed = (each for each in self.walks if not each.walks)
        why = [
            f"{each.planner.replace('_', ' ')}, {each.speed:g} m/s: {each.message}"
            for each in failed
        ]
        return Group(table, *why)


@takes(GaitError)
def compare_planners(
    robot: Robot,
    *,
    speeds: Iterable[float] = SPEEDS,
    step_duration: float = 0.7,
    friction: float = 0.75,
    steps: int = 10,
    progress: Callable[[str], None] | None = None,
) -> PlannerComparison:
    """Walk at several speeds as planned by the cart-table model, and as is optimal.

    Every walk is simulated event-driven; what it costs is that of the simulation. The optimum is
    the gait of least torque of the same step length and duration, without double support.

    Parameters
    ----------
    robot : Robot
        A robot on two flat feet with three driven joints a leg.
    speeds : iterable of float
        Speeds (m/s).
    step_duration : float
        Duration of a step (s).
    friction : float
        Of the ground.
    steps : int
        Steps of each walk.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    PlannerComparison
        What each came to. A walk that cannot be planned says why.

    Raises
    ------
    GaitError
        If the robot cannot be planned for, or an argument makes no sense.
    """
    given = [] if is_number(speeds) else list(speeds)
    if not given or not all(is_number(x) and np.isfinite(x) and x > 0.0 for x in given):
        raise GaitError(f"speeds must be positive numbers (m/s), got {given or speeds!r}")
    several = [float(speed) for speed in given]
    if steps < 1:
        raise GaitError(f"steps must be 1 or more, got {steps}")
    tell, walks = progress or (lambda _: None), []
    for speed in several:
        step: dict[str, Any] = {
            "step_length": speed * step_duration, "step_duration": step_duration,
            "friction": friction,
        }  # fmt: skip
        for planner in (*(each.value for each in Planner), OPTIMUM):
            tell(f"{planner.replace('_', ' ')} at {speed:g} m/s")
            try:
                walk: Motion | Gait = (
                    optimize_gait(robot, **step)
                    if planner == OPTIMUM
                    else plan_motion(robot, planner=planner, **step)
                )
            except InfeasibleGaitError as error:
                walks.append(Planned(planner, speed, walks=False, message=str(error)))
            else:
                walks.append(_walked(robot, walk, planner, speed, step_duration * steps, friction))
    return PlannerComparison(robot.name, step_duration, tuple(walks))


def _walked(
    robot: Robot, walk: Motion | Gait, planner: str, speed: float, duration: float, friction: float
) -> Planned:
    """Simulate a walk and say what it costs."""
    run = simulate(
        robot, ComputedTorque(robot, walk), state=walk.initial_state, duration=duration,
        method=EventDriven(), ground=Ground(friction=friction),
    )  # fmt: skip
    fall = first_cause(run, walk if isinstance(walk, Gait) else None)
    summary = run.summary()
    if not (walked_on(run, fall) and summary.distance_m > REACHED * speed * duration):
        message = f"{run.message}, {summary.distance_m:.3g} m ahead" if fall is None else str(fall)
        return Planned(planner, speed, walks=False, message=message)
    return Planned(
        planner=planner,
        speed=speed,
        walks=True,
        message="",
        torque_cost=summary.torque_cost_N2m2s / summary.distance_m,
        cost_of_transport=summary.cost_of_transport,
        peak_torque=float(np.abs(run.torque).max()),
        zmp_margin=_margin(run),
    )


def _margin(run: Run) -> float:
    """Least margin of the zero moment point under the foot that stands alone."""
    points = zero_moment_point(run)
    events = np.array([-np.inf, *(event.time for event in run.events), np.inf])
    after = np.searchsorted(events, run.time)
    away = np.minimum(run.time - events[after - 1], events[after] - run.time) > LANDING
    alone = points.foot_margin[points.single_support & away]
    return float(np.nanmin(alone)) if alone.size else UNKNOWN
