"""The paper's robot and a gait of it, designed once."""

from __future__ import annotations

import pytest
import walking

import heelstrike as hs


@pytest.fixture(scope="session")
def bravo7() -> hs.Robot:
    return walking.bravo7()


@pytest.fixture(scope="session")
def gait() -> hs.Gait:
    return walking.gait()
