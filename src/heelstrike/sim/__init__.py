"""simulate(), the simulation methods, and the run they leave behind.

What a method from outside is made of is here too, imported under its own name: the bundles that
its kernels are handed, and the kernels that those of this package call.
"""

from heelstrike.compiler.compilation import kernel as kernel
from heelstrike.contact.modes import SOLVED as SOLVED
from heelstrike.contact.problem import solve_contact_kernel as solve_contact_kernel
from heelstrike.contact.sets import ImpulseSet
from heelstrike.dynamics.kernels import integrate as integrate
from heelstrike.dynamics.kernels import passive_force as passive_force
from heelstrike.dynamics.places import add_point_row as add_point_row
from heelstrike.dynamics.places import point_at as point_at
from heelstrike.dynamics.places import point_bias as point_bias
from heelstrike.dynamics.places import point_velocity as point_velocity
from heelstrike.dynamics.queries.evaluation import link_index as link_index
from heelstrike.sim.batch.batch import Batch
from heelstrike.sim.batch.result import BatchResult
from heelstrike.sim.batch.runs import simulate_batch
from heelstrike.sim.clock import Clock as Clock
from heelstrike.sim.closed_sets import EventKind, OnError, RunStatus, Scheme
from heelstrike.sim.compliant import Compliant
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.compliant.law import FrictionLaw as FrictionLaw
from heelstrike.sim.compliant.law import NormalLaw as NormalLaw
from heelstrike.sim.contacts.brakes import find_loops_of_step as find_loops_of_step
from heelstrike.sim.contacts.brakes import note_brakes as note_brakes
from heelstrike.sim.contacts.brakes import share_friction as share_friction
from heelstrike.sim.contacts.candidates import Listing as Listing
from heelstrike.sim.contacts.candidates import find_constraints as find_constraints
from heelstrike.sim.contacts.candidates import hold_latched as hold_latched
from heelstrike.sim.contacts.candidates import list_candidate as list_candidate
from heelstrike.sim.contacts.candidates import list_dry_joints as list_dry_joints
from heelstrike.sim.contacts.candidates import locate_stops as locate_stops
from heelstrike.sim.contacts.candidates import note_answer as note_answer
from heelstrike.sim.contacts.candidates import note_group as note_group
from heelstrike.sim.contacts.candidates import write_contact_rows as write_contact_rows
from heelstrike.sim.contacts.candidates import write_joint_rows as write_joint_rows
from heelstrike.sim.contacts.constraint import Constraint, constrained
from heelstrike.sim.contacts.geometry import add_impulse as add_impulse
from heelstrike.sim.contacts.geometry import assemble_delassus as assemble_delassus
from heelstrike.sim.contacts.geometry import contact_rows as contact_rows
from heelstrike.sim.contacts.geometry import contact_velocity as contact_velocity
from heelstrike.sim.contacts.geometry import evaluate_equations as evaluate_equations
from heelstrike.sim.contacts.geometry import locate_contacts as locate_contacts
from heelstrike.sim.contacts.geometry import row_product as row_product
from heelstrike.sim.contacts.geometry import solve_mass_matrix as solve_mass_matrix
from heelstrike.sim.contacts.latches import react as react
from heelstrike.sim.contacts.loops import append_loops as append_loops
from heelstrike.sim.contacts.loops import close_loops as close_loops
from heelstrike.sim.contacts.loops import free_loops as free_loops
from heelstrike.sim.contacts.loops import rows_of as rows_of
from heelstrike.sim.contacts.loops import steady_loops as steady_loops
from heelstrike.sim.contacts.rows import CONSTRAINT as CONSTRAINT
from heelstrike.sim.contacts.rows import DRY_JOINT as DRY_JOINT
from heelstrike.sim.contacts.rows import LOOP as LOOP
from heelstrike.sim.contacts.rows import POINT as POINT
from heelstrike.sim.contacts.rows import SECOND_FACE as SECOND_FACE
from heelstrike.sim.contacts.rows import STOP as STOP
from heelstrike.sim.controller.held_torque import HeldTorque
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.raised import ControllerWarning, EndOfRun
from heelstrike.sim.event_driven import EventDriven
from heelstrike.sim.files.run_file import load_run
from heelstrike.sim.frame import DIVERGED as DIVERGED
from heelstrike.sim.frame import DONE as DONE
from heelstrike.sim.frame import SOLVER_FAILED as SOLVER_FAILED
from heelstrike.sim.frame import Kernels
from heelstrike.sim.frame import Scene as Scene
from heelstrike.sim.memory import Memory as Memory
from heelstrike.sim.method import Method, UnknownMethod
from heelstrike.sim.method import solver_order as solver_order
from heelstrike.sim.push import Push
from heelstrike.sim.push import add_pushes as add_pushes
from heelstrike.sim.push import share_over_step as share_over_step
from heelstrike.sim.record.record import Record as Record
from heelstrike.sim.record.recording import note_events as note_events
from heelstrike.sim.record.recording import note_extremes as note_extremes
from heelstrike.sim.record.recording import note_row_when_due as note_row_when_due
from heelstrike.sim.run import Certificates, Event, Logged, Run, SolverCount, Timing
from heelstrike.sim.setting import Setting as Setting
from heelstrike.sim.simulation import Simulation, simulate
from heelstrike.sim.snapshot import Snapshot, load_snapshot
from heelstrike.sim.time_stepping import SimulationWarning, TimeStepping

__all__ = [
    "Batch",
    "BatchResult",
    "BristleFriction",
    "Certificates",
    "Compliant",
    "Constraint",
    "Contacts",
    "Controller",
    "ControllerWarning",
    "EndOfRun",
    "Event",
    "EventDriven",
    "EventKind",
    "HeldTorque",
    "HuntCrossley",
    "ImpulseSet",
    "KelvinVoigt",
    "Kernels",
    "Logged",
    "Method",
    "OnError",
    "Push",
    "RegularisedFriction",
    "Run",
    "RunStatus",
    "Scheme",
    "Simulation",
    "SimulationWarning",
    "Snapshot",
    "SolverCount",
    "TimeStepping",
    "Timing",
    "UnknownMethod",
    "constrained",
    "load_run",
    "load_snapshot",
    "simulate",
    "simulate_batch",
]
