"""What is for the plane says so where a robot in space comes, and how to get one of the plane."""

from __future__ import annotations

import inspect

import pytest

import heelstrike as hs
from heelstrike.sim.spatial import SpatialSimulation


def test_what_is_for_the_plane_says_so() -> None:
    robot = hs.load_robot("bravo7", dimension=3)
    with pytest.raises(hs.GaitError, match=r"for the plane: hs.load_robot\(file, dimension=2\)"):
        hs.optimize_gait(robot, step_length=0.3, step_duration=0.7)


def test_a_simulation_of_ones_own_takes_robots_in_space() -> None:
    class Own(hs.Simulation):
        def __init__(self, robot: hs.SpatialRobot, more: int = 2) -> None:
            super().__init__(robot, state=robot.reference_state())

    assert list(inspect.signature(Own).parameters) == ["robot", "more"]
    robot = hs.load_robot("bravo7", dimension=3)
    assert Own(robot).step() is hs.RunStatus.COMPLETED
    with pytest.raises(hs.SimulationError, match="robot must be a SpatialRobot"):
        SpatialSimulation(hs.load_robot("bravo7"))


def test_the_help_of_simulations_in_space_tells_their_options() -> None:
    assert list(inspect.signature(SpatialSimulation).parameters) == list(
        inspect.signature(hs.Simulation).parameters
    )


def test_a_law_that_cannot_be_compiled_is_told_how_it_can_run() -> None:
    @hs.controller
    def opens(torque):  # type: ignore[no-untyped-def]
        open("file")  # noqa: SIM115, PTH123

    robot = hs.load_robot("bravo7", dimension=3)
    with pytest.raises(hs.ControllerError, match=r"@controller\(compile=False\) runs it in Python"):
        hs.Simulation(robot, opens(), state=robot.reference_state())
