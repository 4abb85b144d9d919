"""Siconos' side of a comparison: its time stepping and solvers, in a Python that has them.

Python's package index has no wheels of Siconos. Debian's ``python3-siconos`` is of the system's
Python.
"""

from __future__ import annotations

from heelstrike.experiments.engines.peer import Engine
from heelstrike.experiments.engines.served import ScriptedPeer


class SiconosPeer(ScriptedPeer):
    """A scenario in Siconos, whose script hands it mass matrix, forces and relations."""

    script = "siconos_server.py"
    module = "siconos"
    lacks = ("armature",)


ENGINE = Engine(
    label="Siconos",
    note="in a process of another Python, which computes the dynamics that it asks for",
    peer=SiconosPeer,
)
