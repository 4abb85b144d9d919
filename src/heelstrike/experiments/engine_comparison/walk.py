"""What is walked, by whatever moves the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from heelstrike.contact.ground import Ground
from heelstrike.experiments.engine_comparison.entries import Entry
from heelstrike.experiments.engine_comparison.figures import WalkFigures, walk_figures
from heelstrike.experiments.engine_comparison.walking import asked_of, walk_in
from heelstrike.experiments.engines.packages import refuse_absent
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import EngineProcesses, served
from heelstrike.experiments.walk import LAST_STEP
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.gait.file import entries_of
from heelstrike.robot import Robot, State
from heelstrike.robot.files.robot_json import robot_entries
from heelstrike.sim import Controller, EventDriven, Run, simulate
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.whole_run import whole

TRUTH = EventDriven(rtol=1e-9, atol=1e-11, output_period=1e-3)
"""What the engines are held against."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where a walk in an engine begins, if not at the beginning of the gait."""

    controller: Any
    """As it is asked from Python, with the memory that it has by then."""
    state: State
    """The robot's."""
    time: float
    until: float
    """time, until: When it begins, and when it ends (s)."""


@dataclass(frozen=True, eq=False)
class Walk:
    """What is walked, whatever moves the robot."""

    robot: Robot
    controller: Law | Controller
    gait: Gait
    steps: int
    control_period: float
    friction: float
    patience: float
    """robot, controller, gait, steps, control_period, friction, patience: As of
    :func:`compare_engines`."""
    processes: EngineProcesses = field(default_factory=EngineProcesses)
    """Where the engines walk."""

    pasts: dict[Push, Run] = field(default_factory=dict)
    """What was until the end of each push, the same for all engines."""

    @property
    def can_be_told(self) -> bool:
        """Whether two controllers can be told apart: one in Python says nothing of its numbers."""
        return isinstance(self.controller, Law) or hasattr(self.controller, "snapshot")

    def entries(self) -> dict[str, Any]:
        """Return all that a walk follows from but the engine, as JSON has it."""
        asked = self.asked()
        name = type(self.controller).__name__
        begins = asked.snapshot().tolist() if hasattr(asked, "snapshot") else name
        return {
            "robot": robot_entries(self.robot),
            "controller": [str(getattr(asked, "name", name)), begins],
            "gait": entries_of(self.gait),
            "steps": self.steps,
            "control_period": self.control_period,
            "friction": self.friction,
        }

    @property
    def scenario(self) -> Scenario:
        """What the engines simulate."""
        duration = (self.steps + LAST_STEP) * self.gait.step_duration
        return Scenario(
            "walk", self.robot, self.gait.initial_state, duration, friction=self.friction
        )

    def ours(self, method: Method, *, pushes: Sequence[Push] = (), until: float = 0.0) -> Run:
        """Walk by a method of ours.

        Parameters
        ----------
        method : Method
            Which.
        pushes : sequence of Push
            What disturbs it.
        until : float
            When it ends (s), if not after all steps.
        """
        scenario = self.scenario
        return whole(
            simulate(
                self.robot,
                self.controller,
                state=scenario.state,
                duration=until or scenario.duration,
                method=method,
                ground=Ground(friction=self.friction),
                control_period=self.control_period,
                pushes=pushes,
            )
        )

    def past(self, push: Push) -> Run:
        """Walk by the truth until a push ends."""
        if push not in self.pasts:
            self.pasts[push] = self.ours(TRUTH, pushes=[push], until=push.end)
        return self.pasts[push]

    def asked(self) -> Any:
        """Return the controller as it is asked from Python, with a memory of its own."""
        own = self.controller
        return asked_of(self.robot, own if isinstance(own, Law) else deepcopy(own))

    def by(self, method: Method, truth: Run) -> WalkFigures:
        """Walk by a method of ours, and measure it.

        Parameters
        ----------
        method : Method
            Which.
        truth : Run
            What is held for true.
        """
        self.ours(method, until=self.control_period)  # what is made or read once is not timed
        return walk_figures(self.ours(method), truth, self.gait, self.steps)

    def in_engine(
        self, entry: Entry, step: float, given: Mapping[str, Any], truth: Run,
        versions: Mapping[str, str], film: Path | None = None,
    ) -> WalkFigures:  # fmt: skip
        """Walk in an engine, and measure it.

        Parameters
        ----------
        entry : Entry
            Its row.
        step : float
            Seconds.
        given : mapping
            Its settings.
        truth : Run
            What is held for true.
        versions : mapping
            What :func:`~heelstrike.experiments.engines.peers` says of the engines.
        film : Path, optional
            File to show the walk in, if the robot does not walk.

        Raises
        ------
        InvalidRunError
            If the engine is missing, ends, hangs or refuses.
        """
        run, told = self.run_in(entry, step, given, versions)
        found = walk_figures(run, truth, self.gait, self.steps, forces_told=told)
        if film is not None and not found.walks:
            run.animate(film)
        return found

    def run_in(
        self, entry: Entry, step: float, given: Mapping[str, Any], versions: Mapping[str, str],
        start: Start | None = None,
    ) -> tuple[Run, bool]:  # fmt: skip
        """Walk in an engine; return the run, and whether all forces are told, as means over steps.

        Parameters
        ----------
        entry : Entry
            Its row.
        step : float
            Seconds.
        given : mapping
            Its settings.
        versions : mapping
            What :func:`~heelstrike.experiments.engines.peers` says of the engines.
        start : Start, optional
            Where to begin; by default at the beginning of the gait.

        Raises
        ------
        InvalidRunError
            If the engine is missing, ends, hangs or refuses.
        """
        refuse_absent(entry.package, versions)
        scenario, begins = self.scenario, 0.0
        if start is not None:
            scenario, begins = replace(scenario, state=start.state), start.time
            scenario = replace(scenario, duration=start.until - begins)
        controller = self.asked() if start is None else start.controller
        peer = served(
            entry.package, scenario, step, patience=self.patience,
            process=self.processes.of(entry.package), **given,
        )  # fmt: skip
        run = walk_in(
            peer, controller, control_period=self.control_period, name=entry.title, begins=begins
        )
        return run, bool(peer.facts["tells_friction"] and peer.facts["tells_means"])
