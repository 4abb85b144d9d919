"""Grounds, pushes and poses in a person's words: what they mean, and what is said of wrong ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.cli.options import Reading
from heelstrike.cli.planning import planar_robot_called
from heelstrike.cli.values import AHEAD, GROUNDS, ground_called, pose_called, pushes_called


def same(ours: hs.Ground, other: hs.Ground) -> bool:
    mine, theirs = ours.numbers(), other.numbers()
    return all(np.array_equal(mine[name], theirs[name]) for name in theirs)


def test_grounds_are_those_of_the_library() -> None:
    given = {"friction": 0.6, "restitution": 0.1}
    assert same(ground_called("flat", **given), hs.Ground(**given))
    assert same(ground_called("slope:-3", **given), hs.Ground(slope=math.radians(-3.0), **given))
    assert ground_called("slope:3").height(1.0) > 0.0  # positive climbs
    stairs = ground_called("stairs:-0.02x0.3", **given)
    assert stairs.height(AHEAD - 0.01) == 0.0
    np.testing.assert_allclose(stairs.height(AHEAD + np.array([0.01, 0.31])), [-0.02, -0.04])
    rough = ground_called("rough:0.01:7", **given)
    heights = rough.height(np.linspace(AHEAD, 20.0, 500))
    assert 0.008 < np.abs(heights).max() <= 0.01
    assert rough.height(AHEAD) == 0.0
    assert same(rough, ground_called("rough:0.01:7", **given))
    assert not same(rough, ground_called("rough:0.01:8", **given))


def test_a_file_of_corners(tmp_path: Path) -> None:
    path = tmp_path / "hill.csv"
    path.write_text("\ufeff# x z\n-1 0\n1, 0.1  # the top\n\n2\t0.0\n", encoding="utf-8")
    ground = ground_called(str(path), friction=0.5)
    assert same(ground, hs.Ground(friction=0.5, profile=[(-1, 0), (1, 0.1), (2, 0)]))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("slop:3", "Did you mean slope:DEGREES"),
        ("no/hill.txt", "there is no such file"),
        (".", "is no file"),
        ("slope", "write slope:DEGREES"),
        ("slope:3:4", "write slope:DEGREES"),
        ("slope:3%", "'3%' is not a finite number; write it without a unit"),
        ("slope:", "'' is not a finite number"),
        ("slope:nan", "'nan' is not a finite number"),
        ("slope:90", "a slope lies between -90 and 90 degrees"),
        ("flat:1", "write flat"),
        ("stairs:0.02", "write stairs:RISExTREAD"),
        ("stairs:0.02mx0.3", "'0.02m' is not a finite number"),
        ("stairs:0.02x-0.3", "--ground stairs:0.02x-0.3: stairs need count"),
        ("rough:0.01", "write rough:HEIGHT:SEED"),
        ("rough:-0.01:7", "--ground rough:-0.01:7: rough ground needs amplitude"),
        ("rough:0.01:-7", "the seed is a whole number, not '-7'"),
    ],
)
def test_wrong_grounds(words: str, said: str) -> None:
    with pytest.raises(hs.SimulationError) as refused:
        ground_called(words)
    assert said in str(refused.value)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"x,z\n0 0\n", "line 1: 'x' is not a finite number"),
        (b"0 0\n1 2 3\n", "line 2: a corner is two numbers"),
        (b"0 0\n", "at least two corners"),
        (b"", "at least two corners"),
        (b"0 0\n1 0\n0.5 0\n", "from left to right"),
        (b"\x89PNG\xff\xfe", "not a text file"),
        (b"0 0\n" * 300_000, "larger than 1 MB"),
    ],
    ids=["header", "three", "one", "empty", "back", "picture", "large"],
)
def test_wrong_files_of_corners(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "hill.txt"
    path.write_bytes(content)
    with pytest.raises(hs.SimulationError) as refused:
        ground_called(str(path))
    assert said in str(refused.value)
    assert str(path) in str(refused.value)


def test_pushes_are_those_of_the_library() -> None:
    assert pushes_called(None) == ()
    words = ["trunk:60:1:0.1", "left:foot:-5,2e1:0.5:2"]
    assert pushes_called(words) == (
        hs.Push("trunk", force=(60.0, 0.0), start=1.0, duration=0.1),
        hs.Push("left:foot", force=(-5.0, 20.0), start=0.5, duration=2.0),
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("trunk", "write LINK:FORCE:START:DURATION, as trunk:60:1:0.1"),
        ("60:1:0.1", "write LINK:FORCE:START:DURATION"),
        (":60:1:0.1", "write LINK:FORCE:START:DURATION"),
        ("trunk:1,2,3:1:0.1", "write LINK:FORCE:START:DURATION"),
        ("trunk:60N:1:0.1", "'60N' is not a finite number; write it without a unit"),
        ("trunk:60:1s:0.1", "'1s' is not a finite number"),
        ("trunk:inf:1:0.1", "'inf' is not a finite number"),
        ("trunk:60:1:-0.1", "the duration of a push must be a finite number ≥ 0"),
    ],
)
def test_wrong_pushes(words: str, said: str) -> None:
    with pytest.raises(hs.SimulationError) as refused:
        pushes_called([words])
    assert said in str(refused.value)


def test_poses_are_in_radians_or_say_degrees() -> None:
    assert pose_called(None) == {}
    pose = pose_called(["left_knee=0.4, right_knee=23deg", "root_z=-0.1", "a=b=-90°"])
    expected = {"left_knee": 0.4, "right_knee": math.radians(23.0), "root_z": -0.1}
    assert pose == expected | {"a=b": -0.5 * math.pi}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("left_knee", "write joint=value, as left_knee=0.4"),
        ("left_knee=", "write joint=value"),
        ("=0.4", "write joint=value"),
        ("", "write joint=value"),
        ("left_knee=0.4,", "write joint=value"),
        ("left_knee=23grad", "'23grad' is not a finite number"),
        ("left_knee=1,left_knee=2", "joint 'left_knee' is there twice"),
    ],
)
def test_wrong_poses(words: str, said: str) -> None:
    with pytest.raises(hs.RobotError) as refused:
        pose_called([words])
    assert said in str(refused.value)


def test_help_names_every_kind_of_ground() -> None:
    from heelstrike.cli.options import OnGround

    (option,) = OnGround.__metadata__  # type: ignore[attr-defined]
    assert [kind.partition(":")[0] for kind in option.metavar.split("|")] == ["FILE", *GROUNDS]


def test_a_built_in_robot_is_read_as_it_is_asked_for() -> None:
    """No option of reading is passed over in silence."""
    posed = planar_robot_called("bravo7", Reading(pose=["right_knee=0.4", "left_knee=0.4"]))
    assert posed.reference_state().q[posed.joint_index("left_knee")] == 0.4
    with pytest.raises(hs.RobotError, match="Did you mean 'left_knee'"):
        planar_robot_called("bravo7", Reading(pose=["left_kne=0.4"]))
