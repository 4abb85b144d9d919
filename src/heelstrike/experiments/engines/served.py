"""Engines in a process of their own: one may abort, hang, or be of another Python.

An order and its answer are bytes: a line of JSON, then numbers. The process of an adapter of this
package is told the robot whole; a script for another Python, which imports nothing of this package,
is told it link by link.
"""

from __future__ import annotations

import json
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from heelstrike.experiments.engines.links import links
from heelstrike.experiments.engines.packages import PACKAGES, simulators
from heelstrike.experiments.engines.peer import InvalidRunError, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.reader_process import ReaderProcess, ReadingError
from heelstrike.robot.files.robot_json import robot_entries
from heelstrike.robot.model import Floats

MOST_MEMORY = 16 * 2**30
"""Bytes that an engine may ask for: some reserve much and use little."""

LONGEST = 200
"""Letters of what an engine says that are told on."""

PATIENCE = 60.0
"""Seconds that an engine may take to be made or to answer."""

PYTHONS = (sys.executable, "/usr/bin/python3", "python3")
"""Programs that are asked for a module: this Python, in a process without this package, and the
system's."""

SERVER = "heelstrike.experiments.engines.serving:answer"
"""What answers for the adapters of this package."""


class ServedPeer(Peer):
    """A scenario in an engine that runs in another process.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    engine : str
        Name of the engine.
    job : str
        What answers: ``module:name``, or ``file.py:name`` that imports nothing of this package.
    python : str, optional
        Program of another Python.
    process : ReaderProcess, optional
        Where the engine has been before and runs again; by default it gets a process of its own.
    patience : float
        Seconds that an answer may take.
    **settings
        Of the engine.

    Raises
    ------
    InvalidRunError
        If the engine ends, hangs or refuses; the message says which.
    """

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        engine: str,
        job: str = SERVER,
        python: str | None = None,
        process: ReaderProcess | None = None,
        patience: float = PATIENCE,
        **settings: Any,
    ) -> None:
        super().__init__(scenario, step)
        self._job, self._patience = job, patience
        self._process = process or ReaderProcess(python=python, remembers=True)
        self._owned = process is None
        order = {
            "do": "make", "engine": engine, "step": step, "friction": scenario.friction,
            "restitution": scenario.restitution, "settings": settings,
            "robot": None if job != SERVER else robot_entries(scenario.robot),
            "links": None if job == SERVER else told_links(scenario),
        }  # fmt: skip
        self.facts, _ = self._ask(order)
        self._last = np.zeros((scenario.robot.nc, 3))
        self._torque = [0.0] * scenario.robot.nu

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        self._now = np.array(q), np.array(v)
        self._ask({"do": "place", "q": np.asarray(q).tolist(), "v": np.asarray(v).tolist()})

    def simulate(self, steps: int) -> None:
        """Simulate some steps in one exchange; each with its own under a law of control."""
        if self.scenario.feedback is None:
            self._go(steps)
            return
        for k in range(steps):
            self.hold_by_law(k)
            self._go(1)

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        model = self.scenario.robot.model
        self._torque = np.clip(torque, model.torque_lower, model.torque_upper).tolist()

    def record(self, steps: int) -> Floats:
        """Simulate some steps in one exchange, and tell what happened in each."""
        rows = self._go(steps)
        self.done += steps
        return rows

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        return self._now

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        return self._last[:, :2].copy()

    def contacts(self) -> list[tuple[float, float]]:
        """Force of each contact in the last step, and the depth of its point."""
        found, _ = self._ask({"do": "contacts"})
        return [(force, depth) for force, depth in found["contacts"]]

    def close(self) -> None:
        """End the process, if it is of this scenario alone."""
        if self._owned:
            self._process.end()

    def _go(self, steps: int) -> Floats:
        robot = self.scenario.robot
        head, rows = self._ask({"do": "go", "torque": self._torque, "steps": steps})
        self.seconds += head["seconds"]
        rows = rows.reshape(steps, -1)
        self._now = rows[-1, : robot.nq].copy(), rows[-1, robot.nq : robot.nq + robot.nv].copy()
        self._last[:, :2] = rows[-1, robot.nq + robot.nv :].reshape(-1, 2)
        rows[:, : robot.nq] += self.zero
        return rows

    def _ask(self, order: dict[str, Any]) -> tuple[dict[str, Any], Floats]:
        try:
            answer = self._process.ask(
                self._job,
                json.dumps(order).encode(),
                patience=self._patience,
                memory=MOST_MEMORY,
            )
        except ReadingError as error:
            raise InvalidRunError(_in_words(error, self._patience)) from error
        head, _, numbers = answer.partition(b"\n")
        return json.loads(head), np.frombuffer(numbers, dtype=np.float64).copy()


