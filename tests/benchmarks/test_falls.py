"""The judge of random falls accepts a fall, and objects to records that break its laws."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import falls
import numpy as np
import pytest

import heelstrike as hs


@pytest.fixture(scope="module")
def run() -> hs.Run:
    """A fall on two points."""
    return falls.fall("compass_gait", 0)


def broken(run: hs.Run, **changed: Any) -> tuple[str, ...]:
    """Laws that a record breaks once some of it is changed."""
    return falls.judge(replace(run, **changed)).broken()


def test_a_fall_has_no_objections(run: hs.Run) -> None:
    found = falls.judge(run)
    assert found.broken() == ()
    assert found.figures["bridges"] == 0
    assert found.figures["energy in play (J)"] > 1.0


def test_a_run_cut_short_does_not_arrive(run: hs.Run) -> None:
    moving = ("time", "position", "velocity", "torque", "gap", "contact_point", "contact_normal")
    forces = ("contact_force", "stop_torque", "friction_torque", "brake_torque")
    ties = ("loop_force", "coupling_force")
    short = {name: getattr(run, name)[:-5] for name in (*moving, *forces, *ties)}
    assert "does not arrive" in broken(run, **short)


def test_a_robot_a_little_lower_is_in_the_ground(run: hs.Run) -> None:
    q = run.position.copy()
    q[:, 1] -= 2e-10
    assert set(broken(run, position=q)) == {"in the ground", "force off the ground"}


def test_a_jump_is_no_motion(run: hs.Run) -> None:
    q = run.position.copy()
    q[len(q) // 2 :, 0] += 1e-6
    assert broken(run, position=q) == (falls.UNMOVED,)


def test_energy_from_nowhere_is_seen(run: hs.Run) -> None:
    v = run.velocity.copy()
    v[20:] *= 1.001  # in flight
    assert "energy rises" in broken(run, velocity=v)


def test_the_ground_does_not_pull(run: hs.Run) -> None:
    assert "force that pulls" in broken(run, contact_force=-run.contact_force)


@pytest.mark.parametrize("name", hs.builtin_robots())
def test_a_start_is_above_the_ground_and_within_the_ranges(name: str) -> None:
    robot = hs.load_robot(name)
    for seed in range(5):
        friction, state = falls.random_start(robot, seed)
        assert 0.1 <= friction <= 1.0
        assert 0.0 <= falls.heights(robot, state.q[None]).min() <= falls.DROP
        assert np.all(state.q >= robot.model.lower)
        assert np.all(state.q <= robot.model.upper)
        again = falls.random_start(robot, seed)[1]
        np.testing.assert_array_equal(state.q, again.q)
        assert not np.array_equal(state.q, falls.random_start(robot, seed + 100)[1].q)


def test_the_table_counts_what_did_not_arrive() -> None:
    lost = {"method": "bravo7", "seed": 3, "status": "hang", "message": "more than 60 s"}
    text = falls.table([lost])
    assert "| bravo7 | 1 | 0 | 1 |" in text
    assert "- bravo7 3: hang." in text


@pytest.mark.parametrize(("robot", "seed"), [("bravo7", 15), ("human7", 14), ("walker2d", 5)])
def test_what_once_left_its_place_stays_there(robot: str, seed: int) -> None:
    """Straight legs that coincide; a stop touched and left within a step; one beyond its end."""
    worst = falls.judge(falls.fall(robot, seed)).worst
    for law in ("in the ground", "force off the ground", "joint beyond its range"):
        assert worst[law] <= falls.PLACE
