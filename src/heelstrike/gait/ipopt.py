"""IPOPT, through CasADi, in a form that Ctrl-C can stop.

CasADi looks for signals in the functions that IPOPT evaluates, takes what they raise for a failure
of the function, and returns; nobody learns that there was a Ctrl-C. So the signal is held back, and
the search stopped after the iteration in which it came.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi

from heelstrike.interruption import deferred_interrupts


class Ipopt:
    """A nonlinear program for IPOPT.

    Parameters
    ----------
    problem : mapping
        CasADi expressions of the unknowns ``x``, the objective ``f`` and the constraints ``g``.
    options : mapping
        Options of ``casadi.nlpsol``.
    """

    def __init__(self, problem: Mapping[str, Any], options: Mapping[str, Any]) -> None:
        self._watch = _Watch(problem["x"].numel(), problem["g"].numel())
        self._solver = casadi.nlpsol(
            "gait", "ipopt", dict(problem), {**options, "iteration_callback": self._watch}
        )

    def solve(self, **arguments: Any) -> tuple[Any, Any]:
        """Solve it; return what ``casadi.nlpsol`` found, and its statistics.

        Raises
        ------
        KeyboardInterrupt
            At Ctrl-C, once the iteration under way has ended.
        """
        with deferred_interrupts() as interrupted:
            self._watch.stop = interrupted
            found = self._solver(**arguments)
        return found, self._solver.stats()


class _Watch(casadi.Callback):  # type: ignore[misc]
    """What IPOPT asks after every iteration: whether to stop."""

    def __init__(self, unknowns: int, constraints: int) -> None:
        casadi.Callback.__init__(self)
        self._sizes = {"f": 1, "x": unknowns, "lam_x": unknowns, "g": constraints}
        self._sizes |= {"lam_g": constraints, "lam_p": 0}
        self.stop: Callable[[], bool] = lambda: False
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Return how many results of a program it is shown."""
        return int(casadi.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return how many answers it gives."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """Return the shape of a result."""
        return casadi.Sparsity.dense(self._sizes[casadi.nlpsol_out(index)], 1)

    def eval(self, _: Any) -> list[int]:
        """Return whether to stop."""
        return [int(self.stop())]
