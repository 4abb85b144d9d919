"""The contact problem of an instant: which contacts take part, and what is asked of them."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD, SOLVED, STICK
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import CONE, INTERVAL
from heelstrike.robot.model import Integers
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory


@kernel
def solve_candidates(
    count: int, memory: Memory, slide: Integers, accelerations: bool, order: Integers
) -> int:
    """Solve the contact problem of the candidates at the level of accelerations or velocities.

    Matrix and free term are those in the memory. Of accelerations, points that slide are prescribed
    to go on doing so: their friction is known. Forces or impulses and modes go to
    ``memory.answer``. Returns the solver's status.
    """
    dry = slide.shape[0] - memory.dry_joint.shape[0]
    for place in range(count):
        contact = memory.candidate[place]
        memory.problem.set[place] = INTERVAL if contact >= dry else CONE
        memory.problem.friction[place] = memory.friction[contact]
        memory.answer.mode[place] = STICK
        if accelerations:
            if slide[contact] > 0:
                memory.answer.mode[place] = SLIDING_FORWARD
            elif slide[contact] < 0:
                memory.answer.mode[place] = SLIDING_BACKWARD
            elif memory.mode[contact] < SLIDING_FORWARD:
                memory.answer.mode[place] = memory.mode[contact]
    memory.problem.count = count
    return int(solve_contact_kernel(memory.problem, order, memory.solver, memory.answer))


@kernel
def share_redundant(count: int, memory: Memory, phase: Phase) -> None:
    """Find forces within their limits where the equations leave open who carries what.

    A biped that stands on stuck joints, or a table on four legs: the equations of motion have many
    solutions, and the one at hand may leave a friction cone or pull at a contact that others
    relieve. While the contact problem says that everything stays as it is, its forces stand, and no
    limit is reached.
    """
    short = False
    for place in range(count):
        contact = memory.candidate[place]
        short = short or phase.value[2 * contact] < 0.0
        short = short or (phase.holder[contact] == 1 and phase.value[2 * contact + 1] < 0.0)
    if not short or solve_candidates(count, memory, phase.slide, True, phase.order) != SOLVED:
        return
    for place in range(count):
        contact = memory.candidate[place]
        found = memory.answer.mode[place]
        if found == OPEN:
            return
        if found != STICK and phase.slide[contact] == 0 and memory.friction[contact] > 0.0:
            return
    for place in range(count):
        contact = memory.candidate[place]
        phase.force[contact, 0] = memory.answer.impulse[2 * place]
        phase.force[contact, 1] = memory.answer.impulse[2 * place + 1]
        if phase.value[2 * contact] < 0.0:
            phase.value[2 * contact] = 1.0
        if phase.holder[contact] == 1 and phase.value[2 * contact + 1] < 0.0:
            phase.value[2 * contact + 1] = 1.0
