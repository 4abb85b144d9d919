"""What compliant ground writes into the record of a simulation."""

from __future__ import annotations

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.compliant.method import row_at
from heelstrike.sim.record.record import allocate_record


def test_a_row_is_found_by_its_time_in_the_record_that_has_it() -> None:
    """What acts until the next sample is written over the row of this one, and of no other."""
    record, find = allocate_record(mechanisms.point(), 3, 4, 0), uncompiled(row_at)
    assert find(0.0, record) == -1  # it has just begun
    record.time[:], record.rows = (0.1, 0.2, 0.3), 2
    assert find(0.2, record) == 1
    assert find(0.3, record) == -1
    assert find(0.1, record) == -1  # rows before the last are finished


def test_rows_that_are_seldom_tell_the_mean_until_the_next_sample() -> None:
    """Every second sample, and after a simulation was taken up again with a record of its own."""
    robot = mechanisms.point(mass=2.0)
    x = robot.reference_state().vector.copy()
    x[1] += 1e-3 - hs.contact_kinematics(robot, x[:2], x[2:]).gap[0]
    x[3] = -0.5
    asked = {"method": hs.Compliant(), "stop_when_fallen": False}
    state = hs.State(x[:2], x[2:])
    every = hs.simulate(robot, state=state, duration=0.012, **asked)
    seldom = hs.simulate(robot, state=state, duration=0.012, record_every=2, **asked)
    shared = np.isin(every.time, seldom.time)
    np.testing.assert_array_equal(seldom.contact_force[:-1], every.contact_force[shared][:-1])
    first = hs.Simulation(robot, state=state, **asked)
    first.advance(0.005)
    again = hs.Simulation(robot, state=first.snapshot(), **asked)
    again.advance(0.012)
    rest = every.time >= again.record.time[0] - 1e-12
    np.testing.assert_array_equal(again.record.contact_force, every.contact_force[rest])
    weight = 2.0 * 9.81
    assert every.contact_force[-1, 0, 0] != pytest.approx(weight)  # it is still settling
