"""Contacts that go on as they did, without any solver."""

from __future__ import annotations

import heelstrike as hs

GENERAL = 0.2
"""Part of the steps that may take the general way; 0.8 did where poor pivots cost digits."""


def test_what_stands_straight_on_its_stops_takes_no_solver() -> None:
    """Knees straight and at their stops: of eight rows one nearly depends on those before it."""
    robot = hs.load_robot("walker2d")
    simulation = hs.Simulation(
        robot, state=robot.reference_state(), method=hs.TimeStepping(step=2e-3),
        ground=hs.Ground(friction=0.75), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(3.0)
    reduced, steps = simulation._memory.solver.reduced, 200
    general = 0
    for _ in range(steps):
        reduced.unknowns = 0  # the general way begins with them
        simulation.step()
        general += reduced.unknowns > 0
    assert abs(simulation.time - 3.4) < 1e-9
    assert general <= GENERAL * steps
