"""The page of the comparison: Table 1 of the paper, renewed, and what was measured."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.comparison import CONTROL_PERIOD
from heelstrike.experiments.engine_comparison.compass_table import HEADINGS as COMPASS
from heelstrike.experiments.engine_comparison.compass_table import STEPS as COMPASS_STEPS
from heelstrike.experiments.engine_comparison.compass_table import compass_cells
from heelstrike.experiments.engine_comparison.entries import ABSENT, ENTRIES
from heelstrike.experiments.engine_comparison.facts import FACTS
from heelstrike.experiments.engine_comparison.pushes import DIRECTIONS, UNPUSHED
from heelstrike.experiments.engine_comparison.scene_table import why_not_at_steps
from heelstrike.experiments.engine_comparison.settings import (
    BEST,
    best_settings,
    found_for_others,
    has_best,
)
from heelstrike.experiments.engine_comparison.tables import BY_ITSELF, WALKING, short
from heelstrike.experiments.engine_comparison.whole import taken

SHOWN = 1e-3
"""Step (s) whose walks the page shows in full."""

FELL = "†"
"""Behind the peak force of a walk that ended early."""

Rows = Sequence[Sequence[str]]


def engines_page(folder: Path, figure: str) -> str:
    """Write the page of what lies in a folder.

    Parameters
    ----------
    folder : Path
        Where ``heelstrike compare --engines`` has left ``engines-LAW.json`` and ``scenes.json``.
        Files of quick comparisons, whose names end with ``-quick``, are left out.
    figure : str
        Link to the figure.

    Returns
    -------
    str
        Markdown.

    Raises
    ------
    SimulationError
        If it has not.
    """
    walks = {
        file.stem.removeprefix("engines-").replace("-", " "): json.loads(
            file.read_text(encoding="utf-8")
        )
        for file in _files(folder, "engines")
    }
    scenes_file = folder / "scenes.json"
    first = "heelstrike compare --engines all --scenes comes first"
    if not walks or not scenes_file.exists():
        raise SimulationError(f"there is nothing to write a page of in {folder}: {first}")
    scenes = json.loads(scenes_file.read_text(encoding="utf-8"))
    if lacks := [part for part in ("compass", "guards") if part not in scenes]:
        raise SimulationError(f"{scenes_file} is from before: it lacks {lacks[0]!r}. {first}")
    parts = [
        _INTRODUCTION,
        _taken(folder / "whole.json"),
        _in_short(walks),
        _table_1(walks, scenes),
        _best(walks),
        *(_walks(law, found) for law, found in walks.items()),
        f"![Error over computing time]({figure})\n",
        _peaks(walks),
        *(_pushes(file) for file in _files(folder, "pushes")),
        _scenes(scenes),
        _compass(scenes["compass"]),
        _guards(scenes["guards"]),
    ]
    return "\n".join(parts)


def _files(folder: Path, kind: str) -> list[Path]:
    """Files of a kind in a folder, but for those of quick comparisons."""
    found = sorted(folder.glob(f"{kind}-*.json"))
    return [file for file in found if not file.stem.endswith("-quick")]


_INTRODUCTION = """# Other engines

Table 1 of [the paper](paper.md) compares simulators by their own descriptions. Here the same robot
walks the same gait under the same controller in each engine. The reference is an event-driven run
of heelstrike at a tolerance of 1e-9.

- Each engine gets the robot link by link, with heelstrike's contact points. It runs in its own
  process, takes torques, and returns its state and contact forces.
- heelstrike's compiled controller gets this state and these forces every 2 ms, or as often as the
  table says. ComputedTorque follows the gait without balancing, so errors of the contact can make
  the robot fall. FootstepFeedback corrects them by its footholds.
- Times cover the engine's steps and their Python calls, without the controller; only heelstrike's
  include it. Other work ran at the same time: ignore differences below a factor of two.

`heelstrike compare bravo7 --engines all --whole` makes the tables; with `--page docs/engines.md` it
writes this page, and `--fine` adds shorter steps. It keeps each row as it comes and goes on where
it was interrupted. Use `--engines mujoco` for one engine, `--quick` for a trial, and `--films` to
see the walks that fall.

The columns of the walks follow. Differences are from the reference.

- *walks*: whether the robot takes all steps and stays up; if not, how many steps it took. Stumbles
  count as steps, so there may be more;
- *tracking*: error of the joints from the gait, rms;
- *error*: difference of all coordinates over the walk, rms; large also if the robot is late or
  displaced;
