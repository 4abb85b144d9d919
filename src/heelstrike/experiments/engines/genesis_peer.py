"""Genesis' side of a comparison, in a Python that has it.

Genesis needs PyTorch and packages of two gigabytes, whose versions bind those of others: it is
installed apart, in a virtual environment of its own whose ``python3`` is first on the path.
"""

from __future__ import annotations

from typing import Any

from heelstrike.experiments.engines.peer import Engine
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import PATIENCE, ScriptedPeer

COMPILING = 540.0
"""Seconds that may pass until it is made: the first time on a machine it compiles its kernels,
which takes two minutes of a processor that has nothing else to do."""


class GenesisPeer(ScriptedPeer):
    """A scenario in Genesis, which reads the robot as MJCF.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    patience : float
        Seconds that it may take to answer, once it is made.
    **settings
        Of the script.
    """

    script = "genesis_server.py"
    module = "genesis"
    settling = 1.0
    lacks = ("armature",)
    bounces = False

    def __init__(
        self, scenario: Scenario, step: float, *, patience: float = PATIENCE, **settings: Any
    ) -> None:
        super().__init__(scenario, step, patience=max(patience, COMPILING), **settings)
        self._patience = patience


ENGINE = Engine(
    label="Genesis",
    note="in a process of another Python, several calls of it a step",
    peer=GenesisPeer,
)
