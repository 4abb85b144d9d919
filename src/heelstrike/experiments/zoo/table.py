"""The table of the zoo: on a terminal, as CSV, as a page."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from heelstrike.experiments.zoo.disturbances import Disturbance
from heelstrike.experiments.zoo.results import STANDS, Animal, Cell, Results
from heelstrike.wording import counted

NOTHING = "–"
"""What stands where there is no number."""

UNFORESEEN = ("refused", "no gait")
"""Words that say little without their reason."""

SURE = 0.95
"""Confidence with which a share of all phases and grounds is stated."""


def shown(cell: Cell | None, disturbance: Disturbance) -> str:
    """Write a cell: the size withstood in every trial, and whether more was not tried."""
    if cell is None or cell.word:
        return NOTHING
    worst = cell.worst(less=disturbance.less)
    if cell.beyond:
        return f"{'≤' if disturbance.less else '≥'}\u2009{digits(worst)}"
    if worst == 0.0 and not disturbance.less:
        return f"<\u2009{digits(min(cell.failed))}"
    return digits(worst)


def digits(value: float) -> str:
    """Write a number with as many digits as one reads."""
    if abs(value) < 1e-6:
        return "0"
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.2g}"


def escaped(text: str) -> str:
    """Write a text so that it is shown in Markdown as it is, in a table, too.

    An underscore within a word is nothing but itself.
    """
    line = " ".join(text.split())
    line = re.sub(r"([\\`*\[\]{}#]|(?<![^\W_])_|_(?![^\W_]))", r"\\\1", line)
    for character in "&<>|~":  # not all that read Markdown know a backslash before these
        line = line.replace(character, f"&#{ord(character)};" if character != "&" else "&amp;")
    return line


def columns(results: Results) -> list[Disturbance]:
    """Return the disturbances that there are cells of, in the order of the table."""
    there = {key[2] for key in results.cells}
    return [each for each in results.disturbances if each.name in there]


def empty(row: Mapping[str, Cell]) -> str:
    """Say in a word why a whole row is empty; nothing if it is not."""
    words = {cell.word for cell in row.values()}
    return words.pop() if len(words) == 1 else ""


def notes(rows: Mapping[str, Mapping[str, Cell]]) -> Iterator[tuple[str, str, str]]:
    """Go through what has no number: a word, the controllers it is said of, the reason in full."""
    said: dict[tuple[str, str], dict[str, None]] = {}
    for controller, row in rows.items():
        for cell in row.values():
            if cell.word and cell.word != STANDS:
                said.setdefault((cell.word, cell.reason), {})[controller] = None
    for (word, reason), controllers in said.items():
        yield word, ", ".join(controllers), reason


def on_terminal(results: Results) -> RenderableType:
    """Return a table a robot, within the eighty columns of a plain terminal."""
    parts: list[RenderableType] = []
    shown_columns = columns(results)
    for animal, rows in results.robots():
        table = Table(
            title=Text(_title(animal), "bold"), title_justify="left", title_style="",
            box=SIMPLE_HEAD, show_edge=False, padding=0,
        )  # fmt: skip
        table.add_column("", overflow="fold")
        for each in shown_columns:
            name, _, sign = each.heading.partition(" ")
            table.add_column(f"{name}\n{sign}\n{each.unit}", justify="right", no_wrap=True)
        filled = {controller: row for controller, row in rows.items() if not empty(row)}
        for controller, row in filled.items():
            cells = [
                shown(row.get(each.name), each).replace("\u2009", "") for each in shown_columns
            ]
            table.add_row(Text(controller), *cells)
        parts.append(table if filled else Text(_title(animal), "bold"))
        told: dict[str, list[str]] = {}
        for word, controllers, reason in notes(rows):
            in_full = f": {reason}" if word in UNFORESEEN else ""
            told.setdefault(word, []).append(controllers + in_full)
        parts += [Text(f"{word}: {', '.join(names)}") for word, names in told.items()]
        parts.append(Text())
    return Group(*parts[:-1])


def as_csv(results: Results) -> str:
    """Return a line a cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ("robot", "controller", "disturbance", "unit", "withstood_in_all_trials", "median",
         "first_failed", "trials", "walks", "why_empty", "reason")
    )  # fmt: skip
    known = {each.name: each for each in columns(results)}
    for cell in results.cells.values():
        disturbance = known[cell.disturbance]
        failed = [each for each in cell.failed if math.isfinite(each)]
        first = (max(failed) if disturbance.less else min(failed)) if failed else math.nan
        numbers = (cell.worst(less=disturbance.less), cell.middle, first)
        writer.writerow(
            (*cell.key, disturbance.unit, *("" if math.isnan(n) else f"{n:.6g}" for n in numbers),
             len(cell.withstood), cell.walks, cell.word, cell.reason)
        )  # fmt: skip
    return text.getvalue()


