"""Where a benchmark ran: machine, versions, and which other engines are there."""

from __future__ import annotations

import importlib.util
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

# Engine -> (module, distribution).
ENGINES = {
    "mujoco": ("mujoco", "mujoco"),
    "drake": ("pydrake", "drake"),
    "pinocchio": ("pinocchio", "pin"),
    "bullet": ("pybullet", "pybullet"),
    "dart": ("dartpy", "dartpy"),
    "siconos": ("siconos", "siconos"),
}
COMPARED = ("mujoco",)
"""Engines that the suite knows how to run."""

NOT_INSTALLED = "not installed"


def peers() -> dict[str, str]:
    """Engines by name, each with its version or why it is not compared with."""
    return {name: _state(name, *where) for name, where in ENGINES.items()}


def _state(name: str, module: str, distribution: str) -> str:
    if importlib.util.find_spec(module) is None:
        return NOT_INSTALLED
    found = _version(distribution)
    return found if name in COMPARED else f"{found}, but this suite cannot run it"


def compared(found: dict[str, str]) -> list[str]:
    """Names of the peers that can be run."""
    return [name for name in COMPARED if found[name] != NOT_INSTALLED]


def machine() -> dict[str, Any]:
    """Processor, system and versions."""
    from heelstrike import __version__

    return {
        "processor": _processor(),
        "processors": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {
            "heelstrike": __version__,
            **{name: _version(name) for name in ("numpy", "numba", "llvmlite")},
        },
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown version"
