"""ODE's side of a comparison: bodies, hinges and contact joints, in a Python that has them.

Python's package index has no wheels of ODE. Debian's ``python3-pyode`` is of the system's Python.
"""

from __future__ import annotations

from heelstrike.experiments.engines.peer import Engine
from heelstrike.experiments.engines.served import ScriptedPeer


class OdePeer(ScriptedPeer):
    """A scenario in ODE, whose script makes the contact joints at our points."""

    script = "ode_server.py"
    module = "ode"
    settling = 0.2
    lacks = ("armature",)


ENGINE = Engine(
    label="ODE",
    note="in a process of another Python, a call of it a step",
    peer=OdePeer,
)
