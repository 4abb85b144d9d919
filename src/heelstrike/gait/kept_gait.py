"""Gaits that were designed before, on disk: the same request has the same gait.

A gait is kept under a fingerprint of all that it follows from: the robot, what is asked, and the
program that designs it. Its file is that of any saved gait, and is believed only with its checksum.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import fields

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.gait.file import load_gait, save_gait
from heelstrike.gait.gait import Gait
from heelstrike.gait.request import Request
from heelstrike.kept_files import kept_file, make_room, program_digest
from heelstrike.robot.robot import Robot

_ROOMS = ("gait", "contact", "dynamics", "robot", "compiler", "tolerances")
"""Packages and modules whose text decides what gait is found."""


class KeptGait:
    """Where the gait of a request is kept, if anywhere.

    Parameters
    ----------
    request : Request
        What is asked of the gait.
    """

    def __init__(self, request: Request) -> None:
        self._robot = request.robot
        self._file = kept_file("gaits", _fingerprint(request))

    def load(self) -> Gait | None:
        """Return the gait, or None if it is not there or its file is damaged."""
        if self._file is None or not self._file.is_file():
            return None
        with suppress(GaitError):
            return load_gait(self._file, self._robot)
        return None

    def save(self, gait: Gait) -> Gait:
        """Keep a gait if its folder can be written to, and return it."""
        if self._file is not None:
            with suppress(GaitError, OSError):
                make_room(self._file)
                save_gait(gait, self._file)
        return gait


def _fingerprint(request: Request) -> str:
    digest = hashlib.sha256(program_digest(_ROOMS, "casadi"))
    _add_robot(digest, request.robot)
    for field in fields(request):
        if field.name != "robot":
            value = getattr(request, field.name)
            digest.update(f"{field.name} {_plain(value)!r};".encode())
    return digest.hexdigest()[:32]


def _add_robot(digest: hashlib._Hash, robot: Robot) -> None:
    """Add every digit of a robot's numbers, and its names; pictures of it decide nothing."""
    for name, value in robot.model.members().items():
        numbers = np.ascontiguousarray(value)
        digest.update(f"{name} {numbers.dtype} {numbers.shape}".encode() + numbers.tobytes())
    names = (robot.name, robot.joint_names, robot.actuator_names, robot.contact_names)
    mirror = robot.mirror
    sides = mirror and [
        part.tolist() for part in (mirror.joint, mirror.sign, mirror.contact, mirror.foot)
    ]
    digest.update(repr((names, robot.feet, sides, robot.floating)).encode())


def _plain(value: object) -> object:
    """Return a value whose ``repr`` tells all of it, the same for equal values."""
    if hasattr(value, "items"):
        return sorted((name, tuple(map(float, ends))) for name, ends in value.items())
    return value
