"""Where a benchmark ran: machine and versions."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import heelstrike


def machine() -> dict[str, Any]:
    """Processor, system and versions."""
    packages = {name: version(name) for name in ("numpy", "numba", "llvmlite")}
    return {
        "processor": _processor(),
        "processors": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {"heelstrike": heelstrike.__version__, **packages},
    }


def words(about: dict[str, Any], peers: dict[str, str]) -> str:
    """Return all of it in words, with the engines that took part."""
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    return (
        f"{about['processor']} ({about['processors']} processors), {about['system']}, "
        f"Python {about['python']}, {versions}. "
        f"Peers: {'; '.join(f'{name} {state}' for name, state in peers.items())}."
    )


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
