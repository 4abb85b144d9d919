"""Time stepping of robots in space, and the run it leaves behind."""

from heelstrike.sim.closed_sets import EventKind as SpatialEventKind
from heelstrike.sim.run import Event as SpatialEvent
from heelstrike.sim.run import SolverCount as SpatialSolverCount
from heelstrike.sim.snapshot import Snapshot as SpatialSnapshot
from heelstrike.sim.spatial.controlled import SpatialControlledRobot, SpatialControlState
from heelstrike.sim.spatial.run import SpatialCertificates, SpatialRun
from heelstrike.sim.spatial.simulation import SpatialSimulation

__all__ = [
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
