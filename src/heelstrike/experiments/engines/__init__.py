"""Other simulators under the same robot, contacts and law of control.

Each adapter needs its engine, which ``pip install 'heelstrike[peers]'`` brings; MuJoCo is always
there. :func:`peers` says which are, :func:`simulators` loads them.
"""

from heelstrike.experiments.engines.packages import compared, peers, raced, simulators
from heelstrike.experiments.engines.peer import (
    Engine,
    InvalidRunError,
    Peer,
    Touching,
    check_flight,
)
from heelstrike.experiments.engines.scenario import Scenario

__all__ = [
    "Engine",
    "InvalidRunError",
    "Peer",
    "Scenario",
    "Touching",
    "check_flight",
    "compared",
    "peers",
    "raced",
    "simulators",
]
