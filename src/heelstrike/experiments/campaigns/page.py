"""The page of a campaign: one HTML file with its verdict, figure, worst trials and origin."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

from heelstrike.experiments.campaigns.figure import draw_campaign
from heelstrike.experiments.campaigns.results import CampaignResults
from heelstrike.experiments.campaigns.verdict import Verdict, verdict
from heelstrike.view.page.markup import document, escaped, grid, shipped, table
from heelstrike.view.page.page import check_page
from heelstrike.view.page.provenance import versions
from heelstrike.view.report.writing import svg
from heelstrike.view.style import view_errors
from heelstrike.whole_file import write_whole


def save_campaign_page(
    results: CampaignResults, path: str | os.PathLike[str], *, command: str = ""
) -> Path:
    """Write what a campaign came to as one HTML file, which needs nothing else.

    Parameters
    ----------
    results : CampaignResults
        What its trials came to.
    path : str or path
        File to write, .html or .htm.
    command : str
        The command that makes it again.

    Returns
    -------
    Path
        The file. It appears whole or not at all.

    Raises
    ------
    ViewError
        If it cannot be written.
    """
    target = check_page(path)
    found = verdict(results)
    parts = [f"<h1>{escaped(headline(found))}</h1>"]
    picture = svg(draw_campaign(results))
    told = "How often trials went well, of all and by each parameter"
    parts.append(f'<figure><img src="{picture}" alt="{told}"></figure>')
    parts += [*_influences(found), *_worst(results, found)]
    origin = {"command": command} if command else {}
    parts.append(table(origin | versions(), "Where this comes from"))
    text = document("Campaign", "\n".join(parts), style=shipped("report.css"))
    with view_errors():
        return write_whole(target, text)


def headline(found: Verdict) -> str:
    """Say in one line what a campaign came to."""
    success = found.success
    first = f"; most often it {found.causes[0][0]}" if found.causes else ""
    return (
        f"{100.0 * success.share:.1f} % of {success.trials} trials walked on "
        f"(between {100.0 * success.low:.1f} and {100.0 * success.high:.1f} % at 95 %){first}"
    )


def _influences(found: Verdict) -> Iterator[str]:
    rows = [
        (each.name, str(each.trials), *map(_number, (each.rank, each.chance, each.first_order,
         each.total_order)))
        for each in found.influences
    ]  # fmt: skip
    head = ("parameter", "trials", "rank correlation", "by chance", "Sobol index", "with others")
    yield "<h2>What it depends on</h2>"
    yield grid(head, rows)


def _worst(results: CampaignResults, found: Verdict) -> Iterator[str]:
    if not found.worst:
        return
    at = {number: i for i, number in enumerate(results.numbers)}
    rows = []
    for number in found.worst:
        outcome = results.outcomes[at[number]]
        values = results.plan.of(number)
        told = ", ".join(
            f"{name} {each:.4g}" if isinstance(each, float) else f"{name} {each}"
            for name, each in values.items()
        )
        rows.append((str(number), told, outcome.chain or outcome.status, outcome.message))
    yield "<h2>Trials that failed soonest</h2>"
    yield grid(("trial", "values", "causes", "end"), rows)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"
