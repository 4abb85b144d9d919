"""Words that messages share."""

from __future__ import annotations

import re
from pathlib import Path

from heelstrike.wording import LONGEST_GUESS, counted, meant, some_of


def test_one_thing_is_not_many() -> None:
    assert counted(1, "contact problem", "contact problems") == "1 contact problem"
    assert counted(0, "step", "steps") == "0 steps"
    assert counted(2, "step", "steps") == "2 steps"


def test_some_of_many_things_are_named_and_the_others_counted() -> None:
    assert some_of(["a", "b", "c"], 2) == "a, b and 1 more"
    assert some_of(["a", "b", "c"], 1, "; ") == "a; and 2 more"
    assert some_of(["a", "b"], 2) == "a, b"
    assert some_of([], 2) == ""


def test_a_misspelt_name_is_guessed() -> None:
    assert meant("wakl", ["walk", "stand"]) == " Did you mean 'walk'?"
    assert meant("slpoe", {"slope": "slope:DEGREES"}) == " Did you mean slope:DEGREES?"
    assert meant("mas", {"mass": "<mass>"}, " ({}?)") == " (<mass>?)"
    assert meant("x" * 10_000_000, ["walk"]) == ""
    assert meant("walk" + " " * 2 * LONGEST_GUESS, ["w" * LONGEST_GUESS]) == ""


FORBIDDEN = {
    r"\bhangs? on\b": "depends on; is attached to",
    r"\banew\b": "again",
    r"\bfor ever\b": "forever",
    r"\bseen and touched\b": "live viewer",
    r"\bways? through time\b": "simulation method",
    r"\bbe rid of\b": "delete",
    r"\bgone on with\b": "continued, resumed",
    r"\bor worse, the\b": "or if the process is killed",
    r"\bwhat it comes to is\b": "with the same result",
    r"\bas it comes \|": "default",
    r"\bstands? against\b": "is wrong with",
    r"\bbegins? afresh at\b": "restarts",
    r"\bhow to hurry\b": "say what is slow",
    r"\bdo(es)? not mind\b": "works with",
    r"\bwhat people do\b": "follow a person",
    r"\bto be least\b": "minimised",
    r"\bis no whole number\b": "is not a whole number, is not a multiple of",
    r"\b1 contact problems\b": "1 contact problem",
    r"\bbegun again\b": "run again to resume",
    r"\bwhose twins\b": "the same, without the cause",
    r"\bfells it\b": "makes it fall",
    r"\blooks? at the gap alone\b": "tests only whether the gap is closed",
}
"""Phrases that readers stumbled over, and what to write instead."""


def test_no_page_and_no_message_has_a_phrase_that_readers_stumbled_over() -> None:
    root = Path(__file__).resolve().parent.parent
    texts = [root / "README.md", root / "CONTRIBUTING.md", *(root / "docs").rglob("*.md")]
    texts += (root / "src").rglob("*.py")
    read = {text.relative_to(root): text.read_text(encoding="utf-8") for text in texts}
    found = [
        f"{name}: {match[0]!r}, write {instead!r}"
        for name, text in read.items()
        for phrase, instead in FORBIDDEN.items()
        for match in re.finditer(phrase, text, re.IGNORECASE)
    ]
    assert found == []
