"""A table, for the terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import rich.table


@dataclass(frozen=True)
class Table:
    """Text in rows.

    Attributes
    ----------
    title : str
    head : sequence of str
        What is in the columns; the first stands on the left.
    rows : sequence of sequence of str
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """Return it for a page: the title in italics, and the lines."""
        return "\n".join([f"*{self.title}*", "", *markdown(self.head, self.rows)])

    def __rich__(self) -> rich.table.Table:
        table = rich.table.Table(title=self.title, title_justify="left")
        for place, heading in enumerate(self.head):
            table.add_column(heading, justify="left" if place == 0 else "right")
        for row in self.rows:
            table.add_row(*row)
        return table


def number(value: Any, digits: int = 3) -> str:
    """Return a number that may be missing."""
    return "–" if value is None else f"{value:.{digits}g}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    rule = "|" + "|".join([":---", *["---:"] * (len(head) - 1)]) + "|"
    first, *others = ("| " + " | ".join(cells) + " |" for cells in (head, *rows))
    return [first, rule, *others]
