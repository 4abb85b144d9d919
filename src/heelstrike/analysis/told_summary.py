"""What summaries of runs have in common: told as text, as a table, as JSON."""

from __future__ import annotations

import enum
import json
import math
import string
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from heelstrike.notebook import ShownInNotebooks
from heelstrike.sim.closed_sets import RunStatus

if TYPE_CHECKING:
    from rich.table import Table

UNKNOWN = float("nan")
"""A figure that does not exist."""

OF_A_GAIN = "energy created by impacts"
"""Label of a line that is needless where nothing was created."""


class ToldSummary(ShownInNotebooks):
    """Base of the figures of a run: dataclasses, with the lines that tell them."""

    robot: str
    status: str
    message: str

    def lines(self) -> list[tuple[str, str]]:
        """Label and value of every line of the table a person reads."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists and numbers, with None for what does not exist."""
        figures: Any = self
        found: dict[str, Any] = plain(asdict(figures))
        return found

    def to_json(self, *, indent: int | None = 2) -> str:
        """Return the summary as JSON text.

        Parameters
        ----------
        indent : int or None
            Spaces of indentation; None for one line.

        Returns
        -------
        str
            What :meth:`to_dict` returns, as JSON.
        """
        return json.dumps(self.to_dict(), indent=indent, allow_nan=False, ensure_ascii=False)

    def __str__(self) -> str:
        rows = self.lines()
        width = max(len(label) for label, _ in rows)
        return "\n".join([self._title(), *(f"{label:<{width}}  {value}" for label, value in rows)])

    def __rich__(self) -> Table:
        from rich.table import Table

        good = self.status == RunStatus.COMPLETED.value
        table = Table(
            title=self._title(), title_style="bold green" if good else "bold red", show_header=False
        )
        table.add_column(style="cyan", no_wrap=True)
        table.add_column()
        for label, value in self.lines():
            table.add_row(label, value)
        return table

    def _title(self) -> str:
        return f"{self.robot}: {self.message}"


def plain(value: Any) -> Any:
    """Return dictionaries, lists and numbers for JSON, None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return value.value
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Words(string.Formatter):
    """Significant digits, and a dash for what does not exist."""

    def format_field(self, value: Any, spec: str) -> str:
        """Write a value after a format; a dash for a number that does not exist."""
        if not isinstance(value, float):
            return str(value)
        return f"{value:{spec}g}" if math.isfinite(value) else "–"


def in_lines(
    figures: ToldSummary, lines: Mapping[str, str], needless: Mapping[str, bool]
) -> list[tuple[str, str]]:
    """Write figures into lines by their labels, those left out that are needless."""
    write = Words().format
    return [
        (label, write(line, s=figures))
        for label, line in lines.items()
        if not needless.get(label, False)
    ]
