"""What goes on sticking is solved in the velocities: the same answer as that of the solvers."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_robots import Maker
from test_humanoid import begin, biped

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.spatial.certificate import certify_blocks
from heelstrike.contact.spatial.certified_solve import try_ways
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.sticking import try_sticking
from heelstrike.sim.spatial.candidates import assemble, complete, list_candidates
from heelstrike.sim.spatial.holding import goes_on_holding
from heelstrike.sim.spatial.memory import SpatialMemory, allocate_spatial_memory
from heelstrike.sim.spatial.stepping import find_free_velocity, find_state
from heelstrike.sim.spatial.table import DRY_JOINT, POINT

STEP = 1e-3


def posed(robot: hs.SpatialRobot, q: np.ndarray, v: np.ndarray) -> SpatialMemory:
    """The contact problem of a step, all points sticking; dry friction slides as v says."""
    memory = allocate_spatial_memory(robot)
    ground = hs.SpatialGround().model()
    memory.q[:], memory.v[:] = q, v
    table, assembly, equations = memory.blocks, memory.assembly, memory.equations
    uncompiled(find_state)(
        robot.model, ground, memory.q, memory.v, equations, table, memory.contacts, memory.feet
    )
    table.mode[table.kind == POINT] = STICK
    for entry in np.flatnonzero(table.kind == DRY_JOINT):
        speed = v[table.owner[entry]]
        table.mode[entry] = SLIP if speed else STICK
        table.impulse[entry, 0] = -np.sign(speed)
    memory.torque[:] = -50.0 * v[robot.model.actuator_velocity]
    uncompiled(find_free_velocity)(
        robot.model, 0.0, STEP, memory.q, memory.v, memory.torque, memory.pushes, equations,
        memory.next_v,
    )  # fmt: skip
    uncompiled(list_candidates)(
        robot.model, STEP, equations.tree, table, memory.feet, memory.q, memory.next_v, assembly
    )
    problem = assembly.problem
    uncompiled(assemble)(
        robot.model, STEP, table, memory.feet, memory.q, memory.v, memory.next_v, equations.tree,
        equations.factor, assembly.count, assembly.candidate, problem.first, assembly.last,
        assembly.rows, problem.free, assembly.before,
    )  # fmt: skip
    assembly.complete = 0
    return memory


def sliding(robot: hs.SpatialRobot, *joints: str) -> np.ndarray:
    """Velocities of a biped on its soles of which only these joints turn, and not the feet."""
    v = np.zeros(robot.nv)
    for joint in joints:
        v[robot.velocity_names.index(joint)] = 0.5
    return v


def held(memory: SpatialMemory, robot: hs.SpatialRobot) -> bool:
    return bool(
        uncompiled(goes_on_holding)(robot.model, memory.assembly, memory.holding, memory.solver)
    )


def test_it_is_the_answer_of_the_solvers(made: Maker) -> None:
    """Impulses of least norm, velocities, modes and residual; and the certificate of the matrix."""
    robot = biped(made, "frictionloss='0.1'")
    memory = posed(robot, begin(robot), np.zeros(robot.nv))
    problem, answer = memory.assembly.problem, memory.assembly.answer
    rows = problem.first[problem.count]
    assert rows == 24 + 12
    guess = answer.mode[: problem.count].copy()
    assert held(memory, robot)
    assert memory.solver.tally.solves == memory.solver.tally.shortcuts == 1
    ours = answer.impulse[:rows].copy(), answer.velocity[:rows].copy()
    modes, residual = answer.mode[: problem.count].copy(), answer.residual
    uncompiled(complete)(robot.model, memory.assembly)
    print(residual, answer.rounding)
    again = uncompiled(certify_blocks)(problem, memory.solver.settings, memory.solver.scaled, answer)
    assert again <= 1e-12
    print(np.max(np.abs(answer.velocity[:rows] - ours[1])))
    answer.mode[: problem.count] = guess
    print(modes)
