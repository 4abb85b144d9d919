"""simulate(), the ways through time, and the run they leave behind."""

from heelstrike.sim.controller import CompiledController, Contacts, Controller, controller_kernel
from heelstrike.sim.dataset import load_run
from heelstrike.sim.run import Certificates, Event, Run, SolverCount, Timing
from heelstrike.sim.simulation import simulate
from heelstrike.sim.status import EventKind, RunStatus, Scheme
from heelstrike.sim.time_stepping import TimeStepping

__all__ = [
    "Certificates",
    "CompiledController",
    "Contacts",
    "Controller",
    "Event",
    "EventKind",
    "Run",
    "RunStatus",
    "Scheme",
    "SolverCount",
    "TimeStepping",
    "Timing",
    "controller_kernel",
    "load_run",
    "simulate",
]
