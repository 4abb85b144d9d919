"""What holds a robot beside the ground, event by event and row by row: latches, brakes, loops.

Kernels run as plain Python here, on small made-up robots and tables.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mechanisms
import numpy as np
import pytest
from every_row import HAND, HIP, ROBOT, memory_of

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import STICK
from heelstrike.contact.sets import HALF_LINE, LINE, ImpulseSet
from heelstrike.robot import RobotBuilder
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts import brakes, latches, loops
from heelstrike.sim.contacts.constraint import Constraint, constrained, constraint_names
from heelstrike.sim.contacts.rows import BRAKE, COUPLING, LOOP, TIE, most_rows
from heelstrike.sim.memory import allocate_memory


def told_of(*events: tuple[EventKind, int]) -> SimpleNamespace:
    """A record of events, at 0.1, 0.2, 0.3, ... s, with room for more."""
    told = SimpleNamespace(
        events=len(events), event_time=np.zeros(12), event_kind=np.zeros(12, int),
        event_contact=np.zeros(12, int), event_impulse=np.full((12, 2), 9.0),
    )  # fmt: skip
    for place, (kind, who) in enumerate(events):
        told.event_time[place] = 0.1 * (place + 1)
        told.event_kind[place], told.event_contact[place] = int(kind), who
    return told


# Latches.

LATCHED: Any = SimpleNamespace(
    latch_joint=np.array([3, 4, 4]), latch_side=np.array([1, -1, 1]),
    latch_release=np.array([5, 6, 5]), contact_link=np.array([5, 6, 7]),
    lower=np.full(6, -1.0), upper=np.full(6, 2.0),
)  # fmt: skip
"""Joint 3 is held at its upper end, joint 4 at either; links 5, 6, 5 let them go."""


@pytest.mark.parametrize(
    ("joint", "q", "held"),
    [(3, 1.9, [1, 0, 0]), (3, -0.9, [0, 0, 0]), (4, -0.9, [0, 1, 0]), (4, 1.9, [0, 0, 1]),
     (4, 0.51, [0, 0, 1]), (4, 0.49, [0, 1, 0]), (2, 1.9, [0, 0, 0])],
)  # fmt: skip
def test_a_latch_engages_at_the_end_where_its_joint_is_stopped(
    joint: int, q: float, held: list[int]
) -> None:
    told = told_of((EventKind.TOUCHDOWN, joint), (EventKind.JOINT_STOP, joint))
    found = np.zeros(3, int)
    uncompiled(latches.engage)(LATCHED, 0, np.full(6, q), told, found)
    assert found.tolist() == held
    found[:] = 0
    uncompiled(latches.engage)(LATCHED, 2, np.full(6, q), told, found)
    assert found.tolist() == [0, 0, 0]  # an event of before


def test_latches_let_go_as_their_link_touches_down() -> None:
    """What is told in between is none of theirs; the release is an event of its own."""
    told = told_of(
        (EventKind.TOUCHDOWN, 1), (EventKind.JOINT_STOP, 0), (EventKind.TOUCHDOWN, 2),
        (EventKind.TOUCHDOWN, 0), (EventKind.TOUCHDOWN, 0),
    )  # fmt: skip
    held = np.array([1, 1, 0])
    uncompiled(latches.let_go)(LATCHED, 1, told, held)
    assert held.tolist() == [0, 1, 0]
    assert told.events == 6
    assert told.event_kind[5] == EventKind.JOINT_RELEASE
    assert (told.event_contact[5], told.event_time[5]) == (3, pytest.approx(0.4))
    assert told.event_impulse[5].tolist() == [0.0, 0.0]
    uncompiled(latches.let_go)(LATCHED, 0, told, held)
    assert held.tolist() == [0, 0, 0]
    assert (told.events, told.event_contact[6]) == (7, 4)
    assert told.event_time[6] == pytest.approx(0.1)


def test_a_knee_that_stops_as_its_foot_comes_down_lets_go_at_once() -> None:
    told, held = told_of((EventKind.TOUCHDOWN, 0), (EventKind.JOINT_STOP, 3)), np.zeros(3, int)
    uncompiled(latches.react)(LATCHED, 0, np.full(6, 1.9), told, held)
    assert held.tolist() == [0, 0, 0]
    assert told.events == 3
    told, held = told_of((EventKind.JOINT_STOP, 3)), np.zeros(3, int)
    uncompiled(latches.react)(LATCHED, 1, np.full(6, 1.9), told, held)
    assert held.tolist() == [0, 0, 0]  # nothing new
    uncompiled(latches.react)(LATCHED, 0, np.full(6, 1.9), told, held)
    assert held.tolist() == [1, 0, 0]


def test_stops_of_engaged_latches_become_lines_and_the_last_that_is_missing_is_told() -> None:
    stop, candidate = np.array([7, 9, 8]), np.array([2, 9, 7, 8])
    for held, lines, missing in (
        ([0, 0, 0], [], -1), ([1, 0, 0], [2], -1), ([0, 1, 0], [1], -1), ([1, 1, 1], [1, 2], 2)
    ):  # fmt: skip
        sets = np.full(4, HALF_LINE)
        found = uncompiled(latches.hold)(3, stop, np.array(held), candidate, sets)
        assert found == missing
        assert np.flatnonzero(sets == LINE).tolist() == lines


def latched_pair() -> hs.Robot:
    """A knee with a latch at its upper end, 0.5, which the foot, above the ground, lets go."""
    build = RobotBuilder("pair")
    trunk = build.floating_base("trunk", (0.0, 1.5), mass=1.0, inertia=0.1)
    knee = build.hinge("knee", trunk, mass=1.0, inertia=0.1, limits=(-0.5, 0.5))
    foot = build.hinge("foot", trunk, mass=1.0, inertia=0.1, limits=(-0.5, 0.5))
    build.contact(foot, (0.0, -1.0))
    build.contact(knee, (0.0, 0.2))
    build.latch("knee", "upper", release="foot")
    build.latch("foot", "lower", release="knee")
    return build.build()


def test_which_latches_are_engaged_in_a_state() -> None:
    """Those that rest at their end, unless what lets them go stands; others only if they can be."""
    robot, ground = latched_pair(), hs.Ground()
    at, find = np.array([0.0, 1.5, 0.0, 0.5, -0.5]), latches.latches_at

    def state(q: np.ndarray = at, **v: float) -> hs.State:
        rate = np.zeros(5)
        for name, value in v.items():
            rate[robot.joint_index(name)] = value
        return hs.State(q, rate)

    assert find(robot, state(), ground, None) == (True, True)
    assert find(robot, state(knee=1e-3), ground, None) == (False, True)
    assert find(robot, state(at - 2e-6 * np.eye(5)[3]), ground, None) == (False, True)
    assert find(robot, state(at - 5e-7 * np.eye(5)[3]), ground, None) == (True, True)
    assert find(robot, state(-at * [0, -1, 0, 1, 1]), ground, None) == (False, False)
    gap = hs.contact_kinematics(robot, at, np.zeros(5)).gap.min()
    stands = at - gap * np.eye(5)[1]
    assert find(robot, state(stands), ground, None) == (False, True)
    moving = np.eye(5)[1] * 1e-3
    assert find(robot, hs.State(stands, moving), ground, None) == (True, True)
    assert find(robot, state(), ground, ("knee",)) == (True, False)
    assert find(robot, state(), ground, ()) == (False, False)
    assert find(robot, state(knee=1e-3), ground, ("knee", "foot")) == (True, True)
    with pytest.raises(hs.SimulationError, match=r"'knee' holds it at 0.5, .* it is at 0.4"):
        find(robot, state(at - 0.1 * np.eye(5)[3]), ground, ("knee",))
    with pytest.raises(hs.SimulationError, match=r"'foot' holds it at -0.5, .* it is at -0.4"):
        find(robot, state(at + 0.1 * np.eye(5)[4]), ground, ("knee", "foot"))
    with pytest.raises(hs.SimulationError, match=r"'root_pitch' .* has no latch; knee, foot has"):
        find(robot, state(), ground, (2,))
    assert find(mechanisms.point(), hs.State(np.zeros(2), np.zeros(2)), ground, None) == ()


def test_one_joint_may_be_given_by_itself() -> None:
    assert latches.is_one("knee")
    assert latches.is_one(3)
    assert latches.is_one(np.array(3))
    assert not latches.is_one(np.array([3]))
    assert not latches.is_one(["knee"])
    assert latches.several("latched", "knee") == ("knee",)
    assert latches.several("latched", ["knee"]) == ["knee"]
    for wrong in (None, 3.5):
        with pytest.raises(hs.SimulationError, match="latched must be names of joints, got"):
            latches.several("latched", wrong)


# Brakes.

BRAKED: Any = SimpleNamespace(
    brake_joint=np.array([2, 0, 1]), brake_limit=np.array([np.inf, 2.0, np.inf]),
    dry_friction=np.array([0.5, 0.0, 0.0]),
)  # fmt: skip
"""The brake of joint 0 slips at 2 N m, where the joint has 0.5 N m of its own."""


def test_brakes_that_are_put_on_take_hold() -> None:
    awaits, take = uncompiled(brakes.awaits_hold), uncompiled(brakes.take_hold)
    braked = np.array([loops.PUT_ON, loops.PUT_ON, loops.HOLDS])
    assert awaits(braked)
    assert take(BRAKED, braked)
    assert braked.tolist() == [loops.TAKES_HOLD, loops.BEGINS_TO_RUB, loops.HOLDS]
    assert not awaits(braked)
    braked = np.array([loops.HOLDS, loops.PUT_ON, loops.OFF])
    assert not take(BRAKED, braked)  # one that slips stops nothing at once
    assert braked.tolist() == [loops.HOLDS, loops.BEGINS_TO_RUB, loops.OFF]
    assert not awaits(np.array([loops.OFF, loops.RUBS, loops.HOLDS]))


def test_brakes_stop_what_is_faster_than_rest() -> None:
    stops, v = uncompiled(brakes.stops_any), np.array([5.0, 5.0, -0.2])
    braked = np.array([loops.TAKES_HOLD, loops.OFF, loops.HOLDS])
    assert stops(BRAKED, v, 0.1, braked)
    assert not stops(BRAKED, v, 0.2, braked)
    assert not stops(BRAKED, v, 0.1, np.array([loops.HOLDS, loops.RUBS, loops.PUT_ON]))


def test_brakes_are_told_of_once_with_what_they_took() -> None:
    braked = np.array([loops.HOLDS, loops.BEGINS_TO_RUB, loops.TAKES_HOLD])
    told = told_of()
    note = uncompiled(brakes.note_brakes)
    note(BRAKED, 0.7, 0.01, np.array([10.0, 20.0, 30.0]), told, braked)
    assert braked.tolist() == [loops.HOLDS, loops.RUBS, loops.HOLDS]
    assert told.events == 2
    assert told.event_kind[:2].tolist() == [EventKind.JOINT_BRAKE] * 2
    assert told.event_contact[:2].tolist() == [0, 1]
    np.testing.assert_allclose(told.event_impulse[:2], [[0.0, 0.0], [0.3, 0.0]])
    assert told.event_time[:2].tolist() == [0.7, 0.7]
    note(BRAKED, 0.8, 0.01, np.zeros(3), told, braked)
    assert told.events == 2


def test_a_slipping_brake_has_its_part_of_the_friction() -> None:
    """2 of 2.5 N m, in the ratio of what there may be; without any breakaway there is none."""
    share = uncompiled(brakes.share_friction)
    friction, torque = np.array([1.5, 7.0, 8.0]), np.array([3.0, 9.0, 4.0])
    share(BRAKED, np.array([2.5, 0.0, 0.0]), friction, torque)
    np.testing.assert_allclose(friction, [0.3, 7.0, 8.0])
    np.testing.assert_allclose(torque, [3.0, 1.2, 4.0])
    share(BRAKED, np.zeros(3), friction, torque)
    np.testing.assert_allclose(friction, [0.3, 7.0, 8.0])
    np.testing.assert_allclose(torque, [3.0, 0.0, 4.0])


def test_where_brakes_take_hold_a_loop_has_no_velocity_to_turn_with() -> None:
    memory = memory_of()
    its, found = memory.loops, []

    def write(*_: Any) -> None:
        found.append(its.braked.tolist())
        its.rows.bias[:] = 3.0

    find = uncompiled(brakes.find_loops_of_step, replace={brakes.find_loops: write})
    for braked, bias, then in (
        ([loops.PUT_ON, loops.OFF], 0.0, [loops.TAKES_HOLD, loops.OFF]),
        ([loops.HOLDS, loops.PUT_ON], 3.0, [loops.HOLDS, loops.BEGINS_TO_RUB]),
    ):
        its.braked[:] = braked
        find(ROBOT.model, memory.q, memory.v, memory.equations.tree, its)
        assert found[-1] == then
        assert len(its.rows.bias) >= 3
        assert np.all(its.rows.bias == bias)


def test_brakes_are_put_on_where_their_joints_are() -> None:
    """One that slips adds to the dry friction of its joint; what is let go leaves no force."""
    memory = memory_of()
    its, state = memory.loops, hs.State(np.arange(ROBOT.nq) * 0.1, np.zeros(ROBOT.nv))
    own = ROBOT.model.dry_friction[HAND]
    assert brakes.brakes_of(ROBOT, "hand") == (False, True)
    assert brakes.brakes_of(ROBOT, ("hip", HAND)) == (True, True)
    assert brakes.brakes_of(ROBOT, ()) == (False, False)
    brakes.put_on(ROBOT, (True, True), state, loops.PUT_ON, memory)
    assert its.braked.tolist() == [loops.PUT_ON, loops.PUT_ON]
    np.testing.assert_allclose(its.brake_position, state.q[[HIP, HAND]])
    assert memory.breakaway[HAND] == own + 2.0
    assert brakes.brakes_on(its) == (True, True)
    assert brakes.braked_joints(ROBOT, its.braked) == ("hip", "hand")
    its.braked[:] = loops.HOLDS, loops.RUBS
    its.brake_force[:] = 4.0, 5.0
    memory.reaction.friction_torque[HAND] = 1.0
    memory.reported.resting[:] = 1
    moved = hs.State(state.q + 1.0, state.v)
    brakes.put_on(ROBOT, (True, False), moved, loops.PUT_ON, memory)
    assert its.braked.tolist() == [loops.HOLDS, loops.OFF]
    assert its.brake_force.tolist() == [4.0, 0.0]
    np.testing.assert_allclose(its.brake_position, state.q[[HIP, HAND]])  # as they were
    assert memory.breakaway[HAND] == own
    assert memory.reaction.friction_torque[HAND] == 0.0
    assert brakes.brakes_on(its) == (True, False)
    dry = slice(int(memory.rows.first[3]), int(memory.rows.end[3]))
    assert memory.reported.resting[dry].tolist() == [1, -1]  # that of the arm rubs anyway
    its.braked[:] = loops.OFF
    brakes.put_on(ROBOT, (True, True), state, loops.HOLDS, memory)  # as a simulation begins
    assert its.braked.tolist() == [loops.HOLDS, loops.RUBS]
    with pytest.raises(hs.SimulationError, match=r"'knee' .* has no brake; hip, hand has"):
        brakes.brakes_of(ROBOT, "knee")


# Loops.


def test_rows_are_those_of_loops_and_of_brakes_that_hold() -> None:
    memory = memory_of()
    its, count = memory.loops, uncompiled(loops.rows_of)
    assert len(its.unknown) == most_rows(ROBOT) == 5  # two of the loop, a coupling, two brakes
    for braked, rows in (
        ([loops.OFF, loops.OFF], 3), ([loops.TAKES_HOLD, loops.RUBS], 4),
        ([loops.HOLDS, loops.PUT_ON], 4), ([loops.HOLDS, loops.HOLDS], 5),
    ):  # fmt: skip
        its.braked[:] = braked
        assert count(its) == rows
    its.entry[:3] = [11, 13, 12]
    assert [uncompiled(loops.row_of)(entry, its) for entry in (13, 12, 11)] == [1, 2, 0]


def test_a_brake_that_holds_is_a_row_of_its_joint() -> None:
    memory = memory_of()
    its, find = memory.loops, uncompiled(loops.find_loops, replace={
        loops.find_rows: lambda *_: None, loops.leave_one: lambda *_: None,
        loops.call_at: lambda *_: None,
    })  # fmt: skip
    q = np.arange(ROBOT.nq) * 0.1
    its.braked[:], its.brake_position[:] = [loops.OFF, loops.HOLDS], [0.3, 0.2]
    its.rows.jacobian[:], its.rows.displacement[:] = 0.0, 9.0
    find(ROBOT.model, q, q, memory.equations.tree, its)
    first = int(memory.rows.first[BRAKE])
    assert its.entry[3] == first + 1
    np.testing.assert_array_equal(its.rows.jacobian[3], np.eye(ROBOT.nv)[HAND])
    assert its.rows.displacement[3] == pytest.approx(q[HAND] - 0.2)
    its.braked[0] = loops.TAKES_HOLD
    its.rows.jacobian[:] = 0.0
    find(ROBOT.model, q, q, memory.equations.tree, its)
    assert its.entry[3:5].tolist() == [first, first + 1]
    np.testing.assert_array_equal(its.rows.jacobian[3:5], np.eye(ROBOT.nv)[[HIP, HAND]])
    np.testing.assert_allclose(its.rows.displacement[3:5], [q[HIP] - 0.3, q[HAND] - 0.2])


@pytest.mark.parametrize("turned", [False, True])
def test_of_rows_that_are_multiples_the_shorter_goes(turned: bool) -> None:
    """By forces (3, 6) and (−1, −2) the same is done: the part is −1/3."""
    order = [1, 0] if turned else [0, 1]
    rows = np.array([[3.0, 6.0, 0.0], [-1.0, -2.0, 0.0]])[order]
    other = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1e-3]])
    longest = np.sqrt(45.0)
    nearly, hardly = (  # a part of the longer is missing; less than 1e-11 of it is nothing
        np.array([[3.0, 6.0, 0.0], [-1.0, -2.0, part * longest]])[order]
        for part in (5e-12, 1.5e-11)
    )
    for second in (rows, nearly, hardly, other[order]):
        jacobian = np.vstack((np.ones((2, 3)), second))
        its = SimpleNamespace(
            rows=SimpleNamespace(
                jacobian=jacobian.copy(), displacement=np.full(4, 5.0), bias=np.full(4, 6.0)
            ),
            multiple=np.full((2, 2), 9.0),
        )  # fmt: skip
        uncompiled(loops.leave_one)(1, its)
        if second is hardly or len(np.unique(second)) == len(np.unique(other)):
            np.testing.assert_array_equal(its.rows.jacobian, jacobian)
            assert its.multiple.tolist() == [[9.0, 9.0], [0.0, 0.0]]
            assert np.all(its.rows.bias == 6.0)
            continue
        gone = 2 if turned else 3
        jacobian[gone] = 0.0
        np.testing.assert_array_equal(its.rows.jacobian, jacobian)
        part = [0.0, 0.0]
        part[gone - 2] = pytest.approx(-1.0 / 3.0)
        assert its.multiple.tolist() == [[9.0, 9.0], part]
        for each, there in ((its.rows.displacement, 5.0), (its.rows.bias, 6.0)):
            expected = np.full(4, there)
            expected[gone] = 0.0
            np.testing.assert_array_equal(each, expected)


def test_rows_of_loops_are_appended_and_say_what_they_ask() -> None:
    """They stick, on a line, without friction; free terms are J x + t J̇ v."""
    memory = memory_of()
    its, assembly = memory.loops, memory.assembly
    draw = np.random.default_rng(3)
    its.rows.jacobian[:3], its.rows.bias[:3] = draw.normal(size=(3, ROBOT.nv)), [1.0, 2.0, 3.0]
    assembly.problem.first[:2] = 0, 2
    count = uncompiled(loops.append_loops)(1, its, assembly)
    assert count == 4
    first = assembly.problem.first
    assert np.diff(first[1:5]).tolist() == [1] * 3
    np.testing.assert_array_equal(assembly.directions.jacobian[2:5], its.rows.jacobian[:3])
    assert assembly.problem.set[1:4].tolist() == [LINE] * 3
    assert assembly.problem.friction[1:4].tolist() == [0.0] * 3
    assert assembly.directions.leaf[1:4].tolist() == [-1] * 3
    assert assembly.answer.mode[1:4].tolist() == [STICK] * 3
    assert assembly.candidate[1:4].tolist() == its.entry[:3].tolist()
    rate = draw.normal(size=ROBOT.nv)
    uncompiled(loops.free_loops)(4, its, rate, 0.5, assembly)
    expected = its.rows.jacobian[:3] @ rate + 0.5 * its.rows.bias[:3]
    np.testing.assert_allclose(assembly.problem.free[first[1:4]], expected, rtol=1e-13)
    assert np.all(assembly.problem.free[:2] == 77.0)


def test_forces_of_loops_are_kept_by_what_they_are_of() -> None:
    """Where one row of a loop is −1/3 of the other both have of its force 9/10 and −3/10."""
    table = SimpleNamespace(
        owner=np.array([0, 0, 1, 1, 2, 3, 1]), axis=np.array([0, 1, 0, 1, 0, 1, 0]),
        kind=np.array([LOOP, LOOP, LOOP, LOOP, COUPLING, TIE, BRAKE]),
    )  # fmt: skip
    its = SimpleNamespace(
        entry=np.arange(7), loop_force=np.zeros((2, 2)), coupling_force=np.zeros(3),
        constraint_force=np.zeros((4, 2)), brake_force=np.zeros(2), multiple=np.zeros((2, 2)),
        unknown=np.zeros(7), braked=np.array([loops.HOLDS, loops.HOLDS]),
    )  # fmt: skip
    first = np.array([0, 2, 3, 4, 5, 6, 7, 8, 9])
    impulse = np.array([99.0, 99.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    note = uncompiled(loops.note_loops)
    note(table, 8, 0.5, first, impulse, its)
    assert its.loop_force.tolist() == [[2.0, 4.0], [6.0, 8.0]]
    assert its.coupling_force.tolist() == [0.0, 0.0, 10.0]
    assert its.constraint_force[3].tolist() == [0.0, 12.0]
    assert its.brake_force.tolist() == [0.0, 14.0]
    for gone in range(2):
        its.multiple[1] = 0.0
        its.multiple[1, gone] = -1.0 / 3.0
        impulse[4 + gone], impulse[5 - gone] = 0.0, 10.0
        note(table, 8, 0.5, first, impulse, its)
        np.testing.assert_allclose(its.loop_force[1, [1 - gone, gone]], [18.0, -6.0])
        np.testing.assert_allclose(its.loop_force[0], [2.0, 4.0])


def test_loops_are_closed_and_steadied_along_the_shortest_way_by_the_masses() -> None:
    """A Lagrangian system solved with numpy: A p = Jᵀ λ, J p = −φ, with velocities J v = 0."""
    robot = mechanisms.four_bar()
    memory = allocate_memory(robot)
    memory.equations.programs[:] = 0  # by articulated bodies
    closed = robot.closed(robot.reference_state()).q
    q = closed + 1e-5 * np.array([1.0, -2.0, 3.0])
    mass, jacobian = hs.dynamics.mass_matrix(robot, q), hs.dynamics.loop_jacobian(robot, q)
    off = jacobian @ (q - closed)  # to first order
    way = -np.linalg.solve(mass, jacobian.T) @ np.linalg.solve(
        jacobian @ np.linalg.solve(mass, jacobian.T), off
    )
    found = q.copy()
    assert uncompiled(loops.close_loops)(robot.model, memory.equations, memory.loops, found)
    np.testing.assert_allclose(found, q + way, atol=1e-8)
    assert np.abs(memory.loops.rows.displacement).max() <= 1e-11
    v = np.array([1.0, 2.0, -1.0])
    steady = v.copy()
    uncompiled(loops.steady_loops)(robot.model, found, memory.equations, memory.loops, steady)
    mass, jacobian = hs.dynamics.mass_matrix(robot, found), hs.dynamics.loop_jacobian(robot, found)
    impulse = np.linalg.solve(jacobian @ np.linalg.solve(mass, jacobian.T), jacobian @ v)
    expected = v - np.linalg.solve(mass, jacobian.T) @ impulse
    np.testing.assert_allclose(steady, expected, atol=1e-12)
    far = closed + np.array([0.0, 3.0, 0.0])
    far[1:] *= 40.0  # nothing near closes them
    begins = uncompiled(loops.begin_closed, replace={
        loops.close_loops: lambda *_: False, loops.steady_loops: lambda *_: pytest.fail("steadied"),
    })  # fmt: skip
    assert not begins(robot.model, far, memory.equations, memory.loops, v)


# Constraints from outside that cannot be.


class Held(Constraint):
    """One whose kernel is never asked."""


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"set": ImpulseSet.CONE, "components": 1}, "components; a line has 1 or 2"),
        ({"set": ImpulseSet.HALF_LINE, "components": 2}, "components; a line has 1 or 2"),
        ({"set": ImpulseSet.LINE, "components": 3}, "components; a line has 1 or 2"),
        ({"set": ImpulseSet.INTERVAL, "components": 0}, "components; a line has 1 or 2"),
        ({"set": 7, "components": 1}, "components; a line has 1 or 2"),
        ({"restitution": 1.1}, "the restitution of constraint .* cannot be 1.1"),
        ({"restitution": -0.1}, "the restitution of constraint .* cannot be -0.1"),
        ({"friction": -0.1}, "the friction of constraint .* cannot be -0.1"),
        ({"friction": np.inf}, "the friction of constraint .* cannot be inf"),
        ({"bound": -1.0}, "the bound of constraint .* cannot be -1"),
        ({"bound": np.inf}, "the bound of constraint .* cannot be inf"),
        ({"bound": np.nan}, "the bound of constraint .* cannot be nan"),
    ],
)
def test_constraints_that_cannot_be_are_refused(settings: dict[str, Any], words: str) -> None:
    kind = type("Cable", (Held,), {**settings, "check": lambda _: None})
    with pytest.raises(hs.SimulationError, match=words):
        constrained(mechanisms.point(), kind())


def test_what_is_no_constraint_is_refused_and_those_that_are_have_names() -> None:
    wrong: Any = "cable"
    with pytest.raises(hs.SimulationError, match="derives from Constraint, got 'cable'"):
        constrained(mechanisms.point(), wrong)
    cable, wall = (type(name, (Held,), {})() for name in ("Cable", "Wall"))
    robot: Any = SimpleNamespace(constraints=(cable, wall, cable))
    assert constraint_names(robot) == ["Cable 1", "Wall", "Cable 2"]


def test_friction_of_constraints_is_that_of_cones_and_one_of_intervals() -> None:
    from heelstrike.sim.contacts.constraint import friction_of, line_rows

    kinds = [
        type("Held", (Held,), {"set": each, "components": size, "friction": 0.4})()
        for each, size in (
            (ImpulseSet.CONE, 2), (ImpulseSet.HALF_LINE, 1), (ImpulseSet.LINE, 2),
            (ImpulseSet.INTERVAL, 1), (ImpulseSet.LINE, 1),
        )
    ]  # fmt: skip
    assert [friction_of(each) for each in kinds] == [0.4, 0.0, 0.0, 1.0, 0.0]
    assert line_rows(SimpleNamespace(constraints=kinds)) == 3  # type: ignore[arg-type]


def test_what_loops_call_gives_a_kernel_its_numbers_and_places_to_write_to() -> None:
    asked: list[Any] = []
    write = Constraint._entry(lambda address: f"at {address}", lambda *given: asked.append(given))
    assert write(7, "model", "tree", "q", "v", "gap", "jacobian", "bias") == 0
    assert asked == [("at 7", "model", "tree", "q", "v", "gap", "jacobian", "bias")]
    numbers = type("Cable", (Held,), {"__dataclass_fields__": {}})().numbers(mechanisms.point())
    assert numbers == {}
