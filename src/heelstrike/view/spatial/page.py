"""save_html(): a run in space as one HTML file."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.analysis.spatial.summary import summarize_in_space
from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.page.markup import data_block, escaped, player, shipped, table
from heelstrike.view.page.page import check_page, recorded
from heelstrike.view.page.provenance import method_in_words, versions
from heelstrike.view.page.rows import MOST_ROWS, shown_rows
from heelstrike.view.page.verdict import Verdict, happened
from heelstrike.view.spatial.scene import moving_columns, scene_in_space, spatial_plots
from heelstrike.view.spatial.verdict import judge_in_space
from heelstrike.view.style import view_errors
from heelstrike.whole_file import write_whole

LARGEST = 1_400_000
"""Bytes of a page above which it has fewer rows."""

FEWEST_ROWS = 100

MOST_LIMITS = 12
"""Limits that a page lists."""

CAMERA = (
    " Dragging turns the picture, with Shift it moves; the wheel, + and − come nearer and go away; "
    "f follows the robot or stays; r takes the camera back; 1 to 4 look from aslant, the right, "
    "ahead and behind."
)


@takes(ViewError)
def save_html(run: SpatialRun, path: str | os.PathLike[str], *, command: str = "") -> Path:
    """Write a run in space as one HTML file: animation, events, curves, figures, provenance.

    The file needs nothing else and asks for nothing: it opens from a disk or a mail, without a
    network, in any browser of the last years. It holds at most 1.5 MB: a long run has fewer rows.

    Parameters
    ----------
    run : SpatialRun
        The run.
    path : str or path
        File to write, .html or .htm.
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
    """
    target = check_page(path)
    text = page_in_space(run, command=command)
    with view_errors():
        return write_whole(target, text)


def page_in_space(run: SpatialRun, *, command: str = "") -> str:
    """Write the page of a run; see :func:`save_html`."""
    if not len(run.time):
        raise ViewError(f"there is nothing to show: the run has no rows ({run.message})")
    summary, verdict = summarize_in_space(run), judge_in_space(run)
    parts = {
        "title": escaped(run.robot.name),
        "headline": escaped(verdict.headline),
        "summary": "".join(
            (
                _what_happened(verdict, run),
                _limits(verdict),
                table(dict(summary.lines()), "Summary"),
            )
        ),
        "certificates": table(
            certificates_in_space(run), "Certificates: worst values over all steps"
        ),
        "provenance": table(provenance_in_space(run, command), "Where this comes from"),
        "camera": escaped(CAMERA),
    }
    script = drawing_script()
    content = contents_within(run, LARGEST - len(script) - len(shipped("player.js")))
    return player(f"{run.robot.name}: {run.message}", parts, content, script)


def drawing_script() -> str:
    """Return the script that draws runs in space."""
    own = files(__package__).joinpath("space.js").read_text(encoding="utf-8")
    return "".join((*map(shipped, ("drawing.js", "recording.js")), own))


def contents_within(run: SpatialRun, room: int) -> dict[str, Any]:
    """Return what :func:`contents` does, of so few rows that it takes no more bytes as JSON."""
    most = MOST_ROWS
    while True:
        found = contents(run, most=most)
        if len(data_block("run", found)) <= room or most <= FEWEST_ROWS:
            return found
        most = max(FEWEST_ROWS, int(0.6 * most))


def _what_happened(verdict: Verdict, run: SpatialRun) -> str:
    """What went wrong, causes before consequences; nothing of a run in which nothing did."""
    rows = [(f"{time:.3f} s", what) for time, what in happened(verdict, run)]
    return table(rows, "What happened, causes before consequences") if rows else ""


def _limits(verdict: Verdict) -> str:
    """How close the run came to each limit, the closest first."""
    rows = {
        limit.name: f"{100.0 * limit.used:.3g} % used; {limit.detail}"
        for limit in verdict.limits[:MOST_LIMITS]
    }
    before = " before the first cause" if verdict.fall is not None else ""
    return table(rows, f"How close to each limit{before}") if rows else ""


def contents(run: SpatialRun, *, most: int = MOST_ROWS) -> dict[str, Any]:
    """Return what the script of a page shows, as JSON has it, of at most so many rows."""
    rows = shown_rows(run, most=most)
    if len(rows) > most:
        rows = np.unique(rows[np.linspace(0, len(rows) - 1, most).round().astype(np.int64)])
    drawn = scene_in_space(run.robot, run.ground)
    return recorded(run, rows, drawn, moving_columns(run, rows), spatial_plots(run, rows))


def certificates_in_space(run: SpatialRun) -> dict[str, str]:
    """Return the worst values of a run's certificates, label by label."""
    worst, solver = run.certificates, run.solver
    return {
        "deepest penetration": f"{worst.penetration:.3g} m",
        "residual of the contact problems": f"{worst.residual:.3g} of the data",
        "steps not certified to 1e-9": str(worst.uncertified),
        "steps taken in parts": str(worst.halved),
        "steps with points left in place, or an impact not taken whole": str(worst.relaxed),
        "contact problems": f"{solver.solves}, {solver.shortcuts} by known modes, "
        f"{solver.fallbacks} by another way, {solver.failures} failed",
    }


def provenance_in_space(run: SpatialRun, command: str = "") -> dict[str, str]:
    """Say where a run comes from, label by label."""
    robot, ground = run.robot, run.ground
    normal = ", ".join(f"{float(value) + 0.0:.4g}" for value in np.asarray(ground.normal))
    return {
        **({"command": command} if command else {}),
        **versions(),
        "robot": f"{robot.name}, {robot.total_mass:.6g} kg, {robot.nv} velocities, {robot.nu} "
        f"actuators, {robot.nc} contact points",
        "ground": f"plane with normal ({normal}), {len(ground.boxes)} boxes, friction "
        f"{ground.friction:g}, restitution {ground.restitution:g}",
        "method": method_in_words(run),
        "record": f"{run.steps} steps, {len(run.time)} rows from {run.time[0]:.6g} s to "
        f"{run.time[-1]:.6g} s, {len(run.events)} events",
    }
