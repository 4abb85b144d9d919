"""Words that messages share."""

from __future__ import annotations

from heelstrike.wording import LONGEST_GUESS, meant, some_of


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
