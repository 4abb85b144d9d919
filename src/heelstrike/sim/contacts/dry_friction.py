"""Dry friction of the joints as contacts that are always closed.

Dry friction τ of a joint with velocity v and breakaway torque τ_c obeys Coulomb's law with a
normal force that is known: ``|τ| ≤ τ_c``, and ``τ = −τ_c sign v`` where v is not zero. It enters
the contact problem as a group of its own, whose set is the interval of these torques, or of what
they come to over a step, and whose velocity or acceleration is the joint's. So a robot with dry
joints, flat feet and joint stops is one problem with one certificate.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.contacts.rows import DRY_JOINT, Rows


@kernel
def add_dry_force(slide: Integers, limit: Floats, rows: Rows, force: Floats) -> None:
    """Add the friction of the joints that slide, which is known, to the generalised force.

    `slide` tells the direction of every entry of the table, zero where it sticks; `limit` is the
    breakaway torque of every joint of the robot.
    """
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[dry]
        force[joint] -= slide[dry] * limit[joint]
