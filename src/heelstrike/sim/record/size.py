"""How large the record of a run would be, and whether there is room for it."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
from pathlib import Path

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.robot.robot import Robot
from heelstrike.sim.record.record import allocate_record
from heelstrike.sim.setting import Setting

MOST_STEPS = 2**53
"""Steps are counted, and times are whole multiples of a step, as long as they are exact."""
SHARE = 0.75
"""Part of the machine's memory that a record may take: the rest is the system's and ours."""
FEW_ROWS = 1024
ALWAYS_THERE = 2**28
"""Rows, and bytes, for which nobody is asked."""
BESIDE = 128
"""Rows besides those of the period: the first, the last, some of events."""

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Where Linux tells what a container may have."""


def check_steps(
    setting: Setting, duration: float, name: str, step: float, *, recorded: bool = True
) -> None:
    """Refuse a step so short that the steps of a run cannot be counted.

    Parameters
    ----------
    setting : Setting
        What is to be simulated.
    duration : float
        For how long, in s.
    name : str
        What the step is called where the user gave it.
    step : float
        Its length in seconds.
    recorded : bool
        Whether it is the steps that are recorded.

    Raises
    ------
    SimulationError
        With the shortest step that can be counted, and the `record_every` for it.
    """
    if duration / step <= MOST_STEPS:
        return
    shortest = _rounded_up(duration / MOST_STEPS * (1.0 + 1e-9))
    words = (
        f"{name} = {step:g} s is too short for {duration:g} s: {_count(duration / step)} steps, "
        f"where no more than {MOST_STEPS:.0e} can be counted. The shortest is {shortest:g} s"
    )
    if recorded:
        rows = _count(duration / step / setting.record_every)
        advice = _advice(duration / shortest, row_size(setting.robot), room())
        words += (
            f". The record would have {rows} rows, too, which no record_every mends; that of the "
            f"shortest fits into memory with {advice}"
        )
    raise SimulationError(words)


def check_room(setting: Setting, duration: float, name: str, period: float) -> None:
    """Refuse a run whose record does not fit into memory.

    Parameters
    ----------
    setting : Setting
        What is to be simulated.
    duration : float
        For how long, in s.
    name : str
        What `period` is called where the user gave it.
    period : float
        Seconds between two rows if `record_every` were one.

    Raises
    ------
    SimulationError
        With the rows it would have, and a `record_every` that fits.
    """
    periods = duration / period
    rows = periods / setting.record_every + BESIDE
    if rows <= FEW_ROWS:
        return
    size = row_size(setting.robot)
    # At the end the pieces of the record are joined: every row is there twice.
    available = _missing(2.0 * rows * size)
    if available is not None:
        raise SimulationError(
            f"the record of {duration:g} s with {name} = {period:g} s and "
            f"record_every={setting.record_every} does not fit into memory: {_count(rows)} rows of "
            f"{size} bytes, {_gigabytes(2.0 * rows * size)} with room to join them, where a record "
            f"may take {_gigabytes(available)}. It fits with {_advice(periods, size, available)}"
        )


def check_runs(robot: Robot, rows: int, runs: int, record_every: int) -> None:
    """Refuse several recorded runs that do not fit into memory together.

    Parameters
    ----------
    robot : Robot
        A robot of the size of all.
    rows, runs : int
        Rows of all runs, and how many runs there are.
    record_every : int
        Steps between two rows.

    Raises
    ------
    SimulationError
        With the rows they would have, and a `record_every` that fits.
    """
    size = row_size(robot)
    available = _missing(rows * size)
    if available is None:
        return
    words = (
        f"the records of all runs do not fit into memory: {_count(rows)} rows of {size} bytes, "
        f"{_gigabytes(rows * size)}, where records may take {_gigabytes(available)}"
    )
    spare = available / size - BESIDE * runs
    if spare < 1.0:
        raise SimulationError(
            f"{words}. Simulate fewer runs at once, or keep final states only (record_every=None)"
        )
    enough = _rounded_up(record_every * rows / spare)
    raise SimulationError(
        f"{words}. They fit with record_every={enough:.0f}; or keep final states only "
        "(record_every=None)"
    )


def _missing(size: float) -> int | None:
    """Return what a record may take, if so many bytes are more than that."""
    available = ALWAYS_THERE if size <= ALWAYS_THERE else room()
    return available if size > available else None


def row_size(robot: Robot) -> int:
    """Bytes of one row of the record."""
    row = allocate_record(robot, 1, 0)
    return sum(values.nbytes for name, values in row.storage() if name != "cells")


def room() -> int:
    """Bytes that a record may take on this machine."""
    available = int(SHARE * machine_memory())
    while available > ALWAYS_THERE and not _is_granted(available):
        available = available * 3 // 4
    return available


def machine_memory() -> int:
    """Bytes of memory that this machine, or the container on it, has.

    All of it, used or not: whether a run may begin shall not depend on what else is running. Where
    nobody tells, as much as can be addressed.
    """
    sizes = [sys.maxsize]
    with contextlib.suppress(AttributeError, ValueError, OSError):
        sizes.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for place in _LIMITS:
        with contextlib.suppress(OSError, ValueError):  # "max" is no limit
            sizes.append(int(Path(place).read_text(encoding="ascii")))
    if sys.platform == "win32":
        sizes.append(_windows_memory())
    return min(size for size in sizes if size > 0)


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = [
        ("length", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        ("physical", ctypes.c_uint64),
        *((f"other_{i}", ctypes.c_uint64) for i in range(6)),
    ]


if sys.platform == "win32":

    def _windows_memory() -> int:
        status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
        ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
        return int(status.physical)


def _is_granted(size: int) -> bool:
    """Whether the system lets this process have so many bytes; none of them is touched."""
    try:
        np.empty(size, dtype=np.uint8)
    except MemoryError:
        return False
    return True


def _advice(periods: float, size: int, available: int) -> str:
    """Name a `record_every` with which the rows of so many periods fit."""
    rows = available / (2.0 * size) - BESIDE
    if rows < 1.0:
        return "no record_every: there is hardly any memory"
    enough = max(_rounded_up(periods / rows), 1.0)
    return f"record_every={enough:.0f} ({_count(periods / enough)} rows)"


def _rounded_up(value: float) -> float:
    """Round up to two digits; whole numbers stay whole."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    rounded = math.ceil(value / unit) * unit
    return math.ceil(rounded) if rounded >= 1.0 else rounded


def _count(value: float) -> str:
    if math.isinf(value):
        return "more than 1e308"
    return f"{value:.0f}" if value < 1e6 else f"{value:.2g}"


def _gigabytes(size: float) -> str:
    return f"{size / 1e9:.2g} GB"
