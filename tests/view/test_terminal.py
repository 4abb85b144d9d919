"""Robots drawn in the dots of braille letters."""

from __future__ import annotations

import pytest

from heelstrike.robot import RobotBuilder, builtin_robots, load_robot
from heelstrike.view.terminal import terminal_drawing

GROUND = "▔"


def dots(drawing: str) -> int:
    return sum((ord(letter) - 0x2800).bit_count() for letter in drawing if letter > "\u2800")


@pytest.mark.parametrize("name", builtin_robots())
def test_the_library_fits_a_terminal(name: str) -> None:
    lines = terminal_drawing(load_robot(name), lines=20).splitlines()
    assert len(lines) in (21, 22)  # and one of them the ground
    assert set(lines[-1]) == {GROUND}
    assert max(map(len, lines)) <= 72
    assert len(lines[0].strip()) > 0


def test_lines_are_straight_and_whole() -> None:
    """A rod down and one across, each of 1 m: at 4 dots a line they have 4 n - 1 dots."""
    down = RobotBuilder("down")
    down.hinge("a", None, mass=1, inertia=1, center_of_mass=(0, -0.5))
    drawing = terminal_drawing(down.build(), lines=10)
    assert GROUND not in drawing  # it has no contact points
    assert [len(line) for line in drawing.splitlines()] == [1] * 10
    assert dots(drawing) == 40
    across = RobotBuilder("across")
    across.hinge("a", None, mass=1, inertia=1, center_of_mass=(0.5, 0))
    drawing = terminal_drawing(across.build(), lines=10)
    assert drawing.count("\n") == 0
    assert len(drawing) == 72
    assert dots(drawing) == 144


def test_a_robot_without_extent() -> None:
    point = RobotBuilder("point")
    point.slide("a", None, direction=(1, 0), mass=1)
    assert terminal_drawing(point.build()) == ""
