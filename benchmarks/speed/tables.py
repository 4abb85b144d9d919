"""The results as tables for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from table import Table, number

from heelstrike.experiments.engines.packages import PACKAGES

TITLES = {"heelstrike": "heelstrike", **{name: each.title for name, each in PACKAGES.items()}}


def tables(parts: dict[str, Any]) -> Iterator[Table]:
    """Yield the tables of the parts that were measured."""
    for name, make in _MAKERS.items():
        if name in parts:
            yield from make(parts[name])


def _steps(part: dict[str, Any]) -> Iterator[Table]:
    engines: dict[str, str] = part["engines"]
    rows = part["rows"]
    body = []
    for row in rows:
        cells = [number(row.get("heelstrike_us"))]
        for name in engines:
            times = row.get("times_faster", {}).get(name)
            beside = "" if times is None else f" ({number(times)} ×)"
            cells.append(number(row.get(f"{name}_us")) + beside)
        setup = number(row.get("heelstrike_setup_us"))
        body.append([row["scenario"], *cells, setup, row["controller"]])
    yield Table(
        f"µs a step of {1e3 * part['step_s']:g} ms, best of many (in brackets: multiple of "
        "heelstrike's time)",
        [
            "scenario",
            "heelstrike",
            *engines.values(),
            "heelstrike: set-up of a run (µs)",
            "control",
        ],
        body,
    )
    motions = ("standing", "walking", "falling", "lying")
    yield Table(
        "multiple of heelstrike's time, least to most of the robots",
        ["", *motions],
        [
            [title, *(_range(rows, name, each) for each in motions)]
            for name, title in engines.items()
        ],
    )
    sides = {"heelstrike": "heelstrike", **engines}
    yield Table(
        "active contacts, and the share of the weight that they carry",
        ["scenario", *sides.values()],
        [[row["scenario"], *(_validity(row, name) for name in sides)] for row in rows],
    )
    if any("pinocchio_part_us" in row or "pinocchio_part_invalid" in row for row in rows):
        theirs = (
            row.get("pinocchio_part_invalid") or number(row.get("pinocchio_part_us"))
            for row in rows
        )
        yield Table(
            "forward dynamics alone (no contacts, control, integration): a part of a step, in µs",
            ["scenario", "Pinocchio, articulated bodies", "a whole step of heelstrike"],
            [
                [row["scenario"], its, number(row.get("heelstrike_us"))]
                for row, its in zip(rows, theirs, strict=True)
            ],
        )


def _range(rows: list[dict[str, Any]], engine: str, motion: str) -> str:
    """Least and largest of how many times as long an engine takes in scenarios of a motion."""
    found = [row.get("times_faster", {}).get(engine) for row in rows if motion in row["scenario"]]
    times = sorted({number(value) for value in found if value is not None}, key=float)
    return "–".join(times[:: len(times) - 1] if len(times) > 1 else times) or "not measured"


def _stops(part: dict[str, Any]) -> Iterator[Table]:
    yield Table(
        f"µs a step of {1e3 * part['step_s']:g} ms, best of many",
        ["scenario", "µs", "multiple of standing"],
        [[row["scenario"], number(row["us"]), number(row["times"])] for row in part["rows"]],
    )


def _validity(row: dict[str, Any], name: str) -> str:
    """What makes a run valid, or why it does not count."""
    refused = row.get("invalid") if name == "heelstrike" else row.get(f"{name}_invalid")
    check = row.get(f"{name}_check")
    if refused or check is None:
        return f"does not count: {refused}" if refused else "–"
    carried = check.get("weight_carried")
    weight = "" if carried is None else f", {carried:.4f}"
    return number(check["active_contacts"]) + weight


def _precision(part: dict[str, Any]) -> Iterator[Table]:
    body = [
        [
            point["series"],
            point["knob"],
            number(point["error_rad"], 2),
            number(point["seconds"]),
        ]
        for point in part["points"]
    ]
    body += [[each["series"], each["knob"], each["reason"], "–"] for each in part["failures"]]
    yield Table(
        f"{part['scenario']}, {part['duration_s']:g} s: error in joint positions, and computing",
        ["method", "setting", "error (rad)", "computing time (s)"],
        body,
    )
    goal = part["to_goal"]
    body = []
    for side, title in TITLES.items():
        point = goal.get(side) or goal.get(f"{side}_best")
        if point is None:
            continue
        how = f"{point['series']}, {point['knob']}"
        if side not in goal:
            how = f"not reached; nearest is {point['error_rad']:.1e} rad: {how}"
        times = goal.get("times_less", {}).get(side)
        body.append([title, how, number(point["seconds"]), "" if times is None else number(times)])
    yield Table(
        f"least computing time for an error of {part['goal_rad']:g} rad",
        ["engine", "method", "computing time (s)", "multiple of heelstrike's"],
        body,
    )


def _threads(part: dict[str, Any]) -> Iterator[Table]:
    others = {row["threads"]: row for row in part.get("mujoco", [])}
    body = []
    for row in part["rows"]:
        other = others.get(row["threads"], {})
        body.append(
            [
                str(row["threads"]),
                number(row["steps_per_s"] / 1e6),
                number(row["speed_up"]),
                number(other["steps_per_s"] / 1e6) if other else "–",
                number(other.get("speed_up")),
            ]
        )
    yield Table(
        f"{part['runs']} walks of {part['duration_s']:g} s, {part['steps']} steps, "
        f"{'identical' if part['same_for_all_threads'] else 'NOT THE SAME'} on all threads",
        [
            "threads",
            "million steps a second",
            "speed-up",
            "MuJoCo: million steps a second",
            "speed-up of MuJoCo",
        ],
        body,
    )


def _scaling(part: dict[str, Any]) -> Iterator[Table]:
    engines: dict[str, str] = part["engines"]
    for name, title in (
        ("joints", "µs a step of a chain of hinges"),
        ("contacts", "µs a step of a plank on many points"),
    ):
        sides = {"heelstrike": "heelstrike", **engines}
        if any("pinocchio_part_us" in row for row in part[name]):
            sides["pinocchio_part"] = "Pinocchio, forward dynamics alone"
        body = []
        for row in part[name]:
            cells = [row.get(f"{side}_invalid") or number(row.get(f"{side}_us")) for side in sides]
            body.append([str(row["size"]), *cells])
        slopes, crossing = part[f"{name}_slope"], part[f"{name}_crossover"]
        body.append(
            ["cost grows as size to the power", *(number(slopes.get(side)) for side in sides)]
        )
        found = [
            "" if side not in engines else str(crossing[side] or "never faster") for side in sides
        ]
        body.append(["faster than heelstrike from size", *found])
        yield Table(title, [name, *sides.values()], body)


def _footprint(part: dict[str, Any]) -> Iterator[Table]:
    body = [
        ["import heelstrike", f"{part['import_s']:.3f} s"],
        ["import to first step, code already compiled", f"{part['warm_first_step_s']:.2f} s"],
    ]
    if "cold_first_step_s" in part:
        cold = f"{part['cold_first_step_s']:.1f} s"
        body.append(["import to first step, nothing compiled", cold])
    for method, count in part["allocations_a_step"].items():
        body.append([f"allocations a step, {method}", f"{count:g}"])
    memory = part["memory"]
    if memory["before_MiB"] is not None:
        before, after = (f"{memory[f'{when}_MiB']:.0f} MiB" for when in ("before", "after"))
        body.append([f"peak memory after {memory['short_s']:g} s of walking", before])
        body.append(
            [
                f"peak memory after {memory['long_s']:g} s more, recorded "
                f"{memory['long_s'] / memory['short_s']:g} times as sparsely",
                after,
            ]
        )
    yield Table("start-up, allocations and memory", ["what", "measured"], body)


def _endurance(part: dict[str, Any]) -> Iterator[Table]:
    body = [
        [label, str(part[name])]
        for name, label in (
            ("failures", "contact problems without a solution"),
            ("unfinished", "runs that ended otherwise than walking or falling"),
            ("fell", "falls"),
            ("fallbacks", "problems that needed a solver besides Lemke's method"),
        )
    ]
    for name in ("complementarity", "cone", "non_penetration"):
        body.append([f"{name.replace('_', '-')} residual", f"{part[name]:.1e}"])
    body.append(["penetration", f"{part['penetration_m']:.1e} m"])
    share = part["shortcuts"] / max(part["solves"], 1)
    body.append(["solved with the contact modes of the step before", f"{100 * share:.2f} %"])
    title = f"{part['steps']} steps of {part['runs']} walks under random pushes"
    yield Table(title, ["what", "number or worst value"], body)


def _laws(part: dict[str, Any]) -> Iterator[Table]:
    least = part["a user's"]
    body = [[name, f"{each:.2f}", f"{each / least:.2f}"] for name, each in part.items()]
    title = "A step of 1 ms of bravo7 walking under computed torque, by who runs the law"
    yield Table(title, ["law", "µs", "multiple of a user's"], body)


_MAKERS = {
    "steps": _steps,
    "stops": _stops,
    "precision": _precision,
    "threads": _threads,
    "scaling": _scaling,
    "footprint": _footprint,
    "endurance": _endurance,
    "laws": _laws,
}
