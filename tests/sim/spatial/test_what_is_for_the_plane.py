"""What is for the plane says so where a robot in space comes, and how to get one of the plane."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

import heelstrike as hs


def test_what_is_for_the_plane_says_so(tmp_path: Path) -> None:
    robot = hs.load_robot("bravo7", dimension=3)
    with pytest.raises(hs.GaitError, match=r"for the plane: hs.load_robot\(file, dimension=2\)"):
        hs.optimize_gait(robot, step_length=0.3, step_duration=0.7)

    class Own(hs.Simulation):
        def __init__(self, robot: hs.Robot, more: int = 2) -> None:
            super().__init__(robot, state=robot.reference_state())

    assert list(inspect.signature(Own).parameters) == ["robot", "more"]
    with pytest.raises(hs.SimulationError, match="Own simulates robots in the plane"):
        Own(robot)  # type: ignore[arg-type]
    run = hs.simulate(robot, state=robot.reference_state(), duration=0.002)
    with pytest.raises(hs.RunFileError, match=r"a run in space.*xarray"):
        hs.load_run(run.save(tmp_path / "run.nc"))
