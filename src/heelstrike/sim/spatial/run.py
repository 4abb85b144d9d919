"""What a simulation in space leaves behind, whatever its end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.run import AnyRun, Event, SolverCount, quantities_of, recorded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from heelstrike.analysis.spatial.summary import SpatialSummary


SpatialEvent = Event
SpatialSolverCount = SolverCount
"""SpatialEvent, SpatialSolverCount: Those of the plane. In space an event has three components of
impulse."""


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
    or down to it by less than 1e-9 m, or whose impact did not bounce or was left to the next: no
    certified way was found."""
    energy_gain: float
    """Kinetic energy that restitution with friction made (J)."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SpatialRun(AnyRun):
    """Record of a simulation in space.

    A row holds everything about one instant: the state, the torques decided in it, and the contact
    forces of the step that follows. Forces act on the robot; those of contacts are in the axes of
    the contact: normal, t1, t2.
    """

    robot: SpatialRobot
    ground: SpatialGround
    certificates: SpatialCertificates
    slip: Floats = recorded(
        "nc", 2, of="reaction.slip", unit="m/s",
        label="tangential velocity of the contact points after the step",
    )  # fmt: skip
    """Along t1 and t2. Zero for points that are not in the contact problem."""
    residual: Floats = recorded(
        of="reaction.residual", unit="1", label="relative residual of the contact problem"
    )
    """Zero where there was none."""

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


RECORDED = quantities_of(SpatialRun)
"""What is recorded in space."""


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
