"""A planar human scaled to a person, with the places of markers on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import JOINTS
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.markers import RecordedMarkers
from heelstrike.robot.human import BodyTable, human
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

LEG = 0.245 + 0.246
"""Length from hip to ankle over the height of a person (Winter's table of segments)."""
BODY_MASS_INDEX = 22.0
"""Mass over height squared (kg/m²) of a person whose mass is not said."""
LOW = 5.0
"""Percentile of the heights of a marker that is its height on the ground."""
FLAT = 0.015
"""Height (m) above that within which a marker of a foot is on the ground."""
FEWEST = 3
"""Instants with a flat foot that are wanted at least."""


@dataclass(frozen=True, eq=False)
class Person:
    """A planar human, and where the markers are on it."""

    robot: Robot
    """The human."""
    sides: tuple[str, ...]
    """Legs with markers."""
    places: Mapping[str, tuple[str, Floats]]
    """Link, and place on it (x, z) in m, of every landmark."""


def person_of(
    markers: RecordedMarkers,
    *,
    mass: float | None = None,
    height: float | None = None,
    table: BodyTable | str = BodyTable.WINTER,
) -> Person:
    """Scale a planar human to a person with markers.

    Markers on hip, knee and ankle are taken for the joints: thigh and shank have the median
    distances between them. Without the height it is the one that goes with their sum, and without
    the mass that of a body mass index of 22 kg/m². Heel and toe markers are where they are on a
    foot that stands flat.

    Parameters
    ----------
    markers : RecordedMarkers
        The markers: of one leg at least hip, knee, ankle, heel and toe, and of the trunk one above
        the hip.
    mass, height : float, optional
        Of the person (kg, m).
    table : BodyTable or its value
        Where shares of mass and radii of gyration come from.

    Returns
    -------
    Person
        The human and its markers.

    Raises
    ------
    GaitError
        If markers are missing, or were seen too seldom.
    """
    wanted = (*JOINTS, "heel", "toe")
    sides = tuple(
        side for side in ("right", "left") if markers.has(*(f"{side}_{each}" for each in wanted))
    )
    above = [name for name in ("trunk", "right_shoulder", "left_shoulder") if markers.has(name)]
    if not sides:
        missing = [f"right_{each}" for each in wanted if not markers.has(f"right_{each}")]
        raise GaitError(
            f"the recording has no whole leg: {', '.join(missing)} and the same on the left are "
            f"missing; it has {', '.join(markers.names)}. Say which marker is which, as "
            "right_hip=NAME."
        )
    if not above:
        raise GaitError("the recording has no marker on the trunk: rib cage or shoulder")
    thigh, shank = (
        float(np.mean([_apart(markers, f"{side}_{a}", f"{side}_{b}") for side in sides]))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    height = (thigh + shank) / LEG if height is None else height
    mass = BODY_MASS_INDEX * height**2 if mass is None else mass
    robot = human(mass, height, table=table, thigh=thigh, shank=shank)
    places: dict[str, tuple[str, Floats]] = {}
    origin = np.zeros(2)
    for side in sides:
        for joint, link in zip(JOINTS, ("trunk", f"{side}_shank", f"{side}_foot"), strict=True):
            places[f"{side}_{joint}"] = (link, origin)
        for end, local in _on_foot(markers, side).items():
            places[f"{side}_{end}"] = (f"{side}_foot", local)
    for name in above:
        length = _apart(markers, f"{sides[0]}_hip", name)
        places[name] = ("trunk", np.array([0.0, length]))
    return Person(robot, sides, places)


def _apart(markers: RecordedMarkers, first: str, second: str) -> float:
    """Median distance of two markers (m)."""
    distance = np.linalg.norm(markers.of(second) - markers.of(first), axis=1)
    seen = distance[np.isfinite(distance)]
    if not seen.size:
        raise GaitError(f"{first} and {second} were never seen together")
    return float(np.median(seen))


def _on_foot(markers: RecordedMarkers, side: str) -> dict[str, Floats]:
    """Places of heel and toe markers on a foot, from its ankle, in m.

    Against the line through both they are the same at all times; how that line lies on a foot that
    is flat, the times tell at which both are low.
    """
    ankle, heel, toe = (markers.of(f"{side}_{name}") for name in ("ankle", "heel", "toe"))
    sole = toe - heel
    turned = np.exp(-1j * np.arctan2(sole[:, 1], sole[:, 0]))  # rotations as complex numbers
    flat = np.conj(np.mean(turned[_flat(markers, side)]))
    found = {}
    for name, marker in (("heel", heel), ("toe", toe)):
        away = marker - ankle
        along = np.nanmean((away[:, 0] + 1j * away[:, 1]) * turned) * flat / abs(flat)
        found[name] = np.array([along.real, along.imag])
    return found


def _flat(markers: RecordedMarkers, side: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """When heel and toe are both as low as they are on the ground."""
    above, seen = np.zeros(len(markers.time)), np.ones(len(markers.time), dtype=bool)
    for end in ("ankle", "heel", "toe"):
        up = markers.of(f"{side}_{end}")[:, 1]
        seen &= np.isfinite(up)
        if end != "ankle" and np.isfinite(up).any():
            above = np.fmax(above, up - np.nanpercentile(up, LOW))
    flat = seen & (above < FLAT)
    if np.count_nonzero(flat) < FEWEST:
        raise GaitError(
            f"the {side} foot is never flat on the ground, so the place of its markers "
            "on the sole is unknown; use a recording in which it stands flat"
        )
    return flat
