"""Landmarks of the body, and what markers on them are called in laboratories."""

from __future__ import annotations

import re

SIDES = {"right": "right", "left": "left", "r": "right", "l": "left"}
"""Words for a side."""
PARTS: dict[str, tuple[str, ...]] = {
    "hip": ("hip", "gtro", "gtr", "troch", "trochanter", "gt", "hjc"),
    "knee": ("knee", "kne", "knee_lat", "lfe", "lek", "kjc", "lateral_epicondyle"),
    "ankle": ("ankle", "ank", "ankle_lat", "malleolus", "lm", "ajc", "lateral_malleolus"),
    "heel": ("heel", "hee", "cal", "calc", "calcaneus"),
    "toe": ("toe", "mt5", "mtp5", "toe_lat", "fifth_metatarsal", "5th_metatarsal"),
    "shoulder": ("shoulder", "sho", "acr", "acromion", "acromium"),
}
"""Landmarks of a side, and their names; of several in a file the first that is found counts."""
MIDDLE: dict[str, tuple[str, ...]] = {"trunk": ("rib_cage", "ribcage", "trunk", "c7", "sternum")}
"""Landmarks of the trunk, above the hips."""


def landmark_of(name: str) -> str | None:
    """Return the landmark that a marker of a plain name is on; None if it is none that is known.

    Parameters
    ----------
    name : str
        As ``right_heel``, ``r_heel``, ``rhee``, ``heel_r``, ``rib_cage``.
    """
    for part, names in MIDDLE.items():
        if name in names:
            return part
    for side, whole in SIDES.items():
        for part, names in PARTS.items():
            for each in names:
                told = {f"{side}_{each}", f"{each}_{side}"}
                if len(side) == 1 and re.fullmatch(r"[a-z0-9]{3,4}", each):
                    told.add(f"{side}{each}")
                if name in told:
                    return f"{whole}_{part}"
    return None
