"""What a simulation in space leaves behind, whatever its end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.run import Timing
from heelstrike.sim.spatial.memory import SpatialMemory
from heelstrike.sim.spatial.record import SpatialEventKind, SpatialRecord

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from heelstrike.analysis.spatial.summary import SpatialSummary


class Recorded(NamedTuple):
    """What datasets call a recorded quantity."""

    dims: tuple[str, ...]
    unit: str
    label: str


RECORDED: dict[str, Recorded] = {
    "position": Recorded(("q",), "m or rad", "generalised positions"),
    "velocity": Recorded(("v",), "m/s or rad/s", "generalised velocities"),
    "torque": Recorded(("actuator",), "N m", "joint torques within their limits"),
    "stop_torque": Recorded(("v",), "N m or N", "force of the joint stops on the robot"),
    "friction_torque": Recorded(("v",), "N m or N", "dry friction of the joints"),
    "contact_point": Recorded(("contact", "axis"), "m", "world position of the contact points"),
    "contact_normal": Recorded(("contact", "axis"), "1", "ground normal at the contact points"),
    "gap": Recorded(("contact",), "m", "distance of the contact points to the ground"),
    "contact_force": Recorded(
        ("contact", "component"),
        "N",
        "contact forces on the robot, mean over the step that follows",
    ),
    "slip": Recorded(
        ("contact", "tangent"), "m/s", "tangential velocity of the contact points after the step"
    ),
    "residual": Recorded((), "1", "relative residual of the contact problem"),
}
"""What is recorded of every row; datasets and joined records follow."""


@dataclass(frozen=True)
class SpatialEvent:
    """Something that happened in a run in space."""

    time: float
    """When, in seconds."""
    kind: SpatialEventKind
    """What."""
    contact: int
    """Index of the contact point, of the joint of a stop, or of the velocity of dry friction."""
    impulse: tuple[float, float, float]
    """Impulse (normal, t1, t2) on the robot over the step in which it happened, in N s."""


@dataclass(frozen=True)
class SpatialCertificates:
    """Worst values and counts over every step of a run, recorded or not."""

    penetration: float
    """Deepest penetration of a contact point, in metres."""
    residual: float
    """Largest residual of a contact problem that a step went on with (natural map, relative to its
    data)."""
    uncertified: int
    """Steps that went on with a residual above 1e-9, and none above 1e-6."""
    halved: int
    """Steps that were taken in parts, because no answer for the whole was certified."""
    relaxed: int
    """Steps that were not asked to come out of the ground, in which they were by less than 0.1 mm,
    or whose impact was left to the next: no certified way was found."""
    energy_gain: float
    """Kinetic energy that restitution with friction made (J)."""


@dataclass(frozen=True)
class SpatialSolverCount:
    """How the contact problems of a run were solved."""

    solves: int
    shortcuts: int
    fallbacks: int
    failures: int
    """solves, shortcuts, fallbacks, failures: Contact problems; those answered by the modes of the
    step before; ways that failed where there was another; problems that none could certify."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SpatialRun:
    """Record of a simulation in space.

    A row holds everything about one instant: the state, the torques decided in it, and the contact
    forces of the step that follows. Forces act on the robot; those of contacts are in the axes of
    the contact: normal, t1, t2.
    """

    robot: SpatialRobot
    ground: SpatialGround
    method: Method
    """How it went through time."""
    status: RunStatus
    """How the run ended."""
    message: str
    """The same in a person's words."""
    time: Floats
    """(nt,) Seconds."""
    position: Floats
    """(nt, nq) Generalised positions (m, rad)."""
    velocity: Floats
    """(nt, nv) Generalised velocities (m/s, rad/s)."""
    torque: Floats
    """(nt, nu) Joint torques within their limits (N m)."""
    stop_torque: Floats
    """(nt, nv) Force of the joint stops on the robot (N m, N)."""
    friction_torque: Floats
    """(nt, nv) Dry friction of the joints on the robot (N m, N)."""
    contact_point: Floats
    """(nt, nc, 3) World position of the contact points (m)."""
    contact_normal: Floats
    """(nt, nc, 3) Ground normal at the contact points."""
    gap: Floats
    """(nt, nc) Distance to the ground (m)."""
    contact_force: Floats
    """(nt, nc, 3) Contact forces on the robot, normal, t1, t2, mean over the step (N)."""
    slip: Floats
    """(nt, nc, 2) Tangential velocity along t1 and t2 after the step (m/s)."""
    residual: Floats
    """(nt,) Residual of the contact problem of the step."""
    events: tuple[SpatialEvent, ...]
    certificates: SpatialCertificates
    solver: SpatialSolverCount
    steps: int
    """Steps taken; the parts of halved ones count each."""
    saturations: int
    """Commands that limits or motors did not let through."""
    timing: Timing
    error: BaseException | None = field(default=None, repr=False)
    """What the controller raised, if that ended the run."""
    pushes: tuple[Push, ...] = ()
    """What pushed the robot, and what would have later."""

    def __repr__(self) -> str:
        last = self.time[-1] if len(self.time) else 0.0
        return (
            f"SpatialRun({self.robot.name}, {self.method.name}, {last:.6g} s, "
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
        """Force (x, y, z) on the robot at each contact point in world axes, (nt, nc, 3), in N."""
        normal = self.contact_normal
        first, second = tangents_of(normal)
        force = self.contact_force
        total: Floats = force[..., :1] * normal + force[..., 1:2] * first + force[..., 2:] * second
        return total

    def summary(self) -> SpatialSummary:
        """Summarise the run; see :func:`heelstrike.analysis.spatial.summary.summarize_in_space`.

        Returns
        -------
        SpatialSummary
            Figures with units in their names.
        """
        from heelstrike.analysis.spatial.summary import summarize_in_space

        return summarize_in_space(self)

    def plot(self, what: str, **options: Any) -> Figure:
        """Draw a figure of the run; see :func:`heelstrike.view.spatial.figures.plot_in_space`.

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
        from heelstrike.view.spatial.figures import plot_in_space

        return plot_in_space(self, what, **options)

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

    def save_html(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the run as one HTML file; see :func:`heelstrike.view.spatial.page.save_html`.

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
        from heelstrike.view.spatial.page import save_html

        return save_html(self, path, **options)

    def to_dataset(self) -> xarray.Dataset:
        """Return the run as a labelled dataset with units.

        Returns
        -------
        xarray.Dataset
            With the dimensions ``time``, ``q``, ``v``, ``actuator``, ``contact``, ``axis`` (x, y,
            z), ``component`` (normal, t1, t2), ``tangent`` (t1, t2) and ``event``.
        """
        from heelstrike.sim.spatial.dataset import dataset_of

        return dataset_of(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the dataset of the run as NetCDF.

        Parameters
        ----------
        path : str or path
            File to write, whose name ends in .nc.

        Returns
        -------
        Path
            The file. It appears whole or not at all.

        Raises
        ------
        RunFileError
            If the name ends in anything else or the file cannot be written.
        """
        from heelstrike.sim.spatial.dataset import save_dataset

        return save_dataset(self, path)


def tangents_of(normal: Floats) -> tuple[Floats, Floats]:
    """Tangents t1 and t2 of contacts with some normals, (..., 3) each."""
    x = np.zeros_like(normal)
    x[..., 0] = 1.0
    first = x - normal * normal[..., :1]
    length = np.linalg.norm(first, axis=-1, keepdims=True)
    along = length < X_NORMAL
    first = np.where(along, np.array([0.0, 1.0, 0.0]), first / np.where(along, 1.0, length))
    return first, np.cross(normal, first)


X_NORMAL = 1e-12
"""Sine of the angle from x up to which a normal is along it."""


def joined_records(records: Sequence[SpatialRecord]) -> dict[str, Any]:
    """Return rows and events of consecutive records as fields of a run."""

    def join(name: str, used: str) -> Any:
        return np.concatenate([getattr(each, name)[: getattr(each, used)] for each in records])

    rows = {name: join(name, "rows") for name in ("time", *RECORDED)}
    arrays = [join(f"event_{name}", "events") for name in ("time", "kind", "contact", "impulse")]
    order = np.argsort(arrays[0], kind="stable")
    lists = [values[order].tolist() for values in arrays]
    events = tuple(
        SpatialEvent(time, SpatialEventKind(kind), contact, (n, s, t))
        for time, kind, contact, (n, s, t) in zip(*lists, strict=True)
    )
    return {**rows, "events": events}


def counts_of(memory: SpatialMemory) -> dict[str, Any]:
    """Return counts and worst values of a simulation as fields of a run."""
    tally, solver = memory.tally, memory.solver.tally
    return {
        "certificates": SpatialCertificates(
            penetration=tally.penetration, residual=tally.residual,
            uncertified=tally.uncertified, halved=tally.halved, relaxed=tally.relaxed,
            energy_gain=tally.energy_gain,
        ),
        "solver": SpatialSolverCount(
            solver.solves, solver.shortcuts, solver.fallbacks, solver.failures
        ),
        "steps": tally.steps,
        "saturations": tally.saturations,
    }  # fmt: skip
