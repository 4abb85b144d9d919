"""Tables that notebooks show of an object, with a picture; names in them are text, never markup."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.view.notebook.pictures import (
    curves_picture,
    ground_picture,
    multipliers_picture,
    poses_picture,
)
from heelstrike.view.page.markup import escaped, table
from heelstrike.view.page.page import page
from heelstrike.view.page.provenance import ground_in_words
from heelstrike.view.page.verdict import judge
from heelstrike.view.style import in_words
from heelstrike.wording import some_of

if TYPE_CHECKING:
    from heelstrike.analysis.limit_cycle import LimitCycle
    from heelstrike.analysis.summary import Summary
    from heelstrike.contact.ground import Ground
    from heelstrike.gait.gait import Gait
    from heelstrike.robot.robot import Robot
    from heelstrike.sim.run import Run

POSES = 6
"""Configurations of a run that its picture shows."""
MOST_NAMES = 24
"""Names that a table lists."""


def robot_card(robot: Robot) -> str:
    """Show a robot: portrait, mass, coordinates, motors, feet."""
    from heelstrike.contact.ground import Ground
    from heelstrike.view.drawing import legs_apart, standing_height

    q = legs_apart(robot)
    if robot.floating and robot.nc:
        q[1] -= standing_height(robot, q)
    portrait = poses_picture(robot, q[None], Ground(), "the robot, its legs apart")
    rows = {
        "mass": f"{robot.total_mass:.6g} kg",
        "coordinates": f"{robot.nv}: {_names(robot.joint_names)}",
        "actuators": f"{robot.nu}: {_names(robot.actuator_names)}",
        "contact points": f"{robot.nc}: {_names(robot.contact_names)}",
        "feet": _names(tuple(foot.name for foot in robot.feet)),
        "mirror image": "none" if robot.mirror is None else "yes",
    }
    return _card(robot.name, table(rows), portrait)


def gait_card(gait: Gait) -> str:
    """Show a gait: size, cost, margins, and the joints over one step."""
    time = np.linspace(0.0, gait.step_duration, 60)
    drawn = curves_picture(time, gait.position(time), "positions of the joints over the first step")
    margins = gait.margins
    rows = {
        "step": f"{gait.step_length:.4g} m in {gait.step_duration:.4g} s",
        "torque cost": f"{gait.cost:.5g} N²m²s a step",
        "designed for friction": f"{gait.friction:.3g}, share used {margins.friction_use:.3g}",
        "zero moment point": f"{1e3 * margins.zero_moment_point:.3g} mm from the ends of the sole",
        "largest torque": f"{margins.peak_torque:.4g} N m",
        "joints": _names(gait.joint_names),
    }
    return _card(f"gait of {gait.robot}", table(rows), drawn)


def run_card(run: Run) -> str:
    """Show a run: the verdict, how it ended, and the robot at equal times."""
    if not len(run.time):
        return _card(run.robot.name, f"<p>{escaped(run.message)}</p>", "")
    at = np.searchsorted(run.time, np.linspace(run.time[0], run.time[-1], POSES))
    at = np.unique(np.clip(at, 0, len(run.time) - 1))
    drawn = poses_picture(run.robot, run.position[at], run.ground, "the robot at equal times")
    rows = {
        "verdict": judge(run).headline,
        "status": f"{run.status.value}: {run.message}",
        "method": run.method.name,
        "ground": ground_in_words(run.ground),
        "record": f"{len(run.time)} rows, {len(run.events)} events, {run.steps} steps",
        "contact problems": str(run.solver),
    }
    return _card(run.robot.name, table(rows), drawn)


def summary_card(summary: Summary) -> str:
    """Show a summary as the table that is printed."""
    return _card(f"{summary.robot}: {summary.message}", table(dict(summary.lines())), "")


def ground_card(ground: Ground) -> str:
    """Show a ground: its profile, friction, restitution."""
    drawn, factor = ground_picture(ground)
    remark = f" (heights drawn {factor:.3g} times as large)" if factor > 1.0 else ""
    return _card("ground", f"<p>{escaped(ground_in_words(ground) + remark)}</p>", drawn)


def limit_cycle_card(cycle: LimitCycle) -> str:
    """Show a limit cycle: step, stability, Floquet multipliers."""
    largest = float(np.abs(cycle.multipliers).max(initial=0.0))
    rows = {
        "step": f"{cycle.step_length:.6g} m in {cycle.period:.6g} s",
        "stability": "stable" if cycle.stable else "unstable",
        "largest Floquet multiplier": f"{largest:.4g}",
        "residual": f"{cycle.residual:.2g} after {cycle.iterations} Newton steps",
    }
    return _card("limit cycle", table(rows), multipliers_picture(cycle.multipliers))


@dataclass(frozen=True)
class Film:
    """A run as a page that a notebook shows in place."""

    text: str = field(repr=False)
    """The page."""
    height: int
    """Of its frame, in pixels."""

    def _repr_html_(self) -> str:
        return (
            '<iframe title="film of the run" sandbox="allow-scripts" loading="lazy" '
            f'style="width:100%;height:{int(self.height)}px;border:0" '
            f'srcdoc="{escaped(self.text)}"></iframe>'
        )


def film(run: Run, gait: Gait | None, height: int) -> Film:
    """Make the film of a run for a notebook; see :meth:`heelstrike.Run.show`."""
    return Film(page(run, gait), height)


CARDS: dict[str, Callable[[Any], str]] = {
    "Robot": robot_card,
    "Gait": gait_card,
    "Run": run_card,
    "Summary": summary_card,
    "Ground": ground_card,
    "LimitCycle": limit_cycle_card,
}
"""What shows an object, by the name of its class: to know these by themselves would import them."""


def card(shown: object) -> str:
    """Return what a notebook shows of an object, as HTML."""
    names = (kind.__name__ for kind in type(shown).__mro__)
    return next(CARDS[name] for name in names if name in CARDS)(shown)


def _card(title: str, content: str, drawn: str) -> str:
    return f"<div><p><b>{escaped(title)}</b></p>{drawn}{content}</div>"


def _names(names: tuple[str, ...]) -> str:
    return some_of(list(map(in_words, names)), MOST_NAMES) or "none"
