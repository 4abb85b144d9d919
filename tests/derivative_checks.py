"""Derivatives of steps against differences of what is simulated, block by block."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.sim import Scheme
from heelstrike.sim.linearized.step import NOT_SMOOTH
from heelstrike.sim.whole_run import whole

Floats = NDArray[np.float64]

# Blocks by position, velocity, torque and every number, each of positions and velocities after.
ENOUGH = 1e-7
FORWARD = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0
NEAR, SLIPS = 1e-5, 1e-8
NOTHING = 1e-6


class Torques(hs.Bundle):
    """Torques that a law asks for, whatever happens."""

    torque: Floats = hs.array("nu")


@hs.controller
def hold(torque: Floats, parameters: Torques) -> None:
    """Ask for the same torques all the time."""
    for i in range(torque.shape[0]):
        torque[i] = parameters.torque[i]


def differences(
    function: Callable[[Floats], Floats], ways: Floats, size: Floats, two_sided: Sequence[bool]
) -> Floats:
    """Derivatives of a function along some ways at zero: of order four, to one side or to both."""
    columns = []
    for way, change, both in zip(ways.T, size, two_sided, strict=True):
        if both:
            near, far = (
                (function(k * change * way) - function(-k * change * way)) / (2.0 * k * change)
                for k in (1, 2)
            )
            columns.append((4.0 * near - far) / 3.0)
        else:
            seen = [function(k * change * way) for k in range(5)]
            columns.append(FORWARD @ np.array(seen) / change)
    return np.array(columns).T


def allowed(simulation: hs.Simulation) -> tuple[Floats, list[bool]]:
    """Ways in which positions may change without a foot in the ground or a joint beyond its stop.

    The first leave all gaps that are closed as they are; the others open one each.
    """
    robot, q = simulation.robot, simulation.state.q
    gap = simulation.contacts.gap
    normal = hs.dynamics.contact_jacobian(robot, q)[np.abs(gap) < NEAR, 0]
    model = robot.model
    lower, upper = np.abs(q - model.lower) < NEAR, np.abs(q - model.upper) < NEAR
    rows = np.vstack([normal, np.eye(robot.nv)[lower], -np.eye(robot.nv)[upper]])
    if not len(rows):
        return np.eye(robot.nq), [True] * robot.nq
    _, singular, across = np.linalg.svd(rows)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    still, lift = across[rank:].T, np.linalg.pinv(rows)
    opens = (rows @ lift).min(axis=0) > -1e-9
    return np.hstack([still, lift[:, opens]]), [True] * still.shape[1] + [False] * opens.sum()


def modes_of(simulation: hs.Simulation) -> tuple[object, ...]:
    """What contacts and stops did in the last step, and whether an impact fell into it.

    Of two points of a foot that turns by next to nothing one slips by next to nothing.
    """
    reaction = simulation._memory.reaction
    slips = np.sign(reaction.slip) * (np.abs(reaction.slip) > SLIPS)
    return (reaction.mode > 0).tolist(), slips.tolist(), int(simulation._work.impact.happens)


def worst_of(simulation: hs.Simulation) -> float | None:
    """Largest error of a block of the derivatives of the next step, in parts of the block.

    None if disturbed steps have other contact modes: there is no derivative to all sides then; or
    if differences of several sizes are farther apart, where the solver's tolerance of 1e-9 shows.
    """
    robot, begin = simulation.robot, simulation.snapshot()
    nq, size = robot.nq, robot.nq + robot.nv
    torque = simulation.parameters.torque.copy() if robot.nu else np.zeros(0)
    ways, two_sided = allowed(simulation)
    found = hs.step_derivatives(simulation, answers=False)
    modes, changed = modes_of(simulation), False

    def after(change: Floats) -> Floats:
        nonlocal changed
        state = hs.State(begin.state.q + change[:nq], begin.state.v + change[nq:size])
        simulation.restore(begin.moved(state))
        if robot.nu:
            simulation.parameters.torque[:] = torque + change[size:]
        simulation.step()
        changed = changed or modes_of(simulation) != modes
        return simulation.state.vector

    every = np.zeros((size + robot.nu, ways.shape[1] + robot.nv + robot.nu))
    every[:nq, : ways.shape[1]] = ways
    every[nq:, ways.shape[1] :] = np.eye(robot.nv + robot.nu)
    sides = two_sided + [True] * (robot.nv + robot.nu)
    blocks = np.split(np.arange(len(sides)), np.cumsum([ways.shape[1], robot.nv]))
    told = np.hstack([found.state, found.torque]) @ every
    sizes = np.repeat([1e-6, 1e-5, 1e-3], [len(block) for block in blocks])
    sizes[: ways.shape[1]][~np.array(two_sided, dtype=bool)] = 1e-7
    tries = []
    for factor in (1.0, 2.5, 100.0):
        changed = False
        seen = differences(after, every, factor * sizes, sides)
        tries += [] if changed else [seen]
    simulation.restore(begin)
    if robot.nu:
        simulation.parameters.torque[:] = torque
    worst = 0.0
    for rows in (slice(0, nq), slice(nq, None)):
        for block in blocks:
            scale = np.linalg.norm(told[rows, block]) or 1.0
            apart = [
                np.linalg.norm((one - other)[rows, block]) / scale
                for one, other in combinations(tries, 2)
            ]
            if min(apart, default=1.0) > ENOUGH:  # differences do not know better themselves
                return None
            off = [np.linalg.norm((told - seen)[rows, block]) / scale for seen in tries]
            worst = max(worst, min(off))
    return worst


@dataclass
class Checks:
    """What a comparison along a motion has shown."""

    count: int = 0
    """Steps or intervals that were compared; the others have contact modes that disturbances
    change, or differences that do not know better than `ENOUGH` themselves."""
    worst: float = 0.0
    """Largest error of a block, in parts of the block."""
    modes: set[int] = field(default_factory=set)
    """Contact modes that were seen."""

    def add(self, error: float | None) -> bool:
        """Count a comparison, if it is one; return whether."""
        if error is None:
            return False
        self.count, self.worst = self.count + 1, max(self.worst, error)
        return True


def time_steps(
    robot: hs.Robot, scheme: Scheme = Scheme.IMPACT_RESOLVED, *, state: hs.State | None = None,
    pushes: Sequence[hs.Push] = (), braked: Sequence[str] = (), tries: int = 12,
) -> Checks:  # fmt: skip
    """Compare derivatives of steps along a fall under random torques, onto ground and stops."""
    ground, draw = hs.Ground(friction=0.5), np.random.default_rng(3)
    activation = 0.0 if scheme in (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED) else 1e-3
    law = hold(Torques(torque=draw.normal(size=robot.nu))) if robot.nu else None
    start = robot.reference_state() if state is None else state
    if state is None:
        start = robot.placed(robot.perturbed(start, position=0.05, velocity=0.3, seed=1), ground)
    simulation = hs.Simulation(
        robot, law, state=start, ground=ground, stop_when_fallen=False, pushes=pushes,
        method=hs.TimeStepping(step=1e-3, scheme=scheme, activation=activation),
    )  # fmt: skip
    if braked:
        simulation.braked = braked
    found = Checks()
    for _ in range(tries):
        simulation.advance(simulation.time + 0.023)
        if found.add(worst_of(simulation)):
            found.modes |= set(simulation._memory.reaction.mode.tolist())
    return found


FINE = hs.EventDriven(rtol=1e-13, atol=1e-14)


def blocks_of(
    robot: hs.Robot, x: Floats, span: float, ground: hs.Ground, *, size: float, **acting: Any
) -> tuple[hs.StepDerivatives, Floats, hs.Run]:
    """Derivatives of an event-driven interval, differences by its beginning, and the run."""

    def simulated(begin: Floats) -> hs.Simulation:
        state = hs.State(begin[: robot.nq], begin[robot.nq :])
        return hs.Simulation(
            robot, state=state, method=FINE, ground=ground, stop_when_fallen=False, **acting
        )

    def after(change: Floats) -> Floats:
        simulation = simulated(x + change)
        simulation.advance(span)
        return simulation.state.vector

    found = hs.step_derivatives(simulated(x), until=span, numbers=("friction", "mass"))
    seen = differences(after, np.eye(len(x)), np.full(len(x), size), [True] * len(x))
    simulation = simulated(x)
    simulation.advance(span)
    return found, seen, whole(simulation.record)


def interval(
    robot: hs.Robot, *, seed: int, span: float = 0.15, **acting: Any
) -> tuple[float, set[str]] | None:
    """Compare derivatives of an event-driven fall; return the worst error and what happened.

    It ends before shocks accumulate. None where disturbed falls have other events.
    """
    ground, model, nq = hs.Ground(friction=0.5), robot.model, robot.nq
    state = robot.perturbed(robot.reference_state(), position=0.05, velocity=0.5, seed=seed)
    q = np.clip(state.q, model.lower + 1e-3, model.upper - 1e-3)
    state = robot.placed(hs.State(q, state.v), ground)
    x = hs.State(state.q + 0.005 * np.eye(nq)[1], state.v).vector
    fall = hs.Simulation(
        robot,
        state=hs.State(x[:nq], x[nq:]),
        method=FINE,
        ground=ground,
        stop_when_fallen=False,
        **acting,
    )
    fall.advance(span)
    ends = [event.time for event in whole(fall.record).events if event.kind in NOT_SMOOTH]
    span = min([span, *(0.9 * end for end in ends)])
    tries = []
    for size in (1e-5, 4e-5):
        found, seen, run = blocks_of(robot, x, span, ground, size=size, **acting)
        tries.append(seen)
    worst = 0.0
    for rows in (slice(0, nq), slice(nq, None)):
        for columns in (slice(0, nq), slice(nq, None)):
            told, scale = found.state[rows, columns], np.linalg.norm(found.state[rows, columns])
            if scale < NOTHING:
                continue
            near, far = (each[rows, columns] for each in tries)
            if np.linalg.norm(near - far) > ENOUGH * scale:
                return None
            worst = max(worst, min(np.linalg.norm(told - each) for each in (near, far)) / scale)
    return worst, {event.kind.name for event in run.events}
