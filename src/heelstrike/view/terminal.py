"""What a terminal shows: tables, and a robot drawn in the dots of braille letters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table

from heelstrike.dynamics import link_poses
from heelstrike.robot.robot import Robot
from heelstrike.view.drawing import extent, legs_apart, skeleton

# Bit of each dot of a braille letter: four rows of two.
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_EMPTY = 0x2800
_ROWS, _COLUMNS = _BITS.shape
_WIDEST = 72  # letters


def bare_table(title: str, names: Sequence[str] = (), numbers: Iterable[str] = ()) -> Table:
    """Begin a table with a rule beneath its headings and nothing around it.

    Parameters
    ----------
    title : str
        Above it, to the left.
    names : sequence of str
        Headings of the first columns, whose cells are not broken.
    numbers : iterable of str
        Headings of the columns after them, to the right.

    Returns
    -------
    Table
        Without rows.
    """
    table = Table(
        title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0)
    )
    for heading in names:
        table.add_column(heading, no_wrap=True)
    for heading in numbers:
        table.add_column(heading, justify="right")
    return table


def terminal_drawing(robot: Robot, *, lines: int = 20) -> str:
    """Draw a robot with its legs apart as lines of braille letters, the ground below.

    Parameters
    ----------
    robot : Robot
        The robot.
    lines : int
        Height of the drawing in lines; the width follows.

    Returns
    -------
    str
        Lines; nothing for a robot without extent.
    """
    q = legs_apart(robot)
    poses = link_poses(robot, q)
    segments = skeleton(robot).segments(poses.origin, poses.angle)
    if not len(segments):
        return ""
    low, high = extent(segments)
    # A dot is about square: letters are twice as high as wide, and hold 4 x 2 dots.
    size = np.maximum(high - low, 1e-9)
    per_metre = min((_ROWS * lines - 1) / size[1], (_COLUMNS * _WIDEST - 1) / size[0])
    shape = np.ceil(size * per_metre).astype(int) + 1
    dots = np.zeros((-(-shape[1] // _ROWS) * _ROWS, -(-shape[0] // _COLUMNS) * _COLUMNS), bool)
    for start, end in segments:
        count = max(2, int(2 * np.hypot(*(end - start)) * per_metre))
        points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        x, z = np.rint((points - low) * per_metre).astype(int).T
        dots[np.clip(shape[1] - 1 - z, 0, len(dots) - 1), np.clip(x, 0, dots.shape[1] - 1)] = True
    text = _letters(dots)
    if robot.nc:
        text.append("▔" * (dots.shape[1] // _COLUMNS))
    return "\n".join(line.rstrip() for line in text)


def _letters(dots: NDArray[np.bool_]) -> list[str]:
    rows, columns = dots.shape[0] // _ROWS, dots.shape[1] // _COLUMNS
    blocks = dots.reshape(rows, _ROWS, columns, _COLUMNS).transpose(0, 2, 1, 3)
    codes = _EMPTY + (blocks * _BITS).sum(axis=(2, 3))
    return ["".join(map(chr, line)).replace(chr(_EMPTY), " ") for line in codes]
