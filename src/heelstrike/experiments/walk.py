"""Walking a gait for a number of steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from heelstrike.analysis.limit_cycle import LimitCycle
from heelstrike.analysis.support import walking_steps
from heelstrike.contact.ground import Ground
from heelstrike.control import ComputedTorque
from heelstrike.dynamics import center_of_mass, contact_positions, link_poses
from heelstrike.errors import GaitError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, optimize_gait
from heelstrike.robot import Robot, State
from heelstrike.sim import Controller, Push, Run, TimeStepping, simulate
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import Method

if TYPE_CHECKING:  # which are made of what is here
    from heelstrike.experiments.laws import Entry

HEIGHT = 1.044
"""Height of bravo7's centre of mass above its soles, in m."""

LAST_STEP = 0.1
"""How much longer than the steps should take a walk is simulated, as a share of one step: the last
touchdown is then inside it, and the robot has not gone far beyond."""


@dataclass(frozen=True)
class StepSize:
    """Size of a walking step."""

    length: float
    """In m."""
    duration: float
    """In s."""
    clearance: float
    """Height of the swing foot's path, in m."""


BRAVO7 = StepSize(0.30, 0.70, 0.03)
"""The step from which all others are scaled."""


def typical_step(robot: Robot) -> StepSize:
    """Size of a step that suits a robot.

    Dynamically similar to bravo7's 0.30 m in 0.70 s: lengths scale with the height of the centre of
    mass above the feet in the reference configuration, times with its square root.

    Raises
    ------
    GaitError
        If the robot has no contact points under its centre of mass.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike.experiments.walk import typical_step
    >>> typical_step(hs.load_robot("bravo7"))
    StepSize(length=0.3, duration=0.7, clearance=0.03)
    """
    standing = robot.model.reference
    height = 0.0
    if robot.nc:
        soles = contact_positions(robot, standing)[:, 1] - robot.model.contact_radius
        height = float(center_of_mass(robot, standing)[1] - soles.min())
    if not height > 0.0:
        raise GaitError(
            f"robot {robot.name!r} has no contact points under its centre of mass, so it cannot "
            f"stand. Give it feet."
        )
    scale = height / HEIGHT
    return StepSize(
        length=round(BRAVO7.length * scale, 2),
        duration=round(BRAVO7.duration * float(np.sqrt(scale)), 2),
        clearance=round(BRAVO7.clearance * scale, 3),
    )


FRICTION_RESERVE = 0.2
"""Share of the ground's friction that a gait designed for a walk leaves unused: an impact at the
edge of the cone would slip a little in every time step that resolves it."""


def design(
    robot: Robot,
    size: StepSize | None = None,
    *,
    friction: float = 0.75,
    progress: Callable[[float], None] | None = None,
) -> Gait:
    """Design the gait of a walk.

    Parameters
    ----------
    robot : Robot
        The robot.
    size : StepSize, optional
        Size of its steps; :func:`typical_step` by default.
    friction : float
        Friction coefficient of the ground; a fifth of it is kept in reserve.
    progress : callable, optional
        Called now and then with the fraction of the work that is done.

    Raises
    ------
    GaitError
        If the robot cannot walk this way or the request makes no sense.
    InfeasibleGaitError
        If there is no such gait.
    """
    size = typical_step(robot) if size is None else size
    return optimize_gait(
        robot,
        step_length=size.length,
        step_duration=size.duration,
        clearance=size.clearance,
        friction=(1.0 - FRICTION_RESERVE) * friction,
        progress=progress,
    )


@dataclass(frozen=True, eq=False)
class Beginning:
    """What a walk begins with."""

    state: State
    """The robot on its ground."""
    step_duration: float
    """In s."""
    controller: Controller | Law | None
    """What moves the joints."""


def beginning(
    robot: Robot,
    walked: Gait | LimitCycle | None,
    ground: Ground | None = None,
    law: Entry | None = None,
) -> Beginning:
    """Put a robot on a ground as its gait begins, or on its limit cycle.

    Where the ground slopes at the start, the whole robot is turned with it about the middle of its
    stance foot, so that its feet lie on the ground as they do on that of the gait, which may be a
    slope itself; see also :meth:`heelstrike.Robot.placed`. A robot that stands does so as it can
    there.

    Parameters
    ----------
    robot : Robot
        The robot.
    walked : Gait, LimitCycle or None
        Its gait, or its walk without motors; None of a law that makes it stand.
    ground : Ground, optional
        The ground; level by default.
    law : Entry, optional
        What moves the joints; computed torque by default.
    """
    if isinstance(walked, LimitCycle):
        return Beginning(walked.state, walked.period, None)
    if law is None:
        assert walked is not None
        state, duration = walked.initial_state, walked.step_duration
        controller: Controller | Law | None = ComputedTorque(robot, walked)
    else:
        trial = law.trial(robot, walked)
        state, duration, controller = trial.state, trial.step_duration, trial.controller
    if ground is not None and (ground.shape is not None or np.any(ground.model().vertices[:, 1])):
        if law is not None and law.stands:
            state = robot.standing(ground)
        else:
            turn = _slope_at(ground, 0.0) - (0.0 if walked is None else walked.slope)
            state = robot.placed(_turned(robot, state, turn), ground)
    return Beginning(state, duration, controller)


