"""A contact method from outside: the paper's ordering, with all that may hold a robot.

What is asked of contacts is the certified solver's; who they are is in the table of rows. Points,
stops, latches, joints with dry friction, loops, couplings and brakes all take part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heelstrike as hs
from heelstrike import sim
from heelstrike.robot import Robot


class Numbers(hs.Bundle):
    """What the kernels read."""

    step: float = hs.number(float)
    order: Any = hs.array("solvers", of=int)


@sim.kernel
def prepare(model: Any, ground: Any, memory: Any, work: Any) -> None:
    tree = memory.equations.tree
    sim.evaluate_equations(model, memory.q, memory.v, memory.equations)
    sim.locate_contacts(model, ground, tree, memory.contacts, memory.surface)
    sim.locate_stops(memory.q, memory.rows)
    sim.find_loops_of_step(model, memory.q, memory.v, tree, memory.loops)


@sim.kernel
def move_freely(model: Any, time: float, work: Any, memory: Any) -> None:
    equations = memory.equations
    force, rate = equations.force, equations.rate
    sim.passive_force(model, memory.q, memory.v, force)
    for i in range(model.nu):
        force[model.actuator_joint[i]] += memory.torque[i]
    if sim.share_over_step(time, work.step, memory.pushes):
        sim.add_pushes(model, equations.tree, memory.pushes, force)
    for j in range(model.nv):
        rate[j] = force[j] - equations.bias[j]
    sim.solve_mass_matrix(model, equations, rate)
    for j in range(model.nv):
        memory.next_v[j] = memory.v[j] + work.step * rate[j]


@sim.kernel
def list_closed(kind: int, count: int, rows: Any, listing: Any) -> int:
    for entry in range(rows.first[kind], rows.end[kind]):
        if rows.gap[entry] <= 0.0:
            sim.list_candidate(entry, count, rows.components[entry], listing)
            count += 1
    return count


@sim.kernel
def pose(model: Any, step: float, memory: Any) -> int:
    assembly, loops, v, rows = memory.assembly, memory.loops, memory.next_v, memory.rows
    listing = sim.Listing(
        rows.set, memory.surface.friction, memory.reaction.mode, assembly.candidate,
        assembly.answer.mode, assembly.problem,
    )  # fmt: skip
    near = sim.note_group(sim.POINT, 0, list_closed(sim.POINT, 0, rows, listing), assembly)
    count = list_closed(sim.STOP, near, rows, listing)
    count = sim.hold_latched(model, count, v, rows.latch_stop, loops.held, listing)
    stopped = sim.note_group(sim.STOP, near, count, assembly)
    count = sim.list_dry_joints(count, step, v, memory.breakaway, rows, listing)
    sim.note_group(
        sim.SECOND_FACE, sim.note_group(sim.DRY_JOINT, stopped, count, assembly), count, assembly
    )
    tree = memory.equations.tree
    sim.write_contact_rows(sim.POINT, model, tree, memory.contacts, rows.owner, assembly)
    sim.write_joint_rows(rows, assembly)
    for row in range(assembly.problem.first[count]):
        assembly.problem.free[row] = sim.row_product(assembly.directions.jacobian, row, v)
    total = sim.append_loops(count, loops, assembly)
    sim.free_loops(total, loops, v, 0.5 * step, assembly)
    return sim.note_group(sim.LOOP, count, total, assembly)


@sim.kernel
def decide(scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any) -> int:
    model, assembly, status = scene.model, memory.assembly, sim.SOLVED
    directions, problem, answer = assembly.directions, assembly.problem, assembly.answer
    equations, loops, told = memory.equations, memory.loops, record.told
    move_freely(model, clock.time, work, memory)
    problem.count = pose(model, work.step, memory)
    if problem.count > 0:
        sim.assemble_delassus(model, problem.count, equations, directions, problem)
        status = sim.solve_contact_kernel(work.order, problem, memory.solver, answer)
        rows = problem.first[problem.count]
        sim.add_impulse(model, rows, answer.impulse, directions, equations, memory.next_v)
    sim.note_answer(work.step, memory)
    sim.note_extremes(memory.contacts.gap, answer.residual, memory.tally)
    first, end = told.events, clock.start + (clock.index + 1) * work.step
    sim.note_events(
        model, clock.time, end, work.step, memory.tally.steps, memory.q, memory.v, memory.next_v,
        memory.breakaway, equations.tree, memory.contacts, memory.reaction, loops.constraint_force,
        memory.rows, told, memory.reported,
    )  # fmt: skip
    sim.react(model, first, memory.q, told, loops.held)
    rubbed, braked = memory.reaction.friction_torque, loops.brake_force
    sim.share_friction(model, memory.breakaway, rubbed, braked)
    sim.note_brakes(model, clock.time, work.step, braked, told, loops.braked)
    return sim.DONE if status == sim.SOLVED else sim.SOLVER_FAILED


@sim.kernel
def report(scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any) -> None:
    sim.note_row_when_due(memory, clock, record)


@sim.kernel
def move(scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any) -> int:
    memory.tally.steps += 1
    sim.integrate(scene.model, memory.q, memory.next_v, work.step, memory.q)
    for j in range(scene.model.nv):
        memory.v[j] = memory.next_v[j]
    loops = memory.loops
    if sim.rows_of(loops) > 0 and not sim.close_loops(
        scene.model, memory.equations, loops, memory.q
    ):
        return sim.DIVERGED
    clock.time = clock.start + (clock.index + 1) * work.step
    return sim.DONE


@dataclass(frozen=True, kw_only=True)
class Impulses(sim.Method):
    """The paper's ordering on ground without corners."""

    kernels = sim.Kernels(None, prepare, decide, report, move)
    work = Numbers

    step: float = 1e-3
    solver: str = "lemke"

    @property
    def step_length(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def row_period(self) -> tuple[str, float]:
        return "step", self.step

    @property
    def solves_with(self) -> str:
        return self.solver

    def new_work(self, robot: Robot) -> Numbers:
        return Numbers(step=self.step, order=sim.solver_order(self.solver))

    def room(self, robot: Robot) -> tuple[int, int]:
        return 1, 2 * (robot.nc + robot.nv) + robot.model.latches + robot.model.brakes + 2
