"""Feet that stand, solved by programs: impulses of least norm that leave them no velocity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from heelstrike.contact.cone_certificate import MOST_STOPS, has_stops
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.contact.sets import CONE, HALF_LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.known_modes import repeat, stand
from heelstrike.contact.solvers.standing import MOST_EQUATIONS, PROGRAMS, sharing
from heelstrike.contact.workspace import PROGRAM_ROWS, ContactAnswer, contact_problem

FEET = 2
HEIGHT = 0.07
"""How far a sole is below its ankle (m)."""


def standing(
    draw: Any, code: int, stops: int, *, turns: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Delassus matrix and free velocities of a walker whose vertices share rows as a code says.

    Its vertices press, half of its stops do, and the others part.

    Its coordinates are the places of two ankles, the angles of the feet, and its joints; all hang
    together by their mass matrix. Feet that turn less are those under legs that are nearly
    straight, or straight.
    """
    shared = [digit == "1" for digit in f"{code:b}"]
    shared[0] = False
    size = 3 * FEET + stops
    rows, foot = [], -3
    for same in shared:
        foot += 0 if same else 3
        lever, height = draw.uniform(0.3, 0.5) * (-1 if same else 1), HEIGHT
        normal, tangent = np.zeros(size), np.zeros(size)
        normal[foot + 1], normal[foot + 2] = 1.0, turns * lever
        tangent[foot], tangent[foot + 2] = 1.0, height
        rows += [normal, tangent]
    for stop in range(stops):
        rows.append(np.eye(size)[3 * FEET + stop])
    root = np.eye(size) + 0.2 * draw.standard_normal((size, size))
    jacobian = np.array(rows)
    delassus = jacobian @ np.linalg.inv(root @ root.T) @ jacobian.T
    cones = len(shared)
    impulse = np.concatenate([np.ravel([[draw.uniform(1.0, 2.0), 0.1]] * cones), np.zeros(stops)])
    left = np.zeros(len(rows))
    pressed = draw.random(stops) < 0.5
    impulse[2 * cones :][pressed] = draw.uniform(0.5, 1.0, pressed.sum())
    left[2 * cones :][~pressed] = draw.uniform(0.1, 1.0, stops - pressed.sum())
    return delassus, left - delassus @ impulse


def problem_of(delassus: Any, free: Any, stops: int, room: int = PROGRAM_ROWS) -> Any:
    rows = len(free)
    cones = (rows - stops) // 2
    problem = contact_problem(cones + stops, count=cones + stops, room=room)
    problem.first[cones:] = np.arange(2 * cones, rows + 1)
    problem.set[:cones], problem.set[cones:] = CONE, HALF_LINE
    problem.friction[:cones] = 5.0
    problem.delassus[:] = np.nan  # nobody may read the rest
    problem.delassus[:rows, :rows], problem.free[:rows] = delassus, free
    return problem


def solved(problem: Any, modes: list[int], way: Any = stand) -> tuple[bool, ContactAnswer]:
    work = contact_workspace(problem.count)
    answer = ContactAnswer.allocate(capacity=len(problem.set), mode=np.array(modes, np.int64))
    return way(problem, work.settings, work.sticking, work.scaling, answer), answer


@pytest.mark.parametrize("code", PROGRAMS)
@pytest.mark.parametrize("turns", [1.0, 0.1, 0.03, 0.0])
def test_impulses_have_the_least_norm_of_those_that_leave_no_velocity(
    code: int, turns: float
) -> None:
    """Against the pseudo-inverse of all rows."""
    succeeded = 0
    for seed in range(10):
        delassus, free = standing(np.random.default_rng([code, seed]), code, 0, turns=turns)
        problem = problem_of(delassus, free, 0)
        held, answer = solved(problem, [STICK] * problem.count)
        expected = -np.linalg.pinv(delassus, rcond=1e-9) @ free
        if np.any(np.abs(expected[1::2]) > 5.0 * expected[::2]):
            assert not held
            continue
        assert held
        succeeded += 1
        np.testing.assert_allclose(answer.impulse[: len(free)], expected, atol=1e-10)
        assert np.abs(answer.velocity[: len(free)]).max() <= 1e-12
    assert succeeded >= 5


