"""Work done on a robot between and at the instants of an event-driven run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.checks.quadrature import integrate_piece
from scenes.event_judge import INSTANT, EventRows
from scenes.mechanics import generalised
from scenes.record import Rows

Array = NDArray[Any]

IN_CORNER = 1e-9
"""Distance (m) from a second face up to which a force may be that of both faces of a corner."""


def work_of(run: Any, start: Any = None) -> Work:
    """Work in a run that begins at a state `start`, before any impact of the first instant."""
    return Work(EventRows(Rows(run, corners=IN_CORNER, instants=True), start))


class Work:
    """Work between and at the instants of a run."""

    def __init__(self, rows: EventRows) -> None:
        self.rows = rows
        self.power = rows.power()
        self.eventful = rows.eventful()
        contact, joint, _, self.gains = rows.impulses()
        self.kicks = {k: self._kick(k, contact, joint) for k in set(contact) | set(joint)}
        """Generalised impulses by the instant at which they act."""

    def _kick(self, k: int, contact: dict[int, Array], joint: dict[int, Array]) -> Array:
        rows = self.rows
        row, n = rows.first[k], rows.rows.tree.size
        p = contact.get(k, np.zeros((len(rows.rows.contacts), 2)))
        kick = generalised(rows.rows.acting[row : row + 1], p[None])[0] + joint.get(k, np.zeros(n))
        if rows.first[k] != rows.last[k]:
            before, after = rows.rows.v[row], rows.rows.v[rows.last[k]]
            left = rows.rows.matrix[row] @ (after - before) - kick
            kick = kick + rows.rows.ties.explained(row, left, rows.couples(k, p))
        result: Array = kick
        return result

    def of_kick(self, k: int) -> float:
        """Work of the impulses at an instant; a single row shows what follows them."""
        kick = self.kicks.get(k)
        if kick is None:
            return 0.0
        rows = self.rows
        row = rows.last[k]
        after = rows.rows.v[row]
        before = rows.rows.v[rows.first[k]]
        if rows.first[k] == row:
            if k == 0:  # it has acted before the run begins
                return 0.0
            before = after - np.linalg.solve(rows.rows.matrix[row], kick)
        return 0.5 * float(kick @ (before + after))

    def pieces(self) -> list[tuple[float, float]]:
        """Times between which nothing jumps."""
        rows = self.rows
        begin, end = rows.instant[0], rows.instant[-1]
        inside = rows.edges[(rows.edges > begin + INSTANT) & (rows.edges < end - INSTANT)]
        ends = np.unique(np.concatenate((rows.instant[self.eventful], [begin, end], inside)))
        ends = ends[np.concatenate(([True], np.diff(ends) > INSTANT))]
        return list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))

    def nodes(self, low: float, high: float) -> Array:
        """Rows that show the forces of a smooth piece.

        What begins at an event shows in the last row of its instant, what ends there in the first
        of two, but for discs that meet a second face: it has the place of that one, at which the
        force of the first does not act. At the edge of a push it is not known which side a row
        shows.
        """
        rows = self.rows
        first, end = np.searchsorted(rows.instant, (low - INSTANT, high + INSTANT))
        chosen = []
        for k in range(first, end):
            at = rows.instant[k]
            if len(rows.edges) and np.min(np.abs(rows.edges - at)) <= INSTANT:
                continue
            row, two = int(rows.first[k]), rows.first[k] != rows.last[k]
            if at < high - INSTANT:
                chosen.append(int(rows.last[k]))
            elif not self.eventful[k] or (two and not self._meets(row)):
                chosen.append(row)
        return np.array(chosen, dtype=int)

    def _meets(self, row: int) -> bool:
        rows = self.rows.rows
        discs = rows.cornered[row] & (rows.model.contact_radius > 0.0)
        return bool(np.any(discs & np.any(rows.force[row] != 0.0, axis=1)))

    def between(self) -> tuple[Array, Array, int]:
        """Work from each instant to the next, how far it may be wrong, and intervals left out."""
        rows = self.rows
        count = len(rows.instant) - 1
        work, doubt = np.zeros(count), np.zeros(count)
        out = 0
        for low, high in self.pieces():
            inside = (rows.instant > low + INSTANT) & (rows.instant < high - INSTANT)
            edges = np.concatenate(([low], rows.instant[inside], [high]))
            nodes = self.nodes(low, high)
            first = int(np.searchsorted(rows.instant, low + INSTANT)) - 1
            owners = first + np.arange(len(edges) - 1)
            if not len(nodes):
                out += 1
                near = rows.last[first]
                doubt[owners] += np.abs(self.power[near]) * np.diff(edges)
                continue
            when = rows.rows.time[nodes]
            part, wrong = integrate_piece(when, self.power[nodes], edges)
            work[owners] += part
            doubt[owners] += wrong
        return work, doubt, out
