"""Fixed steps whose contact impulses decide the next velocity."""

from heelstrike.sim.time_stepping.doubts import SimulationWarning
from heelstrike.sim.time_stepping.method import TimeStepping

__all__ = ["SimulationWarning", "TimeStepping"]
