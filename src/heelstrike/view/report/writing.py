"""report(): one run, or several side by side, on a page that prints well."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from heelstrike.analysis.summary import lines, summarize
from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.sim.run import Run
from heelstrike.view.figures import FIGURES, plot
from heelstrike.view.page.markup import data_block, document, escaped, grid, shipped, table
from heelstrike.view.page.page import certificates, check_gait, check_page, contents
from heelstrike.view.page.provenance import provenance
from heelstrike.view.page.verdict import REACHED, Limit, Verdict, judge
from heelstrike.view.report.differences import differences
from heelstrike.view.style import styled, view_errors
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

CAPTIONS = {
    "snapshots": "The robot at equal times of its middle step, with the forces of the ground",
    "tracking": "Joint positions and their references",
    "velocities": "Joint velocities and their references",
    "zmp": "Zero moment point of the stance foot, within its sole",
    "friction": "Tangential forces within the friction cones",
    "forces": "Forces of the ground on the feet",
    "torque": "Joint torques and their limits",
    "gaps": "Heights of the contact points",
    "energy": "Energy, and the work that changed it",
}
"""What the figures show, in the order of a report."""

PIXELS = 110
"""Dots an inch of what a figure does not draw as lines."""


@takes(ViewError)
def report(
    runs: Run | Mapping[str, Run] | Sequence[Run],
    path: str | os.PathLike[str],
    *,
    gait: Gait | None = None,
    command: str = "",
) -> Path:
    """Write a report of a run, or of several side by side, as one HTML page.

    The first line is the verdict: does it walk, how close does it come to each limit, what to
    change. Then the film, the limits, figures, tables, certificates, versions, inputs, and the
    command that makes it again. A browser prints the page to PDF.

    Parameters
    ----------
    runs : Run, or mapping of names to runs, or sequence of runs
        What to report; several are compared, the first being the one the others are held against.
        Runs of a sequence are named after their methods.
    path : str or path
        File to write, .html or .htm.
    gait : Gait, optional
        The gait that they followed, for references and the tracking error.
    command : str
        The command that makes the report, for its provenance.

    Returns
    -------
    Path
        The file. It appears whole or not at all.

    Raises
    ------
    ViewError
        If there is no run, one is empty, or the file cannot be written.
    GaitError
        If the gait does not fit the robot of a run.
    """
    target = check_page(path)
    named = _named(runs)
    check_gait(gait)
    for name, run in named.items():
        if not isinstance(run, Run):
            raise ViewError(f"a report is of runs, got {run!r}; load_run reads one from its file")
        if not len(run.time):
            raise ViewError(f"there is nothing to report of {name}: no rows ({run.message})")
    text = report_page(named, gait, command=command)
    with view_errors():
        return write_whole(target, text)


def report_page(named: Mapping[str, Run], gait: Gait | None = None, *, command: str = "") -> str:
    """Write the page of a report; see :func:`report`."""
    verdicts = {name: judge(run, gait) for name, run in named.items()}
    robots = " and ".join(dict.fromkeys(run.robot.name for run in named.values()))
    title = f"{robots}: report" if len(named) == 1 else f"{robots}: {', '.join(named)}"
    body = [
        f"<header><h1>{escaped(title)}</h1>",
        *_headlines(verdicts),
        "</header><main>",
        _films(named),
        *(_limits(name, verdict, len(named)) for name, verdict in verdicts.items()),
        *_advice(verdicts),
        *_differences(named),
        _summaries(named, gait),
        "<h2>Figures</h2>",
        *_figures(named, gait),
        "<h2>Certificates</h2>",
        *(table(certificates(run), _caption(name, named)) for name, run in named.items()),
        "<h2>Where this comes from</h2>",
        *_origins(named, gait, command),
        "</main>",
        data_block("runs", [contents(run, gait) for run in named.values()]),
    ]
    style = shipped("page.css") + shipped("report.css")
    script = "".join(map(shipped, ("drawing.js", "recording.js", "films.js")))
    return document(title, "\n".join(body), style=style, script=script)


def _named(runs: Run | Mapping[str, Run] | Sequence[Run]) -> dict[str, Run]:
    if isinstance(runs, Run):
        return {runs.robot.name: runs}
    if isinstance(runs, str | os.PathLike):
        raise ViewError(f"a report is of runs, got {runs!r}; load_run reads one from its file")
    named = dict(runs) if isinstance(runs, Mapping) else {}
    for run in () if isinstance(runs, Mapping) else runs:
        method = run.method.name if isinstance(run, Run) else str(run)
        name, several = method, 1
        while name in named:
            several += 1
            name = f"{method} {several}"
        named[name] = run
    if not named:
        raise ViewError("there is no run to report")
    return named


def _headlines(verdicts: Mapping[str, Verdict]) -> Iterator[str]:
    for name, verdict in verdicts.items():
        sign = "good" if verdict.good else "bad"
        label = f"{escaped(name)}: " if len(verdicts) > 1 else ""
        first, _, rest = verdict.headline.partition(". ")
        yield (
            f'<p class="verdict">{label}<span class="{sign}">{escaped(first)}.</span> '
            f"{escaped(rest)}</p>"
        )


def _films(named: Mapping[str, Run]) -> str:
    canvases = "".join(
        f'<figure><canvas role="img" aria-label="film of {escaped(name)}"></canvas>'
        f"<figcaption>{escaped(name)}</figcaption></figure>"
        for name in named
    )
    return (
        f'<section id="films" aria-label="film"><div class="films">{canvases}</div>'
        '<div class="controls" role="group" aria-label="controls">'
        '<button id="play" type="button" aria-label="play">▶ play</button>'
        '<input id="time" type="range" min="0" max="1000" value="0" step="1" aria-label="time">'
        '<label>speed <select id="speed" aria-label="speed"><option value="1">1 ×</option>'
        '<option value="0.25">1/4</option><option value="0.05">1/20</option></select></label>'
        '<output id="clock" for="time" aria-live="off">0 s</output></div></section>'
    )


def _limits(name: str, verdict: Verdict, several: int) -> str:
    rows = "".join(map(_limit, verdict.limits))
    if not rows:
        return ""
    caption = "How close to each limit" + (f": {name}" if several > 1 else "")
    return (
        f'<table class="limits"><caption>{escaped(caption)}</caption><thead><tr>'
        '<th scope="col">limit</th><th scope="col">used</th><th scope="col" aria-hidden="true">'
        '</th><th scope="col">closest</th><th scope="col">reached</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _limit(limit: Limit) -> str:
    share = min(max(limit.used, 0.0), 1.0)
    reached = f"at {limit.reached:.3g} s" if limit.used >= REACHED else "never"
    sign = "bad" if limit.used >= REACHED else "far"
    return (
        f'<tr><th scope="row">{escaped(limit.name)}</th>'
        f'<td class="{sign}">{100.0 * limit.used:.3g} %</td>'
        f'<td><meter min="0" max="1" low="0.9" high="0.9999" optimum="0" value="{share:.4f}" '
        f'aria-hidden="true"></meter></td><td>{escaped(limit.detail)}</td>'
        f'<td class="{sign}">{escaped(reached)}</td></tr>'
    )


def _advice(verdicts: Mapping[str, Verdict]) -> Iterator[str]:
    yield "<h2>What to change</h2>"
    for name, verdict in verdicts.items():
        label = f"<p>{escaped(name)}:</p>" if len(verdicts) > 1 else ""
        items = "".join(f"<li>{escaped(each)}</li>" for each in verdict.advice)
        yield label + (f"<ul>{items}</ul>" if items else "<p>Nothing has to change.</p>")


def _differences(named: Mapping[str, Run]) -> Iterator[str]:
    if len(named) > 1:
        heading, rows = differences(named)
        yield grid(heading, rows, f"Differences from {next(iter(named))}")


def _summaries(named: Mapping[str, Run], gait: Gait | None) -> str:
    each = [dict(lines(summarize(run, gait=gait))) for run in named.values()]
    if len(each) == 1:
        return table(each[0], "Summary")
    rows = [(label, *(one.get(label, "–") for one in each)) for label in each[0]]
    return grid(("", *named), rows, "Summary")


def _figures(named: Mapping[str, Run], gait: Gait | None) -> Iterator[str]:
    for what in sorted(FIGURES, key=list(CAPTIONS).index):
        pictures = []
        for name, run in named.items():
            try:
                drawn = plot(run, what, gait=gait)
            except ViewError:  # there is nothing of the kind on this robot
                continue
            words = CAPTIONS[what] + (f": {name}" if len(named) > 1 else "")
            pictures.append(
                f'<figure><img alt="{escaped(words)}" src="{svg(drawn)}">'
                f"<figcaption>{escaped(words)}</figcaption></figure>"
            )
        if pictures:
            yield f'<div class="pair">{"".join(pictures)}</div>'


def svg(figure: Figure) -> str:
    """Write a figure as an address that holds it, for an image: no script in it would run."""
    picture = io.BytesIO()
    with styled():
        figure.savefig(picture, format="svg", dpi=PIXELS, metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(picture.getvalue()).decode('ascii')}"


def _origins(named: Mapping[str, Run], gait: Gait | None, command: str) -> Iterator[str]:
    for name, run in named.items():
        found = provenance(run, gait, command=command)
        yield table(found, _caption(name, named))


def _caption(name: str, named: Mapping[str, Run]) -> str:
    return name if len(named) > 1 else ""
