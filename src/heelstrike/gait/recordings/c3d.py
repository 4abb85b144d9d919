"""C3D files of laboratories, read by ezc3d where it is installed (``heelstrike[people]``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.lines import FEWEST, LARGEST_FILE, Name
from heelstrike.gait.recordings.units import UNITS
from heelstrike.robot.model import Floats


def points_of_c3d(path: Name) -> tuple[Floats, tuple[str, ...], Floats]:
    """Read times (n,) in s, names of markers, and positions (n, m, 3) in m; NaN where unseen.

    Raises
    ------
    GaitError
        If the reader is not installed, or it cannot read the file.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise GaitError(
            f"{path}: C3D files are read by ezc3d, which is not installed: "
            "pip install 'heelstrike[people]'"
        ) from error
    file = Path(path)
    try:
        if not file.is_file():
            raise GaitError(f"{path} cannot be read: there is no such file")
        if file.stat().st_size > LARGEST_FILE:
            raise GaitError(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it a recording?")
        data = ezc3d.c3d(str(file))
        points = data["parameters"]["POINT"]
        labels = tuple(str(label) for label in points["LABELS"]["value"])
        unit = str((points["UNITS"]["value"] or ["mm"])[0]).strip().lower()
        rate = float(data["header"]["points"]["frame_rate"])
        values = np.asarray(data["data"]["points"], dtype=np.float64)[:3]
    except GaitError:
        raise
    except Exception as error:  # whatever its reader meets in a broken file
        raise GaitError(f"{path}: no C3D file that can be read: {error}") from error
    if unit not in ("mm", "cm", "m") or not rate > 0.0:
        raise GaitError(f"{path}: its unit {unit!r} or its rate {rate:g} makes no sense")
    if values.shape[2] < FEWEST:
        raise GaitError(f"{path}: a recording has at least {FEWEST} rows, got {values.shape[2]}")
    position = UNITS[unit] * values[:, : len(labels)].transpose(2, 1, 0)
    unseen = ~np.any(position, axis=2)  # older files have zeros where a marker was not seen
    position[unseen] = np.nan
    return np.arange(len(position)) / rate, labels, position
