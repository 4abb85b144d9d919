"""One simulation of a batch, in memory of the batch, which compiled code moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import address_of_array
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Integers
from heelstrike.robot.state import State
from heelstrike.sim.batch.planning import Plan
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.controller.control import TRUSTED
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.frame import Outcome
from heelstrike.sim.method import Method
from heelstrike.sim.push import pushes_on
from heelstrike.sim.run import AnyRun
from heelstrike.sim.setting import Setting
from heelstrike.sim.simulation import NEVER, Simulation


@dataclass(frozen=True)
class Ending:
    """How one simulation of a batch came to its end."""

    status: RunStatus
    message: str
    """status, message: How, and the same in a person's words."""
    error: BaseException | None
    """What the controller raised, if that ended it."""
    state: State
    time: float
    """state, time: Where the robot was, and when."""
    events: Integers
    """(kinds,) Events of each kind."""
    counts: dict[str, Any]
    """What was counted, and the worst values, by name."""
    run: AnyRun | None
    """The record, if rows were kept."""


class Lane(Simulation):
    """A simulation in memory that a batch gives it.

    Parameters
    ----------
    plan : Plan
        What it is to be.
    method : Method
        Simulation method.
    memory, clock : Memory or SpatialMemory, and Clock
        As they are allocated for its robot and pushes.
    events : (kinds,) int
        Where its events are counted.
    keep_rows : bool
        Whether it is recorded.
    """

    def __init__(
        self, plan: Plan, method: Method, memory: Any, clock: Clock, events: Integers,
        *, keep_rows: bool,
    ) -> None:  # fmt: skip
        self._begin(plan.setting, method, memory, clock, keep_rows)
        self._event_counts = events
        self._commanded = plan.law.commanded
        self._control_with(plan.law)
        self._new_record()

    @property
    def controller(self) -> Controller | None:
        """What decides the torques; the batch knows it by its place."""
        return self._controller

    @controller.setter
    def controller(self, controller: Controller | None) -> None:
        raise SimulationError(
            f"a lane is given another controller ({type(controller).__name__}) by "
            "batch.lay(index, controller=...)"
        )

    @property
    def moves_alone(self) -> bool:
        """Whether Python has to look at it whenever it has moved: at its record or controller."""
        control = self._control
        return self._keeps_rows or control.conduct != TRUSTED or control.in_python != 0

    @property
    def commanded(self) -> NDArray[np.float64] | None:
        """What its law is commanded with, if it is."""
        name = self._commanded
        return getattr(self._numbers.parameters, name) if name else None

    @property
    def places(self) -> list[int]:
        """Where what it is moved with is, in the order of :mod:`heelstrike.sim.batch.moving`."""
        command = self.commanded
        if not self._records:
            self._new_record()
        return [
            self._loop.address, self.robot.model.address, self._ground.model().address,
            self._control.address, self._memory.address, self._work.address,
            self._records[-1].address, self._clock.address,
            0 if command is None else address_of_array(command),
        ]  # fmt: skip

    def changing(self) -> list[tuple[str, NDArray[Any]]]:
        """Name what changes as it moves, and is not written again before it is read.

        Pushes are left out: their number may differ from lane to lane.
        """
        bundles = self._bundles.items()
        named = [each for prefix, bundle in bundles for each in bundle.storage(prefix)]
        return [
            (name, array)
            for name, array in named
            if array.flags.writeable and array.size and not name.startswith(_NOT_KEPT)
            and not name.endswith("problem.delassus")
        ]  # fmt: skip

    def came_to(self, outcome: int) -> None:
        """Note why compiled code came back that moved it."""
        self.status, self.message = self._ending(Outcome(outcome))

    def renew(self, setting: Setting) -> None:
        """Take ground and pushes, as many as before, of another setting.

        It has to start again before it moves.
        """
        if setting.ground is not self._ground:
            self._dimension.check_fit(setting.ground, self._memory)
        if setting.pushes is not self._pushes and setting.pushes:
            mine, its = self._memory.pushes, pushes_on(self.robot, setting.pushes)
            for name in ("link", "point", "force", "start", "end"):
                getattr(mine, name)[:] = getattr(its, name)
        self._pushes = setting.pushes
        if setting.ground is not self._ground:
            self._ground = setting.ground
            self._choose_loop()
        self._setting = replace(self._setting, pushes=setting.pushes, ground=setting.ground)

    def begin_anew(self) -> None:
        """Forget in Python, too, what was before its memory was put back."""
        for record in self._records:
            record.rows = record.told.events = record.logged = 0
        self._memory.pushes.share[:] = 0.0
        self._recorded_until = 0.0
        self._fork = None
        self._why_stopped = ""
        self.status, self.message = RunStatus.COMPLETED, "not begun"
        self.error = None

    def move(self, until: float, steps: int) -> None:
        """Move on by itself, until a time or so many steps, unless it has ended."""
        self._advance(until, min(self._clock.index + steps, NEVER))

    def count_events(self) -> None:
        """Count what happened so far, and forget it."""
        for each in self._records:
            self._count_events(each)

    def to_the_end(self, duration: float, stopped: Callable[[], bool]) -> Ending:
        """Simulate as :func:`~heelstrike.simulate` does, until `stopped` says so."""
        keep = self._keeps_rows
        self._advance(self._way.instant(self._clock, duration), NEVER, stopped=stopped)
        final = self._final() if keep else None
        status, message = self._decide_last()
        last = self._records[-1]
        state, row = self.state, last.rows - 1
        if row >= 0 and last.time[row] == self.time:  # event-driven rows lie on the constraints
            state = State(last.position[row], last.velocity[row])
        run = self._run(status, message, final) if keep else None
        self.count_events()
        return Ending(
            status, message, self.error, State(state.q.copy(), state.v.copy()), self.time,
            self._event_counts.copy(), self._dimension.counted(self._memory), run,
        )  # fmt: skip


_NOT_KEPT = (
    "memory.pushes.", "memory.solver.sticking.", "memory.solver.reduced.",
    "memory.solver.equations.", "memory.solver.lemke.", "memory.solver.iteration.",
    "memory.solver.combinations.", "memory.solver.trial.", "memory.solver.scaling.",
    "memory.jacobian", "memory.half", "control.parameters",
)  # fmt: skip
"""Scratch, which is written again before it is read; parameters, which are the user's."""
