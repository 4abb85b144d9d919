"""How the searches for modes begin, go on and end: tables by hand, and parts played by others.

Kernels run as plain Python here, some of them with a script in the place of what they call.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import (
    COMBINATIONS,
    FISCHER_BURMEISTER,
    GAUSS_SEIDEL,
    ITERATION_LIMIT,
    LEMKE,
    OPEN,
    RAY,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
    UNCERTIFIED,
    WARM_START,
)
from heelstrike.contact.sets import CONE, HALF_LINE, LINE
from heelstrike.contact.solvers import certified_solve as cs
from heelstrike.contact.solvers import fischer_burmeister as fb
from heelstrike.contact.solvers import lemke as lk
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, ContactWorkspace, contact_problem

Floats = NDArray[np.float64]


# Lemke.


def reduced() -> ContactWorkspace:
    """A cone, a line, a half-line and another cone, their unknowns one after the other."""
    draw = np.random.default_rng(4)
    work = contact_workspace(4, ready=False, symmetric=False)
    its = work.reduced
    its.unknowns = 6
    its.normal[:], its.tangent[:] = [0, 2, 3, 4], [1, -1, -1, 5]
    its.set[:], its.cone[:] = [CONE, LINE, HALF_LINE, CONE], [0.6, 0.0, 0.0, 1.7]
    its.matrix[:], its.offset[:] = np.nan, np.nan
    its.matrix[:6, :6] = draw.normal(size=(6, 6))
    its.offset[:6] = [0.5, -4.0, 0.3, -0.7, 2.0, 0.1]
    return work


def test_the_problem_of_lemke_is_the_one_of_its_docstring() -> None:
    """Pairs of normal, both tangential velocities and friction left; a line in both directions."""
    work = reduced()
    tableau = work.lemke.tableau
    tableau[:] = 99.0
    assert uncompiled(lk.load_frictional)(4, 0, work.reduced, tableau) == 11
    # Velocities and impulses of the pairs by those of the unknowns.
    signs = np.zeros((11, 6))
    signs[0, 0] = signs[1, 1] = signs[7, 4] = signs[8, 5] = 1.0
    signs[2, 1] = signs[9, 5] = -1.0
    signs[4, 2], signs[5, 2], signs[6, 3] = 1.0, -1.0, 1.0
    expected = signs @ work.reduced.matrix[:6, :6] @ signs.T
    for row, cone in ((0, 0.6), (7, 1.7)):
        expected[row + 1 : row + 3, row + 3] = 1.0
        expected[row + 3, row : row + 4] = [cone, -1.0, -1.0, 0.0]
    np.testing.assert_allclose(tableau[:11, 1:12], expected, rtol=1e-15)
    np.testing.assert_allclose(tableau[:11, 0], signs @ work.reduced.offset[:6] / 4.0, rtol=1e-15)
    assert np.all(tableau[:11, 12] == 1.0)
    work.reduced.offset[:] = 0.0  # and without any free velocity nothing is scaled
    uncompiled(lk.load_frictional)(4, 0, work.reduced, tableau)
    assert np.all(tableau[:11, 0] == 0.0)


def test_covering_vectors_are_positive_and_different() -> None:
    """All ones at first, then from 1 to 2, at last over six powers of ten."""
    covering = uncompiled(lk.covering)
    assert [covering(0, row) for row in range(4)] == [1.0] * 4
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for path in range(1, 9):
        for row in range(6):
            share = (golden * path * (row + 1)) % 1.0
            expected = 1.0 + share if path < 3 else 10.0 ** (6.0 * share)
            assert covering(path, row) == pytest.approx(expected, rel=1e-12, abs=0.0)


def asked_of_lemke(
    path: int, basic: dict[int, float], status: int = SOLVED
) -> tuple[int, list[int], float]:
    """What `lemke` proposes if the pivots end with some variables in the basis, and its tie."""
    work, ties = reduced(), []

    def pivots(pairs: int, tie: float, _: Any, dictionary: Any) -> int:
        assert pairs == 11
        ties.append(tie)
        dictionary.place[:] = -1
        dictionary.tableau[:] = 77.0
        for row, (variable, value) in enumerate(basic.items()):
            dictionary.place[variable], dictionary.tableau[row, 0] = row, value
        return status

    mode = np.full(4, 9)
    run = uncompiled(lk.lemke, replace={lk.pivot_to_solution: pivots})
    found = run(4, path, work.reduced, work.tally, work.lemke, mode)
    return found, mode.tolist(), ties[0] if ties else 0.0


def test_on_the_first_path_modes_are_those_of_the_velocities() -> None:
    """Variables 0 to 10 are velocities of the pairs, 11 to 21 their impulses."""
    open_all = {0: 1.0, 4: 1.0, 5: 1.0, 6: 1.0, 7: 1.0}
    assert asked_of_lemke(0, open_all)[:2] == (SOLVED, [OPEN] * 4)
    # A velocity of zero, or next to it, is no other than one of a contact that is closed.
    assert asked_of_lemke(0, {0: 1e-11, 7: 2e-11, 6: 1.0, 15: 1.0})[1] == [STICK, STICK, OPEN, OPEN]
    closed = {11: 1.0, 15: 1.0, 17: 1.0, 18: 1.0}
    assert asked_of_lemke(0, closed)[1] == [STICK] * 4
    assert asked_of_lemke(0, closed | {1: 1e-9, 9: 1e-9})[1] == [
        SLIP_FORWARD, STICK, STICK, SLIP_BACKWARD
    ]  # fmt: skip
    assert asked_of_lemke(0, closed | {2: 1e-9, 8: 1e-9})[1] == [
        SLIP_BACKWARD, STICK, STICK, SLIP_FORWARD
    ]  # fmt: skip
    # Half their difference is the slip: 1e-11 is none.
    assert asked_of_lemke(0, closed | {1: 2e-11, 9: 2e-11})[1] == [STICK] * 4
    assert asked_of_lemke(0, closed | {1: 3e-11, 9: 3e-11})[1] == [
        SLIP_FORWARD, STICK, STICK, SLIP_BACKWARD
    ]  # fmt: skip


def test_on_other_paths_modes_are_those_of_the_basis() -> None:
    """What slips has its speed in the basis, and one of its two frictions."""
    closed = {11: 0.0, 15: 0.0, 17: 0.0, 18: 0.0}
    assert asked_of_lemke(1, {0: 0.0})[1] == [OPEN] * 4
    assert asked_of_lemke(1, closed)[1] == [STICK] * 4
    slips = {14: 0.0, 21: 0.0}
    assert asked_of_lemke(2, closed | slips)[1] == [STICK] * 4
    assert asked_of_lemke(2, closed | slips | {12: 0.0, 20: 0.0})[1] == [
        SLIP_BACKWARD, STICK, STICK, SLIP_FORWARD
    ]  # fmt: skip
    assert asked_of_lemke(2, closed | slips | {13: 0.0, 19: 0.0})[1] == [
        SLIP_FORWARD, STICK, STICK, SLIP_BACKWARD
    ]  # fmt: skip
    assert asked_of_lemke(2, closed | slips | {12: 0.0, 13: 0.0})[1] == [STICK] * 4
    assert asked_of_lemke(2, closed | {12: 0.0, 20: 0.0})[1] == [STICK] * 4


def test_each_path_has_its_tie_and_the_last_tells_how_it_ended() -> None:
    assert [asked_of_lemke(path, {})[2] for path in range(6)] == [1e-11, 1e-13, 1e-9] * 2
    work = reduced()
    run = uncompiled(lk.lemke)
    for status, told in ((RAY, RAY), (ITERATION_LIMIT, ITERATION_LIMIT), (SOLVED, UNCERTIFIED)):
        work.lemke.status = status
        assert run(4, 9, work.reduced, work.tally, work.lemke, np.zeros(4, int)) == told


# Fischer and Burmeister.


def test_modes_are_read_from_impulses_and_velocities() -> None:
    """Of a pair the larger is the one that is there; friction is against the edge it is beyond."""
    work = reduced()
    x, speed = work.iteration.x, work.iteration.speed
    read, mode = uncompiled(fb.read_iterate), np.full(4, 9)

    def read_modes() -> list[int]:
        read(4, work.reduced, work.iteration, mode)
        return mode.tolist()

    x[:6], speed[:6] = [1.0, 0.2, 1.0, 1.0, 1.0, 0.2], 0.0
    assert read(4, work.reduced, work.iteration, mode)
    assert mode.tolist() == [STICK] * 4
    assert not read(4, work.reduced, work.iteration, mode)
    speed[[0, 2, 3, 4]] = 1.5
    assert read(4, work.reduced, work.iteration, mode)
    assert mode.tolist() == [OPEN, STICK, OPEN, OPEN]
    speed[[0, 2, 3, 4]] = 1.0
    assert read_modes() == [STICK] * 4
    # Room of 0.6 + 0.2 to the lower edge, 0.6 - 0.2 to the upper; of 1.7 + 0.2 and 1.7 - 0.2.
    speed[[1, 5]] = 0.81, -1.49
    assert read_modes() == [SLIP_FORWARD, STICK, STICK, STICK]
    speed[[1, 5]] = 0.79, -1.51
    assert read_modes() == [STICK, STICK, STICK, SLIP_BACKWARD]
    speed[[1, 5]] = -0.41, 1.91
    assert read_modes() == [SLIP_BACKWARD, STICK, STICK, SLIP_FORWARD]
    speed[[1, 5]] = -0.39, 1.89
    assert read_modes() == [STICK] * 4


class Script:
    """Plays the parts that `fischer_burmeister` calls, and keeps what it was asked."""

    def __init__(self, merits: list[float], changes: list[bool]) -> None:
        self.merits, self.changes = merits, changes
        self.sizes: list[float] = []
        self.dampings: list[float] = []
        self.at: list[Floats] = []
        self.work = reduced()
        self.mode = np.zeros(4, int)
        parts = {
            fb.equations: self.equations, fb.read_iterate: self.read, fb.newton_step: self.step,
        }  # fmt: skip
        self._run = uncompiled(fb.fischer_burmeister, replace=parts)

    def equations(self, _: int, size: float, __: Any, iteration: Any) -> float:
        self.sizes.append(size)
        self.at.append(iteration.x[:6].copy())
        return self.merits.pop(0)

    def read(self, *_: Any) -> bool:
        return self.changes.pop(0)

    def step(self, unknowns: int, damping: float, iteration: Any) -> None:
        assert unknowns == 6
        self.dampings.append(damping)
        iteration.step[:6] = 1.0

    def __call__(self, call: int) -> int:
        work = self.work
        return int(self._run(4, call, work.reduced, work.tally, work.iteration, self.mode))


def test_steps_are_proposed_where_they_change_modes_and_shortened_where_they_fail() -> None:
    """A step may raise the merit 4 − 1e-4 a fold, where `a` is the part of it that is taken."""
    run = Script([0.5, 0.5 * 3.9998], [False])
    assert run(0) == SOLVED
    assert run.sizes == [4.0, 4.0]  # the largest free velocity
    assert np.all(run.at[0] == 0.0)
    assert np.all(run.at[1] == 1.0)
    assert run.dampings == pytest.approx([1e-15 + 1e-12 * 0.5], rel=1e-12, abs=0.0)
    # Twice too much: a quarter of the step is left.
    run.merits, run.changes = [2.0, 2.0 * 3.99991, 2.0 * 3.99996, 2.0 * 3.99996], [True]
    assert run(1) == SOLVED
    np.testing.assert_allclose([each[0] for each in run.at[2:]], [1.0, 2.0, 1.5, 1.25])
    assert run.dampings[1] == pytest.approx(1e-15 + 1e-12, rel=1e-12, abs=0.0)
    assert run.work.iteration.number == run.work.tally.iterations == 2
    # What changes no mode goes on by itself.
    run.merits, run.changes = [0.3, 0.2] * 4, [False, False, False, True]
    assert run(2) == SOLVED
    assert run.work.iteration.number == 6
    run.work.reduced.offset[:] = 0.0
    run.merits, run.changes = [0.3, 0.2], [True]
    run(3)
    assert run.sizes[-1] == 1.0


def test_what_is_stuck_or_solved_begins_elsewhere() -> None:
    """Starting points of friction within the cones, twice as far out each time; other damping."""
    run = Script([1e-31, 1e-31], [False])
    assert run(0) == SOLVED
    assert run.work.iteration.number == 30
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for start in (1, 2, 3, 12, 21):
        run.work.iteration.number = 30 * start
        stuck = [1.0] + [5.0] * 28  # 2^-27 is less than 1e-8
        run.merits, run.changes = stuck.copy(), [True]
        assert run(1) == SOLVED
        assert run.work.iteration.number == 30 * (start + 1)
        at = 2.0 ** (start % 20) * ((golden * start * np.arange(1, 7)) % 1.0)
        for second, cone in ((1, 0.6), (5, 1.7)):
            share = 2.0 * ((golden * start * (second + 1)) % 1.0) - 1.0
            at[second] = share * cone * at[second - 1]
        first = run.at[-29] if len(run.merits) == 0 else run.at[-29 + len(run.merits)]
        np.testing.assert_allclose(first, at, rtol=1e-12)
        assert run.dampings[-1] == pytest.approx(
            1e-15 + 10.0 ** (-12 + start % 10), rel=1e-12, abs=0.0
        )
    run.work.iteration.number = 30 * 40
    assert run(5) == ITERATION_LIMIT


# All of them, one after the other.


def test_an_answer_is_kept_whole() -> None:
    problem = contact_problem(3, count=2, first=np.array([0, 1, 3, 5]))
    trial = ContactAnswer.allocate(
        capacity=3, impulse=np.arange(6.0), velocity=10.0 + np.arange(6.0),
        mode=np.array([1, 2, 3]), residual=np.array([0.1, 0.2, 0.3]), rest=0.7,
    )  # fmt: skip
    answer = ContactAnswer.allocate(capacity=3)
    uncompiled(cs.keep)(problem, trial, answer)
    assert answer.impulse.tolist() == [0.0, 1.0, 2.0, 0.0, 0.0, 0.0]
    assert answer.velocity.tolist() == [10.0, 11.0, 12.0, 0.0, 0.0, 0.0]
    assert answer.mode.tolist() == [1, 2, 0]
    assert answer.residual.tolist() == [0.1, 0.2, 0.3]
    assert answer.rest == 0.7


def test_what_is_doubtful_and_what_is_clean() -> None:
    """Rounding of impulses is 2⁻⁵³ of the effort, for each contact."""
    scaling = SimpleNamespace(effort=2.0**53 * 1e-6)
    doubtful = uncompiled(cs.is_doubtful)
    assert doubtful(2, 1.9e-6, 1e-9, scaling)
    assert doubtful(2, 2e-6, 1e-9, scaling)
    assert not doubtful(2, 2.1e-6, 1e-9, scaling)  # more than rounding
    assert not doubtful(2, 1e-9, 1e-9, scaling)  # within the tolerance
    assert not doubtful(2, 1.9e-6, 1e-6, scaling)  # rounding is within the tolerance
    clean = uncompiled(cs.is_clean)
    settings = SimpleNamespace(tolerance=1e-9, patient=0)
    for effort, limit in ((0.0, 1e-11), (2.0**53 * 1e-10, 2e-10), (2.0**53 * 1e-8, 1e-9)):
        scaling = SimpleNamespace(effort=effort)
        assert clean(2, 0.999 * limit, settings, scaling)
        assert not clean(2, 1.001 * limit, settings, scaling)
    settings.patient = 1
    assert clean(2, 1e-11, settings, scaling)
    assert not clean(2, 1.1e-11, settings, scaling)
    settings.tolerance = 1e-12
    assert not clean(2, 2e-12, settings, scaling)


@pytest.mark.parametrize(
    ("matrix", "nearly"),
    [
        (np.eye(3), False),
        ([[1.0, -1.0], [-1.0, 1.0]], False),  # exactly
        ([[1.0, -1.0 + 1e-12], [-1.0 + 1e-12, 1.0]], True),
        ([[1.0, -1.0 + 1e-8], [-1.0 + 1e-8, 1.0]], False),
        ([[1.0, 1 / 3, 4 / 3], [1 / 3, 1.0, 4 / 3], [4 / 3, 4 / 3, 8 / 3]], True),  # rounded
        ([[1.0, 0.5, 0.0], [0.5, 0.25, 0.0], [0.0, 0.0, 4.0]], False),  # exactly, pivots last
        ([[0.25, 0.5, 0.25], [0.5, 1.0, 0.5], [0.25, 0.5, 0.25 + 1e-12]], True),
        ([[0.0, 1.0], [1.0, 0.0]], False),  # pivots off the diagonal
        ([[0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1e-11]], True),
        ([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]], False),
    ],
)
def test_what_is_singular_to_rounding(matrix: Any, nearly: bool) -> None:
    """Pivots of less than 1e-10, but for matrices that are singular exactly."""
    size = len(matrix)
    for order in (np.arange(size), np.arange(size)[::-1]):
        work = contact_workspace(2, ready=False, symmetric=False)
        problem = contact_problem(2)
        problem.delassus[:size, :size] = np.array(matrix)[np.ix_(order, order)]
        work.reduced.unknowns = size
        # Scales are those of a diagonal of one; frexp(0.5) is 0.5 times 2⁰.
        work.reduced.scale[:size], work.reduced.source[:size] = 0.5, np.arange(size)
        assert uncompiled(cs.nearly_singular)(problem, work.reduced) == nearly


def test_rows_of_other_units_are_as_singular() -> None:
    """Powers of two of their scales, without rounding, make pivots comparable."""
    problem, work = contact_problem(1), contact_workspace(1, ready=False, symmetric=False)
    work.reduced.unknowns, work.reduced.source[:] = 2, [1, 0]
    for unit in (2.0**-20, 1.0, 2.0**20):
        work.reduced.scale[:] = [0.5, 0.5 / unit]
        for off, nearly in ((1e-12, True), (1e-8, False)):
            matrix = np.array([[1.0, -1.0 + off], [-1.0 + off, 1.0]])
            stretch = np.array([unit, 1.0])
            problem.delassus[:] = stretch[:, None] * matrix * stretch
            assert uncompiled(cs.nearly_singular)(problem, work.reduced) == nearly


def test_each_solver_is_asked_by_its_number() -> None:
    work, asked = reduced(), []

    def part(name: str, answer: int) -> Any:
        def play(*given: Any) -> int:
            asked.append((name, given))
            return answer

        return play

    propose = uncompiled(
        cs.propose,
        replace={
            cs.lemke: part("lemke", 11), cs.fischer_burmeister: part("fischer_burmeister", 12),
            cs.gauss_seidel: part("gauss_seidel", 13),
            cs.begin_combinations: part("begin", 0), cs.next_combination: part("next", 1),
        },
    )  # fmt: skip
    guess, mode = np.zeros(4, int), np.zeros(4, int)

    def found(solver: int, call: int) -> int:
        asked.clear()
        return int(
            propose(
                solver, call, 4, 0.3, guess, work.reduced, work.tally, work.lemke, work.iteration,
                work.combinations, mode,
            )
        )  # fmt: skip

    for solver, answer, memory in (
        (LEMKE, 11, work.lemke), (FISCHER_BURMEISTER, 12, work.iteration),
        (GAUSS_SEIDEL, 13, work.iteration),
    ):  # fmt: skip
        assert found(solver, 3) == answer
        assert asked[0][1][:2] == (4, 3)
        assert asked[0][1][4] is memory
    assert found(COMBINATIONS, 0) == SOLVED
    assert [name for name, _ in asked] == ["begin", "next"]
    assert asked[0][1][0] == 4
    assert asked[0][1][2] == 0.3
    assert asked[0][1][1] is guess
    assert found(COMBINATIONS, 1) == SOLVED
    assert [name for name, _ in asked] == ["next"]


def sought(
    solver: int, residuals: list[float], *, best: float = math.inf, corrections: int = 4,
    patient: int = 0, ends: int = 99,
) -> tuple[int, float, list[float], ContactWorkspace, list[int]]:  # fmt: skip
    """What `seek` answers if the modes that are proposed have such residuals.

    Also the residuals of what it kept, its memory, and how often it proposed or corrected.
    """
    work, calls, kept = contact_workspace(1, ready=False, symmetric=False), [], []
    work.settings.corrections, work.settings.patient = corrections, patient
    problem, answer = contact_problem(1, count=1), ContactAnswer.allocate(capacity=1)

    def evaluate(*given: Any) -> float:
        given[-1].rest = residuals[0]
        return residuals.pop(0)

    def propose(asked: int, call: int, count: int, *_: Any) -> int:
        assert (asked, count) == (solver, 1)
        calls.append(call)
        return SOLVED if call < ends else RAY

    def correct(*_: Any) -> int:
        calls.append(len(calls))
        return SOLVED if len(calls) < ends else UNCERTIFIED

    def keep(_: Any, trial: Any, __: Any) -> None:
        kept.append(trial.rest)

    parts = {
        cs.evaluate: evaluate, cs.propose: propose, cs.correct_modes: correct, cs.keep: keep,
        cs.note_residual: lambda *_: None,
    }  # fmt: skip
    outcome, found = uncompiled(cs.seek, replace=parts)(solver, problem, best, work, answer)
    return outcome, found, kept, work, calls


def test_a_solver_is_asked_until_its_answer_is_certified() -> None:
    outcome, best, kept, _, calls = sought(LEMKE, [0.3, 0.5, 0.2, 1e-9])
    assert (outcome, best, kept, calls) == (SOLVED, 1e-9, [0.3, 0.2, 1e-9], [0, 1, 2, 3])
    outcome, best, kept, _, calls = sought(LEMKE, [0.3, 0.5], ends=2, best=0.4)
    assert (outcome, best, kept, calls) == (RAY, 0.3, [0.3], [0, 1, 2])
    # A certified answer gives way to none, even if what was guessed had less.
    assert sought(LEMKE, [5e-10], best=3e-10)[:3] == (SOLVED, 5e-10, [5e-10])
    # If patient only a clean one ends the search.
    outcome, best, kept, _, _ = sought(LEMKE, [5e-10, 6e-10, 1e-12], patient=1)
    assert (outcome, best, kept) == (SOLVED, 1e-12, [5e-10, 1e-12])


def test_a_guess_is_corrected_a_few_times_and_has_to_be_clean() -> None:
    outcome, best, kept, work, calls = sought(WARM_START, [0.3, 1e-10, 0.2, 0.2, 0.2])
    assert (outcome, best, kept, len(calls)) == (ITERATION_LIMIT, 1e-10, [0.3, 1e-10], 4)
    assert work.tally.iterations == 4
    outcome, best, kept, work, calls = sought(WARM_START, [0.3, 1e-12])
    assert (outcome, best, len(calls), work.tally.iterations) == (SOLVED, 1e-12, 1, 1)
    assert sought(WARM_START, [0.3, 0.1], ends=2)[:2] == (UNCERTIFIED, 0.1)
    assert sought(WARM_START, [0.3], corrections=0)[0] == ITERATION_LIMIT
    assert sought(WARM_START, [1e-12], corrections=0)[0] == SOLVED


def released(labels: list[bool], residuals: list[float], best: float) -> tuple[bool, float, int]:
    """What `release` answers if velocities name such modes; how many trials it kept."""
    work, kept = contact_workspace(2, ready=False, symmetric=False), []
    problem = contact_problem(2, count=2)
    answer = ContactAnswer.allocate(capacity=2, mode=np.array([STICK, SLIP_FORWARD]))

    def evaluate(*given: Any) -> float:
        assert given[-1].mode.tolist() == [STICK, SLIP_FORWARD]
        return residuals.pop(0)

    parts = {
        cs.label: lambda *_: labels.pop(0), cs.evaluate: evaluate,
        cs.keep: lambda *_: kept.append(1),
    }  # fmt: skip
    settled, found = uncompiled(cs.release, replace=parts)(problem, best, work, answer)
    return settled, found, len(kept)


def test_contacts_at_rest_are_let_carry_impulses_while_that_is_as_good() -> None:
    assert released([False], [], 0.3) == (True, 0.3, 0)
    assert released([True, False], [0.2], 0.3) == (True, 0.2, 1)
    assert released([True], [0.4], 0.3) == (False, 0.3, 0)
    assert released([True, False], [2e-10], 1e-12) == (True, 2e-10, 1)  # twice what counts as rest
    assert released([True], [2.1e-10], 1e-12) == (False, 1e-12, 0)
    assert released([True] * 6, [0.2, 0.1, 0.05, 0.04, 0.03, 0.02], 0.3) == (False, 0.02, 6)


def test_a_solve_begins_with_the_modes_of_the_answer_and_no_impulse() -> None:
    problem = contact_problem(
        3, count=2, first=np.array([0, 1, 3, 5]), free=np.arange(1.0, 7.0), delassus=np.eye(6)
    )
    answer = ContactAnswer.allocate(
        capacity=3, mode=np.array([STICK, SLIP_BACKWARD, STICK]), impulse=np.full(6, 9.0),
        velocity=np.full(6, 9.0), residual=np.zeros(3),
    )  # fmt: skip
    work = contact_workspace(3, ready=False, symmetric=False)
    uncompiled(cs.begin)(problem, work.scaling.slope, work.reduced, work.trial, answer)
    assert work.trial.mode.tolist() == [STICK, SLIP_BACKWARD, OPEN]
    assert answer.impulse.tolist() == [0.0, 0.0, 0.0, 9.0, 9.0, 9.0]
    assert answer.velocity.tolist() == [1.0, 2.0, 3.0, 9.0, 9.0, 9.0]
    assert np.isposinf(answer.residual).all()
    assert work.reduced.unknowns == 2  # without friction one a contact


def test_a_workspace_has_the_documented_tolerance_and_room_for_its_contacts() -> None:
    work = contact_workspace(3, ready=False)
    assert work.settings.tolerance == 1e-9
    assert (work.settings.corrections, work.settings.patient, work.settings.skewed) == (4, 0, 0)
    assert work.settings.floor == 0.0
    assert work.equations.tableau.shape == (6, 7)
    assert work.lemke.tableau.shape == (12, 14)
    assert work.equations.dual.tableau.shape == (6, 8)
    assert work.sticking.lower_half.shape == (55,)
    assert contact_workspace(0, ready=False).trial.mode.shape == (1,)


def tried(
    ends: list[tuple[int, float]], *, patient: int = 0, settled: bool = True,
    order: tuple[int, ...] = (LEMKE, GAUSS_SEIDEL),
) -> tuple[int, list[int], ContactWorkspace]:  # fmt: skip
    """How a solve ends whose solvers end with such residuals; who was asked; its counts."""
    work, asked = contact_workspace(1, ready=False, symmetric=False), []
    work.settings.patient = patient
    problem, answer = contact_problem(1, count=1), ContactAnswer.allocate(capacity=1)

    def seek(solver: int, _: Any, best: float, __: Any, ___: Any) -> tuple[int, float]:
        asked.append(solver)
        outcome, residual = ends.pop(0)
        return outcome, min(best, residual)

    parts = {
        cs.seek: seek, cs.release: lambda _, best, *__: (settled, best),
        cs.scale_matrix: lambda *_: None, cs.certify: lambda *_: 1.0,
        cs.nearly_singular: lambda *_: False,
    }  # fmt: skip
    run = uncompiled(cs.try_solvers._function, replace=parts)
    status = run(problem, np.array(order), work, answer)
    return int(status), asked, work


def test_solvers_are_asked_in_turn_until_one_is_believed() -> None:
    """A guess first; combinations at last. Patience asks on where nobody was sure."""
    status, asked, work = tried([(SOLVED, 1e-12)])
    assert (status, asked) == (SOLVED, [WARM_START])
    assert (work.tally.shortcuts, work.tally.solver, work.tally.fallbacks) == (1, WARM_START, 0)
    status, asked, work = tried([(UNCERTIFIED, 0.1), (SOLVED, 1e-10)])
    assert (status, asked, work.tally.solver) == (SOLVED, [WARM_START, LEMKE], LEMKE)
    assert (work.tally.shortcuts, work.tally.fallbacks) == (0, 0)
    # A residual within the tolerance will do, however the search has ended; not if patient.
    unsure = [(UNCERTIFIED, 0.1), (ITERATION_LIMIT, 1e-10), (SOLVED, 1e-12)]
    status, asked, _ = tried(unsure.copy())
    assert (status, asked) == (SOLVED, [WARM_START, LEMKE])
    status, asked, work = tried(unsure.copy(), patient=1)
    assert (status, asked) == (SOLVED, [WARM_START, LEMKE, GAUSS_SEIDEL])
    assert work.tally.fallbacks == 0  # it was solved before
    status, asked, _ = tried([(UNCERTIFIED, 0.1), (SOLVED, 1e-10)], patient=1)
    assert (status, asked) == (SOLVED, [WARM_START, LEMKE])
    every = [(UNCERTIFIED, 0.1), (RAY, 0.1), (ITERATION_LIMIT, 0.1), (UNCERTIFIED, 0.1)]
    status, asked, work = tried(every.copy())
    assert (status, asked) == (RAY, [WARM_START, LEMKE, GAUSS_SEIDEL, COMBINATIONS])
    assert (work.tally.fallbacks, work.tally.failures, work.tally.combinations) == (2, 1, 1)
    status, asked, work = tried(every.copy(), order=(LEMKE,))
    assert (status, asked, work.tally.combinations) == (RAY, [WARM_START, LEMKE], 0)
    # A guess that is not settled is left to the solvers; one that agrees with itself is taken.
    status, asked, _ = tried([(SOLVED, 1e-12), (SOLVED, 1e-12)], settled=False)
    assert asked == [WARM_START, LEMKE]
    status, asked, _ = tried([(UNCERTIFIED, 5e-10)])
    assert (status, asked) == (SOLVED, [WARM_START])
