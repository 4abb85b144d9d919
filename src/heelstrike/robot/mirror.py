"""The mirror image of a robot: left and right exchanged, for every kind of vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.state import State


@dataclass(frozen=True, eq=False)
class Mirror:
    """Exchange of left and right: what the mirror image of the robot has.

    Applied twice it changes nothing. Vectors over the coordinates may be numbers, symbols in an
    array or columns of CasADi; those over the actuators are mirrored by
    ``mirror.among(model.actuator_joint)``.

    Attributes
    ----------
    joint : (nv,) int
        Counterpart of every coordinate and its link (itself for the trunk's).
    sign : (nv,) float
        +1, or -1 where the two joints turn in opposite senses.
    contact : (nc,) int
        Counterpart of every contact point.
    foot : (nf,) int
        Counterpart of every foot.
    reference : (nq,) float
        The robot's `Model.reference`, about which positions are mirrored.
    """

    joint: Integers
    sign: Floats
    contact: Integers
    foot: Integers
    reference: Floats = field(default_factory=lambda: np.zeros(0))

    def among(self, coordinates: Sequence[int] | Integers) -> Mirror:
        """Return the mirror of vectors that have these coordinates only, in this order.

        The counterpart of a coordinate that is not among them is the coordinate itself.

        Parameters
        ----------
        coordinates : sequence of int
            Places of the coordinates in q.

        Returns
        -------
        Mirror
            Their mirror.
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

    def position(self, q: Any, reference: Floats | None = None) -> Any:
        """Mirror positions (..., nq); about another reference than the robot's if one is given.

        Parameters
        ----------
        q : (..., nq) float
            Positions.
        reference : (nq,) float, optional
            Another reference.

        Returns
        -------
        (..., nq) float
            Positions of the mirror image.
        """
        about = self.reference if reference is None else reference
        return self.sign * (self._exchanged(q) - about[self.joint]) + about

    def velocity(self, v: Any) -> Any:
        """Mirror velocities, accelerations or generalised forces, (..., nv).

        Parameters
        ----------
        v : (..., nv) float
            Velocities or accelerations.

        Returns
        -------
        (..., nv) float
            Those of the mirror image.
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
            Its mirror image.
        """
        return State(self.position(state.q), self.velocity(state.v))

    def ranges(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        """Mirror the ends of ranges of the coordinates, (nq,) each.

        Parameters
        ----------
        lower, upper : (nq,) float
            The ends.

        Returns
        -------
        tuple
            Lower and upper ends of the mirror image.
        """
        ends = self.position(lower), self.position(upper)
        return np.minimum(*ends), np.maximum(*ends)

    def at_contacts(self, values: Floats) -> Floats:
        """Mirror forces, positions … of the contact points in x–z, (nc, ...).

        Parameters
        ----------
        values : (nc, ...) float
            A value of each contact point.

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
