"""One step of a robot in space: its velocity at the end, by contact impulses.

The scheme is that of the plane (:mod:`heelstrike.sim.time_stepping.method`): gaps linearised over
the step, impacts whole within it. A step whose contact problem is not certified is halved, three
times at most, and then solved with fifty times the effort, in the end without restitution, or
without the impact, which then takes another step; if that does not help it goes on with a residual
of up to 1e-6, marked, and above that the run ends.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import UNIT_ROUNDOFF
from heelstrike.contact.spatial.certified_solve import solve_block_problem
from heelstrike.contact.spatial.ground import SpatialGroundModel
from heelstrike.contact.spatial.modes import SOLVED
from heelstrike.contact.spatial.workspace import BlockAnswer, BlockWorkspace
from heelstrike.dynamics.spatial.algebra import dot, spatial, velocity_at
from heelstrike.dynamics.spatial.configurations import integrate
from heelstrike.dynamics.spatial.equations import (
    passive_force,
    solve_factorized,
    state_equations,
)
from heelstrike.dynamics.spatial.kinematics import (
    link_velocities,
    place_of,
    point_position,
    point_velocity,
)
from heelstrike.dynamics.spatial.rows import velocity_change
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.push import Pushes, share_over_step
from heelstrike.sim.spatial.candidates import (
    NO_ANGLE,
    assemble,
    begin_as_before,
    complete,
    entry_speed,
    is_far,
    list_candidates,
    locate_ends,
    locate_points,
    turn_of_ball,
)
from heelstrike.sim.spatial.holding import goes_on_holding
from heelstrike.sim.spatial.impact import (
    asks_for_bounces,
    closes,
    solve_impact_of,
    touches_at_end,
)
from heelstrike.sim.spatial.memory import (
    MOST_ITERATIONS,
    SpatialAssembly,
    SpatialEquations,
    SpatialFeet,
    SpatialHolding,
    SpatialMemory,
    SpatialStep,
    SpatialWedge,
)
from heelstrike.sim.spatial.table import (
    BALL_STOP,
    DRY_JOINT,
    POINT,
    STOP,
    WALL,
    BlockTable,
)
from heelstrike.tolerances import CLOSED_GAP

HALVINGS_OF_A_STEP = 3
"""How often an uncertified step is halved."""

MARKED_RESIDUAL = 1e-6
"""Residual up to which an uncertified step goes on, marked."""

LAST_EFFORT = 20000
"""Iterations of a contact problem that no part of a step could be certified without."""

NO_SHARE = 1e-9
"""Part of a step up to which a push that ends, or begins, within it does so where it ends: what is
left is the rounding of times."""

CALLS = 6
"""How often a step is solved again for what it would throw through the ground."""

LEFT_IN_THE_GROUND = 1e-4
"""What is no deeper in the ground than this (m) may be left there where there is no way out."""


@kernel
def find_state(
    model: SpatialModel, ground: SpatialGroundModel, q: Floats, v: Floats,
    equations: SpatialEquations, table: BlockTable, contacts: Contacts, feet: SpatialFeet,
) -> None:  # fmt: skip
    """Equations of motion and contact points of the state now."""
    state_equations(model, q, v, equations.tree, equations.factor, equations.bias)
    position, normal, gap = contacts.position, contacts.normal, contacts.gap
    locate_points(model, ground, equations.tree, table, position, normal, gap, feet)
    locate_ends(model, q, table)


@kernel
def add_spatial_pushes(
    model: SpatialModel, tree: SpatialWorkspace, pushes: Pushes, force: Floats
) -> None:
    """Add the generalised force Jᵀf of the pushes to `force`."""
    for i in range(pushes.link.shape[0]):
        share = pushes.share[i]
        if share <= NO_SHARE:
            continue
        f = share * pushes.force[i, 0], share * pushes.force[i, 1], share * pushes.force[i, 2]
        at = pushes.point[i, 0], pushes.point[i, 1], pushes.point[i, 2]
        place = place_of(tree, point_position(tree, pushes.link[i], at))
        last = model.last_velocity[pushes.link[i]]
        for a in range(model.depth[last] + 1):
            k = model.chain[last, a]
            force[k] += dot(f, velocity_at(spatial(tree.motion, k), place))


@kernel
def find_free_velocity(
    model: SpatialModel, time: float, step: float, q: Floats, v: Floats, torque: Floats,
    pushes: Pushes, equations: SpatialEquations, next_v: Floats,
) -> None:  # fmt: skip
    """Velocity at the end of the step if nothing held the robot."""
    force, rate = equations.force, equations.rate
    passive_force(model, q, v, force)
    for i in range(model.nu):
        force[model.actuator_velocity[i]] += torque[i]
    if share_over_step(time, step, pushes):
        add_spatial_pushes(model, equations.tree, pushes, force)
    for k in range(model.nv):
        rate[k] = step * (force[k] - equations.bias[k])
    solve_factorized(model, equations.factor, rate)
    for k in range(model.nv):
        next_v[k] = v[k] + rate[k]


@kernel
def add_impulses(
    model: SpatialModel, impulse: Floats, equations: SpatialEquations, assembly: SpatialAssembly,
    v: Floats,
) -> None:  # fmt: skip
    """Add what impulses of the candidates do to a velocity."""
    velocity_change(
        model, equations.factor, assembly.count, assembly.problem.first, assembly.last,
        assembly.rows, impulse, assembly.change,
    )  # fmt: skip
    for k in range(model.nv):
        v[k] += assembly.change[k]


@kernel
def call_what_is_missed(
    model: SpatialModel, step: float, tree: SpatialWorkspace, feet: SpatialFeet, q: Floats,
    v: Floats, count: int, candidate: Integers, table: BlockTable,
) -> bool:  # fmt: skip
    """Call what the velocity that was found takes through the ground or a stop; return if any."""
    called = False
    place = 0  # candidates are in the order of the table
    for entry in range(table.kind.shape[0]):
        listed = place < count and candidate[place] == entry
        place += listed
        taking_part = listed or table.called[entry] == 1 or table.kind[entry] == DRY_JOINT
        if taking_part or is_far(step, entry, table):
            continue
        speed = entry_speed(model, tree, entry, table, feet, q, v)
        if table.gap[entry] + step * speed < -CLOSED_GAP:
            table.called[entry] = 1
            called = True
    return called


@kernel
def forgive_depth(step: float, table: BlockTable, assembly: SpatialAssembly) -> bool:
    """Ask nothing that touches to move by its gap; return whether that changes anything.

    Neither out of the ground, nor down to it by less than counts as touching. Points deeper than
    `LEFT_IN_THE_GROUND` are not left there: nothing changes then.
    """
    changed = False
    for place in range(assembly.count):
        gap = table.gap[assembly.candidate[place]]
        if gap < -LEFT_IN_THE_GROUND:
            return False
        changed = changed or (gap != 0.0 and gap <= CLOSED_GAP)
    for place in range(assembly.count if changed else 0):
        gap = table.gap[assembly.candidate[place]]
        if gap <= CLOSED_GAP:
            assembly.problem.free[assembly.problem.first[place]] -= gap / step
    return changed


@kernel
def goes_on_wedged(steps: int, wedge: SpatialWedge) -> bool:
    """Whether the step before had no way out, and is not asked again: at 1, 2, 4, 8, ... steps."""
    age = steps - wedge.since
    return wedge.wedged == steps - 1 and age & (age - 1) != 0


@kernel
def note_relaxed(steps: int, wedge: SpatialWedge) -> None:
    """Keep that a step is not asked to come out of the ground."""
    wedge.relaxed = 1
    if wedge.wedged < steps - 1:
        wedge.since = steps
    wedge.wedged = steps


@kernel
def solve_completed(
    model: SpatialModel, solver: BlockWorkspace, assembly: SpatialAssembly
) -> int:  # fmt: skip
    """Solve the problem of the positions by its Delassus matrix."""
    complete(model, assembly)
    return solve_block_problem(assembly.problem, solver, assembly.answer)


@kernel
def solve_positions(
    model: SpatialModel, step: float, steps: int, table: BlockTable, factor: TreeFactor,
    holding: SpatialHolding, solver: BlockWorkspace, assembly: SpatialAssembly,
    wedge: SpatialWedge,
) -> int:  # fmt: skip
    """Solve the problem of the positions; where there is no way out, without asking for one.

    Limbs that lie on several points, at the ends of their ranges, find none where each of their
    points is in the ground, or above it, by another billionth: each would have to slide its own
    way. They are left there, and asked again when that is twice as long ago.
    """
    wedge.relaxed = assembly.complete = 0
    at_once = goes_on_wedged(steps, wedge) and forgive_depth(step, table, assembly)
    if not at_once and goes_on_holding(model, factor, assembly, holding, solver):
        return SOLVED
    begin_as_before(table, assembly)
    if at_once:
        note_relaxed(steps, wedge)
    status = solve_completed(model, solver, assembly)
    if status != SOLVED and not at_once and forgive_depth(step, table, assembly):
        note_relaxed(steps, wedge)
        status = solve_completed(model, solver, assembly)
    return status


@kernel
def residual_of(answer: BlockAnswer) -> float:
    """Residual of a contact problem, rounding included; infinite where it is no number."""
    residual = answer.residual + answer.rounding
    return residual if residual >= 0.0 else math.inf


@kernel
def left_by(status: int, answer: BlockAnswer) -> float:
    """What a solve leaves: nothing if it is certified, and otherwise more than nothing."""
    return 0.0 if status == SOLVED else max(residual_of(answer), UNIT_ROUNDOFF)


@kernel
def solve_step_of(
    model: SpatialModel, time: float, step: float, number: int, resolves: bool, bounces: bool,
    memory: SpatialMemory,
) -> float:  # fmt: skip
    """Find the velocity at the end of a step; return the largest residual, zero if certified.

    `resolves` says whether an impact is whole within it, `bounces` whether restitution counts.

    ``memory.next_v`` receives the velocity, ``memory.impact.arriving`` that with which positions
    move, ``memory.impact.impulse`` the impulses of the candidates.
    """
    equations, assembly, impact = memory.equations, memory.assembly, memory.impact
    table, v, next_v = memory.blocks, memory.v, memory.next_v
    worst = 0.0
    for entry in range(table.called.shape[0]):
        table.called[entry] = 0
    before = number - 1
    for _ in range(CALLS):
        worst = 0.0
        find_free_velocity(
            model, time, step, memory.q, v, memory.torque, memory.pushes, equations, next_v
        )  # fmt: skip
        list_candidates(
            model, step, equations.tree, table, memory.feet, memory.q, next_v, assembly
        )  # fmt: skip
        impact.happens = memory.wedge.relaxed = 0
        impact.gain = 0.0
        for k in range(model.nv):
            impact.arriving[k] = next_v[k]
        if assembly.count > 0:
            problem = assembly.problem
            assemble(
                model, step, table, memory.feet, memory.q, v, next_v, equations.tree,
                equations.factor, assembly.count, assembly.candidate, problem.first,
                assembly.last, assembly.rows, problem.free, assembly.before,
            )  # fmt: skip
            status = solve_positions(
                model, step, number, table, equations.factor, memory.holding, memory.solver,
                assembly, memory.wedge,
            )  # fmt: skip
            worst = left_by(status, assembly.answer)
            if assembly.complete == 0:  # the change of velocity is known
                for k in range(model.nv):
                    impact.arriving[k] += memory.holding.change[k]
            else:
                add_impulses(model, assembly.answer.impulse, equations, assembly, impact.arriving)
            for row in range(assembly.problem.first[assembly.count]):
                impact.impulse[row] = assembly.answer.impulse[row]
            if resolves and worst == 0.0 and closes(step, before, table, assembly):
                impact.happens = 1
                relaxed = memory.wedge.relaxed == 1
                status = solve_impact_of(
                    model, step, before, relaxed, bounces, table, memory.solver, assembly, impact
                )  # fmt: skip
                worst = left_by(status, impact.answer)
                add_impulses(model, impact.impulse, equations, assembly, next_v)
            else:
                for k in range(model.nv):
                    next_v[k] = impact.arriving[k]
        if not call_what_is_missed(
            model, step, equations.tree, memory.feet, memory.q, impact.arriving, assembly.count,
            assembly.candidate, table,
        ):  # fmt: skip
            break
    return worst


@kernel
def note_answer_of(
    step: float, length: float, steps: int, impulse: Floats, assembly: SpatialAssembly,
    table: BlockTable,
) -> None:  # fmt: skip
    """Keep modes and impulses for the next step, and add up forces over the whole step."""
    first = assembly.problem.first
    place = 0
    for entry in range(table.kind.shape[0]):
        takes_part = place < assembly.count and assembly.candidate[place] == entry
        for i in range(table.size[entry]):
            table.impulse[entry, i] = 0.0
        if not takes_part:
            table.mode[entry] = 0 if table.kind[entry] != DRY_JOINT else table.mode[entry]
            continue
        table.mode[entry] = assembly.answer.mode[place]
        if table.kind[entry] != DRY_JOINT and touches_at_end(step, place, assembly):
            table.touching[entry] = steps
        for i in range(table.size[entry]):
            table.impulse[entry, i] = assembly.answer.impulse[first[place] + i]
            table.force[entry, i] += impulse[first[place] + i] / length
        place += 1


@kernel
def share_forces(
    model: SpatialModel, q: Floats, table: BlockTable, feet: SpatialFeet, contact_force: Floats,
    stop_torque: Floats, friction_torque: Floats,
) -> None:  # fmt: skip
    """Write the mean forces of the step where records and controllers look for them.

    Those of walls are added in the axes of the face below the point; stops of balls turn them back
    about the axis that they have at q, where the step begins.
    """
    for k in range(model.nv):
        stop_torque[k] = 0.0
        friction_torque[k] = 0.0
    for entry in range(table.kind.shape[0]):
        owner, kind = table.owner[entry], table.kind[entry]
        if kind == POINT:
            for i in range(3):
                contact_force[owner, i] = table.force[entry, i]
        elif kind == WALL:
            for i in range(3):
                for j in range(3):
                    along = 0.0
                    for k in range(3):
                        along += feet.frame[owner, 3 * i + k] * feet.frame[entry, 3 * j + k]
                    contact_force[owner, i] += along * table.force[entry, j]
        elif kind == STOP:
            k = model.first_velocity[owner]
            stop_torque[k] += table.side[entry] * table.force[entry, 0]
        elif kind == BALL_STOP:
            x, y, z = turn_of_ball(model, owner, q)
            share = table.force[entry, 0] / max(math.sqrt(x * x + y * y + z * z), NO_ANGLE)
            k = model.first_velocity[owner]
            stop_torque[k] -= share * x
            stop_torque[k + 1] -= share * y
            stop_torque[k + 2] -= share * z
        else:
            friction_torque[owner] += table.force[entry, 0]


@kernel
def find_slip(
    model: SpatialModel, v: Floats, feet: SpatialFeet, kind: Integers, count: int,
    candidate: Integers, tree: SpatialWorkspace, slip: Floats,
) -> None:  # fmt: skip
    """Write the tangential velocity of the contact points that take part, at the end of the step.

    The links of the tree have the velocities of then, afterwards.
    """
    link_velocities(model, v, tree)
    for contact in range(model.nc):
        slip[contact, 0] = slip[contact, 1] = 0.0
    for place in range(count):
        contact = candidate[place]
        if kind[contact] != POINT:  # points come first in the table, each in its own place
            continue
        foot = feet.foot[contact, 0], feet.foot[contact, 1], feet.foot[contact, 2]
        speed = point_velocity(tree, model.contact_link[contact], foot)
        one = feet.frame[contact, 3], feet.frame[contact, 4], feet.frame[contact, 5]
        two = feet.frame[contact, 6], feet.frame[contact, 7], feet.frame[contact, 8]
        slip[contact, 0] = dot(one, speed)
        slip[contact, 1] = dot(two, speed)


@kernel
def begin_step(table: BlockTable, step: SpatialStep) -> None:
    """Forget what was decided of the step before."""
    for entry in range(table.kind.shape[0]):
        for i in range(3):
            table.force[entry, i] = 0.0
    step.parts = step.uncertified = step.halved = step.relaxed = 0
    step.energy_gain = 0.0


@kernel
def take_step(
    model: SpatialModel, ground: SpatialGroundModel, time: float, length: float, resolves: bool,
    memory: SpatialMemory,
) -> bool:  # fmt: skip
    """Move on by a step, or by the parts of a halved one; the state has been found already.

    Returns whether it could be done.
    """
    counts, reaction, tally = memory.step, memory.reaction, memory.tally
    begin_step(memory.blocks, counts)
    halvings, done = 0, 0
    parts = 1
    while done < parts:
        step = length / parts
        if done > 0:
            find_state(
                model, ground, memory.q, memory.v, memory.equations, memory.blocks,
                memory.contacts, memory.feet,
            )  # fmt: skip
        number = tally.steps + counts.parts
        conceded = 0  # whether the impact has no restitution, or is left to the next step
        worst = solve_step_of(model, time + done * step, step, number, resolves, True, memory)
        if worst > 0.0 and halvings < HALVINGS_OF_A_STEP:
            counts.halved = 1
            halvings += 1
            parts *= 2
            done *= 2
            continue
        if worst > 0.0:  # before the run ends, or goes on marked, no effort is too much
            memory.solver.settings.effort = LAST_EFFORT
            worst = solve_step_of(model, time + done * step, step, number, resolves, True, memory)
            if worst > 0.0 and memory.impact.happens == 1 and asks_for_bounces(memory.impact):
                # Friction may not let a point bounce (Painlevé's paradox): it stays, then.
                worst = solve_step_of(
                    model, time + done * step, step, number, resolves, False, memory
                )  # fmt: skip
                conceded = 1
            if worst > 0.0 and memory.impact.happens == 1:
                # Between faces that nearly oppose each other an impact may have no answer at all.
                worst = solve_step_of(model, time + done * step, step, number, False, True, memory)
                conceded = 1
            memory.solver.settings.effort = MOST_ITERATIONS
        if not worst <= MARKED_RESIDUAL:
            tally.unsolved = reaction.residual = worst
            return False
        if worst > 0.0:
            counts.uncertified = 1
        note_answer_of(
            step, length, number, memory.impact.impulse, memory.assembly, memory.blocks
        )  # fmt: skip
        counts.energy_gain += memory.impact.gain
        reaction.residual = 0.0
        if memory.assembly.count > 0:
            reaction.residual = residual_of(memory.assembly.answer)
            tally.residual = max(tally.residual, reaction.residual)
        if memory.impact.happens == 1:
            tally.residual = max(tally.residual, residual_of(memory.impact.answer))
        if conceded == 1 or memory.wedge.relaxed == 1:
            counts.relaxed = 1
        if done + 1 == parts:
            find_slip(
                model, memory.next_v, memory.feet, memory.blocks.kind, memory.assembly.count,
                memory.assembly.candidate, memory.equations.tree, reaction.slip,
            )  # fmt: skip
        integrate(model, memory.q, memory.impact.arriving, step, memory.q)
        for k in range(model.nv):
            memory.v[k] = memory.next_v[k]
        counts.parts += 1
        done += 1
    share_forces(
        model, memory.kept_q, memory.blocks, memory.feet, memory.contacts.force,
        reaction.stop_torque,
        reaction.friction_torque,
    )  # fmt: skip
    return True
