"""The page counts what the results say."""

from __future__ import annotations

from typing import Any

from scenes.table import page, reason, seed_words


def result(seed: int, status: str = "completed", **laws: float) -> dict[str, Any]:
    return {
        "method": "event_driven",
        "seed": seed,
        "kind": "ordinary",
        "status": status,
        "message": f"the run could not go on at t = 0.{seed} s: too short",
        "worst": {"balance": laws.get("balance", 1e-9)},
        "figures": {"penetration": 0.0},
        "objections": [
            {"law": law, "size": size, "tolerance": 1e-6, "time": 0.1, "where": "", "count": 1}
            for law, size in laws.items()
        ],
        "simulated_s": 0.5,
    }


def row(text: str, heading: str) -> list[str]:
    lines = text[text.index(heading) :].splitlines()
    (line,) = (line for line in lines[:8] if line.startswith("| event_driven"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_counts() -> None:
    hang = {"method": "event_driven", "seed": 9, "status": "hang", "message": "more than 30 s"}
    text = page(
        [
            result(0),
            result(1, balance=0.2, teleport=0.5),
            result(2, balance=1e-5),
            result(3, "diverged", penetration=0.1),
            hang,
        ],
        "the command",
    )
    ends = row(text, "## How the runs end")
    assert ends[1:3] == ["5", "0–3, 9"]
    assert ends[3:10] == ["3", "1", "0", "0", "1", "0", "0"]
    assert ends[10:] == ["60.0 %", "2 s"]
    found = row(text, "## What the judge found")
    assert found[1:9] == ["4", "1", "1 (1)", "2 (1)", "0", "1 (1)", "0", "0"]
    assert "diverged: the run could not go on: too short: 3" in text
    assert "hang: more than … s: 9" in text
    assert "- **event_driven**, balance, 1: 1" in text
    assert "    the command" in text


def test_words() -> None:
    assert seed_words([5, 1, 2, 3, 9]) == "1–3, 5, 9"
    assert reason(result(7, "diverged")) == "diverged: the run could not go on: too short"
