"""The results as tables for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from heelstrike.experiments.benchmark.engines import PACKAGES

TITLES = {name: package.title for name, package in PACKAGES.items()}


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
    engines: dict[str, str] = part["engines"]
    rows = part["rows"]
    table = _table(
        f"µs a step of {1e3 * part['step_s']:g} ms, best of many, in turn (times as long as ours)",
        "scenario",
        "heelstrike",
        *engines.values(),
        "control",
    )
    for row in rows:
        cells = [_number(row.get("heelstrike_us"))]
        for name in engines:
            times = row.get("times_faster", {}).get(name)
            beside = "" if times is None else f" ({_number(times)} ×)"
            cells.append(_number(row.get(f"{name}_us")) + beside)
        table.add_row(row["scenario"], *cells, row["controller"])
    yield table
    yield _validity(part)
    if any("pinocchio_part_us" in row or "pinocchio_part_invalid" in row for row in rows):
        yield _parts(rows)


def _validity(part: dict[str, Any]) -> Table:
    """What makes the runs valid, or why they do not count."""
    engines: dict[str, str] = {"heelstrike": "heelstrike", **part["engines"]}
    table = _table("active contacts, and the share of the weight that they carry", "scenario")
    for label in engines.values():
        table.add_column(label, justify="right")
    for row in part["rows"]:
        cells = []
        for name in engines:
            refused = row.get("invalid") if name == "heelstrike" else row.get(f"{name}_invalid")
            check = row.get(f"{name}_check")
            if refused or check is None:
                cells.append(f"does not count: {refused}" if refused else "–")
            else:
                carried = check.get("weight_carried")
                weight = "" if carried is None else f", {carried:.4f}"
                cells.append(_number(check["active_contacts"]) + weight)
        table.add_row(row["scenario"], *cells)
    return table


def _parts(rows: list[dict[str, Any]]) -> Table:
    """What does not make a step, beside whole steps."""
    table = _table(
        "forward dynamics alone (no contacts, control, integration): a part of a step, in µs",
        "scenario",
        "Pinocchio, articulated bodies",
        "a whole step of heelstrike",
    )
    for row in rows:
        theirs = row.get("pinocchio_part_invalid") or _number(row.get("pinocchio_part_us"))
        table.add_row(row["scenario"], theirs, _number(row.get("heelstrike_us")))
    return table


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
    for failure in part["failures"]:
        table.add_row(failure["series"], failure["knob"], failure["reason"], "–")
    yield table
    goal = part["to_goal"]
    table = _table(
        f"least computing to {part['goal_rad']:g} rad",
        "side",
        "how",
        "computing (s)",
        "times as long as ours",
    )
    for side, title in {"heelstrike": "heelstrike", **TITLES}.items():
        point = goal.get(side) or goal.get(f"{side}_best")
        if point is None:
            continue
        how = f"{point['series']}, {point['knob']}"
        if side not in goal:
            how = f"not reached; nearest is {point['error_rad']:.1e} rad: {how}"
        times = goal.get("times_less", {}).get(side)
        table.add_row(
            title, how, _number(point["seconds"]), "" if times is None else _number(times)
        )
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
    engines: dict[str, str] = part["engines"]
    for name, title in (
        ("joints", "µs a step of a chain of hinges"),
        ("contacts", "µs a step of a plank on many points"),
    ):
        sides = {"heelstrike": "heelstrike", **engines}
        if any("pinocchio_part_us" in row for row in part[name]):
            sides["pinocchio_part"] = "part of a step: Pinocchio ABA"
        table = _table(title, name, *sides.values())
        for row in part[name]:
            cells = [row.get(f"{side}_invalid") or _number(row.get(f"{side}_us")) for side in sides]
            table.add_row(str(row["size"]), *cells)
        slopes, crossing = part[f"{name}_slope"], part[f"{name}_crossover"]
        table.add_row("grows with the power", *(_number(slopes.get(side)) for side in sides))
        found = ["" if side not in engines else str(crossing[side] or "nowhere") for side in sides]
        table.add_row("faster than heelstrike from", *found)
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
    if memory["before_MiB"] is None:
        yield table
        return
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
