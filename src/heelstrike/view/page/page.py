"""save_html(): a run as one HTML file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.summary import summarize
from heelstrike.analysis.support import support_phases
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.robot.model import Floats
from heelstrike.sim.run import AnyRun, Run
from heelstrike.view.page.columns import TOLERANCE, packed
from heelstrike.view.page.curves import Plot, plots
from heelstrike.view.page.events import described
from heelstrike.view.page.markup import escaped, player, shipped, table
from heelstrike.view.page.motion import frames
from heelstrike.view.page.provenance import provenance
from heelstrike.view.page.rows import Rows, shown_rows
from heelstrike.view.page.scene import scene
from heelstrike.view.page.verdict import judge
from heelstrike.view.style import view_errors
from heelstrike.whole_file import check_target, write_whole

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

MOST_EVENTS = 4000
"""Events that a page lists."""
MOST_PHASES = 2000
"""Phases of support that a page shows below its timeline."""


@takes(ViewError)
def save_html(
    run: Run,
    path: str | os.PathLike[str],
    *,
    gait: Gait | None = None,
    command: str = "",
) -> Path:
    """Write a run as one HTML file: animation, timeline with events, curves, figures, provenance.

    The file needs nothing else and asks for nothing: it opens from a disk or a mail, without a
    network, in any browser of the last years.

    Parameters
    ----------
    run : Run
        The run.
    path : str or path
        File to write, .html or .htm.
    gait : Gait, optional
        The gait that the run followed, for references and the tracking error.
    command : str
        The command that made the run, for its provenance.

    Returns
    -------
    Path
        The file. It appears whole or not at all.

    Raises
    ------
    ViewError
        If the run is empty, or the file cannot be written.
    GaitError
        If the gait does not fit the robot of the run.
    """
    target = check_page(path)
    text = page(run, gait, command=command)
    with view_errors():
        return write_whole(target, text)


def check_page(path: str | os.PathLike[str]) -> Path:
    """Refuse what cannot be the file of a page.

    Raises
    ------
    ViewError
        That says why.
    """
    target = Path(path)
    with view_errors():
        check_target(target)
    if target.suffix.lower() not in (".html", ".htm"):
        hint = "; a browser prints it to PDF" if target.suffix.lower() == ".pdf" else ""
        raise ViewError(f"cannot write {target}: the name of a page ends in .html{hint}")
    return target


def page(run: Run, gait: Gait | None = None, *, command: str = "") -> str:
    """Write the page of a run; see :func:`save_html`."""
    if not len(run.time):
        raise ViewError(f"there is nothing to show: the run has no rows ({run.message})")
    summary = summarize(run, gait=gait)
    parts = {
        "title": escaped(run.robot.name),
        "headline": escaped(judge(run, gait).headline),
        "summary": table(dict(summary.lines()), "Summary"),
        "certificates": table(certificates(run), "Certificates: worst values over all steps"),
        "provenance": table(provenance(run, gait, command=command), "Where this comes from"),
        "camera": "",
    }
    script = "".join(map(shipped, ("drawing.js", "recording.js")))
    return player(f"{run.robot.name}: {run.message}", parts, contents(run, gait), script)


def certificates(run: Run) -> dict[str, str]:
    """Return the worst values of a run's certificates, label by label."""
    worst = run.certificates
    made = {"energy made by restitution": f"{worst.energy_gain:.3g} J"}
    return {
        "deepest penetration": f"{worst.penetration:.3g} m",
        "residual of complementarity": f"{worst.complementarity:.3g} of the data",
        "residual of the friction cone": f"{worst.cone:.3g} of the data",
        "residual of non-penetration": f"{worst.non_penetration:.3g} of the data",
        "contact problems": str(run.solver),
        **(made if worst.energy_gain > 0.0 else {}),
    }


def contents(run: Run, gait: Gait | None = None) -> dict[str, Any]:
    """Return what the script of a page shows, as JSON has it.

    Forces are means from each row shown to the next.
    """
    rows = shown_rows(run)
    motion = run_motion(run)
    zmp = zero_moment_point(run, motion=motion)
    columns = frames(run, rows, motion, zmp)
    return recorded(run, rows, scene(run.robot, run.ground), columns, plots(run, gait, rows, zmp))


def recorded(
    run: AnyRun,
    rows: Rows,
    drawn: dict[str, Any],
    columns: dict[str, Floats],
    panels: Sequence[Plot],
) -> dict[str, Any]:
    """Return what the script of a page shows of some rows of a run, as JSON has it.

    Numbers are those of the run to `TOLERANCE` of their range, times are exact.

    Parameters
    ----------
    run : AnyRun
        The run.
    rows : (k,) int
        The rows.
    drawn : dict
        What is drawn: the robot and its ground.
    columns : dict of (k, ...) float
        What moves, by its name.
    panels : sequence of Plot
        Panels of curves.
    """
    curves = {
        f"curve {i} {k}": trace.values
        for i, panel in enumerate(panels)
        for k, trace in enumerate(panel.traces)
        if trace.values is not None
    }
    events = run.events[:MOST_EVENTS]
    phases = support_phases(run)[:MOST_PHASES]
    return {
        "scene": drawn,
        "data": packed(run.time[rows], columns | curves),
        "plots": [panel.described() for panel in panels],
        "events": [described(event, run.robot) for event in events],
        "phases": [[phase.start, phase.end, *phase.feet] for phase in phases],
        "left_out": len(run.events) - len(events),
        "recorded": len(run.time),
        "tolerance": TOLERANCE,
    }
