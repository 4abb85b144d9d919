"""Contact points of a time step at a change of mode, where derivatives are those of one side."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from heelstrike.contact.modes import ContactMode
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.sim.contacts.rows import POINT
from heelstrike.sim.simulation import Simulation
from heelstrike.tolerances import CLOSED_GAP

AT_THE_EDGE = 1e-9
"""Impulses this near to the edge of their cone, as a part of the largest or of the robot's weight
over the step, are on it; and speeds (m/s) that are smaller are none."""

SLIPPING = (ContactMode.SLIP_FORWARD, ContactMode.SLIP_BACKWARD)


@dataclass(frozen=True)
class ModeChange:
    """A contact point that is between two modes at the end of a step."""

    contact: str
    """Its name."""
    mode: str
    """That of the derivatives."""
    others: tuple[str, ...]
    """Those of the other sides."""


def other_modes(simulation: Simulation, wanted: Mapping[str, str]) -> tuple[ModeChange, ...]:
    """Return the contact points at a change of mode, and put those that are named to other sides.

    Raises
    ------
    SimulationError
        If one that is named is not at a change to that mode.
    """
    memory, names = simulation._memory, simulation.robot.contact_names
    assembly, answer = memory.assembly, memory.assembly.answer
    changes, left = [], dict(wanted)
    usual = simulation.robot.weight * (simulation.method.step_length or 0.0)
    scale = float(
        np.abs(answer.impulse[: assembly.problem.first[assembly.problem.count]]).max(initial=usual)
    )
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        others = _others(simulation, place, scale)
        contact = names[assembly.candidate[place]]
        if contact in left:
            mode = left.pop(contact)
            if mode not in [each.name.lower() for each in others]:
                left[contact] = mode
                break
            changed = ContactMode[mode.upper()]
            others = (*(each for each in others if each is not changed), _mode(answer, place))
            answer.mode[place] = int(changed)
        if others:
            told = tuple(each.name.lower() for each in others)
            changes.append(ModeChange(contact, _mode(answer, place).name.lower(), told))
    if left:
        contact, mode = next(iter(left.items()))
        raise SimulationError(f"contact point {contact!r} is not at a change to {mode!r}")
    return tuple(changes)


def _mode(answer: object, place: int) -> ContactMode:
    return ContactMode(int(answer.mode[place]))  # type: ignore[attr-defined]


def _others(simulation: Simulation, place: int, scale: float) -> tuple[ContactMode, ...]:
    """Modes that a contact point is at a change to."""
    memory, step = simulation._memory, simulation.method.step_length or 0.0
    answer, problem = memory.assembly.answer, memory.assembly.problem
    normal, tangent = answer.impulse[2 * place : 2 * place + 2]
    rising, sliding = answer.velocity[2 * place : 2 * place + 2]
    mode, friction = _mode(answer, place), float(problem.friction[place])
    if mode is ContactMode.OPEN:
        if step * rising > CLOSED_GAP:
            return ()
        if friction > 0.0 and abs(sliding) <= AT_THE_EDGE:
            return (ContactMode.STICK, *SLIPPING)
        return (SLIPPING[int(sliding < 0.0)],)
    others = [ContactMode.OPEN] if normal <= AT_THE_EDGE * scale else []
    if mode is ContactMode.STICK and friction * normal - abs(tangent) <= AT_THE_EDGE * scale:
        others += SLIPPING if normal <= AT_THE_EDGE * scale else (SLIPPING[int(tangent > 0.0)],)
    if mode in SLIPPING and abs(sliding) <= AT_THE_EDGE:
        others.append(ContactMode.STICK)
    return tuple(others)
