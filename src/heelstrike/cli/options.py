"""Options that several commands have, each typed once, and the methods that they name."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heelstrike.cli.values import pose_called, xacro_arguments

if TYPE_CHECKING:
    from heelstrike.sim.method import Method as TimeMethod


def built_in(incomplete: str) -> list[str]:
    """Complete the name of a built-in robot; where there is none, shells complete a file's."""
    from heelstrike.robot.library import builtin_robots

    return [name for name in builtin_robots() if name.startswith(incomplete)]


class Method(StrEnum):
    """Ways through time, as every command calls them, the usual one first."""

    TIME_STEPPING = "time-stepping"
    EVENT_DRIVEN = "event-driven"
    COMPLIANT = "compliant"
    KELVIN_VOIGT = "kelvin-voigt"
    GAP_LINEARISED = "gap-linearised"
    MOREAU_JEAN = "moreau-jean"
    LINEARLY_IMPLICIT = "linearly-implicit"
    PAPER_EXPLICIT = "paper-explicit"
    PAPER_SYMPLECTIC = "paper-symplectic"


METHODS = tuple(each.value for each in Method)
METHOD = "Way through time: one of three, a law of compliant ground, or a scheme of time stepping."
SEVERAL = "Way through time; repeat the option to see several side by side."
USUAL_METHOD = f"{Method.TIME_STEPPING}; {Method.EVENT_DRIVEN} without motors"


class Way(StrEnum):
    """Where a robot looks in its file."""

    X = "x"
    Y = "y"
    BACK = "-x"
    RIGHT = "-y"


RobotName = Annotated[
    str,
    typer.Argument(help="A built-in robot, or an MJCF, URDF or SDF file.", autocompletion=built_in),
]
Floating = Annotated[
    bool, typer.Option("--floating", help="Let a trunk float in the plane that the file holds.")
]
Projected = Annotated[
    bool, typer.Option("--projected", help="Lock the joints that leave the x–z plane.")
]
Forward = Annotated[
    Way | None,
    typer.Option(help="Where the robot looks in its file.", show_default="the plane it moves in"),
]
Averaged = Annotated[
    bool, typer.Option("--mirror", help="Make left and right equal, which nearly are.")
]
Packages = Annotated[
    list[Path] | None,
    typer.Option(
        "--package-path",
        exists=True,
        file_okay=False,
        help="Folder of ROS packages or Gazebo models, for files that the robot names; repeat the "
        "option for more.",
        show_default="around the file",
    ),
]
Xacro = Annotated[
    bool,
    typer.Option(
        "--xacro",
        help="Expand the macros of the robot's file first, which runs what it says: for files of "
        "people whom you trust.",
    ),
]
XacroArguments = Annotated[
    list[str] | None,
    typer.Option(
        "--xacro-arg",
        metavar="NAME:=VALUE",
        help="Value of an argument of a xacro file; with it --xacro need not be said. Repeat the "
        "option for more.",
    ),
]
Pose = Annotated[
    list[str] | None,
    typer.Option(
        metavar="JOINT=VALUE,...",
        help="Reference positions, locked joints too: rad, m, or degrees as in knee=23deg.",
        show_default="as in the file",
    ),
]
OnGround = Annotated[
    str,
    typer.Option(
        "--ground",
        metavar="FILE|flat|slope:-3|stairs:0.02x0.3|rough:0.01:7",
        help="Ground: degrees (positive climbs), rise x tread in m, height in m and seed; or a "
        "file of corners x z in m.",
    ),
]
Pushed = Annotated[
    list[str] | None,
    typer.Option(
        "--push",
        metavar="LINK:FORCE:START:DURATION",
        help="Push a link, in N along x (or X,Z) and s; repeat the option for more.",
    ),
]
SavedGait = Annotated[
    Path | None, typer.Option("--gait", help="Walk this saved gait instead of designing one.")
]
ControlledBy = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="LAW|MODULE:NAME|FILE.py:NAME",
        help="Law that moves the joints, by its name; or one of yours, a class or function of "
        "(robot, gait), whose code is then run.",
        show_default="ComputedTorque",
    ),
]
Steps = Annotated[int, typer.Option(min=1, help="Steps to walk.")]
Friction = Annotated[float, typer.Option(help="Friction coefficient of the ground.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show where in the program an error arose.", hidden=True)
]


def reads_robots(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of how a robot's file is read, in the place of its ``how``.

    That is what it is called with: the keywords of :func:`heelstrike.load_robot`.
    """
    own = inspect.signature(command, eval_str=True)
    shared = inspect.signature(_reading, eval_str=True).parameters
    options: list[inspect.Parameter] = []
    for parameter in own.parameters.values():
        options += shared.values() if parameter.name == "how" else [parameter]

    @functools.wraps(command)
    def reading(**given: Any) -> None:
        how = _reading(**{name: given.pop(name) for name in shared if name in given})
        command(**given, how=how)

    reading.__signature__ = own.replace(parameters=options)  # type: ignore[attr-defined]
    reading.__annotations__ = {each.name: each.annotation for each in options}
    return reading


def _reading(
    floating: Floating = False,
    projected: Projected = False,
    forward: Forward = None,
    pose: Pose = None,
    mirror: Averaged = False,
    package_path: Packages = None,
    xacro: Xacro = False,
    xacro_arg: XacroArguments = None,
) -> dict[str, Any]:
    return {
        "floating": floating,
        "projected": projected,
        "forward": None if forward is None else forward.value,
        "pose": pose_called(pose),
        "mirror": "average" if mirror else None,
        "package_path": package_path or (),
        "xacro": xacro_arguments(xacro_arg) or xacro,
    }


def method_called(name: str, step: float, *, passive: bool = False) -> TimeMethod:
    """Return the :class:`Method` of a name, with a step (s).

    The legs of a passive walker, of one length, may pass through the ground as they swing, where
    a method can let them.
    """
    from heelstrike import sim

    match Method(name):
        case Method.TIME_STEPPING:
            return sim.TimeStepping(step=step)
        case Method.EVENT_DRIVEN:
            return sim.EventDriven(swing_feet_pass=passive)
        case Method.COMPLIANT:
            return sim.Compliant(step=step)
        case Method.KELVIN_VOIGT:
            return sim.Compliant(law=sim.KelvinVoigt(), step=step)
        case scheme:
            return sim.TimeStepping(step=step, scheme=sim.Scheme[scheme.name])
