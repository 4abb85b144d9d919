"""What can be set of a live simulation, and who makes it again when it is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.errors import ControllerError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.view.live.dimension import LiveDimension, dimension_of

if TYPE_CHECKING:
    from heelstrike.view.live.dimension import AnyGround, AnySimulation, Outline

Value = float | str
FRICTION = "friction"
"""Name of the control of the ground's friction, which acts at once."""


@dataclass(frozen=True)
class Control:
    """Something that a viewer can set: one of several words, or a number within bounds."""

    name: str
    label: str
    """name, label: By which it is known, and what people read."""
    value: Value
    """What it is at first."""
    options: tuple[str, ...] = ()
    """The words; none for a number."""
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    """low, high, step: Bounds of a number and the distance between two that a slider offers."""
    unit: str = ""
    at_once: bool = False
    """Whether it acts at once; otherwise the simulation starts again."""
    resets: tuple[str, ...] = ()
    """Controls that have their first values again when this one is set."""

    def accepts(self, value: Any) -> bool:
        """Whether a value is one that it can have."""
        if self.options:
            return isinstance(value, str) and value in self.options
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number and self.low <= value <= self.high

    def described(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {**vars(self), "options": list(self.options), "resets": list(self.resets)}


class Stage(ABC):
    """Makes the simulation that is watched, of the values of its controls."""

    @property
    def dimension(self) -> LiveDimension:
        """That of its robots; the plane by default."""
        from heelstrike.view.live.plane import LIVE_PLANE

        return LIVE_PLANE

    @abstractmethod
    def controls(self, values: Mapping[str, Any]) -> tuple[Control, ...]:
        """What can be set, where some things are set already; with none, what there is at first."""

    def fitted(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values of all controls: those given where they can be had, others as at first."""
        controls = self.controls(values)
        wanted = {control.name: values.get(control.name) for control in controls}
        return {c.name: wanted[c.name] if c.accepts(wanted[c.name]) else c.value for c in controls}

    @abstractmethod
    def simulation(
        self, values: Mapping[str, Any], progress: Callable[[str], None]
    ) -> AnySimulation:
        """Make the simulation at its beginning.

        Parameters
        ----------
        values : mapping of str to float or str
            Of all controls, by name.
        progress : callable
            Is told in words what is going on, now and then.

        Raises
        ------
        HeelstrikeError
            If there is none of these values.
        """

    def outline(self, values: Mapping[str, Any]) -> Outline | None:  # noqa: ARG002
        """Where the robot is to begin, to be shown until there is a simulation, and at once.

        None where the simulation is there at once.
        """
        return None

    def found(self, values: Mapping[str, Any], simulation: AnySimulation) -> dict[str, Any]:
        """Values as they are in a simulation that has started again, or was taken back.

        What was set at once and later than that is forgotten with all else that came later.
        """
        if FRICTION not in values:
            return dict(values)
        return {**values, FRICTION: friction_of(simulation.ground)}

    @abstractmethod
    def ground(self, values: Mapping[str, Any], simulation: AnySimulation) -> AnyGround:
        """Make the ground of the values that act at once."""


class GivenStage(Stage):
    """A simulation that somebody else made, watched from where it is now.

    Parameters
    ----------
    simulation : Simulation or SpatialSimulation
        The simulation.
    """

    def __init__(self, simulation: AnySimulation) -> None:
        self._simulation, self._begun = simulation, False
        self._start = snapshot_of(simulation)
        ground = simulation.ground
        own = any(box.friction is not None for box in getattr(ground, "boxes", ()))
        self._controls = (friction_control(friction_of(ground), boxes_apart=own),)

    @property
    def dimension(self) -> LiveDimension:
        """That of its robot."""
        return dimension_of(self._simulation.robot)

    def controls(self, values: Mapping[str, Any]) -> tuple[Control, ...]:  # noqa: ARG002
        """The friction of the ground, everywhere but on boxes that have their own."""
        return self._controls

    def simulation(
        self,
        values: Mapping[str, Any],  # noqa: ARG002
        progress: Callable[[str], None],  # noqa: ARG002
    ) -> AnySimulation:
        """Return it as it is; when asked again, as it was then."""
        if not self._begun:
            self._begun = True
        elif self._start is None:
            raise SimulationError(
                "its controller takes no part in snapshots, so that it cannot begin again: give "
                "the controller methods snapshot() and restore(numbers)"
            )
        else:
            self._simulation.restore(self._start)
        return self._simulation

    def ground(self, values: Mapping[str, Any], simulation: AnySimulation) -> AnyGround:
        """Return its ground with another friction."""
        return replace(simulation.ground, friction=values["friction"])


def snapshot_of(simulation: AnySimulation) -> Any:
    """Return a snapshot; None if the controller takes no part in them."""
    try:
        return simulation.snapshot()
    except ControllerError:
        return None


def friction_of(ground: AnyGround) -> float:
    """Friction that the control of it shows: in space without that of boxes that have their own."""
    friction = ground.model().friction
    return float(friction[0] if hasattr(ground, "boxes") else np.min(friction))


def friction_control(value: float, *, boxes_apart: bool = False) -> Control:
    """Return the control of the ground's friction, from which some boxes may be left out."""
    label = "friction μ, but for boxes with their own" if boxes_apart else "friction μ"
    return Control(FRICTION, label, value, low=0.0, high=max(1.5, value), step=0.01, at_once=True)


def slope_control(usual: float, steepest: float) -> Control:
    """Return the control of the ground's slope (degrees), at least as steep as usual."""
    end = max(steepest, abs(usual))
    return Control("slope", "slope", usual, low=-end, high=end, step=0.5, unit="°")


MILLISECONDS = " ms"
STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Steps that are offered, in ms."""


def step_control(first: float) -> Control:
    """Return the control of the time step, which is some length (s) at first."""
    step = 1e3 * first
    offered = sorted({*STEPS, float(f"{step:.6g}")})
    words = tuple(f"{each:g}{MILLISECONDS}" for each in offered)
    return Control("step", "step", f"{step:.6g}{MILLISECONDS}", words)


def step_of(words: str) -> float:
    """Return a step (s) that was chosen there."""
    return 1e-3 * float(words.removesuffix(MILLISECONDS))
