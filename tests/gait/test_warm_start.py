"""A gait that is started near another one is the one that is found from afar."""

from __future__ import annotations

from dataclasses import replace

import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait import design, program
from heelstrike.gait.optimize import request_of
from heelstrike.gait.program import Program, first_instants
from heelstrike.gait.refinement import solved_again
from heelstrike.gait.request import Request
from heelstrike.gait.starts import starts
from heelstrike.gait.transcription import transcribed

STEPS = {
    "bravo7": {"step_length": 0.30, "step_duration": 0.70},
    "rabbit": {"step_length": 0.25, "step_duration": 0.60},
}


@pytest.mark.parametrize("name", STEPS)
def test_the_neighbour_of_a_gait(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No other start is tried, and the optimum is the same."""
    robot, step = hs.load_robot(name), STEPS[name]
    near = hs.optimize_gait(robot, **step, starts=1)
    asked = step | {"step_length": 1.04 * step["step_length"], "slope": 0.01, "starts": 1}
    afar = hs.optimize_gait(robot, **asked)
    monkeypatch.setattr(design, "starts", None)
    found = hs.optimize_gait(robot, **asked, warm_start=near)
    assert found.cost == pytest.approx(afar.cost, rel=1e-6)
    assert found.cost != pytest.approx(near.cost, rel=1e-2)
    assert found.step_length == asked["step_length"]


def test_neighbours_on_flat_feet_need_no_ipopt(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, step = hs.load_robot("bravo7"), STEPS["bravo7"]
    near = hs.optimize_gait(robot, **step, starts=1)
    monkeypatch.setattr(program, "Ipopt", None)
    for slope in (-0.02, 0.02):
        assert hs.optimize_gait(robot, **step, slope=slope, warm_start=near).optimal


def test_the_coarse_grid_leads_to_the_optimum_on_the_whole_one() -> None:
    robot = hs.load_robot("bravo7")
    request = request_of(robot, **STEPS["bravo7"], starts=1)
    whole = Program(request, transcribed(request), request.profiles[0], *first_instants(request))
    rough = program.coarse(whole)
    assert rough.instants.share.size < 0.6 * whole.instants.share.size
    guess = rough.sampled(next(iter(starts(request))))
    expected, found = whole.solve(guess), solved_again(whole, rough.solve(guess).unknowns)
    assert found.converged
    assert found.objective == pytest.approx(expected.objective, rel=1e-7)
    assert abs(whole.violations(found.unknowns)).max() < 2e-8
    coarsest = replace(request, intervals=12)
    few = Program(coarsest, whole.transcription, whole.profile, *first_instants(coarsest))
    assert program.coarse(few) is few


@pytest.mark.parametrize("name", STEPS)
def test_a_gait_is_resampled_as_it_is(name: str) -> None:
    """On its own mesh, a gait is a point that satisfies its own constraints."""
    robot, step = hs.load_robot(name), STEPS[name]
    gait = hs.optimize_gait(robot, **step, starts=1)
    request = Request(
        robot=robot, **step, speed=None, friction=0.75, clearance=0.03, zmp_margin=None,
        clearance_profile=gait.clearance_profile, force_margin=None, impact=True, intervals=None,
        joint_speed_limit=float("inf"), joint_ranges=None, starts=1,
    )  # fmt: skip
    own = Program(request, transcribed(request), gait.clearance_profile, *first_instants(request))
    unknowns = own.resampled(gait)
    assert abs(own.violations(unknowns)).max() < 1e-6
    assert own.effort(unknowns) == pytest.approx(gait.cost, rel=1e-9)


def test_the_neighbour_of_a_gait_keeps_its_profile() -> None:
    """Without it, the parabola that led nowhere for the known gait is tried again."""
    robot, step = hs.load_robot("rabbit"), STEPS["rabbit"]
    flat = hs.optimize_gait(robot, **step, starts=1, clearance_profile="smooth")
    asked = step | {"step_length": 1.04 * step["step_length"]}
    assert request_of(robot, **asked, warm_start=flat).profiles == (
        hs.gait.ClearanceProfile.SMOOTH,
    )
    assert len(request_of(robot, **asked).profiles) == 2
    found = hs.optimize_gait(robot, **asked, starts=1, warm_start=flat)
    assert found.clearance_profile is hs.gait.ClearanceProfile.SMOOTH


def test_another_robots_gait_is_refused(bravo7: hs.Robot) -> None:
    rabbit = hs.optimize_gait(hs.load_robot("rabbit"), **STEPS["rabbit"], starts=1)
    with pytest.raises(GaitError, match="moves the joints"):
        hs.optimize_gait(bravo7, **STEPS["bravo7"], warm_start=rabbit)
