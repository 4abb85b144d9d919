"""The tables and figures of docs/performance.md, from what was measured."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from table import markdown

from speed.machine import words
from speed.tables import tables

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "performance.md"
IMAGES = ROOT / "docs" / "images"

CAPTIONS = {
    "steps": "Microseconds a step of heelstrike and of other engines",
    "precision": "Error in joint positions after 1 s of walking over computing time",
    "threads": "Steps a second by number of threads",
    "scaling": "Microseconds a step by number of joints and of contact points",
}


PARTS = ("steps", "stops", "precision", "threads", "scaling", "footprint", "endurance", "laws")
"""Parts that have a place in the page."""


def blocks(results: dict[str, Any], folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the blocks of the page by name."""
    about = words(results["machine"], results["peers"])
    yield "machine", f"Measured {results['date'][:10]} on {about}"
    for part in PARTS:
        if part not in results:
            continue
        made = list(tables({part: results[part]}))
        if part == "precision":
            made = made[1:]  # the points are in the figure
        text = "\n\n".join(each.markdown() for each in made)
        figure = f"benchmark_{part}.png"
        if (folder / figure).is_file():
            shutil.copyfile(folder / figure, IMAGES / figure)
            text += f"\n\n![{CAPTIONS[part]}](images/{figure})"
        yield part, text
    yield "instructions", instructions()


def instructions() -> str:
    """Return the table of the counts that are kept."""
    kept = json.loads((ROOT / "benchmarks" / "instructions.json").read_text())
    beside = {name: f"{times:.2f}" for name, times in kept["times_sticking"].items()}
    counts = markdown(
        ["scenario", "instructions a step", "multiple of its counterpart"],
        [
            [name, f"{count:.0f}", beside.get(name, "")]
            for name, count in kept["instructions_a_step"].items()
        ],
    )
    return "\n".join(counts)


def put(blocks: Iterable[tuple[str, str]]) -> None:
    """Write blocks by name into the page."""
    page = PAGE.read_text(encoding="utf-8")
    for name, text in blocks:
        pattern = re.compile(rf"(<!-- benchmark: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page, found = pattern.subn(lambda match, text=text: f"{match[1]}{text}\n{match[2]}", page)
        if found != 1:
            sys.exit(f"{PAGE} has {found} places for {name}")
    PAGE.write_text(page, encoding="utf-8")
    print(f"filled {PAGE}")


def fill(folder: Path) -> None:
    """Rewrite the page from the results in a folder."""
    results = json.loads((folder / "benchmark.json").read_text(encoding="utf-8"))
    if results["quick"] or "interrupted" in results:
        sys.exit("these are not all results: run it in full")
    put(blocks(results, folder))
