"""What else the machine does."""

from __future__ import annotations

import math
import os
from pathlib import Path

import machine
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_the_load_is_told_where_the_system_counts_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (2.5, 1.0, 0.5), raising=False)
    assert machine.load() == 2.5
    monkeypatch.delattr(os, "getloadavg")
    assert math.isnan(machine.load())


def test_benchmarks_ask_nobody_else_for_it() -> None:
    asking = [path.name for path in BENCHMARKS.rglob("*.py") if "os.getloadavg" in path.read_text()]
    assert asking == ["machine.py"]
