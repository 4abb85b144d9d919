"""Coordinates of OpenSim's planar models of walking people, as those of ours.

A hip there is positive in flexion, an ankle in dorsiflexion, and a tilt backwards, all about an
axis to the right; ours are positive about +y, to the left: the other way round. The sense of knees
differs from model to model, and is told by the numbers: a knee bends one way only.
"""

from __future__ import annotations

import numpy as np

from heelstrike.gait.recordings.table import Table
from heelstrike.gait.recordings.units import UNITS

SIDES = {"r": "right", "l": "left"}


def joints_of_opensim(table: Table, unit: str = "") -> Table:
    """Return a table in which coordinates of OpenSim have our names and senses, in rad.

    ``root_pitch`` is that of the trunk if there is a ``lumbar_extension``, else of the pelvis, and
    hips are turned as they are against it. Other columns stay as they are; so does a table that
    has no such coordinates.

    Parameters
    ----------
    table : Table
        The table.
    unit : str
        Of coordinates whose columns name none; rad by default.
    """
    columns = {name: k for k, name in enumerate(table.names)}

    def angle(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        k = columns[name]
        return np.asarray(table.values[:, k] * UNITS[table.units[k] or unit or "rad"])

    found = {}
    lumbar = angle("lumbar_extension") if "lumbar_extension" in columns else 0.0
    if "pelvis_tilt" in columns:
        found["root_pitch"] = -(angle("pelvis_tilt") + lumbar)
    for end, side in SIDES.items():
        if f"hip_flexion_{end}" in columns:
            found[f"{side}_hip"] = lumbar - angle(f"hip_flexion_{end}")
        if f"knee_angle_{end}" in columns:
            knee = angle(f"knee_angle_{end}")
            found[f"{side}_knee"] = knee if knee.mean() > 0.0 else -knee
        if f"ankle_angle_{end}" in columns:
            found[f"{side}_ankle"] = -angle(f"ankle_angle_{end}")
    found = {name: each for name, each in found.items() if name not in columns}
    return Table(
        path=table.path,
        names=(*table.names, *found),
        written=(*table.written, *found),
        units=(*table.units, *["rad"] * len(found)),
        values=np.column_stack([table.values, *found.values()]),
        places=table.places,
        rate=table.rate,
        opensim=True,
    )
