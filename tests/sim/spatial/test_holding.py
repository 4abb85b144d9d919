"""What goes on sticking is solved in the velocities: the same answer as that of the solvers."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_robots import Maker
from test_humanoid import begin, biped

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.spatial.certificate import certify_blocks
from heelstrike.contact.spatial.certified_solve import begin_from
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.scaling import give_impulses, scale_blocks
from heelstrike.contact.spatial.sticking import try_sticking
from heelstrike.sim.spatial.candidates import assemble, complete, list_candidates
from heelstrike.sim.spatial.holding import certify_along, goes_on_holding, is_worthwhile
from heelstrike.sim.spatial.impact import pose_impact_of
from heelstrike.sim.spatial.memory import SpatialMemory, allocate_spatial_memory
from heelstrike.sim.spatial.stepping import find_free_velocity, find_state
from heelstrike.sim.spatial.table import DRY_JOINT, POINT

STEP = 1e-3
DRY = "frictionloss='0.1'"


def posed(robot: hs.SpatialRobot, *, speed: float = 0.0, dry: int = STICK) -> SpatialMemory:
    """The contact problem of a biped on its soles without torques, which glides at a speed.

    Its points are thought to stick, and dry friction to do what `dry` says, forwards or
    backwards in turn: where all are alike rounding decides what slides meanwhile. There is no
    Delassus matrix yet, only what is no number.
    """
    memory = allocate_spatial_memory(robot)
    memory.q[:], memory.v[0] = begin(robot), speed
    table, assembly, equations = memory.blocks, memory.assembly, memory.equations
    uncompiled(find_state)(
        robot.model, hs.SpatialGround().model(), memory.q, memory.v, equations, table,
        memory.contacts, memory.feet,
    )  # fmt: skip
    table.mode[table.kind == POINT] = STICK
    table.mode[table.kind == DRY_JOINT] = dry
    table.impulse[table.kind == DRY_JOINT, 0] = np.resize([1.0, -1.0, -1.0], 12)
    uncompiled(find_free_velocity)(
        robot.model, 0.0, STEP, memory.q, memory.v, memory.torque, memory.pushes, equations,
        memory.next_v,
    )  # fmt: skip
    uncompiled(list_candidates)(
        robot.model, STEP, equations.tree, table, memory.feet, memory.q, memory.next_v, assembly
    )
    uncompiled(assemble)(
        robot.model, STEP, table, memory.feet, memory.q, memory.v, memory.next_v, equations.tree,
        equations.factor, assembly.count, assembly.candidate, assembly.problem.first,
        assembly.last, assembly.rows, assembly.problem.free, assembly.before,
    )  # fmt: skip
    assembly.problem.delassus[:] = np.nan
    assembly.complete = 0
    return memory


def by_the_matrix(robot: hs.SpatialRobot, memory: SpatialMemory) -> None:
    """Certify an answer by the Delassus matrix."""
    uncompiled(complete)(robot.model, memory.assembly)
    assembly, solver = memory.assembly, memory.solver
    uncompiled(certify_blocks)(assembly.problem, solver.settings, solver.scaled, assembly.answer)


def along_the_tree(robot: hs.SpatialRobot, memory: SpatialMemory) -> float:
    """Certify an answer by the rows."""
    assembly = memory.assembly
    return float(
        uncompiled(certify_along)(
            robot.model, memory.equations.factor, assembly.problem, assembly.last, assembly.rows,
            memory.solver.scaled, memory.holding, assembly.answer,
        )
    )  # fmt: skip


def goes_on(robot: hs.SpatialRobot, memory: SpatialMemory) -> bool:
    parts = memory.equations.factor, memory.assembly, memory.holding, memory.solver
    return bool(uncompiled(goes_on_holding)(robot.model, *parts))


def of_the_solver(robot: hs.SpatialRobot, memory: SpatialMemory) -> bool:
    """Solve the problem by its Delassus matrix."""
    uncompiled(complete)(robot.model, memory.assembly)
    problem, answer = memory.assembly.problem, memory.assembly.answer
    scaled, iterate = memory.solver.scaled, memory.solver.iterate
    uncompiled(scale_blocks)(problem, memory.solver.settings, scaled)
    uncompiled(begin_from)(problem, scaled, answer, iterate)
    done = uncompiled(try_sticking)(problem, scaled, iterate, memory.solver.newton)
    uncompiled(give_impulses)(problem, scaled, iterate.x, answer)
    uncompiled(certify_blocks)(problem, memory.solver.settings, scaled, answer)
    return bool(done)


@pytest.mark.parametrize("dry", [STICK, SLIP])
def test_it_is_the_answer_of_the_solver(made: Maker, dry: int) -> None:
    """Impulses of least norm, velocities and modes, whatever dry friction was thought to do.

    The legs give way by their pitch joints, whose friction slides; yaw and roll stick, although
    they were thought to slide, or the other way round.
    """
    robot = biped(made, more=DRY)
    memory, other = (posed(robot, dry=dry) for _ in range(2))
    problem, answer, expected = (
        memory.assembly.problem,
        memory.assembly.answer,
        other.assembly.answer,
    )
    count, rows = problem.count, problem.first[problem.count]
    assert rows == 3 * 8 + 12
    assert goes_on(robot, memory)
    assert of_the_solver(robot, other)
    slides = [0, 0, 1, 1, 1, 0]
    assert (answer.mode[8:count] == SLIP).tolist() == [*slides, *slides]
    bound = problem.bound[8:count]
    assert np.all(np.abs(answer.impulse[24:rows]) <= bound * (1.0 + 1e-12))
    assert answer.mode[:count].tolist() == expected.mode[:count].tolist()
    size = np.abs(expected.impulse[:rows]).max()
    assert np.allclose(answer.impulse[:rows], expected.impulse[:rows], rtol=0.0, atol=1e-6 * size)
    moved = np.abs(expected.velocity[:rows]).max()
    assert np.allclose(
        answer.velocity[:rows], expected.velocity[:rows], rtol=0.0, atol=1e-12 * moved
    )
    tally = memory.solver.tally
    assert (tally.solves, tally.shortcuts, tally.failures) == (1, 1, 0)


def test_its_certificate_is_that_of_the_matrix(made: Maker) -> None:
    """Of a solution, and of impulses that are none, by 1e-6, 1e-3 and all of their size."""
    robot = biped(made, more=DRY)
    memory = posed(robot)
    answer, problem = memory.assembly.answer, memory.assembly.problem
    assert goes_on(robot, memory)
    solution = answer.impulse.copy()
    rng = np.random.default_rng(7)
    for off in (0.0, 1e-6, 1e-3, 1.0):
        answer.impulse[:] = solution + off * np.abs(solution).max() * rng.normal(size=solution.size)
        along_the_tree(robot, memory)
        residual, modes = answer.residual, answer.mode[: problem.count].tolist()
        by_the_matrix(robot, memory)
        assert residual == pytest.approx(answer.residual, rel=1e-9, abs=1e-13)
        assert answer.mode[: problem.count].tolist() == modes
        assert (residual > 1e-9) is (off > 0.0)


def test_its_rounding_is_bounded(made: Maker) -> None:
    """Beside sums of more digits; impulses so large that rounding would show are not certified.

    Impulses of 1e6 times their size, which nearly cancel each other, show how large it gets.
    """
    robot = biped(made, more=DRY)
    memory = posed(robot)
    assembly, answer = memory.assembly, memory.assembly.answer
    problem, model, scaled = assembly.problem, robot.model, memory.solver.scaled
    assert goes_on(robot, memory)
    assert 0.0 < answer.rounding < 1e-11
    rows = problem.first[problem.count]
    dense = np.zeros((rows, robot.nv), dtype=np.longdouble)
    for block in range(problem.count):
        last = assembly.last[block]
        chain = model.chain[last, : model.depth[last] + 1]
        for row in range(problem.first[block], problem.first[block + 1]):
            dense[row, chain] = assembly.rows[row, : len(chain)]
    solution = answer.impulse.copy()
    rng = np.random.default_rng(8)
    for size, well in ((0.0, True), (1e-1, True), (1e6, False)):
        answer.impulse[:] = solution
        answer.impulse[:rows] += size * np.abs(solution).max() * rng.normal(size=rows)
        residual = along_the_tree(robot, memory)
        exact = problem.free[:rows] + dense @ (
            dense.T @ answer.impulse[:rows].astype(np.longdouble)
        )
        off = np.abs(answer.velocity[:rows] - exact) * scaled.weight[:rows] / scaled.unit
        assert 0.0 < off.max() <= answer.rounding
        assert np.isfinite(residual) == well


def test_an_impact_completes_the_matrix_that_was_not_needed(made: Maker) -> None:
    """A foot may land in a step whose positions were found along the tree."""
    robot = biped(made, more=DRY)
    memory, other = posed(robot), posed(robot)
    assert goes_on(robot, memory)
    assert memory.assembly.complete == 0
    uncompiled(complete)(robot.model, other.assembly)
    impact, table = memory.impact, memory.blocks
    uncompiled(pose_impact_of)(
        robot.model, STEP, 0, False, True, table, memory.assembly, impact
    )  # fmt: skip
    count = impact.problem.first[impact.problem.count]
    assert count == 3 * 8 + 12
    expected = other.assembly.problem.delassus[:count, :count]
    assert np.array_equal(impact.problem.delassus[:count, :count], expected)


def test_what_slips_is_left_to_the_solvers(made: Maker) -> None:
    """Feet that glide at 1 m/s would need more than their friction to stop within the step."""
    robot = biped(made, more=DRY)
    memory = posed(robot, speed=1.0)
    assert not goes_on(robot, memory)
    assert memory.solver.tally.solves == 0


def test_what_rounding_of_gaps_leaves_is_taken(made: Maker) -> None:
    """One corner's gap is off, so that a foot cannot hold it: 0.8e-10 are taken, 1.25e-10 not.

    What is left grows with how far it is off; what is more is left to the solvers, or solved with
    other modes.
    """
    robot = biped(made, more=DRY)

    def off_by(share: float) -> tuple[bool, float]:
        memory = posed(robot)
        scaled = memory.solver.scaled
        assert goes_on(robot, memory)
        size = scaled.unit / scaled.scale[0]
        memory = posed(robot)
        memory.assembly.problem.free[0] += share * size
        taken = goes_on(robot, memory)
        return taken, memory.assembly.answer.residual

    left = off_by(1e-10)[1] / 1e-10
    for residual, as_it_is in ((0.8e-10, True), (1.25e-10, False)):
        taken, found = off_by(residual / left)
        assert (taken and found == pytest.approx(residual, rel=0.05)) is as_it_is


def test_few_rows_are_left_to_the_solvers(made: Maker) -> None:
    """Where little sticks the Delassus matrix is the cheaper one."""
    robot = biped(made, more=DRY)
    memory = posed(robot)
    memory.assembly.answer.mode[:8] = OPEN
    memory.assembly.answer.mode[3] = STICK
    memory.assembly.answer.mode[8:] = SLIP
    assert not goes_on(robot, memory)
    assert not uncompiled(is_worthwhile)(robot.model, 3)
    assert uncompiled(is_worthwhile)(robot.model, 3 * 8 + 6)


def test_steps_take_this_way(made: Maker) -> None:
    """Compiled ones of a biped that stands; a snapshot in between goes on to the last bit."""
    robot = biped(made, more=DRY)
    q = begin(robot)
    law = hs.HoldPosture(robot, kp=600.0, kd=5.0, posture=q)
    state = hs.State(q, np.zeros(robot.nv))
    simulation = hs.Simulation(robot, law, state=state)
    simulation.advance(0.2)
    assembly = simulation._memory.assembly
    assert assembly.count > 8
    assert assembly.complete == 0
    kept = simulation.snapshot()
    simulation.advance(0.25)
    after = simulation.state
    other = hs.Simulation(robot, law, state=state)
    other.restore(kept)
    other.advance(0.25)
    assert np.array_equal(other.state.q, after.q)
    assert np.array_equal(other.state.v, after.v)