@pytest.mark.parametrize("turns", [1.0, 0.05, 0.0])
@pytest.mark.parametrize(
    ("code", "stops"),
    [
        (code, stops)
        for code in PROGRAMS
        for stops in range(1, MOST_STOPS + 1)
        if has_stops(code.bit_length(), stops)
    ],
)
def test_stops_beside_feet(code: int, stops: int, turns: float) -> None:
    """Those that press are held, the others part; whatever was guessed of them, and as by loops."""
    seen, named = 0, set()
    for seed in range(12):
        draw = np.random.default_rng([code, stops, seed])
        delassus, free = standing(draw, code, stops, turns=turns)
        cones = code.bit_length()
        guess = [STICK] * cones + [STICK] * stops
        problem = problem_of(delassus, free, stops)
        held, answer = solved(problem, guess)
        if not held:
            continue
        seen += 1
        rows = len(free)
        impulse, velocity = answer.impulse[:rows], answer.velocity[:rows]
        rounding = 1e-12 * max(1.0, np.abs(impulse).max())  # what velocities are summed from
        np.testing.assert_allclose(velocity, delassus @ impulse + free, atol=rounding)
        assert np.abs(velocity[: 2 * cones]).max() <= rounding
        for stop in range(stops):
            row, mode = 2 * cones + stop, answer.mode[cones + stop]
            named.add(int(mode))
            assert (impulse[row] == 0.0 and velocity[row] > 0.0) == (mode == OPEN)
            assert mode == OPEN or (impulse[row] >= 0.0 and abs(velocity[row]) <= rounding)
        loops, other = solved(problem_of(delassus, free, stops, room=20), guess, repeat)
        assert loops
        np.testing.assert_allclose(other.impulse[:rows], impulse, atol=1e-11)
        np.testing.assert_array_equal(other.mode, answer.mode)
    assert seen >= 6
    assert named == {OPEN, STICK}


def test_a_stop_at_rest_that_nobody_holds_is_left_to_the_loops() -> None:
    """Whether it bears anything is a question of least norm; of one that is held it is none."""
    delassus, free = standing(np.random.default_rng(1), 3, 1)
    row = 4
    impulse = -np.linalg.pinv(delassus[:row, :row], rcond=1e-9) @ free[:row]
    free[row] = -delassus[row, :row] @ impulse
    assert not solved(problem_of(delassus, free, 1), [STICK, STICK, OPEN])[0]
    held, answer = solved(problem_of(delassus, free, 1), [STICK, STICK, STICK])
    assert held
    assert abs(answer.impulse[row]) <= 1e-12
    assert answer.mode[2] == STICK


def test_stops_are_let_go_one_after_the_other() -> None:
    """The second pulls only when the first no longer holds."""
    delassus = np.eye(6)
    delassus[4, 5] = delassus[5, 4] = 0.5
    free = np.array([-1.0, 0.0, -1.0, 0.0, 1.0, -0.8])
    held, answer = solved(problem_of(delassus, free, 2), [STICK] * 4)
    assert held
    assert answer.mode.tolist() == [STICK, STICK, OPEN, STICK]
    np.testing.assert_allclose(answer.impulse[4:6], [0.0, 0.8])
    delassus[4, 5] = delassus[5, 4] = 0.9
    free[4:6] = [0.5, 0.1]
    held, answer = solved(problem_of(delassus, free, 2), [STICK] * 4)
    assert held
    assert answer.mode.tolist() == [STICK, STICK, OPEN, OPEN]
    np.testing.assert_array_equal(answer.impulse[4:6], [0.0, 0.0])


def test_memory_has_room_for_the_largest_program() -> None:
    """Whatever is too large for a matrix of its own would be written behind it."""
    sizes = [
        len(sharing(code).source) + stops
        for code in PROGRAMS
        for stops in range(MOST_STOPS + 1)
        if stops == 0 or has_stops(code.bit_length(), stops)
    ]
    assert max(sizes) == MOST_EQUATIONS
    half = contact_workspace(8).sticking.lower_half
    assert len(half) >= MOST_EQUATIONS * (MOST_EQUATIONS + 1) // 2


def test_what_cannot_stand_keeps_its_modes() -> None:
    """A foot that is drawn up, one that is to slip, and a stop that was let go but presses."""
    delassus, free = standing(np.random.default_rng(0), 3, 1)
    up = free.copy()
    up[::2] = 1.0
    pressed = free.copy()
    pressed[4] = -3.0
    for data, modes in (
        (up, [STICK, STICK, STICK]),
        (free, [STICK, 2, STICK]),
        (pressed, [STICK, STICK, OPEN]),
    ):
        held, answer = solved(problem_of(delassus, data, 1), modes)
        assert not held
        assert answer.mode.tolist() == modes


def test_codes_tell_which_vertices_share_their_row() -> None:
    shared = sharing(0b1101)
    assert shared.source.tolist() == [0, 1, 2, 4, 5, 6]
    assert shared.equation.tolist() == [0, 1, 2, 1, 3, 4, 5, 4]
    assert shared.sharers.tolist() == [1, 2, 1, 1, 2, 1]
