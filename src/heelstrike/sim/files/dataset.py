"""Runs as labelled datasets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from heelstrike.robot.model import SELDOM
from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.constraint import constraint_names
from heelstrike.sim.files.logs import DIMENSIONS, log_attribute, log_variables
from heelstrike.sim.files.settings import constraint_settings, settings, shape_settings
from heelstrike.sim.files.variables import Variable
from heelstrike.sim.push import numbers_of_pushes
from heelstrike.sim.run import EVENT_MEMBERS, QUANTITIES, SOLVED, WORST, Run

if TYPE_CHECKING:
    import xarray

FORMAT = 1
"""Version of the layout of the files."""

ROBOT_GROUP = "robot"

ROWS = {
    name: Variable(
        ("time", *(DIMENSIONS[extent] for extent in each.shape)),
        each.unit,
        each.label,
        default=0.0 if each.later else None,
    )
    for name, each in QUANTITIES.items()
}
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
GROUND = {
    "ground_corner": Variable(
        ("corner", "axis"), "m", "corners of the ground; its end segments go on forever"
    ),
    "ground_friction": Variable(
        ("segment",), "1", "friction coefficient of the segments of the ground"
    ),
    "ground_restitution": Variable(("segment",), "1", "restitution of the segments of the ground"),
}
PUSHES = {
    "push_link": Variable(("push",), "1", "index of the link that was pushed", int, default=0),
    "push_point": Variable(("push", "axis"), "m", "where it was pushed, in the axes of the link"),
    "push_force": Variable(("push", "axis"), "N", "force of the push on the robot"),
    "push_window": Variable(("push", "window"), "s", "beginning and duration of the push"),
}


def _seldom(name: str) -> bool:
    """Whether a quantity is one of what most robots have nothing of, which need not be told."""
    return any(extent in (*SELDOM, "constraints") for extent in QUANTITIES[name].shape)


def labels(robot: Robot) -> dict[str, list[str]]:
    """Return what counts along the dimensions of a dataset."""
    return {
        "coordinate": list(robot.joint_names),
        "actuator": list(robot.actuator_names),
        "contact": list(robot.contact_names),
        "loop": list(robot.loop_names),
        "coupling": list(robot.coupling_names),
        "brake": list(robot.brake_names),
        "constraint": constraint_names(robot),
        "axis": ["x", "z"],
        "component": ["normal", "tangent"],
        "condition": ["complementarity", "cone", "non-penetration"],
        "window": ["start", "duration"],
    }


def to_dataset(run: Run) -> xarray.Dataset:
    """Return a run as a labelled dataset.

    Dimensions are ``time``, ``coordinate``, ``actuator``, ``contact``, ``axis`` (x, z),
    ``component`` (normal, tangent), ``condition`` and ``event``; every variable has ``units`` and a
    ``long_name``, and how the run ended is in the attributes. What the controller logged is in the
    variables ``log_<name>``.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    xarray.Dataset
    """
    import xarray

    columns: list[Any] = [[getattr(event, name) for event in run.events] for name in EVENT_MEMBERS]
    columns[-1] = np.reshape(columns[-1], (-1, 2))  # of no events, too
    values: dict[str, Any] = {
        **{name: rows for name in ROWS if (rows := getattr(run, name)).size or not _seldom(name)},
        **dict(zip(EVENTS, columns, strict=True)),
        **{f"ground_{name}": each for name, each in run.ground.numbers().items()},
        **{f"push_{name}": each for name, each in numbers_of_pushes(run.robot, run.pushes).items()},
    }
    declared = ROWS | EVENTS | GROUND | PUSHES
    variables = {
        name: each.written(values[name]) for name, each in declared.items() if name in values
    }
    variables["event_kind"][2].update(
        flag_values=np.array([kind.value for kind in EventKind]),
        flag_meanings=" ".join(kind.name.lower() for kind in EventKind),
    )
    variables |= log_variables(run)
    # A dimension of length zero has no labels, and an empty list would pass for numbers.
    coordinates: dict[str, Any] = {dim: names for dim, names in labels(run.robot).items() if names}
    coordinates["time"] = TIME["time"].written(run.time)
    return xarray.Dataset(variables, coords=coordinates, attrs=_attributes(run))


def _attributes(run: Run) -> dict[str, Any]:
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
        "ground_slope": float(run.ground.slope),
        "ground_has_profile": int(run.ground.profile is not None),
        **shape_settings(run.ground),
        **constraint_settings(run.robot),
        **{f"worst_{name}": getattr(run.certificates, name) for name in WORST},
        "solver_name": run.solver.name,
        **{f"solver_{name}": getattr(run.solver, name) for name in SOLVED},
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
