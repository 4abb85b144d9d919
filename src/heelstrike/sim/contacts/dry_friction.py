"""Dry friction of the joints as contacts that are always closed.

Dry friction τ of a joint with velocity v and breakaway torque τ_c obeys Coulomb's law with a
normal force that is known: ``|τ| ≤ τ_c``, and ``τ = −τ_c sign v`` where v is not zero. It enters
the contact problem as a group of its own, whose set is the interval of these torques, or of what
they come to over a step, and whose velocity or acceleration is the joint's. So a robot with dry
joints, flat feet and joint stops is one problem with one certificate.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import INTERVAL
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.geometry import write_unit_row
from heelstrike.sim.memory import Memory


@kernel
def select_dry_joints(model: Model, step: float, count: int, memory: Memory) -> int:
    """Append the joints with dry friction to the candidates of a step; return how many there are.

    They are numbered on from the joint stops.
    """
    nv = model.parent.shape[0]
    first = model.contact_link.shape[0] + 2 * nv
    for place in range(memory.dry_joint.shape[0]):
        joint = memory.dry_joint[place]
        write_unit_row(memory, joint, 2 * count + 1, 1.0)
        memory.problem.free[2 * count + 1] = memory.next_v[joint]
        memory.problem.set[count] = INTERVAL
        memory.problem.friction[count] = 1.0
        memory.problem.bound[count] = step * model.dry_friction[joint]
        memory.answer.mode[count] = memory.dry_mode[place]
        memory.candidate[count] = first + place
        count += 1
    return count


@kernel
def note_dry_joint(place: int, impulse: float, step: float, found: int, memory: Memory) -> None:
    """Keep the torque and the mode that the contact problem found for a dry joint."""
    memory.friction_torque[memory.dry_joint[place]] = impulse / step
    memory.dry_mode[place] = found


@kernel
def dry_force(dry_joint: Integers, slide: Integers, limit: Floats, force: Floats) -> None:
    """Add the friction of the joints that slide, which is known, to the generalised force.

    `slide` tells the direction of every joint in `dry_joint`, zero where it sticks; `limit` is
    the breakaway torque of every joint of the robot.
    """
    for place in range(dry_joint.shape[0]):
        joint = dry_joint[place]
        force[joint] -= slide[place] * limit[joint]
