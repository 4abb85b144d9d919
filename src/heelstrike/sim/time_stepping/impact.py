"""Impacts that are whole within the step they fall into.

The gap at the end of a step, linearised, lets a contact that comes down arrive and no more: what is
left of its speed is taken by the next step, from where the first one left it. One contact alone
loses nothing by that. Two problems one after the other are not one problem, though, once other
contacts or friction take part, and the state behind such an impact does not converge.

So position and velocity part ways in a step in which a contact closes. Both start from the same
free velocity v_f and Delassus matrix::

    position   w = G λ + J v_f,  w_n ≥ −gap/h    the robot moves on with this velocity: it arrives
    velocity   w = G λ + J v_f,  w_n ≥ −e J_n v  of the contacts that touch: Newton's impact law

The contacts of the impact are those that touch now and touched before or would close if they were
free. It is for the contact that is *new* to say that there is an impact at all: one that touches at
the end of this step, did not at the end of the last one, and is not there already. A contact that
is in the ground makes two problems of it, too: positions are pushed out, velocities are not.
Elsewhere the two velocities are the same. So no solve makes kinetic energy, but restitution with
friction (Kane's paradox): that is measured, and told by an event::

    Δ(½ vᵀ M v) = ½ p (w⁻ + w⁺),   w⁻ = J v_f,  w⁺ = w⁻ + G p

Asked for it, a step scales restitution back in such an impact until it makes none. There is such a
share of e: an impact without restitution never makes energy.

Between a stop and the ground, or two walls, there may be no way out of a penetration. If it is no
more than rounding and turning explain, the problem is asked again with negative gaps counted as
zero, and an event tells of it. While such a wedge lasts, and nothing in it opens, closes or slides,
that is asked at once: the strict problem is only asked again when the wedge is twice as old.
Positions are pushed out without friction, where that leads out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE, row_of
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    contact_problem,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
    lay_out_rows,
)
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Assembly
from heelstrike.sim.time_stepping.corners import Corner
from heelstrike.tolerances import CLOSED_GAP, NOTICEABLE_ENERGY

Floats = NDArray[np.float64]

NEVER = -2

# What is no deeper in the ground or beyond a stop than this (m, rad) may be left there, if there is
# no way out: what turning makes of a gap that is closed, h² ω² l / 2, at 20 rad/s and 1 ms.
WEDGED_BY = 1e-4
WEDGED = int(EventKind.WEDGED)
ENERGY_GAIN = int(EventKind.ENERGY_GAIN)

# How often the share of restitution that makes no energy is halved in: to a thousandth.
HALVINGS = 10


class Calls(Bundle):
    """What takes part in a step although it seemed too far away."""

    count: int = cell(int)
    """How many there are."""
    called: Integers = array("entries", of=int)
    """Whether each entry of the table of rows is one."""


class Impact(Bundle):
    """What a step has to know of the contacts that close in it."""

    happens: int = cell(int)
    """Whether an impact falls into this step."""
    touching: Integers = array("entries", of=int)
    """The last step at whose end each entry of the table of rows touched."""
    calls: Calls = part(Calls)
    """What is called to take part."""
    relaxed: int = cell(int)
    wedged: int = cell(int)
    since: int = cell(int)
    """relaxed, wedged, since: Whether this step is asked for less than to come out of the ground
    and to bounce; the last step that was; the first of those without a break."""
    bounded: int = cell(int)
    """Whether restitution that would make energy is scaled back."""
    gains: int = cell(int)
    """Whether restitution made energy in this step, or would have."""
    gain: float = cell(float)
    """The energy it made (J)."""
    bounce: Floats = array("capacity")
    """What restitution asks of each member (m/s, rad/s)."""
    kept: Integers = array("capacity", of=int)
    """Modes of the members in the last answer that made no energy."""
    arriving: Floats = array("nv")
    arriving_impulse: Floats = array("2 capacity")
    arriving_mode: Integers = array("capacity", of=int)
    """arriving, arriving_impulse, arriving_mode: Where there is an impact, the velocity that
    positions move with, and the answer of their problem."""
    member: Integers = array("capacity", of=int)
    """The candidates that take part."""
    problem: ContactProblem = part(ContactProblem)
    answer: ContactAnswer = part(ContactAnswer)
    """problem, answer: The impact."""
    corner: Corner = part(Corner)
    """Second faces of concave corners."""


def allocate_impact(robot: Robot, *, bounded: bool = False) -> Impact:
    """Allocate what the steps of a robot need, with nothing known yet."""
    entries = len(lay_out_rows(robot).kind)
    return Impact.allocate(
        nv=robot.nv,
        capacity=entries,
        entries=entries,
        touching=np.full(entries, NEVER),
        wedged=NEVER,
        bounded=int(bounded),
        problem=contact_problem(entries),
        answer=ContactAnswer.allocate(capacity=entries),
    )


@kernel
def dismiss(calls: Calls) -> None:
    """Let nothing be called any more."""
    calls.count = 0
    for place in range(calls.called.shape[0]):
        calls.called[place] = 0


@dissolved_kernel
def call(entry: int, calls: Calls) -> None:
    """Call a contact point, a stop or a constraint to take part."""
    calls.count += 1 - calls.called[entry]
    calls.called[entry] = 1


@kernel
def left_alone(
    count: int, candidate: Integers, gap: Floats, restitution: Floats
) -> tuple[float, bool]:
    """What a relaxed step does not ask for: the deepest negative gap, and whether any bounces."""
    deepest, bounces = 0.0, False
    for place in range(count):
        deepest = min(deepest, gap[candidate[place]])
        bounces = bounces or restitution[candidate[place]] > 0.0
    return deepest, bounces


@rare_kernel
def relax(bounds_gaps: bool, deepest: float, bounces: bool, steps: int, impact: Impact) -> bool:
    """Ask a step without an answer for less: no way out, no bounce; return if it asked for any.

    Without these the velocity that the step would have without contact is all that is in the way,
    and there is an answer. What is beyond stops or in the ground is left there, where the gap is
    bounded and none is deeper than rounding and turning explain. In a wedge that goes on all of it
    is explained: the step before has let nothing sink but by turning.
    """
    leaves = impact.relaxed == 0 and bounces
    if bounds_gaps and impact.relaxed == 0 and deepest < 0.0:
        leaves = impact.wedged == steps - 1 or deepest >= -WEDGED_BY
    if leaves:
        impact.relaxed = 1
    return leaves


@kernel
def stays_wedged(steps: int, impact: Impact) -> bool:
    """Whether a wedge lasts, and is not as old as when it is asked again: 1, 2, 4, 8, ... steps."""
    age = steps - impact.since
    return impact.wedged == steps - 1 and age & (age - 1) != 0


@kernel
def modes_change(assembly: Assembly, before: Integers) -> bool:
    """Whether anything opens, closes or slides otherwise than in the step before."""
    return (
        changes(POINT, assembly, before)
        or changes(STOP, assembly, before)
        or changes(CONSTRAINT, assembly, before)
        or changes(SECOND_FACE, assembly, before)
    )


@kernel
def changes(kind: int, assembly: Assembly, before: Integers) -> bool:
    """Whether any candidate of a kind has another mode than before."""
    for place in range(assembly.begin[kind], assembly.until[kind]):
        if assembly.answer.mode[place] != before[assembly.candidate[place]]:
            return True
    return False


@rare_kernel
def close_gaps(step: float, count: int, gap: Floats, assembly: Assembly) -> None:
    """Count negative gaps of the candidates as zero."""
    problem = assembly.problem
    for place in range(count):
        problem.free[problem.first[place]] -= min(gap[assembly.candidate[place]], 0.0) / step


@kernel
def deepest_point(gap: Floats) -> int:
    """The contact point that is deepest in the ground."""
    deepest = 0
    for contact in range(gap.shape[0]):
        deepest = contact if gap[contact] < gap[deepest] else deepest
    return deepest


@kernel
def note_wedge(steps: int, impact: Impact) -> bool:
    """Keep that this step is wedged; return whether the wedge begins with it."""
    begins = impact.wedged != steps - 1
    if begins:
        impact.since = steps
    impact.wedged = steps
    return begins


@dissolved_kernel
def arrives(step: float, place: int, first: Integers, answer: ContactAnswer) -> bool:
    """Whether a candidate touches at the end of the step.

    With the linearised gap in the free term, velocities are gaps at the end divided by the step.
    """
    return step * answer.velocity[row_of(place, first)] <= CLOSED_GAP


@dissolved_kernel
def would_close(step: float, place: int, problem: ContactProblem) -> bool:
    """Whether a candidate would touch at the end of the step if it were free."""
    return step * problem.free[row_of(place, problem.first)] < CLOSED_GAP


@dissolved_kernel
def note_touching(
    step: float, count: int, steps: int, assembly: Assembly, touching: Integers
) -> None:
    """Keep which of the candidates touch at the end of this step."""
    first = assembly.problem.first
    for place in range(count):
        if arrives(step, place, first, assembly.answer):
            touching[assembly.candidate[place]] = steps


@dissolved_kernel
def falls_into(
    step: float, before: int, gap: Floats, touching: Integers, problem: ContactProblem,
    assembly: Assembly,
) -> bool:  # fmt: skip
    """Whether an impact falls into the step; `problem` is that of the positions, solved.

    ``before`` is the step before, at whose end what was touching then had arrived.
    """
    first = problem.first
    for place in range(problem.count):
        candidate = assembly.candidate[place]
        now = gap[candidate]
        if now < np.inf and arrives(step, place, first, assembly.answer):
            new = touching[candidate] != before and would_close(step, place, problem)
            if now < -CLOSED_GAP or (new and now > CLOSED_GAP):
                return True
    return False


@kernel
def find_members(
    step: float, before: int, gap: Floats, touching: Integers, problem: ContactProblem,
    assembly: Assembly, member: Integers,
) -> int:  # fmt: skip
    """List what takes part in the impact of a step; return how many that are.

    As in :func:`falls_into`.
    """
    members = 0
    for place in range(problem.count):
        candidate = assembly.candidate[place]
        now = gap[candidate]
        takes_part = now == np.inf  # dry friction and loops are always there
        if not takes_part:
            touched = touching[candidate] == before
            stays = touched or would_close(step, place, problem)
            takes_part = now <= CLOSED_GAP or (
                stays and arrives(step, place, problem.first, assembly.answer)
            )
        if takes_part:
            member[members] = place
            members += 1
    return members


@kernel
def speed_before(
    model: Model, entry: int, v: Floats, rows: Rows, tree: Workspace, contacts: Contacts,
    second_faces: Contacts,
) -> float:  # fmt: skip
    """Normal velocity of a contact point, on either face, or a constraint, as the step begins."""
    if rows.kind[entry] == CONSTRAINT:
        return rate_of(rows.owner[entry], 0, v, rows.outside)
    point = rows.owner[entry]
    if rows.kind[entry] == POINT:
        normal, _ = contact_velocity(model, tree, contacts, point)
    else:
        normal, _ = contact_velocity(model, tree, second_faces, point)
    return normal


@kernel
def leave_others_out(members: int, problem: ContactProblem, impact: Impact) -> None:
    """Write what the problem of the positions is of the members alone."""
    its = impact.problem
    for place in range(members):
        source = impact.member[place]
        row, size = problem.first[source], problem.first[source + 1] - problem.first[source]
        own = its.first[place]
        its.first[place + 1] = own + size
        for other in range(place + 1):
            column = problem.first[impact.member[other]]
            for i in range(size):
                for j in range(its.first[other + 1] - its.first[other]):
                    entry = problem.delassus[row + i, column + j]
                    its.delassus[own + i, its.first[other] + j] = entry
                    its.delassus[its.first[other] + j, own + i] = entry
        for i in range(size):
            its.free[own + i] = problem.free[row + i]
        its.friction[place] = problem.friction[source]
        its.set[place] = problem.set[source]
        its.bound[place] = problem.bound[source]
    its.count = members


@dissolved_kernel
def pose_impact(
    step: float, candidate: Integers, gap: Floats, mode: Integers, impact: Impact,
    problem: ContactProblem,
) -> None:  # fmt: skip
    """Turn the problem of the members' positions into that of the impact: bounces, not gaps."""
    for place in range(problem.count):
        source, row = impact.member[place], row_of(place, problem.first)
        now = gap[candidate[source]]
        if now < np.inf:
            problem.free[row] -= (max(now, 0.0) if impact.relaxed == 1 else now) / step
        problem.free[row] += impact.bounce[place]
        impact.answer.mode[place] = mode[source]


