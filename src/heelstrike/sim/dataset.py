"""Runs as labelled datasets and NetCDF files.

A file holds the dataset of :func:`to_dataset`, readable by any NetCDF or HDF5 tool, and in the
group ``robot`` the numbers of the robot, so that a run can be read again without the robot's own
file. Everything in it is numbers and text: reading never executes anything.
"""

from __future__ import annotations

import contextlib
import enum
import math
import os
from dataclasses import MISSING, fields, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.errors import HeelstrikeError, RunFileError
from heelstrike.robot.robot import Robot
from heelstrike.sim.compliant import Compliant
from heelstrike.sim.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.event_driven import EventDriven
from heelstrike.sim.push import Push
from heelstrike.sim.robot_dataset import robot_from_dataset, robot_to_dataset
from heelstrike.sim.run import Certificates, Event, Run, SolverCount, Timing
from heelstrike.sim.status import EventKind, RunStatus
from heelstrike.sim.time_stepping import TimeStepping

if TYPE_CHECKING:
    import xarray

FORMAT = 1
"""Version of the layout of the files."""

ROBOT_GROUP = "robot"

# Field of Run -> dimensions, unit, description.
_ROWS = {
    "position": (("coordinate",), "m or rad", "generalised positions"),
    "velocity": (("coordinate",), "m/s or rad/s", "generalised velocities"),
    "torque": (("actuator",), "N m", "joint torques within their limits"),
    "stop_torque": (("coordinate",), "N m or N", "force of the joint stops on the robot"),
    "friction_torque": (("coordinate",), "N m or N", "dry friction of the joints on the robot"),
    "contact_point": (("contact", "axis"), "m", "world position of the contact points"),
    "contact_normal": (("contact", "axis"), "1", "ground normal under the contact points"),
    "gap": (("contact",), "m", "distance of the contact points to the ground"),
    "contact_force": (
        ("contact", "component"),
        "N",
        "force on the robot at the contact points, mean over the step that follows",
    ),
    "slip_velocity": (
        ("contact",),
        "m/s",
        "tangential velocity of the contact points at the end of the step",
    ),
    "residual": (("condition",), "1", "relative residuals of the contact problem"),
}
_LABELS = {
    "axis": ["x", "z"],
    "component": ["normal", "tangent"],
    "condition": ["complementarity", "cone", "non-penetration"],
    "window": ["start", "duration"],
}
_METHODS = {kind.__name__: kind for kind in (TimeStepping, EventDriven, Compliant)}
_LAWS = {
    kind.__name__: kind
    for kind in (HuntCrossley, KelvinVoigt, RegularisedFriction, BristleFriction)
}
NONE = "none"
"""How a setting that is None is written, for NetCDF has no such attribute."""
_COUNTS = ("solves", "shortcuts", "fallbacks", "failures")
_WORST = ("penetration", "complementarity", "cone", "non_penetration")
_JOINT_EVENTS = (EventKind.JOINT_STOP, EventKind.JOINT_SLIP, EventKind.JOINT_STICK)
_EVENTS = ("event_time", "event_kind", "event_contact", "event_impulse")


