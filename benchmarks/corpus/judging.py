"""What becomes of published files: loaded, judged by another engine, told on a page."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from corpus.clones import Published, published, row

Floats = NDArray[np.float64]

HEAD = ("| file | robot, or why it is refused | judge | difference |", "|---|---|---|---|")

LEAST = 1e-12
"""Entries that are all smaller are compared with this."""


@dataclass
class Outcome:
    """What became of one file.

    Attributes
    ----------
    robot : Published
        The file.
    summary : str
        The robot in words, or the reason of its refusal.
    loaded : bool
        Whether it loads.
    engine : str
        Who judged it.
    difference : float
        Largest difference from that engine, as a share of the largest entry; NaN if nobody judged.
    said : str
        What is to be known of the comparison, or why there is none.
    seconds : float
        Processor time to load it.
    """

    robot: Published
    summary: str
    loaded: bool
    engine: str = ""
    difference: float = np.nan
    said: str = ""
    seconds: float = 0.0

    @property
    def is_judged(self) -> bool:
        """Whether another engine was asked."""
        return self.loaded and not np.isnan(self.difference)

    def line(self, said: str) -> str:
        """Return its row of the page; `said` is who judged it, or why nobody did."""
        words = self.summary if self.loaded else f"**refused**: {self.summary}"
        number = "" if np.isnan(self.difference) else f"{self.difference:.1g}"
        return row(self.robot.link, words, said, number)


Judge = Callable[[Published, Path, Path], Outcome]
"""What loads a file, found in a folder of clones, with a folder for scratch."""


def refused(robot: Published, error: Exception, path: Path, scratch: Path) -> Outcome:
    """Return the outcome of a file that does not load, in words without folders."""
    words = str(error).replace(str(path), path.name)
    for folder in (path.resolve().parent, scratch.resolve(), scratch):
        words = words.replace(f"{folder}{os.sep}", "")
    return Outcome(robot, words, loaded=False)


def shortened(reason: Exception) -> str:
    """Return why an engine could not judge, in one line."""
    return " ".join(str(reason).split())[:160]


def text_of(path: Path, options: dict[str, Any]) -> str:
    """Return a file as other engines read it: macros of xacro are expanded."""
    if "xacro" not in options:
        return path.read_text(encoding="utf-8", errors="replace")
    from heelstrike.robot.files.ros.xacro import expanded  # the same macros, by the package xacro

    given = options["xacro"]
    return expanded(path, given if isinstance(given, dict) else {}, (), str(path))


def share(ours: Any, theirs: Any) -> float:
    """Return the largest difference of two answers, as a share of the largest entry of theirs."""
    size = max(float(np.abs(theirs).max()), LEAST)
    return float(np.abs(ours - theirs).max()) / size


def counts(outcomes: list[Outcome], tolerance: float) -> tuple[int, int, int]:
    """Return how many load, how many of these are judged, and how many of these are equal."""
    judged = [each.difference for each in outcomes if each.is_judged]
    equal = [difference for difference in judged if difference <= tolerance]
    return sum(each.loaded for each in outcomes), len(judged), len(equal)


def judge_all(
    description: str,
    judge: Judge,
    page: Callable[[list[Outcome]], str],
    tolerance: float,
    kinds: Iterable[str] = (),
) -> int:
    """Judge the corpus as the command line says; return 1 if a robot is not the one of its file.

    Of several `kinds` of robots the command line chooses one, the first by default.
    """
    kinds = tuple(kinds)
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("clones", type=Path)
    parser.add_argument("--scratch", type=Path, required=True)
    parser.add_argument("--only", default="")
    parser.add_argument("--page", type=Path)
    if kinds:
        parser.add_argument("--kind", default=kinds[0], choices=kinds)
    given = parser.parse_args()
    given.scratch.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for robot in published():
        wanted = given.only in f"{robot.repository}/{robot.path}"
        if wanted and (not kinds or robot.kind == given.kind):
            one = judge(robot, given.clones, given.scratch)
            outcomes.append(one)
            print(
                f"{'ok     ' if one.loaded else 'REFUSED'} {one.difference:8.1g} {one.engine:10} "
                f"{one.seconds:4.1f}s {robot.repository} {robot.path}: {one.summary[:150]} "
                f"{one.said}",
                flush=True,
            )
    if given.page:
        given.page.write_text(page(outcomes), encoding="utf-8")
    return int(any(one.difference > tolerance for one in outcomes))
