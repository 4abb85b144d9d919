"""Gaits that several tests look at, designed once."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
import walking

import heelstrike as hs


@pytest.fixture(autouse=True)
def _a_changed_program_keeps_nothing(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a test makes of the design of gaits is read by no other, nor the other way round."""
    kept = os.environ["HEELSTRIKE_KEEP_GAITS"]
    if {"monkeypatch", "afresh"} & set(request.fixturenames):
        os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"
    yield
    os.environ["HEELSTRIKE_KEEP_GAITS"] = kept


@pytest.fixture
def afresh() -> None:
    """Gaits are designed in this test, whether they are kept or not."""


@pytest.fixture(scope="session")
def bravo7() -> hs.Robot:
    return walking.bravo7()


@pytest.fixture(scope="session")
def spring_flamingo() -> hs.Robot:
    return hs.load_robot("spring_flamingo")


@pytest.fixture(scope="session")
def gait() -> hs.Gait:
    return walking.gait()
