"""``heelstrike paper``: the paper's figures, and its claims beside what is computed here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from heelstrike.cli.terminal import output, spoken, stage, tell


@spoken
def paper(
    out: Annotated[Path, typer.Option(file_okay=False, help="Directory for the report.")] = Path(
        "paper"
    ),
) -> None:
    """Reproduce the paper's Figures 3 to 6 and set its claims beside computed figures.

    Writes report.md, figure3.png to figure6.png, gait.json and run.nc.
    """
    with stage("loading") as current:
        from heelstrike.experiments.paper import reproduce_paper

        report = reproduce_paper(out, progress=current.doing)
    table = Table("where", "the paper", "computed here", "verdict", show_lines=True)
    for claim in report.claims:
        table.add_row(claim.source, claim.statement, claim.measured, claim.verdict.value)
    output().print(table)
    tell(f"{report.page}: the claims in full, with figures")
