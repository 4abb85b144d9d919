"""The compiled entry that simulation loops call: warm starts, counters, prescribed sliding."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from contact_oracle import residual
from contact_problems import random_problem

from heelstrike.contact.modes import (
    FISCHER_BURMEISTER,
    GAUSS_SEIDEL,
    LEMKE,
    OPEN,
    RAY,
    SLIDING_BACKWARD,
    SLIDING_FORWARD,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
    WARM_START,
)
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.known_modes import repeat
from heelstrike.contact.workspace import ContactAnswer, contact_problem

ALL = (LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL)


@dataclass
class Caller:
    """A simulation's memory: larger than any one problem, reused from one to the next."""

    capacity: int = 8
    problem: Any = field(init=False)
    answer: Any = field(init=False)
    work: Any = field(init=False)
    mode: Any = field(init=False)
    impulse: Any = field(init=False)
    velocity: Any = field(init=False)
    residual: Any = field(init=False)

    def __post_init__(self) -> None:
        self.problem = contact_problem(self.capacity)
        self.answer = ContactAnswer.allocate(capacity=self.capacity)
        for name in ("mode", "impulse", "velocity", "residual"):
            setattr(self, name, getattr(self.answer, name))
        self.impulse[:] = self.velocity[:] = 7.0
        self.work = contact_workspace(self.capacity)

    def solve(self, G: Any, b: Any, friction: Any, order: tuple[int, ...] = ALL) -> int:
        count = len(friction)
        problem = self.problem
        problem.count = count
        problem.delassus[:] = problem.free[:] = problem.friction[:] = np.nan
        problem.delassus[: 2 * count, : 2 * count] = G
        problem.free[: 2 * count] = b
        problem.friction[:count] = friction
        codes = np.array(order, np.int64)
        return int(solve_contact_kernel(codes, problem, self.work, self.answer))


def test_only_the_leading_blocks_are_touched() -> None:
    caller = Caller()
    assert caller.solve(np.eye(4), [-1.0, 0.2, 1.0, 0.0], [0.5, 0.5]) == SOLVED
    np.testing.assert_allclose(caller.impulse[:4], [1.0, -0.2, 0.0, 0.0])
    assert np.all(caller.impulse[4:] == 7.0)
    assert np.all(caller.velocity[4:] == 7.0)


def test_right_modes_are_a_shortcut_to_the_same_answer() -> None:
    shortcuts = several = 0
    for seed in range(200):
        problem = random_problem(np.random.default_rng([3, seed]))
        caller = Caller()
        assert caller.solve(problem.delassus, problem.free, problem.friction) == SOLVED
        cold = caller.impulse.copy()
        before = caller.work.tally.shortcuts
        assert caller.solve(problem.delassus, problem.free, problem.friction) == SOLVED
        if caller.work.tally.shortcuts > before:
            assert caller.work.tally.solver == WARM_START
            shortcuts += 1
        size = np.sqrt(np.diag(problem.delassus))
        rows = slice(2 * problem.count)
        difference = np.max(size * np.abs(caller.impulse - cold)[rows])
        several += difference > 1e-9 * np.max(size * np.abs(cold[rows]))
    assert shortcuts >= 190
    assert several == 0


@pytest.mark.parametrize("guess", range(6))
def test_wrong_modes_do_no_harm(guess: int) -> None:
    for seed in range(100):
        problem = random_problem(np.random.default_rng([5, seed]))
        caller = Caller()
        caller.mode[:] = min(guess, 3)
        assert caller.solve(problem.delassus, problem.free, problem.friction) == SOLVED
        impulse = caller.impulse[: 2 * problem.count]
        assert residual(problem.delassus, problem.free, problem.friction, impulse) <= 1e-9


