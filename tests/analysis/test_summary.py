"""The page of figures, for a person and for a program."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import walking
from synthetic_runs import SUMMARY_KEYS, make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import summarize
from heelstrike.analysis.motion import motion
from heelstrike.dynamics import center_of_mass, energy, link_poses


def test_keys_and_kinds() -> None:
    run = walking.walk(steps=2)
    figures: dict[str, Any] = json.loads(run.summary(gait=walking.gait()).to_json())
    assert set(figures) >= SUMMARY_KEYS
    assert figures["gait"].keys() >= {"step_length_m", "step_duration_s", "cost_N2m2s"}
    assert figures["solver"].keys() >= {"name", "solves", "fallbacks", "failures"}
    assert figures["status"] == "completed"
    assert figures["zmp_limits_m"] == [-0.1, 0.1]
    assert figures["real_time_factor"] == figures["duration_s"] / figures["wall_s"]
    assert figures["gait"]["cost_N2m2s"] == walking.gait().cost
    assert figures["tracking_rms_rad"] > 0.0


def test_what_does_not_exist_is_null() -> None:
    run = hs.simulate(pendulum(), state=hs.State([0.3], [0.0]), duration=0.01)
    figures = json.loads(run.summary().to_json())
    assert figures["gait"] is None
    for key in ("tracking_rms_rad", "zmp_min_m", "friction_use_max", "cost_of_transport"):
        assert figures[key] is None
    assert figures["zmp_limits_m"] == [None, None]
    assert figures["slip_max_m"] == 0.0


def test_run_without_rows() -> None:
    run = make_run(walking.bravo7(), np.zeros(0))
    summary = summarize(run, gait=walking.gait())
    assert summary.steps == 0
    assert summary.duration_s == 0.0
    json.loads(summary.to_json())
    str(summary)


def test_text_for_a_person() -> None:
    summary = walking.walk(steps=2).summary(gait=walking.gait())
    text = str(summary)
    assert text.startswith("bravo7: completed at t = ")
    for words in ("zero moment point", "friction use", "× real time", "N²m²s"):
        assert words in text
    from rich.console import Console

    console = Console(width=100, record=True, file=io.StringIO())
    console.print(summary)
    assert "zero moment point" in console.export_text()


def test_motion_agrees_with_the_queries_of_one_state() -> None:
    run = walking.walk(steps=1)
    robot = run.robot
    whole = motion(robot, run.position, run.velocity, run.contact_point)
    for row in (0, 123, -1):
        q, v = run.position[row], run.velocity[row]
        poses = link_poses(robot, q)
        np.testing.assert_array_equal(whole.link_origin[row], poses.origin)
        np.testing.assert_array_equal(whole.link_angle[row], poses.angle)
        np.testing.assert_array_equal(whole.center_of_mass[row], center_of_mass(robot, q))
        np.testing.assert_array_equal(
            (whole.kinetic[row], whole.potential[row]), energy(robot, q, v)
        )
    # The contact points' velocities are the derivatives of their places.
    h = run.time[1] - run.time[0]
    difference = (run.contact_point[2:] - run.contact_point[:-2]) / (2.0 * h)
    smooth = slice(100, 600)
    np.testing.assert_allclose(whole.contact_velocity[1:-1][smooth], difference[smooth], atol=5e-3)
