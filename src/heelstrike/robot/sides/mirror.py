"""The mirror image of a robot: left and right exchanged, for every kind of vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.state import State


@dataclass(frozen=True, eq=False)
class Mirror:
    """Exchange of left and right: what the mirror image of the robot has.

    Applied twice it changes nothing. Vectors over the coordinates may be numbers, symbols in an
    array or columns of CasADi; those over the actuators are mirrored by
    ``mirror.among(model.actuator_joint)``.
    """

    joint: Integers
    """(nv,) Counterpart of every coordinate and its link (itself for the trunk's)."""
    sign: Floats
    """(nv,) +1, or -1 where the two joints turn in opposite senses."""
    contact: Integers
    """(nc,) Counterpart of every contact point."""
    foot: Integers
    """(nf,) Counterpart of every foot."""
    reference: Floats = field(default_factory=lambda: np.zeros(0))
    """(nq,) The robot's `Model.reference`, about which positions are mirrored."""

    def among(self, coordinates: Sequence[int] | Integers) -> Mirror:
        """Return the mirror of vectors that have some of the coordinates only.

        Parameters
        ----------
        coordinates : sequence of int
            Indices of the coordinates in the order of the vectors. One whose counterpart is not
            among them counts as its own.

        Returns
        -------
        Mirror
            It mirrors vectors over these coordinates.
        """
        chosen = np.asarray(coordinates, dtype=np.int64)
        place = {coordinate: i for i, coordinate in enumerate(chosen.tolist())}
        joint = [place.get(int(self.joint[j]), i) for i, j in enumerate(chosen)]
        return replace(
            self,
            joint=np.array(joint, dtype=np.int64),
            sign=self.sign[chosen],
            reference=self.reference[chosen],
        )

    @property
    def offset(self) -> Floats:
        """What a mirrored position adds: it is ``sign * q[joint] + offset``, (nq,)."""
        offset: Floats = self.reference - self.sign * self.reference[self.joint]
        return offset

    def position(self, q: Any) -> Any:
        """Mirror positions.

        Parameters
        ----------
        q : (..., nq) array
            Positions, in m and rad.

        Returns
        -------
        (..., nq) array
            Those of the mirror image.
        """
        about = self.reference
        return self.sign * (self._exchanged(q) - about[self.joint]) + about

    def velocity(self, v: Any) -> Any:
        """Mirror velocities, accelerations or generalised forces.

        Parameters
        ----------
        v : (..., nv) array
            One of these.

        Returns
        -------
        (..., nv) array
            That of the mirror image.
        """
        return self.sign * self._exchanged(v)

    def state(self, state: State) -> State:
        """Mirror a state.

        Parameters
        ----------
        state : State
            The state.

        Returns
        -------
        State
            That of the mirror image.
        """
        return State(self.position(state.q), self.velocity(state.v))

    def ranges(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        """Mirror ranges of the coordinates.

        Parameters
        ----------
        lower, upper : (nq,) float
            Ends of the ranges, in m and rad.

        Returns
        -------
        tuple of (nq,) float
            Those of the mirror image.
        """
        ends = self.position(lower), self.position(upper)
        return np.minimum(*ends), np.maximum(*ends)

    def at_contacts(self, values: Floats) -> Floats:
        """Mirror what the contact points have in x–z: forces, positions, gaps.

        Parameters
        ----------
        values : (nc, ...) float
            A row for every contact point.

        Returns
        -------
        (nc, ...) float
            Those of the mirror image.
        """
        return values[self.contact]

    def _exchanged(self, vector: Any) -> Any:
        return (
            vector[..., self.joint]
            if isinstance(vector, np.ndarray)
            else vector[self.joint.tolist()]
        )
