"""The search for the largest disturbance, and what counts as recovery."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.analysis.stability.largest import largest


@cache
def trial() -> hs.Trial:
    """Rabbit under virtual constraints, 0.21 m in 0.58 s."""
    robot, phased = walking.rabbit(), walking.rabbit_phased()
    zero = hs.zero_dynamics(phased)
    return hs.Trial(
        robot=robot,
        controller=hs.VirtualConstraints(phased),
        state=zero.initial_state,
        step_length=zero.step_length,
        step_duration=zero.period,
        settling=8.0,
    )


def test_the_search_halves_the_stride_of_the_first_failure() -> None:
    tried: list[float] = []

    def recovers(size: float) -> bool:
        tried.append(size)
        return size < 5.3 or size > 7.9  # a gap: what recovers beyond a failure does not count

    found = largest(recovers, most=8.0, strides=4, halvings=3, unit="m")
    assert tried == [0.0, 2.0, 4.0, 6.0, 5.0, 5.5, 5.25]
    assert (found.recovered, found.failed, found.trials) == (5.25, 5.5, 7)
    assert str(found) == "5.25 m (not 5.5)"


def test_the_search_at_its_ends() -> None:
    everything = largest(lambda _: True, most=3.0, strides=3, unit="N s")
    assert (everything.recovered, everything.failed) == (3.0, np.inf)
    assert str(everything) == "≥ 3 N s"
    nothing = largest(lambda _: False, most=3.0)
    assert (nothing.recovered, nothing.failed, nothing.trials) == (0.0, 0.0, 1)
    for wrong in ({"most": 0.0}, {"most": 1.0, "strides": 0}, {"most": np.inf}):
        with pytest.raises(hs.SimulationError, match="a search needs"):
            largest(lambda _: True, **wrong)  # type: ignore[arg-type]


def test_pushes_forwards_are_easier_than_backwards() -> None:
    """Backwards, σ must still bear the robot over its highest point; half a step is left for it.

    σ⁺ = √(2ζ⁺) must stay above √(2 barrier): 10.98 and 8.42 kg m²/s. A push of p at a height of
    0.9 m takes 0.9 p, so that 3 N s just after touchdown are too much.
    """
    options = {"most": 12.0, "strides": 3, "halvings": 0}
    forwards = hs.largest_push(trial(), phase=0.0, **options)  # type: ignore[arg-type]
    backwards = hs.largest_push(  # type: ignore[arg-type]
        trial(), phase=0.0, direction=(-2.0, 0.0), **options
    )
    assert forwards.recovered == 12.0
    assert forwards.unit == "N s"
    assert (backwards.recovered, backwards.failed) == (0.0, 4.0)


def test_ground_that_is_not_level() -> None:
    """Rabbit gets uphill by itself and falls downhill, where gravity feeds its speed."""
    up = hs.largest_slope(trial(), uphill=True, most=3.0, strides=1, halvings=0)
    down = hs.largest_slope(trial(), uphill=False, most=3.0, strides=1, halvings=0)
    assert (up.recovered, down.recovered, down.failed) == (3.0, 0.0, 3.0)
    step = hs.largest_ground_step(trial(), up=True, most=0.02, strides=1, halvings=0)
    assert step.recovered == 0.02
    rough = hs.largest_roughness(trial(), seed=1, most=0.05, strides=1, halvings=1)
    assert (rough.recovered, rough.failed) == (0.0, 0.025)


def test_other_ground_begins_between_two_footholds(monkeypatch: pytest.MonkeyPatch) -> None:
    grounds: list[hs.Ground] = []
    level = trial().run(trial().begins)

    def run(self: hs.Trial, until: float, *, ground: hs.Ground) -> hs.Run:
        grounds.append(ground)
        return level

    monkeypatch.setattr(hs.Trial, "run", run)
    hs.largest_slope(trial(), uphill=True, most=3.0, strides=1, halvings=0)
    edge = float(np.asarray(grounds[-1].profile)[1, 0])
    poses = [hs.dynamics.contact_positions(trial().robot, q) for q in level.position]
    touching = [pose[pose[:, 1] < 1e-5, 0] for pose in poses]
    places = np.concatenate(touching)
    behind, beyond = places[places < edge].max(), places[places > edge].min()
    length = trial().step_length
    assert beyond - behind == pytest.approx(length, rel=0.02)
    assert edge - behind == pytest.approx(0.5 * length, rel=0.05)
    # The foot that comes down beyond it is the first to do so after the undisturbed steps.
    first = next(t for t, x in zip(level.time, touching, strict=True) if np.any(x > edge))
    period = trial().step_duration
    assert trial().begins + 0.9 * period < first < trial().begins + 1.1 * period


def test_what_counts_as_recovery() -> None:
    """Another speed is none after a push, but on other ground; the trunk's angle is the trial's."""
    begins = trial().begins
    run, at = trial().run(begins), (begins, begins)
    assert trial().recovered(run, at)
    faster = dataclasses.replace(trial(), step_length=0.35)
    assert "its speed is" in faster.recovered(run, at).reason
    assert faster.recovered(run, at, same_speed=False)
    assert not dataclasses.replace(trial(), step_length=0.8).recovered(run, at, same_speed=False)
    upright = dataclasses.replace(trial(), pitch=1e-3)
    assert "the trunk leant" in upright.recovered(run, at).reason
    fallen = trial().run(
        0.1, pushes=[hs.Push("torso", force=(-400.0, 0.0), start=0.0, duration=0.1)]
    )
    assert not trial().recovered(fallen, (0.0, 0.1))


@pytest.mark.parametrize(
    "options", [{"phase": 1.5}, {"direction": (0.0, 0.0)}, {"duration": 0.0}, {"phase": np.nan}]
)
def test_pushes_that_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(hs.SimulationError, match="a push needs a phase from 0 to 1"):
        hs.largest_push(trial(), **options)  # type: ignore[arg-type]


def test_trials_that_are_refused() -> None:
    with pytest.raises(hs.SimulationError, match="settling of a trial must be positive"):
        dataclasses.replace(trial(), settling=0.0)
    with pytest.raises(hs.SimulationError, match="floating trunk; 'compass_gait'"):
        dataclasses.replace(trial(), robot=hs.load_robot("compass_gait"))
    stairs = hs.Ground.stairs(rise=0.01, tread=0.3, count=2)
    with pytest.raises(hs.SimulationError, match="ground of a trial must be level"):
        hs.largest_slope(dataclasses.replace(trial(), ground=stairs), uphill=True)
