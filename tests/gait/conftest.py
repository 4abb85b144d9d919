"""Gaits that several tests look at, designed once."""

from __future__ import annotations

import pytest
import walking

import heelstrike as hs


@pytest.fixture(autouse=True)
def _nothing_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is asked of the design of gaits is asked of a design, and not of a file."""
    monkeypatch.setenv("HEELSTRIKE_KEEP_GAITS", "0")


@pytest.fixture(scope="session")
def bravo7() -> hs.Robot:
    return walking.bravo7()


@pytest.fixture(scope="session")
def spring_flamingo() -> hs.Robot:
    return hs.load_robot("spring_flamingo")


@pytest.fixture(scope="session")
def gait() -> hs.Gait:
    return walking.gait()
