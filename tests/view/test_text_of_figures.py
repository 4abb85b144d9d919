"""All that is written on figures can be read; of walks and falls, test_figures asks."""

from __future__ import annotations

from typing import Any

import pytest
import walking
from figure_text import check_text
from matplotlib.figure import Figure
from synthetic_runs import make_run, pushes

import heelstrike as hs
from heelstrike.robot import builtin_robots
from heelstrike.sim.run import QUANTITIES
from heelstrike.view import drawing, plot, robot_picture
from heelstrike.view.style import label_powers, new_figure


@pytest.mark.parametrize("what", ["zmp", "friction", "forces", "gaps", "energy", "snapshots"])
def test_figures_of_a_walker_on_points(what: str) -> None:
    robot = hs.load_robot("compass_gait")
    run = make_run(robot, [0.0, 0.1], force=pushes(robot, [[0], [0]]))
    check_text(plot(run, what), names=True)


@pytest.mark.parametrize("name", QUANTITIES)
def test_recorded_quantities(name: str) -> None:
    run = walking.walk(steps=1)
    if getattr(run, name).size:
        check_text(plot(run, name))


@pytest.mark.parametrize("name", builtin_robots())
def test_portraits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(drawing, "save_figure", lambda figure, path: drawn.append(figure))
    options: dict[str, Any] = {}
    robot = hs.load_robot(name)
    if name == "bravo7":
        options["pushes"] = [hs.Push("trunk", force=(120.0, 0.0), start=0.3, duration=0.1)]
    robot_picture(robot, "portrait.png", **options)
    check_text(drawn[0], names=True)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(1e-7, 1e3, "10⁻³"), (1e-2, 1e3, "1"), (1.5e-4, 6e-4, "2×10⁻⁴"), (1e5, 1e6, "10⁵")],
)
def test_ticks_of_logarithmic_axes(low: float, high: float, expected: str) -> None:
    figure = new_figure(4.0, 3.0)
    axes = figure.add_subplot()
    axes.semilogy([0.0, 1.0], [low, high])
    axes.set(xlabel="time (s)", ylabel="energy (J)")
    label_powers(axes.yaxis)
    assert expected in check_text(figure)
