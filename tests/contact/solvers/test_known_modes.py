"""Contacts that go on as they did, without any solver."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.contact.modes import LEMKE, OPEN, SLIP_BACKWARD, SLIP_FORWARD, SOLVED, STICK
from heelstrike.contact.problem import solve_contact, solve_contact_kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.known_modes import repeat
from heelstrike.contact.workspace import ContactAnswer, contact_problem

GENERAL = 0.2
"""Part of the steps that may take the general way; 0.8 did where poor pivots cost digits."""


@pytest.mark.slow
def test_what_stands_straight_on_its_stops_takes_no_solver() -> None:
    """Knees straight and at their stops: of eight rows one nearly depends on those before it."""
    robot = hs.load_robot("walker2d")
    simulation = hs.Simulation(
        robot, state=robot.reference_state(), method=hs.TimeStepping(step=2e-3),
        ground=hs.Ground(friction=0.75), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(3.0)
    reduced, steps = simulation._memory.solver.reduced, 200
    general = 0
    for _ in range(steps):
        reduced.unknowns = 0  # the general way begins with them
        simulation.step()
        general += reduced.unknowns > 0
    assert abs(simulation.time - 3.4) < 1e-9
    assert general <= GENERAL * steps


@pytest.mark.parametrize("part", [0.3, 0.9, 0.999, 1.001])
def test_points_of_a_sole_share_friction_as_far_as_their_cones_reach(part: float) -> None:
    """Two feet on heel and toe each, which press by chance: as the general way shares it.

    `part` is that of the most friction that a foot can hold. Most of them could not hold it in
    equal shares, and above 1 they slip.
    """
    draw, friction, edges = np.random.default_rng(24), 0.6, 0
    for _ in range(20):
        jacobian = np.zeros((8, 6))
        for point, x in enumerate(draw.uniform(-1.0, 1.0, 4)):
            body = 3 * (point // 2)
            jacobian[2 * point, body : body + 3] = 0.0, 1.0, -x
            jacobian[2 * point + 1, body : body + 3] = 1.0, 0.0, -0.5
        delassus = jacobian @ np.diag([0.5, 0.5, 3.0, 0.7, 0.7, 2.0]) @ jacobian.T
        pressed = np.zeros((4, 2))
        pressed[:, 0] = draw.uniform(0.02, 1.0, 4)
        pressed[:, 1] = part * friction * pressed[:, 0] * np.repeat(draw.choice([-1.0, 1.0], 2), 2)
        free = -delassus @ pressed.ravel()
        work = contact_workspace(4)
        problem = contact_problem(
            4, count=4, delassus=delassus, free=free, friction=np.full(4, friction)
        )
        answer = ContactAnswer.allocate(capacity=4, mode=np.full(4, STICK))
        held = repeat(problem, work.settings, work.sticking, work.scaling, answer)
        assert held == (part < 1.0)
        if held:
            general = solve_contact(delassus, free, friction).impulse
            np.testing.assert_allclose(answer.impulse.reshape(4, 2), general, atol=1e-9)
            halves = pressed[:, 1].reshape(2, 2).mean(axis=1).repeat(2)
            edges += bool(np.any(np.abs(halves) > friction * pressed[:, 0]))
    assert edges >= (10 if 0.5 < part < 1.0 else 0)


def asked(delassus: Any, free: Any, friction: Any, modes: Any) -> tuple[bool, ContactAnswer]:
    """Whether modes are repeated, and the answer."""
    count = len(modes)
    work = contact_workspace(count)
    problem = contact_problem(count, count=count, delassus=delassus, free=free, friction=friction)
    answer = ContactAnswer.allocate(capacity=count, mode=np.array(modes, np.int64))
    return repeat(problem, work.settings, work.sticking, work.scaling, answer), answer


def test_what_slips_goes_on_slipping() -> None:
    """As the general way has it, whatever the others do; and both ways occur."""
    draw, seen = np.random.default_rng(3), set()
    for _ in range(120):
        count = int(draw.integers(1, 5))
        jacobian = draw.standard_normal((2 * count, 9))
        delassus, free = jacobian @ jacobian.T, draw.standard_normal(2 * count)
        friction = draw.uniform(0.1, 0.5, count)
        general = solve_contact(delassus, free, friction)
        if not general.certificate.valid or not {SLIP_FORWARD, SLIP_BACKWARD} & {*general.mode}:
            continue
        seen |= set(general.mode)
        held, answer = asked(delassus, free, friction, general.mode)
        assert held
        assert answer.mode.tolist() == [*general.mode]
        np.testing.assert_allclose(answer.impulse, general.impulse.ravel(), atol=1e-11)
    assert seen == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}


def test_stops_lines_and_dry_joints_go_on_beside_what_slips() -> None:
    """Of all kinds, as Lemke's method has it; dry joints slip, too."""
    draw, held, slid = np.random.default_rng(11), 0, 0
    for _ in range(150):
        kind = draw.choice([CONE, HALF_LINE, LINE, INTERVAL], 4)
        jacobian = draw.standard_normal((8, 9))
        jacobian[1::2][(kind == HALF_LINE) | (kind == LINE)] = 0.0
        jacobian[0::2][kind == INTERVAL] = 0.0
        problem = contact_problem(
            4, count=4, delassus=jacobian @ jacobian.T, free=jacobian @ draw.standard_normal(9),
            friction=np.select([kind == CONE, kind == INTERVAL], [0.3, 1.0]),
            bound=np.full(4, 0.1), set=kind,
        )  # fmt: skip
        work, solution = contact_workspace(4), ContactAnswer.allocate(capacity=4)
        if solve_contact_kernel(np.array([LEMKE]), problem, work, solution) != SOLVED:
            continue
        slips = np.isin(solution.mode, [SLIP_FORWARD, SLIP_BACKWARD])
        if not np.any(slips & (kind == CONE)):
            continue
        answer = ContactAnswer.allocate(capacity=4, mode=solution.mode)
        if repeat(problem, work.settings, work.sticking, work.scaling, answer):
            held += 1
            slid += bool(np.any(slips & (kind == INTERVAL)))
            np.testing.assert_allclose(answer.impulse, solution.impulse, atol=1e-10)
    assert held >= 50
    assert slid >= 25


