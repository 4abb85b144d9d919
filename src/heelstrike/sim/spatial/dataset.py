"""Runs in space as labelled datasets, and as files."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.errors import RunFileError, WriteError
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import RECORDED, SpatialRun
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    import xarray


def dataset_of(run: SpatialRun) -> xarray.Dataset:
    """Return a run as a labelled dataset; see :meth:`SpatialRun.to_dataset`."""
    import xarray

    variables: dict[str, Any] = {
        name: (
            ("time", *each.dims),
            getattr(run, name),
            {"units": each.unit, "long_name": each.label},
        )
        for name, each in RECORDED.items()
    }
    events = run.events
    variables["event_time"] = (
        ("event",), np.array([each.time for each in events], dtype=float),
        {"units": "s", "long_name": "time of the event"},
    )  # fmt: skip
    variables["event_kind"] = (
        ("event",), np.array([int(each.kind) for each in events], dtype=np.int64),
        {
            "long_name": "what happened",
            "flag_values": np.array([int(kind) for kind in SpatialEventKind]),
            "flag_meanings": " ".join(kind.name.lower() for kind in SpatialEventKind),
        },
    )  # fmt: skip
    variables["event_contact"] = (
        ("event",), np.array([each.contact for each in events], dtype=np.int64),
        {"long_name": "index of the contact point, joint or velocity of the event"},
    )  # fmt: skip
    variables["event_impulse"] = (
        ("event", "component"),
        np.array([each.impulse for each in events], dtype=float).reshape(-1, 3),
        {"units": "N s", "long_name": "impulse on the robot in the step of the event"},
    )
    labels: dict[str, Any] = {
        "q": list(run.robot.position_names),
        "v": list(run.robot.velocity_names),
        "actuator": list(run.robot.actuator_names),
        "contact": list(run.robot.contact_names),
        "axis": ["x", "y", "z"],
        "component": ["normal", "t1", "t2"],
        "tangent": ["t1", "t2"],
    }
    coordinates: dict[str, Any] = {name: names for name, names in labels.items() if names}
    coordinates["time"] = ("time", run.time, {"units": "s", "long_name": "time"})
    return xarray.Dataset(variables, coords=coordinates, attrs=_attributes(run))


def _attributes(run: SpatialRun) -> dict[str, Any]:
    worst, solver = run.certificates, run.solver
    ground = run.ground
    return {
        "title": f"heelstrike run of {run.robot.name} in space",
        "robot": run.robot.name,
        "status": run.status.value,
        "message": run.message,
        "method": repr(run.method),
        "ground_normal": np.array(ground.normal, dtype=float),
        "ground_height": ground.height,
        "ground_friction": ground.friction,
        "ground_restitution": ground.restitution,
        "ground_boxes": len(ground.boxes),
        **{f"worst_{name}": getattr(worst, name) for name in ("penetration", "residual")},
        "uncertified_steps": worst.uncertified,
        "halved_steps": worst.halved,
        "relaxed_problems": worst.relaxed,
        "energy_gain": worst.energy_gain,
        "solver_solves": solver.solves,
        "solver_shortcuts": solver.shortcuts,
        "solver_fallbacks": solver.fallbacks,
        "solver_failures": solver.failures,
        "steps": run.steps,
        "saturations": run.saturations,
        "compile_s": run.timing.compile_s,
        "wall_s": run.timing.wall_s,
    }


def save_dataset(run: SpatialRun, path: str | os.PathLike[str]) -> Path:
    """Write the dataset of a run; see :meth:`SpatialRun.save`."""
    path = Path(path)
    if path.suffix.lower() != ".nc":
        raise RunFileError(f"a run is written to a file whose name ends in .nc, got {path}")
    image = io.BytesIO()  # on a disk that is full HDF5 crashes
    dataset_of(run).to_netcdf(image, engine="h5netcdf")
    try:
        return write_whole(path, image.getbuffer())
    except WriteError as error:
        raise RunFileError(f"{error}; the run is still in memory") from error
