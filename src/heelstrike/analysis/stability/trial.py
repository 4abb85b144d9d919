"""A walk that is disturbed, and whether it recovers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace

import numpy as np

from heelstrike.analysis.recovery import Recovery, recovery
from heelstrike.arguments import check_fields
from heelstrike.contact.ground import Ground
from heelstrike.control import Law
from heelstrike.dynamics import contact_positions
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import simulate
from heelstrike.sim.time_stepping.method import TimeStepping
from heelstrike.sim.whole_run import whole

# Steps of the method between two rows, of which a verdict needs few.
ROWS = 5
# Time (s) simulated beyond the verdict: methods with steps end on one.
BEYOND = 0.02
# How far ground that is not level goes, and the corners of rough ground are apart (m).
FAR = 1000.0
SPACING = 0.1
# A foot that is lifted by less than this (m) stands.
ON_IT = 1e-3
# Part of the speed that may differ after a push, and on other ground.
NORMAL = 0.25
GETS_ON = 0.7


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """A walk that is tested under disturbances.

    Raises
    ------
    SimulationError
        If the robot does not float, or a number is not positive.
    """

    robot: Robot
    """A floating robot."""
    controller: Controller | Law | None
    """Object with ``torque(t, state, contacts)``: what makes it walk. One in Python that remembers
    must forget at time 0."""
    state: State
    """Where it begins, on a walk that repeats."""
    step_length: float
    step_duration: float
    """step_length, step_duration: Of a step of that walk, in m and s. Of a robot that stands the
    length is zero; the duration then counts the time before a disturbance, and its phase."""
    method: Method = field(default_factory=lambda: TimeStepping(step=1e-3))
    """Simulation method; ``TimeStepping(step=1e-3)`` by default."""
    ground: Ground = field(default_factory=Ground)
    """The ground it walks on undisturbed, level."""
    undisturbed: int = 2
    """Steps before a disturbance."""
    settling: float = 7.0
    """How long after a disturbance the walk has to be normal again, in s."""
    pitch: float = 0.6
    """Largest angle of the trunk from the upright, in rad."""
    control_period: float | None = None
    """As of :func:`~heelstrike.simulate`."""
    progress: Callable[[float], None] | None = None
    """Called now and then, in every walk, with the simulated time. If it raises, that walk ends
    there as if by Ctrl-C."""
    on_error: OnError = OnError.WARN
    """What to do when the controller raises, as of :func:`~heelstrike.simulate`."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        if not self.robot.floating:
            raise SimulationError(
                "a trial of balance needs a robot with a floating trunk; "
                f"{self.robot.name!r} has none"
            )
        for name in ("step_duration", "settling", "pitch"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise SimulationError(f"{name} of a trial must be positive, got {value!r}")
        if not (np.isfinite(self.step_length) and self.step_length >= 0.0):
            raise SimulationError(
                f"step_length of a trial must not be negative, got {self.step_length!r}; "
                "use zero for a robot that stands"
            )

    @property
    def speed(self) -> float:
        """Speed of the walk, in m/s."""
        return self.step_length / self.step_duration

    @property
    def begins(self) -> float:
        """When a disturbance may begin, in s."""
        return self.undisturbed * self.step_duration

    @property
    def edge(self) -> float:
        """Where ground may change, in m: midway between two footholds of the undisturbed walk."""
        points = contact_positions(self.robot, self.state.q)
        feet = [points[list(foot.contacts)] for foot in self.robot.feet if foot.contacts]
        lowest = points[:, 1].min()
        first = max(float(foot[:, 0].mean()) for foot in feet if foot[:, 1].min() < lowest + ON_IT)
        return first + (self.undisturbed + 0.5) * self.step_length

    def other_ground(
        self, *, friction: float | None = None, restitution: float | None = None,
        slope: float = 0.0, roughness: float = 0.0, spacing: float = SPACING, seed: int = 0,
    ) -> Ground:  # fmt: skip
        """Return ground that is level up to the `edge` and another one beyond it.

        Parameters
        ----------
        friction, restitution : float, optional
            Of all of it; those of the trial's own ground by default.
        slope : float
            Inclination beyond the edge, in rad; positive climbs.
        roughness : float
            Greatest height or depth of corners beyond the edge, in m.
        spacing : float
            Distance between them, in m.
        seed : int
            Of their heights; each is that of a size times one shape.

        Returns
        -------
        Ground
            The ground.

        Raises
        ------
        SimulationError
            If the trial's own ground is not level where other ground is asked for, or a number is
            impossible.
        """
        own = self.ground.model()
        if slope == 0.0 and roughness == 0.0:
            mu = self.ground.friction if friction is None else friction
            bounce = self.ground.restitution if restitution is None else restitution
            return replace(self.ground, friction=mu, restitution=bounce)
        if len(own.friction) > 1:
            raise SimulationError("the ground of a trial must be level: the disturbances change it")
        if not abs(slope) < 0.5 * np.pi:
            raise SimulationError(f"the slope must lie within ±π/2 rad, got {slope}")
        mu = float(own.friction[0]) if friction is None else friction
        bounce = float(own.restitution[0]) if restitution is None else restitution
        edge = self.edge
        if roughness == 0.0:
            corners = [(edge - 1.0, 0.0), (edge, 0.0), (edge + FAR, np.tan(slope) * FAR)]
            return Ground(friction=mu, restitution=bounce, profile=np.array(corners))
        length = 3.0 * self.speed * (self.begins + self.settling) + 2.0
        rough = Ground.rough(
            amplitude=roughness,
            spacing=spacing,
            length=length,
            seed=seed,
            start=edge,
            friction=mu,
            restitution=bounce,
        )
        if slope == 0.0:
            return rough
        profile = np.array(rough.profile)
        profile[:, 1] += np.tan(slope) * np.maximum(profile[:, 0] - edge, 0.0)
        return replace(rough, profile=profile)

    def run(
        self, until: float, *, pushes: Sequence[Push] = (), ground: Ground | None = None,
        record_every: int = ROWS,
    ) -> Run:  # fmt: skip
        """Walk for as long as it takes to settle after an instant.

        Parameters
        ----------
        until : float
            When the disturbance is over, in s.
        pushes : sequence of Push
            What pushes the robot.
        ground : Ground, optional
            What lies there instead of the trial's own ground.
        record_every : int
            Steps of the method between two rows.

        Returns
        -------
        Run
            The walk.

        Raises
        ------
        SimulationError
            If an argument is not usable.
        KeyboardInterrupt
            If Ctrl-C, or `progress`, ended the walk.
        """
        return whole(
            simulate(
                self.robot,
                self.controller,
                state=self.state,
                duration=until + self.settling + BEYOND,
                method=self.method,
                ground=self.ground if ground is None else ground,
                control_period=self.control_period,
                record_every=record_every,
                progress=self.progress,
                pushes=pushes,
                on_error=self.on_error,
            )
        )

    def recovered(
        self, run: Run, disturbed: tuple[float, float], *, same_speed: bool = True
    ) -> Recovery:
        """Judge a disturbed walk; see :func:`~heelstrike.recovery`.

        Parameters
        ----------
        run : Run
            The walk.
        disturbed : (2,) float
            When the disturbance began and ended, in s.
        same_speed : bool
            Whether the speed must be the old one, to a quarter; else the robot must get on at all,
            between three and seventeen tenths of it: on other ground a walk is another one.

        Returns
        -------
        Recovery
            True in a condition if it recovered.

        Raises
        ------
        SimulationError
            If the run has no rows.
        """
        return recovery(
            run, pushed=disturbed, normal_speed=self.speed, after=self.settling, pitch=self.pitch,
            speed=NORMAL if same_speed else GETS_ON,
        )  # fmt: skip
