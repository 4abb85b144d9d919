"""The page about the paper: its figures, its claims, steps and schemes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import heelstrike
from heelstrike.analysis import summarize
from heelstrike.experiments.claims import Claim
from heelstrike.experiments.evidence import STEPS, TIME_STEP, Evidence
from heelstrike.experiments.refinement import EXACT_STEP, Convergence, RefinedWalk
from heelstrike.whole_file import write_whole

CITATION = (
    "D. A. Bravo M. and C. F. Rengifo Rodas, *Design of a Dynamic Simulator for a Biped Robot*, "
    "[Modelling and Simulation in Engineering, vol. 2021, 5539123]"
    "(https://doi.org/10.1155/2021/5539123)"
)

FIGURES = (
    ("figure3", "tracking", "Figure 3. Tracking of the reference motion."),
    ("figure4", "velocities", "Figure 4. Tracking of the velocity reference motion."),
    (
        "figure5",
        "zmp",
        "Figure 5. Position of the zero moment point under computed torque. The dashed lines are "
        "the boundaries of the sole.",
    ),
    ("figure6", "friction", "Figure 6. Tangential force, |F_t(t)| ≤ μ F_n(t)."),
)
"""File, drawing of :func:`heelstrike.view.plot`, and caption of the paper's figures."""


def page(evidence: Evidence, claims: Sequence[Claim]) -> str:
    """Write the page in Markdown; its figures lie beside it."""
    return "\n\n".join(
        (
            "# The paper, computed",
            f"{CITATION}.",
            _setting(evidence),
            "## Figures",
            *(f"![{caption}]({name}.png)\n\n*{caption}*" for name, _, caption in FIGURES),
            "## Claims",
            _tally(claims),
            _claims(claims),
            "## Steps and schemes",
            f"The same gait, {STEPS} steps, with the default scheme of time stepping and with the "
            "paper's two: its eq. 23 as printed, which is explicit, and the symplectic method that "
            "its text names. Margin: least distance of the zero moment point to the ends of the "
            "sole; zero means that the foot tipped.",
            _refinement(evidence.refinement),
            "Largest difference of a coordinate (m, rad) from a motion computed with a step of "
            f"{1e3 * EXACT_STEP:g} ms, shortly before the first foot lands:",
            _convergence(evidence.convergence),
            "",
        )
    )


def save_page(evidence: Evidence, claims: Sequence[Claim], directory: Path) -> Path:
    """Write report.md."""
    return write_whole(directory / "report.md", page(evidence, claims))


def _setting(evidence: Evidence) -> str:
    run, gait, robot = evidence.run, evidence.gait, evidence.robot
    summary = summarize(run, gait=gait)
    return (
        f"heelstrike {heelstrike.__version__}, robot {robot.name}: {robot.total_mass:g} kg, "
        f"{robot.nv} coordinates, {robot.nu} actuators, {robot.nc} contact points. The paper does "
        f"not print masses, step length or step duration; this robot is completed from human "
        f"anthropometry and takes steps of {gait.step_length:g} m in {gait.step_duration:g} s. "
        f"{summary.steps} steps, time step {1e3 * TIME_STEP:g} ms, μ = "
        f"{run.ground.friction:g}, restitution {run.ground.restitution:g}: {run.message}."
    )


def _tally(claims: Sequence[Claim]) -> str:
    hold = sum(claim.holds for claim in claims)
    return f"Of {len(claims)} claims {hold} hold here; each is judged by the criterion beside it."


def _claims(claims: Sequence[Claim]) -> str:
    rows = [
        (
            claim.source,
            claim.statement,
            f"{claim.measured}. {claim.remark}".rstrip(),
            claim.criterion,
            f"**{claim.verdict}**",
        )
        for claim in claims
    ]
    return _table(("where", "the paper", "computed here", "criterion", "verdict"), rows)


def _refinement(rows: Sequence[RefinedWalk]) -> str:
    figures = {
        "steps walked": "steps",
        "tracking rad rms": "tracking_rms_rad",
        "margin m": "zmp_margin_min_m",
        "slip m": "slip_max_m",
        "penetration m": "penetration_max_m",
    }
    return _table(
        ("scheme", "step ms", "ended", *figures, "× real time"),
        [
            (
                row.scheme.label,
                f"{1e3 * row.step:g}",
                row.summary.status.replace("_", " "),
                *(_number(getattr(row.summary, name)) for name in figures.values()),
                f"{row.summary.real_time_factor:.0f}",
            )
            for row in rows
        ],
    )


def _convergence(found: Sequence[Convergence]) -> str:
    steps = found[0].steps if found else ()
    return _table(
        ("scheme", *(f"{1e3 * step:g} ms" for step in steps), "order", "off the ground"),
        [
            (
                each.scheme.label,
                *map(_number, each.errors),
                "–" if each.lost else f"{each.order:.2f}",
                f"{100.0 * each.lost:.2g} %",
            )
            for each in found
        ],
    )


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heading, ["---"] * len(heading), *rows]
    return "\n".join(
        f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines
    )


def _number(value: float) -> str:
    if isinstance(value, int):
        return str(value)
    return f"{value:.2g}" if math.isfinite(value) else "–"
