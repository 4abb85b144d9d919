"""Each engine has our robot: it flies as ours when steps vanish, and weighs as much at rest."""

from __future__ import annotations

import pytest

from heelstrike.experiments.engine_comparison import guard
from heelstrike.experiments.engine_comparison.entries import ENTRIES, Entry
from heelstrike.experiments.engine_comparison.guards import DOUBLE, SINGLE, WEIGHT, Guards
from heelstrike.experiments.engines import InvalidRunError, Scenario, compared, peers
from heelstrike.experiments.engines.packages import PACKAGES
from heelstrike.experiments.engines.served import engine_process, served
from heelstrike.robot import load_robot


@pytest.mark.slow
@pytest.mark.parametrize("name", list(ENTRIES))
def test_an_engine_has_our_robot(name: str) -> None:
    """The order of an engine whose error is not of its steps (Simbody's) tells nothing."""
    entry: Entry = ENTRIES[name]
    state = peers(load=False)[entry.package]
    if not compared({entry.package: state}):
        pytest.skip(f"{PACKAGES[entry.package].title} is {state}")
    found = guard(entry, load_robot("bravo7"), entry.given)
    assert found.extrapolated <= (SINGLE if found.float32 else DOUBLE)
    assert found.weight == pytest.approx(1.0, abs=WEIGHT)
    assert found.holds
    assert found.sunk_m < 2e-3
    if not entry.exact:
        assert found.order == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(ENTRIES))
def test_an_engine_knows_the_settings_that_the_search_tries(name: str) -> None:
    """A name that it does not know would count as a walk that falls, and nobody would see it."""
    entry = ENTRIES[name]
    state = peers(load=False)[entry.package]
    if not compared({entry.package: state}):
        pytest.skip(f"{PACKAGES[entry.package].title} is {state}")
    robot = load_robot("bravo7")
    scenario = Scenario("standing", robot, robot.reference_state(), 0.01)
    process = engine_process(entry.package)
    try:
        for setting, values in entry.choices.items():
            for value in values:
                given = {**entry.given, setting: value}
                served(entry.package, scenario, 1e-3, process=process, **given).restart()
        with pytest.raises(InvalidRunError, match="no_such_setting"):
            served(entry.package, scenario, 1e-3, process=process, no_such_setting=1.0)
    finally:
        process.end()


def test_guards_hold_for_both_and_in_their_precision() -> None:
    good = {"flight": 1e-4, "order": 1.0, "sunk_m": 0.0}
    assert Guards(**good, extrapolated=1e-7, weight=1.009, float32=False).holds
    assert not Guards(**good, extrapolated=1e-7, weight=1.011, float32=False).holds
    assert not Guards(**good, extrapolated=1e-5, weight=1.0, float32=False).holds
    assert Guards(**good, extrapolated=1e-5, weight=1.0, float32=True).holds
