"""What a simulation leaves behind, whatever its end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.memory import Memory
from heelstrike.sim.push import Push
from heelstrike.sim.record.record import Record
from heelstrike.sim.snapshot import Snapshot

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from heelstrike.analysis.summary import Summary
    from heelstrike.sim.method import Method, UnknownMethod

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """Something that happened at a contact point.

    Attributes
    ----------
    time : float
        When, in seconds.
    kind : EventKind
        Touchdown, lift-off, beginning of slip or of stick.
    contact : int
        Index of the contact point, or of the joint of a ``JOINT_`` event.
    impulse : tuple of float
        Impulse (normal, tangent) on the robot over the step in which it happened, in N s.
    """

    time: float
    kind: EventKind
    contact: int
    impulse: tuple[float, float]


@dataclass(frozen=True)
class Certificates:
    """Worst values over every step of a run, recorded or not.

    Attributes
    ----------
    penetration : float
        Deepest penetration of a contact point, in metres.
    complementarity, cone, non_penetration : float
        Largest residuals of the contact problems, relative to the size of their data.
    """

    penetration: float
    complementarity: float
    cone: float
    non_penetration: float


@dataclass(frozen=True)
class SolverCount:
    """How the contact problems of a run were solved.

    Attributes
    ----------
    name : str
        Solver tried first.
    solves, shortcuts, fallbacks, failures : int
        Contact problems; those answered by the modes of the step before, verified; those that
        needed another solver; those that none could certify.
    """

    name: str
    solves: int
    shortcuts: int
    fallbacks: int
    failures: int

    def __str__(self) -> str:
        backed = f" with {self.fallbacks} fallbacks" if self.fallbacks else ""
        counts = {
            "by the modes of the step before": self.shortcuts,
            f"by {self.name}{backed}": self.solves - self.shortcuts - self.failures,
            "unsolved": self.failures,
        }
        parts = ", ".join(f"{count} {how}" for how, count in counts.items() if count)
        return f"{self.solves}: {parts}" if parts else "none"


@dataclass(frozen=True)
class Timing:
    """Seconds spent.

    Attributes
    ----------
    compile_s : float
        Compiling, or loading compiled code.
    wall_s : float
        Simulating.
    """

    compile_s: float
    wall_s: float


@dataclass(frozen=True, eq=False)
class Run:
    """Record of a simulation.

    A row holds everything about one instant: the state, the torques decided in it, and the
    contact forces of the step that follows. Forces act on the robot.

    Attributes
    ----------
    robot : Robot
    ground : Ground
    method : Method or UnknownMethod
        How it went through time; unknown if only its file told so.
    status : RunStatus
        How the run ended.
    message : str
        The same in a person's words.
    time : (nt,) float
        Seconds.
    position : (nt, nq) float
        Generalised positions (m, rad).
    velocity : (nt, nv) float
        Generalised velocities (m/s, rad/s).
    torque : (nt, nu) float
        Joint torques within their limits (N m).
    stop_torque : (nt, nv) float
        Generalised force of the joint stops on the robot (N m, or N for a slide).
    friction_torque : (nt, nv) float
        Generalised force of the joints' dry friction on the robot (N m, or N for a slide).
    contact_point : (nt, nc, 2) float
        World position (x, z) of the contact points (m).
    contact_normal : (nt, nc, 2) float
        Ground normal (x, z) under the contact points; the tangent is (normal z, −normal x).
    gap : (nt, nc) float
        Distance of the contact points to the ground (m).
    contact_force : (nt, nc, 2) float
        Force (normal, tangent) on the robot at each contact point (N): the mean over the step, so
        that an impact shows as a large force over one step.
    slip_velocity : (nt, nc) float
        Tangential velocity (m/s) at the end of the step of the points in the contact problem;
        zero for the others.
    residual : (nt, 3) float
        Relative residuals of the contact problem: complementarity, cone, non-penetration.
    events : tuple of Event
    certificates : Certificates
    solver : SolverCount
    steps : int
        Steps taken.
    saturations : int
        Times a torque was clipped to its limit, counted when the controller is called for good: at
        every step or control period. Of a controller that acts continuously, at the samples or
        ends of steps only; what is clipped within them is not counted.
    timing : Timing
    error : BaseException or None
        What the controller raised, if that ended the run.
    pushes : tuple of Push
        What pushed the robot.
    final : Snapshot or None
        What a simulation goes on from, as if it had not stopped: hand it over as `state`. None of a
        run from a file, or under a controller in Python that takes no part in snapshots.
    """

    robot: Robot
    ground: Ground
    method: Method | UnknownMethod
    status: RunStatus
    message: str
    time: Floats
    position: Floats
    velocity: Floats
    torque: Floats
    stop_torque: Floats
    friction_torque: Floats
    contact_point: Floats
    contact_normal: Floats
    gap: Floats
    contact_force: Floats
    slip_velocity: Floats
    residual: Floats
    events: tuple[Event, ...]
    certificates: Certificates
    solver: SolverCount
    steps: int
    saturations: int
    timing: Timing
    error: BaseException | None = field(default=None, repr=False)
    pushes: tuple[Push, ...] = ()
    final: Snapshot | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        last = self.time[-1] if len(self.time) else 0.0
        return (
            f"Run({self.robot.name}, {self.method.name}, {last:.6g} s, "
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

        return animate(self, path, **options)

    def to_dataset(self) -> xarray.Dataset:
        """Return the run as a labelled dataset with units."""
        from heelstrike.sim.files.dataset import to_dataset

        return to_dataset(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the run as NetCDF; read it again with :func:`heelstrike.load_run`.

        Parameters
        ----------
        path : str or path
            File to write.

        Returns
        -------
        Path
            The file.
        """
        from heelstrike.sim.files.run_file import save

        return save(self, path)


