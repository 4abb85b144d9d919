"""Simbody's side of a comparison, by way of OpenSim, which must be alone in its process."""

from __future__ import annotations

from heelstrike.experiments.engines.peer import Engine
from heelstrike.experiments.engines.served import ScriptedPeer


class SimbodyPeer(ScriptedPeer):
    """A scenario in Simbody, whose contact points are on compliant ground."""

    script = "simbody_server.py"
    module = "opensim"
    settling = 1.0
    lacks = ("armature",)
    tells_means = False
    bounces = False


ENGINE = Engine(
    label="Simbody",
    note="through OpenSim, a call of it a step; its integrator takes shorter ones by itself",
    peer=SimbodyPeer,
)
