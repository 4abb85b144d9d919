"""``heelstrike watch``: a robot walks in the browser, to be looked at and pushed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    LAW,
    METHODS,
    OWN_LAW,
    Friction,
    OneMethod,
    OnGround,
    Reading,
    built_in,
    method_called,
)
from heelstrike.cli.planning import law_asked
from heelstrike.cli.terminal import spoken, stage, tell
from heelstrike.cli.values import ground_called
from heelstrike.interruption import acknowledge

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground


# As many arguments as the command has options: a person's.
@spoken
def watch(
    *,
    robots: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT",
            help="Built-in robots, and MJCF, URDF or SDF files; the first one starts.",
            show_default="bravo7",
            autocompletion=built_in,
        ),
    ] = None,
    gait: Annotated[
        list[Path] | None,
        typer.Option(help="Saved gait of one of the robots; repeat the option for more."),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(
            metavar=LAW,
            help=f"{OWN_LAW} Repeat the option to choose among several.",
            show_default="FootstepFeedback where the robot can have it; ComputedTorque",
        ),
    ] = None,
    method: OneMethod = None,
    step: Annotated[float, typer.Option(help="Time step h in s.")] = 1e-3,
    ground: OnGround = "flat",
    friction: Friction = 0.75,
    speed: Annotated[float, typer.Option(help="Simulated seconds a second at the start.")] = 1.0,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of 127.0.0.1.", show_default="a free one")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    how: Reading,
) -> None:
    """Walk a robot live in the browser: watch, pause, rewind and push it.

    Needs `pip install 'heelstrike[watch]'`. The page is served on 127.0.0.1 only, and needs the
    printed address. Its lists offer the robots, gaits and laws named here beside the built-in
    ones. Ctrl-C ends it.
    """
    with stage("loading"):
        from heelstrike.view.live.server import check_installed

        check_installed()
        from heelstrike.experiments.watching import First, WalkStage
        from heelstrike.view.live.viewer import view

        # All that is cheap to refuse is refused before anything is served.
        surface = ground_called(ground, friction=friction)
        for name in METHODS if method is None else (method,):
            method_called(name, step)
        named = robots or ["bravo7"]
        first = First(
            method=None if method is None else method.value,
            step=step,
            gait=gait,
            friction=friction,
            laws=[law for words in controller or () if (law := law_asked(words))],
            **_shape(ground, surface),
        )
        walks = WalkStage(named, method_called, METHODS, first, **how.keywords())
        viewer = view(stage=walks, rate=speed, port=port)
    tell(f"watch at {viewer.url}")
    try:
        if browser and not viewer.open():
            tell("no browser could be opened here: open the address yourself")
        tell("Ctrl-C ends it")
        viewer.wait()
    except KeyboardInterrupt as interrupt:
        acknowledge(interrupt)
        tell("closed")
        raise typer.Exit(INTERRUPTED) from None


def _shape(words: str, surface: Ground) -> dict[str, Any]:
    """What of a ground can be set by viewers; stairs and files are as they are."""
    kind, *shape = words.split(":")
    if kind == "flat":
        return {}
    if kind == "slope":
        return {"slope": math.degrees(surface.slope)}
    if kind == "rough":
        return {"roughness": float(shape[0]), "seed": int(shape[1])}
    return {"ground": surface}
