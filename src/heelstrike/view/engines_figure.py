"""Error over computing time of engines: what a lecturer would show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from heelstrike.view.style import INK, label_powers, new_figure, styled

MARKS = "osD^v<>Phd*Xp"
COLORS = 10
"""Colours there are; an engine beyond them shares one, and its line is dashed."""
OURS = "heelstrike"
FAINT = 0.35
"""Opacity of the lines of defaults, where there are better settings."""
SMALLEST_DRAWN = 1e-12
"""Smaller errors are drawn here: they are rounding."""

PANELS: Mapping[str, tuple[str, str]] = {
    "walking": ("walking", "distance from the reference (m, rad)"),
    "landing": ("landing: a cube on its corner", "error of its rate (rad/s)"),
    "rest": ("rest: a cube on a slope", "creep in 1 s (m)"),
}
"""What panels are about: their titles, and the labels of their errors."""


def draw_engines(
    walks: Sequence[tuple[str, str, float, Mapping[str, Any]]],
    scenes: Sequence[Mapping[str, Any]] = (),
) -> Figure:
    """Draw the errors of engines over the computing time that they took.

    Parameters
    ----------
    walks : sequence of (str, str, float, mapping)
        Engine, settings, step (s) and figures: ``position``, ``computing_s``, ``walks``.
    scenes : sequence of mapping
        Scenes at several steps, as of ``SceneTable.to_dict()["at_steps"]``.

    Returns
    -------
    Figure
        Matplotlib's figure: a panel for the walk and for each scene, a line an engine and settings,
        a mark a step. Marks of walks that fell are hollow; defaults are faint where there are
        better settings.
    """
    lines = _lines(walks, scenes)
    names = list(dict.fromkeys(name for name, _, _, _ in lines))
    names.sort(key=lambda name: not name.startswith(OURS))  # ours first, the others as they come
    panels = [panel for panel in PANELS if any(each[1] == panel for each in lines)]
    with styled():
        figure = new_figure(4.2 * len(panels) + 2.4 if len(panels) > 1 else 9.0, 5.5)
        columns = figure.subplots(1, max(1, len(panels)), squeeze=False)[0]
        for axes, panel in zip(columns, panels, strict=False):
            for name, where, opacity, points in lines:
                if where == panel:
                    _draw(axes, _look(name, names), opacity, points)
            axes.set_xscale("log")
            axes.set_yscale("log")
            label_powers(axes.xaxis)
            label_powers(axes.yaxis)
            title, error = PANELS[panel]
            axes.set_title(title, loc="left", fontsize=11)
            axes.set_xlabel("computing time (s)")
            axes.set_ylabel(error)
        handles = [
            Line2D([], [], marker=mark, color=color, linestyle=style, label=name)
            for name in names
            for color, mark, style in [_look(name, names)]
        ]
        columns[-1].legend(
            handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8
        )
        figure.suptitle(
            "a mark a step size; faint: default settings where better ones are known; hollow: it "
            "falls; at 10⁻¹²: rounding", x=0.01, ha="left", fontsize=10,
        )  # fmt: skip
    return figure


def _lines(
    walks: Sequence[tuple[str, str, float, Mapping[str, Any]]],
    scenes: Sequence[Mapping[str, Any]],
) -> list[tuple[str, str, float, list[tuple[float, float, bool]]]]:
    """Return engine, panel, opacity, and computing time, error and whether it walked, by steps."""
    found: dict[tuple[str, str, str], dict[float, tuple[float, float, bool]]] = {}
    for name, settings, step, f in walks:
        if f["position"] > 0.0:
            own = found.setdefault((_title(name), "walking", settings), {})
            own[step] = f["computing_s"], f["position"], bool(f["walks"])
    for row in scenes:
        own = found.setdefault((_title(row["title"]), row["shows"], "defaults"), {})
        own[row["step_s"]] = row["computing_s"], max(row["error"], SMALLEST_DRAWN), True
    return [
        (name, panel,
         FAINT if settings == "defaults" and (name, panel, "best") in found else 1.0,
         [points[step] for step in sorted(points)])
        for (name, panel, settings), points in found.items()
    ]  # fmt: skip


def _title(name: str) -> str:
    """Return what the legend calls an engine: our rows of walks are by time stepping."""
    return f"{OURS}, time stepping" if name == OURS else name


def _look(name: str, names: Sequence[str]) -> tuple[str, str, Any]:
    """Return colour, mark and style of the line of an engine."""
    if name.startswith(OURS):
        own = [each for each in names if each.startswith(OURS)]
        return INK, MARKS[own.index(name)], ("-", "--", ":")[own.index(name) % 3]
    others = [each for each in names if not each.startswith(OURS)]
    place = others.index(name)
    return f"C{place % COLORS}", MARKS[(place + 3) % len(MARKS)], "-" if place < COLORS else "--"


def _draw(
    axes: Any, look: tuple[str, str, Any], opacity: float, points: list[tuple[float, float, bool]]
) -> None:
    color, mark, style = look
    times, errors = [t for t, *_ in points], [e for _, e, _ in points]
    axes.plot(times, errors, style, color=color, lw=1.0, alpha=opacity)
    for t, e, walked in points:
        axes.plot(t, e, mark, color=color, alpha=opacity, ms=5.0, mfc=color if walked else "none")
