"""Command line of the random scenes.

    python benchmarks/scenes run --out scenes.jsonl --methods event_driven --seeds 0:300
    python benchmarks/scenes page scenes.jsonl --out benchmarks/scenes/baseline.md
    python benchmarks/scenes show event_driven 38
    python benchmarks/scenes run --out tied.jsonl --family tied --seeds 0:100
    python benchmarks/scenes energy --seeds 4000:4100
    python benchmarks/scenes costs

`run` goes on where a file of results ends; `show` judges one scene and prints what is wrong. Of
the family `tied` scenes have closed loops, coupled joints, latches and brakes (scenes/ties);
`--family space` draws robots in space (scenes/space), for the methods that these have.
`energy`, `twins`, `orders` and `bridges` put one question each to many scenes (scenes/checks):
a line of JSON a scene, then what they add up to; with --out FILE they go on where it ends, too.
`costs` measures a step in scenes whose contact problems are awkward, at 1e-5 s and at 1e-3 s.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from functools import partial
from pathlib import Path

# Run as a folder, its modules would be on the path and not the package.
sys.path[0] = str(Path(__file__).resolve().parent.parent)

from scenes.campaign import Task, add_arguments, campaign, results_in  # noqa: E402
from scenes.checks.commands import CHECKS, check  # noqa: E402
from scenes.costs import costs  # noqa: E402
from scenes.methods import METHODS  # noqa: E402
from scenes.running import FAMILIES, SPACE, prepare, run_scene  # noqa: E402
from scenes.space.running import SCHEMES  # noqa: E402
from scenes.table import page  # noqa: E402


def main() -> None:
    """Run a campaign, write its page, or show one scene."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="run scenes and append what comes out to a file")
    add_arguments(run, 300, kept=True, of="methods", choices=METHODS)
    run.add_argument("--without-twins", action="store_true")
    families = (*FAMILIES, SPACE)
    run.add_argument("--family", choices=families, default="free", help="tied: loops, brakes …")
    sums = commands.add_parser("page", help="sum a file of results up")
    sums.add_argument("results", type=Path)
    sums.add_argument("--out", type=Path)
    sums.add_argument("--written-by", default="python benchmarks/scenes run", help="the command")
    show = commands.add_parser("show", help="run and judge one scene")
    show.add_argument("method", choices=METHODS)
    show.add_argument("seed", type=int)
    show.add_argument("--family", choices=families, default="free")
    for name, (_, words) in CHECKS.items():
        asks = commands.add_parser(name, help=words)
        add_arguments(asks, 100, kept=False)
    commands.add_parser("costs", help="measure a step where contact problems are awkward")
    options = parser.parse_args()
    if options.command in CHECKS:
        with tempfile.TemporaryDirectory() as folder:
            out = options.out or Path(folder) / "results.jsonl"
            check(options.command, options.seeds, out, options.workers)
    elif options.command == "run":
        twins = not options.without_twins
        others = {one.get("family", "free") for one in results_in(options.out)}
        if others - {options.family}:
            parser.error(f"{options.out} has scenes of another family: {', '.join(sorted(others))}")
        known = set(SCHEMES) if options.family == SPACE else set(METHODS)
        if not known.intersection(options.methods):
            parser.error(
                f"no method of {', '.join(options.methods)} takes scenes of family "
                f"{options.family}: there {'are' if len(known) > 1 else 'is'} "
                f"{', '.join(sorted(known))}"
            )
        for one in campaign(
            options.out,
            [name for name in options.methods if name in known],
            options.seeds,
            workers=options.workers,
            task=Task(
                partial(run_scene, family=options.family), partial(prepare, family=options.family)
            ),
            twins=twins,
        ):
            found = one.get("objections", []) + one.get("twins", {}).get("objections", [])
            words = "; ".join(f"{o['law']} {o['size']:.1e}" for o in found)
            print(f"{one['method']} {one['seed']}: {one['status']}. {words}", flush=True)
    elif options.command == "costs":
        for row in costs():
            print(json.dumps(row), flush=True)
    elif options.command == "page":
        text = page(results_in(options.results), options.written_by)
        if options.out is None:
            print(text)
        else:
            options.out.write_text(text)
    else:
        print(json.dumps(run_scene(options.method, options.seed, family=options.family), indent=2))


if __name__ == "__main__":
    main()
