"""What a contact law of compliant ground is: the contract that a new one fulfils.

A law is a frozen dataclass of its settings with one kernel, `force`. In compiled code ``self`` has
the settings that are numbers, by their names; in Python it is the law itself. The kernel is
compiled by itself and called by its address, so that one loop serves every law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache, lru_cache
from typing import Any, ClassVar

from numba import types

from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.compiler.bundle_type import bundle_at
from heelstrike.compiler.compilation import CompileError
from heelstrike.compiler.separate_kernel import SeparateKernel
from heelstrike.errors import SimulationError
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


class ContactLaw:
    """What normal and friction laws have in common: a kernel, and numbers that it reads.

    A subclass is a frozen dataclass, and may live outside this package.
    """

    force: ClassVar[Callable[..., Any]]
    """The kernel of one point, made by :func:`heelstrike.sim.kernel`."""

    forces: ClassVar[type[Bundle]]
    apply: ClassVar[Callable[..., Callable[..., int]]]

    def parameters(self) -> Bundle:
        """Return what ``self`` is in compiled code: the settings that are numbers, by name.

        Returns
        -------
        Bundle
            A law that needs arrays makes a bundle of its own.
        """
        settings = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        numbers = {name: each for name, each in settings.items() if isinstance(each, int | float)}
        kind: Any = type(self)
        return _numbers(kind, *numbers)(**numbers)

    def code(self, parameters: Bundle) -> int:
        """Compile its kernel for these parameters, or load it; return where it is.

        Parameters
        ----------
        parameters : Bundle
            What ``self`` is.

        Returns
        -------
        int
            Address of code that finds the forces of all points.

        Raises
        ------
        SimulationError
            If it has no kernel, or one that cannot be compiled.
        """
        name = type(self).__name__
        if not hasattr(getattr(type(self), "force", None), "py_func"):
            raise SimulationError(
                f"contact law {name} has no kernel: write force(self, ...) under "
                "@heelstrike.sim.kernel into its class"
            )
        try:
            kind: Any = type(self)
            return _compiled(kind, type(parameters)).__wrapper_address__()  # type: ignore[arg-type]
        except CompileError as error:
            raise SimulationError(
                f"the force of contact law {name} cannot be compiled: {error}"
            ) from error


def _press(force: Any, numbers_at: Any) -> Callable[..., int]:
    def press(address: int, points: Any) -> int:
        numbers = numbers_at(address)
        for i in range(points.gap.shape[0]):
            said = (0.0, 0.0, 0.0)
            if points.gap[i] < 0.0:
                said = force(numbers, points.gap[i], points.speed[i])
            points.force[i], points.by_gap[i], points.by_speed[i] = said
        return 0

    return press


def _rub(force: Any, numbers_at: Any) -> Callable[..., int]:
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
    apply = staticmethod(_press)


class FrictionLaw(ContactLaw):
    """A tangential force from the normal force, the sliding speed and the bend of a bristle.

    The bend is a number that the law may keep of each point, zero at first. Its kernel
    ``force(self, friction, normal, speed, bend)`` returns the force with its derivatives by normal
    force, speed and bend; the rate of the bend with the same; and whether the point slides. A point
    in the air has no normal force, and is not asked about while its bristle is straight.
    """

    forces = FrictionForces
    apply = staticmethod(_rub)

    @property
    def joint_speed(self) -> float:
        """Speed around which dry friction of the joints is smoothed beside it (rad/s, m/s)."""
        return 1e-4


@cache
def _numbers(law: Any, *names: str) -> type[Bundle]:
    """Bundle of the settings of a law."""
    return type(law.__name__, (Bundle,), {name: number(float) for name in names})


@lru_cache
def _compiled(law: Any, numbers: Any) -> SeparateKernel:
    """Return the kernel of a law as loops call it: for all points, with the address of numbers."""
    kernel: Any = law.force
    call: Any = law.apply(kernel, bundle_at(numbers))
    # Machine code is kept beside the file of the law, under its name.
    place = kernel.py_func
    call.__module__, call.__name__ = place.__module__, place.__name__
    call.__qualname__ = place.__qualname__
    call.__code__ = call.__code__.replace(
        co_filename=place.__code__.co_filename, co_firstlineno=place.__code__.co_firstlineno
    )
    return SeparateKernel(call, lambda: types.int64(types.int64, law.forces.compiled_type()))
