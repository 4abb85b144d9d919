"""What a simulation leaves behind, whatever its end.

A quantity that is recorded is declared here, once, as a field of :class:`Run`: its shape, where
in the memory of a simulation it is, its unit and what it is called. The arrays that the loops fill,
the dataset, the files and the figures follow.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle
from heelstrike.contact.ground import Ground
from heelstrike.field_texts import dataclass
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.contacts.constraint import constraint_names
from heelstrike.sim.push import Push
from heelstrike.sim.snapshot import Snapshot

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from heelstrike.analysis.summary import Summary
    from heelstrike.gait.gait import Gait
    from heelstrike.sim.method import Method, UnknownMethod
    from heelstrike.sim.record.record import RowsAndEvents
    from heelstrike.view.notebook.cards import Film


@dataclass(frozen=True)
class Quantity:
    """What is recorded of every row."""

    shape: tuple[str | int, ...]
    """Extents of the array of a row, by their names in :class:`~heelstrike.sim.memory.Memory`."""
    of: str
    """Where in the memory it is when a row is written."""
    unit: str
    label: str
    """What datasets and figures call it."""
    later: bool = False
    """Whether there are files that are older than it, and mean zero."""

    @property
    def dimensions(self) -> tuple[str | int, ...]:
        """Extents of what is recorded of it, a row an instant."""
        return ("nt", *self.shape)


def recorded(*shape: str | int, of: str, unit: str, label: str, later: bool = False) -> Any:
    """Declare a recorded quantity; see :class:`Quantity`."""
    return field(metadata={"declared": Quantity(shape, of, unit, label, later)})


@dataclass(frozen=True, eq=False)
class Logged:
    """A quantity that a controller logged, one value a row."""

    values: NDArray[Any]
    """(nt, ...) Values: at every row what it wrote at its last call for good."""
    unit: str = ""
    label: str = ""
    """unit, label: As its log declares them."""
    extents: tuple[str, ...] = ()
    """How the array of a row is declared: ``("nu",)``, ``("2",)``; nothing of a number."""


@dataclass(frozen=True)
class Event:
    """Something that happened at a contact point."""

    time: float
    """When, in seconds."""
    kind: EventKind
    """Touchdown, lift-off, beginning of slip or of stick."""
    contact: int
    """Index of the contact point, of the joint of a ``JOINT_`` event, or of the constraint."""
    impulse: tuple[float, ...]
    """Impulse on the robot over the step in which it happened, in N s: (normal, tangent), or
    (normal, t1, t2) in space. Of a ``BRIDGE`` its length (s) and how far it may be wrong."""

    @property
    def kind_in_words(self) -> str:
        """Its kind as people write it."""
        return self.kind.name.lower().replace("_", " ")

    def place(self, robot: Robot | SpatialRobot) -> str:
        """Name of the joint or contact point of a robot at which it happened; "" if at none.

        Parameters
        ----------
        robot : Robot or SpatialRobot
            The robot of the run.

        Returns
        -------
        str
            The name.
        """
        names: Sequence[str] = robot.joint_names if self.kind.of_joint else robot.contact_names
        if isinstance(robot, SpatialRobot):
            rubs = self.kind in (EventKind.JOINT_SLIP, EventKind.JOINT_STICK)
            names = robot.velocity_names if rubs else names
        elif self.kind.of_constraint:
            names = constraint_names(robot)
        somewhere = self.kind is not EventKind.BRIDGE and 0 <= self.contact < len(names)
        return names[self.contact] if somewhere else ""


@dataclass(frozen=True)
class Certificates:
    """Worst values over every step of a run, recorded or not."""

    penetration: float
    """Deepest penetration of a contact point, in metres."""
    complementarity: float
    cone: float
    non_penetration: float
    """complementarity, cone, non_penetration: Largest residuals of the contact problems, relative
    to the size of their data."""
    energy_gain: float = 0.0
    """Kinetic energy that Newton's restitution with friction made, of all impacts together (J).
    Events of kind ``ENERGY_GAIN`` tell when."""


@dataclass(frozen=True)
class SolverCount:
    """How the contact problems of a run were solved."""

    name: str
    """Solver tried first."""
    solves: int
    shortcuts: int
    fallbacks: int
    failures: int
    """solves, shortcuts, fallbacks, failures: Contact problems; those answered by the modes of the
    step before, verified; those that needed another solver; those that none could certify."""
    combinations: int = 0
    """Of the latter two, those that came to the last resort, combinations of contact modes."""
    relaxed: int = 0
    """Steps that were asked for less than to leave the ground and to bounce: in a wedge."""

    def __str__(self) -> str:
        if not self.solves:
            return "none"
        notes = {
            "not certified": self.failures,
            "needed another solver": self.fallbacks,
            "by trying combinations of contact modes": self.combinations,
            "steps with a wedged point or an impact left as it was": self.relaxed,
        }
        told = [f"{count} {what}" for what, count in notes.items() if count]
        return ", ".join([str(self.solves), *([] if self.failures else ["all certified"]), *told])


@dataclass(frozen=True)
class Timing:
    """Computing time in seconds."""

    compile_s: float
    """Compiling, or loading compiled code."""
    wall_s: float
    """Simulating."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AnyRun(ShownInNotebooks):
    """Record of a simulation, in the plane or in space: what both have.

    A row holds everything about one instant: the state, the torques decided in it, and the
    contact forces of the step that follows. Forces act on the robot.
    """

    robot: Any
    ground: Any
    method: Method | UnknownMethod
    """How it went through time; unknown if only its file told so."""
    status: RunStatus
    """How the run ended."""
    message: str
    """The same in a person's words."""
    time: Floats
    """(nt,) Seconds."""
    position: Floats = recorded("nq", of="q", unit="m or rad", label="generalised positions")
    velocity: Floats = recorded("nv", of="v", unit="m/s or rad/s", label="generalised velocities")
    torque: Floats = recorded(
        "nu", of="torque", unit="N m or N", label="joint torques within their limits"
    )
    stop_torque: Floats = recorded(
        "nv",
        of="reaction.stop_torque",
        unit="N m or N",
        label="force of the joint stops on the robot",
    )
    friction_torque: Floats = recorded(
        "nv", of="reaction.friction_torque", unit="N m or N", later=True,
        label="dry friction of the joints on the robot",
    )  # fmt: skip
    contact_point: Floats = recorded(
        "nc", "axes", of="contacts.position", unit="m",
        label="world position of the contact points",
    )  # fmt: skip
    contact_normal: Floats = recorded(
        "nc", "axes", of="contacts.normal", unit="1", label="ground normal under the contact points"
    )
    gap: Floats = recorded(
        "nc", of="contacts.gap", unit="m", label="distance of the contact points to the ground"
    )
    contact_force: Floats = recorded(
        "nc", "components", of="contacts.force", unit="N",
        label="force on the robot at the contact points, mean over the step that follows",
    )  # fmt: skip
    """An impact shows as a large force over one step."""
    events: tuple[Event, ...]
    certificates: Any
    solver: SolverCount
    steps: int
    """Steps taken."""
    saturations: int
    """Times a torque was clipped to its limit, counted when the controller is called for good: at
    every step or control period. What the speed-torque line of a motor holds back is counted at
    every step. Of a controller that acts continuously, at the samples or ends of steps only; what
    is clipped within them is not counted."""
    timing: Timing
    error: BaseException | None = field(default=None, repr=False)
    """What the controller raised, if that ended the run; a ControllerError if it did what it may
    not."""
    pushes: tuple[Push, ...] = ()
    """What pushed the robot."""
    log: Mapping[str, Logged] = field(default_factory=dict, repr=False)
    """What the controller told of itself, by name."""
    final: Snapshot | None = field(default=None, repr=False)
    """What a simulation goes on from, as if it had not stopped: hand it over as `state`. None of a
    run from a file, or under a controller in Python that takes no part in snapshots."""

    def __repr__(self) -> str:
        last = self.time[-1] if len(self.time) else 0.0
        return (
            f"{type(self).__name__}({self.robot.name}, {self.method.name}, {last:.6g} s, "
            f"{self.status.value}, {self.steps} steps)"
        )

    @property
    def completed(self) -> bool:
        """Whether the run lasted as long as it was asked to."""
        return self.status is RunStatus.COMPLETED

    @property
    def final_state(self) -> State:
        """State of the last row."""
        return State(self.position[-1], self.velocity[-1])

    def animate(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write an animation of the run; see :func:`heelstrike.view.animation.animate`.

        Parameters
        ----------
        path : str or path
            File to write.
        **options
            As for that function.

        Returns
        -------
        Path
            The file.
        """
        from heelstrike.view.animation import animate

        run: Any = self
        return animate(run, path, **options)

    def save_report(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write a report of the run; see :func:`heelstrike.report`.

        Parameters
        ----------
        path : str or path
            File to write.
        **options
            As for that function.

        Returns
        -------
        Path
            The file.
        """
        from heelstrike.view.report.writing import report

        return report(self, path, **options)

    def to_dataset(self) -> xarray.Dataset:
        """Return the run as a labelled dataset with units."""
        from heelstrike.sim.files.dataset import to_dataset

        return to_dataset(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the run as NetCDF (``.nc``), or as a table of text for other programs (``.csv``).

        A NetCDF file is read again with :func:`heelstrike.load_run`. A table has a row for each
        recorded time and a column for each number, headed by its name and unit as in
        ``position left_knee [rad]``, and at last the events since the row before, in words. It
        holds neither robot nor ground and cannot be loaded.

        Parameters
        ----------
        path : str or path
            File to write, whose name ends in .nc or .csv.

        Returns
        -------
        Path
            The file. It appears whole or not at all.

        Raises
        ------
        RunFileError
            If the name ends in anything else or the file cannot be written. The run is as it was.
        """
        from heelstrike.sim.files.run_file import save

        return save(self, path)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Run(AnyRun):
    """Record of a simulation.

    A row holds everything about one instant: the state, the torques decided in it, and the
    contact forces of the step that follows. Forces act on the robot; those of contacts are normal
    and tangent, which is (normal z, −normal x).
    """

    robot: Robot
    ground: Ground
    certificates: Certificates
    slip_velocity: Floats = recorded(
        "nc", of="reaction.slip", unit="m/s",
        label="tangential velocity of the contact points at the end of the step",
    )  # fmt: skip
    """Zero for points that are not in the contact problem."""
    loop_force: Floats = recorded(
        "loops", "axes", of="loops.loop_force", unit="N", later=True,
        label="force on the first link of the closed loops, mean over the step that follows",
    )  # fmt: skip
    """At its hinge, in world axes. The second link feels the opposite."""
    coupling_force: Floats = recorded(
        "couplings", of="loops.coupling_force", unit="N m or N", later=True,
        label="force on the joints that follow others",
    )  # fmt: skip
    """The leader feels it times minus the slope of the coupling."""
    brake_torque: Floats = recorded(
        "brakes", of="loops.brake_force", unit="N m or N", later=True,
        label="force of the brakes on their joints",
    )  # fmt: skip
    """Zero while it is off."""
    constraint_force: Floats = recorded(
        "constraints", "components", of="loops.constraint_force", unit="N or N m", later=True,
        label="force of the constraints from outside along their rows",
    )  # fmt: skip
    """On the robot as Jᵀ λ, mean over the step that follows."""
    residual: Floats = recorded(
        "conditions", of="assembly.answer.residual", unit="1",
        label="relative residuals of the contact problem",
    )  # fmt: skip
    """Complementarity, cone, non-penetration."""

    @property
    def doubt(self) -> str:
        """Why the run may mean little though it was completed; empty if nothing is known."""
        if not len(self.time):
            return ""
        begun = max(0.0, -float(self.gap[0].min(initial=0.0)))
        sunk = self.certificates.penetration - begun
        model = self.robot.model
        beyond = np.maximum(model.lower - self.position, self.position - model.upper)
        past = float(np.max(beyond, initial=0.0) - np.max(beyond[0], initial=0.0))
        return "; ".join(self.method.doubts(self.robot, self.position[0], sunk, past))

    @property
    def world_force(self) -> Floats:
        """Force (x, z) on the robot at each contact point in world axes, (nt, nc, 2), in N."""
        normal, tangent = self.contact_force[..., 0], self.contact_force[..., 1]
        nx, nz = self.contact_normal[..., 0], self.contact_normal[..., 1]
        return np.stack((normal * nx + tangent * nz, normal * nz - tangent * nx), axis=-1)

    def summary(self, **options: Any) -> Summary:
        """Summarise the run; see :func:`heelstrike.analysis.summary.summarize`.

        Parameters
        ----------
        **options
            As for that function.

        Returns
        -------
        Summary
            Figures with units in their names.
        """
        from heelstrike.analysis.summary import summarize

        return summarize(self, **options)

    def plot(self, what: str, **options: Any) -> Figure:
        """Draw a figure of the run; see :func:`heelstrike.view.figures.plot`.

        Parameters
        ----------
        what : str
            Name of the figure.
        **options
            As for that function.

        Returns
        -------
        Figure
            Matplotlib's figure.
        """
        from heelstrike.view.figures import plot

        return plot(self, what, **options)

    def save_html(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the run as one HTML file; see :func:`heelstrike.view.page.page.save_html`.

        Parameters
        ----------
        path : str or path
            File to write.
        **options
            As for that function.

        Returns
        -------
        Path
            The file.
        """
        from heelstrike.view.page.page import save_html

        return save_html(self, path, **options)

    def show(self, *, gait: Gait | None = None, height: int = 820) -> Film:
        """Show the run in a notebook: the page of :meth:`save_html`, in place.

        Parameters
        ----------
        gait : Gait, optional
            The gait that it followed.
        height : int
            Of the frame, in pixels.

        Returns
        -------
        object
            What a notebook shows, if it is the last value of a cell.

        Raises
        ------
        ViewError
            If the run has no rows.
        GaitError
            If the gait does not fit the robot of the run.
        """
        from heelstrike.view.notebook.cards import film

        return film(self, gait, height)


def quantities_of(run: type[AnyRun]) -> dict[str, Quantity]:
    """Return what runs of a class record, by its name, in the order of rows."""
    return {each.name: each.metadata["declared"] for each in fields(run) if each.metadata}


QUANTITIES = quantities_of(Run)
"""What is recorded in the plane."""


def joined(
    records: Sequence[RowsAndEvents], quantities: Mapping[str, Quantity], since: float, log: Bundle
) -> dict[str, Any]:
    """Return the rows and events of consecutive records, from a time on, as fields of a run.

    `log` is the bundle whose numbers the words of the records are.
    """

    def join(parts: Sequence[Any]) -> Any:
        return np.concatenate(parts) if len(parts) > 1 else parts[0].copy()

    def rows_of(member: str) -> Any:
        return join([getattr(record, member)[: record.rows] for record in records])

    def events_by(member: str) -> Any:
        return join([getattr(told, f"event_{member}")[: told.events] for told in tellings])

    tellings = [record.told for record in records]
    first = int(np.searchsorted(rows_of("time"), since))
    rows = {name: rows_of(name)[first:] for name in ("time", *quantities)}
    events: tuple[Event, ...] = ()
    if any(told.events for told in tellings):
        arrays = {name: events_by(name) for name in EVENT_MEMBERS}
        order = np.argsort(arrays["time"], kind="stable")
        order = order[arrays["time"][order] >= since]
        events = events_of(*(values[order] for values in arrays.values()))
    return rows | {"events": events, "log": _logged(rows_of("log")[first:], log)}


def _logged(words: NDArray[np.int64], log: Bundle) -> dict[str, Logged]:
    """Return the words of rows as what the members of a log held."""
    found, begin = {}, 0
    for name, member, values in log.views():
        end = begin + values.size
        rows = np.ascontiguousarray(words[:, begin:end]).view(member.dtype)
        rows = rows.reshape(len(words), *values.shape)
        extents = tuple(map(str, member.shape))
        found[name] = Logged(rows, member.unit, member.label, extents)
        begin = end
    return found


EVENT_MEMBERS = ("time", "kind", "contact", "impulse")


def events_of(time: Floats, kind: Any, contact: Any, impulse: Floats) -> tuple[Event, ...]:
    """Return the events of some arrays, one entry an event."""
    lists = (values.tolist() for values in (time, kind, contact, impulse))
    return tuple(
        Event(t, EventKind(int(k)), int(c), tuple(components))
        for t, k, c, components in zip(*lists, strict=True)
    )


WORST = tuple(each.name for each in fields(Certificates))
SOLVED = tuple(each.name for each in fields(SolverCount))[1:]
"""Worst values that are kept in the plane, and what is counted there of contact problems."""
