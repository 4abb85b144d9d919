"""The parts: measured one after the other, written, and printed."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from heelstrike.experiments.engines import peers, raced
from heelstrike.view.style import save_figure
from speed import endurance, footprint, laws, precision, scaling, steps, stops, threads
from speed.figures import draw
from speed.machine import machine, words
from speed.tables import tables

PARTS = {
    each.__name__.rpartition(".")[2]: each
    for each in (steps, stops, precision, threads, scaling, footprint, endurance, laws)
}
"""Parts by name."""
INTERRUPTED = 130
"""Exit status after Ctrl-C."""


def measure(wanted: Sequence[str], *, quick: bool) -> dict[str, Any]:
    """Measure parts; after Ctrl-C, those that were finished by then, and which was not."""
    found = peers()
    results: dict[str, Any] = {
        "quick": quick,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "peers": found,
    }
    for name in wanted:
        print(f"measuring {name}", file=sys.stderr)
        try:
            results[name] = PARTS[name].measure(quick=quick, peers=raced(found))
        except KeyboardInterrupt:
            return {**results, "interrupted": name}
    return results


def write(results: dict[str, Any], out: Path) -> None:
    """Write benchmark.json and, of what is whole, the figures."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "benchmark.json").write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    for name, figure in draw({} if "interrupted" in results else results).items():
        save_figure(figure, out / f"{name}.png")


@contextmanager
def output_diverted() -> Iterator[None]:
    """Send what engines print by themselves to standard error: standard output is for results."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        with suppress(OSError, TypeError):  # C keeps a buffer of its own; not so on all systems
            ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)


def run(wanted: Sequence[str], *, quick: bool, out: Path) -> int:
    """Measure parts, write what was found, and print it; return the exit status."""
    with output_diverted():
        results = measure(wanted, quick=quick)
        write(results, out)
    console = Console(highlight=False)
    console.print(words(results["machine"], results["peers"]), *tables(results))
    if "interrupted" in results:
        print(f"interrupted while measuring {results['interrupted']}", file=sys.stderr)
        return INTERRUPTED
    return 0
