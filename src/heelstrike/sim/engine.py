"""What every way through time has in common, so that one argument switches between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import Solver
from heelstrike.errors import SimulationError
from heelstrike.robot.robot import Robot
from heelstrike.sim.memory import Memory, Record

# How a compiled loop can come back.
DONE = 0
RECORD_FULL = 1
FELL = 2
DIVERGED = 3
SOLVER_FAILED = 4
BAD_CONTROLLER = 5
PAUSED = 6
RAISED = 7


@dataclass(frozen=True)
class Setting:
    """What a way through time is asked to do.

    Attributes
    ----------
    robot : Robot
    ground : GroundModel
    memory : Memory
        State of the simulation; `q` and `v` hold the initial state.
    duration : float
        Seconds.
    control_period : float or None
        Seconds between two calls of the controller; None for as often as the method can.
    record_every : int
        Steps between two rows of the record.
    fallen_height : float
        Height of the centre of mass above the ground (m) below which the robot has fallen.
    """

    robot: Robot
    ground: GroundModel
    memory: Memory
    duration: float
    control_period: float | None
    record_every: int
    fallen_height: float


class Engine(Protocol):
    """A way through time at work on one simulation.

    Attributes
    ----------
    compile_s : float
        Seconds it took to compile or load.
    solver : str
        Contact solver tried first, or the contact law.
    spare : (m,) float
        Copy of the controller's memory for the calls that it shall forget; guarded.
    """

    compile_s: float
    solver: str
    spare: NDArray[np.float64]

    @property
    def time(self) -> float:
        """Simulated time now, in seconds."""
        ...

    @property
    def rows_left(self) -> int:
        """Rows the record will still need, as far as one can tell."""
        ...

    def pause_after(self, steps: int | None) -> None:
        """Pause after about so many steps, or, for None, when the controller is due again."""
        ...

    def advance(
        self,
        controller: Callable[..., None],
        parameters: NDArray[np.float64],
        controller_memory: NDArray[np.float64],
        record: Record,
    ) -> int:
        """Advance under a compiled controller until something stops it; return what.

        `parameters` and `controller_memory` are guarded
        (:mod:`heelstrike.sim.controller.guard`). What the controller raises comes out.
        """
        ...


@runtime_checkable
class Method(Protocol):
    """A way through time: :class:`TimeStepping` and its like."""

    def engine(self, setting: Setting) -> Engine:
        """Return this way through time, compiled and ready to run."""
        ...


def solver_order(name: str) -> NDArray[np.int64]:
    """Codes of the contact solvers in the order in which they are tried, `name` first."""
    order = (Solver.LEMKE, Solver.FISCHER_BURMEISTER, Solver.GAUSS_SEIDEL)
    for first in order:
        if first.value == name:
            rest = [solver for solver in order if solver is not first]
            return np.array([solver.code for solver in (first, *rest)], dtype=np.int64)
    names = ", ".join(solver.value for solver in order)
    raise SimulationError(f"unknown contact solver {name!r}; choose one of {names}")


def whole_steps(name: str, value: float, step: float) -> int:
    """Return how many steps make up a time, which must be a whole number of them."""
    steps = round(value / step)
    if steps < 1 or abs(steps * step - value) > 1e-6 * step:
        raise SimulationError(f"{name} = {value} s must be a whole number of steps of {step} s")
    return steps