def to_dataset(run: Run) -> xarray.Dataset:
    """Return a run as a labelled dataset.

    Dimensions are ``time``, ``coordinate``, ``actuator``, ``contact``, ``axis`` (x, z),
    ``component`` (normal, tangent), ``condition`` and ``event``; every variable has ``units`` and a
    ``long_name``, and how the run ended is in the attributes.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    xarray.Dataset
    """
    import xarray

    robot = run.robot
    variables: dict[str, Any] = {
        name: (("time", *dims), getattr(run, name), {"units": units, "long_name": words})
        for name, (dims, units, words) in _ROWS.items()
    }
    events = run.events
    kinds = np.array([event.kind.value for event in events], dtype=np.int64)
    variables |= {
        "event_time": (
            ("event",),
            np.array([event.time for event in events], dtype=np.float64),
            {"units": "s", "long_name": "time of the event"},
        ),
        "event_kind": (
            ("event",),
            kinds,
            {
                "units": "1",
                "long_name": "what happened",
                "flag_values": np.array([kind.value for kind in EventKind]),
                "flag_meanings": " ".join(kind.name.lower() for kind in EventKind),
            },
        ),
        "event_contact": (
            ("event",),
            np.array([event.contact for event in events], dtype=np.int64),
            {
                "units": "1",
                "long_name": "index of the contact point, or of the joint of a joint event",
            },
        ),
        "event_impulse": (
            ("event", "component"),
            np.array([event.impulse for event in events], dtype=np.float64).reshape(-1, 2),
            {"units": "N s", "long_name": "impulse on the robot in the step of the event"},
        ),
    }
    ground = run.ground.model()
    variables |= {
        "ground_corner": (
            ("corner", "axis"),
            ground.vertices,
            {"units": "m", "long_name": "corners of the ground; its end segments go on for ever"},
        ),
        "ground_friction": (
            ("segment",),
            ground.friction,
            {"units": "1", "long_name": "friction coefficient of the segments of the ground"},
        ),
        "ground_restitution": (
            ("segment",),
            ground.restitution,
            {"units": "1", "long_name": "restitution of the segments of the ground"},
        ),
    }
    places = [push.place(robot) for push in run.pushes]
    variables |= {
        "push_link": (
            ("push",),
            np.array([link for link, _ in places], dtype=np.int64),
            {"units": "1", "long_name": "index of the link that was pushed"},
        ),
        "push_point": (
            ("push", "axis"),
            np.array([point for _, point in places], dtype=np.float64).reshape(-1, 2),
            {"units": "m", "long_name": "where it was pushed, in the axes of the link"},
        ),
        "push_force": (
            ("push", "axis"),
            np.array([push.force for push in run.pushes], dtype=np.float64).reshape(-1, 2),
            {"units": "N", "long_name": "force of the push on the robot"},
        ),
        "push_window": (
            ("push", "window"),
            np.array([(p.start, p.duration) for p in run.pushes], dtype=np.float64).reshape(-1, 2),
            {"units": "s", "long_name": "beginning and duration of the push"},
        ),
    }
    coordinates: dict[str, Any] = {
        "time": (("time",), run.time, {"units": "s", "long_name": "time"}),
        "coordinate": list(robot.joint_names),
        "actuator": list(robot.actuator_names),
        "contact": list(robot.contact_names),
        **_LABELS,
    }
    # A dimension of length zero has no labels, and an empty list would pass for numbers.
    coordinates = {name: value for name, value in coordinates.items() if len(value)}
    return xarray.Dataset(variables, coords=coordinates, attrs=_attributes(run))


def _attributes(run: Run) -> dict[str, Any]:
    return {
        "heelstrike_format": FORMAT,
        "title": f"heelstrike run of {run.robot.name}",
        "robot": run.robot.name,
        "status": run.status.value,
        "message": run.message,
        "method": type(run.method).__name__,
        **_settings("method", run.method),
        "ground_slope": float(run.ground.slope),
        "ground_has_profile": int(run.ground.profile is not None),
        **{f"worst_{name}": float(getattr(run.certificates, name)) for name in _WORST},
        "solver_name": run.solver.name,
        **{f"solver_{name}": int(getattr(run.solver, name)) for name in _COUNTS},
        "steps": run.steps,
        "saturations": run.saturations,
        "compile_s": run.timing.compile_s,
        "wall_s": run.timing.wall_s,
        "error": "" if run.error is None else f"{type(run.error).__name__}: {run.error}",
        **{f"{name}_version": _version(name) for name in ("heelstrike", "numpy", "numba")},
    }


def _settings(prefix: str, thing: Any) -> dict[str, str | int | float]:
    """Fields of a frozen dataclass as attributes: enums by name, dataclasses with their own."""
    settings: dict[str, str | int | float] = {}
    for field in fields(thing):
        name, value = f"{prefix}_{field.name}", getattr(thing, field.name)
        if is_dataclass(value):
            settings |= {name: type(value).__name__, **_settings(name, value)}
        else:
            settings[name] = _plain(value)
    return settings