def test_counters() -> None:
    caller = Caller()
    caller.work.settings.corrections = 0
    G, b = np.eye(2), [-1.0, 0.2]
    caller.solve(G, b, [0.5])
    caller.solve(G, b, [0.5])
    tally = caller.work.tally
    assert tally.solves == 2
    assert tally.shortcuts == 1
    assert tally.fallbacks == tally.failures == 0
    status = caller.solve(np.zeros((2, 2)), [-1.0, 0.0], [0.5])
    assert status == RAY
    assert tally.solves == 3
    assert tally.failures == 1
    assert tally.fallbacks == tally.last_fallbacks == 3
    assert tally.combinations == 1


def test_no_solver_left_means_failure_not_zero_force_in_silence() -> None:
    caller = Caller()
    caller.work.settings.corrections = 0
    assert caller.solve(np.eye(2), [-1.0, 0.2], [0.5], order=()) != SOLVED
    assert caller.work.tally.failures == 1
    assert caller.work.tally.shortcuts == 0
    assert caller.residual.max() > 1e-3


def test_modes_that_nearly_fit_need_no_solver() -> None:
    """The second point of a foot meets the ground, where the first slips the other way.

    What answers for it is the guess, corrected; the impulse is the one that a solver finds.
    """
    x, z = np.array([-0.6, -0.4, 0.4, 0.6]), np.full(4, -0.9)
    root = np.zeros((8, 4))
    root[0::2] = np.array([0.0 * x, 0.0 * x + 1.0, -x, 0.0 * x]).T
    root[1::2] = np.array([0.0 * x + 1.0, 0.0 * x, z, [0.0, 0.0, 0.5, 0.5]]).T
    G = root @ root.T
    b = -G @ [0.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.7, 0.07] + np.tile([0.0, -0.3], 4)
    b[[0, 2]] += 1.0
    corrected, asked = Caller(), Caller()
    asked.work.settings.corrections = 0
    for caller in (corrected, asked):
        caller.mode[:4] = [OPEN, OPEN, OPEN, SLIP_FORWARD]
        assert caller.solve(G, b, [0.1] * 4) == SOLVED
    assert (corrected.work.tally.solver, asked.work.tally.solver) == (WARM_START, LEMKE)
    assert corrected.mode[:4].tolist() == [OPEN, OPEN, SLIP_BACKWARD, SLIP_BACKWARD]
    assert 1 <= corrected.work.tally.iterations <= 4
    np.testing.assert_allclose(corrected.impulse, asked.impulse, rtol=1e-14, atol=1e-14)


def test_what_rounding_allows_no_better_is_accepted() -> None:
    """A disc spins in a crack a millionth of a radian wide: impulses are 1e6 times the data.

    Rounded, they leave residuals of 1e-11 and more. No solver has better ones to offer.
    """
    between = 0
    for seed in range(12):
        draw = np.random.default_rng([17, seed])
        c, s = np.cos(1e-6), np.sin(1e-6) * draw.uniform(0.5, 2.0)
        jacobian = np.array([[c, s, 0.0], [s, -c, 1.0], [-c, s, 0.0], [s, c, 1.0]])
        jacobian[:, 2] *= draw.uniform(1.0, 3.0)
        free = jacobian @ [0.0, -draw.uniform(0.5, 2.0), draw.uniform(1.0, 2.0)]
        caller = Caller()
        caller.mode[:2] = SLIP_FORWARD
        assert caller.solve(jacobian @ jacobian.T, free, [1e-8, 1e-8]) == SOLVED
        between += 1e-11 < caller.residual.max() <= 1e-9
        tally = caller.work.tally
        assert (tally.solver, tally.shortcuts, tally.iterations) == (WARM_START, 1, 0)
    assert between >= 3


def test_same_bits_every_time() -> None:
    for seed in range(50):
        problem = random_problem(np.random.default_rng([9, seed]))
        answers = []
        for _ in range(2):
            caller = Caller()
            caller.solve(problem.delassus, problem.free, problem.friction)
            answers.append(caller.impulse.tobytes())
        assert answers[0] == answers[1]


