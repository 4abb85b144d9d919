"""Strict recovery from a push, and pushes timed by the phase of a walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import analysis
from heelstrike.analysis import phase_time, recovery

PUSHED = (3.0, 3.1)


def test_a_walk_that_goes_on_has_recovered() -> None:
    run = walking.walk()
    found = recovery(run, pushed=PUSHED)
    assert found
    assert found.reason == ""
    speed = walking.STEP_LENGTH / walking.STEP_DURATION
    assert found.normal_speed == pytest.approx(speed, rel=0.01)
    assert found.speed == pytest.approx(speed, rel=0.01)
    assert 0.9 < found.hip < 1.0
    assert 0.0 < found.pitch < 0.3


def test_what_is_no_recovery_is_named() -> None:
    run = walking.walk()
    late = run.time > 5.0
    x, z, pitch = np.eye(run.robot.nq)[:3]

    def moved(by: np.ndarray) -> hs.Run:
        return replace(run, position=run.position + late[:, None] * by)

    assert "the hip sank to 0.5" in recovery(moved(-0.4 * z), pushed=PUSHED).reason
    assert "the trunk leant by 0.7" in recovery(moved(0.7 * pitch), pushed=PUSHED).reason
    stands = moved(np.outer(5.0 - run.time, walking.STEP_LENGTH / walking.STEP_DURATION * x))
    assert "its speed is" in recovery(stands, pushed=PUSHED).reason
    back = moved(np.outer(2.0 * (5.0 - run.time), walking.STEP_LENGTH / walking.STEP_DURATION * x))
    assert recovery(back, pushed=PUSHED).speed < -0.3
    assert not recovery(back, pushed=PUSHED)
    assert "ends at" in recovery(run, pushed=(10.0, 10.1)).reason
    fell = replace(run, status=hs.RunStatus.FELL, message="it fell")
    assert "it fell" in recovery(fell, pushed=PUSHED).reason
    # A gait may lean all the time.
    assert recovery(replace(run, position=run.position - 0.7 * pitch), pushed=PUSHED)
    # What was before the push does not count.
    early = replace(run, position=run.position - 0.05 * (run.time < 0.2)[:, None] * z)
    assert recovery(early, pushed=PUSHED)


def test_a_robot_that_stops_stepping_has_not_recovered() -> None:
    """However fast it took its last steps."""
    run = walking.walk()
    stops = np.searchsorted(run.time, 6.0)
    held = np.minimum(np.arange(len(run.time)), stops)
    stands = replace(
        run,
        position=run.position[held],
        velocity=run.velocity[held],
        contact_force=run.contact_force[held],
        events=tuple(event for event in run.events if event.time <= run.time[stops]),
    )
    assert len(analysis.walking_steps(stands)) >= 7
    found = recovery(stands, pushed=PUSHED)
    assert found.speed == pytest.approx(0.0, abs=1e-6)
    assert "its speed is" in found.reason


def test_pushes_of_the_run_are_meant_where_none_is_named() -> None:
    run = walking.walk()
    with pytest.raises(hs.SimulationError, match=r"pushed=\(begin, end\)"):
        recovery(run)
    push = hs.Push("trunk", force=(1.0, 0.0), start=3.0, duration=0.1)
    assert recovery(replace(run, pushes=(push,))) == recovery(run, pushed=PUSHED)
    with pytest.raises(hs.SimulationError, match="push later"):
        recovery(run, pushed=(0.0, 0.1))
    assert recovery(run, pushed=(0.0, 0.1), normal_speed=0.43)


def test_a_push_is_timed_by_an_unpushed_walk() -> None:
    run = walking.walk()
    landings = [stance.touchdown for stance in analysis.walking_steps(run)]
    assert phase_time(run, 0, 0.5) == pytest.approx(0.5 * landings[0])
    assert phase_time(run, 3, 0.0) == landings[2]
    assert phase_time(run, 3, 1.0) == landings[3]
    for step, phase in ((len(landings), 0.5), (-1, 0.5)):
        with pytest.raises(hs.SimulationError, match="whole steps"):
            phase_time(run, step, phase)
    with pytest.raises(hs.SimulationError, match="from 0 to 1"):
        phase_time(run, 0, 1.5)
