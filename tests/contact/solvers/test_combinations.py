"""The last resort counts modes; each is tried once, near ones first. And what has no answer."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, STICK
from heelstrike.contact.solvers import combinations as modes_in_turn
from heelstrike.contact.solvers.certified_solve import contact_workspace, nearly_singular
from heelstrike.contact.solvers.combinations import MOST
from heelstrike.contact.workspace import ContactWorkspace, Integers, contact_problem

begin_combinations = uncompiled(modes_in_turn.begin_combinations)
next_combination = uncompiled(modes_in_turn.next_combination)
note_residual = uncompiled(modes_in_turn.note_residual)

ALL = range(OPEN, SLIP_BACKWARD + 1)


def workspace(count: int, *, smooth: tuple[int, ...] = ()) -> ContactWorkspace:
    work = contact_workspace(count)
    for contact in range(count):
        work.reduced.tangent[contact] = -1 if contact in smooth else 2 * contact + 1
    return work


def begin(count: int, best: Integers, residual: float, work: ContactWorkspace) -> None:
    begin_combinations(count, best, residual, work.combinations)


def following(count: int, work: ContactWorkspace) -> bool:
    return bool(
        next_combination(
            count, work.reduced.tangent, work.tally, work.combinations, work.trial.mode
        )
    )


def note(count: int, residual: float, work: ContactWorkspace) -> None:
    note_residual(count, residual, work.trial.mode, work.combinations)


def trial(count: int, work: ContactWorkspace) -> tuple[int, ...]:
    return tuple(int(mode) for mode in work.trial.mode[:count])


def test_few_contacts_get_every_combination_once() -> None:
    """Four modes a contact, two without friction."""
    work = workspace(3, smooth=(1,))
    begin(3, np.zeros(3, np.int64), 1.0, work)
    found = []
    while following(3, work):
        found.append(trial(3, work))
    assert sorted(found) == sorted(product(ALL, (OPEN, STICK), ALL))


def neighbours(base: tuple[int, ...]) -> set[tuple[int, ...]]:
    """Modes that differ from some in two contacts at most."""
    found = set()
    for places in combinations(range(len(base)), 2):
        for changed in product(ALL, ALL):
            near = list(base)
            for place, mode in zip(places, changed, strict=True):
                near[place] = mode
            found.add(tuple(near))
    return found


def test_many_contacts_change_by_two_at_first() -> None:
    """All changes of two of six contacts, which are 154, then somewhere else; 8000 in all."""
    count, base = 6, (STICK, OPEN, STICK, SLIP_BACKWARD, STICK, OPEN)
    work = workspace(count)
    begin(count, np.array(base), 1.0, work)
    first = set()
    for _ in range(16 * count * 4):
        assert following(count, work)
        first.add(trial(count, work))
    assert first == neighbours(base)
    assert len(first) == 1 + 6 * 3 + 15 * 9
    assert following(count, work)
    elsewhere = tuple(int(mode) for mode in work.combinations.base[:count])
    assert elsewhere != base
    assert trial(count, work) in neighbours(elsewhere)
    left = 0
    while following(count, work):
        left += 1
    assert 16 * count * 4 + 1 + left == MOST


@pytest.mark.parametrize(("count", "most"), [(6, 8000), (8, 8000), (12, 2370), (24, 296)])
def test_of_more_contacts_fewer_are_tried(count: int, most: int) -> None:
    """Each is an elimination, whose work grows with the cube of their number."""
    work = workspace(count)
    begin(count, np.full(count, STICK), 1.0, work)
    tried = 0
    while following(count, work):
        tried += 1
    assert tried == most


def test_the_better_becomes_the_base() -> None:
    count, base = 6, (STICK,) * 6
    work = workspace(count)
    begin(count, np.array(base), 1.0, work)
    for _ in range(5):
        following(count, work)
    better = trial(count, work)
    assert better != base
    note(count, 1.0, work)  # as good is not better
    assert tuple(work.combinations.base[:count]) == base
    note(count, 0.5, work)
    assert tuple(work.combinations.base[:count]) == better
    following(count, work)
    assert trial(count, work) in neighbours(better)


SINE = float(np.sin(0.3))


@pytest.mark.parametrize("size", [1.0, 1e-12, 3e10])
@pytest.mark.parametrize(
    ("matrix", "doubtful"),
    [
        (np.eye(3), False),
        ([[2.0, 1.0], [1.0, 2.0]], False),
        # Two walls that face each other: singular, and no operation is rounded.
        ([[1.0, -1.0], [-1.0, 1.0]], False),
        # Singular but for the last digits.
        ([[1.0, SINE], [SINE, SINE * SINE * (1.0 + 2e-16)]], True),
        ([[1.0, 1.0], [1.0, 1.0 + 3e-16]], True),
        ([[1.0, 1.0], [1.0, 1.0 + 1e-3]], False),
    ],
)
def test_what_rounding_decides(matrix: object, size: float, doubtful: bool) -> None:
    delassus = np.array(matrix)
    reduced = contact_workspace(2).reduced
    reduced.unknowns = number = len(delassus)
    unit = 2.0 ** np.round(np.log2(size))
    reduced.source[:number] = np.arange(number)
    reduced.scale[:number] = 1.0 / np.sqrt(unit * np.diag(delassus))
    problem = contact_problem(2)
    problem.delassus[:number, :number] = unit * delassus
    assert uncompiled(nearly_singular)(problem, reduced) == doubtful


def test_contacts_without_friction_never_slip() -> None:
    count = 6
    work = workspace(count, smooth=(1, 4))
    begin(count, np.full(count, STICK), 1.0, work)
    met = set()
    while following(count, work):
        modes = trial(count, work)
        met.update(modes[:1])
        assert max(modes[1], modes[4]) <= STICK
    assert met == set(ALL)
