"""``heelstrike transfer``: one policy in several worlds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from heelstrike.cli.options import AsJson
from heelstrike.cli.terminal import print_found, spoken, stage

COLUMNS = {
    "episodes": "{:.0f}", "return": "{:.0f}", "interval": "± {:.0f}", "fell": "{:.0%}",
    "decisions": "{:.0f}", "distance": "{:.1f} m", "effort": "{:.2f}",
    "work": "{:.2f}", "force": "{:.1f}",
}  # fmt: skip
"""What is told of each world, and how."""


@spoken
def transfer(
    *,
    policy: Annotated[
        Path,
        typer.Argument(dir_okay=False, help="File of a policy, as heelstrike train writes it."),
    ],
    episodes: Annotated[
        int, typer.Option(min=2, help="Episodes for each method and for MuJoCo.")
    ] = 100,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the noise in their initial states.")
    ] = 0,
    as_json: AsJson = False,
) -> None:
    """Try one policy under several simulation methods, and in MuJoCo.

    Time stepping at several steps, event-driven, compliant ground, and Gymnasium's own environment
    if the task is one of its: mean return with its interval of 95 %, share of falls, decisions and
    distance an episode, effort (mean of the sum of the squared actions), work of the motors over
    weight and distance, and the 95th percentile of the normal force over the weight (medians).
    Episodes begin with the same noise everywhere.
    """
    rows: list[dict[str, Any]] = []
    with stage("loading") as doing:
        from heelstrike.control.policy.network import load_network
        from heelstrike.experiments.learning import transfer as worlds

        network = load_network(policy)
        for found in worlds.transfer(
            network, episodes, seed=seed, progress=lambda world: doing.doing(world, 0.0)
        ):
            rows.append(found.row())
    table = Table("world", *COLUMNS)
    for row in rows:
        table.add_row(row["world"], *(form.format(row[name]) for name, form in COLUMNS.items()))
    print_found(table, rows, as_json=as_json)
