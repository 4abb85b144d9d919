"""Runs as labelled datasets."""

from __future__ import annotations

import enum
from dataclasses import fields, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.compliant.method import Compliant
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.method import UnknownMethod
from heelstrike.sim.run import Run
from heelstrike.sim.time_stepping.method import TimeStepping

if TYPE_CHECKING:
    import xarray

FORMAT = 1
"""Version of the layout of the files."""

ROBOT_GROUP = "robot"

# Field of Run -> dimensions, unit, description.
ROWS = {
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
LABELS = {
    "axis": ["x", "z"],
    "component": ["normal", "tangent"],
    "condition": ["complementarity", "cone", "non-penetration"],
    "window": ["start", "duration"],
}
METHODS = {kind.__name__: kind for kind in (TimeStepping, EventDriven, Compliant)}
LAWS = {
    kind.__name__: kind
    for kind in (HuntCrossley, KelvinVoigt, RegularisedFriction, BristleFriction)
}
NONE = "none"
"""How a setting that is None is written, for NetCDF has no such attribute."""
COUNTS = ("solves", "shortcuts", "fallbacks", "failures")
WORST = ("penetration", "complementarity", "cone", "non_penetration")


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
        for name, (dims, units, words) in ROWS.items()
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
        **LABELS,
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
        "message": _writable(run.message),
        "method": run.method.name,
        **_settings("method", run.method),
        "impulses_in_events": int(run.method.impulses_in_events),
        "ground_slope": float(run.ground.slope),
        "ground_has_profile": int(run.ground.profile is not None),
        **{f"worst_{name}": float(getattr(run.certificates, name)) for name in WORST},
        "solver_name": run.solver.name,
        **{f"solver_{name}": int(getattr(run.solver, name)) for name in COUNTS},
        "steps": run.steps,
        "saturations": run.saturations,
        "compile_s": run.timing.compile_s,
        "wall_s": run.timing.wall_s,
        "error": (
            "" if run.error is None else _writable(f"{type(run.error).__name__}: {run.error}")
        ),
        **{f"{name}_version": _version(name) for name in ("heelstrike", "numpy", "numba")},
    }


def _settings(prefix: str, thing: Any) -> dict[str, str | int | float]:
    """Fields of a frozen dataclass as attributes: enums by name, dataclasses with their own."""
    if isinstance(thing, UnknownMethod):
        return {f"{prefix}_{name}": value for name, value in thing.settings.items()}
    settings: dict[str, str | int | float] = {}
    for field in fields(thing) if is_dataclass(thing) else ():
        name, value = f"{prefix}_{field.name}", getattr(thing, field.name)
        if is_dataclass(value):
            settings |= {name: type(value).__name__, **_settings(name, value)}
        else:
            settings[name] = _plain(value)
    return settings


_PLAIN = (str, int, float, enum.Enum, np.bool_, np.number)


def unreadable(thing: Any) -> str:
    """Say why a method, or a law of it, could not be made again of its settings; or nothing."""
    if isinstance(thing, UnknownMethod):
        return ""
    kind: Any = type(thing)
    if not getattr(getattr(kind, "__dataclass_params__", None), "frozen", False):
        return f"{kind.__name__} is not a frozen dataclass"
    if (METHODS | LAWS).get(kind.__name__, kind) is not kind:
        return f"heelstrike has a {kind.__name__} of its own; call it something else"
    for field in fields(thing):
        value = getattr(thing, field.name)
        if is_dataclass(value):
            if reason := unreadable(value):
                return reason
        elif value is not None and not isinstance(value, _PLAIN):
            return f"its setting {field.name} is neither number nor text, but {value!r}"
    return ""


def _plain(value: Any) -> str | int | float:
    if value is None:
        return NONE
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, bool | np.bool_):
        return int(value)  # NetCDF knows no truth values either
    return value if isinstance(value, str | int) else float(value)


def _writable(text: str) -> str:
    """Text without what NetCDF cannot hold: halves of characters, and the null character."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("\0", "\\0")


def _version(package: str) -> str:
    if package == "heelstrike":
        from heelstrike import __version__

        return __version__
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