def test_what_comes_to_rest_sticks_at_the_next_try() -> None:
    """A block that friction of 0.8 would hold; and what slips the other way is not repeated."""
    block, free = np.eye(2), np.array([-1.0, 0.8])
    held, answer = asked(block, free, np.array([0.8]), [SLIP_FORWARD])  # at rest, to the last digit
    assert held
    assert answer.mode.tolist() == [STICK]
    np.testing.assert_allclose(answer.impulse, [1.0, -0.8], atol=1e-15)
    held, answer = asked(block, free, np.array([0.5]), [SLIP_BACKWARD])
    assert not held


def test_slipping_rows_that_depend_on_each_other_share_evenly() -> None:
    """Two points at one place: each has half, which has the least norm."""
    twice = np.kron(np.ones((2, 2)), np.eye(2))
    held, answer = asked(twice, np.array([-1.0, 2.0] * 2), np.full(2, 0.5), [SLIP_FORWARD] * 2)
    assert held
    np.testing.assert_allclose(answer.impulse, [0.5, -0.25, 0.5, -0.25], rtol=1e-14)


def test_how_fast_something_slips_is_no_question_of_least_norm() -> None:
    """The same where one of them rubs more: the more it carries, the slower they slip."""
    twice, friction = np.kron(np.ones((2, 2)), np.eye(2)), np.array([0.5, 0.4])
    held, _ = asked(twice, np.array([-1.0, 2.0] * 2), friction, [SLIP_FORWARD] * 2)
    assert not held
