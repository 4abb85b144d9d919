"""Something to simulate that every engine can have alike."""

from __future__ import annotations

from typing import Any

from heelstrike.contact.ground import Ground
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.field_texts import dataclass
from heelstrike.robot import Robot, State
from heelstrike.sim import Run, simulate
from heelstrike.sim.method import Method
from heelstrike.sim.whole_run import whole

NEVER = 2**62
"""Steps between two rows of a run of which only the end is wanted."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """A robot, where it starts, and what drives it, on level ground."""

    name: str
    """What tables call it."""
    robot: Robot
    state: State
    """Where it starts."""
    duration: float
    """Seconds."""
    feedback: JointFeedback | None = None
    """Its control; None for none."""
    contacts: int | None = None
    """Contact points that must be active throughout, if it shall stand."""
    friction: float = 0.75
    """Coefficient of the ground."""
    restitution: float = 0.0
    """Of the ground."""

    @property
    def ground(self) -> Ground:
        """The ground in heelstrike."""
        return Ground(friction=self.friction, restitution=self.restitution)

    def run(self, method: Method, *, controller: Any = None, record_every: int = NEVER) -> Run:
        """Simulate it in heelstrike, under its own law of control or another controller.

        Parameters
        ----------
        method : Method
            Simulation method.
        controller : controller, optional
            Instead of the scenario's own law.
        record_every : int
            Steps between two rows; by default only beginning and end are kept.

        Returns
        -------
        Run
            The run.
        """
        return whole(
            simulate(
                self.robot,
                self.feedback if controller is None else controller,
                state=self.state,
                duration=self.duration,
                method=method,
                ground=self.ground,
                record_every=record_every,
                stop_when_fallen=False,
            )
        )
