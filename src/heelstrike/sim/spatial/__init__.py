"""Time stepping of robots in space, and the run it leaves behind."""

from heelstrike.sim.batch.result import SpatialBatchResult
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.spatial.controlled import SpatialControlledRobot, SpatialControlState
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import (
    SpatialCertificates,
    SpatialEvent,
    SpatialRun,
    SpatialSolverCount,
)
from heelstrike.sim.spatial.simulation import SpatialSimulation

SpatialSnapshot = Snapshot
"""That of the plane."""

__all__ = [
    "SpatialBatchResult",
    "SpatialCertificates",
    "SpatialControlState",
    "SpatialControlledRobot",
    "SpatialEvent",
    "SpatialEventKind",
    "SpatialRun",
    "SpatialSimulation",
    "SpatialSnapshot",
    "SpatialSolverCount",
]
