"""Runs as NetCDF files.

A file holds the dataset of :func:`~heelstrike.sim.files.dataset.to_dataset`, readable by any NetCDF
or HDF5 tool, and in the group ``robot`` the numbers of the robot, so that a run can be read again
without the robot's own file. Everything in it is numbers and text: reading never executes anything.
Its last line is a seal by which damage is seen before the HDF5 library sees the file.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import RunFileError, WriteError
from heelstrike.reader_process import MOST_MEMORY, READER, ReadingError
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.files import hdf5_contents
from heelstrike.sim.files.dataset import ROBOT_GROUP, to_dataset
from heelstrike.sim.files.hdf5_contents import Contents
from heelstrike.sim.files.layout import layout_of
from heelstrike.sim.files.seal import seal, seal_holds
from heelstrike.sim.files.settings import unreadable
from heelstrike.sim.files.stored_run import stored_run
from heelstrike.sim.files.table import to_csv
from heelstrike.sim.run import AnyRun
from heelstrike.whole_file import check_target, write_whole

PATIENCE = 20.0
"""Seconds that reading a file may take, and as many again for every so many bytes."""
PATIENCE_BYTES = 2**28

NETCDF, TABLE = ".nc", ".csv"
KEPT = "the run is still in memory, to be saved elsewhere"
ENDINGS = {
    NETCDF: "NetCDF, which load_run reads",
    TABLE: "a table of text, for other programs",
}
"""Endings of the names of files that runs are written to, and what these are."""


def save(run: AnyRun, path: str | os.PathLike[str]) -> Path:
    """Write a run as NetCDF, or as a table of text. The file appears whole or not at all.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.
    path : str or path
        File to write, ``.nc`` or ``.csv``; an existing one is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunFileError
        If the name ends otherwise, the folder does not exist, cannot be written to or is full, or
        the method is one that could not be read again. The run is as it was, and so is an older
        file.
    """
    try:
        ending = check_run_file(path)
    except RunFileError as error:
        raise RunFileError(f"{error}; {KEPT}") from error
    if ending == TABLE:
        return _written(path, to_csv(run))
    for part in (run.method, *_from_outside(run)):
        if reason := unreadable(part):
            raise RunFileError(
                f"cannot write {path}: a run by {type(part).__name__} could not be read again: "
                f"{reason}; {KEPT}, as run.to_dataset() or array by array"
            )
    try:
        # HDF5 crashes on a disk that is full. In memory it never meets one.
        image = _image(run)
    except MemoryError as error:
        raise RunFileError(
            f"cannot write {path}: no memory left to make the file in; {KEPT}"
        ) from error
    except Exception as error:  # names that NetCDF cannot hold, arrays of other shapes
        raise RunFileError(
            f"cannot write {path}: {type(error).__name__}: {error}; {KEPT}"
        ) from error
    return _written(path, image.getbuffer())


def _from_outside(run: AnyRun) -> tuple[Any, ...]:
    """Return shape of the ground and constraints of a run, which may be of somebody's classes."""
    shape = getattr(run.ground, "shape", None)
    constraints: tuple[Any, ...] = getattr(run.robot, "constraints", ())
    return constraints if shape is None else (shape, *constraints)


def check_run_file(path: str | os.PathLike[str], *endings: str) -> str:
    """Return the ending of the name of a file for a run; refuse it if nothing is written so.

    Parameters
    ----------
    path : str or path
        The file.
    *endings : str
        Those that it may have, by default all that there are.

    Raises
    ------
    RunFileError
        With the endings that it may have, or why there can be no such file.
    """
    if not isinstance(path, str | os.PathLike):
        raise RunFileError(f"a run is written to a file, as 'walk.nc'; this is {path!r}")
    try:
        check_target(path)
    except WriteError as error:
        raise RunFileError(str(error)) from error
    ending = Path(path).suffix.lower()
    if ending not in (endings or ENDINGS):
        known = " or ".join(f"{each} ({ENDINGS[each]})" for each in endings or ENDINGS)
        raise RunFileError(f"cannot write {path}: the name of a run ends in {known}")
    return ending


