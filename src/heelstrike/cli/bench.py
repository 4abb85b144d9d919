"""``heelstrike bench``: how fast it is, beside the engines that are installed."""

from __future__ import annotations

import json
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.terminal import (
    Debug,
    messages,
    output,
    spoken,
    stage,
    tell,
    tell_interruption,
    wrote,
)


class Part(StrEnum):
    """Parts of the suite."""

    STEPS = "steps"
    PRECISION = "precision"
    THREADS = "threads"
    SCALING = "scaling"
    FOOTPRINT = "footprint"
    ENDURANCE = "endurance"


@spoken
def bench(
    part: Annotated[
        list[Part] | None, typer.Option(help="Run this part only; repeat the option for more.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Less than a minute: good for a look, not for figures.")
    ] = False,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Directory for benchmark.json and the figures.")
    ] = Path("bench"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """Measure speed and precision beside the other engines that are installed.

    Every engine simulates the same robots with the same contacts and law of control in the same
    run, in turn; a run counts only if it is physically valid.
    """
    with stage("loading", when_slow="(compiling, once)") as current, ExitStack() as stack:
        from heelstrike.experiments.benchmark import run_benchmark
        from heelstrike.experiments.benchmark.engines import NOT_INSTALLED, output_diverted, peers

        stack.enter_context(output_diverted())
        missing = [name for name, state in peers().items() if state == NOT_INSTALLED]
        if missing and not as_json:
            tell(f"{NOT_INSTALLED}, so not compared with: {', '.join(missing)}")
        benchmark = run_benchmark(quick=quick, parts=part, progress=current.doing)
        files = benchmark.save(out)
        wrote(*files)
    if as_json:
        typer.echo(json.dumps(benchmark.to_dict(), indent=2))
    else:
        output().print(benchmark)
    if benchmark.interrupted:
        tell_interruption(f"measuring {benchmark.interrupted}")
        raise typer.Exit(INTERRUPTED)
    messages().print(f"in {out}: {', '.join(file.name for file in files)}")
