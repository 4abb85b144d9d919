"""Derivatives are of the robot that there is, though code is made for some of its numbers."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.contact.linearized.partials import Differentiated, differentiated
from heelstrike.robot.model import Model

UP = np.array([0.0, 1.0])


def own_model() -> Model:
    """Return bravo7's model with arrays of its own."""
    model = walking.bravo7().model
    return model.replaced(damping=np.array(model.damping), mass=np.array(model.mass))


def slopes(at: Differentiated) -> np.ndarray:
    rng = np.random.default_rng(1)
    q, v, a = rng.standard_normal((3, 9))
    at.place(q, v, UP)
    at.look(ahead=0.0, acceleration=a)
    return np.array(at.partials.lacking_by_v)


def test_other_numbers_are_looked_at_and_other_zeros_refused() -> None:
    model = own_model()
    at = Differentiated(model)
    before = slopes(at)
    model.mass[3] *= 2.0
    heavier = slopes(at)
    assert np.abs(heavier - before).max() > 0.1
    np.testing.assert_array_equal(heavier, slopes(Differentiated(model)))
    assert not model.damping.any()
    model.damping[4] = 0.3
    with pytest.raises(hs.SimulationError, match="some damping of the robot was 0, 1 or -1"):
        at.look(ahead=0.0)


def test_equations_that_are_kept_are_made_anew_for_a_model_that_has_changed() -> None:
    model = own_model()
    before = slopes(differentiated(model))
    assert differentiated(model) is differentiated(model)
    model.damping[4] = 0.3
    change = slopes(differentiated(model)) - before
    expected = np.zeros((9, 9))
    expected[4, 4] = 0.3  # r has minus the damper's force in it
    np.testing.assert_allclose(change, expected, atol=1e-12)
