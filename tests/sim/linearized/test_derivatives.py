"""Derivatives of steps and runs through contact, against differences of what is simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.sim import Scheme

Floats = NDArray[np.float64]

# Blocks by position, velocity, torque and every number, each of positions and velocities after.
ENOUGH = 1e-7
FORWARD = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0
NEAR, SLIPS = 1e-5, 1e-8


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
    if differences of several sizes are farther apart, as where the solver's tolerance of 1e-9 shows.
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
    for factor in (1.0, 10.0, 100.0):
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


@cache
def falling(robot: str, scheme: Scheme) -> tuple[int, float, set[int]]:
    """Check derivatives along a fall under random torques: how many, the worst, contact modes."""
    built, ground = hs.load_robot(robot), hs.Ground(friction=0.5)
    draw = np.random.default_rng(3)
    activation = 0.0 if scheme in (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED) else 1e-3
    law = hold(Torques(torque=draw.normal(size=built.nu))) if built.nu else None
    state = built.placed(
        built.perturbed(built.reference_state(), position=0.05, velocity=0.3, seed=1), ground
    )
    simulation = hs.Simulation(
        built, law, state=state, ground=ground, stop_when_fallen=False,
        method=hs.TimeStepping(step=1e-3, scheme=scheme, activation=activation),
    )  # fmt: skip
    checked, worst, modes = 0, 0.0, set()
    for _ in range(12):
        simulation.advance(simulation.time + 0.023)
        error = worst_of(simulation)
        if error is not None:
            checked, worst = checked + 1, max(worst, error)
            modes |= set(simulation._memory.reaction.mode.tolist())
    return checked, worst, modes


@pytest.mark.parametrize("robot", hs.builtin_robots())
def test_a_time_step_of_every_robot_has_the_derivatives_that_differences_show(robot: str) -> None:
    """Along a fall onto the ground and onto stops, wherever disturbed steps keep contact modes."""
    checked, worst, _ = falling(robot, Scheme.IMPACT_RESOLVED)
    print(robot, checked, worst, _)
    assert checked >= 4
    assert worst <= ENOUGH


@pytest.mark.parametrize("scheme", Scheme)
def test_so_has_one_of_every_scheme(scheme: Scheme) -> None:
    checked, worst, modes = falling("bravo7", scheme)
    print(scheme, checked, worst, modes)
    assert checked >= 4
    assert worst <= ENOUGH
