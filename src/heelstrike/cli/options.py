"""Options that several commands have, each typed once, and the methods that they name."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli.values import pose_called, xacro_arguments

if TYPE_CHECKING:
    from heelstrike.robot.files.options import LoadOptions
    from heelstrike.sim.method import Method as TimeMethod


def built_in(incomplete: str) -> list[str]:
    """Complete the name of a built-in robot; where there is none, shells complete a file's."""
    from heelstrike.robot.library import builtin_robots

    return [name for name in builtin_robots() if name.startswith(incomplete)]


class Method(StrEnum):
    """Simulation methods, as every command calls them, the usual one first."""

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
METHODS_IN_SPACE = (Method.TIME_STEPPING, Method.GAP_LINEARISED)
"""Those that robots in space have."""
METHOD = "Simulation method: one of three, a law of compliant ground, or a scheme of time stepping."
SEVERAL = "Simulation method; repeat the option to see several side by side."
USUAL_METHOD = f"{Method.TIME_STEPPING}; {Method.EVENT_DRIVEN} without motors"


class Animation(StrEnum):
    """Kinds of animation."""

    MP4 = "mp4"
    GIF = "gif"
    NONE = "none"


class Way(StrEnum):
    """Where a robot looks in its file."""

    X = "x"
    Y = "y"
    BACK = "-x"
    RIGHT = "-y"


ROBOT = "A built-in robot, or an MJCF, URDF or SDF file."
RobotName = Annotated[str, typer.Argument(help=ROBOT, autocompletion=built_in)]
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
LAW = "LAW|MODULE:NAME|FILE.py:NAME"
OWN_LAW = (
    "Control law by its name, or one of yours: a class or function of (robot, gait). Its code "
    "is run."
)
Steps = Annotated[int, typer.Option(min=1, help="Steps to walk.")]
Step = Annotated[float, typer.Option(help="Time step in s of the methods that have one.")]
FixedStep = Annotated[float, typer.Option(help="Time step h in s.")]
Rate = Annotated[
    float | None, typer.Option(help="Rows a second, where there is no column of times.")
]
Unit = Annotated[
    str, typer.Option(help="Unit of columns that name none: rad or deg.", show_default="rad")
]
MeasuredRobot = Annotated[str, typer.Option("--robot", help=ROBOT)]
Friction = Annotated[float, typer.Option(help="Friction coefficient of the ground.")]
OneMethod = Annotated[Method | None, typer.Option(help=METHOD, show_default=USUAL_METHOD)]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")]
Afresh = Annotated[bool, typer.Option("--afresh", help="Discard what is in --out and start again.")]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Threads.", show_default="one a processor")
]
Animated = Annotated[Animation, typer.Option(help="Kind of animation.")]
TableFolder = Annotated[
    Path, typer.Option(file_okay=False, help="Directory for the table and the figure.")
]


@dataclass(frozen=True)
class Reading:
    """How a robot's file is read."""

    floating: Annotated[
        bool,
        typer.Option(
            "--floating",
            help="Let the trunk float in the plane, although the file fixes it.",
        ),
    ] = False
    projected: Annotated[
        bool, typer.Option("--projected", help="Lock the joints that leave the x–z plane.")
    ] = False
    forward: Annotated[
        Way | None,
        typer.Option(
            help="Axis along which the robot looks in its file.",
            show_default="the plane it moves in",
        ),
    ] = None
    pose: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE,...",
            help="Reference positions, locked joints too: rad, m, or degrees as in knee=23deg.",
            show_default="as in the file",
        ),
    ] = None
    mirror: Annotated[
        bool, typer.Option("--mirror", help="Make left and right equal where they differ slightly.")
    ] = False
    package_path: Annotated[
        list[Path] | None,
        typer.Option(
            exists=True,
            file_okay=False,
            help="Folder of ROS packages or Gazebo models whose files the robot names; repeat the "
            "option for more.",
            show_default="around the file",
        ),
    ] = None
    xacro: Annotated[
        bool,
        typer.Option(
            "--xacro",
            help="Expand the macros of the robot's file first. This runs code from the file: use "
            "it only for files that you trust.",
        ),
    ] = False
    xacro_arg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:=VALUE",
            help="Value of an argument of a xacro file; implies --xacro. Repeat the option for "
            "more.",
        ),
    ] = None

    def keywords(self) -> LoadOptions:
        """Return the keywords of :func:`heelstrike.load_robot`."""
        return {
            "floating": self.floating,
            "projected": self.projected,
            "forward": None if self.forward is None else self.forward.value,
            "pose": pose_called(self.pose),
            "mirror": "average" if self.mirror else None,
            "package_path": self.package_path or (),
            "xacro": xacro_arguments(self.xacro_arg) or self.xacro,
        }


@dataclass(frozen=True)
class Walking:
    """What a robot walks by, and on what."""

    controller: Annotated[
        str | None,
        typer.Option(metavar=LAW, help=OWN_LAW, show_default="ComputedTorque"),
    ] = None
    gait: Annotated[
        Path | None, typer.Option(help="Walk this saved gait instead of designing one.")
    ] = None
    ground: OnGround = "flat"
    friction: Friction = 0.75
    push: Pushed = None


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
