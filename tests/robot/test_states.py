"""States by the names of joints: made, read, mirrored, perturbed, saved and restored."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damage import damaged_bytes, damaged_json
from stored_files import SAVED

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotBuilder, State, builtin_robots, load_robot


@pytest.fixture
def robot() -> Robot:
    return load_robot("bravo7")


def some_state(robot: Robot, seed: int = 0) -> State:
    draw = np.random.default_rng(seed)
    return State(draw.normal(size=robot.nq), draw.normal(size=robot.nv))


def assert_same(one: State, other: State) -> None:
    np.testing.assert_array_equal(one.q, other.q)
    np.testing.assert_array_equal(one.v, other.v)


def test_setting_one_joint_by_name(robot: Robot) -> None:
    state = robot.state({"left_knee": 0.4}, {"root_x": 0.8})
    expected = robot.reference_state()
    expected.q[robot.joint_names.index("left_knee")] = 0.4
    expected.v[0] = 0.8
    assert_same(state, expected)
    start = some_state(robot)
    before = State(start.q, start.v)
    changed = robot.state({"left_knee": 0.1, 3: 0.2, -1: 0.3}, start=start)
    assert_same(start, before)  # it is left as it is
    differing = np.flatnonzero(changed.q != start.q)
    np.testing.assert_array_equal(differing, [3, robot.joint_index("left_knee"), robot.nq - 1])


def test_reading_by_name(robot: Robot) -> None:
    state = some_state(robot)
    assert list(robot.positions(state)) == list(robot.joint_names)
    assert robot.positions(state)["right_ankle"] == state.q[robot.joint_index("right_ankle")]
    assert robot.velocities(state)["root_pitch"] == state.v[2]
    again = robot.state(robot.positions(state), robot.velocities(state))
    assert_same(again, state)


def test_indices_by_name(robot: Robot) -> None:
    for i, name in enumerate(robot.joint_names):
        assert robot.joint_index(name) == i == robot.joint_index(i)
    assert robot.joint_index(-1) == robot.nv - 1
    assert robot.actuator_names[robot.actuator_index("left_ankle")] == "left_ankle"
    # Joints and actuators number differently.
    assert robot.joint_index("right_hip") == robot.actuator_index("right_hip") + 3


@pytest.mark.parametrize("joint", ["left_nee", "", 9, -10, 1.5, True, None])
def test_unknown_joints(robot: Robot, joint: Any) -> None:
    words = rf"'bravo7' has no joint {joint!r}.*root_x, root_z, .*left_ankle \(0 to 8\)"
    for attempt in (
        lambda: robot.joint_index(joint),
        lambda: robot.state({joint: 0.1}),
        lambda: robot.perturbed(robot.reference_state(), seed=0, position={joint: 0.1}),
        lambda: robot.perturbed(robot.reference_state(), seed=0, joints=[joint]),
    ):
        with pytest.raises(RobotError, match=words):
            attempt()
    with pytest.raises(RobotError, match="Did you mean 'left_knee'"):
        robot.joint_index("left_nee")


@pytest.mark.parametrize("value", [np.nan, np.inf, "much", None])
def test_values_that_are_none(robot: Robot, value: Any) -> None:
    with pytest.raises(RobotError, match=r"position of joint 'left_knee'.*finite number"):
        robot.state({"left_knee": value})
    with pytest.raises(RobotError, match=r"velocity of joint 'left_knee'.*finite number"):
        robot.state(velocity={"left_knee": value})


def test_states_of_another_robot(robot: Robot) -> None:
    for attempt in (robot.positions, robot.mirrored, lambda state: robot.state(start=state)):
        with pytest.raises(RobotError, match="q of a state of robot 'bravo7' must be 9 finite"):
            attempt(State(np.zeros(7), np.zeros(7)))
    with pytest.raises(RobotError, match="v of a state"):
        robot.velocities(State(np.zeros(9), np.full(9, np.nan)))


@pytest.mark.parametrize(
    "name", [name for name in builtin_robots() if load_robot(name).mirror is not None]
)
def test_a_mirrored_state_has_the_energy_and_the_feet_of_the_other_side(name: str) -> None:
    """Left and right are alike: energy and the motion of the centre of mass do not change."""
    robot = load_robot(name)
    state = some_state(robot)
    other = robot.mirrored(state)
    assert not np.array_equal(other.q, state.q)
    back = robot.mirrored(other)  # through the reference and back: round-off of 1 m
    np.testing.assert_allclose(back.q, state.q, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(back.v, state.v)
    for query in (dynamics.kinetic_energy, dynamics.center_of_mass_velocity):
        expected = query(robot, state.q, state.v)
        np.testing.assert_allclose(query(robot, other.q, other.v), expected, rtol=1e-12, atol=1e-12)
    assert robot.mirror is not None
    np.testing.assert_allclose(
        dynamics.contact_positions(robot, other.q)[robot.mirror.contact],
        dynamics.contact_positions(robot, state.q),
        atol=1e-12,
    )


def test_mirroring_by_name(robot: Robot) -> None:
    mirrored = robot.mirrored(robot.state({"left_knee": 0.4, "root_pitch": 0.1}, {"right_hip": 2}))
    assert_same(mirrored, robot.state({"right_knee": 0.4, "root_pitch": 0.1}, {"left_hip": 2}))


def test_no_mirror_image(robot: Robot) -> None:
    with pytest.raises(RobotError, match=r"no mirror image.*heelstrike inspect"):
        replace(robot, mirror=None).mirrored(robot.reference_state())


def test_perturbations_are_reproducible_and_independent(robot: Robot) -> None:
    start = robot.reference_state()
    one = robot.perturbed(start, seed=7, position=0.01, velocity=0.1)
    assert_same(robot.perturbed(start, seed=7, position=0.01, velocity=0.1), one)
    other = robot.perturbed(start, seed=8, position=0.01, velocity=0.1)
    assert np.all(other.v != one.v)
    assert_same(start, robot.reference_state())
    # A joint's number does not depend on which others are perturbed, nor on how it is named.
    hip = robot.joint_index("left_hip")
    for alone in (
        robot.perturbed(start, seed=7, position=0.01, velocity=0.1, joints=["left_hip"]),
        robot.perturbed(start, seed=7, position={"left_hip": 0.01}, velocity={hip: 0.1}),
        robot.perturbed(start, seed=7, position=0.01, velocity=0.1, joints="left_hip"),
    ):
        assert (alone.q[hip], alone.v[hip]) == (one.q[hip], one.v[hip])
        np.testing.assert_array_equal(np.delete(alone.v, hip), 0.0)
        np.testing.assert_array_equal(np.delete(alone.q, hip), np.delete(start.q, hip))


def test_perturbations_have_the_spread_asked_for(robot: Robot) -> None:
    """2000 draws of 9: the estimate of a deviation errs by 1/sqrt(2 n) = 1.6 %, 5 sigma are 8 %."""
    start = robot.state({"left_knee": 1.0, "right_knee": 1.0})  # ranges are far away
    drawn = [robot.perturbed(start, seed=k, position=0.01, velocity=0.3) for k in range(2000)]
    for values, spread in (
        (np.array([state.q for state in drawn]) - start.q, 0.01),
        (np.array([state.v for state in drawn]), 0.3),
    ):
        np.testing.assert_allclose(values.std(axis=0), spread, rtol=0.08)
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=5.0 * spread / np.sqrt(2000))
        correlation = np.corrcoef(values.T) - np.eye(robot.nv)
        assert np.abs(correlation).max() < 5.0 / np.sqrt(2000)


def test_perturbed_positions_stay_in_range(robot: Robot) -> None:
    model = robot.model
    for seed in range(20):
        q = robot.perturbed(robot.reference_state(), seed=seed, position=2.0).q
        assert np.all((model.lower <= q) & (q <= model.upper))
    outside = robot.state({"left_knee": model.lower[robot.joint_index("left_knee")] - 0.3})
    q = robot.perturbed(outside, seed=0, velocity=1.0).q  # what is outside is not moved in secret
    np.testing.assert_array_equal(q, outside.q)


@pytest.mark.parametrize("spread", [-0.1, np.nan, np.inf, {"left_hip": -1.0}, "wide"])
def test_spreads_that_are_none(robot: Robot, spread: Any) -> None:
    for which in ("position", "velocity"):
        with pytest.raises(RobotError, match=f"spread of (the|a) {which}"):
            robot.perturbed(robot.reference_state(), seed=0, **{which: spread})


@pytest.mark.parametrize("name", builtin_robots())
def test_states_through_files_bit_by_bit(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    state = some_state(robot)
    state.q[0], state.v[0] = 1.0 / 3.0, 5e-324
    path = robot.save_state(state, tmp_path / "Zustand ä.json")
    assert_same(robot.load_state(path), state)
    data = json.loads(path.read_text(encoding="utf-8"))
    assert (data["format"], data["version"]) == ("heelstrike state", 1)
    assert (data["robot"], data["joints"]) == (name, list(robot.joint_names))


def test_joints_of_a_file_are_found_by_name(robot: Robot, tmp_path: Path) -> None:
    state = some_state(robot)
    path = robot.save_state(state, tmp_path / "s.json")
    data = json.loads(path.read_text())
    for key in ("joints", "position_rad_or_m", "velocity_rad_or_m_per_s"):
        data[key].reverse()
    del data["sha256"]
    path.write_text(json.dumps(data))
    assert_same(robot.load_state(path), state)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "heelstrike gait"}, 'with "format": "heelstrike state"'),
        ({"version": 2}, "version 2 of the format is not known here, only 1"),
        ({"version": True}, "version True"),
        ({"joints": ["hip"]}, "with the joints hip; robot 'bravo7' has root_x"),
        ({"joints": None}, "must be a list of different names, got None"),
        ({"joints": [["root_x"]]}, "must be a list of different names"),
        ({"position_rad_or_m": [1.0]}, '"position_rad_or_m" must be a list of 9 numbers'),
        ({"velocity_rad_or_m_per_s": ["1"] * 9}, "must be a number, got '1'"),
        ({"velocity_rad_or_m_per_s": [True] * 9}, "must be a number, got True"),
        ({"velocity_rad_or_m_per_s": [10**400] * 9}, "which no state has"),
        ({"velocity_rad_or_m_per_s": [np.nan] * 9}, "contains NaN"),
        ({"position_rad_or_m": [np.inf] * 9}, "contains Infinity"),
    ],
)
def test_files_that_are_no_state(
    robot: Robot, tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    path = robot.save_state(robot.reference_state(), tmp_path / "s.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(RobotError, match=words) as caught:
        robot.load_state(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not valid JSON"),
        (b"{", "not valid JSON"),
        (b"[]", "not a state file"),
        (b"\xff\xfe", "cannot be read"),
        (b"[" * 100_000, "cannot be read"),
        (b" " * (2**20 + 1), "larger than 1 MB"),
    ],
    ids=range(6),
)
def test_what_is_no_json(robot: Robot, tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "s.json"
    path.write_bytes(content)
    with pytest.raises(RobotError, match=words):
        robot.load_state(path)


def test_where_no_file_can_be(robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="no such file"):
        robot.load_state(tmp_path / "gone.json")
    with pytest.raises(RobotError, match="cannot write"):
        robot.save_state(robot.reference_state(), tmp_path / "no" / "folder" / "s.json")
    with pytest.raises(RobotError):
        robot.load_state("a\0b")


@pytest.mark.parametrize("damage", [damaged_bytes, damaged_json])
def test_damaged_files_are_refused_in_words_or_still_states(
    damage: Callable[[bytes, random.Random], bytes], robot: Robot, tmp_path: Path
) -> None:
    content = (SAVED / "state.json").read_bytes()
    path = tmp_path / "state.json"
    refused = []
    for seed in range(150):
        path.write_bytes(damage(content, random.Random(seed)))
        try:
            state = robot.load_state(path)
        except RobotError as error:
            refused.append(str(error))
        else:
            assert np.all(np.isfinite((*state.q, *state.v))), seed
    assert len(refused) > 50
    assert all(str(path) in words and len(words) < 2000 for words in refused)


def test_joints_that_only_look_like_the_names(tmp_path: Path) -> None:
    builder = RobotBuilder("numbered")
    builder.hinge("1", None, mass=1.0, inertia=0.1)
    robot = builder.build()
    path = robot.save_state(robot.reference_state(), tmp_path / "s.json")
    path.write_text(path.read_text().replace('"1"', "1"))
    with pytest.raises(RobotError, match="must be a list of different names"):
        robot.load_state(path)


def test_files_of_version_0_1_still_load(robot: Robot) -> None:
    state = robot.load_state(SAVED / "state.json")
    expected = robot.reference_state()
    expected.q[1] += 2e-3
    np.testing.assert_array_equal(state.q, expected.q)


def test_one_digit_that_is_another(robot: Robot, tmp_path: Path) -> None:
    state = robot.reference_state()
    state.q[3] = 0.125
    path = robot.save_state(state, tmp_path / "s.json")
    path.write_text(path.read_text().replace("0.125", "0.135"))
    with pytest.raises(RobotError, match=r"s\.json: damaged: .* remove the entry \"sha256\""):
        robot.load_state(path)
    data = json.loads(path.read_text())
    del data["sha256"]
    path.write_text(json.dumps(data, indent=1))
    assert robot.load_state(path).q[3] == 0.135