@pytest.mark.parametrize("guess", [OPEN, STICK])
@pytest.mark.parametrize("size", [0.0, 1e-16, 1e-13, 1e-11, 1e-10, 1e-9, 1e-6])
@pytest.mark.parametrize("parts", [False, True], ids=["presses", "parts"])
def test_stops_that_barely_press_or_part_need_no_solver(
    parts: bool, size: float, guess: int
) -> None:
    """Two points of a foot stick; two stops without friction hardly do anything, as at rest."""
    for seed in range(20):
        root = np.random.default_rng([13, seed]).standard_normal((8, 9))
        root[[5, 7]] = 0.0
        G = root @ root.T
        small = size * np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.7, 0.0])
        b = -G @ ([1.0, 0.1, 2.0, -0.3, 0.0, 0.0, 0.0, 0.0] + (not parts) * small) + parts * small
        caller = Caller()
        caller.mode[:] = [STICK, STICK, guess, guess, *[OPEN] * 4]
        assert caller.solve(G, b, [0.8, 0.8, 0.0, 0.0]) == SOLVED
        assert caller.work.tally.solver == WARM_START
        assert caller.work.tally.shortcuts == 1
        assert caller.work.tally.iterations == 0
        assert caller.residual.max() <= 2e-10


@pytest.mark.parametrize("tilt", [1e-5, 1e-4, 1e-3])
def test_a_row_that_hardly_differs_from_those_before_is_solved_last(tilt: float) -> None:
    """The toe under a straight leg: what it adds, 1e-10 to 1e-6 of it, another row tells as well.

    Five rows of rank four, of which the third would be divided by that. The answer is the shortest,
    to the digits that are there, and takes neither the elimination that looks for pivots nor a
    solver.
    """
    e = np.eye(4)
    root = np.array([e[0], e[1], [0.6, 0.1, tilt, 0.0], e[3], [-0.3, 0.2, 0.9, 0.0], np.zeros(4)])
    G = root @ root.T
    impulse = np.append(np.linalg.pinv(root[:5].T) @ (root.T @ [1.0, 0.1, 0.5, 0.1, 0.8, 0.0]), 0.0)
    caller = Caller()
    caller.mode[:] = STICK
    caller.work.sticking.order[:] = -1
    assert caller.solve(G, -G @ impulse, [0.8, 0.8, 0.0]) == SOLVED
    np.testing.assert_allclose(caller.impulse[:6], impulse, rtol=0.0, atol=1e-13)
    assert caller.work.tally.solver == WARM_START
    assert caller.work.tally.iterations == 0
    assert np.all(caller.work.sticking.order == -1)


@pytest.mark.parametrize("solver", ALL)
def test_prescribed_sliding(solver: int) -> None:
    """Accelerations: a point that slides forward keeps its friction whatever its acceleration.

    G_nn - mu G_nt = 1 - 0.4 * 0.5 = 0.8, so lambda_n = 9.81 / 0.8.
    """
    G = np.array([[1.0, 0.5], [0.5, 1.0]])
    caller = Caller()
    caller.mode[0] = SLIDING_FORWARD
    assert caller.solve(G, [-9.81, 100.0], [0.4], order=(solver,)) == SOLVED
    np.testing.assert_allclose(caller.impulse[:2], 9.81 / 0.8 * np.array([1.0, -0.4]), rtol=1e-13)
    assert caller.mode[0] == SLIDING_FORWARD
    caller.mode[0] = SLIDING_BACKWARD
    assert caller.solve(G, [-9.81, 100.0], [0.4], order=(solver,)) == SOLVED
    np.testing.assert_allclose(caller.impulse[:2], 9.81 / 1.2 * np.array([1.0, 0.4]), rtol=1e-13)


def test_sliding_contact_may_open() -> None:
    caller = Caller()
    caller.mode[0] = SLIDING_FORWARD
    assert caller.solve(np.eye(2), [1.0, 0.0], [0.4]) == SOLVED
    assert caller.mode[0] == OPEN
    assert caller.impulse[:2].tolist() == [0.0, 0.0]