- *touchdown*: largest difference of a touchdown's time. A robot that is once late stays late;
- *impulse*: mean difference of the touchdown impulses;
- *ZMP*: difference of the stance foot's zero moment point, rms;
- *slip*, *depth*: longest slide of a loaded contact point; deepest penetration;
- *energy*: largest energy that appears or disappears without work, computed from the contact
  forces, averaged over each step; engines that do not report all of them have a dash;
- *noise*: rms difference of the ground force in single support from its running mean over 10 ms, in
  percent of the weight;
- *peak*: largest force on a foot, as a mean over a step, in multiples of the weight;
- *step*: computing time of a step.
"""


def _taken(file: Path) -> str:
    """Say by which command the page was made, and how long that took."""
    found = taken(file)
    if not found:
        return ""
    sittings = found["sittings"]
    days = list(dict.fromkeys(each["date"] for each in sittings))
    wall, processor = (sum(each[k] for each in sittings) / 60.0 for k in ("wall_s", "processor_s"))
    return (
        f"`{found['command']} --page docs/engines.md` made all of it on {' and '.join(days)}. It "
        f"took {wall:.0f} minutes on {found['processors']} processors that others used, too, and "
        f"{processor:.0f} minutes of processor time.\n"
    )


def _table(headings: Sequence[str], rows: Rows) -> str:
    lines = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _title(name: str) -> str:
    return "heelstrike" if name == "heelstrike" else ENTRIES[name].title


def _in_short(walks: Mapping[str, Any]) -> str:
    lines = []
    for law, found in walks.items():
        shown = _shown(found)
        able = dict.fromkeys(
            _title(row["engine"])
            for row in found["rows"]
            if row["step_s"] == shown and row["settings"] == "defaults"
            and row["figures"] and row["figures"]["walks"]
        )  # fmt: skip
        lines.append(
            f"- {law}, steps of {1e3 * shown:g} ms: {', '.join(able) or 'none'} "
            f"take all {found['steps']} steps."
        )
    return "## In short\n\nAt their default settings:\n\n" + "\n".join(lines) + "\n"


def _shown(found: Mapping[str, Any]) -> float:
    """Step (s) whose walks are shown in full."""
    sizes = {row["step_s"] for row in found["rows"]}
    return SHOWN if SHOWN in sizes else max(sizes)


def _table_1(walks: Mapping[str, Any], scenes: Mapping[str, Any]) -> str:
    versions = {name: each for walk in walks.values() for name, each in walk["versions"].items()}
    theirs = [
        [
            _title(name), "" if name == "heelstrike" else versions.get(ENTRIES[name].package, ""),
            f.languages, f.engine, f.graphics, f.licence, f.systems, f.open_source,
            f.documentation,
        ]
        for name, f in FACTS.items()
    ]  # fmt: skip
    read: dict[str, list[str]] = {}
    for name, f in FACTS.items():
        read.setdefault(f.read, []).append(_title(name))
    ours = []
    for name, f in FACTS.items():
        row = [
            _title(name),
            f.contact,
            f.friction,
            f.restitution,
            f.certificate,
            _creep(scenes, name),
        ]
        for found in walks.values():
            row += [_walks_at(found, name, which) for which in _settings(found)]
        ours.append(row)
    headings = ["simulator", "contact", "Coulomb's law", "restitution", "certificate", "creep mm/s"]
    for law, found in walks.items():
        headings += [f"{law}, {which}" for which in _settings(found)]
    sizes = [row["step_s"] for found in walks.values() for row in found["rows"]]
    return (
        f"## Table 1, renewed\n\nOf {date.today().isoformat()}, in the paper's columns:\n\n"
        + _table(
            ["simulator", "version", "languages", "engine", "graphics", "licence", "systems",
             "open source", "documented"],
            theirs,
        )
        + "\nNot compared:\n\n"
        + _table(["simulator", "why"], list(ABSENT.items()))
        + "\nWhere licences and systems were read:\n\n"
        + "\n".join(f"- {', '.join(names)}: {where}." for where, names in read.items())
        + "\n\nheelstrike's columns, added to the paper's, follow. Creep is the speed of a cube on "
        "a slope 0.05 rad below its angle of friction, at defaults and a step of 1 ms; by "
        "Coulomb's law it is zero. The last columns have the step sizes, in ms, at which bravo7 "
        f"takes all its steps under a controller (none above {1e3 * max(sizes):g} or below "
        f"{1e3 * min(sizes):g} was tried); *as defaults* means that the search found no better "
        "settings.\n\n"
        + _table(headings, ours)
    )  # fmt: skip


def _settings(found: Mapping[str, Any]) -> list[str]:
    """Settings that a comparison has rows of."""
    return list(dict.fromkeys(row["settings"] for row in found["rows"]))


def _creep(scenes: Mapping[str, Any], name: str) -> str:
    engine = "event-driven" if name == "heelstrike" else name
    for row in scenes["rows"]:
        if row["engine"] == engine and "below" in row["scene"] and row["error"] is not None:
            return short(abs(1e3 * row["error"]))  # of a scene of one second
    return "–"


def _walks_at(found: Mapping[str, Any], name: str, which: str) -> str:
    rows = [r for r in found["rows"] if r["engine"] == name and r["settings"] == which]
    if not rows:
        return "as defaults" if which == BEST and not has_best(name) else "–"
    told = [f"{1e3 * r['step_s']:g}" for r in rows if r["figures"] and r["figures"]["walks"]]
    return ", ".join(told) or "none"


def _best(walks: Mapping[str, Any]) -> str:
    rows = [
        [
            _title(name),
            ", ".join(f"{k}={v}" for k, v in found["settings"].items()) or "the defaults",
            short(1e3 * found["default_error"]) if found["default_error"] < math.inf else "falls",
            short(1e3 * found["error"]),
            str(found["tried"]),
            found["version"],
            found["date"],
        ]
        for name, found in best_settings().items()
    ]
    best = {
        row["engine"]: _title(row["engine"])
        for walk in walks.values()
        for row in walk["rows"]
        if row["settings"] == BEST and row["figures"]
    }
    versions = {k: each for walk in walks.values() for k, each in walk["versions"].items()}
    others = found_for_others(best, {name: versions[ENTRIES[name].package] for name in best})
    commands = {
        found["command"].replace(f"--engines {name} ", "--engines NAME ")
        for name, found in best_settings().items()
    }
    advice = [f"- {entry.title}: {entry.advice}." for entry in ENTRIES.values() if entry.advice]
    return (
        "## Settings\n\nA search walks three steps at 1 ms in every engine. It varies each setting "
        "in turn from its default and keeps what lowers the error by 2 %. This single pass finds "
        "good settings, not proven optima. Errors are in mm and mrad. Each row is "
        + " or ".join(f"`{command}`" for command in sorted(commands)) + ".\n\n"
        + _table(
            ["engine", "best", "error, defaults", "error, best", "walks tried", "version", "date"],
            rows,
        )
        + "".join(f"\n{each}.\n" for each in others)
        + "\nThe settings tried follow the maintainers' advice. Names are the engines' own:\n\n"
        + "\n".join(advice) + "\n"
    )  # fmt: skip


def _figure(row: Mapping[str, Any], name: str, factor: float, walks: bool) -> str:
    value = row["figures"][name]
    if value is None or (name in WALKING and not walks):
        return "–"
    return short(factor * value)


_WHY = (
    "The others did not walk (*completed* means only that the simulation reached its planned "
    "time). Steps taken, or the fall's cause and consequences:"
)


def _walks(law: str, found: Mapping[str, Any]) -> str:
    columns = {**WALKING, **BY_ITSELF}
    rows = []
    reasons = []
    shown = _shown(found)
    name, *_ = law.partition(" ")
    period = found["control_period_s"]
    often = "" if period == CONTROL_PERIOD else f" --period {period:g}"
    for row in found["rows"]:
        if row["step_s"] != shown:
            continue
        title = _title(row["engine"])
        if row["figures"] is None:
            reasons.append(f"- {title}, {row['settings']}: {row['reason']}.")
            continue
        walks = row["figures"]["walks"]
        rows.append(
            [title, row["settings"], "yes" if walks else f"no, {row['figures']['steps']}"]
            + [_figure(row, name, factor, walks) for name, (_, factor) in columns.items()]
        )
        if not walks:
            reasons.append(f"- {title}, {row['settings']}: {row['figures']['ending']}.")
    headings = ["engine", "settings", "walks", *(heading for heading, _ in columns.values())]
    said = f"\n{_WHY}\n\n" + "\n".join(reasons) + "\n" if reasons else ""
    return (
        f"## {found['steps']} steps under {law}\n\nStep size {1e3 * shown:g} ms. Each row is "
        f"`heelstrike compare {found['robot']} --controller {name} --engines NAME "
        f"--settings SETTINGS --sizes {shown:g} --steps {found['steps']}{often}`.\n\n"
        + _table(headings, rows) + said
    )  # fmt: skip


def _peaks(walks: Mapping[str, Any]) -> str:
    law, found = next(
        ((law, found) for law, found in walks.items() if law == "FootstepFeedback"),
        next(iter(walks.items())),
    )
    sizes = sorted({row["step_s"] for row in found["rows"]}, reverse=True)
    names = dict.fromkeys((row["engine"], row["settings"]) for row in found["rows"])
    rows = []
    for name, which in names:
        own = {
            row["step_s"]: row["figures"]
            for row in found["rows"]
            if (row["engine"], row["settings"]) == (name, which) and row["figures"]
        }
        rows.append(
            [_title(name), which]
            + [_peak(own.get(h)) for h in sizes]
            + [short(own[h]["computing_s"]) if h in own else "–" for h in sizes]
        )
    headings = ["engine", "settings"]
    headings += [f"peak, {1e3 * h:g} ms" for h in sizes]
    headings += [f"computing time (s), {1e3 * h:g} ms" for h in sizes]
    called = ",".join(f"{h:g}" for h in sizes)
    return (
        "## Foot force over step size\n\nThe peak force on a foot, as above, and the computing "
        f"time of the same walk under {law}; {FELL} marks walks that ended early. With hard "
        "contact a touchdown is an impulse within one step, so its force grows as the step "
        "shrinks. With soft contact the force is that of the spring. "
        f"Each row is `heelstrike compare {found['robot']} "
        f"--controller {law.partition(' ')[0]} --engines NAME --settings SETTINGS --sizes {called} "
        f"--steps {found['steps']}`.\n\n"
        + _table(headings, rows)
    )  # fmt: skip


def _peak(figures: Mapping[str, Any] | None) -> str:
    if figures is None:
        return "–"
    return short(figures["peak"]) + ("" if figures["walks"] else FELL)


def _pushes(file: Path) -> str:
    name = file.stem.removeprefix("pushes-")
    law, _, often = name.partition("-every-")
    period = f" --period {1e-3 * float(often.removesuffix('-ms')):g}" if often else ""
    found = json.loads(file.read_text(encoding="utf-8"))
    told: dict[tuple[str, str], dict[str, str]] = {}
    for row in found["rows"]:
        cells = told.setdefault((row["title"], row["settings"]), {})
        cells[row["direction"]] = row["reason"] or _largest(row["largest"])
    called = f", called every {often.replace('-', ' ')}" if often else ""
    settings = ",".join(dict.fromkeys(row["settings"] for row in found["rows"]))
    return (
        f"## Largest push under {law}{called}\n\n"
        "A push acts on the trunk for 0.1 s, in the middle of the third step. The table has the "
        "largest impulse (N s) up to which the robot survives every push tried. In brackets is the "
        "smallest not survived. heelstrike simulates the walk event-driven to the end of the push. "
        "From there each engine continues with this state and the "
        "controller's memory, at steps of 1 ms. Times in messages of engines that fail are from "
        "the end of the push. Each row is "
        f"`heelstrike compare {found['robot']} --controller {law} --engines NAME "
        f"--settings {settings}{period} --largest-push`.\n\n"
        + _table(
            ["engine", "settings", *DIRECTIONS],
            [
                [title, which, *(cells.get(each, "–") for each in DIRECTIONS)]
                for (title, which), cells in told.items()
            ],
        )
    )


def _largest(found: Mapping[str, Any]) -> str:
    if found["failed"] is None:
        return f"≥ {short(found['recovered'])}"
    if found["failed"] == 0.0:
        return UNPUSHED
    return f"{short(found['recovered'])} ({short(found['failed'])})"


_SYMBOLS = (
    "β is the slope, μ the friction, v the speed at the start and ω a rate of rotation. R is "
    "the distance of the body's centre from the corner, φ the angle of the line between them "
    "from the vertical, α this angle when the block stands flat. I is the moment of inertia, "
    "about the corner in 5 and 6, about the disc's centre in 11 and 12. The wheel has spokes of "
    "length r at angles of 2α on a slope γ."
)


def _scenes(found: Mapping[str, Any]) -> str:
    names = list(dict.fromkeys((row["engine"], row["title"]) for row in found["rows"]))
    headings = ["engine", *(str(k + 1) for k in range(len(found["scenes"])))]
    rows = []
    for engine, title in names:
        told = [title]
        for name, *_ in found["scenes"]:
            row = next(r for r in found["rows"] if (r["engine"], r["scene"]) == (engine, name))
            told.append("–" if row["error"] is None else short(row["error"]))
        rows.append(told)
    listed = []
    last = ""
    for k, (name, exact, unit, words) in enumerate(found["scenes"]):
        told_of = "likewise" if words == last else words
        listed.append(f"{k + 1}. {name}: {f'{exact:.6g} {unit}'.rstrip()}; {told_of}.")
        last = words
    numbers = {name: str(k + 1) for k, (name, *_) in enumerate(found["scenes"])}
    failed: dict[tuple[str, str], list[str]] = {}
    for row in found["rows"]:
        if row["error"] is None and "restitution" not in row["reason"]:
            failed.setdefault((row["title"], row["reason"]), []).append(numbers[row["scene"]])
    why = [
        f"- {title}, scene{'s' if len(where) > 1 else ''} {', '.join(where)}: {said}."
        for (title, said), where in failed.items()
    ]
    why += dict.fromkeys(f"- {each}." for each in why_not_at_steps(found))
    return (
        "## Scenes with closed forms\n\nThe exact result of each scene:\n\n" + "\n".join(listed)
        + f"\n\n{_SYMBOLS}\n\nErrors (simulated minus exact value, in the units above) at a step "
        f"of {1e3 * found['step_s']:g} ms and {found['settings']}. Each row is `heelstrike compare "
        "bravo7 --engines NAME --scenes`:\n\n"
        + _table(headings, rows)
        + "\nA dash for a bouncing ball marks an engine without a coefficient of restitution. An "
        "error of many times the exact value means that the simulation diverged."
        + ("\n\n" + "\n".join(why) if why else "")
        + "\n"
    )  # fmt: skip


def _compass(found: Mapping[str, Any]) -> str:
    return (
        "## The compass gait\n\nThe passive walker of Goswami, Thuilot and Espiau (1998) starts on "
        f"its cycle down a slope of 3 degrees and takes up to {found['strides']} steps, at "
        f"{found['settings']}. Its legs are of one length, so the swing foot passes through the "
        "ground at mid-stance. Therefore the swing foot loses its contact points when, lifted off, "
        "it begins to sink, and regains them when the stance leg is perpendicular to the slope. "
        "Published: period 0.734346391 s, step 0.535445415 m, "
        "multipliers −0.199726 ± 0.544476i and 0.131573."
        "\n\nThe cycle is the mean of the last five steps; *spread* is how far they still differ "
        "from it. The Floquet multipliers are fitted to one step after each of 32 random "
        "disturbances; ± is the standard error of the largest one's modulus. An engine that puts "
        "landings at the ends of time steps is early or late by up to one time step, which changes "
        "the walker's next step. Where this change exceeds the disturbances, ± is large and the "
        "multipliers are not resolved. If the walker falls after a disturbance, the column "
        "*multipliers* has the reason. *best* marks rows at the best settings, of engines in which "
        "it falls at defaults.\n\nEach row is `heelstrike compare bravo7 --engines NAME "
        f"--scenes`.{_not_run(found)}\n\n"
        + _table(COMPASS, [compass_cells(row) for row in found["rows"]])
    )


def _not_run(found: Mapping[str, Any]) -> str:
    """Say which rows of the compass gait are missing."""
    there = {(row["engine"], row["step_s"]) for row in found["rows"]}
    steps = sorted({*COMPASS_STEPS, *(step for _, step in there if step is not None)}, reverse=True)
    lacks = {
        name: [f"{1e3 * step:g}" for step in steps if (name, step) not in there] for name in ENTRIES
    }
    told = [f"{_title(name)} at {' and '.join(own)} ms" for name, own in lacks.items() if own]
    return f" Missing rows were not run here: {', '.join(told)}." if told else ""


def _guards(found: Mapping[str, Any]) -> str:
    rows = []
    for name, guards in found.items():
        if "reason" in guards:
            rows.append([_title(name), guards["reason"], "", "", "", "", "no"])
            continue
        rows.append(
            [
                _title(name), "single" if guards["float32"] else "double",
                short(guards["flight"]), f"{guards['order']:.2f}" if guards["order"] else "–",
                short(guards["extrapolated"]), f"{guards['weight']:.4f}",
                "yes" if guards["holds"] else "no",
            ]
        )  # fmt: skip
    return (
        "## Guards\n\nTwo checks confirm that an engine has the same robot:\n\n- a flight of 0.1 s "
        "with all joints turning, at steps of 1, 0.5 and 0.25 ms. *flight* is the largest "
        "difference of a coordinate from heelstrike (m, rad), *order* its order of convergence. "
        "*extrapolated* is *flight* extrapolated to a step of zero, and must be at most 1e-6, or "
        "1e-3 in single precision;\n- *weight*, the sum of the normal forces at rest over the "
        "robot's weight. It must be 1, within 1 %.\n\nEach row is `heelstrike compare bravo7 "
        "--engines NAME --scenes`.\n\n"
        + _table(
            ["engine", "precision", "flight, 0.25 ms", "order", "extrapolated", "weight",
             "holds"],
            rows,
        )
    )  # fmt: skip
