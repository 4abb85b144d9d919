"""Contact points of a simulation, looked at: the same as a query's, and nothing is changed."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.contact.queries.kinematics import contact_kinematics

GROUNDS = {
    "flat": hs.Ground(friction=0.6),
    "slope": hs.Ground(slope=0.2),
    "stairs": hs.Ground.stairs(rise=-0.1, tread=0.3, count=4),
}


def begun(name: str, ground: hs.Ground) -> hs.Simulation:
    robot = hs.load_robot(name)
    state = robot.placed(robot.reference_state(), ground)
    return hs.Simulation(robot, state=state, ground=ground, stop_when_fallen=False)


@pytest.mark.parametrize("name", ["bravo7", "rimless_wheel", "walker2d"])
@pytest.mark.parametrize("ground", GROUNDS)
def test_contacts_are_those_of_the_query_and_of_the_step_before(name: str, ground: str) -> None:
    simulation, unseen = (begun(name, GROUNDS[ground]) for _ in range(2))
    for _ in range(30):
        simulation.step()
        seen, state = simulation.contacts, simulation.state
        expected = contact_kinematics(simulation.robot, state.q, state.v, GROUNDS[ground])
        for member in ("position", "normal", "gap"):
            assert np.array_equal(getattr(seen, member), getattr(expected, member)), member
        unseen.step()
    assert np.array_equal(seen.force, unseen._memory.contacts.force)
    assert np.array_equal(simulation.state.q, unseen.state.q)
    seen.force[:] = seen.gap[:] = -1.0  # a copy
    assert not np.array_equal(simulation.contacts.gap, seen.gap)
    assert not np.array_equal(simulation.contacts.force, seen.force)