def as_page(results: Results, *, page: Path, figure: Path, command: str) -> str:
    """Return a page in Markdown, which shows a figure that lies elsewhere.

    Parameters
    ----------
    results : Results
        What was found.
    page, figure : Path
        Where the page and its figure will be.
    command : str
        What makes them.
    """
    settings = results.settings
    there = columns(results)
    link = quote(Path(os.path.relpath(figure, page.parent)).as_posix())
    share = (1.0 - SURE) ** (1.0 / settings.trials)
    lines = [
        "# Zoo of controllers",
        "",
        "The tables give the largest disturbance that each controller withstands on each robot. "
        "Each robot has one gait, each controller one set of gains, tuned on one robot and "
        "scaled with weight and height. The page *Command line* describes the controllers. The "
        "command:",
        "",
        "```sh",
        command,
        "```",
        "",
        f"It used heelstrike {settings.version}, {settings.method}, seed {settings.seed}, and "
        "called controllers once a millisecond, at most once per time step.",
        "",
        f"![Largest disturbance by robot and controller, one panel for each disturbance]({link})",
        "",
    ]
    for animal, rows in results.robots():
        lines += [f"## {escaped(animal.robot)}", "", _gait(animal), ""]
        filled = {controller: row for controller, row in rows.items() if not empty(row)}
        if filled:
            heads = [f"{each.heading}<br>{each.unit}" for each in there]
            lines += [_line("controller", *heads), _line("---", *["--:"] * len(there))]
            for controller, row in filled.items():
                lines.append(
                    _line(escaped(controller), *(shown(row.get(d.name), d) for d in there))
                )
            lines.append("")
        said = [
            f"- {escaped(names)}: {word}{f' ({escaped(reason)})' if reason else ''}"
            for word, names, reason in notes(rows)
        ]
        lines += [*said, ""] if said else []
    lines += ["## The numbers", "", *_explained(there), "", *_measure(results, share)]
    return "\n".join(lines).rstrip() + "\n"


def _explained(there: Sequence[Disturbance]) -> list[str]:
    heads = ("disturbance", "name for `--disturbances`", "unit", "what it is")
    rows = [_line(*heads), _line(*["---"] * len(heads))]
    return rows + [_line(each.heading, f"`{each.name}`", each.unit, each.told) for each in there]


def _measure(results: Results, share: float) -> list[str]:
    settings = results.settings
    return [
        "A size is withstood if the walk recovers (`heelstrike.analysis.recovery`) from it and "
        f"all smaller ones tried. Up to {settings.strides} growing sizes are tried until "
        f"the walk fails, then {settings.halvings} bisections follow. ≥ (for friction ≤) means "
        "that the hardest size tried was withstood, < that the easiest was not. Pushes begin at "
        f"{counted(settings.trials, 'phase', 'phases')} of a step, rough ground has "
        f"{counted(settings.trials, 'shape', 'shapes')}, drawn from the seed, the same for all. "
        "A size in the tables was withstood at each of these. So, "
        f"with {SURE:.0%} confidence, at least {share:.0%} of all phases or shapes allow recovery: "
        f"if fewer did, the chance that all {settings.trials} do would be below "
        f"{share:.2f}^{settings.trials} = {1.0 - SURE:.2f}. "
        "Everything else has one trial.",
        "",
        "Controllers under which the undisturbed walk falls, leans by more than 0.6 rad, or "
        f"changes its speed are not tested. Rows with {NOTHING}: controllers that only stand.",
    ]


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _title(animal: Animal) -> str:
    return f"{animal.robot}, {animal.mass:.3g} kg"


def _gait(animal: Animal) -> str:
    if not animal.step_length:
        return f"{animal.mass:.3g} kg."
    step = f"{animal.step_length:.2f} m in {animal.step_duration:.2f} s"
    return f"{animal.mass:.3g} kg; steps of {step}."
