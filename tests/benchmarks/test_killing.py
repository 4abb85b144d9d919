"""Campaigns and their workers are killed at random moments: nothing is lost, nothing twice."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from campaigns.killing import killed, short_campaign


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers are found in /proc")
@pytest.mark.parametrize("workers", [False, True])
def test_killed_at_random_nothing_is_lost_and_nothing_is_twice(
    tmp_path: Path, workers: bool
) -> None:
    campaign = short_campaign(tmp_path, 600)
    found = killed(tmp_path, campaign, workers=workers, most=3, seed=1)
    assert 1 <= found.kills <= 3  # a fast machine may be through before
    assert (found.lost, found.twice) == (0, 0)
    assert found.same
