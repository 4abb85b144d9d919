"""Kernels write only to their last arguments, as their source says."""

from __future__ import annotations

import ast

import pytest
from written_arguments import (
    arguments_of,
    arguments_of_kind,
    definition_of,
    kernels_of,
    members_touched,
    written_by,
)

import heelstrike.contact
import heelstrike.dynamics
import heelstrike.sim
from heelstrike.compiler.compilation import Kernel, kernel
from heelstrike.robot.model import Floats
from heelstrike.sim.memory import Memory
from heelstrike.sim.method import Method

ALL = [
    each
    for package in (heelstrike.dynamics, heelstrike.contact, heelstrike.sim)
    for each in kernels_of(package)
]
METHODS = [kind for kind in Method.__subclasses__() if kind.__module__.startswith("heelstrike.")]
OF_METHODS = {
    each for kind in METHODS for each in vars(kind.kernels).values() if isinstance(each, Kernel)
}
NOT_YET = (
    "heelstrike.sim.compliant.",
    "heelstrike.sim.controller.",
    "heelstrike.sim.spatial.controlled",
)
"""Of compliant ground, where the controller's bundle comes first, and what laws call by name."""

FIRST_OF_A_METHOD = ("scene", "model", "ground")
"""What no method may write to; the order of the others is one for all methods."""


def named(each: Kernel) -> str:
    return f"{each.py_func.__module__.removeprefix('heelstrike.')}.{each.__name__}"


def used_by(each: Kernel) -> set[str]:
    nodes = (node for statement in definition_of(each).body for node in ast.walk(statement))
    return {node.id for node in nodes if isinstance(node, ast.Name)}


def is_written_last(each: Kernel) -> bool:
    """Whether no argument that is only read comes after one that is written."""
    read_after = False
    for name in reversed(arguments_of(each)):
        if name in written_by(each):
            if read_after:
                return False
        elif name in used_by(each):
            read_after = True
    return True


def test_what_a_kernel_writes_comes_last() -> None:
    asked = [
        each
        for each in ALL
        if each not in OF_METHODS and not each.py_func.__module__.startswith(NOT_YET)
    ]
    assert len(asked) > 400
    assert {
        named(each): [
            f"{name} (written)" if name in written_by(each) else name for name in arguments_of(each)
        ]
        for each in asked
        if not is_written_last(each)
    } == {}


@pytest.mark.parametrize("each", sorted(OF_METHODS, key=named), ids=named)
def test_a_method_writes_to_what_is_its_own(each: Kernel) -> None:
    arguments = arguments_of(each)
    last = [name for name in arguments if name not in FIRST_OF_A_METHOD]
    assert arguments[-len(last) :] == last
    assert written_by(each) <= set(last)


def test_the_whole_memory_goes_only_where_several_of_its_bundles_do() -> None:
    asked = [k for k in ALL if k not in OF_METHODS and arguments_of_kind(k, Memory)]
    assert asked
    assert [named(each) for each in asked if len(members_touched(each, Memory)) <= 1] == []


@kernel
def fill(value: float, array: Floats) -> None:
    for i in range(array.shape[0]):
        array[i] = value


@kernel
def fill_by_another_name(array: Floats, memory: Memory) -> None:
    rows = memory.equations.mass_matrix if array.size > 0 else array
    row, _ = rows[0], 1
    fill(1.0, row)


@kernel
def write_first(array: Floats, value: float) -> None:
    fill(value, array)


@kernel
def read_only(memory: Memory) -> float:
    total = 0.0
    for i in range(memory.v.shape[0]):
        total += memory.v[i]
    return total


def test_writing_is_found_through_names_and_calls() -> None:
    assert written_by(fill) == {"array"}
    assert written_by(fill_by_another_name) == {"array", "memory"}
    assert written_by(write_first) == {"array"}
    assert written_by(read_only) == set()
    assert is_written_last(fill)
    assert not is_written_last(write_first)
