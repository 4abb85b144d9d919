"""The table of rows: numbers that all methods share, and that nothing else computes with."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from every_row import every_kind

import heelstrike as hs
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.robot import RobotBuilder
from heelstrike.sim.contacts.rows import (
    BRAKE,
    COUPLING,
    DRY_JOINT,
    KINDS,
    LOOP,
    POINT,
    SECOND_FACE,
    STOP,
    lay_out_rows,
)
from heelstrike.sim.memory import allocate_memory

SIM = Path(hs.__file__).parent / "sim"

TABLE = SIM / "contacts" / "rows.py"

PENDING: tuple[str, ...] = ()
"""Rooms whose kernels still compute with numbers of their own."""

KERNELS = ("kernel", "dissolved_kernel")

NAMES = ("POINT", "STOP", "DRY_JOINT", "SECOND_FACE", "LOOP", "COUPLING", "BRAKE")


def entries(kind: int) -> slice:
    rows = lay_out_rows(every_kind())
    return slice(int(rows.first[kind]), int(rows.end[kind]))


def test_entries_go_kind_by_kind_without_a_gap() -> None:
    rows = lay_out_rows(every_kind())
    assert [int(n) for n in rows.end - rows.first] == [2, 4, 0, 2, 2, 2, 1, 0, 2]
    assert rows.first[POINT] == 0  # points have the numbers of `Contacts`
    np.testing.assert_array_equal(rows.first[1:], rows.end[:-1])
    assert rows.end[-1] == len(rows.kind)
    for kind in range(len(KINDS)):
        assert (rows.kind[entries(kind)] == kind).all()


def test_each_entry_says_of_what_it_is() -> None:
    robot = every_kind()
    rows = lay_out_rows(robot)
    hip, knee, arm, hand = (robot.joint_index(name) for name in ("hip", "knee", "arm", "hand"))
    owners = {
        POINT: [0, 1], STOP: [hip, knee, knee, arm], DRY_JOINT: [arm, hand],
        SECOND_FACE: [0, 1], LOOP: [0, 0], COUPLING: [0], BRAKE: [0, 1],
    }  # fmt: skip
    for kind, owner in owners.items():
        np.testing.assert_array_equal(rows.owner[entries(kind)], owner, KINDS[kind].name)
    np.testing.assert_array_equal(rows.side[entries(STOP)], [1.0, 1.0, -1.0, -1.0])
    np.testing.assert_array_equal(rows.limit[entries(STOP)], [-1.0, -2.0, 0.5, 3.0])
    np.testing.assert_array_equal(rows.axis[entries(LOOP)], [0, 1])
    (latch,) = rows.latch_stop
    assert (rows.kind[latch], rows.owner[latch], rows.side[latch]) == (STOP, knee, -1.0)


def test_entries_have_the_sets_of_their_kinds() -> None:
    rows = lay_out_rows(every_kind())
    sets = {POINT: CONE, STOP: HALF_LINE, DRY_JOINT: INTERVAL, SECOND_FACE: CONE, LOOP: LINE}
    for kind, its in (sets | {COUPLING: LINE, BRAKE: LINE}).items():
        assert (rows.set[entries(kind)] == its).all(), KINDS[kind].name


def test_kinds_that_a_robot_does_not_have_are_not_there() -> None:
    build = RobotBuilder("ball")
    build.floating_base("ball", mass=1.0, inertia=0.1)
    build.contact("ball", (0.0, 0.0), radius=0.1)
    rows = lay_out_rows(build.build())
    assert [int(n) for n in rows.end - rows.first] == [1, 0, 0, 0, 1, 0, 0, 0, 0]


def test_places_of_points_on_both_faces_are_those_of_the_table() -> None:
    """What finds the contact points writes the table's gaps, places and normals."""
    memory = allocate_memory(every_kind())
    rows = memory.rows
    assert np.isposinf(rows.gap).all()
    memory.contacts.gap[:] = 1.0, 2.0
    memory.second_faces.gap[:] = 3.0, 4.0
    np.testing.assert_array_equal(rows.gap[entries(POINT)], [1.0, 2.0])
    np.testing.assert_array_equal(rows.gap[entries(SECOND_FACE)], [3.0, 4.0])
    for name in ("position", "normal"):
        first, second = getattr(memory.contacts, name), getattr(memory.second_faces, name)
        first[:], second[:] = np.eye(2), -np.eye(2)
        np.testing.assert_array_equal(getattr(rows, name)[entries(POINT)], np.eye(2))
        np.testing.assert_array_equal(getattr(rows, name)[entries(SECOND_FACE)], -np.eye(2))
    assert np.isposinf(rows.gap[entries(STOP)]).all()


