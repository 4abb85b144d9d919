"""A sample of the falls that are built to have a cause: one of each kind has it."""

from __future__ import annotations

import named_falls as falls
import pytest

from heelstrike.analysis.diagnosis.symptoms import Cause


def test_every_cause_is_built() -> None:
    assert set(falls.KINDS) == set(Cause) - {
        Cause.UNKNOWN,
        Cause.TIPPED_SIDEWAYS,
    }  # robots in the plane do not


@pytest.mark.parametrize("cause", falls.KINDS)
def test_the_cause_that_was_built_is_told_first(cause: Cause) -> None:
    told, _ = falls.told_cause(cause, 1000)
    assert told.startswith(cause.value)


@pytest.mark.parametrize("cause", [Cause.SLIPPED, Cause.LEG_GAVE_WAY])
def test_without_it_the_robot_stays_up(cause: Cause) -> None:
    assert falls.walks_on(cause)
