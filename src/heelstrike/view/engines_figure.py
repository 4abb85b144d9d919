"""Error over computing time of engines: what a lecturer would show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

MARKS = "osD^v<>Phd*Xp"


def draw_engines(walks: Sequence[tuple[str, str, float, Mapping[str, Any]]]) -> Figure:
    """Draw the error of walks over the computing time that they took.

    Parameters
    ----------
    walks : sequence of (str, str, float, mapping)
        Engine, settings, step (s) and figures: ``position``, ``computing_s``, ``walks``.

    Returns
    -------
    Figure
        Matplotlib's figure, with a line an engine and settings, a mark a step; marks of walks that
        fell are hollow.
    """
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    names = list(dict.fromkeys(name for name, *_ in walks))
    for name, settings in dict.fromkeys((name, settings) for name, settings, *_ in walks):
        place = names.index(name)
        own = sorted(
            (f["computing_s"], f["position"], f["walks"])
            for n, s, _, f in walks
            if (n, s) == (name, settings) and f["position"] > 0.0
        )
        if not own:
            continue
        color = f"C{place % 10}"
        style = ":" if settings == "defaults" and name != "heelstrike" else "-"
        mark = MARKS[place % len(MARKS)]
        label = name if name == "heelstrike" else f"{name}, {settings}"
        axes.plot([t for t, *_ in own], [e for _, e, _ in own], style, color=color, lw=1.0)
        for t, e, walked in own:
            axes.plot(t, e, mark, color=color, mfc=color if walked else "none", ms=6.0, label=label)
            label = "_"
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("computing time of the walk (s)")
    axes.set_ylabel("distance from the truth, all coordinates (m, rad; root mean square)")
    axes.legend(fontsize=7, ncols=2)
    return figure
