"""The results as figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.view.style import (
    BLUE,
    BOUND,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    label_powers,
    new_figure,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS, THEIRS = BLUE, VERMILION
COLORS = {"mujoco": VERMILION, "drake": ORANGE, "bullet": GREY, "dart": PURPLE}
ENGINE_MARKS = {"mujoco": "s", "drake": "D", "bullet": "v", "dart": "^"}


def draw(parts: dict[str, Any]) -> dict[str, Figure]:
    """Figures of the parts that were measured, by name."""
    with styled():
        return {
            f"benchmark_{name}": make(parts[name])
            for name, make in _MAKERS.items()
            if name in parts
        }


def _steps(part: dict[str, Any]) -> Figure:
    rows = [row for row in part["rows"] if "heelstrike_us" in row]
    sides = {"heelstrike": "heelstrike", **part["engines"]}
    figure = new_figure(7.0, 1.1 + (0.26 + 0.18 * len(sides)) * len(rows))
    axes = figure.add_subplot()
    place = np.arange(len(rows))[::-1]
    height = 0.8 / len(sides)
    for i, (name, label) in enumerate(sides.items()):
        y = place + 0.4 - (i + 0.5) * height
        theirs = [row.get(f"{name}_us", np.nan) for row in rows]
        axes.barh(y, theirs, 0.9 * height, label=label, **_bar(name))
        for at, row in zip(y, rows, strict=True):
            if name in row.get("times_faster", {}):
                text = f"{row['times_faster'][name]:.3g} ×"
                where = (row[f"{name}_us"], at)
            elif name != "heelstrike":
                text, where = "–", (row["heelstrike_us"], at)
            else:
                continue
            axes.annotate(
                text, where, xytext=(4, 0), textcoords="offset points", va="center", color=INK
            )
    axes.set_xscale("log")
    label_powers(axes.xaxis)
    axes.margins(x=0.15)
    axes.set_xlim(0.1, max(10.0, axes.get_xlim()[1]))
    axes.set_yticks(place, [row["scenario"] for row in rows])
    axes.grid(False, axis="y")
    axes.set_xlabel("time to compute a step of 1 ms (µs)")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=min(3, len(sides)))
    return figure


def _bar(name: str) -> dict[str, Any]:
    if name == "heelstrike":
        return {"color": OURS}
    return {"color": COLORS[name], "hatch": "///", "edgecolor": "white"}


# Ours are the cold colours.
_MARKS = (
    (BLUE, "o", "-"),
    (GREEN, "s", "-"),
    (SKY, "D", "-"),
    (SKY, "v", "-"),
    (BLUE, "^", "-"),
)
_PEER_MARKS = ("o", "s", "D", "v", "^", "P")


def _precision(part: dict[str, Any]) -> Figure:
    figure = new_figure(8.0, 5.0)
    axes = figure.add_subplot()
    names = list(dict.fromkeys(point["series"] for point in part["points"]))
    own, others = 0, 0
    for name in names:
        points = [p for p in part["points"] if p["series"] == name]
        seconds, error = zip(*((p["seconds"], p["error_rad"]) for p in points), strict=True)
        if points[0]["side"] != "heelstrike":
            color, mark, line = COLORS[points[0]["side"]], _PEER_MARKS[others % 6], "--"
            others += 1
        else:
            color, mark, line = _MARKS[own % 5]
            own += 1
        axes.loglog(seconds, error, color=color, marker=mark, linestyle=line, ms=5, label=name)
    for axis in (axes.xaxis, axes.yaxis):
        label_powers(axis)
    axes.axhline(part["goal_rad"], **BOUND)
    axes.annotate(
        f"{part['goal_rad']:g} rad",
        (1.0, part["goal_rad"]),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 3),
        textcoords="offset points",
        ha="right",
    )
    axes.set_xlabel(f"computing time for {part['duration_s']:g} s of walking (s)")
    axes.set_ylabel("largest error of a joint's last position (rad)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _threads(part: dict[str, Any]) -> Figure:
    figure = new_figure(5.0, 3.6)
    axes = figure.add_subplot()
    for rows, label, color, mark in (
        (part["rows"], "heelstrike", OURS, "o"),
        (part.get("mujoco", []), "MuJoCo", THEIRS, "s"),
    ):
        if rows:
            number = [row["threads"] for row in rows]
            rate = [row["steps_per_s"] / 1e6 for row in rows]
            axes.plot(number, rate, color=color, marker=mark, label=label)
            axes.plot(
                number, [rate[0] * n / number[0] for n in number], color=color, ls=":", lw=1.0
            )
    axes.set_xticks([row["threads"] for row in part["rows"]])
    axes.set_ylim(0.0)
    axes.set_xlabel("threads (dotted: in proportion)")
    axes.set_ylabel("million steps of 1 ms a second")
    axes.legend()
    return figure


def _scaling(part: dict[str, Any]) -> Figure:
    figure = new_figure(8.0, 3.8)
    left, right = figure.subplots(1, 2)
    for axes, name, label in (
        (left, "joints", "hinges of a chain without contact"),
        (right, "contacts", "contact points under a plank at rest"),
    ):
        size = np.array([row["size"] for row in part[name]])
        for side, engine in {"heelstrike": "heelstrike", **part["engines"]}.items():
            cost = [row.get(f"{side}_us", np.nan) for row in part[name]]
            color, mark = COLORS.get(side, OURS), ENGINE_MARKS.get(side, "o")
            axes.plot(size, cost, color=color, marker=mark, label=engine)
        if name == "joints":
            axes.set_xscale("log")
        else:
            axes.set_xscale("symlog", linthresh=1.0)
        axes.set_yscale("log")
        label_powers(axes.yaxis)
        axes.set_xticks(size, [str(n) for n in size])
        axes.minorticks_off()
        axes.set_xlabel(label)
        axes.set_ylabel("time to compute a step (µs)")
        axes.legend(loc="upper left")
    return figure


_MAKERS = {
    "steps": _steps,
    "precision": _precision,
    "threads": _threads,
    "scaling": _scaling,
}
