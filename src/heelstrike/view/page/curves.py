"""Curves of a page: panels over the same time as its animation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from heelstrike.analysis.energy import energy_balance
from heelstrike.analysis.friction import friction_use
from heelstrike.analysis.support import foot_sums
from heelstrike.analysis.tracking import reference_motion
from heelstrike.analysis.zero_moment_point import ZeroMomentPoint, zero_moment_point_limits
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import legs
from heelstrike.sim.run import Run
from heelstrike.view.contact_figures import ROOM_ABOUT_POINTS
from heelstrike.view.energy_figure import ALWAYS
from heelstrike.view.page.rows import Rows, means
from heelstrike.view.panels import impact_rows
from heelstrike.view.style import in_words, limits_in_words

DASHED, DOTTED = 1, 2
SIDES = ("left", "right")
FLATTEST = 3.0
"""How much taller than its curves an axis may become to hold their limits."""
ROOM = 0.08
"""Share of the height of a panel that is left free above and below its curves."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One curve: values in the rows shown, and its look."""

    values: Floats | None
    """(n,), None where the numbers come later."""
    label: str
    foot: int = -1
    """Whose colour it has, -1 for none."""
    dash: int = 0
    """Kind of line, 0 for a whole one."""
    color: int | None = None
    """A colour of the palette instead of a foot's."""
    at: int | None = None
    """Where in a frame its numbers are, if they come later."""

    def described(self) -> dict[str, Any]:
        """Return all but the values, for JSON."""
        known = {"color": self.color, "at": self.at}
        return {"label": self.label, "foot": self.foot, "dash": self.dash} | {
            name: each for name, each in known.items() if each is not None
        }


@dataclass(frozen=True, eq=False)
class Plot:
    """Traces on common axes, as ``drawing.js`` has them."""

    title: str
    unit: str
    traces: Sequence[Trace]
    limits: Sequence[tuple[str, float]] = ()
    """Levels drawn as limits."""
    span: tuple[float, float] | None = None
    """Ends of the y axis; those of the curves by default."""
    steps: bool = False
    """Whether values are held from row to row."""
    note: str = ""
    """What else there is to say."""
    group: str = field(default="", kw_only=True)
    """What it belongs to."""
    usual: tuple[float, float] | None = field(default=None, kw_only=True)
    """Values that are usual, where those that come later decide upon the y axis."""

    def described(self) -> dict[str, Any]:
        """Return all but the values, for JSON."""
        known = {"span": self.span, "steps": self.steps, "note": self.note, "usual": self.usual}
        return {
            "title": self.title,
            "unit": self.unit,
            "group": self.group,
            "curves": [trace.described() for trace in self.traces],
            "limits": [{"label": label, "level": level} for label, level in self.limits],
            **{name: each for name, each in known.items() if each},
        }


def plots(run: Run, gait: Gait | None, rows: Rows, zmp: ZeroMomentPoint) -> list[Plot]:
    """Make the panels of a run: joints, torques, brakes, feet, energy."""
    found = [*_joints(run, gait, rows), *_torques(run, rows), *_brakes(run, rows)]
    if run.robot.feet:
        found += [_pressure(run, rows, zmp), *_forces(run, rows), _friction(run, rows)]
    return [*found, *_energy(run, rows)]


def _joints(run: Run, gait: Gait | None, rows: Rows) -> list[Plot]:
    """Positions of the joints that motors move, by legs, or of all coordinates."""
    robot = run.robot
    joints = robot.model.actuator_joint if robot.nu else np.arange(robot.nq)
    names = robot.actuator_names if robot.nu else robot.joint_names
    reference = None
    if gait is not None and robot.nu:
        reference = reference_motion(run, gait).position[rows]
    leg = legs(robot)[joints]
    turns = robot.model.axis[joints, 0] != 0.0
    found = []
    for kind, unit, what in ((True, "rad", "angle"), (False, "m", "position")):
        for name, several in alike(names, np.flatnonzero(turns == kind)).items():
            traces = []
            for place, i in enumerate(several):
                side = in_words(names[i])
                dash = 0 if len(several) < 3 else place
                traces.append(Trace(run.position[rows, joints[i]], side, int(leg[i]), dash))
                if reference is not None:
                    told = "reference" if i == several[-1] else ""
                    traces.append(Trace(reference[:, i], told, -1, DOTTED))
            found.append(Plot(f"{name} {what}", unit, traces, group="joint positions"))
    return found


def _torques(run: Run, rows: Rows) -> list[Plot]:
    """What motors do to their joints, with their limits."""
    model = run.robot.model
    ends = np.column_stack((model.torque_lower, model.torque_upper))
    return _on_joints(run, rows, run.torque, model.actuator_joint, run.robot.actuator_names, ends)


def _brakes(run: Run, rows: Rows) -> list[Plot]:
    """What brakes do to their joints, with the limits of those that slip."""
    model = run.robot.model
    ends = np.column_stack((-model.brake_limit, model.brake_limit))
    return _on_joints(
        run, rows, run.brake_torque, model.brake_joint, run.robot.brake_names, ends, "brake"
    )


