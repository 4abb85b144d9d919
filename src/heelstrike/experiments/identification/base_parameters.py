"""Base parameters: combinations of masses, moments and friction that motions can tell at all.

Forces are linear in what is unknown, but never depend on some combinations: of a link that turns
about its parent, mass and first moments act as if some of them were the parent's (M. Gautier and
W. Khalil 1990, *Direct calculation of minimum set of inertial parameters of serial robots*). Which
they are follows from the columns of the equations along any motion that is rich enough: of the
columns that depend on others, what is unknown is told together with those only.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from heelstrike.dynamics.dense import triangulate
from heelstrike.experiments.identification.equations import Equations
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

SEED = 20
"""Of the random motions."""
FASTER = 3.0
"""Standard deviation of their velocities and accelerations, in 1/s and 1/s²."""
OFTEN = 3
"""Equations of random motions for each unknown."""
LESSER = 0.01
"""How much masses count when the largest column is looked for: they go with moments, not moments
with them."""
NO_PART = 1e-7
"""Share of an unknown in a combination, of the sizes of both, that is rounding: columns are exact
to 1e-13, and solving for shares loses some digits."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Combinations of what is unknown that motions can tell."""

    chosen: tuple[int, ...]
    """(b,) Unknowns that each combination is named after."""
    matrix: Floats
    """(b, unknowns) The combinations: shares of all unknowns in each. That of the chosen is one."""
    silent: tuple[int, ...]
    """Unknowns that nothing depends on."""

    def deviation(self, size: Floats) -> Floats:
        """Standard deviations (b,) of the combinations where those of all unknowns are given."""
        found: Floats = np.linalg.norm(self.matrix * size, axis=1)
        return found

    def shares(self, row: int) -> Iterator[tuple[float, int]]:
        """Yield the others in a combination, and their shares.

        Parameters
        ----------
        row : int
            Which combination.
        """
        for k in np.flatnonzero(self.matrix[row]).tolist():
            if k != self.chosen[row]:
                yield float(self.matrix[row, k]), k


def base_parameters(
    equations: Equations, feet: Sequence[int | None], *, ground: bool
) -> BaseParameters:
    """Find the base parameters of a robot.

    Parameters
    ----------
    equations : Equations
        Its equations of motion.
    feet : sequence of int or None
        Feet that stand flat at one time or another; None of a robot that stands fixed.
    ground : bool
        Whether forces of the ground are measured.
    """
    unknowns, rng = equations.unknowns, np.random.default_rng(SEED)
    joints = len(unknowns.joints)
    count = OFTEN * len(unknowns) // joints + 1
    parts = []
    for foot in feet:
        spread = np.array([1.0, FASTER, FASTER])[:, None, None]
        theta = spread * rng.standard_normal((3, count, joints))
        at = equations.columns((theta[0], theta[1], theta[2]), foot)
        parts += [at.motors, at.ground] if ground else [at.motors]
    size = unknowns.size * [LESSER if kind == "mass" else 1.0 for kind in unknowns.kinds]
    stacked = np.concatenate([part.reshape(-1, len(unknowns)) for part in parts])
    factor = np.ascontiguousarray(np.linalg.qr(stacked * size, mode="r"))
    order = np.zeros(len(unknowns), dtype=np.int64)
    rank = triangulate(len(unknowns), len(unknowns), True, factor, order)
    others = np.linalg.solve(np.triu(factor[:rank, :rank]), factor[:rank, rank:])
    others[np.abs(others) < NO_PART] = 0.0
    matrix = np.zeros((rank, len(unknowns)))
    matrix[np.arange(rank), order[:rank]] = 1.0
    matrix[:, order[rank:]] = others * size[order[:rank], None] / size[order[rank:]]
    rows = np.argsort(order[:rank])
    silent = [k for k in order[rank:].tolist() if not matrix[:, k].any()]
    return BaseParameters(tuple(order[:rank][rows].tolist()), matrix[rows], tuple(sorted(silent)))
