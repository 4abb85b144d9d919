"""A step in coordinates of what may differ at its beginning, and its derivative there.

That is exact where the motion can be linearised; where not, it is a difference of whole steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heelstrike.analysis.linearized_step import linearized_step
from heelstrike.analysis.poincare_map import Landing, PoincareMap, derivative
from heelstrike.contact.linearized.standing import Chart
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State

# Disturbance (m, rad, m/s, rad/s) of the central differences. The derivative's error is its square
# times a third derivative of the map, plus the error of the map itself, some 1e-13, over it.
VARIED = 1e-4
# The same of sharp differences, which have an error of the fourth power of it.
VARIED_SHARPLY = 3e-4
# How far (m, m/s) a state may be off the section.
ON_THE_SECTION = 1e-8


@dataclass(frozen=True)
class StepImage:
    """The map in coordinates about a state and a memory: those of a chart, then the memory's."""

    step: PoincareMap
    chart: Chart
    memory: Floats

    def at(self, coordinates: Floats) -> tuple[State, Floats]:
        """Return the state and the memory at some coordinates."""
        place, nq = self.chart.directions.shape[1], self.step.section.robot.nq
        x = self.chart.moved(coordinates[:place])
        if self.chart.off(x) > ON_THE_SECTION:
            raise LimitCycleError("the step leads too far from the states just after touchdown")
        return State(x[:nq], x[nq:]), self.memory + coordinates[place:]

    def coordinates(self, end: Landing) -> Floats:
        """Return the coordinates of the end of a step."""
        if (off := self.chart.off(end.state.vector)) > ON_THE_SECTION:
            raise LimitCycleError(
                "the contact points that stand after the step are not those that stood before it "
                f"({off:.3g} m or m/s between the two)"
            )
        there = self.chart.coordinates(end.state.vector)
        return np.concatenate((there, end.memory - self.memory))

    def __call__(self, coordinates: Floats) -> Floats:
        """Return the coordinates one step later."""
        return self.coordinates(self.step(*self.at(coordinates)))

    def exact(self, state: State, landed: Landing) -> Floats:
        """Derivative of the map where it begins, from flows and events.

        Raises
        ------
        SimulationError
            If something cannot be linearised, which it names.
        """
        if self.step.carries:
            raise SimulationError("its controller carries memory on from step to step")
        directions = self.chart.directions
        slope: Floats = directions.T @ linearized_step(self.step, state, landed).matrix @ directions
        return slope

    def differences(self) -> Floats:
        """The same by central differences."""
        return derivative(self, self._size, VARIED)

    def sharp_differences(self) -> Floats:
        """The same by differences of fourth order; of second where the walk does not go on."""
        try:
            near, far = (derivative(self, self._size, k * VARIED_SHARPLY) for k in (1, 2))
        except LimitCycleError:
            return self.differences()
        return (4.0 * near - far) / 3.0

    @property
    def _size(self) -> int:
        return self.chart.directions.shape[1] + len(self.memory)


class Derivatives:
    """Derivatives of the steps of a walk: exact until one cannot be, differences from then on.

    Attributes
    ----------
    why_not : str
        Why they are differences; empty while they are exact.
    """

    def __init__(self) -> None:
        self.why_not = ""

    def good_enough(self, image: StepImage, state: State, landed: Landing) -> Floats:
        """Return one that is good enough for Newton's method."""
        exact = self._exact(image, state, landed)
        return image.differences() if exact is None else exact

    def sharp(self, image: StepImage, state: State, landed: Landing) -> Floats:
        """Return one as sharp as can be."""
        exact = self._exact(image, state, landed)
        return image.sharp_differences() if exact is None else exact

    def _exact(self, image: StepImage, state: State, landed: Landing) -> Floats | None:
        if not self.why_not:
            try:
                return image.exact(state, landed)
            except SimulationError as error:
                self.why_not = str(error)
        return None