def recorded(records: Sequence[Record], since: float) -> dict[str, Any]:
    """Return the rows and events of consecutive records, from a time on, as fields of a run."""

    def join(member: str, counts: Sequence[int]) -> Any:
        used = [getattr(part, member)[:n] for part, n in zip(records, counts, strict=True)]
        return np.concatenate(used)

    counts = [part.rows for part in records]
    first = int(np.searchsorted(join("time", counts), since))
    fields = {name: join(member, counts)[first:] for name, member in _MEMBERS.items()}
    counts = [part.events for part in records]
    time, kind, contact, impulse = (
        join(f"event_{name}", counts) for name in ("time", "kind", "contact", "impulse")
    )
    events = tuple(
        Event(
            time=float(time[i]),
            kind=EventKind(int(kind[i])),
            contact=int(contact[i]),
            impulse=(float(impulse[i, 0]), float(impulse[i, 1])),
        )
        for i in np.argsort(time, kind="stable")
        if time[i] >= since
    )
    return fields | {"events": events}


_MEMBERS = {
    "time": "time",
    "position": "q",
    "velocity": "v",
    "torque": "torque",
    "stop_torque": "stop_torque",
    "friction_torque": "friction_torque",
    "contact_point": "point",
    "contact_normal": "normal",
    "gap": "gap",
    "contact_force": "force",
    "slip_velocity": "slip",
    "residual": "residual",
}
"""Which member of the record each field of a run is."""


def tallied(memory: Memory, solves_with: str) -> dict[str, Any]:
    """Return counts and worst values of a simulation, as fields of a run."""
    tally, solver = memory.tally, memory.solver.tally
    return {
        "certificates": Certificates(
            penetration=tally.penetration,
            complementarity=tally.complementarity,
            cone=tally.cone,
            non_penetration=tally.non_penetration,
        ),
        "solver": SolverCount(
            name=solves_with,
            solves=solver.solves,
            shortcuts=solver.shortcuts,
            fallbacks=solver.fallbacks,
            failures=solver.failures,
        ),
        "steps": tally.steps,
        "saturations": tally.saturations,
    }
