"""A robot file tried in a process of its own, so that what kills the parser kills nothing else.

Reading meshes and joining models are work for which parsers of all kinds have crashed or run for
ever. A file with such things is given to MuJoCo in another Python first. What comes of it does not
matter, only that it ends.

The module is also the program of that other process.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import subprocess
import sys
from typing import Any

from heelstrike.errors import RobotError

LONGEST_TRIAL = 300.0
"""Seconds after which a file counts as one that never ends. Large meshes take ten, on a machine
that does nothing else."""

POINT_SIZE = 1e-12
"""Metres; sizes of zero become this, which is nothing to everybody but a parser."""

_SIZES = {2: 1, 3: 2, 4: 3, 5: 2, 6: 3}
"""How many sizes there are, by MuJoCo's mjtGeom: sphere, capsule, ellipsoid, cylinder, box."""

_tried: dict[bytes, str] = {}


def try_apart(text: str, models: dict[str, bytes], label: str) -> None:
    """Parse and compile a file in another process, once for each text.

    Parameters
    ----------
    text : str
        MJCF or URDF, all files in it by whole paths.
    models : dict of str to bytes
        Models that it joins, by name.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If that process crashes or does not end.
    """
    order = json.dumps({"text": text, "models": {k: v.decode() for k, v in models.items()}})
    data = order.encode("utf-8", "surrogatepass")
    digest = hashlib.sha256(data).digest()
    if digest not in _tried:
        _tried[digest] = _trouble(data)
    if _tried[digest]:
        raise RobotError(
            f"{label}: MuJoCo's parser {_tried[digest]}. Look at its meshes (are their files "
            "whole?), plugins and attached models, or replace the meshes by boxes, capsules and "
            "spheres."
        )


def lift_sizes(spec: Any) -> None:
    """Give shapes without extent, such as spheres of radius 0 for points, one that parsers take."""
    for geom in spec.geoms:
        sizes = _SIZES.get(int(geom.type), 0)
        if not math.isnan(geom.fromto[0]):  # the length is told by two points
            sizes = 1
        for k in range(sizes):
            if geom.size[k] == 0.0:
                geom.size[k] = POINT_SIZE


def _trouble(order: bytes) -> str:
    """What happens to a process that parses a file, in words; nothing if it ends well."""
    if not sys.executable:
        return ""  # Python inside another program, which cannot start another
    try:
        done = subprocess.run(
            [sys.executable, "-P", __file__],
            input=order,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=LONGEST_TRIAL,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"has not finished with this file after {LONGEST_TRIAL:.0f} s"
    except OSError:
        return ""  # a system without processes
    return "crashes on this file" if done.returncode else ""


def _try(text: str, models: dict[str, bytes]) -> None:
    """Do with a file whatever a reader does, and let nothing stop it early."""
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)  # it would write them into the work directory
    spec = mujoco.MjSpec.from_string(text, include=models)
    lift_sizes(spec)
    spec.compiler.balanceinertia = True
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-12
    model = spec.compile()
    mujoco.mj_kinematics(model, mujoco.MjData(model))


if __name__ == "__main__":
    order = json.loads(sys.stdin.buffer.read())
    with contextlib.suppress(Exception):  # refused in words, which the reader will hear itself
        _try(order["text"], {name: text.encode() for name, text in order["models"].items()})
