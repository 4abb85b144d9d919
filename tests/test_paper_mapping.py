"""The page about the paper covers all of it and names only what exists."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "paper.md").read_text(encoding="utf-8")
NAMES = sorted(set(re.findall(r"`(heelstrike(?:\.\w+)+)`", PAGE)))


@pytest.mark.parametrize("name", NAMES)
def test_name_exists(name: str) -> None:
    pkgutil.resolve_name(name)


def test_every_equation_is_accounted_for() -> None:
    rows = re.findall(r"^\| ((?:\(\d+\)[, –]*)+) \|", PAGE, re.MULTILINE)
    covered: set[int] = set()
    for row in rows:
        for first, last in re.findall(r"\((\d+)\)(?:–\((\d+)\))?", row):
            covered |= set(range(int(first), int(last or first) + 1))
    assert covered == set(range(1, 46))


@pytest.mark.parametrize("item", [*(f"Figure {number}" for number in range(1, 7)), "Table 1"])
def test_every_figure_and_table_is_accounted_for(item: str) -> None:
    assert re.search(rf"^\| {item} \|", PAGE, re.MULTILINE)