def test_painleve_configuration_has_no_solution() -> None:
    """G_nn - mu G_nt < 0: pressing harder pulls the sliding point further in."""
    caller = Caller()
    caller.mode[0] = SLIDING_FORWARD
    status = caller.solve(np.array([[1.0, 0.9], [0.9, 1.0]]), [-1.0, 0.0], [1.5])
    assert status == RAY
    assert np.all(np.isfinite(caller.impulse[:2]))
    assert caller.work.tally.failures == 1


def test_prescribed_sliding_beside_a_foot_at_rest() -> None:
    """One foot slides, the other is solved for; the laws of the second are Coulomb's."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        root = rng.standard_normal((4, 6))
        G = root @ root.T
        b = G @ [-1.0, 0.1 * rng.standard_normal(), -1.0, 0.1 * rng.standard_normal()]
        friction = np.array([0.2, 0.6])
        caller = Caller()
        caller.mode[0] = SLIDING_FORWARD
        caller.mode[1] = STICK
        assert caller.solve(G, b, friction) == SOLVED
        impulse, velocity = caller.impulse[:4], caller.velocity[:4]
        np.testing.assert_allclose(velocity, G @ impulse + b, atol=1e-12)
        assert impulse[1] == pytest.approx(-0.2 * impulse[0], abs=1e-14)
        assert velocity[::2].min() >= -1e-9
        assert np.abs(np.minimum(velocity[::2], impulse[::2])).max() <= 1e-9
        assert abs(impulse[3]) <= 0.6 * impulse[2] * (1.0 + 1e-12) + 1e-12
        if caller.mode[1] == SLIP_FORWARD:
            assert impulse[3] == pytest.approx(-0.6 * impulse[2])


@pytest.mark.parametrize("close", [False, True], ids=["apart", "in pairs"])
@pytest.mark.parametrize("points", [1, 2, 3, 5, 16, 64])
def test_many_points_of_two_soles_that_stick(points: int, close: bool) -> None:
    """The quick way finds the least-norm impulses, of few directions or of many.

    A rigid body on two soles, of which one is twice as high as the other: rank 3 whatever the
    number of points. The pseudo-inverse gives the shortest impulse; all are pressed, and none
    leaves its cone. Neighbours 1e-2 apart differ by 1e-4 in what they add to the matrix, so that
    1e-16 becomes 1e-12, and more where few such points carry all.
    """
    draw = np.random.default_rng([11, points])
    x = np.sort(draw.uniform(-1.0, 1.0, points))
    if close:
        x[points // 2 :] = x[: points - points // 2] + 1e-2
    z = np.where(np.arange(points) < points // 2, -0.5, -1.0)
    jacobian = np.zeros((2 * points, 3))
    jacobian[0::2] = np.array([0.0 * x, 0.0 * x + 1.0, -x]).T
    jacobian[1::2] = np.array([0.0 * x + 1.0, 0.0 * x, z]).T
    delassus = jacobian @ np.diag([0.5, 0.5, 3.0]) @ jacobian.T
    pressed = np.ravel(np.column_stack([1.0 + 0.0 * x, draw.uniform(-0.01, 0.01, points)]))
    free = -delassus @ pressed
    work = contact_workspace(points)
    problem = contact_problem(
        points, count=points, delassus=delassus, free=free, friction=np.full(points, 0.8)
    )
    answer = ContactAnswer.allocate(capacity=points, mode=np.full(points, STICK))
    assert repeat(problem, work.settings, work.sticking, work.scaling, answer)
    # Impulses with the same effect differ by what J takes to zero.
    shortest = np.linalg.pinv(jacobian.T, rcond=1e-12) @ (jacobian.T @ pressed)
    np.testing.assert_allclose(answer.impulse, shortest, atol=1e-9)
    assert np.all(answer.mode == STICK)
