"""report(): one run, or several side by side, on a page that prints well."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from heelstrike.analysis.actuation import turning
from heelstrike.analysis.diagnosis.changes import Tried
from heelstrike.analysis.diagnosis.limits import REACHED, Limit
from heelstrike.analysis.diagnosis.measures import motor_loads
from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.sim.run import AnyRun
from heelstrike.view.page.markup import data_block, document, escaped, grid, shipped, table
from heelstrike.view.page.page import check_page
from heelstrike.view.page.verdict import NOTHING_TO_CHANGE, happened
from heelstrike.view.report.account import Account, account_of
from heelstrike.view.report.differences import differences
from heelstrike.view.style import in_words, styled, view_errors
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

PIXELS = 110
"""Dots an inch of what a figure does not draw as lines."""

FILMS = 1_000_000
"""Bytes that the films of a page take together, about."""

LIMITS_REACHED = (
    "It did not fall, and its contact certificates hold. It reached limits, listed below: whether "
    "they matter depends on what it was meant to do"
)
"""What is said of a good run without advice that reached a limit."""


@takes(ViewError)
def report(
    runs: AnyRun | Mapping[str, AnyRun] | Sequence[AnyRun],
    path: str | os.PathLike[str],
    *,
    gait: Gait | None = None,
    command: str = "",
    tried: Mapping[str, Sequence[Tried]] | None = None,
) -> Path:
    """Write a report of a run, or of several side by side, as one HTML page.

    The first line is the verdict: does it walk, why did it fall or how close does it come to its
    limits, what to change. Then the film, which begins where it went wrong, what happened, what to
    change and what was tried, the limits, the figures that an engineer signs, pictures,
    certificates, versions, inputs, and the command that makes it again. A browser prints the page
    to PDF.

    Parameters
    ----------
    runs : Run or SpatialRun, or mapping of names to runs, or sequence of runs
        What to report, in the plane or in space; several are compared, the first being the one the
        others are held against. Runs of a sequence are named after their methods.
    path : str or path
        File to write, .html or .htm.
    gait : Gait, optional
        The gait that runs in the plane followed, for references and the tracking error.
    command : str
        The command that makes the report, for its provenance.
    tried : mapping of str to sequence of Tried, optional
        What was tried beside each run, by its name: that of the robot for a single run.
        :mod:`heelstrike.experiments.what_if` tries, and so does ``heelstrike report``.

    Returns
    -------
    Path
        The file. It appears whole or not at all.

    Raises
    ------
    ViewError
        If there is no run, one is empty, some are in the plane and some in space, or the file
        cannot be written.
    GaitError
        If the gait does not fit the robot of a run.
    """
    target = check_page(path)
    text = report_page(_named(runs), gait, command=command, tried=tried)
    with view_errors():
        return write_whole(target, text)


def report_page(
    runs: Mapping[str, AnyRun],
    gait: Gait | None = None,
    *,
    command: str = "",
    tried: Mapping[str, Sequence[Tried]] | None = None,
) -> str:
    """Write the page of a report; see :func:`report`.

    Raises
    ------
    ViewError
        If one has no rows, or some are in the plane and some in space.
    """
    beside = tried or {}
    named = {name: account_of(name, run, gait, beside.get(name, ())) for name, run in runs.items()}
    kinds = {type(account) for account in named.values()}
    if len(kinds) > 1:
        raise ViewError("a report compares runs in the plane, or runs in space, not both")
    robots = " and ".join(dict.fromkeys(account.run.robot.name for account in named.values()))
    title = f"{robots}: report" if len(named) == 1 else f"{robots}: {', '.join(named)}"
    films = []
    for account in named.values():
        films.append(account.film(FILMS // len(named)) | {"shown": account.shown()})
    body = [
        f"<header><h1>{escaped(title)}</h1>",
        *_headlines(named),
        "</header><main>",
        _films(named),
        *_happened(named),
        *_advice(named),
        *_tried(named),
        *(_limits(name, account, len(named)) for name, account in named.items()),
        *_measures(named),
        *_differences(named),
        _summaries(named),
        "<h2>Figures</h2>",
        *_figures(named),
        "<h2>Certificates</h2>",
        *(table(account.certificates(), _caption(name, named)) for name, account in named.items()),
        "<h2>Where this comes from</h2>",
        *(
            table(account.provenance(command), _caption(name, named))
            for name, account in named.items()
        ),
        "</main>",
        data_block("runs", films),
    ]
    style = shipped("page.css") + shipped("report.css")
    script = next(iter(named.values())).script() + shipped("films.js")
    return document(title, "\n".join(body), style=style, script=script)


def _named(runs: AnyRun | Mapping[str, AnyRun] | Sequence[AnyRun]) -> dict[str, AnyRun]:
    if isinstance(runs, AnyRun):
        return {runs.robot.name: runs}
    if isinstance(runs, str | os.PathLike):
        raise ViewError(f"a report is of runs, got {runs!r}; load_run reads one from its file")
    named = dict(runs) if isinstance(runs, Mapping) else {}
    for run in () if isinstance(runs, Mapping) else runs:
        method = run.method.name if isinstance(run, AnyRun) else str(run)
        name, several = method, 1
        while name in named:
            several += 1
            name = f"{method} {several}"
        named[name] = run
    if not named:
        raise ViewError("there is no run to report")
    return named


def _headlines(named: Mapping[str, Account]) -> Iterator[str]:
    for name, account in named.items():
        verdict = account.verdict
        sign = "good" if verdict.good else "bad"
        label = f"{escaped(name)}: " if len(named) > 1 else ""
        first, _, rest = verdict.headline.partition(". ")
        yield (
            f'<p class="verdict">{label}<span class="{sign}">{escaped(first)}.</span> '
            f"{escaped(rest)}</p>"
        )


def _films(named: Mapping[str, Account]) -> str:
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


def _happened(named: Mapping[str, Account]) -> Iterator[str]:
    """What went wrong, one after the other; a click on a time takes the film there."""
    for name, account in named.items():
        if account.verdict.fall is None:
            continue
        cells = "".join(
            '<tr><th scope="row"><button type="button" '
            f'data-time="{time:.6f}">{time:.3f} s</button></th><td>{escaped(what)}</td></tr>'
            for time, what in happened(account.verdict, account.run)
        )
        caption = "What happened, causes before consequences" + (
            f": {name}" if len(named) > 1 else ""
        )
        yield (
            f'<table class="happened"><caption>{escaped(caption)}</caption>'
            f"<tbody>{cells}</tbody></table>"
        )


def _tried(named: Mapping[str, Account]) -> Iterator[str]:
    for name, account in named.items():
        caption = "Tried beside this run" + (f": {name}" if len(named) > 1 else "")
        tried = account.verdict.tried
        rows = [(each.what, each.outcome) for each in tried if each.change is None]
        if rows:
            yield grid(("", "withstood"), rows, caption)
        elif not tried and account.not_tried:
            yield f'<p class="note">{escaped(caption)}: nothing. {escaped(account.not_tried)}</p>'


def _measures(named: Mapping[str, Account]) -> Iterator[str]:
    for name, account in named.items():
        of = f": {name}" if len(named) > 1 else ""
        rows = [
            (each.name, f"{each.value:.3g}\u00a0{each.unit}".strip(), each.detail)
            for each in account.measures()
        ]
        if rows:
            yield grid(("", "value", ""), rows, f"{account.measured}{of}")
        loads = [
            (
                in_words(load.name), f"{load.peak_torque:.3g}", f"{load.rms_torque:.3g}",
                f"{load.peak_speed:.3g}", f"{load.mean_power:.3g}", f"{load.peak_power:.3g}",
            )
            for load in motor_loads(account.run)
        ]  # fmt: skip
        if loads:
            robot = account.run.robot
            slides = "" if turning(robot)[robot.driven].all() else " (N and m/s of slides)"
            heading = ("", "peak torque (N m)", "rms (N m)", "peak speed (rad/s)",
                       "mean power (W)", "peak power (W)")  # fmt: skip
            yield f'<div class="wide">{grid(heading, loads, f"Motors{slides}{of}")}</div>'


def _limits(name: str, account: Account, several: int) -> str:
    verdict = account.verdict
    rows = "".join(map(_limit, verdict.limits))
    if not rows:
        return ""
    before = " before the first cause" if verdict.fall is not None else ""
    caption = f"How close to each limit{before}" + (f": {name}" if several > 1 else "")
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


def _advice(named: Mapping[str, Account]) -> Iterator[str]:
    yield "<h2>What to change</h2>"
    for name, account in named.items():
        verdict = account.verdict
        label = f"<p>{escaped(name)}:</p>" if len(named) > 1 else ""
        items = "".join(f"<li>{escaped(each)}</li>" for each in verdict.advice)
        nothing = "No change is known that would help."
        if verdict.good:
            reached = any(limit.used >= REACHED for limit in verdict.limits)
            checked = LIMITS_REACHED if reached else NOTHING_TO_CHANGE
            nothing = " ".join(filter(None, (f"{checked}.", account.withstands)))
        nothing = f"<p>{nothing}</p>"
        yield label + (f"<ol>{items}</ol>" if items else nothing)


def _differences(named: Mapping[str, Account]) -> Iterator[str]:
    if len(named) > 1:
        heading, rows = differences(named)
        yield grid(heading, rows, f"Differences from {next(iter(named))}")


def _summaries(named: Mapping[str, Account]) -> str:
    each = [account.summary() for account in named.values()]
    if len(each) == 1:
        return table(each[0], "Summary")
    rows = [(label, *(one.get(label, "–") for one in each)) for label in each[0]]
    return grid(("", *named), rows, "Summary")


def _figures(named: Mapping[str, Account]) -> Iterator[str]:
    for what, caption in next(iter(named.values())).captions.items():
        pictures = []
        for name, account in named.items():
            try:
                drawn = account.plot(what)
            except ViewError:  # there is nothing of the kind on this robot
                continue
            words = caption + (f": {name}" if len(named) > 1 else "")
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


def _caption(name: str, named: Mapping[str, Account]) -> str:
    return name if len(named) > 1 else ""
