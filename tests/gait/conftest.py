"""Gaits that several tests look at, designed once."""

from __future__ import annotations

import pytest

import heelstrike as hs


@pytest.fixture(scope="session")
def bravo7() -> hs.Robot:
    return hs.load_robot("bravo7")


@pytest.fixture(scope="session")
def spring_flamingo() -> hs.Robot:
    return hs.load_robot("spring_flamingo")


@pytest.fixture(scope="session")
def gait(bravo7: hs.Robot) -> hs.Gait:
    return hs.optimize_gait(bravo7, step_length=0.30, step_duration=0.70, friction=0.75)
