"""Gaits that were designed before, on disk: the same request has the same gait.

A gait is kept under a fingerprint of all that it follows from: the robot, what is asked, and the
program that designs it. Its file is that of any saved gait, and is believed only with its checksum.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress

from heelstrike.errors import GaitError
from heelstrike.gait.file import load_gait, save_gait
from heelstrike.gait.gait import Gait
from heelstrike.gait.request import Request
from heelstrike.gait.request_digest import digest_of
from heelstrike.kept_files import kept_file, make_room, program_digest

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
        # A function has no fingerprint, and what was started near a gait depends on that gait.
        nameless = callable(request.cost) or request.warm_start is not None
        self._file = None if nameless else kept_file("gaits", _fingerprint(request))

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
    digest.update(digest_of(request))
    return digest.hexdigest()[:32]
