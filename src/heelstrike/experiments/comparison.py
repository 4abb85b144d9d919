"""The same robot and controller under several simulation methods, and how far they differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, field
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table

from heelstrike.analysis import (
    energy_balance,
    max_slip,
    stances,
    zero_moment_point,
)
from heelstrike.analysis.intervals import IMPULSIVE, impulses_in_events
from heelstrike.analysis.told_summary import plain
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.interruption import acknowledge
from heelstrike.robot import Robot, State
from heelstrike.robot.model import Floats
from heelstrike.sim import Controller, Push, Run, simulate
from heelstrike.sim.closed_sets import OnError, RunStatus
from heelstrike.sim.method import Method
from heelstrike.view.terminal import bare_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


GRID = 1e-3
"""Time between the instants at which runs are compared, in s."""

INTERRUPTED = "interrupted before it began"
"""Why a method is left out after Ctrl-C."""

LANDING = 0.02
"""Impulses are added up over this time from a touchdown, in s: compliant ground needs it."""


@dataclass(frozen=True)
class Difference:
    """How one method fared, and how far it is from the reference."""

    method: str
    """Name of the method."""
    status: str
    """How its run ended."""
    touchdowns: int
    """Touchdowns of feet after the start; more than steps if a foot chatters."""
    touchdown_s: float
    """Largest difference in time, in s, between a touchdown of the reference and the nearest of the
    same foot."""
    impulse_Ns: float  # noqa: N815 - units keep their letters
    """Largest difference of the normal impulse of a landing foot, added up over `LANDING`."""
    zmp_m: float
    """Root mean square difference of the stance foot's zero moment point, in m."""
    energy_J: float  # noqa: N815
    """Root mean square difference of the mechanical energy, in J."""
    position: float
    """Largest difference of a coordinate at the last common instant (rad or m)."""
    penetration_m: float
    slip_m: float
    """penetration_m, slip_m: Deepest penetration and longest slip of its own run."""
    complementarity: float
    """Largest residual of its own contact problems; zero for laws that solve none."""
    wall_s: float
    """Seconds it took to compute."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs of the same robot under several methods."""

    runs: dict[str, Run]
    """The runs by the names of their methods."""
    reference: str
    """Name of the run that the others are held against."""
    differences: tuple[Difference, ...]
    """One a method, in the order they were given."""
    left_out: dict[str, str] = field(default_factory=dict)
    """Methods that could not simulate this, and why."""

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all methods were through."""
        cut = any(run.status is RunStatus.INTERRUPTED for run in self.runs.values())
        return cut or INTERRUPTED in self.left_out.values()

    def to_dict(self) -> dict[str, Any]:
        """Return the differences as plain numbers, NaN as None."""
        return {
            "reference": self.reference,
            "methods": plain([asdict(each) for each in self.differences]),
            "left_out": self.left_out,
        }

    def plot(self) -> Figure:
        """Draw how positions, energy and zero moment point differ over time."""
        from heelstrike.view.comparison_figure import draw_comparison

        times, series = {}, {}
        for name, run in self.runs.items():
            times[name], series[name] = _against(run, self.runs[self.reference])
        return draw_comparison(self.runs[self.reference].robot, self.reference, times, series)

    def __rich__(self) -> Group:
        # Two tables, each within the eighty columns of a plain terminal.
        apart = self._table(f"differences from {self.reference}", APART)
        return Group(apart, "", self._table("each by itself", ALONE), *self._reasons())

    def _table(self, title: str, columns: Mapping[str, str]) -> Table:
        table = bare_table(title, ("method",), columns.values())
        for each in self.differences:
            values = [getattr(each, name) for name in columns]
            cells = [f"{v:.2g}" if isinstance(v, float) else str(v) for v in values]
            table.add_row(each.method, *(cell.replace("nan", "–") for cell in cells))
        return table

    def _reasons(self) -> list[str]:
        return [f"{name} left out: {why}" for name, why in self.left_out.items()]


APART = {
    "touchdowns": "landings",
    "touchdown_s": "time of landing s",
    "impulse_Ns": "landing impulse N s",
    "zmp_m": "ZMP m",
    "energy_J": "energy J",
    "position": "last position rad, m",
}
ALONE = {
    "status": "status",
    "penetration_m": "penetration m",
    "slip_m": "slip m",
    "complementarity": "residual",
    "wall_s": "computing s",
}
"""Members of a difference and their headings: how runs lie apart, and what each is by itself."""


@takes(SimulationError)
def compare(
    robot: Robot,
    controller: Controller | None = None,
    *,
    methods: Sequence[Method] | Mapping[str, Method],
    state: State,
    duration: float,
    ground: Ground | None = None,
    reference: str | None = None,
    control_period: float | None = None,
    pushes: Sequence[Push] = (),
    on_error: OnError | str = OnError.WARN,
) -> Comparison:
    """Simulate the same walk by several methods and report how far the results differ.

    Parameters
    ----------
    robot, controller, state, duration, ground, control_period, pushes, on_error
        As in :func:`heelstrike.simulate`.
    methods : sequence of Method, or mapping of names to them
        Simulation methods; a sequence is named after their classes and options.
    reference : str, optional
        Name of the method to hold the others against; the first by default.

    Returns
    -------
    Comparison
        Methods that refuse the ground, the state or the controller's period are left out with
        their reasons: a compliant law has a restitution of its own, for one, and takes none from
        the ground. So are those that had not begun when Ctrl-C came; the one under way is there
        as far as it came.

    Raises
    ------
    SimulationError
        If no method is given, two have the same name, the reference is none of them, or the
        reference is left out.
    KeyboardInterrupt
        At Ctrl-C before the reference has begun.
    """
    named = _named(methods)
    first = next(iter(named)) if reference is None else reference
    if first not in named:
        raise SimulationError(f"the reference {first!r} is none of the methods: {', '.join(named)}")
    runs: dict[str, Run] = {}
    left_out: dict[str, str] = {}
    interrupted = False
    for name, method in named.items():
        if interrupted:
            left_out[name] = INTERRUPTED
            continue
        try:
            run = simulate(
                robot,
                controller,
                state=state,
                duration=duration,
                method=method,
                ground=ground,
                control_period=control_period,
                pushes=pushes,
                on_error=on_error,
            )
        except SimulationError as error:
            if name == first:
                raise
            left_out[name] = str(error)
        except KeyboardInterrupt as interrupt:  # while compiling
            acknowledge(interrupt)
            interrupted = True
            left_out[name] = INTERRUPTED
        else:
            runs[name] = run
            interrupted = run.status is RunStatus.INTERRUPTED
    if first not in runs:
        raise KeyboardInterrupt
    differences = tuple(_difference(name, run, runs[first]) for name, run in runs.items())
    return Comparison(runs, first, differences, left_out)


def _named(methods: Sequence[Method] | Mapping[str, Method]) -> dict[str, Method]:
    pairs = methods if isinstance(methods, Mapping) else {str(each): each for each in methods}
    named = dict(pairs)
    if len(named) < len(methods):
        raise SimulationError("two of the methods to compare are the same: give each once")
    if not named:
        raise SimulationError("give at least one method to compare")
    return named


def _difference(name: str, run: Run, reference: Run) -> Difference:
    ours, theirs = _landings(run), _landings(reference)
    landing = _nearest(ours, theirs[theirs[:, 1] <= run.time[-1]])
    _, series = _against(run, reference)
    return Difference(
        method=name,
        status=run.status.value,
        touchdowns=len(ours),
        touchdown_s=_largest(landing[:, 1]),
        impulse_Ns=_largest(landing[:, 2]),
        zmp_m=root_mean_square(series["zmp"]),
        energy_J=root_mean_square(series["energy"]),
        position=float(series["position"][-1]) if len(series["position"]) else math.nan,
        penetration_m=run.certificates.penetration,
        slip_m=max_slip(run),
        complementarity=run.certificates.complementarity,
        wall_s=run.timing.wall_s,
    )


def _landings(run: Run) -> Floats:
    """Foot, time and normal impulse of every landing, (n, 3)."""
    found = []
    for stance in stances(run):
        if stance.touchdown == run.time[0]:
            continue
        contacts = list(run.robot.feet[stance.foot].contacts)
        impulse = landing_impulse(run, contacts, stance.touchdown)
        found.append((stance.foot, stance.touchdown, impulse))
    return np.array(found, dtype=np.float64).reshape(-1, 3)


def _nearest(ours: Floats, theirs: Floats) -> Floats:
    """Differences of the landings of a foot that are nearest in time to those of the reference.

    A foot that chatters lands more often than it should.
    """
    found = []
    for landing in theirs:
        same = ours[ours[:, 0] == landing[0]]
        if len(same):
            found.append(same[np.argmin(np.abs(same[:, 1] - landing[1]))] - landing)
    return np.array(found, dtype=np.float64).reshape(-1, 3)


def landing_impulse(run: Run, contacts: list[int], touchdown: float) -> float:
    """Normal impulse on some contact points over the landing.

    Time stepping and compliant laws have it all in their forces; event-driven runs have impacts
    apart, in their events.

    Parameters
    ----------
    run : Run
        The run.
    contacts : list of int
        The contact points.
    touchdown : float
        When it begins, in s; it lasts for `LANDING`.

    Returns
    -------
    float
        In N s.
    """
    end = touchdown + LANDING
    spans = np.minimum(run.time[1:], end) - run.time[:-1]
    rows = (run.time[1:] > touchdown - 1e-12) & (run.time[:-1] < end)
    force = run.contact_force[:-1, contacts, 0].sum(axis=1)
    total = float(np.sum((force * spans)[rows]))
    if impulses_in_events(run):
        total += sum(
            event.impulse[0]
            for event in run.events
            if event.kind in IMPULSIVE
            and event.contact in contacts
            and touchdown - 1e-12 <= event.time < end
        )
    return total


def _against(run: Run, reference: Run) -> tuple[Floats, dict[str, Floats]]:
    """Differences of a run from the reference on a common grid of instants."""
    end = min(run.time[-1], reference.time[-1])
    grid = np.linspace(0.0, end, max(2, round(end / GRID) + 1))
    ours, theirs = sampled(run, grid), sampled(reference, grid)
    apart = {name: ours[name] - theirs[name] for name in ours}
    return grid, apart | {"position": np.abs(apart["position"]).max(axis=1)}


def sampled(run: Run, grid: Floats) -> dict[str, Floats]:
    """Positions (linearly), energy and zero moment point (the row before) at given instants.

    Parameters
    ----------
    run : Run
        The run.
    grid : (n,) float
        Instants in s.

    Returns
    -------
    dict
        ``position``, ``energy`` and ``zmp``, n rows each.
    """
    before = np.clip(np.searchsorted(run.time, grid + 1e-9, side="right") - 1, 0, None)
    position = np.column_stack([np.interp(grid, run.time, column) for column in run.position.T])
    zmp = zero_moment_point(run).stance if run.robot.feet else np.full(len(run.time), np.nan)
    return {
        "position": position,
        "energy": energy_balance(run).total[before],
        "zmp": zmp[before],
    }


def _largest(values: Floats) -> float:
    return float(np.fmax.reduce(np.abs(values), initial=math.nan))


def root_mean_square(values: Floats) -> float:
    """Root mean square of the numbers that are finite; NaN of none.

    Parameters
    ----------
    values : array
        Numbers.
    """
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else math.nan
