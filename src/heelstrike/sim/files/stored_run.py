"""A run made from what is in its file, every number of which is checked."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.errors import HeelstrikeError, RunFileError
from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.files.dataset import (
    COUNTS,
    FORMAT,
    LABELS,
    LAWS,
    METHODS,
    NONE,
    ROBOT_GROUP,
    ROWS,
    WORST,
)
from heelstrike.sim.files.hdf5_contents import Contents
from heelstrike.sim.files.robot_dataset import stored_robot
from heelstrike.sim.method import Method, UnknownMethod
from heelstrike.sim.push import Push
from heelstrike.sim.run import Certificates, Event, Run, SolverCount, Timing

_ENDED_WELL = (RunStatus.COMPLETED, RunStatus.FELL, RunStatus.INTERRUPTED)
"""Ends of runs of which every number is finite."""
_JOINT_EVENTS = (EventKind.JOINT_STOP, EventKind.JOINT_SLIP, EventKind.JOINT_STICK)
_EVENTS = ("event_time", "event_kind", "event_contact", "event_impulse")


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
    stored = _Stored(source, contents, classes)
    if "/@heelstrike_format" not in contents:
        raise RunFileError(f"{source}: this NetCDF file is not a run of heelstrike")
    layout = stored.number("heelstrike_format")
    if layout != FORMAT:
        raise RunFileError(
            f"{source}: written in layout {layout:g}, this version of heelstrike reads {FORMAT}. "
            "Update heelstrike."
        )
    described = _robot(source, contents)
    if robot is not None:
        _check_same(source, robot, described)
    return _run(stored, described if robot is None else robot)


def _robot(source: Path, contents: Contents) -> Robot:
    group = f"/{ROBOT_GROUP}/"
    described = {
        name.removeprefix(group): value
        for name, value in contents.items()
        if name.startswith(group)
    }
    if not described:
        raise RunFileError(f"{source}: damaged, it holds no robot")
    try:
        return stored_robot(described)
    except (HeelstrikeError, ValueError) as error:
        raise RunFileError(f"{source}: the robot in the file is damaged: {error}") from error


def _check_same(source: Path, robot: Robot, stored: Robot) -> None:
    for what in ("joint_names", "actuator_names", "contact_names"):
        ours, theirs = getattr(robot, what), getattr(stored, what)
        if ours != theirs:
            raise RunFileError(
                f"{source}: the run is one of another robot than {robot.name!r}: its "
                f"{what.replace('_', ' ')} are {', '.join(theirs)}, not {', '.join(ours)}"
            )


def _run(stored: _Stored, robot: Robot) -> Run:
    status = stored.member("status", {s.value: s for s in RunStatus})
    time = stored.numbers("time", (None,))
    if not np.all(np.diff(time) >= 0.0):
        raise stored.damaged("'time' goes backwards")
    rows = len(time)
    sizes = {
        "coordinate": robot.nv,
        "actuator": robot.nu,
        "contact": robot.nc,
        **{name: len(labels) for name, labels in LABELS.items()},
    }
    arrays: dict[str, Any] = {
        name: np.zeros((rows, robot.nv))
        if name == "friction_torque" and f"/{name}" not in stored.contents  # as files once were
        else stored.numbers(
            name, (rows, *(sizes[dim] for dim in dims)), finite=status in _ENDED_WELL
        )
        for name, (dims, _, _) in ROWS.items()
    }
    return Run(
        robot=robot,
        ground=_ground(stored),
        method=stored.method(),
        status=status,
        message=stored.text("message"),
        time=time,
        **arrays,
        events=_events(stored, robot),
        certificates=Certificates(**{name: stored.number(f"worst_{name}") for name in WORST}),
        solver=SolverCount(
            name=stored.text("solver_name"),
            **{name: stored.count(f"solver_{name}") for name in COUNTS},
        ),
        steps=stored.count("steps"),
        saturations=stored.count("saturations"),
        timing=Timing(stored.number("compile_s"), stored.number("wall_s")),
        pushes=_pushes(stored, robot),
    )


def _pushes(stored: _Stored, robot: Robot) -> tuple[Push, ...]:
    if "/push_link" not in stored.contents:
        return ()  # files of versions that knew no pushes
    link = stored.numbers("push_link", (None,), whole=True).tolist()
    window, force, point = (
        stored.numbers(f"push_{name}", (len(link), 2)).tolist()
        for name in ("window", "force", "point")
    )
    try:
        pushes = tuple(
            Push(int(link[i]), force=force[i], start=start, duration=duration, point=point[i])
            for i, (start, duration) in enumerate(window)
        )
        for push in pushes:
            push.place(robot)
    except HeelstrikeError as error:
        raise stored.damaged(str(error)) from error
    return pushes


def _ground(stored: _Stored) -> Ground:
    corners = stored.numbers("ground_corner", (None, 2))
    segments = (len(corners) - 1,)
    friction = stored.numbers("ground_friction", segments)
    restitution = stored.numbers("ground_restitution", segments)
    try:
        return Ground.of_numbers(
            {
                "corner": corners,
                "friction": friction,
                "restitution": restitution,
                "slope": np.array(stored.number("ground_slope")),
                "has_profile": np.array(stored.count("ground_has_profile")),
            }
        )
    except HeelstrikeError as error:
        raise stored.damaged(str(error)) from error


def _events(stored: _Stored, robot: Robot) -> tuple[Event, ...]:
    time = stored.numbers("event_time", (None,)).tolist()
    kind, contact = (
        stored.numbers(name, (len(time),), whole=True).tolist() for name in _EVENTS[1:3]
    )
    impulse = stored.numbers("event_impulse", (len(time), 2), finite=False).tolist()
    known = {each.value for each in EventKind}
    for k, c in zip(kind, contact, strict=True):
        if k not in known:
            raise stored.damaged(f"an event is of kind {k:g}, which is none")
        where, count = ("joint", robot.nv) if k in _JOINT_EVENTS else ("contact point", robot.nc)
        if not 0 <= c < count:
            raise stored.damaged(f"an event names a {where} that is not there")
    return tuple(
        Event(time=t, kind=EventKind(int(k)), contact=int(c), impulse=(p[0], p[1]))
        for t, k, c, p in zip(time, kind, contact, impulse, strict=True)
    )


class _Stored:
    """The contents of a file, each number and text of which is checked as it is asked for."""

    def __init__(
        self, source: Path, contents: Mapping[str, NDArray[Any]], classes: Sequence[type]
    ) -> None:
        self.source = source
        self.contents = contents
        self.kinds = {kind.__name__: kind for kind in classes} | METHODS | LAWS

    def damaged(self, what: str) -> RunFileError:
        return RunFileError(f"{self.source}: damaged: {what}")

    def numbers(
        self, name: str, shape: tuple[int | None, ...], *, finite: bool = True, whole: bool = False
    ) -> NDArray[np.float64]:
        """Return a variable of a stated shape; None stands for any length."""
        values = self.contents.get(f"/{name}")
        if values is None:
            raise self.damaged(f"the variable {name!r} is missing, or holds no numbers")
        if values.dtype.kind not in "fi":
            raise self.damaged(f"{name!r} holds text, not numbers")
        fits = len(values.shape) == len(shape) and all(
            wanted in (None, found) for wanted, found in zip(shape, values.shape, strict=True)
        )
        if not fits:
            wanted = " × ".join("any" if n is None else str(n) for n in shape)
            found = " × ".join(str(n) for n in values.shape)
            raise self.damaged(f"{name!r} has shape {found} instead of {wanted}")
        values = np.ascontiguousarray(values, dtype=np.float64)
        if finite and not np.all(np.isfinite(values)):
            row = int(np.argwhere(~np.isfinite(values))[0][0])
            raise self.damaged(f"{name!r} is not finite in row {row}")
        if whole and not np.all(values == np.round(values)):
            raise self.damaged(f"{name!r} holds other than whole numbers")
        return values

    def _attribute(self, name: str) -> NDArray[Any]:
        if f"/@{name}" not in self.contents:
            raise self.damaged(f"the attribute {name!r} is missing, or neither number nor text")
        return self.contents[f"/@{name}"]

    def number(self, name: str) -> float:
        value = self._attribute(name)
        if value.dtype.kind not in "fi":
            raise self.damaged(f"attribute {name!r} is not a number")
        if np.isnan(value):
            raise self.damaged(f"attribute {name!r} is NaN")
        return float(value)

    def count(self, name: str) -> int:
        value = self.number(name)
        if not (0.0 <= value < math.inf and value == round(value)):
            raise self.damaged(f"attribute {name!r} is {value:g}, not a count")
        return int(self._attribute(name))

    def text(self, name: str) -> str:
        value = self._attribute(name)
        if value.dtype.kind != "U":
            raise self.damaged(f"attribute {name!r} is not text")
        return str(value)

    def member(self, name: str, members: Mapping[str, Any]) -> Any:
        value = self.text(name)
        if value not in members:
            shown = value if len(value) <= 60 else value[:57] + "…"
            raise RunFileError(
                f"{self.source}: {name} {shown!r} is unknown; known are {', '.join(members)}"
            )
        return members[value]

    def plain(self, name: str) -> str | int | float:
        """Return an attribute as it was written."""
        kind = self._attribute(name).dtype.kind
        if kind == "U":
            return self.text(name)
        return int(self._attribute(name)) if kind == "i" else self.number(name)

    def method(self) -> Method | UnknownMethod:
        """Make the method; of one that is not known, or whose laws are not, return what is told."""
        name = self.text("method")
        if not name.isidentifier():
            raise self.damaged(f"the method is called {name[:60]!r}")
        kind = self.kinds.get(name)
        try:
            if kind is not None and issubclass(kind, Method):
                made: Method = self.rebuilt("method", kind)
                return made
        except _UnknownLawError:
            pass
        begin = "/@method_"
        names = (key.removeprefix(begin) for key in self.contents if key.startswith(begin))
        return UnknownMethod(
            name=name,
            settings={setting: self.plain(f"method_{setting}") for setting in names},
            impulses_in_events="/@impulses_in_events" in self.contents
            and self.count("impulses_in_events") != 0,
        )

    def rebuilt(self, prefix: str, kind: Any) -> Any:
        """Make a frozen dataclass from its fields, as `to_dataset` wrote them."""
        # A setting that did not exist when the file was written has its default.
        values = {
            field.name: self._setting(f"{prefix}_{field.name}", field)
            for field in fields(kind)
            if field.init
            and (f"/@{prefix}_{field.name}" in self.contents or field.default is MISSING)
        }
        try:
            return kind(**values)
        except HeelstrikeError as error:
            raise self.damaged(str(error)) from error
        except Exception as error:  # a setting that may not be None; what a class from outside says
            raise self.damaged(f"the settings of {prefix} do not fit: {error}") from error

    def _setting(self, name: str, field: Field[Any]) -> Any:
        default = field.default
        stored = self.contents.get(f"/@{name}")
        if stored is not None and stored.dtype.kind == "U" and str(stored) == NONE:
            return None
        if field.default_factory is not MISSING or is_dataclass(default):
            law = self.text(name)
            if law not in self.kinds:
                raise _UnknownLawError
            return self.rebuilt(name, self.kinds[law])
        if isinstance(default, enum.Enum):
            return self.member(name, {member.name.lower(): member for member in type(default)})
        if isinstance(default, bool):
            return self.count(name) != 0
        if isinstance(default, str):
            return self.text(name)
        return self.number(name) if isinstance(default, float) else self.plain(name)


class _UnknownLawError(Exception):
    """A method has a law that is not known."""
