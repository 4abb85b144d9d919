"""plot(): the figures of a run by their names."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.sim.run import QUANTITIES, Run
from heelstrike.view import contact_figures, energy_figure, joint_figures, snapshots
from heelstrike.view.panels import Excerpt, rows_within
from heelstrike.view.quantity_figure import draw_quantity
from heelstrike.view.style import save_figure, styled
from heelstrike.wording import meant

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

_DRAWINGS: dict[str, Callable[[Excerpt], Figure]] = {
    "tracking": joint_figures.draw_tracking,
    "velocities": joint_figures.draw_velocities,
    "zmp": contact_figures.draw_zero_moment_point,
    "friction": contact_figures.draw_friction,
    "forces": contact_figures.draw_forces,
    "torque": joint_figures.draw_torque,
    "gaps": contact_figures.draw_gaps,
    "energy": energy_figure.draw_energy,
    "snapshots": snapshots.draw_snapshots,
}

FIGURES = tuple(_DRAWINGS)
"""Names of the figures that :func:`plot` draws."""


@takes(ViewError)
def plot(
    run: Run,
    what: str,
    *,
    gait: Gait | None = None,
    path: str | os.PathLike[str] | None = None,
    span: tuple[float, float] | None = None,
) -> Figure:
    """Draw a figure of a run.

    Parameters
    ----------
    run : Run
        The run.
    what : str
        One of :data:`FIGURES`: ``"tracking"``, ``"velocities"``, ``"zmp"`` and ``"friction"`` are
        the paper's Figures 3 to 6; ``"forces"``, ``"torque"``, ``"gaps"``, ``"energy"``,
        ``"snapshots"``. Or the name of an array of the run, such as ``"slip_velocity"``, or of what
        its controller logged, which is drawn as it is.
    gait : Gait, optional
        The gait that the run followed; without it no references are drawn.
    path : str or path, optional
        File to write: .png, .pdf or .svg.
    span : tuple of float, optional
        First and last time to show, in s; all of the run by default. The snapshots are taken in
        the middle step of it.

    Returns
    -------
    matplotlib.figure.Figure
        The figure. It belongs to no window: ``figure.savefig`` writes it, and a notebook shows it
        where a cell ends in it.

    Raises
    ------
    ViewError
        If there is no such figure, nothing to show, or the file cannot be written.
    GaitError
        If the gait does not fit the robot of the run.
    """
    if what not in _DRAWINGS and what not in QUANTITIES and what not in run.log:
        raise unknown_figure(what, "figure", _DRAWINGS, (*QUANTITIES, *run.log))
    excerpt = Excerpt(run, rows_within(run, span), gait)
    with styled():
        drawing = _DRAWINGS.get(what)
        figure = draw_quantity(excerpt, what) if drawing is None else drawing(excerpt)
    if path is not None:
        save_figure(figure, path)
    return figure


def unknown_figure(
    what: str, kind: str, drawings: Mapping[str, Callable[..., Any]], recorded: Iterable[str]
) -> ViewError:
    """Return what says that there is no such figure of a kind, and which there are."""
    recorded = tuple(recorded)
    guess = meant(str(what).lower(), (*drawings, *recorded))
    names = " ".join(f"{name}: {drawing.__doc__}" for name, drawing in drawings.items())
    return ViewError(
        f"there is no {kind} called {what!r}.{guess} There are: {names} And what is recorded: "
        f"{', '.join(recorded)}."
    )
