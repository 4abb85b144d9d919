"""Speed limits of joints, which URDF has and MJCF has not."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import Floats
from heelstrike.robot.warning import warn

SPEED_LIMIT = "speed_limit:"
"""Beginning of the name of a ``<custom><numeric>`` that holds the limit of the joint named next."""

LARGEST_SPEED = 1e10
"""Files that must give a limit but mean none give a number like this."""


def read_speed_limits(file: MujocoFile) -> Floats:
    """Greatest speed of every joint (rad/s, m/s), infinite where the file gives none, (nv,).

    URDF gives it as ``<limit velocity="…">``. In MJCF we look for
    ``<custom><numeric name="speed_limit:JOINT" data="…"/></custom>``.

    Raises
    ------
    RobotError
        If a limit is not a number, or negative.
    """
    names = [file.given_name("joint", joint) for joint in range(file.model.njnt)]
    index = {name: joint for joint, name in reversed(list(enumerate(names)))}
    limits = np.full(len(names), math.inf)
    for joint, limit in _written(file):
        if joint not in index:
            if not file.is_urdf:  # whose fixed joints may have limits too
                warn(f"{file.source}: {SPEED_LIMIT}{joint}: there is no joint of that name.")
            continue
        if not limit >= 0.0:
            raise file.error(f"the speed limit of joint {joint!r} is {limit}, not a number >= 0.")
        # Exporters write 0 for what nobody told them.
        limits[index[joint]] = limit if 0.0 < limit < LARGEST_SPEED else math.inf
    return limits


def _written(file: MujocoFile) -> Iterator[tuple[str, float]]:
    if file.is_urdf:
        for joint in file.xml.iterfind("joint"):
            for limit in joint.iterfind("limit"):
                yield joint.get("name", ""), _number(limit.get("velocity", "0"))
    for numeric in range(file.model.nnumeric):
        name = file.given_name("numeric", numeric)
        if name.startswith(SPEED_LIMIT):
            place = file.model.numeric_adr[numeric]
            yield name.removeprefix(SPEED_LIMIT), float(file.model.numeric_data[place])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
