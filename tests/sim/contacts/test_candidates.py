"""Who is listed in a contact problem, with what rows, and who keeps what of its answer: by hand.

The robot has one entry or more of nearly every kind. Kernels run as plain Python here.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from every_row import ARM, DRY, HAND, HIP, KNEE, ROBOT, ROWS, STOPS, memory_of

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIP_FORWARD, STICK
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.sim.contacts import candidates
from heelstrike.sim.contacts.candidates import Listing
from heelstrike.sim.contacts.dry_friction import add_dry_force
from heelstrike.sim.contacts.rows import (
    BRAKE,
    CONSTRAINT,
    COUPLING,
    DRY_JOINT,
    LOOP,
    POINT,
    SECOND_FACE,
    STOP,
    is_of_ground,
    lay_out_rows,
    second_of,
)
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.memory import Memory


def listing_of(memory: Memory) -> Listing:
    entries = len(memory.rows.kind)
    assembly = memory.assembly
    return Listing(
        memory.rows.set, 0.1 * np.arange(entries), 100 + np.arange(entries), assembly.candidate,
        assembly.answer.mode, assembly.problem,
    )  # fmt: skip


def test_who_is_listed_brings_its_set_friction_and_mode() -> None:
    memory = memory_of()
    problem, its = memory.assembly.problem, listing_of(memory)
    add = uncompiled(candidates.list_candidate)
    assert add(1, 0, 2, its) == 0
    assert add(STOPS[2], 1, 1, its) == 2
    assert add(DRY[0], 2, 2, its) == 3
    assert problem.first[:4].tolist() == [0, 2, 3, 5]
    assert problem.set[:3].tolist() == [CONE, HALF_LINE, INTERVAL]
    np.testing.assert_allclose(problem.friction[:3], [0.1, 0.1 * STOPS[2], 0.1 * DRY[0]])
    assert its.candidate[:4].tolist() == [1, STOPS[2], DRY[0], 77]
    assert its.mode[:4].tolist() == [101, 100 + STOPS[2], 100 + DRY[0], 77]


def test_groups_are_noted_and_told_apart() -> None:
    assembly = memory_of().assembly
    note, there = uncompiled(candidates.note_group), uncompiled(candidates.are_there)
    assert note(POINT, 0, 2, assembly) == 2
    assert note(STOP, 2, 2, assembly) == 2
    assert (assembly.begin[POINT], assembly.until[POINT]) == (0, 2)
    assert (assembly.begin[STOP], assembly.until[STOP]) == (2, 2)
    assert there(POINT, assembly)
    assert not there(STOP, assembly)


def test_gaps_of_stops_are_the_way_to_them() -> None:
    memory = memory_of()
    q = np.zeros(ROBOT.nq)
    q[[HIP, KNEE, ARM]] = 0.4, 0.7, -1.0
    uncompiled(candidates.locate_stops)(q, memory.rows)
    np.testing.assert_allclose(memory.rows.gap[STOPS.start : STOPS.stop], [1.4, 2.7, -0.2, 4.0])
    assert np.isposinf(np.delete(memory.rows.gap, STOPS)).all()


@pytest.mark.parametrize("listed", [True, False])
def test_the_stop_of_an_engaged_latch_is_a_line_though_it_be_far(listed: bool) -> None:
    """Where it is no candidate it becomes one, with the rate at which its gap opens, and sticks."""
    memory = memory_of()
    its, problem = listing_of(memory), memory.assembly.problem
    add, hold = uncompiled(candidates.list_candidate), uncompiled(candidates.hold_latched)
    add(0, 0, 2, its)
    add(STOPS[2] if listed else STOPS[1], 1, 1, its)
    v, stop = np.arange(1.0, ROBOT.nv + 1.0), memory.rows.latch_stop
    assert hold(ROBOT.model, 2, v, stop, np.array([0]), its) == 2
    assert problem.set[:2].tolist() == [CONE, HALF_LINE]
    count = hold(ROBOT.model, 2, v, stop, np.array([1]), its)
    if listed:
        assert count == 2
        assert problem.set[:2].tolist() == [CONE, LINE]
        return
    assert count == 3
    assert problem.set[:3].tolist() == [CONE, HALF_LINE, LINE]
    assert problem.first[:4].tolist() == [0, 2, 3, 4]
    assert its.candidate[2] == STOPS[2]
    assert problem.free[3] == -v[KNEE]  # of the upper end
    assert its.mode[2] == STICK


def test_dry_joints_are_listed_while_anything_rubs() -> None:
    memory = memory_of()
    its, problem = listing_of(memory), memory.assembly.problem
    uncompiled(candidates.list_candidate)(0, 0, 2, its)
    v, breakaway = np.arange(1.0, ROBOT.nv + 1.0), np.zeros(ROBOT.nv)
    add = uncompiled(candidates.list_dry_joints)
    breakaway[HAND] = 2.0
    assert add(1, 0.01, v, breakaway, memory.rows, its) == 2
    assert its.candidate[1] == DRY[1]
    assert problem.first[:3].tolist() == [0, 2, 4]
    assert (problem.free[3], problem.bound[1]) == (v[HAND], 0.02)
    breakaway[ARM] = 0.3
    assert add(1, 0.01, v, breakaway, memory.rows, its) == 3
    assert its.candidate[1:3].tolist() == list(DRY)
    assert problem.free[[3, 5]].tolist() == [v[ARM], v[HAND]]
    np.testing.assert_allclose(problem.bound[1:3], [0.003, 0.02])


def test_rows_of_joints_are_units_and_no_normal_of_what_rubs() -> None:
    memory = memory_of()
    assembly, its = memory.assembly, listing_of(memory)
    add, note = uncompiled(candidates.list_candidate), uncompiled(candidates.note_group)
    for place, (entry, size) in enumerate(((0, 2), (STOPS[0], 1), (STOPS[2], 1), (DRY[1], 2))):
        add(entry, place, size, its)
    for kind, first, last in ((POINT, 0, 1), (STOP, 1, 3), (CONSTRAINT, 3, 3), (DRY_JOINT, 3, 4)):
        note(kind, first, last, assembly)
    uncompiled(candidates.write_joint_rows)(memory.rows, assembly)
    jacobian, unit = assembly.directions.jacobian, np.eye(ROBOT.nv)
    assert np.all(jacobian[:2] == 77.0)
    expected = [unit[HIP], -unit[KNEE], 0.0 * unit[0], unit[HAND]]
    np.testing.assert_array_equal(jacobian[2:6], expected)
    assert np.all(jacobian[6:] == 77.0)
    assert assembly.directions.leaf[1:4].tolist() == [HIP, KNEE, HAND]


def answered() -> Memory:
    """The answer of two candidates of each kind but one, over 10 ms: impulses 1, 2, 3, ... N s."""
    memory = memory_of()
    assembly, its = memory.assembly, listing_of(memory)
    add, note = uncompiled(candidates.list_candidate), uncompiled(candidates.note_group)
    second = int(ROWS.first[SECOND_FACE])
    order = (
        (POINT, [(1, 2)]), (STOP, [(STOPS[1], 1), (STOPS[2], 1), (STOPS[3], 1)]), (CONSTRAINT, []),
        (DRY_JOINT, [(DRY[0], 2), (DRY[1], 2)]), (SECOND_FACE, [(second + 1, 2)]),
        (LOOP, [(int(each), 1) for each in memory.loops.entry[:3]]),
    )  # fmt: skip
    place = 0
    for kind, those in order:
        begin = place
        for entry, size in those:
            add(entry, place, size, its)
            place += 1
        note(kind, begin, place, assembly)
    rows = int(assembly.problem.first[place])
    assembly.problem.count = place
    assembly.answer.impulse[:rows] = 1.0 + np.arange(rows)
    assembly.answer.velocity[:rows] = -1.0 - np.arange(rows)
    assembly.answer.mode[:place] = [SLIP_FORWARD, OPEN, STICK, STICK, 11, 12, 13, 14, 15, 16]
    return memory


def test_every_candidate_keeps_its_forces_and_the_others_have_none() -> None:
    memory = answered()
    contacts, reaction, loops = memory.contacts, memory.reaction, memory.loops
    for each in (
        contacts.force, reaction.slip, reaction.stop_torque, loops.loop_force, loops.coupling_force,
    ):  # fmt: skip
        each[:] = 55.0
    reaction.mode[:] = 55
    span = 0.01
    uncompiled(candidates.note_answer)(span, memory)
    np.testing.assert_allclose(contacts.force, [[0.0, 0.0], [100.0, 200.0]])
    assert reaction.slip.tolist() == [0.0, -2.0]
    torque = np.zeros(ROBOT.nv)
    torque[KNEE] = (3.0 - 4.0) / span
    torque[ARM] = -5.0 / span
    np.testing.assert_allclose(reaction.stop_torque, torque)
    np.testing.assert_allclose(reaction.friction_torque[[ARM, HAND]], [700.0, 900.0])
    np.testing.assert_allclose(memory.second_faces.force[1], [1000.0, 1100.0])
    np.testing.assert_allclose(loops.loop_force[0], [1200.0, 1300.0])
    np.testing.assert_allclose(loops.coupling_force, [1400.0])
    second = int(ROWS.first[SECOND_FACE])
    modes = reaction.mode
    assert modes[:2].tolist() == [OPEN, SLIP_FORWARD]
    assert modes[STOPS.start : STOPS.stop].tolist() == [OPEN, 0, 1, 1]
    assert modes[DRY.start : DRY.stop].tolist() == [11, 12]
    assert modes[second + 1] == 13


def test_one_stop_pushes_up_the_other_down() -> None:
    """Torques of both ends of one range add up, with their signs."""
    memory = answered()
    torque, mode = np.full(ROBOT.nv, 9.0), np.zeros(len(ROWS.kind), int)
    uncompiled(candidates.keep_stops)(
        0.5, memory.rows.owner, memory.rows.side, memory.assembly, torque, mode
    )
    assert torque[KNEE] == -2.0
    assert torque[ARM] == -10.0
    assert torque[HIP] == 0.0
    assert mode[STOPS.start : STOPS.stop].tolist() == [0, 0, 1, 1]


def outside(sets: list[int], components: list[int]) -> SimpleNamespace:
    """A table of constraints alone, three entries after two others."""
    jacobian = 1.0 + np.arange(len(sets) * 8).reshape(len(sets), 2, 4)
    return SimpleNamespace(
        set=np.array([CONE, CONE, *sets]), owner=np.array([0, 1, *range(len(sets))]),
        components=np.array([2, 2, *components]),
        first=np.full(9, 2), end=np.full(9, 2 + len(sets)), gap=np.full(2 + len(sets), 8.0),
        outside=SimpleNamespace(jacobian=jacobian, gap=0.1 * np.arange(6.0).reshape(3, 2)),
    )  # fmt: skip


def test_rows_of_constraints_from_outside_are_what_their_kernels_wrote() -> None:
    """Of an interval the only row is the one along which it rubs."""
    rows = outside([CONE, INTERVAL, HALF_LINE], [2, 2, 1])
    its, write = rows.outside.jacobian, uncompiled(candidates.write_own_rows)
    jacobian, leaf, first = np.full((7, 4), 77.0), np.full(4, 9), np.array([0, 1, 3, 5, 6])
    for place, entry in ((1, 2), (2, 3), (3, 4)):
        write(entry, place, rows, first, leaf, jacobian)
    np.testing.assert_array_equal(jacobian[1:3], its[0])
    np.testing.assert_array_equal(jacobian[3:5], [np.zeros(4), its[1, 0]])
    np.testing.assert_array_equal(jacobian[5], its[2, 0])
    assert np.all(jacobian[[0, 6]] == 77.0)
    assert leaf.tolist() == [9, -1, -1, -1]


def test_constraints_have_gaps_unless_they_rub() -> None:
    rows, wrote = outside([CONE, INTERVAL, HALF_LINE], [2, 2, 1]), []

    def write(own: int, *_: Any) -> None:
        wrote.append(own)

    find = uncompiled(candidates.find_constraints, replace={candidates.write_own: write})
    find(ROBOT.model, np.zeros(1), np.zeros(1), None, rows)
    assert wrote == [0, 1, 2]
    np.testing.assert_allclose(rows.gap, [8.0, 8.0, 0.0, 8.0, 0.4])


def test_forces_of_constraints_are_kept_by_their_rows() -> None:
    rows = outside([CONE, INTERVAL, HALF_LINE], [2, 2, 1])
    problem = SimpleNamespace(
        first=np.array([0, 2, 4, 5, 6]), set=np.array([CONE, INTERVAL, HALF_LINE, HALF_LINE])
    )
    answer = SimpleNamespace(impulse=np.arange(1.0, 8.0), mode=np.array([2, 1, 3, 1]))
    assembly = SimpleNamespace(
        problem=problem, answer=answer, candidate=np.array([2, 3, 4, 0]), begin=np.zeros(9, int),
        until=np.full(9, 3),
    )  # fmt: skip
    force, mode = np.full((3, 2), 9.0), np.zeros(5, int)
    uncompiled(candidates.keep_constraints)(0.5, rows, assembly, force, mode)
    np.testing.assert_allclose(force, [[2.0, 4.0], [8.0, 0.0], [10.0, 0.0]])
    assert mode.tolist() == [0, 0, 2, 1, 3]
    assembly.until[:] = 0
    uncompiled(candidates.keep_constraints)(0.5, rows, assembly, force, mode)
    assert not force.any()


def test_the_rate_of_a_row_is_its_product_with_the_velocity() -> None:
    its = outside([CONE, CONE], [2, 2]).outside
    v = np.array([1.0, -2.0, 0.5, 3.0])
    for own, component in np.ndindex(2, 2):
        assert uncompiled(rate_of)(own, component, v, its) == its.jacobian[own, component] @ v


def test_friction_of_joints_that_slide_is_against_them() -> None:
    slide, force = np.zeros(len(ROWS.kind)), np.ones(ROBOT.nv)
    slide[DRY[0]], slide[DRY[1]] = 1, -1
    limit = np.arange(1.0, ROBOT.nv + 1.0)
    uncompiled(add_dry_force)(slide, limit, ROWS, force)
    expected = np.ones(ROBOT.nv)
    expected[ARM] -= limit[ARM]
    expected[HAND] += limit[HAND]
    np.testing.assert_array_equal(force, expected)


def test_the_table_tells_points_their_second_faces_and_sizes() -> None:
    """Sides are those of stops alone; gaps begin infinite; cones and intervals have two rows."""
    second = int(ROWS.first[SECOND_FACE])
    ground = [0, 1, second, second + 1]
    found = [entry for entry in range(len(ROWS.kind)) if uncompiled(is_of_ground)(entry, ROWS)]
    assert found == ground
    assert [uncompiled(second_of)(point, ROWS) for point in range(2)] == ground[2:]
    side = np.ones(len(ROWS.kind))
    side[[STOPS[2], STOPS[3]]] = -1.0
    rows = lay_out_rows(ROBOT)
    np.testing.assert_array_equal(rows.side, side)
    assert np.isposinf(rows.gap).all()
    np.testing.assert_array_equal(rows.components, np.where(np.isin(rows.set, [0, 3]), 2, 1))
    np.testing.assert_array_equal(np.delete(rows.limit, STOPS), 0.0)
    assert [int(ROWS.end[kind] - ROWS.first[kind]) for kind in (COUPLING, BRAKE)] == [1, 2]
