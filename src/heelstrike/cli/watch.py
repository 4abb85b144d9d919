"""``heelstrike watch``: a robot walks in the browser, to be looked at and pushed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    LAW,
    METHODS,
    METHODS_IN_SPACE,
    OWN_LAW,
    FixedStep,
    Friction,
    Method,
    OneMethod,
    OnGround,
    Reading,
    built_in,
    method_called,
)
from heelstrike.cli.planning import law_asked, robots_named, spatial_law_asked
from heelstrike.cli.terminal import spoken, stage, tell
from heelstrike.cli.values import ground_called
from heelstrike.interruption import acknowledge

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground
    from heelstrike.robot import Robot, SpatialRobot
    from heelstrike.view.live.stage import Stage


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
    step: FixedStep = 1e-3,
    ground: OnGround = "flat",
    friction: Friction = 0.75,
    dimension: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=3,
            help="Watch it in the plane, or in space.",
            show_default="as its file has it",
        ),
    ] = None,
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

    A robot in space holds the posture of its file, by HoldPosture, or follows a law of yours.

    Needs `pip install 'heelstrike[watch]'`. The page is served on 127.0.0.1 only, and needs the
    printed address. Its lists offer the robots, gaits and laws named here beside the built-in
    ones. Ctrl-C ends it.
    """
    with stage("loading"):
        from heelstrike.view.live.server import check_installed

        check_installed()
        from heelstrike.view.live.viewer import view

        # All that is cheap to refuse is refused before anything is served.
        surface = ground_called(ground, friction=friction)
        for name in METHODS if method is None else (method,):
            method_called(name, step)
        named = robots or ["bravo7"]
        found, first = robots_named(named, dimension, how)
        if found:
            if gait is not None:
                raise typer.BadParameter(
                    "gaits are of robots in the plane, and this one is in space: leave them out",
                    param_hint="--gait",
                )
            walks = _in_space(found, controller or (), method, step, surface)
        else:
            options = how.keywords() | ({"projected": True} if dimension == 2 else {})
            walks = _in_plane(
                named, first, controller or (), options, step=step, gait=gait, friction=friction,
                method=None if method is None else method.value, **_shape(ground, surface),
            )  # fmt: skip
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


def _in_plane(
    named: list[str],
    loaded: dict[str, Robot],
    controller: Sequence[str],
    how: Any,
    **first: Any,
) -> Stage:
    from heelstrike.experiments.watching import First, WalkStage

    laws = [law for words in controller if (law := law_asked(words))]
    chosen = First(laws=laws, **first)
    return WalkStage(named, method_called, METHODS, chosen, loaded=loaded, **how)


def _in_space(
    robots: dict[str, SpatialRobot],
    controller: Sequence[str],
    method: Method | None,
    step: float,
    surface: Ground,
) -> Stage:
    from heelstrike.experiments.watching_in_space import FirstInSpace, SpaceStage
    from heelstrike.sim.spatial.method import way_in_space
    from heelstrike.sim.spatial.space import SPACE

    SPACE.checked_ground(surface)  # which refuses what is of the plane only
    way_in_space(method_called(method or METHODS_IN_SPACE[0], step))
    first = FirstInSpace(
        method=method or METHODS_IN_SPACE[0],
        step=step,
        laws=[spatial_law_asked(words) for words in controller],
        friction=float(surface.model().friction.min()),
        slope=math.degrees(surface.slope),
    )
    return SpaceStage(robots, method_called, METHODS_IN_SPACE, first)


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
