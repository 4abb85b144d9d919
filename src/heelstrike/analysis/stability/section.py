"""What goes on from an instant of a closed loop, as coordinates: of the robot, of its memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.stability.loop import STANDS, ClosedLoop, Walk
from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.standing import Chart, Standing
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State
from heelstrike.sim.compliant.method import Compliant
from heelstrike.sim.controller.law import law_of
from heelstrike.sim.simulation import Simulation
from heelstrike.sim.snapshot import Snapshot
from heelstrike.tolerances import STANDING_GAP, STANDING_SPEED

TURNED = 10.0
"""m/s²: over a fixed step a standing point's Jacobian turns, and by so much of it its speed with
it."""

SHORT = 1e-3
"""Seconds after which a number of the memory shows whether it matters, without samples."""

EARLY = 0.004
"""A walk that is early by this part of a return stays so, or is driven by a clock."""

INSTANT = 1e-5
"""Seconds over which a rate is seen where no fixed step is the least."""

INSTANTS = 0.1
"""Numbers that grow by what a return lasts, or as far as it goes, to this part of it, are instants
or places."""

GROWING = 0.01
"""Part of the way of a return by which a place grows at least: heights do on a slope."""

FARTHER = 0.125
"""Metres along the ground by which places are told from instants."""

STEADY = 1e-3
"""A number that varies by less has one as its unit."""

LOOKS = 16
"""Instants of a return at which is seen how much a number varies."""


class Section:
    """Coordinates of the errors in the middle of a step.

    Parameters
    ----------
    loop : ClosedLoop
    walk : Walk
        The walk, undisturbed.
    size : float
        Of the disturbances.
    memory : sequence of str, optional
        Numbers of the controller's memory; by default all that matter.

    Attributes
    ----------
    names : tuple of str
        Of the coordinates: those of the robot, then numbers of the memory.
    of_robot : int
        How many are the robot's.
    directions : (nq + nv, m) float
        These, m of them.
    """

    def __init__(
        self,
        loop: ClosedLoop,
        walk: Walk,
        size: float,
        memory: Sequence[str] | None,
    ) -> None:
        begin, duration = walk.begins[0], walk.duration
        self._loop, self._begin, self._duration = loop, begin, duration
        self._nq = loop.robot.nq
        # Velocities count by the length they make in half a step or so.
        self._scale = np.concatenate((np.ones(self._nq), np.full(loop.robot.nv, 0.25 * duration)))
        self._standing = self.standing(begin)
        self._frame()
        self.words = Words(loop, walk, size, memory)
        self.of_robot = self.directions.shape[1]
        robot = tuple(f"robot {i + 1}" for i in range(self.of_robot))
        self.names = robot + tuple(self.words.names)

    def standing(self, at: Snapshot) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which points are on the ground, (nc,), and along which directions at rest, (nc, 2)."""
        if isinstance(self._loop.simulation.method, Compliant):  # springs hold no point anywhere
            nc = self._loop.robot.nc
            return np.zeros(nc, bool), np.zeros((nc, 2), bool)
        seen = contact_kinematics(self._loop.robot, at.state.q, at.state.v, self._loop.ground)
        step = self._loop.simulation.method.step_length or 0.0
        touching = np.abs(seen.gap) <= STANDING_GAP + TURNED * step * step
        at_rest = (np.abs(seen.velocity) <= STANDING_SPEED + TURNED * step) & touching[:, None]
        at_rest[:, 1] &= at_rest[:, 0]
        return touching, at_rest

    def feet(self, at: Snapshot) -> set[int]:
        """Which feet are on the ground, or next to it."""
        return self.feet_of(at.state, self._loop.ground)

    def feet_of(self, state: State, ground: Ground) -> set[int]:
        """Which feet are on a ground, or next to it."""
        seen = contact_kinematics(self._loop.robot, state.q, state.v, ground)
        lowest = float(seen.gap.min(initial=0.0))
        return {self._loop.foot(int(i)) for i in np.flatnonzero(seen.gap <= lowest + STANDS)}

    def _frame(self) -> None:
        """Find the directions: orthonormal in scaled coordinates, feet and place kept."""
        loop, (touching, at_rest) = self._loop, self._standing
        held = loop.robot.model.latch_joint[self._begin.arrays["memory.loops.held"] > 0]
        first = int(np.argmax(touching)) if touching.any() else 0
        standing = Standing(loop.robot, loop.ground, touching, at_rest, first, held)
        self._chart = Chart(standing, self._begin.state.vector, self._scale)
        self.directions = self._chart.directions
        way = np.zeros(len(self._scale))
        way[:2] = loop.along
        # The first is the way along the ground, which is left out: it does not matter.
        frame = np.column_stack((way, self.directions))
        self._read = np.linalg.pinv(frame * self._scale[:, None])

    def of(self, difference: Floats) -> Floats:
        """Coordinates of a difference of two states (q, v), or of several in columns."""
        coordinates: Floats = (self._read[1:] * self._scale) @ difference
        return coordinates

    def error(self, one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> Floats:
        """Coordinates of what one state (q, v), with its numbers, differs by from another.

        Of a robot that stands elsewhere, places that are remembered are elsewhere by as much.
        """
        apart = one[0] - other[0]
        moved = float(self._read[0] @ (self._scale * apart))
        words = one[1] - other[1] - moved * self.words.places / self.words.unit
        return np.concatenate((self.of(apart), words))

    def missed(self, begin: Snapshot, end: Snapshot) -> Floats:
        """Coordinates of what a walk misses that ends where it began, farther on and later."""
        simulation = self._loop.simulation
        simulation.restore(begin)
        state, numbers = self.read(simulation)
        simulation.restore(end)
        there, later = self.read(simulation)
        along = ((there - state)[:2] @ self._loop.along) * self._loop.along
        there = state + self.flat(there - state)
        there[:2] += along
        later = later - (end.time - begin.time) * self.words.instants / self.words.unit
        return self.error((there, later), (state, numbers))

    def flat(self, difference: Floats) -> Floats:
        """The difference of two states, but for the way along the ground and whole turns."""
        moved, turns = difference.copy(), self._loop.robot.model.axis[:, 0] != 0.0
        angles = moved[: self._nq]
        angles[turns] = np.remainder(angles[turns] + np.pi, 2.0 * np.pi) - np.pi
        moved[:2] -= (difference[:2] @ self._loop.along) * self._loop.along
        return moved

    def disturb(self, simulation: Simulation, begin: Snapshot, coordinates: Floats) -> None:
        """Take up a snapshot, with its coordinates changed."""
        robot, words = coordinates[: self.of_robot], coordinates[self.of_robot :]
        if robot.any():
            moved = self._chart.moved(robot, begin.state.vector)
            begin = begin.moved(State(moved[: self._nq], moved[self._nq :]))
        simulation.restore(begin)
        for place in np.flatnonzero(words):
            self.words.add(simulation, int(place), float(words[place]))

    def read(self, simulation: Simulation) -> tuple[Floats, Floats]:
        """State (q, v) now, and the numbers of the memory in their units."""
        return simulation.state.vector, self.words.read(simulation)

    def later(self, at: Snapshot, seconds: float) -> tuple[Floats, Floats]:
        """State (q, v) of the walk so much later, and the numbers; instants are that much less."""
        simulation = self._loop.simulation
        simulation.restore(at)
        self._loop.advanced(simulation, at.time + seconds, "the walk does not go on")
        state, numbers = self.read(simulation)
        return state, numbers - seconds * self.words.instants / self.words.unit

    def rate(self, at: Snapshot) -> Floats:
        """Rate of the state."""
        short, here = self._loop.simulation.method.step_length or INSTANT, at.state.vector
        one, two = (self.later(at, k * short)[0] - here for k in (1, 2))
        return (2.0 * one - 0.5 * two) / short  # but for the square of `short`

    def way(self, at: Snapshot) -> Floats:
        """Rate of the walk, in coordinates: what being early by a second would be."""
        short = self._loop.grid or INSTANT  # numbers change from sample to sample
        numbers = [self.later(at, k * short)[1] for k in range(3)]
        rate = (2.0 * (numbers[1] - numbers[0]) - 0.5 * (numbers[2] - numbers[0])) / short
        return np.concatenate((self.of(self.rate(at)), rate))

    def put_early(self, simulation: Simulation, begin: Snapshot, seconds: float) -> None:
        """Take up a walk as it is a little later, but at its time."""
        (moved, ahead), (_, numbers) = self.later(begin, seconds), self.later(begin, 0.0)
        simulation.restore(begin.moved(State(moved[: self._nq], moved[self._nq :])))
        for place, change in enumerate(ahead - numbers):
            self.words.add(simulation, place, change)

    @property
    def early(self) -> float:
        """Seconds, a whole number of samples, of which is seen whether they stay."""
        wanted, grid = EARLY * self._duration, self._loop.grid
        return max(round(wanted / grid), 1) * grid if grid > 0.0 else wanted

    def size(self, difference: Floats) -> float:
        """Largest of the entries, those of velocities by the length they make in half a step."""
        return float(np.abs(self._scale * difference).max())

    def ahead(self, difference: Floats, rate: Floats) -> float:
        """Seconds by which a walk is ahead that differs so from another."""
        weighted = self._scale**2 * self.flat(rate)
        return float(weighted @ difference / (weighted @ self.flat(rate)))

    def but_late(self, difference: Floats, rate: Floats) -> Floats:
        """The difference of two states without what comes of being early or late."""
        left: Floats = difference - self.ahead(difference, rate) * self.flat(rate)
        return left


class Words:
    """Numbers that a controller remembers, of those on which it hangs how it goes on.

    A number that one call of the controller makes what it would have been anyway is scratch, and
    none of them. Units are how much each varies in a return; of one that does not, one.

    Attributes
    ----------
    names : list of n str
    unit : (n,) float
    instants : (n,) float
        One for numbers that grow as time does: when a step began, say.
    places : (n,) float
        How far numbers are moved by a walk that begins a metre farther along the ground: where a
        foot stands, say.
    """

    def __init__(
        self,
        loop: ClosedLoop,
        walk: Walk,
        size: float,
        wanted: Sequence[str] | None,
    ) -> None:
        begin = walk.begins[0]
        self._loop, self._begin, self._size = loop, begin, size
        self._opaque = law_of(loop.controller) is None
        simulation = loop.simulation
        simulation.restore(begin)
        found = self._all(simulation)
        if wanted is not None:
            unknown = [name for name in wanted if not any(_is(each, name) for each in found)]
            if unknown:
                raise SimulationError(
                    f"the controller's memory has no numbers {', '.join(unknown)}; it has "
                    f"{', '.join(found) or 'none'}"
                )
            found = {k: v for k, v in found.items() if any(_is(k, name) for name in wanted)}
        self.names = list(found)
        self._units = self._varying(walk.duration)
        # What is not known yet, NaN, cannot be wrong by a little.
        self.names = [name for name in self.names if name not in self._unknown]
        if wanted is None:
            if self._opaque:  # of numbers without names, those always whole count something
                self.names = [name for name in self.names if name not in self._whole]
            self.names = self._that_matter()
        self.unit = np.array([self._units[name] for name in self.names])
        self.instants, self.places = self._growing(walk)

    def _all(self, simulation: Simulation) -> dict[str, float]:
        """All numbers that are no counts, by name."""
        found: dict[str, float] = {}
        if self._opaque:
            kept = simulation.snapshot().arrays.get("controller", np.zeros(0))
            return {f"controller[{i}]": float(x) for i, x in enumerate(np.ravel(kept))}
        if self._loop.controller is None:
            return found
        for name, member, values in simulation.memory.views():
            if member.kind is float:
                for place in np.ndindex(values.shape):
                    index = ", ".join(map(str, place))
                    found[f"memory.{name}{f'[{index}]' if place else ''}"] = float(values[place])
        return found

    def counts(self, simulation: Simulation) -> dict[str, Any]:
        """Whole numbers that it remembers, by name."""
        if self._opaque or self._loop.controller is None:
            return {}
        return {
            f"memory.{name}": values.copy()
            for name, member, values in simulation.memory.views()
            if member.kind is int
        }

    def _varying(self, duration: float) -> dict[str, float]:
        """How much each number varies in a return."""
        simulation = self._loop.simulation
        seen = []
        for look in range(LOOKS + 1):
            simulation.restore(self._begin)
            until = self._begin.time + look * duration / LOOKS
            self._loop.advanced(simulation, until, "the walk does not go on")
            seen.append(list(self._all(simulation).values()))
        rows = np.array(seen).reshape(LOOKS + 1, -1)
        finite = np.isfinite(rows).all(axis=0)
        spread = np.ptp(np.where(finite, rows, 0.0), axis=0)
        every = list(self._all(simulation))
        self._unknown = {name for name, known in zip(every, finite, strict=True) if not known}
        self._whole = {
            name for i, name in enumerate(every) if np.array_equal(rows[:, i], np.rint(rows[:, i]))
        }
        return dict(zip(every, np.where(spread > STEADY, spread, 1.0).tolist(), strict=True))

    def _growing(self, walk: Walk) -> tuple[Floats, Floats]:
        """Tell what numbers are instants, and what places are.

        What grows in a return by what it lasts is an instant, unless it is a place. Walks of 1 m/s
        make no difference between the two, other than where they begin.
        """
        simulation, seen, there = self._loop.simulation, [], []
        for each in walk.begins:
            simulation.restore(each)
            seen.append(self.read(simulation) * self.unit)
            there.append(float(each.state.q[:2] @ self._loop.along))
        lasted = np.diff([each.time for each in walk.begins])[:, None]
        went, grown = np.diff(there)[:, None], np.diff(seen, axis=0)
        instants = np.all(np.abs(grown - lasted) <= INSTANTS * lasted, axis=0)
        # No place goes farther than the robot, and what does not grow need not be asked about.
        far = np.abs(went)
        growing = (np.abs(grown) > GROWING * far) & (np.abs(grown) <= (1.0 + INSTANTS) * far)
        places = np.where(np.all(growing, axis=0), np.mean(grown / went, axis=0), 0.0)
        moved = np.where(instants, 0.0, np.sign(places))  # at least those that are as far
        if places.any() and self._loop.can_be_moved:
            elsewhere = self._loop.fresh(FARTHER)
            self._loop.advanced(elsewhere, walk.begins[0].time, "a walk that begins elsewhere")
            moved = (self.read(elsewhere) * self.unit - seen[0]) / FARTHER
        places[np.abs(moved - places) > INSTANTS * np.abs(moved)] = 0.0
        return np.asarray(instants & (places == 0.0), float), places

    def _that_matter(self) -> list[str]:
        """Those whose disturbance one call of the controller does not undo without a trace."""
        simulation, short = self._loop.simulation, self._loop.grid or SHORT
        size = self._size

        def after(names: list[str]) -> tuple[bytes, dict[str, float]]:
            simulation.restore(self._begin)
            for name in names:
                self._put(simulation, name, size * self._units[name])
            self._loop.advanced(simulation, self._begin.time + short, "the walk does not go on")
            numbers = self._all(simulation)
            others = [value for name, value in numbers.items() if name not in names]
            return np.concatenate((simulation.state.vector, others)).tobytes(), numbers

        usual_numbers = after([])[1]

        def scratch(names: list[str]) -> bool:
            try:
                trace, numbers = after(names)
            except LimitCycleError:
                return False
            ours = [value for name, value in usual_numbers.items() if name not in names]
            usual = np.concatenate((self._usual_state, ours)).tobytes()
            return trace == usual and all(numbers[n] == usual_numbers[n] for n in names)

        self._usual_state = simulation.state.vector
        groups: dict[str, list[str]] = {}
        for name in self.names:
            groups.setdefault(name.split("[")[0], []).append(name)
        kept: list[str] = []
        for names in groups.values():
            if scratch(names):
                continue
            kept += [each for each in names if len(names) == 1 or not scratch([each])]
        return kept

    def _put(self, simulation: Simulation, name: str, change: float) -> None:
        """Change a number."""
        if self._opaque:
            now = simulation.snapshot()
            numbers = np.array(now.arrays["controller"], dtype=np.float64)
            numbers.flat[int(name.split("[")[1][:-1])] += change
            simulation.restore(Snapshot(now.arrays | {"controller": numbers}, now.identity))
            return
        for member, _, values in simulation.memory.views():
            if name == f"memory.{member}":
                values[...] += change
            elif name.startswith(f"memory.{member}["):
                inside = name[len(f"memory.{member}[") : -1]
                values[tuple(int(i) for i in inside.split(", "))] += change

    def add(self, simulation: Simulation, place: int, amount: float) -> None:
        """Change a number by a part of its unit."""
        self._put(simulation, self.names[place], amount * float(self.unit[place]))

    def read(self, simulation: Simulation) -> Floats:
        """The numbers now, in their units."""
        numbers = self._all(simulation)
        return np.array([numbers[name] for name in self.names]) / self.unit


def _is(name: str, wanted: str) -> bool:
    """Whether a number is meant by the name of its array, with or without what it is part of."""
    bare = name.removeprefix("memory.")
    return wanted in (name, bare, bare.split("[")[0], name.split("[")[0])