def _on_joints(
    run: Run, rows: Rows, values: Floats, joints: Integers, names: Sequence[str], ends: Floats,
    what: str = "",
) -> list[Plot]:  # fmt: skip
    """Torques (nt, n) on joints, with their limits (n, 2): a panel for those that are alike."""
    leg = legs(run.robot)[joints]
    found = []
    for name, several in alike(names, np.arange(len(names))).items():
        unit = "N m" if run.robot.model.axis[joints[several[0]], 0] != 0.0 else "N"
        limits = sorted({float(end) for end in ends[several].ravel() if np.isfinite(end)})
        traces = [
            Trace(values[rows, i], in_words(names[i]), int(leg[i]), place)
            for place, i in enumerate(several)
        ]
        found.append(
            Plot(
                f"{name} {what or ('torque' if unit == 'N m' else 'force')}",
                unit,
                traces,
                [("slips" if what else "limit", level) for level in limits],
                span=_usual_span(run, values[:, several], limits),
                steps=True,
                note=limits_in_words(limits, unit),
                group="joint torques",
            )
        )
    return found


def side_of(name: str) -> str:
    """The side of a joint; its name if it has none."""
    return " ".join(w for w in in_words(name).split() if w.lower() in SIDES) or in_words(name)


def alike(names: Sequence[str], which: Integers) -> dict[str, list[int]]:
    """Group indices of names that differ by their side only: one panel for both knees."""
    groups: dict[str, list[int]] = {}
    for i in which.tolist():
        words = [w for w in in_words(names[i]).split() if w.lower() not in SIDES]
        groups.setdefault(" ".join(words) or in_words(names[i]), []).append(i)
    return groups


def _pressure(run: Run, rows: Rows, zmp: ZeroMomentPoint) -> Plot:
    heel, toe = zero_moment_point_limits(run.robot)
    alone = np.where(zmp.single_support[:, None], zmp.foot, np.nan)[rows]
    traces = [Trace(alone[:, i], in_words(foot.name), i) for i, foot in enumerate(run.robot.feet)]
    room = 0.15 * (toe - heel) if toe > heel else ROOM_ABOUT_POINTS
    return Plot(
        "zero moment point in single support, ahead of the ankle",
        "m",
        traces,
        [("heel", heel), ("toe", toe)],
        span=(heel - room, toe + room),
        group="feet",
    )


def _forces(run: Run, rows: Rows) -> list[Plot]:
    sums = foot_sums(run, run.contact_force)
    shown = means(run, sums, rows)
    found = []
    for k, name in enumerate(("normal force", "tangential force, positive forward")):
        traces = [
            Trace(shown[:, i, k], in_words(foot.name), i, i and DASHED)
            for i, foot in enumerate(run.robot.feet)
        ]
        limits = [("weight", run.robot.weight)] if k == 0 else []
        levels = [level for _, level in limits]
        span = _usual_span(run, sums[..., k], levels)
        found.append(Plot(name, "N", traces, limits, span=span, steps=True, group="feet"))
    return found


def _friction(run: Run, rows: Rows) -> Plot:
    use = friction_use(run).foot[rows]
    traces = [Trace(use[:, i], in_words(foot.name), i) for i, foot in enumerate(run.robot.feet)]
    limits = [("edge of the cone", 1.0)]
    return Plot("friction used, share of the cone", "1", traces, limits, (-0.05, 1.1), group="feet")


def _energy(run: Run, rows: Rows) -> list[Plot]:
    balance = energy_balance(run)
    changes = [
        Trace((getattr(balance, name) - getattr(balance, name)[:1])[rows], label, -1, dash, color)
        for name, label, dash, color in (
            ("kinetic", "kinetic", 0, 0),
            ("potential", "potential", DASHED, 1),
            ("total", "mechanical", 0, None),
        )
    ]
    works = [
        Trace(getattr(balance, name)[rows], label, -1, dash, color)
        for name, label, dash, color in (
            ("actuators", "actuators", 0, 2),
            ("contacts", "ground", DASHED, 1),
            ("dampers", "dampers", DOTTED, 3),
            ("stops", "joint stops", 3, 4),
            ("dry_friction", "dry friction", DOTTED, 5),
            ("brakes", "brakes", DASHED, 4),
            ("pushes", "pushes", 3, 0),
            ("residual", "residual", 0, None),
        )
        if name in ALWAYS or getattr(balance, name).any()
    ]
    return [
        Plot("energy, change since the start", "J", changes, group="energy"),
        Plot("work since the start", "J", works, group="energy"),
    ]


def _usual_span(run: Run, values: Floats, levels: Sequence[float]) -> tuple[float, float] | None:
    """Ends of an axis that holds values (nt, ...) between impacts, which leave it.

    Levels that would press the curves flat are left outside.
    """
    usual = values[~impact_rows(run)].ravel()
    usual = usual[np.isfinite(usual)]
    if not usual.size:
        return None
    wide = np.append(usual, levels)
    if np.ptp(wide) <= FLATTEST * np.ptp(usual):
        usual = wide
    if not np.ptp(usual) > 0.0:
        return None
    room = ROOM * float(np.ptp(usual))
    return float(usual.min()) - room, float(usual.max()) + room
