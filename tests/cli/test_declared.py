"""Options that a command declares together, as the fields of a dataclass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from heelstrike.cli.terminal import spoken


@dataclass(frozen=True)
class Size:
    """Two options."""

    length: Annotated[float, typer.Option("--length", help="In m.")] = 0.3
    names: Annotated[list[str] | None, typer.Option("--name")] = None


app = typer.Typer()


@app.command()
@spoken
def show(what: str, *, size: Size, loud: bool = False) -> None:
    """Show what came."""
    typer.echo(f"{what} {size.length} {size.names} {loud}")


def test_fields_are_options_in_the_place_of_their_argument() -> None:
    asked = CliRunner().invoke(app, ["foot", "--length", "0.5", "--name", "a", "--name", "b"])
    assert asked.stdout == "foot 0.5 ['a', 'b'] False\n"
    assert CliRunner().invoke(app, ["foot", "--loud"]).stdout == "foot 0.3 None True\n"
    words = CliRunner().invoke(app, ["--help"]).stdout
    assert words.index("--length") < words.index("--name") < words.index("--loud")
    assert "In m." in words
    assert "--size" not in words
