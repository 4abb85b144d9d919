"""The judge of found gaits: its equations, and that it objects to gaits that are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closing import mechanics_of
from gait_judge import check, closes, equations, sample
from gait_requests import Asked, drawn

import heelstrike as hs

pytestmark = pytest.mark.slow
ASKED = Asked(robot="bravo7", length=0.30, duration=0.70, clearance=0.03, friction=0.75)


@pytest.fixture(scope="module")
def gait() -> hs.Gait:
    return hs.optimize_gait(hs.load_robot("bravo7"), **ASKED.arguments(), starts=1)


@pytest.mark.parametrize("name", ["bravo7", "walker2d", "rabbit"])
def test_its_equations_are_mujoco_s(name: str) -> None:
    """With springs, dampers, rotors and round feet, at random states."""
    of = equations(name)
    random = np.random.default_rng(0)
    mechanics = mechanics_of(of.robot, 0.0)
    q, v, a = of.robot.reference_state().q + random.normal(size=(3, of.robot.nv))
    force = random.normal(size=of.held)
    now = mechanics.at(q, v)
    rows = now.jacobian[list(of.robot.feet[0].contacts)]
    pushed = force[0] * rows[:, 1].mean(axis=0) + force[1:] @ rows[:, 0]
    found = np.array(of.balance(q, v, a, force)).ravel()
    expected = now.mass @ a + now.force - pushed
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_a_found_gait_is_one(gait: hs.Gait) -> None:
    told = check(equations("bravo7"), ASKED, gait)
    assert told["violated"] < 1e-7
    assert max(told["lands"], told["impact"]) < 1e-10
    assert told["cost"] == pytest.approx(gait.cost, rel=1e-9)
    assert closes(gait, hs.load_robot("bravo7"), ASKED.friction) < 1e-8


@pytest.mark.parametrize(
    ("other", "limit", "least"),
    [
        ({"clearance": 0.04}, "clearance", 0.005),
        ({"friction": 0.1}, "force", 0.01),
        ({"length": 0.31}, "", 0.0),
    ],
)
def test_it_objects_to_what_was_not_asked(
    gait: hs.Gait, other: dict[str, float], limit: str, least: float
) -> None:
    told = check(equations("bravo7"), replace(ASKED, **other), gait)
    assert told["limit"] == limit
    assert told["violated"] >= least
    assert told["lands"] == pytest.approx(abs(other.get("length", 0.30) - 0.30), abs=1e-12)


def test_it_objects_to_another_motion(gait: hs.Gait) -> None:
    """A knee that begins to move 1 % faster: neither does the foot land, nor the step repeat."""
    (phase,) = gait.phases
    pieces = phase.pieces.copy()
    pieces[:, 1, 1] *= 1.01
    other = replace(gait, phases=(replace(phase, pieces=pieces),))
    told = check(equations("bravo7"), ASKED, other)
    assert told["lands"] > 1e-4
    assert told["impact"] > 1e-6
    assert abs(told["cost"] / gait.cost - 1.0) > 1e-3


def test_the_sample_has_all_robots() -> None:
    seeds = sample(21)
    assert len(set(seeds)) == 21
    robots = [drawn(seed).robot for seed in seeds]
    assert all(robots.count(name) == 3 for name in set(robots))
    assert len(set(robots)) == 7
