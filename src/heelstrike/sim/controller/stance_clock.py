"""Which foot stands, since when, and whether its impact is over: one rule for all laws.

A swing foot that meets ground which it can stand on takes over, if the step has gone far enough:
sooner it scuffs. How far a step has gone is the law's affair, by time, by a clock of its own or by
the phase of the robot. If several feet land at the same instant the swing foot does; one that
bounces is in the step it began; in flight nothing changes.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Integers
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

STEEP = 0.6
"""Ground whose normal rises less is a wall, which cannot be stood upon."""

LANDED_SPEED = 1e-3
"""A point of a foot that comes down more slowly than this (m/s) has landed."""


class StanceClock(Bundle):
    """The foot that stands."""

    stance: int = cell(int)
    """Which it is."""
    start: float = cell(float)
    """When its step began (s)."""
    landed: int = cell(int)
    """Whether it is past the impact that made it the stance foot."""


@kernel
def touches(contacts: Contacts, contact_foot: Integers, foot: int) -> bool:
    """Whether a foot is pressed on ground that it could stand on.

    `contact_foot` tells which foot each contact point belongs to.
    """
    for i in range(contact_foot.shape[0]):
        pressed = contact_foot[i] == foot and contacts.force[i, 0] > 0.0
        if pressed and contacts.normal[i, 1] > STEEP:
            return True
    return False


@kernel
def exchange_at_touchdown(
    t: float, gone: float, earliest: float, contacts: Contacts, contact_foot: Integers,
    clock: StanceClock,
) -> bool:  # fmt: skip
    """Exchange stance and swing if the swing foot has met the ground; return whether.

    Only once what has `gone` of the step is `earliest` at the least, in whatever unit.
    """
    swing = 1 - clock.stance
    if gone < earliest or not touches(contacts, contact_foot, swing):
        return False
    clock.stance = swing
    clock.start = t
    clock.landed = 0
    return True


@kernel
def has_landed(
    t: float, longest: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    clock: StanceClock,
) -> bool:  # fmt: skip
    """Whether the stance foot is past the impact that made it the stance foot.

    Heel and toe rarely meet the ground at the same instant, and time stepping spreads an impact
    over two steps. In between, velocities are neither those before the impact nor those after, and
    differ from the reference by as much as the impact itself. A foot that has touched without
    coming flat counts as landed after the `longest` time (s).
    """
    landed = clock.landed == 1 or t - clock.start > longest
    if not landed:
        landed = True
        for i in range(robot.nc):
            if robot.contact_foot[i] == clock.stance:
                robot.contact_velocity(state, contacts, i, robot.three)
                landed = landed and -robot.three[0] < LANDED_SPEED
    clock.landed = 1 if landed else 0
    return landed
