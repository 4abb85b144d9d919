"""Figures of a walk that an engineer signs: clearance, impacts, speed, repetition, power."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from heelstrike.analysis.actuation import actuator_power, cost_of_transport
from heelstrike.analysis.intervals import mean_over_intervals
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.slip import max_slip
from heelstrike.analysis.support import stances, step_times, walking_steps
from heelstrike.analysis.tracking import tracking_error
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Integers
from heelstrike.sim.run import AnyRun, Run

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


MID_SWING = (0.2, 0.8)
"""Parts of a swing between which its clearance counts: the foot is on the ground at both ends."""
NO_SLIP = 1e-9
"""Slip (m) of points that stick, but for rounding."""
STEPPED = 0.1
"""Shortest swing that counts (s): what is shorter is chatter."""


@dataclass(frozen=True)
class Measure:
    """A measured quantity of a walk."""

    name: str
    """What is measured."""
    value: float
    unit: str
    """value, unit: How much it is; NaN where there is nothing to measure."""
    detail: str = ""
    """What else there is to say of it."""


@dataclass(frozen=True)
class MotorLoad:
    """Load of a motor over a run."""

    name: str
    """Name of the actuator."""
    peak_torque: float
    rms_torque: float
    """peak_torque, rms_torque: In N m; N of a slide."""
    peak_speed: float
    """In rad/s; m/s of a slide."""
    mean_power: float
    peak_power: float
    """mean_power, peak_power: Mechanical power τ ω: the mean of its size, and its largest size, in
    W."""


def motor_loads(run: AnyRun) -> tuple[MotorLoad, ...]:
    """Compute the load of each motor over a run.

    Parameters
    ----------
    run : Run or SpatialRun
        The run, of at least one row.

    Returns
    -------
    tuple of MotorLoad
        In the order of the actuators.
    """
    held = np.diff(run.time)
    duration = max(float(held.sum()), np.finfo(float).tiny)
    power, square = actuator_power(run), mean_over_intervals(run, run.torque**2)
    speed = run.velocity[:, run.robot.driven]
    return tuple(
        MotorLoad(
            name,
            float(np.abs(run.torque[:, i]).max()),
            float(np.sqrt(held @ square[:, i] / duration)),
            float(np.abs(speed[:, i]).max()),
            float(held @ np.abs(power[:, i]) / duration),
            float(np.abs(power[:, i]).max(initial=0.0)),
        )
        for i, name in enumerate(run.robot.actuator_names)
    )


def measures(run: Run, gait: Gait | None = None) -> tuple[Measure, ...]:
    """Measure a walk.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait that it followed, for the tracking error.

    Returns
    -------
    tuple of Measure
        Those that there are.

    Raises
    ------
    GaitError
        If the gait does not fit the robot of the run.
    """
    found = _measures(run, gait) if len(run.time) else ()
    return tuple(each for each in found if np.isfinite(each.value))


def _measures(run: Run, gait: Gait | None) -> Iterator[Measure]:
    motion = run_motion(run)
    landings = walking_steps(run)
    times = step_times(run)
    rows = np.minimum(np.searchsorted(run.time, np.array(times) - 1e-9), len(run.time) - 1)
    center = motion.center_of_mass[rows, 0]
    if len(times) > 1:
        durations, lengths = np.diff(times), np.diff(center)
        speeds = lengths / durations
        yield Measure(
            "walking speed", float((center[-1] - center[0]) / (times[-1] - times[0])), "m/s",
            f"{speeds.min():.3g} to {speeds.max():.3g} from step to step",
        )  # fmt: skip
        yield Measure(
            "duration of a step", float(durations.mean()), "s",
            f"{durations.min():.4g} to {durations.max():.4g}",
        )  # fmt: skip
    yield from _repetition(run, rows)
    yield from _clearance(run)
    if landings:
        impulses = np.array([landing.impulse for landing in landings])
        worst = int(impulses.argmax())
        yield Measure(
            "touchdown impulse, largest", float(impulses[worst]), "N s",
            f"at {landings[worst].touchdown:.3f} s; {impulses.mean():.3g} on average",
        )  # fmt: skip
        before = np.maximum(rows[1:] - 1, 0)
        down = [
            -float(
                motion.contact_velocity[row, list(run.robot.feet[landing.foot].contacts), 1].min()
            )
            for row, landing in zip(before, landings, strict=True)
        ]
        worst = int(np.argmax(down))
        yield Measure(
            "touchdown velocity, largest", down[worst], "m/s",
            f"downwards, at {landings[worst].touchdown:.3f} s",
        )  # fmt: skip
    if run.robot.nc:
        slip = max_slip(run)
        slid = 1e3 * slip if slip > NO_SLIP else 0.0
        yield Measure("slip of a pressed contact point", slid, "mm", "in all")
    if gait is not None:
        error = tracking_error(run, gait)
        row, joint = np.unravel_index(int(np.abs(error.position).argmax()), error.position.shape)
        yield Measure(
            "tracking error, largest", error.max, "rad",
            f"{run.robot.actuator_names[joint].replace('_', ' ')} at {run.time[row]:.3f} s; "
            f"{error.rms:.3g} rms",
        )  # fmt: skip
    if run.robot.nu:
        transport = cost_of_transport(run, motion=motion)
        yield Measure(
            "cost of transport",
            transport.absolute,
            "",
            f"{transport.positive:.3g} of positive work",
        )
        yield from measure_power(run)


def measure_power(run: AnyRun) -> Iterator[Measure]:
    """Measure the mechanical power of all motors of a run, of some duration, together."""
    held, power = np.diff(run.time), np.abs(actuator_power(run)).sum(axis=1)
    if held.sum() > 0.0:
        at = int(power.argmax())
        yield Measure(
            "mechanical power, mean of all motors", float(held @ power / held.sum()), "W",
            f"{power[at]:.4g} W at most, at {run.time[at]:.3f} s",
        )  # fmt: skip


def _repetition(run: Run, rows: Integers) -> Iterator[Measure]:
    """How much the states after touchdowns differ from those two steps before."""
    state = np.hstack((run.position[rows, 1:], run.velocity[rows]))  # but where it is
    if len(state) > 4:
        size = np.abs(state[3:] - state[1:-2]).max(axis=1)
        yield Measure(
            "change of a state after two steps, last", float(size[-1]), "rad, rad/s",
            f"{size[0]:.3g} at first; a walk that repeats has none",
        )  # fmt: skip


def _clearance(run: Run) -> Iterator[Measure]:
    lowest, when, who = np.inf, np.nan, ""
    found = stances(run)
    for foot, each in enumerate(run.robot.feet):
        own = [stance for stance in found if stance.foot == foot]
        for before, after in pairwise(own):
            swing = after.touchdown - before.liftoff
            if swing < STEPPED:
                continue
            begin, end = (before.liftoff + part * swing for part in MID_SWING)
            inside = np.flatnonzero((run.time >= begin) & (run.time <= end))
            if not len(inside):
                continue
            gaps = run.gap[inside][:, list(each.contacts)].min(axis=1)
            if gaps.min() < lowest:
                lowest, when = float(gaps.min()), float(run.time[inside[int(gaps.argmin())]])
                who = each.name.replace("_", " ")
    if np.isfinite(lowest):
        yield Measure(
            "clearance of the swing foot, least", 1e3 * lowest, "mm",
            f"{who} at {when:.3f} s, in the middle of its swing",
        )  # fmt: skip
