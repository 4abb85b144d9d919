"""The page about the paper: its simulations, its claims, its text."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.experiments.claims import CLAIMS, Claim, Verdict, judge
from heelstrike.experiments.claims import first_order as first_order_claim
from heelstrike.experiments.claims import friction as friction_claim
from heelstrike.experiments.claims import zero_moment_point as zero_moment_point_claim
from heelstrike.experiments.evidence import STEPS, Evidence, gather
from heelstrike.experiments.refinement import SCHEMES, converge
from heelstrike.experiments.report import page
from heelstrike.sim import RunStatus, Scheme


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    # The clearance that the other robot's gait ends up with, without what is tried before.
    smooth = partial(hs.optimize_gait, clearance_profile="smooth", starts=1)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("heelstrike.experiments.walk.optimize_gait", smooth)
        return gather(lambda _doing, _part: None)


@pytest.fixture(scope="module")
def claims(evidence: Evidence) -> dict[str, Claim]:
    names = [function.__name__ for function in CLAIMS]
    return dict(zip(names, judge(evidence), strict=True))


@pytest.mark.parametrize(
    "name",
    [
        "tracking",
        "velocities",
        "zero_moment_point",
        "friction",
        "unilateral",
        "stance_foot",
        "swing_foot",
        "symmetry",
        "plastic_impact",
        "energy",
        "shock_accumulation",
        "first_order",
        "lemke",
        "cost",
    ],
)
def test_claim_holds(claims: dict[str, Claim], name: str) -> None:
    assert claims[name].verdict is Verdict.HOLDS, claims[name].measured


@pytest.mark.parametrize("name", ["small_steps", "underactuated", "other_robots"])
def test_claim_does_not_hold(claims: dict[str, Claim], name: str) -> None:
    # All schemes walk at steps that take less than real time; a flat foot leaves as many freedoms
    # as there are actuators; another robot's file is enough.
    assert claims[name].verdict is Verdict.FAILS, claims[name].measured


def test_every_claim_has_a_verdict_that_is_tested() -> None:
    asked = {
        name
        for test in (test_claim_holds, test_claim_does_not_hold)
        for name in test.pytestmark[0].args[1]  # type: ignore[attr-defined]
    }
    assert asked == {function.__name__ for function in CLAIMS}


def test_default_scheme_walks_at_both_steps(evidence: Evidence) -> None:
    walked = {row.step: row for row in evidence.refinement if row.scheme is Scheme.IMPACT_RESOLVED}
    for step, tracking in ((1e-3, 2e-3), (1e-4, 1e-3)):
        found = walked[step].summary
        assert found.status == "completed"
        assert found.steps == STEPS
        assert found.tracking_rms_rad <= tracking
        assert found.penetration_max_m <= 1e-9
        assert found.slip_max_m <= 1e-4


def test_the_paper_s_own_orderings_walk_at_a_small_step(evidence: Evidence) -> None:
    for scheme in (Scheme.PAPER_EXPLICIT, Scheme.PAPER_SYMPLECTIC):
        (row,) = [r for r in evidence.refinement if r.scheme is scheme and r.step == 1e-4]
        assert row.summary.status == "completed"
        assert row.summary.steps == STEPS


def test_order_is_that_of_made_up_errors(
    bravo7: hs.Robot, gait: hs.Gait, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And ground is lost where an end of the sole that stands carries nothing."""
    sole = list(bravo7.feet[gait.stance_foot].contacts)

    def simulate(*_: object, method: hs.TimeStepping, **__: object) -> object:
        class Made:
            status = RunStatus.COMPLETED
            position = np.array([[method.step**2]])
            contact_force = np.zeros((11, bravo7.nc, 2))

        Made.contact_force[1:, sole] = 1.0
        if method.scheme is Scheme.PAPER_EXPLICIT:
            Made.contact_force[3, sole[0]] = 0.0
        return Made()

    monkeypatch.setattr("heelstrike.experiments.refinement.simulate", simulate)
    monkeypatch.setattr("heelstrike.experiments.refinement.EXACT_STEP", 1e-12)
    found = converge(bravo7, gait, hs.Ground())
    assert [each.order for each in found] == pytest.approx([2.0] * len(SCHEMES))
    assert [each.scheme for each in found] == list(SCHEMES)
    lost = [0.1 if each.scheme is Scheme.PAPER_EXPLICIT else 0.0 for each in found]
    assert [each.lost for each in found] == pytest.approx(lost)


def test_orders_count_where_the_ground_is_kept(evidence: Evidence) -> None:
    """Whatever comes of a scheme that loses it, which rounding decides."""
    default = next(c for c in evidence.convergence if c.scheme is Scheme.IMPACT_RESOLVED)
    assert default.lost == 0.0
    for order, lost, verdict in (
        (4.9, 0.1, Verdict.HOLDS),
        (-1.0, 0.1, Verdict.HOLDS),
        (1.1, 0.0, Verdict.HOLDS),
        (1.9, 0.0, Verdict.FAILS),
    ):
        other = replace(default, scheme=Scheme.PAPER_EXPLICIT, order=order, lost=lost)
        claim = first_order_claim(replace(evidence, convergence=(default, other)))
        assert claim.verdict is verdict
        assert (f"{order:.2f}" in claim.measured) == (lost == 0.0)
    falling = replace(default, lost=0.1)
    claim = first_order_claim(replace(evidence, convergence=(falling,)))
    assert claim.verdict is Verdict.FAILS


def test_claims_can_fail(evidence: Evidence) -> None:
    run = evidence.run
    slippery = replace(evidence, run=replace(run, ground=hs.Ground(friction=0.1)))
    assert friction_claim(slippery).verdict is Verdict.FAILS
    force = run.contact_force.copy()
    force[..., 0] *= np.array([3.0, -1.0, 3.0, -1.0])  # pulls at the toes
    pulled = replace(evidence, run=replace(run, contact_force=force))
    assert zero_moment_point_claim(pulled).verdict is Verdict.FAILS


def test_page_shows_every_claim_and_figure(evidence: Evidence, claims: dict[str, Claim]) -> None:
    text = page(evidence, tuple(claims.values()))
    for claim in claims.values():
        assert claim.measured.replace("|", r"\|") in text
        assert claim.criterion.replace("|", r"\|") in text
    for number in (3, 4, 5, 6):
        assert f"(figure{number}.png)" in text
    for table in re.findall(r"(?:^\|.*\n)+", text + "\n", re.MULTILINE):
        # Cells may contain escaped bars; every row of a table has as many as its heading.
        bars = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(bars) == 1


@pytest.mark.slow
def test_command_writes_the_page(
    tmp_path: Path, evidence: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heelstrike.experiments.paper.gather", lambda _progress: evidence)
    out = tmp_path / "paper"
    result = CliRunner().invoke(app, ["paper", "--out", str(out)])
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in out.iterdir()} == {
        "report.md",
        "gait.json",
        "run.nc",
        *(f"figure{number}.png" for number in (3, 4, 5, 6)),
    }
    assert "report.md" in result.stderr
    assert "\x1b" not in result.stdout


def test_command_refuses_a_file(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.touch()
    assert CliRunner().invoke(app, ["paper", "--out", str(taken)]).exit_code == 2
