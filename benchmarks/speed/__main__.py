"""Speed and precision of heelstrike beside the other engines that are installed.

    python benchmarks/speed run [--part steps ...] [--quick] [--out bench]
    python benchmarks/speed page [bench]

Every engine simulates the same robots with the same contacts and law of control in the same run,
in turn; a run counts only if it is physically valid. `run` prints tables and writes benchmark.json
and figures; `page` fills docs/performance.md from them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

# Run as a folder, its modules would be on the path and not the package.
sys.path[0] = str(Path(__file__).resolve().parent.parent)

from speed.page import fill  # noqa: E402
from speed.suite import PARTS, run  # noqa: E402

parser = argparse.ArgumentParser(
    prog="benchmarks/speed",
    description=__doc__,
    formatter_class=argparse.RawDescriptionHelpFormatter,
)
commands = parser.add_subparsers(dest="command", required=True)
runs = commands.add_parser("run", help="measure")
runs.add_argument("--part", nargs="+", choices=list(PARTS), default=list(PARTS), help="these only")
runs.add_argument("--quick", action="store_true", help="good for a look, not for figures")
runs.add_argument("--out", type=Path, default=Path("bench"), help="folder of the results")
page = commands.add_parser("page", help="fill docs/performance.md")
page.add_argument("results", type=Path, nargs="?", default=Path("bench"))
options = parser.parse_args()
if options.command == "page":
    fill(options.results)
else:
    sys.exit(run(options.part, quick=options.quick, out=options.out))