@rare_kernel
def energy_made(
    problem: ContactProblem, bounce: Floats, share: float, answer: ContactAnswer
) -> float:
    """Kinetic energy that impulses make (J), or zero if it is no more than rounding explains.

    A share of ``bounce`` is in the free velocities. What moves a loop as it turns does work by its
    own velocity, which is left out.
    """
    impulse, first, made, through = answer.impulse, problem.first, 0.0, 0.0
    for place in range(problem.count):
        for row in range(first[place], first[place + 1]):
            normal = row == first[place]
            if normal and problem.set[place] == INTERVAL:
                continue
            before = problem.free[row] - (share * bounce[place] if normal else 0.0)
            after = before
            for column in range(first[problem.count]):
                after += problem.delassus[row, column] * impulse[column]
            if normal and problem.set[place] == LINE:
                before, after = before - after, 0.0
            made += 0.5 * impulse[row] * (before + after)
            through += abs(impulse[row] * before) + abs(impulse[row] * after)
    return made if made > NOTICEABLE_ENERGY * through else 0.0


@kernel
def solve_restitution(
    order: Integers, problem: ContactProblem, solver: ContactWorkspace, impact: Impact,
    answer: ContactAnswer,
) -> int:  # fmt: skip
    """Solve a problem with restitution, and measure the energy it makes; return how that ended.

    If restitution is bounded, the largest share of it is sought that makes none.
    """
    bounce, kept, asked = impact.bounce, impact.kept, 0.0
    for place in range(problem.count):
        asked = max(asked, abs(bounce[place]))
        kept[place] = answer.mode[place]
    least, most, share = 0.0, 1.0, 1.0
    status = SOLVED
    for attempt in range(-1, HALVINGS + 1):
        if attempt >= 0:
            another = 0.5 * (least + most) if attempt < HALVINGS else least
            for place in range(problem.count):
                problem.free[problem.first[place]] += (another - share) * bounce[place]
                answer.mode[place] = kept[place]
            share = another
        status = solve_contact_kernel(order, problem, solver, answer)
        if asked == 0.0:
            break
        impact.gain = energy_made(problem, bounce, share, answer) if status == SOLVED else 0.0
        if attempt < 0:
            impact.gains = int(impact.gain > 0.0)
            if impact.gains == 0 or impact.bounded == 0:
                break
        elif status == SOLVED and impact.gain == 0.0:
            least = share
            for place in range(problem.count):
                kept[place] = answer.mode[place]
        else:
            most = share
    return int(status)


