"""The simulations on which the page about the paper rests."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.control import ComputedTorque, Encoder
from heelstrike.experiments.laws import Entry, walking
from heelstrike.experiments.refinement import Convergence, RefinedWalk, converge, refine
from heelstrike.experiments.walk import design, walk
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, optimize_gait
from heelstrike.robot import Robot, State, load_robot
from heelstrike.sim import Run, TimeStepping, simulate
from heelstrike.sim.whole_run import whole

FRICTION = 0.75
"""The paper's coefficient of friction."""
STEP_LENGTH = 0.30
STEP_DURATION = 0.70
"""Length (m) and duration (s) of a step; the paper prints neither."""
STEPS = 20
"""Walking steps on which the claims are measured."""
TIME_STEP = 1e-4
"""Time step of the walk, in s."""
ENCODER = Encoder(period=1e-3, resolution=0.0)
"""How joint positions are sampled when velocities are estimated from them."""


@dataclass(frozen=True)
class Evidence:
    """Everything the claims are measured on."""

    gait: Gait
    """The gait of the paper's robot."""
    run: Run
    """The walk under computed torque."""
    estimated: Run
    """The same walk with joint velocities estimated from sampled positions, one time step a
    sample."""
    drop: Run
    """The robot dropped, unpowered, on tilted feet: toes first."""
    other: Run
    """Another robot walking a gait of its own."""
    refinement: tuple[RefinedWalk, ...]
    """Walks with several schemes and time steps."""
    convergence: tuple[Convergence, ...]
    """Order of convergence of the same schemes."""

    @property
    def robot(self) -> Robot:
        """The paper's robot."""
        return self.run.robot


def gather(progress: Callable[[str, float], None]) -> Evidence:
    """Run all simulations.

    Parameters
    ----------
    progress : callable
        Called with what is being done and the fraction of it that is done.
    """
    robot = load_robot("bravo7")
    progress("designing the gait", 0.0)
    gait = optimize_gait(
        robot, step_length=STEP_LENGTH, step_duration=STEP_DURATION, friction=FRICTION
    )
    ground = Ground(friction=FRICTION)
    method = TimeStepping(step=TIME_STEP)
    sampled = TimeStepping(step=ENCODER.period)
    estimating = walking(
        "by encoders", lambda robot, gait: ComputedTorque(robot, gait, encoder=ENCODER)
    )

    def stroll(doing: str, method: TimeStepping, law: Entry | None = None) -> Run:
        return whole(
            walk(
                robot, gait, steps=STEPS, law=law, method=method, ground=ground,
                progress=partial(progress, doing),
            )
        )  # fmt: skip

    run = stroll("walking", method)
    estimated = stroll("walking on estimated velocities", sampled, estimating)
    refinement = refine(robot, gait, ground, STEPS, partial(progress, "comparing time steps"))
    progress("measuring the order of convergence", 0.0)
    convergence = converge(robot, gait, ground)
    progress("walking another robot", 0.0)
    return Evidence(
        gait=gait,
        run=run,
        estimated=estimated,
        drop=_drop(robot, ground, method),
        other=_other_robot(),
        refinement=refinement,
        convergence=convergence,
    )


def _drop(robot: Robot, ground: Ground, method: TimeStepping) -> Run:
    """Drop the robot, unpowered and leaning forward, so that toes and heels land apart in time."""
    q = np.array(robot.model.reference)
    q[1] += 0.03
    q[2] += 0.1
    return whole(
        simulate(
            robot,
            state=State(q, np.zeros(robot.nv)),
            duration=0.4,
            method=method,
            ground=ground,
            stop_when_fallen=False,
        )
    )


def _other_robot() -> Run:
    robot = load_robot("spring_flamingo")
    gait = design(robot, friction=FRICTION)
    return whole(walk(robot, gait, steps=STEPS, ground=Ground(friction=FRICTION)))
