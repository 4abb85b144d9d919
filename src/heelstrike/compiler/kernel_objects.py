"""Objects whose kernels loops call by their address: frozen dataclasses, perhaps of somebody else.

In compiled code ``self`` has the settings that are numbers, by their names; in Python it is the
object itself. The kernels are compiled apart from the loops, so that one loop serves every object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache, lru_cache
from typing import Any, ClassVar

import numpy as np

from heelstrike.compiler.bundle import Bundle, number
from heelstrike.compiler.bundle_type import bundle_at
from heelstrike.compiler.compilation import CompileError
from heelstrike.compiler.separate_kernel import SeparateKernel
from heelstrike.errors import SimulationError


class KernelObject:
    """A frozen dataclass of settings, with kernels that read them.

    A kind of objects says what it is called, which kernels it must have, and how loops call them.
    """

    called: ClassVar[str]
    """What messages call it."""

    asked: ClassVar[dict[str, str]]
    """Names of the kernels that it must have, and their arguments for messages."""

    entry: ClassVar[Callable[..., Callable[..., Any]]]
    """Makes what loops call: of ``numbers_at``, which turns an address into ``self``, and of the
    kernels."""

    @classmethod
    def signature(cls) -> Any:
        """Numba signature of what loops call."""
        raise NotImplementedError

    def check(self) -> None:
        """Refuse an object whose class is no frozen dataclass, or lacks a kernel.

        Raises
        ------
        SimulationError
            That says what its class has to have.
        """
        kind: Any = type(self)
        for asked, arguments in self.asked.items():
            if not hasattr(getattr(kind, asked, None), "py_func"):
                raise SimulationError(
                    f"{self.called} {kind.__name__} has no kernel: write {asked}({arguments}) "
                    "under @heelstrike.sim.kernel into its class"
                )
        if not (is_dataclass(kind) and vars(kind)["__dataclass_params__"].frozen):
            raise SimulationError(
                f"{self.called} {kind.__name__} is no frozen dataclass: write "
                "@dataclass(frozen=True) above its class"
            )

    def parameters(self) -> Bundle:
        """Return what ``self`` is in compiled code: the settings that are numbers, by name.

        Returns
        -------
        Bundle
            An object that needs arrays makes a bundle of its own.
        """
        self.check()
        kind: Any = self
        settings = {field.name: getattr(self, field.name) for field in fields(kind)}
        return numbers_of(
            type(self),
            {name: float(each) for name, each in settings.items() if isinstance(each, int | float)},
        )

    def code(self, parameters: Bundle) -> int:
        """Compile its kernels for these parameters, or load them; return where they are.

        Parameters
        ----------
        parameters : Bundle
            What ``self`` is.

        Returns
        -------
        int
            Address of what loops call.

        Raises
        ------
        SimulationError
            If a kernel is missing, or cannot be compiled.
        """
        self.check()
        kind: Any = type(self)
        try:
            numbers: Any = type(parameters)
            return _compiled(kind, numbers).__wrapper_address__()
        except CompileError as error:
            told = " or ".join(self.asked)
            raise SimulationError(
                f"the {told} of {self.called} {kind.__name__} cannot be compiled: {error}"
            ) from error


def numbers_of(kind: type, numbers: Mapping[str, float | int]) -> Bundle:
    """Return a bundle of numbers by name, for objects of a class; whole ones stay whole."""
    whole = tuple(isinstance(each, int | np.integer) for each in numbers.values())
    return _bundle_of(kind, tuple(numbers), whole)(**numbers)


@cache
def _bundle_of(kind: Any, names: tuple[str, ...], whole: tuple[bool, ...]) -> type[Bundle]:
    kinds = zip(names, whole, strict=True)
    return type(
        kind.__name__, (Bundle,), {name: number(int if one else float) for name, one in kinds}
    )


@lru_cache
def _compiled(kind: Any, numbers: Any) -> SeparateKernel:
    """Return the kernels of a class as loops call them, with the address of numbers."""
    kernels = [getattr(kind, name) for name in kind.asked]
    call: Any = kind.entry(bundle_at(numbers), *kernels)
    # Machine code is kept beside the file of the class, under the name of its first kernel.
    place = kernels[0].py_func
    call.__module__, call.__name__ = place.__module__, place.__name__
    call.__qualname__ = place.__qualname__
    call.__code__ = call.__code__.replace(
        co_filename=place.__code__.co_filename, co_firstlineno=place.__code__.co_firstlineno
    )
    return SeparateKernel(call, kind.signature)
