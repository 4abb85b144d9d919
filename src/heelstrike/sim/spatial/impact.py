"""Impacts that are whole within the step they fall into, as in the plane.

Where a contact closes in a step, position and velocity part ways: positions arrive with the
velocity that the linearised gaps allow; the velocity behind it is that of an impact of all that
touches, with Newton's restitution. :mod:`heelstrike.sim.time_stepping.impact` tells why.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.spatial.certified_solve import solve_block_problem
from heelstrike.contact.spatial.workspace import BlockProblem, BlockWorkspace
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.spatial.candidates import complete
from heelstrike.sim.spatial.memory import SpatialAssembly, SpatialImpact
from heelstrike.sim.spatial.table import DRY_JOINT, BlockTable
from heelstrike.tolerances import CLOSED_GAP, NOTICEABLE_ENERGY


@kernel
def touches_at_end(step: float, place: int, assembly: SpatialAssembly) -> bool:
    """Whether a candidate touches at the end of the step."""
    row = assembly.problem.first[place]
    return step * assembly.answer.velocity[row] <= CLOSED_GAP


@kernel
def would_touch(step: float, place: int, problem: BlockProblem) -> bool:
    """Whether a candidate would touch at the end of the step if it were free."""
    return step * problem.free[problem.first[place]] < CLOSED_GAP


@kernel
def closes(step: float, before: int, table: BlockTable, assembly: SpatialAssembly) -> bool:
    """Whether an impact falls into the step, after the one of number `before`."""
    for place in range(assembly.count):
        entry = assembly.candidate[place]
        if table.kind[entry] == DRY_JOINT or not touches_at_end(step, place, assembly):
            continue
        now = table.gap[entry]
        new = table.touching[entry] != before and would_touch(step, place, assembly.problem)
        if now < -CLOSED_GAP or (new and now > CLOSED_GAP):
            return True
    return False


@kernel
def takes_part(
    step: float, before: int, place: int, table: BlockTable, assembly: SpatialAssembly
) -> bool:
    """Whether a candidate takes part in the impact of a step."""
    entry = assembly.candidate[place]
    if table.kind[entry] == DRY_JOINT or table.gap[entry] <= CLOSED_GAP:
        return True
    stays = table.touching[entry] == before or would_touch(step, place, assembly.problem)
    return stays and touches_at_end(step, place, assembly)


@kernel
def pose_impact_of(
    model: SpatialModel, step: float, before: int, relaxed: bool, bounces: bool,
    table: BlockTable, assembly: SpatialAssembly, impact: SpatialImpact,
) -> None:  # fmt: skip
    """Write the problem of the impact: what takes part, without the gaps, with its bounces.

    `relaxed` says that nothing that touches was asked to move by its gap, `bounces` whether
    restitution counts.
    """
    complete(model, assembly)
    problem, its = assembly.problem, impact.problem
    members = rows = 0
    for place in range(assembly.count):
        if not takes_part(step, before, place, table, assembly):
            continue
        entry = assembly.candidate[place]
        impact.member[members] = place
        its.first[members] = rows
        its.set[members] = problem.set[place]
        its.friction[members] = problem.friction[place]
        its.bound[members] = problem.bound[place]
        impact.answer.mode[members] = assembly.answer.mode[place]
        begin = problem.first[place]
        size = problem.first[place + 1] - begin
        for i in range(size):
            its.free[rows + i] = problem.free[begin + i]
            impact.answer.impulse[rows + i] = assembly.answer.impulse[begin + i]
        impact.bounce[members] = 0.0
        if table.kind[entry] != DRY_JOINT:
            if bounces:
                impact.bounce[members] = table.restitution[entry] * assembly.before[place]
            gap = table.gap[entry]
            its.free[rows] -= (0.0 if relaxed and gap <= CLOSED_GAP else gap) / step
            its.free[rows] += impact.bounce[members]
        for other in range(members + 1):
            column = problem.first[impact.member[other]]
            for j in range(its.first[other + 1] - its.first[other] if other < members else size):
                for i in range(size):
                    entry_of_both = problem.delassus[begin + i, column + j]
                    its.delassus[rows + i, its.first[other] + j] = entry_of_both
                    its.delassus[its.first[other] + j, rows + i] = entry_of_both
        rows += size
        members += 1
        its.first[members] = rows
    its.count = members


@kernel
def asks_for_bounces(impact: SpatialImpact) -> bool:
    """Whether restitution asks anything of the impact."""
    count = 0
    for place in range(impact.problem.count):
        count += impact.bounce[place] != 0.0
    return count > 0


@kernel
def energy_of_impact(impact: SpatialImpact) -> float:
    """Kinetic energy that the impulses of an impact make (J); zero if it is only rounding."""
    its, impulse = impact.problem, impact.answer.impulse
    made = through = 0.0
    for place in range(its.count):
        for row in range(its.first[place], its.first[place + 1]):
            bounce = impact.bounce[place] if row == its.first[place] else 0.0
            before = its.free[row] - bounce
            after = impact.answer.velocity[row] - bounce
            made += 0.5 * impulse[row] * (before + after)
            through += abs(0.5 * impulse[row] * before) + abs(0.5 * impulse[row] * after)
    return made if made > NOTICEABLE_ENERGY * through else 0.0


@kernel
def solve_impact_of(
    model: SpatialModel, step: float, before: int, relaxed: bool, bounces: bool,
    table: BlockTable, solver: BlockWorkspace, assembly: SpatialAssembly, impact: SpatialImpact,
) -> int:  # fmt: skip
    """Solve the impact of a step; its impulses go to the rows of the candidates.

    Returns how the solve ended.
    """
    pose_impact_of(model, step, before, relaxed, bounces, table, assembly, impact)
    status = solve_block_problem(impact.problem, solver, impact.answer)
    impact.gain = energy_of_impact(impact)
    first, its = assembly.problem.first, impact.problem
    for row in range(first[assembly.count]):
        impact.impulse[row] = 0.0
    for member in range(its.count):
        begin = first[impact.member[member]]
        for i in range(its.first[member + 1] - its.first[member]):
            impact.impulse[begin + i] = impact.answer.impulse[its.first[member] + i]
    return status
