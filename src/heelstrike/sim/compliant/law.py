"""What a contact law of compliant ground is: the contract that a new one fulfils.

A law is a frozen dataclass of its settings with one kernel, `force`. In compiled code ``self`` has
the settings that are numbers, by their names; in Python it is the law itself. The kernel is
compiled by itself and called by its address, so that one loop serves every law.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from numba import types

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.kernel_objects import KernelObject
from heelstrike.robot.model import Floats, Integers


class NormalForces(Bundle):
    """Normal forces of contact points, or of joints beyond the ends of their ranges."""

    gap: Floats = array("n")
    speed: Floats = array("n")
    """gap, speed: Gap, negative in the ground, and its rate, positive when leaving."""
    force: Floats = array("n")
    by_gap: Floats = array("n")
    by_speed: Floats = array("n")
    """force, by_gap, by_speed: What the law says: force and derivatives."""


class FrictionForces(Bundle):
    """Tangential forces of contact points."""

    friction: Floats = array("nc")
    normal: Floats = array("nc")
    speed: Floats = array("nc")
    bend: Floats = array("nc")
    """friction, normal, speed, bend: Coefficient, normal force, sliding speed, bend of the
    bristle."""
    force: Floats = array("nc")
    by_normal: Floats = array("nc")
    by_speed: Floats = array("nc")
    by_bend: Floats = array("nc")
    """force, by_normal, by_speed, by_bend: What the law says: force and derivatives."""
    rate: Floats = array("nc")
    rate_by_normal: Floats = array("nc")
    rate_by_speed: Floats = array("nc")
    rate_by_bend: Floats = array("nc")
    """rate, rate_by_normal, rate_by_speed, rate_by_bend: Likewise, of the bend."""
    slides: Integers = array("nc", of=int)
    """Whether each point slides."""


class ContactLaw(KernelObject):
    """What normal and friction laws have in common: a kernel, and numbers that it reads.

    A subclass is a frozen dataclass, and may live outside this package.
    """

    called = "contact law"
    asked: ClassVar[dict[str, str]] = {"force": "self, ..."}

    force: ClassVar[Callable[..., Any]]
    """The kernel of one point, made by :func:`heelstrike.sim.kernel`."""

    forces: ClassVar[type[Bundle]]

    @classmethod
    def signature(cls) -> Any:
        """Of the address of its numbers, and all points."""
        return types.int64(types.int64, cls.forces.compiled_type())


def _press(numbers_at: Any, force: Any) -> Callable[..., int]:
    def press(address: int, points: Any) -> int:
        numbers = numbers_at(address)
        for i in range(points.gap.shape[0]):
            said = (0.0, 0.0, 0.0)
            if points.gap[i] < 0.0:
                said = force(numbers, points.gap[i], points.speed[i])
            points.force[i], points.by_gap[i], points.by_speed[i] = said
        return 0

    return press


def _rub(numbers_at: Any, force: Any) -> Callable[..., int]:
    def rub(address: int, points: Any) -> int:
        numbers = numbers_at(address)
        for i in range(points.normal.shape[0]):
            normal, bend = points.normal[i], points.bend[i]
            said = (0.0, 0.0, 0.0, 0.0)
            rate = (0.0, 0.0, 0.0, 0.0)
            slides = False
            if normal > 0.0 or bend != 0.0:
                said, rate, slides = force(
                    numbers, points.friction[i], normal, points.speed[i], bend
                )
            points.force[i], points.by_normal[i], points.by_speed[i], points.by_bend[i] = said
            points.rate[i], points.rate_by_normal[i] = rate[0], rate[1]
            points.rate_by_speed[i], points.rate_by_bend[i] = rate[2], rate[3]
            points.slides[i] = slides
        return 0

    return rub


class NormalLaw(ContactLaw):
    """A normal force from penetration and its rate.

    Its kernel ``force(self, gap, speed)`` is asked about points in the ground, whose gap is
    negative (m), and returns the force, never negative (N), and its derivatives by the two; of a
    joint beyond the end of its range these are rad and N m. The speed is positive when leaving.
    """

    forces = NormalForces
    entry = staticmethod(_press)


class FrictionLaw(ContactLaw):
    """A tangential force from the normal force, the sliding speed and the bend of a bristle.

    The bend is a number that the law may keep of each point, zero at first. Its kernel
    ``force(self, friction, normal, speed, bend)`` returns the force with its derivatives by normal
    force, speed and bend; the rate of the bend with the same; and whether the point slides. A point
    in the air has no normal force, and is not asked about while its bristle is straight.
    """

    forces = FrictionForces
    entry = staticmethod(_rub)

    @property
    def joint_speed(self) -> float:
        """Speed around which dry friction of the joints is smoothed beside it (rad/s, m/s)."""
        return 1e-4
