"""A robot of which the ground holds places, and loops what they join, asked from Python.

The kernels of :mod:`heelstrike.dynamics.held` over the numbers or the symbols of a state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics import held as kernels
from heelstrike.dynamics.kernels import solve_factorized
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.field_texts import dataclass

Array = NDArray[Any]
"""Of numbers, or of symbols."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place of a robot that is held."""

    link: int
    """Its link."""
    position: Array
    """(2,) array. World position (m): of a disc its lowest point."""
    center: Array
    """(2,) array. What moves on evenly while a disc rolls: its centre; of others the same."""
    components: int
    """Two, x and z; or three, the link's rotation too."""


class HeldRobot:
    """A robot of which places are held, and loops closed.

    Parameters
    ----------
    at : Evaluation
        The robot in its state, in numbers or symbols. Velocities matter to accelerations.
    places : sequence of Place
        What is held.
    dependent : sequence of int, optional
        Coordinate that each row is solved for. By default, of numbers, those without a motor first,
        by the largest entries; rows may then be dependent. Symbols have none by default: their rows
        are independent, and answer as :meth:`stopped` and :meth:`accelerated` only.
    loops : bool
        Whether closed loops and couplings are rows, too, after those of the places.
    """

    def __init__(
        self, at: Evaluation, places: Sequence[Place], *, dependent: Sequence[int] | None = None,
        loops: bool = True,
    ) -> None:  # fmt: skip
        self._at, self._places, self._loops = at, tuple(places), loops
        model = at.model
        count = count_rows(model)
        size = sum(place.components for place in places) + count
        self.rows = kernels.HeldRows.allocate(
            {"held": size, "nv": model.nv, "loop_rows": count},
            dtype=object if at.symbolic else None,
        )
        for place in places:
            at.run(
                kernels.add_place, model, at.work, place.link, place.position, place.components,
                self.rows,
            )  # fmt: skip
        if loops:
            at.run(kernels.add_loops, model, at.q, at.v, at.work, self.rows)
        if dependent is None and at.symbolic:
            self.rows.coordinate[:] = np.arange(size)
            return
        if dependent is None:
            without_motor = np.setdiff1d(np.arange(model.nv), model.actuator_joint)
            kernels.solve_rows(without_motor, self.rows)
            return
        at.run(kernels.begin_solving, self.rows)
        for row, coordinate in enumerate(dependent):
            at.run(kernels.solve_row, row, coordinate, self.rows)

    @classmethod
    def on(
        cls,
        at: Evaluation,
        contacts: Iterable[int | str],
        *,
        dependent: Sequence[int] | None = None,
    ) -> HeldRobot:
        """Hold contact points, on level ground: discs roll."""
        radius = at.model.contact_radius
        places = [
            Place(link, center - np.array([0.0, radius[i]]), center, 2)
            for i, link, center in at.contact_centers(contacts)
        ]
        return cls(at, places, dependent=dependent)

    def velocity(self, free: Array) -> Array:
        """Velocities (nv,) of which the independent ones are given."""
        self.rows.target[:] = 0.0
        return self._completed(free)

    def acceleration(self, free: Array) -> Array:
        """Accelerations (nv,) of which the independent ones are given."""
        self._keep()
        return self._completed(free)

    def _completed(self, free: Array) -> Array:
        whole = free.copy()
        self._at.run(kernels.complete, self.rows, whole)
        return whole

    def _keep(self) -> None:
        """Let the rows be of accelerations."""
        first = 0
        for place in self._places:
            self._at.run(
                kernels.keep_place, self._at.work, place.link, place.center, place.components,
                first, self.rows,
            )  # fmt: skip
            first += place.components
        if self._loops:
            self._at.run(kernels.keep_loops, first, self.rows)

    def reaction(self, force: Array) -> tuple[Array, Array]:
        """What is exerted of a generalised force (nv,) that is needed, and what others must supply.

        Returns
        -------
        exerted : (held,) array
            Along the rows, of places then of loops, the shortest there is (N, N m).
        rest : (nv,) array
            On the independent coordinates; zero on the others.
        """
        exerted = self._at.zeros(self.rows.count)
        self._at.run(kernels.forces_of_rows, force, self.rows, exerted)
        rest = self._at.zeros(len(force))
        self._at.run(kernels.find_left, force, self.rows, rest)
        return exerted, rest

    def stopped(self, v: Array) -> tuple[Array, Array]:
        """Velocities (nv,) after a plastic impact of all that is held, and its impulses (held,)."""
        self.rows.target[:] = 0.0
        return self._changed(v, self._response())

    def accelerated(self, force: Array) -> tuple[Array, Array]:
        """Accelerations (nv,) under a generalised force A v̇ (nv,), and the forces (held,)."""
        self._keep()
        response = self._response()
        free = force.copy()
        self._at.run(solve_factorized, self._at.model, response.factor, free)
        return self._changed(free, response)

    def _response(self) -> kernels.Reaction:
        model, at = self._at.model, self._at
        response = kernels.Reaction.allocate(
            {"held": len(self.rows.target), "nv": model.nv}, dtype=object if at.symbolic else None
        )
        at.run(kernels.find_response, model, self.rows, at.work, response)
        return response

    def _changed(self, x: Array, response: kernels.Reaction) -> tuple[Array, Array]:
        changed = x.copy()
        self._at.run(kernels.change_least, self.rows, response, changed)
        return changed, response.force[: self.rows.count]
