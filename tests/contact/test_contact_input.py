"""Malformed contact problems are refused in words that say what to mend."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from heelstrike.contact import SolveStatus, solve_contact
from heelstrike.contact.problem import _may_be_semidefinite
from heelstrike.errors import ContactProblemError

EYE = np.eye(4)
FREE = np.array([-1.0, 0.0, -1.0, 0.0])


@pytest.mark.parametrize(
    ("delassus", "free", "friction", "options", "message"),
    [
        (EYE, FREE[:3], 0.5, {}, "3 entries, but every contact needs two"),
        (np.eye(3), FREE, 0.5, {}, r"shape \(3, 3\), but free has 2 contacts.*\(4, 4\)"),
        (EYE[:2], FREE, 0.5, {}, r"shape \(2, 4\)"),
        (np.zeros((0, 0)), FREE, 0.5, {}, r"shape \(0, 0\)"),
        (
            EYE,
            FREE,
            [0.5, 0.5, 0.5],
            {},
            r"shape \(3,\); give one number, or one for each of the 2",
        ),
        (EYE, FREE, [0.5, -0.1], {}, r"friction\[1\] is -0.1.*cannot be negative"),
        (EYE, FREE, np.nan, {}, "friction.* is nan"),
        (np.full((4, 4), np.inf), FREE, 0.5, {}, r"delassus\[0, 0\] is inf"),
        (EYE, FREE * np.nan, 0.5, {}, r"free\[0\] is nan"),
        (-EYE, FREE, 0.5, {}, r"delassus\[0, 0\] is -1.*negative"),
        (EYE + np.triu(np.ones((4, 4)), 1), FREE, 0.5, {}, "not symmetric"),
        (EYE, FREE, 0.5, {"solver": "simplex"}, "unknown contact solver 'simplex'.*gauss_seidel"),
        (EYE, FREE, 0.5, {"solver": "warm_start"}, "unknown contact solver"),
        (EYE, FREE, 0.5, {"tolerance": 0.0}, "tolerance must be between 0 and 1"),
        ("robot", FREE, 0.5, {}, "delassus must be numbers"),
        ([[1.0, 2.0], [3.0]], FREE, 0.5, {}, "delassus must be numbers"),
    ],
)
def test_malformed(
    delassus: Any, free: Any, friction: Any, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ContactProblemError, match=message):
        solve_contact(delassus, free, friction, **options)


def test_unknown_keyword() -> None:
    with pytest.raises(TypeError, match="max_iterations"):
        solve_contact(EYE, FREE, 0.5, max_iterations=3)  # type: ignore[call-arg]


def test_data_are_not_written_to() -> None:
    G, b, mu = EYE.copy(), FREE.copy(), np.array([0.5, 0.5])
    solve_contact(G, b, mu)
    assert np.array_equal(G, EYE)
    assert np.array_equal(b, FREE)
    assert mu.tolist() == [0.5, 0.5]


def test_free_velocity_by_contact() -> None:
    flat = solve_contact(EYE, FREE, 0.5)
    shaped = solve_contact(EYE, FREE.reshape(2, 2), 0.5)
    assert np.array_equal(flat.impulse, shaped.impulse)


def test_every_status_has_words() -> None:
    assert all(status.text for status in SolveStatus)


@pytest.mark.parametrize(
    ("matrix", "possible"),
    [
        ([[1.0, 1.0], [1.0, 1.0]], True),
        ([[4.0, -2.0], [-2.0, 1.0]], True),
        ([[1.0, 1.1], [1.1, 1.0]], False),
        ([[1.0, -1.1], [-1.1, 1.0]], False),
        ([[0.0, 0.1], [0.1, 1.0]], False),
    ],
)
def test_an_entry_larger_than_its_diagonal_allows(matrix: object, possible: bool) -> None:
    """|G_ij| ≤ √(G_ii G_jj) in any J M⁻¹ Jᵀ (Cauchy and Schwarz)."""
    assert _may_be_semidefinite(np.array(matrix)) == possible
