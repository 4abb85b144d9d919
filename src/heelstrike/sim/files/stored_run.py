"""A run made from what is in its file, every number of which is checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.errors import HeelstrikeError, RunFileError
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.dimension import AnyRobot
from heelstrike.sim.files.dataset import EVENTS, FORMAT, PUSHES, ROBOT_GROUP, TIME
from heelstrike.sim.files.hdf5_contents import Contents
from heelstrike.sim.files.layout import PLANAR, Layout, layout_named
from heelstrike.sim.files.logs import stored_log
from heelstrike.sim.files.settings import UnknownClassError, stored_method
from heelstrike.sim.files.variables import DamageError, Stored
from heelstrike.sim.push import Push, pushes_of_numbers
from heelstrike.sim.run import AnyRun, Event, SolverCount, Timing, events_of

_ENDED_WELL = (
    RunStatus.COMPLETED, RunStatus.FELL, RunStatus.STOPPED, RunStatus.INTERRUPTED,
)  # fmt: skip
"""Ends of runs of which every number is finite."""


def stored_run(
    source: Path, contents: Contents, robot: AnyRobot | None = None, classes: Sequence[type] = ()
) -> AnyRun:
    """Make a run of the contents of a file.

    Parameters
    ----------
    source : Path
        The file, for messages.
    contents : mapping
        What is in its root and in the group of the robot.
    robot : Robot or SpatialRobot, optional
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
                f"{source}: a run in space by an older heelstrike, which did not write its robot. "
                "Read its data with xarray.open_dataset."
            )
        raise RunFileError(f"{source}: this NetCDF file is not a run of heelstrike")
    try:
        layout = stored.number("heelstrike_format")
        if layout != FORMAT:
            raise RunFileError(
                f"{source}: written in layout {layout:g}, this version of heelstrike reads "
                f"{FORMAT}. Update heelstrike."
            )
        held = layout_named(stored.count("dimension", PLANAR))
        described = _robot(stored, held)
        if robot is not None:
            _check_same(source, robot, described)
        return _run(stored, held, described if robot is None else robot, classes)
    except RunFileError:
        raise
    except UnknownClassError as error:
        raise RunFileError(f"{source}: {error}") from error
    except (DamageError, HeelstrikeError) as error:
        raise RunFileError(f"{source}: damaged: {error}") from error


def _robot(stored: Stored, layout: Layout) -> AnyRobot:
    group = f"{ROBOT_GROUP}/"
    described = {
        name.removeprefix(group): value
        for name, value in stored.contents.items()
        if name.startswith(group)
    }
    if not described:
        raise DamageError("it holds no robot")
    try:
        robot: AnyRobot = layout.stored_robot(described)
        return robot
    except ValueError as error:
        raise DamageError(f"the robot in the file: {error}") from error


def _check_same(source: Path, robot: AnyRobot, stored: AnyRobot) -> None:
    if type(robot) is not type(stored):
        raise RunFileError(
            f"{source}: the run is one of a {type(stored).__name__}, and robot {robot.name!r} is a "
            f"{type(robot).__name__}"
        )
    for what in ("joint_names", "actuator_names", "contact_names"):
        ours, theirs = getattr(robot, what), getattr(stored, what)
        if ours != theirs:
            raise RunFileError(
                f"{source}: the run is one of another robot than {robot.name!r}: its "
                f"{what.replace('_', ' ')} are {', '.join(theirs)}, not {', '.join(ours)}"
            )


def _run(stored: Stored, layout: Layout, robot: AnyRobot, classes: Sequence[type]) -> AnyRun:
    status = stored.member("status", {each.value: each for each in RunStatus})
    known = {kind.__name__: kind for kind in classes}
    robot = layout.held(robot, stored, known)
    sizes = {dim: len(names) for dim, names in layout.labels(robot).items()}
    (time,) = stored.arrays(TIME, sizes).values()
    if not np.all(np.diff(time) >= 0.0):
        raise DamageError("'time' goes backwards")
    allowed = "" if status in _ENDED_WELL else "anything"
    lacking = [name for name in layout.left_out(robot) if name not in stored.contents]
    rows = {
        name: each._replace(allowed=allowed)
        for name, each in layout.rows().items()
        if name not in lacking
    }
    ground = layout.stored_ground(stored, sizes, known)
    arrays = stored.arrays(rows, sizes)
    if lacking:
        arrays |= layout.following(robot, ground, arrays)
    dimension = layout.dimension
    return dimension.run(
        robot=robot,
        ground=ground,
        method=stored_method(stored, known),
        status=status,
        message=stored.text("message"),
        time=time,
        **arrays,
        events=_events(stored, layout, robot, sizes),
        certificates=_counted(stored, "worst", dimension.certificates),
        solver=_counted(stored, "solver", SolverCount),
        steps=stored.count("steps"),
        saturations=stored.count("saturations"),
        timing=Timing(stored.number("compile_s"), stored.number("wall_s")),
        pushes=_pushes(stored, robot, sizes),
        log=stored_log(stored, sizes, layout.extents),
    )


def _counted(stored: Stored, prefix: str, kind: Any) -> Any:
    """Make a dataclass of counts, numbers and texts; what older files do not tell has a default."""
    read: Mapping[Any, Any] = {"int": stored.count, "float": stored.number}
    values = {
        each.name: read[each.type](f"{prefix}_{each.name}", each.default)
        if each.type in read
        else stored.text(f"{prefix}_{each.name}")
        for each in fields(kind)
    }
    return kind(**values)


def _pushes(stored: Stored, robot: AnyRobot, sizes: dict[str, int]) -> tuple[Push, ...]:
    arrays = stored.arrays(PUSHES, sizes)
    pushes = pushes_of_numbers({name[len("push_") :]: each for name, each in arrays.items()})
    for push in pushes:
        push.place(robot)
    return pushes


def _events(
    stored: Stored, layout: Layout, robot: AnyRobot, sizes: dict[str, int]
) -> tuple[Event, ...]:
    time, kind, contact, impulse = stored.arrays(EVENTS, sizes).values()
    known = {each.value for each in EventKind}
    for k, c in zip(kind.tolist(), contact.tolist(), strict=True):
        if k not in known:
            raise DamageError(f"an event has the unknown kind {k}")
        where, first, count = layout.places(EventKind(k), robot)
        if not first <= c < first + count:
            raise DamageError(f"an event names a {where} that is not there")
    return events_of(time, kind, contact, impulse)
