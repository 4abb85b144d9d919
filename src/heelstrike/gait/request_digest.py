"""Texts that tell requests for gaits apart, by everything that decides the answer."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import fields

import numpy as np

from heelstrike.gait.request import Request
from heelstrike.robot.robot import Robot


def digest_of(request: Request, without: Collection[str] = ()) -> bytes:
    """Digest of a request: of every digit of its robot and of its numbers, but for some by name."""
    digest = hashlib.sha256()
    _add_robot(digest, request.robot)
    for field in fields(request):
        if field.name not in ("robot", "warm_start", *without):
            value = getattr(request, field.name)
            digest.update(f"{field.name} {_plain(value)!r};".encode())
    return digest.digest()


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
        return sorted((str(name), np.ravel(numbers).tolist()) for name, numbers in value.items())
    return value
