"""The ``heelstrike`` command."""

from __future__ import annotations

from typing import Annotated

import typer

from heelstrike import __version__
from heelstrike.cli.campaign import campaign
from heelstrike.cli.check import check
from heelstrike.cli.compare import compare
from heelstrike.cli.identify import identify
from heelstrike.cli.inspect import inspect
from heelstrike.cli.mimic import mimic
from heelstrike.cli.paper import paper
from heelstrike.cli.planners import planners
from heelstrike.cli.report import report
from heelstrike.cli.robots import robots
from heelstrike.cli.simulate import simulate
from heelstrike.cli.train import train
from heelstrike.cli.transfer import transfer
from heelstrike.cli.walk import walk
from heelstrike.cli.watch import watch
from heelstrike.cli.zoo import zoo

app = typer.Typer(
    name="heelstrike",
    help="Walking robots on exact hard contact.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for command in (
    walk,
    simulate,
    watch,
    report,
    train,
    transfer,
    zoo,
    campaign,
    check,
    identify,
    mimic,
    paper,
    compare,
    planners,
    robots,
    inspect,
):
    app.command()(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"heelstrike {__version__}")
        raise typer.Exit()


@app.callback()
def heelstrike(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Walking robots on exact hard contact."""


if __name__ == "__main__":
    app()
