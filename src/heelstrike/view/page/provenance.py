"""Where a result comes from: versions, inputs, the command that makes it again."""

from __future__ import annotations

import math
import os
import platform
import shlex
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

import numpy as np

import heelstrike
from heelstrike.contact.ground import Ground
from heelstrike.gait.gait import Gait
from heelstrike.robot.robot import Robot
from heelstrike.sim.files.settings import settings
from heelstrike.sim.run import Run
from heelstrike.sim.setting import model_digest
from heelstrike.sim.spatial.run import SpatialRun

COMPUTING = ("numpy", "numba", "llvmlite")
"""Packages whose versions decide about the last digits of a run."""


def provenance(run: Run, gait: Gait | None = None, *, command: str = "") -> dict[str, str]:
    """Say where a run comes from, label by label.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait it followed.
    command : str
        The command that made it, if one did.
    """
    found = {"command": command} if command else {}
    found |= versions()
    found |= {
        "robot": _robot(run.robot),
        "ground": ground_in_words(run.ground),
        "method": method_in_words(run),
    }
    if gait is not None:
        found["gait"] = (
            f"{gait.step_length:g} m in {gait.step_duration:g} s a step, stance first on "
            f"{run.robot.feet[gait.stance_foot].name.replace('_', ' ')}"
        )
    if run.pushes:
        found["pushes"] = "; ".join(repr(push) for push in run.pushes)
    if len(run.time):
        found["initial positions (m, rad)"] = _numbers(run.robot, run.position[0].tolist())
        found["initial velocities (m/s, rad/s)"] = _numbers(run.robot, run.velocity[0].tolist())
        found["record"] = (
            f"{run.steps} steps, {len(run.time)} rows from {run.time[0]:.6g} s to "
            f"{run.time[-1]:.6g} s, {len(run.events)} events"
        )
    return found


def versions() -> dict[str, str]:
    """Say when a page is written, and by what, label by label."""
    packages = ", ".join(f"{name} {_version(name)}" for name in COMPUTING)
    return {
        # A run from a file may have been computed with others, which it does not tell.
        "page written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "by": f"heelstrike {heelstrike.__version__} with {packages}, Python "
        f"{platform.python_version()}, {platform.system()} {platform.machine()}",
    }


def command_line(words: Sequence[str]) -> str:
    """Write a command as the shell of this system takes it."""
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)


def ground_in_words(ground: Ground) -> str:
    """Describe a ground: its shape, friction and restitution."""
    corners = ground.model().vertices
    if ground.shape is not None:
        shape = f"smooth, {ground.shape}"
    elif ground.profile is None:
        degrees = math.degrees(ground.slope)
        shape = f"slope of {degrees:.4g}°" if degrees else "flat"
    else:
        heights = corners[:, 1]
        shape = (
            f"{len(corners)} corners from x = {corners[0, 0]:.4g} m to {corners[-1, 0]:.4g} m, "
            f"{heights.min():.4g} m to {heights.max():.4g} m high"
        )
    model = ground.model()
    return f"{shape}, friction {_span(model.friction)}, restitution {_span(model.restitution)}"


def _span(values: np.ndarray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _robot(robot: Robot) -> str:
    return (
        f"{robot.name}, {robot.total_mass:.6g} kg, {robot.nv} coordinates, {robot.nu} actuators, "
        f"{robot.nc} contact points; numbers {model_digest(robot.model)}"
    )


def method_in_words(run: Run | SpatialRun) -> str:
    """Say by which method a run was simulated, with its settings."""
    found = settings("", run.method)
    return f"{run.method.name}: " + ", ".join(
        f"{name.strip('_').replace('_', ' ')} {value}" for name, value in found.items()
    )


def _numbers(robot: Robot, values: Sequence[float]) -> str:
    return ", ".join(
        f"{name} {value!r}" for name, value in zip(robot.joint_names, values, strict=True)
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