def test_the_kinds_of_friction_and_loops_are_numbered_by_the_table() -> None:
    memory = allocate_memory(every_kind())
    friction = np.zeros(len(memory.rows.kind))
    friction[entries(DRY_JOINT)] = 1.0
    np.testing.assert_array_equal(memory.surface.friction, friction)
    first = int(memory.rows.first[LOOP])
    np.testing.assert_array_equal(memory.loops.entry, np.arange(first, len(friction)))
    np.testing.assert_array_equal(
        memory.loops.brake_entry, np.arange(len(friction))[entries(BRAKE)]
    )


def kernels_in(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            marks = {each.id for each in node.decorator_list if isinstance(each, ast.Name)}
            if marks & set(KERNELS):
                yield node


def tells_where_kinds_begin(node: ast.AST) -> bool:
    """Whether an expression is how many of a kind there are, or where one begins or ends."""
    if isinstance(node, ast.BinOp):
        return tells_where_kinds_begin(node.left) or tells_where_kinds_begin(node.right)
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Name) and node.slice.id in NAMES
    return isinstance(node, ast.Attribute) and node.attr in ("nc", "first_dry", "first_second")


def arithmetic_that_tells_kinds_apart(source: str) -> list[str]:
    """Return the expressions of kernels that compute with, or compare with, where kinds begin."""
    found = []
    for function in kernels_in(ast.parse(source)):
        for node in ast.walk(function):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
                operands: list[ast.expr] = [node.left, node.right]
            elif isinstance(node, ast.Compare):
                operands = [node.left, *node.comparators]
            else:
                continue
            if any(map(tells_where_kinds_begin, operands)):
                found.append(f"{function.name}: {ast.unparse(node)}")
    return found


@pytest.mark.parametrize(
    "expression",
    [
        "candidate - model.nc", "candidate < model.nc", "model.nc + 2 * joint", "2 * model.nc",
        "stop - 2 * (model.nc + model.nv)", "contact >= phase.first_dry", "rows.first[STOP] + 1",
        "entry - rows.first[STOP]", "rows.first[STOP] <= entry < rows.end[STOP]",
    ],
)  # fmt: skip
def test_arithmetic_on_an_index_is_found(expression: str) -> None:
    kernel = f"@kernel\ndef told():\n    return {expression}\n"
    assert arithmetic_that_tells_kinds_apart(kernel)


def test_going_through_a_kind_is_no_arithmetic() -> None:
    kernel = "@kernel\ndef f():\n    for i in range(rows.first[STOP], rows.end[STOP]):\n        i"
    assert not arithmetic_that_tells_kinds_apart(kernel)


def test_kinds_are_told_apart_by_the_table_alone() -> None:
    """No kernel of a simulation computes with numbers of entries to tell what they are."""
    found = {
        str(path.relative_to(SIM)): arithmetic_that_tells_kinds_apart(path.read_text("utf-8"))
        for path in sorted(SIM.rglob("*.py"))
        if path != TABLE
    }
    rooms = {Path(name).parts[0] for name, expressions in found.items() if expressions}
    done = {name: found[name] for name in found if Path(name).parts[0] not in PENDING}
    assert not any(done.values()), {name: each for name, each in done.items() if each}
    assert rooms == set(PENDING), "a room that is done is pending no longer"


def test_a_stop_brings_one_row() -> None:
    """walker2d, left alone, comes to lie on points and stops: each tells where its rows begin."""
    robot = hs.load_robot("walker2d")
    simulation = hs.Simulation(robot, state=robot.reference_state(), stop_when_fallen=False)
    simulation.advance(0.8)
    assembly, rows = simulation._memory.assembly, simulation._memory.rows
    kinds = rows.kind[assembly.candidate[: assembly.problem.count]]
    assert {POINT, STOP} == set(kinds.tolist())
    brought = np.diff(assembly.problem.first[: assembly.problem.count + 1])
    assert np.array_equal(brought, np.where(kinds == STOP, 1, 2))
