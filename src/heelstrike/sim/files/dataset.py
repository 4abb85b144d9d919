"""Runs as labelled datasets."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.files.layout import DIMENSIONS as DIMENSIONS
from heelstrike.sim.files.layout import Layout, layout_of
from heelstrike.sim.files.logs import log_attribute, log_variables
from heelstrike.sim.files.settings import settings
from heelstrike.sim.files.variables import Variable
from heelstrike.sim.push import numbers_of_pushes
from heelstrike.sim.run import EVENT_MEMBERS, AnyRun

if TYPE_CHECKING:
    import xarray

FORMAT = 1
"""Version of the layout of the files."""

ROBOT_GROUP = "robot"

TIME = {"time": Variable(("time",), "s", "time")}
EVENTS = {
    "event_time": Variable(("event",), "s", "time of the event"),
    "event_kind": Variable(("event",), "1", "what happened", int),
    "event_contact": Variable(
        ("event",), "1", "index of the contact point, or of the joint of a joint event", int
    ),
    "event_impulse": Variable(
        ("event", "component"),
        "N s",
        "impulse on the robot in the step of the event",
        allowed="anything",
    ),
}
PUSHES = {
    "push_link": Variable(("push",), "1", "index of the link that was pushed", int, default=0),
    "push_point": Variable(("push", "axis"), "m", "where it was pushed, in the axes of the link"),
    "push_force": Variable(("push", "axis"), "N", "force of the push on the robot"),
    "push_window": Variable(("push", "window"), "s", "beginning and duration of the push"),
}


def to_dataset(run: AnyRun) -> xarray.Dataset:
    """Return a run as a labelled dataset.

    Dimensions are ``time``, ``coordinate``, ``actuator``, ``contact``, ``axis`` (x, z),
    ``component`` (normal, tangent), ``condition`` and ``event``; in space ``q`` and ``v`` instead
    of ``coordinate``, ``axis`` (x, y, z), ``component`` (normal, t1, t2) and ``tangent`` (t1, t2).
    Every variable has ``units`` and a ``long_name``, and how the run ended is in the attributes.
    What the controller logged is in the variables ``log_<name>``.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.

    Returns
    -------
    xarray.Dataset
    """
    import xarray

    layout = layout_of(run)
    rows, ground = layout.rows(), run.ground.numbers()
    columns: list[Any] = [[getattr(event, name) for event in run.events] for name in EVENT_MEMBERS]
    columns[-1] = np.reshape(columns[-1], (-1, layout.axes))  # of no events, too
    values: dict[str, Any] = {
        **{
            name: each
            for name in rows
            if (each := getattr(run, name)).size or not layout.is_seldom(name)
        },
        **dict(zip(EVENTS, columns, strict=True)),
        **{f"ground_{name}": each for name, each in ground.items()},
        **{f"push_{name}": each for name, each in numbers_of_pushes(run.robot, run.pushes).items()},
    }
    declared = rows | EVENTS | layout.ground | PUSHES
    variables = {
        name: each.written(values[name]) for name, each in declared.items() if name in values
    }
    for name in rows.keys() & variables.keys():
        dims, array, told = variables[name]
        if "actuator" in dims:
            told["units"] = layout.unit_along(run.robot, "actuator", array.shape[1], told["units"])
    variables["event_kind"][2].update(
        flag_values=np.array([kind.value for kind in EventKind]),
        flag_meanings=" ".join(kind.name.lower() for kind in EventKind),
    )
    variables |= log_variables(run, layout.extents)
    # A dimension of length zero has no labels, and an empty list would pass for numbers.
    coordinates: dict[str, Any] = {
        dim: names for dim, names in layout.labels(run.robot).items() if names
    }
    coordinates["time"] = TIME["time"].written(run.time)
    return xarray.Dataset(variables, coords=coordinates, attrs=_attributes(run, layout))


def _attributes(run: AnyRun, layout: Layout) -> dict[str, Any]:
    error = "" if run.error is None else f"{type(run.error).__name__}: {run.error}"
    return {
        "heelstrike_format": FORMAT,
        "title": f"heelstrike run of {run.robot.name}",
        "robot": run.robot.name,
        "status": run.status.value,
        "message": _writable(run.message),
        "method": run.method.name,
        **settings("method", run.method),
        "impulses_in_events": int(run.method.impulses_in_events),
        **layout.attributes(run),
        **{f"worst_{name}": value for name, value in asdict(run.certificates).items()},
        **{f"solver_{name}": value for name, value in asdict(run.solver).items()},
        "steps": run.steps,
        "saturations": run.saturations,
        **{name: _writable(text) for name, text in log_attribute(run).items()},
        "compile_s": run.timing.compile_s,
        "wall_s": run.timing.wall_s,
        "error": _writable(error),
        **{f"{name}_version": number for name, number in _versions().items()},
    }


def _writable(text: str) -> str:
    """Text without what NetCDF cannot hold: halves of characters, and the null character."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("\0", "\\0")


def _versions() -> dict[str, str]:
    from heelstrike import __version__

    return {"heelstrike": __version__, "numpy": np.__version__, "numba": numba.__version__}
