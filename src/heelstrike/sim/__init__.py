"""simulate(), the ways through time, and the run they leave behind."""

from heelstrike.sim.batch import Batch, simulate_batch
from heelstrike.sim.compliant import Compliant
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.event_driven import EventDriven
from heelstrike.sim.files.run_file import load_run
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.run import Certificates, Event, Run, SolverCount, Timing
from heelstrike.sim.simulation import Simulation, simulate
from heelstrike.sim.snapshot import Snapshot, load_snapshot
from heelstrike.sim.status import EventKind, RunStatus, Scheme
from heelstrike.sim.time_stepping import TimeStepping

__all__ = [
    "Batch",
    "BristleFriction",
    "Certificates",
    "Compliant",
    "Contacts",
    "Controller",
    "Event",
    "EventDriven",
    "EventKind",
    "HuntCrossley",
    "KelvinVoigt",
    "Method",
    "Push",
    "RegularisedFriction",
    "Run",
    "RunStatus",
    "Scheme",
    "Simulation",
    "Snapshot",
    "SolverCount",
    "TimeStepping",
    "Timing",
    "load_run",
    "load_snapshot",
    "simulate",
    "simulate_batch",
]
