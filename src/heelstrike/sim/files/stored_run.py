"""A run made from what is in its file, every number of which is checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.errors import HeelstrikeError, RunFileError
from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.files.dataset import (
    EVENTS,
    FORMAT,
    GROUND,
    PUSHES,
    ROBOT_GROUP,
    ROWS,
    TIME,
    labels,
)
from heelstrike.sim.files.hdf5_contents import Contents
from heelstrike.sim.files.logs import stored_log
from heelstrike.sim.files.robot_dataset import stored_robot
from heelstrike.sim.files.settings import UnknownClassError, held, shaped, stored_method
from heelstrike.sim.files.variables import DamageError, Stored
from heelstrike.sim.push import Push, pushes_of_numbers
from heelstrike.sim.run import (
    SOLVED,
    WORST,
    Certificates,
    Event,
    Run,
    SolverCount,
    Timing,
    events_of,
)

_ENDED_WELL = (
    RunStatus.COMPLETED, RunStatus.FELL, RunStatus.STOPPED, RunStatus.INTERRUPTED,
)  # fmt: skip
"""Ends of runs of which every number is finite."""

_DEFAULTS = {
    each.name: each.default for kind in (Certificates, SolverCount) for each in fields(kind)
}
"""What older files do not tell has one."""


def stored_run(
    source: Path, contents: Contents, robot: Robot | None = None, classes: Sequence[type] = ()
) -> Run:
    """Make a run of the contents of a file.

    Parameters
    ----------
    source : Path
        The file, for messages.
    contents : mapping
        What is in its root and in the group of the robot.
    robot : Robot, optional
        Robot to attach in the place of the stored one.
    classes : sequence of type
        Methods and contact laws from outside the package.

    Raises
    ------
    RunFileError
        If anything is missing or cannot be.
    """
    stored = Stored({name.removeprefix("/"): value for name, value in contents.items()})
    if "@heelstrike_format" not in stored.contents:
        if "in space" in str(stored.contents.get("@title", "")):
            raise RunFileError(
                f"{source}: a run in space, which cannot be taken up again. Read its data with "
                "xarray.open_dataset."
            )
        raise RunFileError(f"{source}: this NetCDF file is not a run of heelstrike")
    try:
        layout = stored.number("heelstrike_format")
        if layout != FORMAT:
            raise RunFileError(
                f"{source}: written in layout {layout:g}, this version of heelstrike reads "
                f"{FORMAT}. Update heelstrike."
            )
        described = _robot(stored)
        if robot is not None:
            _check_same(source, robot, described)
        return _run(stored, described if robot is None else robot, classes)
    except RunFileError:
        raise
    except UnknownClassError as error:
        raise RunFileError(f"{source}: {error}") from error
    except (DamageError, HeelstrikeError) as error:
        raise RunFileError(f"{source}: damaged: {error}") from error


def _robot(stored: Stored) -> Robot:
    group = f"{ROBOT_GROUP}/"
    described = {
        name.removeprefix(group): value
        for name, value in stored.contents.items()
        if name.startswith(group)
    }
    if not described:
        raise DamageError("it holds no robot")
    try:
        return stored_robot(described)
    except ValueError as error:
        raise DamageError(f"the robot in the file: {error}") from error


def _check_same(source: Path, robot: Robot, stored: Robot) -> None:
    for what in ("joint_names", "actuator_names", "contact_names"):
        ours, theirs = getattr(robot, what), getattr(stored, what)
        if ours != theirs:
            raise RunFileError(
                f"{source}: the run is one of another robot than {robot.name!r}: its "
                f"{what.replace('_', ' ')} are {', '.join(theirs)}, not {', '.join(ours)}"
            )


def _run(stored: Stored, robot: Robot, classes: Sequence[type]) -> Run:
    status = stored.member("status", {each.value: each for each in RunStatus})
    known = {kind.__name__: kind for kind in classes}
    if not robot.constraints:
        robot = held(robot, stored, known)
    sizes = {dim: len(names) for dim, names in labels(robot).items()}
    (time,) = stored.arrays(TIME, sizes).values()
    if not np.all(np.diff(time) >= 0.0):
        raise DamageError("'time' goes backwards")
    allowed = "" if status in _ENDED_WELL else "anything"
    rows = {name: each._replace(allowed=allowed) for name, each in ROWS.items()}
    return Run(
        robot=robot,
        ground=shaped(_ground(stored, sizes), stored, known),
        method=stored_method(stored, known),
        status=status,
        message=stored.text("message"),
        time=time,
        **stored.arrays(rows, sizes),
        events=_events(stored, robot, sizes),
        certificates=Certificates(
            *(stored.number(f"worst_{name}", _DEFAULTS[name]) for name in WORST)
        ),
        solver=SolverCount(
            stored.text("solver_name"),
            *(stored.count(f"solver_{name}", _DEFAULTS[name]) for name in SOLVED),
        ),
        steps=stored.count("steps"),
        saturations=stored.count("saturations"),
        timing=Timing(stored.number("compile_s"), stored.number("wall_s")),
        pushes=_pushes(stored, robot, sizes),
        log=stored_log(stored, sizes),
    )


def _pushes(stored: Stored, robot: Robot, sizes: dict[str, int]) -> tuple[Push, ...]:
    arrays = stored.arrays(PUSHES, sizes)
    pushes = pushes_of_numbers({name[len("push_") :]: each for name, each in arrays.items()})
    for push in pushes:
        push.place(robot)
    return pushes


def _ground(stored: Stored, sizes: dict[str, int]) -> Ground:
    arrays = stored.arrays(GROUND, sizes)
    if sizes["segment"] != sizes["corner"] - 1:
        raise DamageError("'ground_friction' does not have one number a segment")
    return Ground.of_numbers(
        {
            **{name[len("ground_") :]: each for name, each in arrays.items()},
            "slope": np.array(stored.number("ground_slope")),
            "has_profile": np.array(stored.count("ground_has_profile")),
        }
    )


def _events(stored: Stored, robot: Robot, sizes: dict[str, int]) -> tuple[Event, ...]:
    time, kind, contact, impulse = stored.arrays(EVENTS, sizes).values()
    known = {each.value for each in EventKind}
    for k, c in zip(kind.tolist(), contact.tolist(), strict=True):
        if k not in known:
            raise DamageError(f"an event has the unknown kind {k}")
        # A bridge is one of the whole robot, but every robot has a joint.
        of_joint = EventKind(k).of_joint or k == EventKind.BRIDGE
        where, count = ("joint", robot.nv) if of_joint else ("contact point", robot.nc)
        if EventKind(k).of_constraint:
            where, count = "constraint", len(robot.constraints)
        if not 0 <= c < count:
            raise DamageError(f"an event names a {where} that is not there")
    return events_of(time, kind, contact, impulse)
