"""Fill the tables and figures of docs/performance.md from what `heelstrike bench` wrote.

Run: python benchmarks/performance_page.py [bench]
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table

from heelstrike.experiments.benchmark.tables import tables

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "performance.md"
IMAGES = ROOT / "docs" / "images"

CAPTIONS = {
    "steps": "Microseconds a step of heelstrike and of other engines",
    "precision": "Error in joint positions after 1 s of walking over computing time",
    "threads": "Steps a second by number of threads",
    "scaling": "Microseconds a step by number of joints and of contact points",
}


def markdown(table: Table) -> str:
    """Return a table of the terminal as one of the page."""
    rows = [[str(column.header) for column in table.columns]]
    rows += zip(*(list(column.cells) for column in table.columns), strict=True)
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    rule = [":---" if column.justify == "left" else "---:" for column in table.columns]
    lines.insert(1, "|" + "|".join(rule) + "|")
    return f"*{table.title}*\n\n" + "\n".join(lines)


def blocks(results: dict[str, Any], folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the blocks of the page by name."""
    about = results["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    peers = "; ".join(f"{name} {state}" for name, state in results["peers"].items())
    yield (
        "machine",
        f"Measured {results['date'][:10]} on {about['processor']} ({about['processors']} "
        f"processors), {about['system']}, Python {about['python']}, {versions}. Peers: {peers}.",
    )
    for part in ("steps", "precision", "threads", "scaling", "footprint", "endurance"):
        if part not in results:
            continue
        made = list(tables({part: results[part]}))
        if part == "precision":
            made = made[1:]  # the points are in the figure
        text = "\n\n".join(markdown(table) for table in made)
        figure = f"benchmark_{part}.png"
        if (folder / figure).is_file():
            shutil.copyfile(folder / figure, IMAGES / figure)
            text += f"\n\n![{CAPTIONS[part]}](images/{figure})"
        yield part, text
    kept = json.loads((ROOT / "benchmarks" / "instructions.json").read_text())
    beside = {name: f"{times:.2f}" for name, times in kept["times_sticking"].items()}
    lines = ["| scenario | instructions a step | times those of sticking |", "|:---|---:|---:|"]
    lines += [
        f"| {name} | {number:.0f} | {beside.get(name, '')} |"
        for name, number in kept["instructions_a_step"].items()
    ]
    yield "instructions", "\n".join(lines)


def main() -> None:
    """Rewrite the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("bench"))
    folder = parser.parse_args().folder
    results = json.loads((folder / "benchmark.json").read_text(encoding="utf-8"))
    if results["quick"]:
        parser.error("these are the results of the quick form; run `heelstrike bench` in full")
    page = PAGE.read_text(encoding="utf-8")
    for name, text in blocks(results, folder):
        pattern = re.compile(rf"(<!-- benchmark: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page, found = pattern.subn(lambda match, text=text: f"{match[1]}{text}\n{match[2]}", page)
        if found != 1:
            raise RuntimeError(f"{PAGE} has {found} places for {name}")
    PAGE.write_text(page, encoding="utf-8")
    print(f"filled {PAGE}")


if __name__ == "__main__":
    main()
