"""A walk that is disturbed, and whether it recovers.

Strict recovery: the run completes, the hip stays above 0.65 of its height over the ground, the
trunk leans less than 0.6 rad from where it began, and at the end the robot walks as it did before.
To have completed is not enough: a robot that kneels, stands or walks backwards completes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.control import Law
from heelstrike.errors import SimulationError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import simulate
from heelstrike.sim.time_stepping.method import TimeStepping
from heelstrike.sim.whole_run import whole

# Hip height as a part of that at first, and lean (rad) from it, that still count as upright.
LOWEST_HIP = 0.65
MOST_LEAN = 0.6
# Over so many last steps the speed is taken, and this part of it may differ after a push.
LAST_STEPS = 4.0
NORMAL = 0.2
# On other ground a walk is another one; it must get on at this part of its speed.
GETS_ON = 0.3


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """A walk to be disturbed.

    Attributes
    ----------
    robot : Robot
        A floating robot.
    controller : object with ``torque(t, state, contacts)``, or None
        What makes it walk. One in Python that remembers must forget at time 0.
    state : State
        Where it begins, on a walk that repeats.
    step_length, step_duration : float
        Of a step of that walk, in m and s.
    method : Method
        Way through time; ``TimeStepping(step=1e-3)`` by default.
    ground : Ground
        The ground it walks on undisturbed, level.
    undisturbed : int
        Steps before a disturbance.
    settling : float
        How long after a disturbance the walk has to be normal again, in s.
    control_period : float or None
        As of :func:`~heelstrike.simulate`.

    Raises
    ------
    SimulationError
        If the robot does not float, or a number is not positive.
    """

    robot: Robot
    controller: Controller | Law | None
    state: State
    step_length: float
    step_duration: float
    method: Method = field(default_factory=lambda: TimeStepping(step=1e-3))
    ground: Ground = field(default_factory=Ground)
    undisturbed: int = 2
    settling: float = 7.0
    control_period: float | None = None

    def __post_init__(self) -> None:
        if not self.robot.floating:
            raise SimulationError(
                f"trials of balance need a robot with a trunk that floats; {self.robot.name!r} is "
                "none"
            )
        for name in ("step_length", "step_duration", "settling"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise SimulationError(f"{name} of a trial must be positive, got {value!r}")

    @property
    def speed(self) -> float:
        """Speed of the walk, in m/s."""
        return self.step_length / self.step_duration

    @property
    def begins(self) -> float:
        """When a disturbance may begin, in s."""
        return self.undisturbed * self.step_duration

    def run(self, until: float, **disturbed: Any) -> Run:
        """Walk for as long as it takes to settle after an instant.

        Parameters
        ----------
        until : float
            When the disturbance is over, in s.
        **disturbed
            Arguments of :func:`~heelstrike.simulate` that make the disturbance.

        Returns
        -------
        Run
            The walk.

        Raises
        ------
        SimulationError
            If an argument is not usable.
        """
        given: dict[str, Any] = {"ground": self.ground, "control_period": self.control_period}
        return whole(
            simulate(
                self.robot, self.controller, state=self.state, duration=until + self.settling,
                method=self.method, **(given | disturbed),
            )
        )  # fmt: skip

    def recovered(self, run: Run, *, same_speed: bool = True) -> bool:
        """Whether a disturbed walk is upright throughout and walks on at its end.

        Parameters
        ----------
        run : Run
            The walk.
        same_speed : bool
            Whether its speed must be the old one, to a fifth; else it must get on at all, at three
            tenths of it.

        Returns
        -------
        bool
            Whether it is.
        """
        if not run.completed:
            return False
        height = run.position[:, 1] - run.ground.height(run.position[:, 0])
        first = self.state.q[1] - run.ground.height(self.state.q[0])
        lean = np.abs(run.position[:, 2] - self.state.q[2])
        if height.min() < LOWEST_HIP * first or lean.max() > MOST_LEAN:
            return False
        last = run.time >= run.time[-1] - LAST_STEPS * self.step_duration
        place = run.position[last, 0]
        speed = float((place[-1] - place[0]) / np.ptp(run.time[last]))
        if same_speed:
            return abs(speed - self.speed) <= NORMAL * abs(self.speed)
        return speed / self.speed >= GETS_ON
