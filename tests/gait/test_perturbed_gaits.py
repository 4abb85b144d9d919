"""The option that perturbs gaits does so, and gently."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from perturbed_gaits import perturbed

import heelstrike as hs


def test_unknowns_change_by_what_is_asked() -> None:
    unknowns = np.linspace(-1.0, 1.0, 50)
    program = SimpleNamespace(polished=lambda unknowns: unknowns)
    same = perturbed(lambda _, unknowns: unknowns, 1e-12)
    found = same(program, unknowns)
    change = (found - unknowns)[:-2]
    assert 0.3e-12 < np.std(change) < 3e-12
    np.testing.assert_array_equal(found[-2:], unknowns[-2:])
    np.testing.assert_array_equal(found, same(program, unknowns))


def test_gaits_of_this_suite_are_perturbed_if_asked(
    request: pytest.FixtureRequest, gait: hs.Gait
) -> None:
    size = request.config.getoption("perturb_gaits")
    from heelstrike.gait import design

    assert (design.designed_gait.__name__ == "perturbed_gait") == (size > 0.0)
    assert gait.step_length == 0.30
    assert gait.step_duration == 0.70
