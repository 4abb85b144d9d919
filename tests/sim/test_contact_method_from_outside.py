"""A contact method of somebody else's, with stops, friction, loops and brakes at its disposal."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path
from typing import Any

import impulse_method
import numpy as np
import pytest
from impulse_method import Impulses
from scenes.running import FAMILIES

import heelstrike as hs
from heelstrike.sim import Scheme

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

MOST_LINES = 120
"""What such a method may take."""

SPAN = 0.15
"""Seconds of a comparison: the two round differently, and contacts make more of that."""


def lines_of_code(path: Path) -> int:
    """How many lines are neither blank nor comments nor docstrings."""
    source = path.read_text("utf-8")
    said: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                said |= set(range(first.lineno, (first.end_lineno or 0) + 1))
    silent = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in (*silent, tokenize.ENDMARKER):
            code |= set(range(token.start[0], token.end[0] + 1))
    return len(code - said)


def run_of(seed: int, method: Any) -> hs.Run:
    scene = FAMILIES["tied"](seed)
    robot = scene.robot()
    joints = tuple(link.name for link in scene.links)
    return hs.simulate(
        robot, scene.controller(robot), state=scene.state(robot), duration=SPAN, method=method,
        ground=scene.ground(restitution=False), braked=scene.ties.braked(0.0, joints),
        stop_when_fallen=False,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_it_agrees_with_the_papers_ordering(seed: int) -> None:
    """Random robots with loops, couplings, latches, brakes, dry friction and stops."""
    ours = run_of(seed, hs.TimeStepping(step=1e-3, scheme=Scheme.PAPER_SYMPLECTIC))
    theirs = run_of(seed, Impulses(step=1e-3))
    assert theirs.status is ours.status
    np.testing.assert_allclose(theirs.position, ours.position, atol=1e-9)
    np.testing.assert_allclose(theirs.velocity, ours.velocity, atol=1e-7)
    for name in ("contact_force", "stop_torque", "friction_torque", "loop_force", "brake_torque"):
        force, same = getattr(theirs, name), getattr(ours, name)
        np.testing.assert_allclose(force, same, atol=1e-6 * (1.0 + np.abs(same).max(initial=0.0)))
    assert [event.kind for event in theirs.events] == [event.kind for event in ours.events]


def test_it_takes_few_lines() -> None:
    assert 50 < lines_of_code(Path(impulse_method.__file__)) <= MOST_LINES
