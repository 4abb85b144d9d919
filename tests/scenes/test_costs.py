"""Scenes whose contact problems are awkward at steps of 1e-5 s cost no search in every step.

What they cost is measured by ``python benchmarks/scenes costs``; here it is counted.
"""

from __future__ import annotations

import math

import pytest
from scenes.costs import AWKWARD, SHORT, run_awkward, share_between
from scenes.methods import Setting
from scenes.scene import random_scene

from heelstrike.sim import EventKind

BETWEEN, *WEDGES = AWKWARD


def test_what_is_certified_is_accepted() -> None:
    run, _ = run_awkward(BETWEEN, SHORT)
    assert run.completed
    assert share_between(run) >= 0.3
    assert run.residual.max() <= 1e-9
    solver = run.solver
    assert (solver.fallbacks, solver.failures, solver.combinations) == (0, 0, 0)


@pytest.mark.parametrize("one", WEDGES, ids=lambda one: one.name)
def test_a_wedge_that_lasts_is_asked_what_answered_last(one: object) -> None:
    """The strict problem is asked when the wedge is 0, 1, 2, 4, ... steps old, and what is asked
    for less is told and counted."""
    run, _ = run_awkward(one, SHORT, 0.02)
    told = [event for event in run.events if event.kind is EventKind.WEDGED]
    assert run.completed
    assert len(told) >= 1
    assert run.solver.relaxed >= 100
    assert 1 <= run.solver.failures <= len(told) * (2 + math.log2(run.solver.relaxed))
    assert run.certificates.penetration <= 1e-9


def test_what_turns_in_a_wedge_does_not_sink() -> None:
    """Friction on the floor and on a wall lets nothing out; a way without friction leads out.

    Turning takes it in by h² ω² l / 2 a step, 0.1 mm here; over the 129 steps it would be 8 mm.
    """
    run = Setting.of(random_scene(12001)).run("impact_resolved")
    assert run.completed
    assert run.solver.relaxed >= 50
    assert run.certificates.penetration <= 2e-4
