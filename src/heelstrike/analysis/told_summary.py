"""What summaries of runs have in common: told as text, as a table, as JSON."""

from __future__ import annotations

import enum
import json
import math
import string
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from heelstrike.analysis.actuation import CostOfTransport, torque_cost
from heelstrike.analysis.slip import max_slip
from heelstrike.field_texts import dataclass
from heelstrike.notebook import ShownInNotebooks
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import AnyRun, SolverCount

if TYPE_CHECKING:
    from rich.table import Table

UNKNOWN = float("nan")
"""A figure that does not exist."""

OF_A_GAIN = "energy created by impacts"
"""Label of a line that is needless where nothing was created."""


class PlainEntries:
    """Base of dataclasses that files and other programs read as plain entries."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists and numbers, with None for what does not exist."""
        figures: Any = self
        found: dict[str, Any] = plain(asdict(figures))
        return found


@dataclass(frozen=True, kw_only=True)
class ToldSummary(PlainEntries, ShownInNotebooks):
    """Figures of a run that one in the plane and one in space have, with the lines that tell them.

    Those that do not exist for it are NaN (null in JSON).
    """

    robot: str
    """Name of the robot."""
    status: str
    message: str
    """status, message: How the run ended."""
    duration_s: float
    """Time simulated."""
    slip_max_m: float
    """Largest distance that a contact point slid while pressed, over the whole run."""
    penetration_max_m: float
    """Worst value over all steps, from the certificates."""
    solver: SolverCount
    """How the contact problems were solved."""
    torque_cost_N2m2s: float  # noqa: N815 - units keep their capitals
    """∫ ΓᵀΓ dt over the whole run."""
    cost_of_transport: float
    cost_of_transport_positive: float
    """cost_of_transport, cost_of_transport_positive: ∫ Σ |τ ω| dt / (m g d), and the same of
    positive work only."""
    saturations: int
    """Times that a torque was clipped to its limit."""
    compile_s: float
    wall_s: float
    """compile_s, wall_s: Time spent on compilation, and on the simulation."""
    real_time_factor: float
    """Time simulated over time spent on the simulation."""
    energy_gain_J: float = 0.0  # noqa: N815 - units keep their capitals
    """Kinetic energy that restitution with friction made in impacts."""

    def lines(self) -> list[tuple[str, str]]:
        """Label and value of every line of the table a person reads."""
        raise NotImplementedError

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


def common_figures(run: AnyRun, transport: CostOfTransport) -> dict[str, Any]:
    """Return the fields of `ToldSummary` for a run, of which the cost of transport is known."""
    duration = float(run.time[-1] - run.time[0]) if len(run.time) else 0.0
    wall = run.timing.wall_s
    return {
        "robot": run.robot.name,
        "status": run.status.value,
        "message": run.message,
        "duration_s": duration,
        "slip_max_m": max_slip(run),
        "penetration_max_m": run.certificates.penetration,
        "solver": run.solver,
        "torque_cost_N2m2s": torque_cost(run),
        "cost_of_transport": transport.absolute,
        "cost_of_transport_positive": transport.positive,
        "saturations": run.saturations,
        "compile_s": run.timing.compile_s,
        "wall_s": wall,
        "real_time_factor": duration / wall if wall > 0.0 else UNKNOWN,
        "energy_gain_J": run.certificates.energy_gain,
    }


# What a person reads, in letters that the consoles of Windows have.
FRICTION_LINES = {
    "friction use": "{s.friction_use_max:.3} of the cone",
    "slip": "{s.slip_max_m:.2} m",
    "penetration": "{s.penetration_max_m:.2} m",
}
GAIN_LINE = {OF_A_GAIN: "{s.energy_gain_J:.3} J (Newton's restitution with friction)"}
COST_LINES = {
    "cost of transport": "{s.cost_of_transport:.3} "
    "({s.cost_of_transport_positive:.3} by positive work alone)",
    "torques at their limit": "{s.saturations}",
    "computing time": "{s.wall_s:.3} s ({s.real_time_factor:.3} × real time), "
    "compilation {s.compile_s:.3} s",
}


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