@kernel
def hardest_point(force: Floats) -> int:
    """The contact point with the largest normal force, of (nc, 2)."""
    hardest = 0
    for contact in range(force.shape[0]):
        hardest = contact if force[contact, 0] > force[hardest, 0] else hardest
    return hardest


@rare_kernel
def pose_way_out(
    step: float, candidate: Integers, gap: Floats, velocity: Floats, problem: ContactProblem,
    impact: Impact,
) -> None:  # fmt: skip
    """Write the problem of what is to be added to the velocity of a wedge to push it out.

    Without friction; `problem` is that of the positions, solved with negative gaps counted as zero.
    """
    its = impact.problem
    rows = problem.first[problem.count]
    for row in range(rows):
        its.free[row] = 0.0
        for column in range(rows):
            its.delassus[row, column] = problem.delassus[row, column]
    for place in range(problem.count):
        deep, row = min(gap[candidate[place]], 0.0), problem.first[place]
        its.first[place + 1] = problem.first[place + 1]
        its.friction[place] = its.bound[place] = 0.0
        its.set[place] = LINE if problem.set[place] == LINE else HALF_LINE
        impact.answer.mode[place] = STICK if problem.set[place] == LINE else OPEN
        if problem.set[place] in (CONE, HALF_LINE):
            its.free[row] = velocity[row] + deep / step
            if deep < 0.0:
                impact.answer.mode[place] = STICK
    its.count = problem.count


