"""The paper, computed: its Figures 3 to 6 and its claims beside what is measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from heelstrike.experiments.claims import Claim, judge
from heelstrike.experiments.evidence import TIME_STEP, Evidence, gather
from heelstrike.experiments.report import FIGURES, save_page
from heelstrike.field_texts import dataclass

SHOWN_STEPS = 4
"""Walking steps that the figures show."""


@dataclass(frozen=True)
class PaperReport:
    """What :func:`reproduce_paper` found."""

    page: Path
    """The page, report.md; its figures and data lie beside it."""
    evidence: Evidence
    """The simulations."""
    claims: tuple[Claim, ...]
    """Every claim, measured and judged."""


def reproduce_paper(
    directory: Path, *, progress: Callable[[str, float], None] | None = None
) -> PaperReport:
    """Compute the paper's Figures 3 to 6 and set its claims beside what is measured.

    Writes gait.json, run.nc, figure3.png to figure6.png and report.md.

    Parameters
    ----------
    directory : Path
        Where to; created if it does not exist.
    progress : callable, optional
        Called with what is being done and the fraction of it that is done.

    Raises
    ------
    OSError
        If the directory cannot be written to.
    KeyboardInterrupt
        At Ctrl-C. Nothing is written before all simulations are done.
    """
    report = progress or _silent
    directory.mkdir(parents=True, exist_ok=True)
    evidence = gather(report)
    # The page goes first and comes last: while it is there, it is about the files beside it.
    (directory / "report.md").unlink(missing_ok=True)
    evidence.gait.save(directory / "gait.json")
    report("writing the run", 0.0)
    evidence.run.save(directory / "run.nc")
    span = (0.0, SHOWN_STEPS * evidence.gait.step_duration - TIME_STEP)  # before the last impact
    for number, (name, drawing, _) in enumerate(FIGURES):
        report("drawing", number / len(FIGURES))
        evidence.run.plot(drawing, gait=evidence.gait, path=directory / f"{name}.png", span=span)
    report("measuring the claims", 0.0)
    claims = judge(evidence)
    return PaperReport(save_page(evidence, claims, directory), evidence, claims)


def _silent(doing: str, part: float) -> None:
    """Report progress to nobody."""
