"""What the constraints of a motion mean."""

from __future__ import annotations

from heelstrike.gait import rows


class Kind(rows.Kind):
    """What a constraint is about, and its unit."""

    MOTION = ("equation of motion", "N or N m")
    NORMAL_REST = ("contact point that stays on the ground", "m/s²")
    TANGENT_REST = ("contact point that does not slide", "m/s²")
    NORMAL_STILL = ("contact point that stays on the ground", "m/s")
    TANGENT_STILL = ("contact point that does not slide", "m/s")
    PLACE = ("contact point that stays in its place", "m")
    LOOP_REST = ("loop or coupling that holds", "m/s² or rad/s²")
    LOOP_STILL = ("loop or coupling that holds", "m/s or rad/s")
    LOOP_CLOSED = ("loop or coupling", "m or rad")
    PUSH = ("contact point that pushes", "N")
    FRICTION = ("friction cone", "N")
    HEIGHT = ("contact point above the ground", "m")
    TORQUE = ("torque limit", "N m")
    RANGE = ("joint range", "rad")
    SPEED = ("joint speed limit", "rad/s")
    OWN = ("constraint of your own", "")
    JOIN = ("torque that does not jump within a phase", "N or N m")
    POWER = ("power that a motor spends", "W")
    MOMENTUM = ("momentum through the impact", "N s or N m s")
    TOUCH = ("contact point on the ground at touchdown", "m")
    ARRIVE = ("contact point not rising at touchdown", "m/s")
    NORMAL_STOP = ("contact point that stops", "m/s")
    TANGENT_STOP = ("contact point that stops sliding", "m/s")
    LOOP_STOP = ("loop or coupling that holds", "m/s or rad/s")
    LEAVE = ("contact point free to leave", "m/s")
    IMPULSE = ("impulse that pushes", "N s")
    IMPULSE_FRICTION = ("friction cone of the impulse", "N s")
