"""The results as tables for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table


def tables(parts: dict[str, Any]) -> Iterator[Table]:
    """Yield the tables of the parts that were measured."""
    for name, make in _MAKERS.items():
        if name in parts:
            yield from make(parts[name])


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, title_justify="left")
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="left" if place == 0 else "right")
    return table


def _number(value: Any, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _steps(part: dict[str, Any]) -> Iterator[Table]:
    table = _table(
        f"µs a step of {1e3 * part['step_s']:g} ms, best of many, in turn",
        "scenario",
        "heelstrike",
        "MuJoCo Euler",
        "times faster",
        "active contacts",
        "controller",
    )
    for row in part["rows"]:
        refused = row.get("invalid") or row.get("mujoco_invalid")
        active = [
            _number(row[check]["active_contacts"])
            for check in ("heelstrike_check", "mujoco_check")
            if check in row
        ]
        table.add_row(
            row["scenario"],
            _number(row.get("heelstrike_us")),
            f"does not count: {refused}" if refused else _number(row.get("mujoco_us")),
            _number(row.get("times_faster")),
            " / ".join(active),
            row["controller"],
        )
    yield table


def _precision(part: dict[str, Any]) -> Iterator[Table]:
    table = _table(
        f"{part['scenario']}, {part['duration_s']:g} s: error in joint positions, and computing",
        "method",
        "setting",
        "error (rad)",
        "computing (s)",
    )
    for point in part["points"]:
        table.add_row(
            point["series"],
            point["knob"],
            _number(point["error_rad"], 2),
            _number(point["seconds"]),
        )
    yield table
    goal = part["to_goal"]
    table = _table(f"least computing to {part['goal_rad']:g} rad", "side", "how", "computing (s)")
    for side in ("heelstrike", "mujoco"):
        if side in goal:
            point = goal[side]
            table.add_row(side, f"{point['series']}, {point['knob']}", _number(point["seconds"]))
        elif f"{side}_best" in goal:
            point = goal[f"{side}_best"]
            how = f"not reached; nearest is {point['error_rad']:.1e} rad: {point['series']}"
            table.add_row(side, f"{how}, {point['knob']}", _number(point["seconds"]))
    if "times_less" in goal:
        table.add_row("times less", "", _number(goal["times_less"]))
    yield table


def _threads(part: dict[str, Any]) -> Iterator[Table]:
    table = _table(
        f"{part['runs']} walks of {part['duration_s']:g} s, {part['steps']} steps, "
        f"{'identical' if part['same_for_all_threads'] else 'NOT THE SAME'} on all threads",
        "threads",
        "million steps a second",
        "speed-up",
        "MuJoCo",
        "its speed-up",
    )
    others = {row["threads"]: row for row in part.get("mujoco", [])}
    for row in part["rows"]:
        other = others.get(row["threads"], {})
        table.add_row(
            str(row["threads"]),
            _number(row["steps_per_s"] / 1e6),
            _number(row["speed_up"]),
            _number(other["steps_per_s"] / 1e6) if other else "–",
            _number(other.get("speed_up")),
        )
    yield table


def _scaling(part: dict[str, Any]) -> Iterator[Table]:
    for name, title in (
        ("joints", "µs a step of a chain of hinges"),
        ("contacts", "µs a step of a plank on many points"),
    ):
        table = _table(title, name, "heelstrike", "MuJoCo Euler")
        for row in part[name]:
            table.add_row(
                str(row["size"]), _number(row["heelstrike_us"]), _number(row.get("mujoco_us"))
            )
        slopes = part[f"{name}_slope"]
        table.add_row(
            "grows with the power",
            _number(slopes.get("heelstrike")),
            _number(slopes.get("mujoco")),
        )
        crossing = part[f"{name}_crossover"]
        table.add_row("peer is faster from", "nowhere" if crossing is None else str(crossing), "")
        yield table


def _footprint(part: dict[str, Any]) -> Iterator[Table]:
    table = _table("to begin, and to go on", "what", "measured")
    table.add_row("import heelstrike", f"{part['import_s']:.3f} s")
    table.add_row("import to first step, compiled before", f"{part['warm_first_step_s']:.2f} s")
    if "cold_first_step_s" in part:
        table.add_row(
            "import to first step, nothing compiled", f"{part['cold_first_step_s']:.1f} s"
        )
    for method, number in part["allocations_a_step"].items():
        table.add_row(f"allocations a step, {method}", f"{number:g}")
    memory = part["memory"]
    table.add_row(
        f"peak memory after {memory['short_s']:g} s of walking", f"{memory['before_MiB']:.0f} MiB"
    )
    table.add_row(
        f"after {memory['long_s']:g} s more, as many rows", f"{memory['after_MiB']:.0f} MiB"
    )
    yield table


def _endurance(part: dict[str, Any]) -> Iterator[Table]:
    table = _table(
        f"{part['steps']} steps of {part['runs']} walks under random pushes", "what", "worst"
    )
    for name, label in (
        ("failures", "contact problems without a solution"),
        ("unfinished", "runs that ended otherwise than walking or falling"),
        ("fell", "falls"),
        ("fallbacks", "problems that needed another solver"),
    ):
        table.add_row(label, str(part[name]))
    for name in ("complementarity", "cone", "non_penetration"):
        table.add_row(f"{name.replace('_', '-')} residual", f"{part[name]:.1e}")
    table.add_row("penetration", f"{part['penetration_m']:.1e} m")
    share = part["shortcuts"] / max(part["solves"], 1)
    table.add_row("answered by the modes of the step before, verified", f"{100 * share:.2f} %")
    yield table


_MAKERS = {
    "steps": _steps,
    "precision": _precision,
    "threads": _threads,
    "scaling": _scaling,
    "footprint": _footprint,
    "endurance": _endurance,
}
