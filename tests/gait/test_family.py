"""Families of gaits: each is the optimum that is found alone, and those between walk."""

from __future__ import annotations

import importlib
import json
from functools import wraps
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait import branches

families = importlib.import_module("heelstrike.gait.family")

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

SLOPES = np.array([0.0, 0.03])
SPEEDS = [0.40, 0.45]
ASKED = {"step_duration": 0.70, "starts": 1}


@pytest.fixture(scope="module")
def family(bravo7: hs.Robot) -> hs.GaitFamily:
    return hs.gait_family(bravo7, speed=SPEEDS, slope=SLOPES, **ASKED)


def test_each_gait_is_the_one_that_is_found_alone(bravo7: hs.Robot, family: hs.GaitFamily) -> None:
    assert len(family.gaits) == 4
    assert not family.gaps
    alone = hs.optimize_gait(bravo7, speed=0.45, slope=0.03, **ASKED)
    found = family[1, 1]
    assert found is not None
    assert found.optimal
    assert (found.slope, found.step_length) == (0.03, 0.45 * 0.70)
    assert found.cost == pytest.approx(alone.cost, rel=1e-6)
    assert family.at(speed=0.45, slope=0.03) is found


def test_a_gait_between_lands_as_it_says(bravo7: hs.Robot, family: hs.GaitFamily) -> None:
    """Equations hold to rounding, it is the optimum, and it walks there."""
    gait = family.at(speed=0.42, slope=0.02)
    assert gait.optimal
    assert gait.margins.touchdown_error < 1e-10
    assert gait.margins.impact_error < 1e-10
    best = hs.optimize_gait(bravo7, speed=0.42, slope=0.02, **ASKED)
    assert gait.cost == pytest.approx(best.cost, rel=1e-8)
    run = hs.simulate(
        bravo7, hs.ComputedTorque(bravo7, gait), state=gait.initial_state, duration=1.45,
        method=hs.EventDriven(), ground=hs.Ground(friction=0.75, slope=0.02),
    )  # fmt: skip
    assert run.completed
    landed = [event.time for event in run.events if event.kind.name == "TOUCHDOWN"]
    np.testing.assert_allclose(landed[:2], 0.70, atol=1e-6)


def test_a_gait_between_holds_limits_that_the_mean_breaks(bravo7: hs.Robot) -> None:
    """Steeply downhill: the mean of the gaits brings the zero moment point too near to the toe."""
    slopes = np.deg2rad([-8.0, -6.2])
    family = hs.gait_family(bravo7, speed=[0.30, 0.333], slope=slopes, **ASKED)
    between = family.at(speed=0.3165, slope=float(slopes.mean()))
    assert between.optimal
    assert between.margins.zero_moment_point >= 0.02 - 1e-7
    assert between.margins.clearance >= -1e-7
    ground = hs.Ground(friction=0.75, slope=between.slope)
    gap = hs.Simulation(bravo7, state=between.initial_state, ground=ground).contacts.gap
    assert np.abs(gap).max() <= 1e-12


def test_what_was_interrupted_goes_on(bravo7: hs.Robot, tmp_path: Path) -> None:
    file = tmp_path / "family.json"
    told: list[float] = []

    def interrupt(share: float) -> None:
        told.append(share)
        if share > 0.3:  # the second of two
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hs.gait_family(bravo7, speed=SPEEDS, **ASKED, file=file, progress=interrupt)
    begun = hs.load_gait_family(file, bravo7)
    assert list(begun.gaits) == [(0,)]
    whole = hs.gait_family(bravo7, speed=SPEEDS, **ASKED, file=file)
    assert set(whole.gaits) == {(0,), (1,)}
    first, kept = begun[0], whole[0]
    assert first is not None
    assert kept is not None
    np.testing.assert_array_equal(first.pieces, kept.pieces)
    with pytest.raises(GaitError, match="holds a family with other axes"):
        hs.gait_family(bravo7, speed=[0.40, 0.46], **ASKED, file=file)


def test_a_finished_family_is_only_read(
    bravo7: hs.Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neighbours that differ much are not sought again; a file that does not know of them is."""
    file = tmp_path / "family.json"
    told: list[float] = []
    monkeypatch.setattr(branches, "APART", 0.0)  # all neighbours
    hs.gait_family(bravo7, speed=SPEEDS, **ASKED, file=file, progress=told.append)
    assert told == [0.0, 0.35, 0.7, 1.0, 1.0]
    assert hs.load_gait_family(file, bravo7).settled == {((0,), (1,))}
    written = file.read_bytes()
    with monkeypatch.context() as patch:
        never = wraps(families.optimize_gait)(lambda *_, **__: pytest.fail("designed again"))
        patch.setattr(families, "optimize_gait", never)
        again = hs.gait_family(bravo7, speed=SPEEDS, **ASKED, file=file)
    assert len(again.gaits) == 2
    assert file.read_bytes() == written
    older = json.loads(written)
    del older["settled"], older["sha256"]
    file.write_text(json.dumps(older), encoding="utf-8")
    assert not hs.load_gait_family(file, bravo7).settled


def test_gaps_are_named(bravo7: hs.Robot) -> None:
    family = hs.gait_family(bravo7, step_length=[0.30, 1.9], **ASKED)
    assert list(family.gaits) == [(0,)]
    assert "cannot take a step of 1.9 m" in family.gaps[1,]
    with pytest.raises(GaitError, match=r"no gait at step_length = 1\.9"):
        family.at(step_length=1.0)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"speed": 0.4}, "give a sequence"),
        ({"speed": [0.5, 0.4]}, "rising order"),
        ({"slope": [0.0, "a"]}, "slope must be"),
    ],
)
def test_grids_that_are_none(bravo7: hs.Robot, asked: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(GaitError, match=words):
        hs.gait_family(bravo7, step_duration=0.7, **asked)


def test_places_outside(family: hs.GaitFamily) -> None:
    with pytest.raises(GaitError, match=r"outside of the family, 0\.4 to 0\.45"):
        family.at(speed=0.5, slope=0.0)
    with pytest.raises(GaitError, match="give a value of each axis, speed, slope"):
        family.at(speed=0.42)
