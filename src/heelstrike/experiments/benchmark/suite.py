"""The whole suite: which parts there are, and what they found."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Group

from heelstrike.errors import SimulationError
from heelstrike.experiments.benchmark.endurance import measure_endurance
from heelstrike.experiments.benchmark.engines import compared, peers
from heelstrike.experiments.benchmark.footprint import measure_footprint
from heelstrike.experiments.benchmark.machine import machine
from heelstrike.experiments.benchmark.precision import measure_precision
from heelstrike.experiments.benchmark.scaling import measure_scaling
from heelstrike.experiments.benchmark.steps import measure_steps
from heelstrike.experiments.benchmark.tables import tables
from heelstrike.experiments.benchmark.threads import measure_threads
from heelstrike.interruption import acknowledge

PARTS: dict[str, tuple[str, Callable[..., dict[str, Any]]]] = {
    "steps": ("µs a step", measure_steps),
    "precision": ("work and precision", measure_precision),
    "threads": ("batches by threads", measure_threads),
    "scaling": ("joints and contacts", measure_scaling),
    "footprint": ("import, compiling, memory", measure_footprint),
    "endurance": ("certificates over many steps", measure_endurance),
}
"""Parts of the suite by name: what each measures, and how."""


@dataclass(frozen=True, eq=False)
class Benchmark:
    """What a run of the suite found.

    Attributes
    ----------
    quick : bool
        Whether it was the short form, good for a look only.
    date : str
        When it ran, in UTC.
    machine : dict
        Processor, system, versions.
    peers : dict
        Version of each engine, or why it is not in the comparison.
    parts : dict
        Results by part; plain numbers and text.
    interrupted : str
        What was being measured when Ctrl-C ended it; empty if it is whole.
    """

    quick: bool
    date: str
    machine: dict[str, Any]
    peers: dict[str, str]
    parts: dict[str, Any]
    interrupted: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and text."""
        return {
            "quick": self.quick,
            "date": self.date,
            "machine": self.machine,
            "peers": self.peers,
            **({"interrupted": self.interrupted} if self.interrupted else {}),
            **self.parts,
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write benchmark.json and the figures into a folder; return the files.

        Of a benchmark that was interrupted no figures are drawn.
        """
        from heelstrike.experiments.benchmark.figures import draw
        from heelstrike.view.style import save_figure
        from heelstrike.whole_file import write_whole

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        files = [target / "benchmark.json"]
        write_whole(files[0], json.dumps(self.to_dict(), indent=2) + "\n")
        for name, figure in draw({} if self.interrupted else self.parts).items():
            files.append(save_figure(figure, target / f"{name}.png"))
        return files

    def __rich__(self) -> Group:
        return Group(*self._paragraphs())

    def _paragraphs(self) -> Iterator[Any]:
        about = self.machine
        versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
        yield f"{about['processor']} ({about['processors']}), {about['system']}"
        yield f"Python {about['python']}, {versions}"
        yield "peers: " + "; ".join(f"{name} {state}" for name, state in self.peers.items())
        if self.quick:
            yield "the quick form: good for a look, not for figures"
        yield from tables(self.parts)


def run_benchmark(
    *,
    quick: bool = False,
    parts: Sequence[str] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Benchmark:
    """Measure heelstrike beside the engines that are installed.

    Parameters
    ----------
    quick : bool
        Measure less, in less than a minute once everything is compiled.
    parts : sequence of str, optional
        Names of the parts to run; all by default.
    progress : callable, optional
        Called with what is being measured and the fraction that is done.

    Returns
    -------
    Benchmark
        After Ctrl-C, of the parts that were finished by then.

    Raises
    ------
    SimulationError
        If there is no such part.
    """
    wanted = list(PARTS) if parts is None else list(parts)
    for name in wanted:
        if name not in PARTS:
            raise SimulationError(
                f"the benchmark has no part {name!r}; its parts are {', '.join(PARTS)}"
            )
    about = machine()
    found = peers()
    results: dict[str, Any] = {}
    interrupted = ""
    for done, name in enumerate(wanted):
        title, measure = PARTS[name]
        if progress is not None:
            progress(title, done / len(wanted))
        try:
            results[name] = measure(quick=quick, peers=compared(found))
        except KeyboardInterrupt as interrupt:
            if not results:
                raise
            acknowledge(interrupt)
            interrupted = title
            break
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Benchmark(quick, date, about, found, results, interrupted)
