"""Impacts that are whole within the step they fall into.

The gap at the end of a step, linearised, lets a contact that comes down arrive and no more: what is
left of its speed is taken by the next step, from where the first one left it. One contact alone
loses nothing by that. Two problems one after the other are not one problem, though, once other
contacts or friction take part, and the state behind such an impact does not converge.

So position and velocity part ways in a step in which a contact closes. Both start from the same
free velocity v_f and Delassus matrix::

    position   gap + h (J_n v_f + …)_n ≥ 0       the robot moves on with this velocity: it arrives
    velocity   w = G λ + J v_f ≥ −e J_n v        of the contacts that touch: Newton's impact law

The contacts of the impact are those that touch now and touched before or would close if they were
free. It is for the contact that is *new* to say that there is an impact at all: one that touches at
the end of this step, did not at the end of the last one, and is not there already. Elsewhere the
two velocities are the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.modes import OPEN, SOLVED
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.workspace import ContactAnswer, ContactProblem
from heelstrike.robot.model import Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.memory import Memory

Floats = NDArray[np.float64]

# A contact touches when its gap is no more than this (m).
TOUCHING = 1e-9
NEVER = -1


class Impact(Bundle):
    """What a step has to know of the contacts that close in it.

    Attributes
    ----------
    happens : int
        Whether an impact falls into this step.
    step : int
        Number of this step.
    touching : (places,) int
        The last step at whose end each contact point, and then each end of each joint, touched.
    touches : (capacity,) int
        Whether each candidate touches at the end of this step.
    called : (places,) int
        What takes part although it seemed too far away; `calls` tells whether there is any.
    calls : int
    free : (nv,) float
        The free velocity.
    arriving : (nv,) float
        Where there is an impact, the velocity that positions move with.
    member : (capacity,) int
        The candidates that take part.
    problem, answer : ContactProblem, ContactAnswer
        The impact.
    """

    happens: int = cell(int)
    step: int = cell(int)
    touching: Integers = array("places", of=int)
    touches: Integers = array("capacity", of=int)
    called: Integers = array("places", of=int)
    calls: int = cell(int)
    free: Floats = array("nv")
    arriving: Floats = array("nv")
    member: Integers = array("capacity", of=int)
    problem: ContactProblem = part(ContactProblem)
    answer: ContactAnswer = part(ContactAnswer)


def allocate_impact(robot: Robot, capacity: int) -> Impact:
    """Allocate what the steps of a robot need, with nothing known yet."""
    places = robot.nc + 2 * robot.nv
    return Impact.allocate(
        nv=robot.nv,
        nc=capacity,
        capacity=capacity,
        places=places,
        touching=np.full(places, NEVER),
    )


@kernel
def gap_of(model: Model, memory: Memory, candidate: int) -> float:
    """Gap of a contact point or a joint stop."""
    points = model.contact_link.shape[0]
    if candidate < points:
        return memory.contacts.gap[candidate]
    joint = (candidate - points) // 2
    if (candidate - points) % 2 == 1:
        return model.upper[joint] - memory.q[joint]
    return memory.q[joint] - model.lower[joint]


@dissolved_kernel
def begin_step(velocity: Floats, impact: Impact) -> None:
    """Keep the free velocity; nothing is called yet."""
    free = impact.free
    for j in range(velocity.shape[0]):
        free[j] = velocity[j]
    impact.step += 1
    if impact.calls > 0:
        impact.calls = 0
        for place in range(impact.called.shape[0]):
            impact.called[place] = 0


@dissolved_kernel
def note_touching(model: Model, count: int, memory: Memory, impact: Impact) -> None:
    """Keep which of the candidates touch at the end of this step."""
    closable = model.contact_link.shape[0] + 2 * model.parent.shape[0]
    candidates, touches, touching = memory.candidate, impact.touches, impact.touching
    for place in range(count):
        if touches[place] == 1 and candidates[place] < closable:
            touching[candidates[place]] = impact.step


@dissolved_kernel
def call(impact: Impact, place: int) -> None:
    """Call a contact point or stop to take part."""
    impact.calls += 1 - impact.called[place]
    impact.called[place] = 1


@dissolved_kernel
def find_impact(
    model: Model, step: float, problem: ContactProblem, memory: Memory, impact: Impact
) -> int:
    """Note which contacts touch at the end of the step; return how many take part in an impact.

    Zero if no contact is new. `problem` is that of the positions, solved.
    """
    closable = model.contact_link.shape[0] + 2 * model.parent.shape[0]
    candidates, touches, member = memory.candidate, impact.touches, impact.member
    free, velocity = problem.free, memory.answer.velocity
    members = 0
    happens = False
    for place in range(problem.count):
        candidate = candidates[place]
        if candidate >= closable:  # dry friction is always there
            member[members] = place
            members += 1
            continue
        # With the linearised gap in the free term these are gaps at the end, divided by the step.
        arrives = step * velocity[2 * place] <= TOUCHING
        closes = free[2 * place] < 0.0
        gap = gap_of(model, memory, candidate)
        there = gap <= TOUCHING
        touched = impact.touching[candidate] == impact.step - 1
        new = closes and not touched and not there
        happens = happens or (arrives and (new or gap < -TOUCHING))
        touches[place] = arrives
        if there or (arrives and (touched or closes)):
            member[members] = place
            members += 1
    return members if happens else 0


@dissolved_kernel
def pose_impact(
    model: Model, step: float, members: int, problem: ContactProblem, memory: Memory, impact: Impact
) -> None:
    """Write the problem of the impact: what takes part, without the gaps, with restitution."""
    points = model.contact_link.shape[0]
    closable = points + 2 * model.parent.shape[0]
    contacts, its = memory.contacts, impact.problem
    for place in range(members):
        source = impact.member[place]
        for other in range(members):
            column = 2 * impact.member[other]
            for i in range(2):
                for j in range(2):
                    entry = problem.delassus[2 * source + i, column + j]
                    its.delassus[2 * place + i, 2 * other + j] = entry
        candidate = memory.candidate[source]
        normal = problem.free[2 * source]
        if candidate < closable:
            normal -= gap_of(model, memory, candidate) / step
        if candidate < points:
            before, _ = contact_velocity(
                model.contact_link[candidate],
                contacts.position[candidate],
                contacts.normal[candidate],
                memory.tree,
            )
            normal += memory.restitution[candidate] * before
        its.free[2 * place] = normal
        its.free[2 * place + 1] = problem.free[2 * source + 1]
        its.friction[place] = problem.friction[source]
        its.set[place] = problem.set[source]
        impact.answer.mode[place] = memory.answer.mode[source]
    its.count = members


@dissolved_kernel
def solve_impact(
    model: Model, step: float, members: int, order: Integers, problem: ContactProblem,
    memory: Memory, impact: Impact,
) -> bool:  # fmt: skip
    """Put the answer of the impact in the place of that of the positions; return success."""
    pose_impact(model, step, members, problem, memory, impact)
    status = solve_contact_kernel(impact.problem, order, memory.solver, impact.answer)
    answer, its = memory.answer, impact.answer
    for place in range(problem.count):
        answer.mode[place] = OPEN
        answer.impulse[2 * place] = 0.0
        answer.impulse[2 * place + 1] = 0.0
    for place in range(members):
        source = impact.member[place]
        answer.mode[source] = its.mode[place]
        answer.impulse[2 * source] = its.impulse[2 * place]
        answer.impulse[2 * source + 1] = its.impulse[2 * place + 1]
    for place in range(problem.count):
        row = 2 * place + 1
        slip = problem.free[row]
        for column in range(2 * problem.count):
            slip += problem.delassus[row, column] * answer.impulse[column]
        answer.velocity[row] = slip
    for i in range(3):
        answer.residual[i] = max(answer.residual[i], its.residual[i])
    return status == SOLVED
