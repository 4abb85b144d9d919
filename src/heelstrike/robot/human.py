"""Planar humans of any mass and height, from tables of body segments."""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.robot.builder import RobotBuilder
from heelstrike.robot.robot import Robot


class BodyTable(enum.Enum):
    """Where the numbers of the segments come from."""

    WINTER = "winter"
    """Winter (2009), Biomechanics and Motor Control of Human Movement, table 4.1."""
    DE_LEVA = "de_leva"
    """De Leva (1996), Journal of Biomechanics 29, men."""


class _Segment(NamedTuple):
    mass: float  # share of the body's
    center: float  # from the proximal joint, share of the length
    gyration: float  # radius about the centre of mass, share of the length


# Segments as in BMClab/BMC (CC BY 4.0). De Leva measures the trunk's centre from above; here from
# the hip.
_TABLES = {
    BodyTable.WINTER: {
        "foot": _Segment(0.0145, 0.50, 0.475),
        "shank": _Segment(0.0465, 0.433, 0.302),
        "thigh": _Segment(0.100, 0.433, 0.323),
        "trunk": _Segment(0.678, 0.626, 0.496),
    },
    BodyTable.DE_LEVA: {
        "foot": _Segment(0.0137, 0.4415, 0.257),
        "shank": _Segment(0.0433, 0.4395, 0.251),
        "thigh": _Segment(0.1416, 0.4095, 0.329),
        "trunk": _Segment(0.4346, 1.0 - 0.4486, 0.372),
    },
}
# Lengths as shares of the height. That of the foot is Winter's; trunk, heel and ball are those of
# the body called human7.
_THIGH, _SHANK, _ANKLE, _FOOT = 0.245, 0.246, 0.039, 0.152
_TRUNK, _HEEL, _BALL = 0.28, 0.06 / 1.8, 0.15 / 1.8

_TORQUE = 4.0  # N m a kilogram of body mass
_LIMITS = {"hip": (-90.0, 90.0), "knee": (-10.0, 130.0), "ankle": (-60.0, 60.0)}  # degrees


@takes(RobotError)
def human(
    mass: float = 75.0,
    height: float = 1.8,
    *,
    table: BodyTable | str = BodyTable.WINTER,
    thigh: float | None = None,
    shank: float | None = None,
) -> Robot:
    """Build a planar human of seven links from tables of body segments.

    Coordinates, senses and zeros are those of the built-in human7: trunk x, z, pitch; right hip,
    knee, ankle; left hip, knee, ankle. With 75 kg, 1.8 m and Winter's table it *is* human7, to the
    digits that its source prints, but for wider joint ranges and stronger motors (4 N m a
    kilogram).

    The trunk carries head and arms. Winter's does so by itself; de Leva's does not, and takes their
    mass in addition, at its own centre and radius of gyration.

    Parameters
    ----------
    mass : float
        Mass of the body (kg).
    height : float
        Its height (m).
    table : BodyTable or its value, ``"winter"`` or ``"de_leva"``
        Where the numbers of the segments come from.
    thigh, shank : float, optional
        Lengths from hip to knee and from knee to ankle (m), where they are known; else those that
        go with the height.

    Returns
    -------
    Robot
        The human.

    Raises
    ------
    RobotError
        If mass, height or a length is not positive, or there is no such table.

    Examples
    --------
    >>> import heelstrike as hs
    >>> hs.human(60, 1.65)
    Robot('human': 9 coordinates, 6 actuators, 4 contact points, 60 kg)
    """
    for what, value, unit in (("mass", mass, "kg"), ("height", height, "m")):
        if not 0.0 < value < math.inf:
            raise RobotError(f"the {what} of a human must be positive, got {value} {unit}.")
    try:
        segments = _TABLES[BodyTable(table)]
    except ValueError:
        known = ", ".join(repr(one.value) for one in BodyTable)
        raise RobotError(
            f"there is no table {table!r} of body segments; there are {known}."
        ) from None
    thigh = _THIGH * height if thigh is None else thigh
    shank = _SHANK * height if shank is None else shank
    ankle = _ANKLE * height
    for what, value in (("thigh", thigh), ("shank", shank)):
        if not 0.0 < value < math.inf:
            raise RobotError(f"the {what} of a human must be positive, got {value} m.")
    legs = 2.0 * sum(segments[name].mass for name in ("foot", "shank", "thigh"))

    body = RobotBuilder("human")
    length = _TRUNK * height
    trunk = body.floating_base(
        "trunk",
        (0.0, thigh + shank + ankle),
        mass=(1.0 - legs) * mass,
        inertia=(1.0 - legs) * mass * (segments["trunk"].gyration * length) ** 2,
        center_of_mass=(0.0, segments["trunk"].center * length),
    )
    middle = (segments["foot"].center * _FOOT - _HEEL) * height
    joints = (
        ("hip", "thigh", thigh, (0.0, -segments["thigh"].center * thigh)),
        ("knee", "shank", shank, (0.0, -segments["shank"].center * shank)),
        ("ankle", "foot", _FOOT * height, (middle, -0.5 * ankle)),
    )
    for side in ("right", "left"):
        upper, place = trunk, (0.0, 0.0)
        for joint, name, length, center in joints:
            segment, (low, high) = segments[name], _LIMITS[joint]
            upper = body.hinge(
                f"{side}_{joint}",
                upper,
                at=place,
                link=f"{side}_{name}",
                mass=segment.mass * mass,
                inertia=segment.mass * mass * (segment.gyration * length) ** 2,
                center_of_mass=center,
                limits=(math.radians(low), math.radians(high)),
                torque=_TORQUE * mass,
            )
            place = (0.0, -length)
        body.sole(upper, heel=(-_HEEL * height, -ankle), toe=(_BALL * height, -ankle))
    return body.build()
