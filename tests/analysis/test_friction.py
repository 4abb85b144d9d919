"""How much of the friction cone is used (paper eq. 9)."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import box, make_run

import heelstrike as hs
from heelstrike.analysis import friction_use
from heelstrike.analysis.friction import friction_coefficient


def test_shares_of_the_cone() -> None:
    force = [[100.0, 50.0], [300.0, -10.0], [0.0, 0.0], [0.0, 0.0]]
    run = make_run(walking.bravo7(), [0.0], force=force, ground=hs.Ground(friction=0.5))
    use = friction_use(run)
    np.testing.assert_allclose(use.contact[0], [1.0, 10.0 / 150.0, np.nan, np.nan])
    # What the foot uses depends on the sum, not on how heel and toe share it.
    np.testing.assert_allclose(use.foot[0], [40.0 / 200.0, np.nan])
    np.testing.assert_allclose(use.total[0], 0.2)
    assert use.max == pytest.approx(0.2)


def test_frictionless_ground() -> None:
    force = [[100.0, 0.0], [100.0, 0.0], [100.0, 1.0], [100.0, 0.0]]
    run = make_run(walking.bravo7(), [0.0], force=force, ground=hs.Ground(friction=0.0))
    use = friction_use(run)
    np.testing.assert_array_equal(use.foot[0], [0.0, np.inf])
    assert use.max == np.inf


def test_no_force_no_figure() -> None:
    assert np.isnan(friction_use(make_run(walking.bravo7(), [0.0])).max)


def test_sliding_block_uses_all_of_it() -> None:
    robot = box()
    start = robot.reference_state()
    run = hs.simulate(
        robot,
        state=hs.State(start.q, np.array([1.0, 0.0, 0.0])),
        duration=0.1,
        ground=hs.Ground(friction=0.3),
    )
    np.testing.assert_allclose(friction_use(run).total, 1.0, rtol=1e-9)


def test_friction_that_varies_along_the_ground() -> None:
    ground = hs.Ground(friction=[0.2, 0.8], profile=[[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    run = make_run(walking.bravo7(), [0.0], ground=ground)
    np.testing.assert_array_equal(friction_coefficient(run)[0], [0.2, 0.8, 0.2, 0.8])
