"""What counts as a line of code."""

from __future__ import annotations

from pathlib import Path

import pytest
from lines import code_lines, counted

TEXT = '''"""A module,
in two lines."""

import math  # counts

SIZE = 1.0
"""What is said of a number."""


def area(
    radius: float,
) -> float:
    """Return it."""
    # why
    words = """two
lines"""
    return math.pi * radius**2 * len(words)
'''


def test_what_counts_as_a_line_of_code(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text(TEXT, encoding="utf-8")
    assert code_lines(file) == 2 + 3 + 2 + 1


@pytest.mark.slow
def test_rooms_by_their_depth() -> None:
    rooms, folders = counted(1), counted(2)
    assert sum(code for code, _ in rooms.values()) == sum(code for code, _ in folders.values())
    assert all(0 <= code <= every for code, every in rooms.values())
    assert rooms["cli"][0] == sum(c for name, (c, _) in folders.items() if name.startswith("cli/"))
