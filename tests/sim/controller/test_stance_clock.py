"""Which foot stands, since when: at given sequences of contact forces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import controlled_robot
from heelstrike.sim.controller.stance_clock import (
    LANDED_SPEED,
    STEEP,
    StanceClock,
    exchange_at_touchdown,
    has_landed,
)

EARLIEST = 0.35
HEEL, TOE, OTHER_HEEL, OTHER_TOE = range(4)
"""Contact points of bravo7, foot by foot."""


def contacts(*pressed: int, normal: tuple[float, float] = (0.0, 1.0)) -> Contacts:
    """Forces of 100 N on these points, on ground of this normal."""
    force = np.zeros((4, 2))
    force[list(pressed), 0] = 100.0
    return Contacts(
        position=np.zeros((4, 2)), normal=np.tile(normal, (4, 1)), gap=np.zeros(4), force=force
    )


def clocked(*instants: tuple[float, tuple[int, ...]]) -> list[tuple[int, float]]:
    """Foot and beginning of its step at each instant, by time since the step began."""
    robot, clock = controlled_robot(walking.bravo7()), StanceClock.allocate(landed=1)
    told = []
    for t, pressed in instants:
        clock.landed = 1
        seen = contacts(*pressed)
        begun = exchange_at_touchdown(t, t - clock.start, EARLIEST, seen, robot.contact_foot, clock)
        assert clock.landed == int(not begun)  # its impact is not over yet
        told.append((clock.stance, clock.start))
    return told


def test_the_points_are_those_of_two_feet() -> None:
    feet = walking.bravo7().feet
    assert [foot.contacts for foot in feet] == [(HEEL, TOE), (OTHER_HEEL, OTHER_TOE)]


def test_a_swing_foot_takes_over_with_either_end() -> None:
    for end in (OTHER_HEEL, OTHER_TOE):
        assert clocked((0.2, (HEEL, TOE)), (0.7, (HEEL, TOE, end))) == [(0, 0.0), (1, 0.7)]


def test_before_its_time_it_scuffs_and_from_then_on_it_lands() -> None:
    late = np.nextafter(EARLIEST, 0.0)
    assert clocked((late, (OTHER_TOE,)), (EARLIEST, (OTHER_TOE,))) == [(0, 0.0), (1, EARLIEST)]


def test_a_foot_that_bounces_is_in_the_step_that_it_began() -> None:
    sequence = [(0.7, (OTHER_HEEL,)), (0.702, ()), (0.71, (OTHER_HEEL, OTHER_TOE)), (0.72, ())]
    assert clocked(*sequence) == [(1, 0.7)] * 4


def test_when_both_feet_land_at_the_same_instant_the_swing_foot_stands() -> None:
    """And only one step has begun: the other foot scuffs until its time has come."""
    both = (HEEL, TOE, OTHER_HEEL, OTHER_TOE)
    found = clocked((0.6, ()), (0.7, both), (0.701, both), (1.04, both), (1.06, both))
    assert found == [(0, 0.0), (1, 0.7), (1, 0.7), (1, 0.7), (0, 1.06)]


def test_in_flight_and_on_the_stance_foot_nothing_changes() -> None:
    assert clocked((0.7, ()), (1.4, (HEEL, TOE)), (2.1, ())) == [(0, 0.0)] * 3


def test_a_wall_is_not_stood_upon() -> None:
    robot, clock = controlled_robot(walking.bravo7()), StanceClock.allocate()
    for height, stands in ((STEEP - 0.01, False), (STEEP + 0.01, True)):
        normal = (-float(np.sqrt(1.0 - height**2)), height)
        seen = contacts(OTHER_TOE, normal=normal)
        assert exchange_at_touchdown(1.0, 1.0, 0.5, seen, robot.contact_foot, clock) is stands


def turning_about(point: int, rate: float) -> tuple[Any, Any, Contacts]:
    """Bravo7 as one body about a contact point: view, state and contacts."""
    robot = walking.bravo7()
    state = robot.reference_state()
    view = controlled_robot(robot)
    at = view.estimate
    at.q[:] = state.q
    view.update(at)
    from heelstrike.dynamics import contact_positions

    places = contact_positions(robot, state.q) - [0.0, robot.model.contact_radius[0]]
    pivot = places[point]
    # About +y: a point ahead of the pivot goes down.
    at.v[:3] = rate * (state.q[1] - pivot[1]), -rate * (state.q[0] - pivot[0]), rate
    view.update(at)
    seen = Contacts(
        position=places, normal=np.tile((0.0, 1.0), (4, 1)), gap=np.zeros(4), force=np.zeros((4, 2))
    )
    return view, at, seen


def test_a_foot_on_its_heel_has_not_landed_until_the_toe_is_slow() -> None:
    """The toe comes down at rate times the length of the sole."""
    length = float(np.ptp(turning_about(HEEL, 0.0)[2].position[:2, 0]))
    assert length == pytest.approx(0.2)
    for speed, landed in ((1.01 * LANDED_SPEED, False), (0.99 * LANDED_SPEED, True)):
        view, at, seen = turning_about(HEEL, speed / length)
        velocity = np.zeros(2)
        view.contact_velocity(at, seen, TOE, velocity)
        assert velocity[0] == pytest.approx(-speed)
        clock = StanceClock.allocate(start=1.0)
        assert has_landed(1.001, 0.014, at, seen, view, clock) is landed
        assert clock.landed == int(landed)


def test_what_has_landed_stays_so_and_waiting_has_an_end() -> None:
    view, at, seen = turning_about(HEEL, 1.0)
    clock = StanceClock.allocate(start=1.0)
    assert has_landed(1.0139, 0.014, at, seen, view, clock) is False
    assert has_landed(1.0141, 0.014, at, seen, view, clock) is True
    clock = StanceClock.allocate(start=1.0, landed=1)
    assert has_landed(1.001, 0.014, at, seen, view, clock) is True
