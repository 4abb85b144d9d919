"""One contact at a time: the block of Gauss and Seidel against Coulomb's law itself."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.gauss_seidel import solve_block


def solved(
    delassus: np.ndarray, free: np.ndarray, friction: float | None
) -> tuple[int, np.ndarray, np.ndarray]:
    """Mode, impulse and velocity of one contact beside a second one that pushes with (1, 0.5)."""
    reduced = contact_workspace(2).reduced
    reduced.unknowns = size = len(delassus)
    reduced.matrix[:size, :size] = delassus
    reduced.offset[:size] = free
    reduced.normal[0] = 0
    reduced.tangent[0] = -1 if friction is None else 1
    reduced.cone[0] = 0.0 if friction is None else friction
    own = 1 if friction is None else 2
    impulse = np.array([*[7.0, -3.0][:own], 1.0, 0.5])  # the old answer is forgotten
    mode = uncompiled(solve_block)(0, reduced, impulse)
    np.testing.assert_array_equal(impulse[own:], [1.0, 0.5])
    return mode, impulse[:own], (delassus @ impulse + free)[:own]


@pytest.mark.parametrize("seed", range(60))
def test_a_contact_with_friction(seed: int) -> None:
    draw = np.random.default_rng(seed)
    rows = draw.normal(size=(4, 5))
    delassus, friction = rows @ rows.T, float(draw.uniform(0.1, 1.0))
    free = draw.normal(size=4) * [3.0, 3.0, 1.0, 1.0]
    mode, (normal, tangent), (apart, slip) = solved(delassus, free, friction)
    small = 1e-10 * np.abs(delassus).max()
    if mode == OPEN:
        assert normal == tangent == 0.0
        assert apart >= 0.0
        return
    assert normal > 0.0
    assert abs(apart) <= small
    if mode == STICK:
        assert abs(slip) <= small
        assert abs(tangent) <= friction * normal
    else:
        direction = {SLIP_FORWARD: 1.0, SLIP_BACKWARD: -1.0}[mode]
        assert direction * slip >= -small
        assert tangent == pytest.approx(-direction * friction * normal, rel=1e-12)


def test_all_modes_were_met() -> None:
    modes = set()
    for seed in range(60):
        draw = np.random.default_rng(seed)
        rows = draw.normal(size=(4, 5))
        delassus, friction = rows @ rows.T, float(draw.uniform(0.1, 1.0))
        free = draw.normal(size=4) * [3.0, 3.0, 1.0, 1.0]
        modes.add(solved(delassus, free, friction)[0])
    assert modes == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}


@pytest.mark.parametrize(("free", "impulse"), [(-3.0, 1.25), (1.0, 0.0), (-0.5, 0.0)])
def test_a_contact_without_friction(free: float, impulse: float) -> None:
    """w = 2 λ + 0.5 + free, of which the second contact has its share, is not to be negative."""
    delassus = np.array([[2.0, 0.25, 0.5], [0.25, 1.0, 0.0], [0.5, 0.0, 1.0]])
    mode, (normal,), (apart,) = solved(delassus, np.array([free, 0.0, 0.0]), None)
    assert normal == pytest.approx(impulse)
    assert mode == (STICK if impulse > 0.0 else OPEN)
    assert apart == pytest.approx(max(0.0, free + 0.5))
