"""Gaps that may not become negative: those of the contact points, and those of the joint stops.

A joint stop is a contact without friction or restitution: its gap is the way left to the end of the
joint's range, its force a torque of the joint. The event-driven method numbers stops on from the
contact points, dry joints from the stops, and these kernels tell them apart.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.kernels import point_bias_acceleration
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.geometry import contact_rows, contact_velocity, write_unit_row
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory


@kernel
def gap_now(contact: int, contacts: Contacts, phase: Phase, state: Floats) -> float:
    """Gap of a contact point or joint stop."""
    stop = contact - contacts.gap.shape[0]
    if stop < 0:
        return contacts.gap[contact]
    return phase.stop_side[stop] * (state[phase.stop_joint[stop]] - phase.stop_limit[stop])


@kernel
def gap_velocity(
    contact: int, model: Model, contacts: Contacts, tree: Workspace, phase: Phase, state: Floats
) -> tuple[float, float]:
    """Normal and tangential velocity of a contact point or joint stop."""
    stop = contact - contacts.gap.shape[0]
    if stop < 0:
        return contact_velocity(
            model.contact_link[contact], contacts.position[contact], contacts.normal[contact], tree
        )
    return phase.stop_side[stop] * state[state.shape[0] // 2 + phase.stop_joint[stop]], 0.0


@kernel
def gap_rows(model: Model, memory: Memory, phase: Phase, contact: int, place: int) -> None:
    """Write the Jacobian rows (normal, tangent) of a contact, stop or dry joint as a candidate."""
    stop = contact - model.contact_link.shape[0]
    if stop < 0:
        contact_rows(model, memory, contact, place)
        return
    dry = stop - phase.stop_joint.shape[0]
    if dry < 0:
        write_unit_row(memory, phase.stop_joint[stop], 2 * place, phase.stop_side[stop])
    else:
        write_unit_row(memory, phase.dry_joint[dry], 2 * place + 1, 1.0)


@kernel
def free_gap_acceleration(
    model: Model, memory: Memory, phase: Phase, contact: int, place: int
) -> None:
    """Acceleration b = J v̇ + J̇ v of a contact, stop or dry joint, under ``memory.rate``.

    Of a contact point it is that of the gap and of the sliding velocity: for a rolling disc the
    acceleration of its centre and not of the material point that touches the ground. Of a dry
    joint the bound is written, too. The Jacobian rows must be those of the candidates'
    `place`.
    """
    along_normal = 0.0
    along_tangent = 0.0
    if contact < model.contact_link.shape[0]:
        position = memory.contacts.position[contact]
        normal = memory.contacts.normal[contact]
        radius = model.contact_radius[contact]
        scratch = phase.scratch
        scratch[0, 0] = position[0] + radius * normal[0]
        scratch[0, 1] = position[1] + radius * normal[1]
        point_bias_acceleration(memory.tree, model.contact_link[contact], scratch[0], scratch[1])
        along_normal, along_tangent = into_frame(normal, (scratch[1, 0], scratch[1, 1]))
        along_tangent -= radius * scratch[1, 2]
    for j in range(model.parent.shape[0]):
        along_normal += memory.jacobian[2 * place, j] * memory.rate[j]
        along_tangent += memory.jacobian[2 * place + 1, j] * memory.rate[j]
    memory.problem.free[2 * place] = along_normal
    memory.problem.free[2 * place + 1] = along_tangent
    dry = contact - phase.closed.shape[0] + phase.dry_joint.shape[0]
    if dry >= 0:
        memory.problem.bound[place] = model.dry_friction[phase.dry_joint[dry]]
