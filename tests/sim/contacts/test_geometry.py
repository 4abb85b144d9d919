"""The loops of a step against linear algebra, and against straight-line code."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import pytest
from speed.scenarios import chain

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.contact.ground import Ground
from heelstrike.robot import Robot, load_robot, read_mjcf
from heelstrike.sim import Scheme, TimeStepping
from heelstrike.sim.contacts import straight_line as programs
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    contact_rows,
    evaluate_equations,
    locate_contacts,
    write_unit_row,
)
from heelstrike.sim.memory import allocate_memory

# Sums of a few hundred products of order one, over a mass matrix of condition 1e4 at most.
ROUNDING = 1e-10


def without_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make new simulations run on the loops alone."""
    monkeypatch.setattr(programs, "MOST_COORDINATES", 0)
    monkeypatch.setattr(programs, "_known", WeakKeyDictionary())


@pytest.mark.parametrize("straight", [True, False], ids=["programs", "loops"])
@pytest.mark.parametrize("name", ["bravo7", "walker2d", "rabbit"])
def test_delassus_matrix_and_what_impulses_do(
    name: str, straight: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """G = J A⁻¹ Jᵀ and Δv = A⁻¹ Jᵀ λ, for contact points and for single joints as candidates."""
    if not straight:
        without_programs(monkeypatch)
    robot = load_robot(name)
    draw = np.random.default_rng(5)
    memory = allocate_memory(robot)
    equations, assembly = memory.equations, memory.assembly
    tree, directions, first = equations.tree, assembly.directions, assembly.problem.first
    assert straight == bool(equations.programs[programs.EQUATIONS])
    for _ in range(5):
        memory.q[:] = draw.normal(size=robot.nv)
        evaluate_equations(robot.model, memory.q, memory.v, equations)
        locate_contacts(robot.model, Ground().model(), tree, memory.contacts, memory.surface)
        for contact in range(robot.nc):
            contact_rows(robot.model, tree, memory.contacts, contact, contact, first, directions)
        for component in range(2):  # a stop, which has one row, and a dry joint
            place = robot.nc + component
            first[place + 1] = first[place] + 1 + component
            write_unit_row(
                int(draw.integers(robot.nv)), place, component, -1.0, first, directions.leaf,
                directions.jacobian,
            )  # fmt: skip
        count = robot.nc + 2
        rows = first[count]
        assert rows == 2 * robot.nc + 3
        assemble_delassus(robot.model, count, equations, directions, assembly.problem)
        jacobian = directions.jacobian[:rows]
        inverse = np.linalg.inv(dynamics.mass_matrix(robot, memory.q))
        expected = jacobian @ inverse @ jacobian.T
        found = assembly.problem.delassus[:rows, :rows]
        np.testing.assert_allclose(found, expected, atol=ROUNDING * np.abs(expected).max())
        assembly.answer.impulse[:rows] = draw.normal(size=rows)
        change = inverse @ jacobian.T @ assembly.answer.impulse[:rows]
        v = draw.normal(size=robot.nv)
        after = v.copy()
        impulse = assembly.answer.impulse
        add_impulse(robot.model, int(rows), impulse, directions, equations, after)
        np.testing.assert_allclose(after - v, change, atol=ROUNDING * np.abs(change).max())


def fall(robot: Robot, method: hs.TimeStepping | hs.EventDriven) -> hs.Run:
    q = robot.reference_state().q
    q[1] += 0.02
    return hs.simulate(
        robot, state=hs.State(q, np.zeros(robot.nv)), duration=0.3, method=method,
        ground=Ground(friction=0.6), stop_when_fallen=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "method",
    [
        TimeStepping(),
        TimeStepping(scheme=Scheme.GAP_LINEARISED),
        TimeStepping(scheme=Scheme.LINEARLY_IMPLICIT),
        TimeStepping(scheme=Scheme.MOREAU_JEAN),
        hs.EventDriven(),
    ],
    ids=["impact resolved", "gap linearised", "linearly implicit", "Moreau-Jean", "event driven"],
)
def test_loops_and_programs_simulate_the_same(
    method: hs.TimeStepping | hs.EventDriven, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot that drops on its feet and folds; rounding (1e-16) grows by the folding."""
    straight = fall(load_robot("bravo7"), method)
    without_programs(monkeypatch)
    loops = fall(load_robot("bravo7"), method)
    assert straight.completed
    assert loops.completed
    np.testing.assert_allclose(loops.position[-1], straight.position[-1], atol=1e-8)
    assert loops.contact_force[..., 0].max() > 0.0


def test_a_long_chain_keeps_its_energy() -> None:
    """Sixty hinges swing without friction: total energy is constant, up to the order of the step.

    Semi-implicit Euler wobbles about the energy in proportion to the step, so half the step halves
    the error; that is the method's, and another one would be a mistake in the equations.
    """
    robot = read_mjcf(chain(60), name="chain")
    start = hs.State(robot.model.reference + 0.02, np.zeros(robot.nv))
    errors = []
    for step in (2e-4, 1e-4):
        run = hs.simulate(
            robot, state=start, duration=0.2,
            method=TimeStepping(step=step), stop_when_fallen=False,
        )  # fmt: skip
        assert run.completed
        states = zip(run.position, run.velocity, strict=True)
        kinetic, potential = np.array([dynamics.energy(robot, q, v) for q, v in states]).T
        total = kinetic + potential
        errors.append(np.abs(total - total[0]).max() / kinetic.max())
    assert errors[1] < 0.02
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
