"""The spring-loaded inverted pendulum: a point mass that walks and runs on massless springs.

A leg touches down at its rest length and at one angle to the ground, and pushes along the line from
foothold to mass until it is long again. Both gaits follow from angle, stiffness and energy (H.
Geyer, A. Seyfarth, R. Blickhan, *Compliant leg behaviour explains basic dynamics of walking and
running*, Proceedings of the Royal Society B 273, 2006). A massless leg has no place among the links
of a robot, whose dynamics need mass; it is a force between the mass and its foothold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from heelstrike.arguments import check_fields
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

Phases = list[tuple[Floats, Floats]]

RTOL, ATOL = 1e-13, 1e-14
LONGEST_PHASE = 3.0  # s; a phase that lasts longer leads to no step
SPRING_DISTURBANCE = 3e-5  # m, rad; of the differences of fourth order that make multipliers


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """A gait that repeats."""

    state: Floats
    """(n,) Walking: height (m) and direction of the velocity (rad, up) where the foot is below the
    mass. Running: height of the apex (m)."""
    multipliers: NDArray[np.complex128]
    """(n,) Floquet multipliers of a step."""
    period: float
    length: float
    """period, length: Of a step, in s and m."""
    contact: float
    """Running: how long a foot is on the ground. Walking: how long both are (s)."""


@dataclass(frozen=True, kw_only=True)
class SpringMass:
    """A point mass on massless springs.

    Raises
    ------
    SimulationError
        If a number is not positive, or the angle not below 90°.

    Notes
    -----
    A massless leg has no place among the links of a robot, whose dynamics need mass; it is a force
    between the mass and its foothold, and this a model of its own.

    Examples
    --------
    >>> import heelstrike as hs
    >>> run = hs.SpringMass(stiffness=20_000.0, angle=1.1868, energy=1784.8).running(0.94)
    >>> bool(abs(run.multipliers[0]) < 0.2)
    True
    """

    stiffness: float
    """Of a leg, in N/m."""
    angle: float
    """Angle of attack: of a leg to the ground at touchdown, in rad."""
    energy: float
    """In J; nothing is lost."""
    mass: float = 80.0
    leg: float = 1.0
    gravity: float = 9.81
    """mass, leg, gravity: In kg, m and m/s²."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise SimulationError(
                    f"{name} of a spring-mass model must be positive, got {value!r}"
                )
        if self.angle >= 0.5 * np.pi:
            raise SimulationError(
                f"the angle of attack must lie below π/2 rad, got {self.angle:.6g}: it is counted "
                "from the ground, in rad"
            )

    @property
    def touchdown_height(self) -> float:
        """Height of the mass when a leg touches down, in m."""
        return float(self.leg * np.sin(self.angle))

    def walking(self, guess: Sequence[float]) -> Cycle:
        """Find a walk that repeats near a state.

        Parameters
        ----------
        guess : (2,) float
            Height (m) and direction of the velocity (rad).

        Returns
        -------
        Cycle

        Raises
        ------
        LimitCycleError
            If there is none near.
        """
        return self._cycle(self._walking_step, guess)

    def running(self, guess: float) -> Cycle:
        """Find a run that repeats near an apex.

        Parameters
        ----------
        guess : float
            Height of the apex (m).

        Returns
        -------
        Cycle

        Raises
        ------
        LimitCycleError
            If there is none near.
        """
        return self._cycle(self._running_step, [guess])

    def course(self, cycle: Cycle, *, steps: int = 1) -> tuple[Floats, Floats]:
        """Go through steps of a gait that repeats.

        Parameters
        ----------
        cycle : Cycle
            What :meth:`walking` or :meth:`running` returned.
        steps : int
            How many steps.

        Returns
        -------
        time : (n,) float
            Instants as dense as the motion asks for, in s.
        motion : (n, 4) float
            Place x, z of the mass (m), from 0 on, and velocity (m/s).
        """
        step = self._walking_step if len(cycle.state) == 2 else self._running_step
        times, way, state = [np.zeros(1)], 0.0, np.asarray(cycle.state)
        motions: list[Floats] = []
        for _ in range(steps):
            phases: list[tuple[Floats, Floats]] = []
            state, _, length, _ = step(state, phases)
            for time, motion in phases:
                times.append(times[-1][-1] + time[1:])
                motions.append(motion[1 if motions else 0 :] + np.array([way, 0.0, 0.0, 0.0]))
            way += length
        return np.concatenate(times), np.concatenate(motions)

    def _cycle(
        self, step: Callable[[Floats], tuple[Floats, float, float, float]], guess: Sequence[float]
    ) -> Cycle:
        found = root(lambda x: step(x)[0] - x, guess, tol=1e-13)
        state = np.asarray(found.x, dtype=np.float64)
        image, period, length, contact = step(state)
        if not np.abs(image - state).max() < 1e-10:
            raise LimitCycleError(
                f"no gait of the spring-mass model repeats near {tuple(guess)}: its state still "
                f"changes by {np.abs(image - state).max():.3g} a step"
            )
        columns = [
            (4.0 * (step(state + h)[0] - step(state - h)[0]))
            - 0.5 * (step(state + 2.0 * h)[0] - step(state - 2.0 * h)[0])
            for h in SPRING_DISTURBANCE * np.eye(len(state))
        ]
        slope = np.array(columns).T / (6.0 * SPRING_DISTURBANCE)
        multipliers = np.linalg.eigvals(slope).astype(np.complex128)
        return Cycle(
            state=state, multipliers=multipliers, period=period, length=length, contact=contact
        )

    def _walking_step(
        self, state: Floats, phases: Phases | None = None
    ) -> tuple[Floats, float, float, float]:
        """From above one foot to above the next."""
        height, direction = state
        pressed = 0.5 * self.stiffness * (self.leg - height) ** 2
        speed = self._speed(self.energy - self.mass * self.gravity * height - pressed)
        start = np.array([0.0, height, speed * np.cos(direction), speed * np.sin(direction)])
        rear = 0.0
        landing, first = self._until(start, (rear,), self._lands, phases)
        front = landing[0] + self.leg * np.cos(self.angle)
        leaving, both = self._until(landing, (rear, front), self._leaves(rear), phases)
        end, last = self._until(leaving, (front,), self._above(front), phases)
        image = np.array([end[1], np.arctan2(end[3], end[2])])
        return image, first + both + last, front, both

    def _running_step(
        self, state: Floats, phases: Phases | None = None
    ) -> tuple[Floats, float, float, float]:
        """From apex to apex."""
        (height,) = state
        energy = self.energy - self.mass * self.gravity * height
        start = np.array([0.0, height, self._speed(energy), 0.0])
        landing, first = self._until(start, (), self._lands, phases)
        foot = landing[0] + self.leg * np.cos(self.angle)
        leaving, contact = self._until(landing, (foot,), self._leaves(foot), phases)
        end, last = self._until(leaving, (), self._apex, phases)
        return end[1:2], first + contact + last, float(end[0]), contact

    def _speed(self, kinetic: float) -> float:
        """Speed of the mass by its kinetic energy."""
        if not kinetic > 0.0:
            raise LimitCycleError(
                f"{self.energy:.6g} J are not enough for this height: the mass would not move"
            )
        return float(np.sqrt(2.0 * kinetic / self.mass))

    def _rate(self, feet: Sequence[float]) -> Callable[[float, Floats], Floats]:
        def rate(_: float, x: Floats) -> Floats:
            force = np.array([0.0, -self.mass * self.gravity])
            for foot in feet:
                line = np.array([x[0] - foot, x[1]])
                length = np.hypot(*line)
                force += self.stiffness * (self.leg - length) / length * line
            return np.array([x[2], x[3], *(force / self.mass)])

        return rate

    def _until(
        self, start: Floats, feet: Sequence[float], event: Callable[[float, Floats], float],
        phases: Phases | None = None,
    ) -> tuple[Floats, float]:  # fmt: skip
        """State at an event, a value that falls through zero, and when it was."""

        def falling(t: float, x: Floats) -> float:
            return event(t, x)

        falling.terminal, falling.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            self._rate(feet), (0.0, LONGEST_PHASE), start, method="DOP853", rtol=RTOL, atol=ATOL,
            events=falling,
        )  # fmt: skip
        if not len(run.t_events[0]):
            raise LimitCycleError(
                "the spring-mass model falls or flies on before it completes a step; try "
                "another stiffness, angle or energy"
            )
        # Newton's method on the length of the last phase: events of dense output are less exact.
        end, time = self._refined(start, feet, event, float(run.t_events[0][0]))
        if phases is not None:
            within = run.t < time
            phases.append((np.append(run.t[within], time), np.vstack((run.y.T[within], end))))
        return end, time

    def _refined(
        self, start: Floats, feet: Sequence[float], event: Callable[[float, Floats], float],
        time: float,
    ) -> tuple[Floats, float]:  # fmt: skip
        rate = self._rate(feet)
        for _ in range(3):
            end = solve_ivp(rate, (0.0, time), start, method="DOP853", rtol=RTOL, atol=ATOL).y[
                :, -1
            ]
            h = 1e-6
            slope = event(0.0, end + h * rate(0.0, end)) - event(0.0, end - h * rate(0.0, end))
            time -= event(0.0, end) / (slope / (2.0 * h))
        return end, time

    def _lands(self, _: float, x: Floats) -> float:
        return float(x[1] - self.touchdown_height)

    def _leaves(self, foot: float) -> Callable[[float, Floats], float]:
        return lambda _, x: float(self.leg - np.hypot(x[0] - foot, x[1]))

    def _above(self, foot: float) -> Callable[[float, Floats], float]:
        return lambda _, x: float(foot - x[0])

    def _apex(self, _: float, x: Floats) -> float:
        return float(x[3])
