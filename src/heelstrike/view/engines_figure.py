"""Error over computing time of engines: what a lecturer would show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from heelstrike.view.style import INK, label_powers, new_figure, styled

MARKS = "osD^v<>Phd*Xp"
OURS = "heelstrike"
TITLE = "the same walk in every engine: faint at defaults, hollow if it falls"
FAINT = 0.35
"""Opacity of the lines of defaults, where there are better settings."""


def draw_engines(walks: Sequence[tuple[str, str, float, Mapping[str, Any]]]) -> Figure:
    """Draw the error of walks over the computing time that they took.

    Parameters
    ----------
    walks : sequence of (str, str, float, mapping)
        Engine, settings, step (s) and figures: ``position``, ``computing_s``, ``walks``.

    Returns
    -------
    Figure
        Matplotlib's figure, with a line an engine and settings, a mark a step. Marks of walks that
        fell are hollow; defaults are faint where there are better settings.
    """
    names = list(dict.fromkeys(name for name, *_ in walks))
    series = list(dict.fromkeys((name, settings) for name, settings, *_ in walks))
    with styled():
        figure = new_figure(9.0, 5.5)
        axes = figure.subplots()
        for name, settings in series:
            place = names.index(name)
            color = INK if name == OURS else f"C{place % 10}"
            best = settings == "best" or (name, "best") not in series
            mine = [
                (step, f)
                for n, s, step, f in walks
                if (n, s) == (name, settings) and f["position"] > 0.0
            ]
            found = sorted(mine, key=lambda each: each[0])
            own = [(f["computing_s"], f["position"], f["walks"]) for _, f in found]
            opacity = 1.0 if best else FAINT
            times, errors = [t for t, *_ in own], [e for _, e, _ in own]
            axes.plot(times, errors, "-" if best else ":", color=color, lw=1.0, alpha=opacity)
            for t, e, walked in own:
                axes.plot(
                    t, e, MARKS[place % len(MARKS)], color=color, alpha=opacity, ms=6.0,
                    mfc=color if walked else "none",
                )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        label_powers(axes.xaxis)
        label_powers(axes.yaxis)
        axes.set_xlabel("computing time of the walk (s)")
        axes.set_ylabel("distance from the truth (m, rad)")
        handles = [
            Line2D(
                [], [], marker=MARKS[i % len(MARKS)], label=name,
                color=INK if name == OURS else f"C{i % 10}",
            )
            for i, name in enumerate(names)
        ]  # fmt: skip
        axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8)
        figure.suptitle(TITLE, x=0.01, ha="left", fontsize=12)
    return figure