def _plain(value: Any) -> str | int | float:
    if value is None:
        return NONE
    if isinstance(value, enum.Enum):
        return value.name.lower()
    return value if isinstance(value, str | int) else float(value)


def _version(package: str) -> str:
    if package == "heelstrike":
        from heelstrike import __version__

        return __version__
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def save(run: Run, path: str | os.PathLike[str]) -> Path:
    """Write a run as NetCDF. The file appears whole or not at all.

    Parameters
    ----------
    run : Run
        The run.
    path : str or path
        File to write, by custom ``.nc``; an existing one is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunFileError
        If the folder does not exist or cannot be written to.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise RunFileError(f"cannot write {target}: there is no folder {target.parent}")
    if target.is_dir():
        raise RunFileError(f"cannot write {target}: it is a folder; give the name of a file")
    dataset = to_dataset(run)
    compression = {"zlib": True, "complevel": 1, "shuffle": True}
    encoding = {
        name: {"_FillValue": None, **(compression if dataset[name].size > 1000 else {})}
        for name in dataset.variables
        if dataset[name].dtype.kind == "f"
    }
    # Written beside the target first, so that a failure leaves an older file alone.
    name = str(target.with_name(f".{target.name}.{os.getpid()}.part"))
    try:
        dataset.to_netcdf(name, mode="w", engine="h5netcdf", encoding=encoding)
        robot_to_dataset(run.robot).to_netcdf(name, mode="a", engine="h5netcdf", group=ROBOT_GROUP)
        Path(name).replace(target)
    except OSError as error:
        raise RunFileError(f"cannot write {target}: {error.strerror or error}") from error
    finally:
        Path(name).unlink(missing_ok=True)
    return target


def load_run(path: str | os.PathLike[str], robot: Robot | None = None) -> Run:
    """Read a run that was saved with :func:`save`.

    Parameters
    ----------
    path : str or path
        The NetCDF file.
    robot : Robot, optional
        Robot to attach to the run, instead of the one the file describes. Its coordinates,
        actuators and contact points must have the names of the file's.

    Returns
    -------
    Run
        The run as it was saved; of an exception of the controller only the message remains.

    Raises
    ------
    RunFileError
        If there is no such file, it is not a run of heelstrike, or it is damaged.
    """
    source = Path(path)
    if source.is_dir():
        raise RunFileError(f"{source} is a folder; give the name of a saved run")
    if not source.is_file():
        raise RunFileError(f"there is no file {source}")
    try:
        return _read(source, robot)
    except RunFileError:
        raise
    except MemoryError as error:
        raise RunFileError(f"{source}: the run does not fit into memory") from error
    except Exception as error:  # whatever a damaged file makes its readers raise
        raise RunFileError(
            f"{source}: not a run of heelstrike, or damaged ({type(error).__name__}: {error})"
        ) from error


def _read(source: Path, robot: Robot | None) -> Run:
    _refuse_bombs(source)
    with contextlib.ExitStack() as stack:
        dataset = stack.enter_context(_open(source, None))
        layout = dataset.attrs.get("heelstrike_format")
        if layout is None:
            raise RunFileError(f"{source}: this NetCDF file is not a run of heelstrike")
        if int(layout) != FORMAT:
            raise RunFileError(
                f"{source}: written in layout {layout}, this version of heelstrike reads "
                f"{FORMAT}. Update heelstrike."
            )
        described = stack.enter_context(_open(source, ROBOT_GROUP))
        try:
            stored = robot_from_dataset(described.load())
        except (KeyError, ValueError) as error:
            raise RunFileError(f"{source}: the robot in the file is damaged: {error}") from error
        if robot is not None:
            _check_same(source, robot, stored)
        return _run(source, dataset, stored if robot is None else robot)


def _open(source: Path, group: str | None) -> xarray.Dataset:
    import xarray

    try:
        return xarray.open_dataset(
            source, engine="h5netcdf", group=group, decode_cf=False, cache=False
        )
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        what = "not a run of heelstrike, or cut short" if group is None else "it holds no robot"
        raise RunFileError(f"{source}: {what} ({error})") from error


def _refuse_bombs(source: Path) -> None:
    """Refuse a small file that claims to hold a huge run, before any of it is read."""
    import h5py  # type: ignore[import-untyped]

    declared = 0

    def count(_: str, item: Any) -> None:
        nonlocal declared
        if isinstance(item, h5py.Dataset) and item.shape is not None:
            declared += math.prod(item.shape) * item.dtype.itemsize

    try:
        with h5py.File(source, "r") as file:
            file.visititems(count)
    except PermissionError as error:
        raise RunFileError(f"{source}: no permission to read it") from error
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise RunFileError(f"{source}: not a run of heelstrike, or cut short ({error})") from error
    # zlib shrinks a thousandfold at best.
    if declared > 1100 * source.stat().st_size + 2**20:
        raise RunFileError(
            f"{source}: damaged. It claims to hold {declared / 2**20:.0f} MiB, more than a file of "
            "its size can."
        )


def _check_same(source: Path, robot: Robot, stored: Robot) -> None:
    for what in ("joint_names", "actuator_names", "contact_names"):
        ours, theirs = getattr(robot, what), getattr(stored, what)
        if ours != theirs:
            raise RunFileError(
                f"{source}: the run is one of another robot than {robot.name!r}: its "
                f"{what.replace('_', ' ')} are {', '.join(theirs)}, not {', '.join(ours)}"
            )


def _run(source: Path, dataset: xarray.Dataset, robot: Robot) -> Run:
    attributes = dataset.attrs
    rows = len(_numbers(source, dataset, "time", (None,)))
    sizes = {
        "coordinate": robot.nv,
        "actuator": robot.nu,
        "contact": robot.nc,
        **{name: len(labels) for name, labels in _LABELS.items()},
    }
    arrays: dict[str, Any] = {
        name: np.zeros((rows, robot.nv))
        if name == "friction_torque" and name not in dataset.variables  # as files once were
        else _numbers(source, dataset, name, (rows, *(sizes[dim] for dim in dims)))
        for name, (dims, _, _) in _ROWS.items()
    }
    text = _Attributes(source, attributes)
    method = text.member("method", _METHODS)
    return Run(
        robot=robot,
        ground=_ground(source, dataset, text),
        method=text.rebuilt("method", method),
        status=text.member("status", {s.value: s for s in RunStatus}),
        message=text.text("message"),
        time=_numbers(source, dataset, "time", (rows,)),
        **arrays,
        events=_events(source, dataset, robot),
        certificates=Certificates(**{name: text.number(f"worst_{name}") for name in _WORST}),
        solver=SolverCount(
            name=text.text("solver_name"),
            **{name: int(text.number(f"solver_{name}")) for name in _COUNTS},
        ),
        steps=int(text.number("steps")),
        saturations=int(text.number("saturations")),
        timing=Timing(text.number("compile_s"), text.number("wall_s")),
        pushes=_pushes(source, dataset, robot),
    )


def _pushes(source: Path, dataset: xarray.Dataset, robot: Robot) -> tuple[Push, ...]:
    if "push_link" not in dataset.variables:
        return ()  # files of versions that knew no pushes
    count = len(_numbers(source, dataset, "push_link", (None,)))
    link, window, force, point = (
        _numbers(source, dataset, f"push_{name}", shape).tolist()
        for name, shape in (
            ("link", (count,)),
            ("window", (count, 2)),
            ("force", (count, 2)),
            ("point", (count, 2)),
        )
    )
    try:
        pushes = tuple(
            Push(int(link[i]), force=force[i], start=start, duration=duration, point=point[i])
            for i, (start, duration) in enumerate(window)
        )
        for push in pushes:
            push.place(robot)
    except HeelstrikeError as error:
        raise RunFileError(f"{source}: damaged: {error}") from error
    return pushes


def _ground(source: Path, dataset: xarray.Dataset, text: _Attributes) -> Ground:
    corners = _numbers(source, dataset, "ground_corner", (None, 2))
    segments = (len(corners) - 1,)
    friction = _numbers(source, dataset, "ground_friction", segments)
    restitution = _numbers(source, dataset, "ground_restitution", segments)
    try:
        return Ground(
            friction=_one_if_equal(friction),
            restitution=_one_if_equal(restitution),
            slope=text.number("ground_slope"),
            profile=corners if text.number("ground_has_profile") else None,
        )
    except HeelstrikeError as error:
        raise RunFileError(f"{source}: damaged: {error}") from error


def _one_if_equal(values: NDArray[np.float64]) -> NDArray[np.float64] | float:
    return float(values[0]) if len(values) and np.all(values == values[0]) else values


def _events(source: Path, dataset: xarray.Dataset, robot: Robot) -> tuple[Event, ...]:
    count = len(_numbers(source, dataset, "event_time", (None,)))
    time, kind, contact = (
        _numbers(source, dataset, name, (count,)).tolist() for name in _EVENTS[:3]
    )
    impulse = _numbers(source, dataset, "event_impulse", (count, 2)).tolist()
    for k, c in zip(kind, contact, strict=True):
        where, count = ("joint", robot.nv) if k in _JOINT_EVENTS else ("contact point", robot.nc)
        if not 0 <= c < count:
            raise RunFileError(f"{source}: damaged, an event names a {where} that is not there")
    return tuple(
        Event(time=t, kind=EventKind(int(k)), contact=int(c), impulse=(p[0], p[1]))
        for t, k, c, p in zip(time, kind, contact, impulse, strict=True)
    )


def _numbers(
    source: Path, dataset: xarray.Dataset, name: str, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """Read a variable of a stated shape as numbers; None stands for any length."""
    if name not in dataset.variables:
        raise RunFileError(f"{source}: damaged, the variable {name!r} is missing")
    variable = dataset[name]
    if variable.dtype.kind not in "fiu":
        raise RunFileError(f"{source}: damaged, {name!r} holds {variable.dtype}, not numbers")
    fits = len(variable.shape) == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, variable.shape, strict=False)
    )
    if not fits:
        wanted = " × ".join("any" if n is None else str(n) for n in shape)
        found = " × ".join(str(n) for n in variable.shape)
        raise RunFileError(f"{source}: damaged, {name!r} has shape {found} instead of {wanted}")
    return np.ascontiguousarray(variable.values, dtype=np.float64)


class _Attributes:
    """The attributes of a file, each checked as it is read."""

    def __init__(self, source: Path, values: dict[str, Any]) -> None:
        self.source = source
        self.values = values

    def _value(self, name: str) -> Any:
        if name not in self.values:
            raise RunFileError(f"{self.source}: damaged, the attribute {name!r} is missing")
        return self.values[name]

    def number(self, name: str) -> float:
        value = np.asarray(self._value(name))
        if value.size != 1 or value.dtype.kind not in "fiu":
            raise RunFileError(f"{self.source}: damaged, attribute {name!r} is not a number")
        return float(value.item())

    def text(self, name: str) -> str:
        value = self._value(name)
        if not isinstance(value, str):
            raise RunFileError(f"{self.source}: damaged, attribute {name!r} is not text")
        return value

    def member(self, name: str, members: dict[str, Any]) -> Any:
        value = self.text(name)
        if value not in members:
            raise RunFileError(
                f"{self.source}: {name} {value!r} is unknown; known are {', '.join(members)}"
            )
        return members[value]

    def rebuilt(self, prefix: str, kind: Any) -> Any:
        """Make a frozen dataclass from its fields, as `_settings` wrote them."""
        values: dict[str, Any] = {}
        for field in fields(kind):
            name = f"{prefix}_{field.name}"
            default = field.default
            if name not in self.values and default is not MISSING:
                continue  # a setting that did not exist when the file was written
            if self.values.get(name) == NONE:
                values[field.name] = None
            elif field.default_factory is not MISSING:
                values[field.name] = self.rebuilt(name, self.member(name, _LAWS))
            elif isinstance(default, enum.Enum):
                members = {member.name.lower(): member for member in type(default)}
                values[field.name] = self.member(name, members)
            elif isinstance(default, str):
                values[field.name] = self.text(name)
            else:
                values[field.name] = self.number(name)
        try:
            return kind(**values)
        except HeelstrikeError as error:
            raise RunFileError(f"{self.source}: damaged: {error}") from error