@kernel
def solve_impact(
    order: Integers, problem: ContactProblem, posed: ContactProblem, solver: ContactWorkspace,
    impact: Impact, assembly: Assembly,
) -> bool:  # fmt: skip
    """Put the answer of the impact in the place of that of the positions; return success.

    ``posed`` is the impact of its members. If these are all, it is the problem of the positions,
    turned into that.
    """
    status = solve_restitution(order, posed, solver, impact, impact.answer)
    answer, its, first = assembly.answer, impact.answer, problem.first
    for place in range(problem.count):
        impact.arriving_mode[place] = answer.mode[place]
        answer.mode[place] = OPEN
    for row in range(first[problem.count]):
        impact.arriving_impulse[row] = answer.impulse[row]
        answer.impulse[row] = 0.0
    for place in range(posed.count):
        source, own = impact.member[place], row_of(place, posed.first)
        row, end = row_of(source, first), row_of(source + 1, first)
        answer.mode[source] = its.mode[place]
        answer.impulse[row] = its.impulse[own]
        if end > row + 1:
            answer.impulse[row + 1] = its.impulse[own + 1]
            answer.velocity[row + 1] = its.velocity[own + 1]
    if posed.count < problem.count:
        find_slips(posed.count, problem, impact.member, answer)
    for i in range(3):
        answer.residual[i] = max(answer.residual[i], its.residual[i])
    return status == SOLVED


@kernel
def find_slips(
    members: int, problem: ContactProblem, member: Integers, answer: ContactAnswer
) -> None:
    """Write the tangential velocities, after an impact, of those that have no part in it."""
    first, known = problem.first, 0
    for place in range(problem.count):
        if known < members and member[known] == place:
            known += 1
            continue
        for row in range(first[place] + 1, first[place + 1]):
            slip = problem.free[row]
            for column in range(first[problem.count]):
                slip += problem.delassus[row, column] * answer.impulse[column]
            answer.velocity[row] = slip
