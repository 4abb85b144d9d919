"""Contact problems of event-driven simulation: each candidate has as many rows as its set needs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.robot import Robot, RobotBuilder
from heelstrike.sim.contacts.brakes import HOLDS
from heelstrike.sim.contacts.geometry import evaluate_equations
from heelstrike.sim.contacts.loops import append_loops, find_loops
from heelstrike.sim.contacts.rows import DRY_JOINT, POINT, SECOND_FACE, STOP
from heelstrike.sim.event_driven.bridge import gather_near
from heelstrike.sim.event_driven.impact import list_hit
from heelstrike.sim.event_driven.phase import Motion, allocate_motion
from heelstrike.sim.event_driven.smooth.dynamics import list_closed, list_unknowns
from heelstrike.sim.event_driven.smooth.projection import list_sunk
from heelstrike.sim.event_driven.smooth.saddle_point import guess_modes, list_rows
from heelstrike.sim.memory import Memory, allocate_memory

ROWS = {POINT: 2, STOP: 1, DRY_JOINT: 2, SECOND_FACE: 2}


def robot_with_everything() -> Robot:
    """One contact point, three stops, a latch, a dry joint, a loop, a coupling and a brake."""
    build = RobotBuilder("everything")
    build.floating_base("trunk", mass=1.0, inertia=0.1)
    build.hinge("hip", "trunk", mass=1.0, inertia=0.1, limits=(-1.0, np.inf))
    build.hinge("knee", "hip", at=(0.0, -0.5), mass=1.0, inertia=0.1, limits=(-2.0, 0.5))
    build.hinge("arm", "trunk", mass=1.0, inertia=0.1, dry_friction=0.3)
    build.hinge("hand", "arm", at=(0.5, 0.0), mass=1.0, inertia=0.1)
    build.contact("knee", (0.0, -1.0))
    build.loop("hand", "trunk", at=(0.5, 0.0))
    build.couple("hand", "arm")
    build.latch("knee", "upper")
    build.brake("hip")
    return build.build()


def all_closed() -> tuple[Robot, Memory, Motion]:
    """The memory of a simulation in which all entries of the table hold, and the brake, too."""
    robot = robot_with_everything()
    memory, work = allocate_memory(robot), allocate_motion(robot)
    rows, modes = memory.rows, work.phase.modes
    modes.watched = rows.end[SECOND_FACE]
    for each in (modes.closed, modes.carrier):
        each[:] = 1
    modes.breakaway[:] = memory.breakaway
    memory.loops.braked[:] = HOLDS
    return robot, memory, work


def rows_of(count: int, memory: Memory) -> list[int]:
    first: list[int] = np.diff(memory.assembly.problem.first[: count + 1]).tolist()
    return first


def needed_by(count: int, memory: Memory) -> list[int]:
    kinds = memory.rows.kind[memory.assembly.candidate[:count]]
    return [ROWS[int(kind)] for kind in kinds]


def test_what_is_closed_has_the_rows_of_its_set() -> None:
    robot, memory, work = all_closed()
    assembly, loops = memory.assembly, memory.loops
    problem, tree = assembly.problem, memory.equations.tree
    count = uncompiled(list_closed)(
        memory.rows, work.phase.modes, assembly.candidate, problem.first, problem.bound
    )
    # A point on both faces, three stops and a dry joint; then two rows of the loop, the coupling
    # and the brake.
    assert rows_of(count, memory) == needed_by(count, memory) == [2, 1, 1, 1, 2, 2]
    find_loops(robot.model, memory.q, memory.v, tree, loops)
    total = uncompiled(append_loops)(count, loops, assembly)
    assert rows_of(total, memory)[count:] == [1, 1, 1, 1]
    assert problem.first[total] == 13  # once 20, with empty tangents


@pytest.mark.parametrize("closed", [1, 0], ids=["on the ground", "hit"])
def test_what_takes_part_in_an_impact_has_the_rows_of_its_set(closed: int) -> None:
    """Dry friction is a finite force and takes no part."""
    _, memory, work = all_closed()
    work.phase.modes.closed[:] = closed
    work.impact.hit[:] = 1 - closed
    assembly = memory.assembly
    count = uncompiled(list_hit)(
        memory.rows, work.phase.modes, work.impact.hit, assembly.candidate, assembly.problem.first
    )
    assert rows_of(count, memory) == needed_by(count, memory) == [2, 1, 1, 1, 2]


def test_what_is_put_back_on_its_limit_has_the_rows_of_its_set() -> None:
    _, memory, work = all_closed()
    work.phase.modes.closed[:] = 0
    memory.rows.gap[:] = -1e-9
    assembly = memory.assembly
    count = uncompiled(list_sunk)(
        0, memory.rows, work.phase.modes, work.phase.watch.fired, assembly.candidate,
        assembly.problem.first,
    )  # fmt: skip
    assert rows_of(count, memory) == needed_by(count, memory) == [2, 1, 1, 1]


def test_what_a_bridge_gathers_has_the_rows_of_its_set() -> None:
    robot, memory, work = all_closed()
    model, assembly, modes = robot.model, memory.assembly, work.phase.modes
    evaluate_equations(model, memory.q, memory.v, memory.equations)
    memory.rows.gap[:] = 0.0
    directions = assembly.directions
    count = uncompiled(gather_near)(
        1e-6, False, model, work.step.begin, work.bridge.free_end, memory.equations.rate,
        memory.surface.restitution, memory.equations.tree, memory.rows, modes, assembly.candidate,
        directions.leaf, directions.jacobian, assembly.problem, work.bridge.added,
    )  # fmt: skip
    assert rows_of(count, memory) == needed_by(count, memory) == [2, 1, 1, 1, 2, 2]


def listed() -> tuple[int, Memory, Motion]:
    _, memory, work = all_closed()
    assembly = memory.assembly
    problem = assembly.problem
    count = uncompiled(list_closed)(
        memory.rows, work.phase.modes, assembly.candidate, problem.first, problem.bound
    )
    problem.set[:count] = memory.rows.set[assembly.candidate[:count]]
    problem.friction[:count] = memory.surface.friction[assembly.candidate[:count]]
    return count, memory, work


def test_a_stop_is_one_unknown_force() -> None:
    """Sticking points are two, a dry joint at rest is one: along its tangent."""
    count, memory, work = listed()
    modes, held, first = work.phase.modes, work.phase.held, memory.assembly.problem.first
    kinds = memory.rows.kind[memory.assembly.candidate[:count]]
    modes.holder[:] = np.isin(memory.rows.kind[: len(modes.holder)], (POINT, DRY_JOINT))
    modes.carrier[:] = np.isin(memory.rows.kind[: len(modes.carrier)], (POINT, STOP))
    friction = memory.surface.friction
    size = uncompiled(list_unknowns)(
        count, count, memory.assembly.candidate, first, friction, modes, held
    )
    place = held.place[:size]
    assert [int(np.sum(place == i)) for i in range(count)] == [
        {POINT: 2, STOP: 1, DRY_JOINT: 1, SECOND_FACE: 0}[int(kind)] for kind in kinds
    ]
    assert np.all((held.row[:size] >= first[place]) & (held.row[:size] < first[place + 1]))


@pytest.mark.parametrize(("speed", "expected"), [(-1.0, STICK), (1.0, OPEN)])
def test_what_has_no_tangent_does_not_slip(speed: float, expected: int) -> None:
    """Where modes of an impact are guessed from its free velocities, a stop holds or lets go."""
    count, memory, work = listed()
    assembly = memory.assembly
    bias = np.full(len(work.phase.saddle.bias), speed)
    uncompiled(guess_modes)(count, bias, assembly)
    stops = memory.rows.kind[assembly.candidate[:count]] == STOP
    assert set(assembly.answer.mode[:count][stops].tolist()) == {expected}
    size = uncompiled(list_rows)(count, assembly.problem, assembly.answer.mode, work.phase.held)
    assert int(np.sum(np.isin(work.phase.held.place[:size], np.flatnonzero(stops)))) == (
        np.sum(stops) if expected == STICK else 0
    )


def pressed(simulation: Any) -> list[int]:
    """Rows of each candidate of the problem that was posed last."""
    problem = simulation._memory.assembly.problem
    rows: list[int] = np.diff(problem.first[: problem.count + 1]).tolist()
    return rows


def gate(*, dry: float = 0.0) -> Robot:
    """Pendulum of 1 kg at 0.5 m, with a latch at its upper stop, an angle of 0.3 rad."""
    build = RobotBuilder("gate")
    build.hinge(
        "hinge", None, mass=1.0, inertia=0.02, center_of_mass=(0, -0.5), limits=(0.1, 0.3),
        dry_friction=dry,
    )  # fmt: skip
    build.latch("hinge", "upper")
    return build.build()


@pytest.mark.parametrize(
    ("angle", "dry", "rows"),
    [(0.1, 0.0, [1]), (0.3, 0.0, [1]), (0.1, 0.01, [1, 2])],
    ids=["stop", "latch", "stop with dry friction"],
)
def test_the_problem_at_a_stop_has_its_size(angle: float, dry: float, rows: list[int]) -> None:
    """Gravity presses it against its lower stop, and would pull it off the upper one."""
    robot = gate(dry=dry)
    simulation = hs.Simulation(
        robot, state=robot.state({"hinge": angle}), method=hs.EventDriven(), stop_when_fallen=False
    )
    simulation.advance(0.01)
    assert pressed(simulation) == rows
    share = 9.81 * 0.5 * np.sin(angle)  # of which dry friction may bear a part
    assert abs(simulation.record.stop_torque[-1, 0] - share) <= dry + 1e-9 * share
