"""``heelstrike mimic``: a recording of a person, and the nearest gait on hard contact."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli.options import AsJson, Friction, Reading, Steps
from heelstrike.cli.planning import FIRST_TIME, planar_robot_called
from heelstrike.cli.terminal import FAILED, print_found, spoken, stage, tell, wrote


@dataclass(frozen=True)
class Recording:
    """How a recording is read, and of whom it is."""

    mass: Annotated[
        float | None,
        typer.Option(help="Mass of the person in kg.", show_default="goes with the height"),
    ] = None
    height: Annotated[
        float | None,
        typer.Option(help="Height of the person in m.", show_default="goes with the legs"),
    ] = None
    speed: Annotated[
        float | None,
        typer.Option(help="Walking speed in m/s.", show_default="that of the hip"),
    ] = None
    rate: Annotated[float | None, typer.Option(help="Rows a second, if the file has none.")] = None
    unit: Annotated[
        str, typer.Option(help="Unit of joints that name none: rad or deg.", show_default="rad")
    ] = ""
    marker: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LANDMARK=NAME",
            help="Marker of a landmark, as in right_hip=R.GTRO; repeat the option for more.",
        ),
    ] = None
    up_axis: Annotated[
        str | None, typer.Option(help="Axis that points up: y, z.", show_default="as usual")
    ] = None
    forward_axis: Annotated[
        str | None,
        typer.Option(help="Axis of the walk: x, -x, y, ...", show_default="from heel to toe"),
    ] = None
    forces: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Forces measured with markers: .mot, .sto or a table."),
    ] = None

    def landmarks(self) -> dict[str, str]:
        """Return names of markers by landmark."""
        pairs = [each.partition("=") for each in self.marker or []]
        for landmark, equals, name in pairs:
            if not (landmark and equals and name):
                raise typer.BadParameter(
                    "write LANDMARK=NAME, as right_hip=R.GTRO", param_hint="--marker"
                )
        return {landmark.strip(): name.strip() for landmark, _, name in pairs}


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def mimic(
    recording: Annotated[
        str,
        typer.Argument(
            metavar="FILE|winter",
            help="Markers (.trc, .c3d or a table) or joints (.mot, .sto or a table) of a person; "
            "or winter, a recording that is built in.",
        ),
    ],
    *,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Robot that walks: built-in, or an MJCF, URDF or SDF file.",
            show_default="the person",
        ),
    ] = None,
    person: Recording,
    friction: Friction = 0.75,
    steps: Steps = 20,
    csv_rate: Annotated[
        float, typer.Option(help="Rows a second of the table of the motion.")
    ] = 1000.0,
    how: Reading,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the results.")] = Path(
        "mimic"
    ),
    as_json: AsJson = False,
) -> None:
    """Find the gait nearest to a recorded person that is exact on hard contact, and walk it.

    Writes motion.json, motion.csv (for a robot), person.csv, angles.png, walk.nc and summary.json;
    moments.csv where forces were measured. The exit status is 0 if all steps were walked, 1 if not.
    """
    with stage("loading"):
        from heelstrike.experiments.people import mimic as mimicked
        from heelstrike.experiments.people.writing import figures_of, write_mimicry
        from heelstrike.gait.recordings.saving import check_rate

        check_rate(csv_rate, "--csv-rate")
        machine = None if robot is None else planar_robot_called(robot, how)
    with stage("reading", when_slow=FIRST_TIME) as doing:
        found = mimicked(
            recording, robot=machine, mass=person.mass, height=person.height, speed=person.speed,
            rate=person.rate, unit=person.unit, markers=person.landmarks(), up=person.up_axis,
            forward=person.forward_axis, forces=person.forces, friction=friction, steps=steps,
            progress=doing.doing,
        )  # fmt: skip
    with stage("writing results"):
        files = write_mimicry(found, out, rate=csv_rate)
        wrote(*files)
    print_found(str(found), figures_of(found), as_json=as_json)
    if not as_json:
        tell(f"in {out}: {', '.join(each.name for each in files)}")
    if not found.walk.all_of_them:
        raise typer.Exit(FAILED)