def _written(path: str | os.PathLike[str], content: str | memoryview) -> Path:
    try:
        return write_whole(path, content)
    except WriteError as error:
        raise RunFileError(f"{error}; {KEPT}") from error


def _image(run: AnyRun) -> io.BytesIO:
    """Return the bytes of the file."""
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    layout = layout_of(run)
    dataset = to_dataset(run).drop_vars(layout.left_out(run.robot))
    compression = {"zlib": True, "complevel": 1, "shuffle": True}
    encoding = {
        name: {"_FillValue": None, **(compression if dataset[name].size > 1000 else {})}
        for name in dataset.variables
        if dataset[name].dtype.kind == "f"
    }
    image = io.BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(H5NetCDFStore(file, mode="w"), encoding=encoding)
        robot = layout.robot_to_dataset(run.robot)
        robot.dump_to_store(H5NetCDFStore(file, group=ROBOT_GROUP, mode="a"))
    line = seal(image.getbuffer())
    image.seek(0, io.SEEK_END)
    image.write(line)
    return image


@takes(RunFileError)
def load_run(
    path: str | os.PathLike[str], robot: Robot | SpatialRobot | None = None,
    classes: Sequence[type] = (),
) -> Any:  # fmt: skip
    """Read a run that was saved with :meth:`Run.save`, or one in space.

    Parameters
    ----------
    path : str or path
        The NetCDF file.
    robot : Robot or SpatialRobot, optional
        Robot to attach to the run, instead of the one the file describes. Its joints,
        actuators and contact points must have the names of the file's.
    classes : sequence of type
        Methods, contact laws, ground shapes and constraints from outside the package that the run
        may be made with. A method that is not known is loaded as data, an
        :class:`~heelstrike.sim.method.UnknownMethod`; shapes and constraints have to be known.

    Returns
    -------
    Run or SpatialRun
        The run as it was saved; of an exception of the controller only the message remains.

    Raises
    ------
    RunFileError
        If there is no such file, it is not a run of heelstrike, or it is damaged.

    Notes
    -----
    A file ends with a checksum of its bytes, and a file that has changed since is refused. All are
    read by another process, because bytes that are no HDF5 can make the library crash or hang.
    """
    source = Path(path)
    try:
        if source.is_dir():
            raise RunFileError(f"{source} is a folder; give the name of a saved run")
        if not source.exists():
            raise RunFileError(f"there is no file {source}")
        if not source.is_file():
            raise RunFileError(f"{source}: not a run of heelstrike: it is not a regular file")
        if source.suffix.lower() == TABLE:
            raise RunFileError(
                f"{source} is a table, which does not hold robot and ground; load the {NETCDF} file"
            )
        sealed = seal_holds(source)
    except RunFileError:
        raise
    except (OSError, ValueError) as error:  # also a path with a null character
        raise RunFileError(f"{source}: cannot be read ({error})") from error
    if sealed is False:
        raise RunFileError(
            f"{source}: damaged: its bytes are not those that were written (their checksum differs)"
        )
    try:
        return stored_run(source, _contents(source), robot, classes)
    except RunFileError:
        raise
    except MemoryError as error:
        raise RunFileError(f"{source}: the run does not fit into memory") from error
    except Exception as error:  # whatever the HDF5 library makes of it
        told = error if isinstance(error, ReadingError) else repr(error)
        raise RunFileError(f"{source}: not a run of heelstrike, or damaged: {told}") from error


def _contents(path: Path) -> Contents:
    """Return what another process finds in a file."""
    order = json.dumps([str(path.absolute()), ROBOT_GROUP]).encode("utf-8", "surrogatepass")
    size = path.stat().st_size
    handed = READER.ask(
        f"{hdf5_contents.__file__}:answer",
        order,
        patience=PATIENCE * (1.0 + size / PATIENCE_BYTES),
        memory=MOST_MEMORY + hdf5_contents.LARGEST_RATIO * size,
    )
    with np.load(io.BytesIO(handed), allow_pickle=False) as found:
        return dict(found)
