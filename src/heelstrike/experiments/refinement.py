"""How the answer of time stepping depends on its step and on its scheme.

The paper warns that first-order, fixed-step methods may need prohibitively small steps. Here the
same gait is walked with its two readings of Euler's method and with the default scheme, for a
range of steps, and their order of convergence is measured.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from heelstrike.analysis import Summary, summarize
from heelstrike.contact.ground import Ground
from heelstrike.control import ComputedTorque
from heelstrike.experiments.walk import walk
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.robot import Robot
from heelstrike.sim import Run, Scheme, TimeStepping, simulate
from heelstrike.sim.whole_run import whole

SCHEMES = (Scheme.IMPACT_RESOLVED, Scheme.PAPER_EXPLICIT, Scheme.PAPER_SYMPLECTIC)
"""Discretisations compared: the default, and the paper's equations and text."""

TIME_STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
"""Time steps of the walks, in s."""

FINE_STEPS = (4e-4, 2e-4, 1e-4, 5e-5)
"""Time steps from which the order of convergence is measured, in s."""

EXACT_STEP = 5e-6
"""Time step of the motion that counts as exact, in s."""

COMPARED_AT = 0.9
"""When motions are compared, as a share of the first step: before the foot lands."""


@dataclass(frozen=True)
class RefinedWalk:
    """One walk of the comparison."""

    scheme: Scheme
    """Discretisation."""
    step: float
    """Time step in s."""
    summary: Summary
    """What came of it."""


@dataclass(frozen=True)
class Convergence:
    """How the error of a scheme falls with its step."""

    scheme: Scheme
    """Discretisation."""
    steps: tuple[float, ...]
    """Time steps in s."""
    errors: tuple[float, ...]
    """Largest difference of a coordinate from the exact motion late in the first walking step, in m
    or rad."""
    order: float
    """Slope of log(error) over log(step)."""
    lost: float
    """Share of all time steps in which an end of the stance sole carries nothing, which stands on
    both. A scheme that loses the ground regains it when rounding has it so: its errors differ from
    one processor to the next, and their slope measures nothing."""


def refine(
    robot: Robot, gait: Gait, ground: Ground, steps: int, progress: Callable[[float], None]
) -> tuple[RefinedWalk, ...]:
    """Walk so many steps of the same gait with all schemes and time steps.

    Parameters
    ----------
    robot, gait, ground, steps
        As for :func:`heelstrike.experiments.walk.walk`.
    progress : callable
        Called with the fraction of the walks that is done.
    """
    walks: list[RefinedWalk] = []
    for scheme, step in product(SCHEMES, TIME_STEPS):
        method = TimeStepping(step=step, scheme=scheme)
        run = whole(walk(robot, gait, steps=steps, method=method, ground=ground))
        walks.append(RefinedWalk(scheme, step, summarize(run, gait=gait)))
        progress(len(walks) / (len(SCHEMES) * len(TIME_STEPS)))
    return tuple(walks)


def converge(robot: Robot, gait: Gait, ground: Ground) -> tuple[Convergence, ...]:
    """Measure the order of convergence of several schemes on the first step of a gait.

    Parameters
    ----------
    robot : Robot
        The robot.
    gait : Gait
        Its gait.
    ground : Ground
        The ground.
    """

    def motion(step: float, scheme: Scheme, record_every: int = 1) -> Run:
        """The run to the instant of comparison, a whole number of all steps."""
        return whole(
            simulate(
                robot,
                ComputedTorque(robot, gait),
                state=gait.initial_state,
                duration=instant,
                method=TimeStepping(step=step, scheme=scheme),
                ground=ground,
                record_every=record_every,
            )
        )

    sole = list(robot.feet[gait.stance_foot].contacts)
    coarsest = max(FINE_STEPS)
    instant = round(COMPARED_AT * gait.step_duration / coarsest) * coarsest
    last = round(instant / EXACT_STEP)
    exact = motion(EXACT_STEP, Scheme.IMPACT_RESOLVED, last).position[-1]
    found = []
    for scheme in SCHEMES:
        runs = [motion(step, scheme) for step in FINE_STEPS]
        errors = [float(np.abs(run.position[-1] - exact).max()) for run in runs]
        order = float(np.polyfit(np.log(FINE_STEPS), np.log(errors), 1)[0])
        carried = np.concatenate([run.contact_force[1:][:, sole, 0] for run in runs])
        lost = float((carried <= 0.0).any(axis=1).mean())
        found.append(Convergence(scheme, FINE_STEPS, tuple(errors), order, lost))
    return tuple(found)