def _slope_at(ground: Ground, x: float) -> float:
    """Inclination (rad) of the ground at x; positive climbs."""
    if ground.shape is not None:
        return float(np.arctan(ground.shape.at(x)[1]))
    corners = ground.model().vertices
    segment = int(np.clip(np.searchsorted(corners[:, 0], x, "right") - 1, 0, len(corners) - 2))
    run, rise = corners[segment + 1] - corners[segment]
    return float(np.arctan2(rise, run))


def _turned(robot: Robot, state: State, slope: float) -> State:
    """Turn a floating robot with its motion about the world's origin, up by a slope (rad)."""
    turn = np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    q, v = state.q.copy(), state.v.copy()
    trunk = link_poses(robot, q).origin[2]
    q[:2] += turn @ trunk - trunk
    v[:2] = turn @ v[:2]
    q[2] -= slope
    return State(q, v)


def walk(
    robot: Robot,
    walked: Gait | LimitCycle | None,
    *,
    steps: int = 20,
    law: Entry | None = None,
    method: Method | None = None,
    ground: Ground | None = None,
    pushes: Sequence[Push] = (),
    progress: Callable[[float], None] | None = None,
    on_error: OnError | str = OnError.WARN,
) -> Run:
    """Walk a gait, or on from a limit cycle.

    Parameters
    ----------
    robot : Robot
        The robot.
    walked : Gait, LimitCycle or None
        Its gait, or its walk without motors; None of a law that makes it stand.
    steps : int
        Steps to walk. The run goes on for a tenth of a step after the time they should take.
    law : Entry, optional
        What moves the joints; by default computed torque with its usual gains, nothing on a limit
        cycle.
    method : Method, optional
        Simulation method.
    ground : Ground, optional
        The ground, on which the robot is put as :func:`beginning` says.
    pushes : sequence of Push
        Forces that somebody else applies.
    progress : callable, optional
        Called now and then with the fraction of the walk that is done.
    on_error : OnError or str
        What to do when the law raises, as of :func:`~heelstrike.simulate`.

    Raises
    ------
    SimulationError
        If the number of steps is not positive.
    """
    if steps < 1:
        raise SimulationError(f"a walk has at least one step, got {steps}")
    start = beginning(robot, walked, ground, law)
    duration = (steps + LAST_STEP) * start.step_duration

    def report(time: float) -> None:
        if progress is not None:
            progress(time / duration)

    return simulate(
        robot,
        start.controller,
        state=start.state,
        duration=duration,
        method=method,
        ground=ground,
        pushes=pushes,
        progress=report,
        on_error=on_error,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A walk, with all that decides how it goes."""

    robot: Robot
    gait: Gait | LimitCycle | None
    """Its gait, or its walk without motors; None of a law that makes it stand."""
    law: Entry | None = None
    """What moves the joints; computed torque by default."""
    ground: Ground = field(default_factory=Ground)
    pushes: Sequence[Push] = ()
    method: Method = field(default_factory=lambda: TimeStepping(step=1e-3))
    steps: int = 10
    """Steps that it is to take."""

    @property
    def followed(self) -> Gait | None:
        """Gait that motors follow, if they follow one."""
        return self.gait if isinstance(self.gait, Gait) else None

    @property
    def lowest_friction(self) -> float:
        """Friction coefficient of the ground where it is lowest."""
        return float(self.ground.model().friction.min())

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        on_error: OnError | str = OnError.WARN,
    ) -> Run:
        """Walk, as :func:`walk` does."""
        return walk(
            self.robot, self.gait, steps=self.steps, law=self.law, method=self.method,
            ground=self.ground, pushes=self.pushes, progress=progress, on_error=on_error,
        )  # fmt: skip


def steps_taken(run: Run, walked: Gait | LimitCycle | None) -> int:
    """Count the steps of a walk; on a limit cycle by the distance.

    A wheel lands on one spoke after the other, and all of them are one foot; and a walker that
    stumbles lands often and gets nowhere.
    """
    if not isinstance(walked, LimitCycle) or not len(run.time):
        return len(walking_steps(run))
    first, last = (center_of_mass(run.robot, run.position[row]) for row in (0, -1))
    return int(np.hypot(*(last - first)) / walked.step_length)


def why_unstable(walked: Gait | LimitCycle) -> str | None:
    """Say why a robot cannot keep to what it walks; None if it can.

    On a flat foot every coordinate follows from the joints. On a point the robot tips about it as
    gravity will, whatever the joints do: the linearised step multiplies an error of that motion by
    some factor, 7.8 for rabbit's usual gait (:func:`heelstrike.find_limit_cycle`).
    """
    if isinstance(walked, LimitCycle):
        if walked.stable:
            return None
        return (
            "The walk repeats, but it is unstable: an error grows from step to step, by the factor "
            f"{np.abs(walked.multipliers).max():.3g}. Another slope may have a stable one."
        )
    if not walked.point_feet:
        return None
    return (
        f"robot {walked.robot!r} stands on point feet, on which the ground exerts no moment: no "
        "motor acts on its tipping about the stance foot. Computed torque makes the joints follow "
        "the gait, and the first step with them, but an error of that motion grows from step to "
        "step until the robot falls."
    )