def told_links(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario's robot link by link, as JSON can have it.

    Parameters
    ----------
    scenario : Scenario
        What is simulated.

    Returns
    -------
    dict
        ``links``, each after its parent, in the plane (x, z), ``actuators`` as indices of their
        joints, ``gravity`` and the number of contact points.
    """
    model = scenario.robot.model
    told = [
        {
            "parent": link.parent,
            "hinge": link.hinge,
            "axis": [link.axis[1]] if link.hinge else link.axis[[0, 2]].tolist(),
            "place": link.place[[0, 2]].tolist(),
            "mass": link.mass,
            "center": link.center[[0, 2]].tolist(),
            "inertia": link.inertia,
            "lower": link.lower if np.isfinite(link.lower) else None,
            "upper": link.upper if np.isfinite(link.upper) else None,
            "damping": link.damping,
            "points": [
                [contact, center[0], center[2], radius]
                for contact, (center, radius) in zip(link.contacts, link.points, strict=True)
            ],
        }
        for link in links(scenario.robot)
    ]
    return {
        "links": told,
        "actuators": model.actuator_joint.tolist(),
        "gravity": model.gravity.tolist(),
        "contacts": scenario.robot.nc,
    }


def _in_words(error: ReadingError, patience: float) -> str:
    """Say what became of an engine."""
    if error.kind:
        words = str(error).strip().partition("\n")[0].partition(". ")[0]
        return words if error.kind == "InvalidRunError" else f"{error.kind}: {words[:LONGEST]}"
    text = str(error)
    if "crashes" in text:
        code = int(text.rpartition("exit ")[2].rstrip(")") or 0)
        name = ""
        if code < 0:
            known = {int(each): each.name for each in signal.Signals}
            name = f" by {known.get(-code, f'signal {-code}')}"
        return f"its process was ended{name}" if name else f"its process ended with exit {code}"
    if "has not finished" in text:
        return f"it hangs: no answer within {patience:.0f} s"
    return text


@cache
def other_python(module: str) -> tuple[str, str]:
    """Return a Python of this machine that has a module, and the version of that.

    Parameters
    ----------
    module : str
        Name of the module.

    Returns
    -------
    program : str
        The first of `PYTHONS` that has it; empty if none does.
    version : str
        As the module says, or Debian does.
    """
    for name in PYTHONS:
        program = shutil.which(name)
        if program is None:
            continue
        process = ReaderProcess(python=program, remembers=True)
        try:
            found = process.ask(f"{_LOOKING}:version", module.encode(), patience=PATIENCE)
        except ReadingError:
            continue
        finally:
            process.end()
        if found:
            return program, found.decode()
    return "", ""


def version_elsewhere(module: str) -> str:
    """Return the version of a module that another Python has; empty if none has it.

    Parameters
    ----------
    module : str
        Name of the module.
    """
    return other_python(module)[1]


_LOOKING = str(Path(__file__).with_name("elsewhere") / "looking.py")


class ScriptedPeer(ServedPeer):
    """A scenario in an engine that another Python has; a script of this folder answers for it.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    **settings
        Of the script, and ``patience``.
    """

    script: ClassVar[str]
    """Name of the script's file in the folder ``elsewhere``."""
    module: ClassVar[str]
    """What that Python imports."""

    def __init__(self, scenario: Scenario, step: float, **settings: Any) -> None:
        if not scenario.robot.floating:
            raise InvalidRunError("this engine is given robots with a floating trunk only")
        python, _ = other_python(self.module)
        if not python:
            raise InvalidRunError(f"no Python here has the module {self.module}")
        job = str(Path(__file__).with_name("elsewhere") / self.script)
        super().__init__(
            scenario, step, engine=self.module, job=f"{job}:answer", python=python, **settings
        )
        self.facts = {
            "tells_friction": self.tells_friction,
            "tells_means": self.tells_means,
            "float32": self.float32,
        }


def engine_process(name: str) -> ReaderProcess:
    """Return a process for an engine, which is started when it is asked something.

    Parameters
    ----------
    name : str
        Name of the engine.
    """
    package = PACKAGES[name]
    python = other_python(package.module)[0] if package.elsewhere else None
    return ReaderProcess(python=python or None, remembers=True)


class EngineProcesses:
    """Processes of engines that are started once and asked again, until all are ended together."""

    def __init__(self) -> None:
        self._started: dict[tuple[str, int], ReaderProcess] = {}

    def of(self, name: str, number: int = 0) -> ReaderProcess:
        """Return a process of an engine.

        Parameters
        ----------
        name : str
            Name of the engine.
        number : int
            Which of its processes, where it has several scenarios at once.
        """
        key = name, number
        if key not in self._started:
            self._started[key] = engine_process(name)
        return self._started[key]

    def end(self) -> None:
        """End them all; who asks again starts others."""
        for process in self._started.values():
            process.end()


@contextmanager
def lent(processes: EngineProcesses | None) -> Iterator[EngineProcesses]:
    """Lend the processes that were given, or others that are ended afterwards.

    Parameters
    ----------
    processes : EngineProcesses or None
        Where engines have been asked before.
    """
    if processes is not None:
        yield processes
        return
    own = EngineProcesses()
    try:
        yield own
    finally:
        own.end()


def served(name: str, scenario: Scenario, step: float, **settings: Any) -> ServedPeer:
    """Return a scenario in an engine that runs in a process of its own.

    Parameters
    ----------
    name : str
        Name of the engine.
    scenario : Scenario
        What is simulated.
    step : float
        Seconds.
    **settings
        Of the engine, and ``patience`` and ``process`` of :class:`ServedPeer`.

    Returns
    -------
    ServedPeer
        The other process has it; end it with ``close``.

    Raises
    ------
    InvalidRunError
        If the engine ends, hangs or refuses.
    """
    if PACKAGES[name].elsewhere:
        found: Any = simulators([name])[name].peer(scenario, step, **settings)
        return cast(ServedPeer, found)
    return ServedPeer(scenario, step, engine=name, **settings)
