"""What `inspect_robot` finds: each fault planted alone in a sound robot."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import (
    FindingKind,
    Inspection,
    RobotBuilder,
    RobotWarning,
    builtin_robots,
    human,
    inspect_robot,
    load_robot,
)
from heelstrike.robot.inspection import facts


def leg(side: str) -> str:
    return (
        f'<body name="{side}_leg"><joint name="{side}_hip" axis="0 1 0" range="-1 1"/>'
        '<inertial pos="0 0 -0.5" mass="5" diaginertia="0.2 0.2 0.1"/>'
        '<geom type="sphere" size="0.01" pos="-0.1 0 -0.99" friction="0.8"/>'
        '<geom type="sphere" size="0.01" pos="0.1 0 -0.99" friction="0.8"/></body>'
    )


SOUND = (
    '<mujoco model="biped"><compiler angle="radian"/><worldbody><body name="trunk" pos="0 0 1">'
    '<joint name="root_x" type="slide" axis="1 0 0"/>'
    '<joint name="root_z" type="slide" axis="0 0 1" ref="1"/>'
    '<joint name="root_pitch" axis="0 1 0"/>'
    '<inertial pos="0 0 0.3" mass="10" diaginertia="1 1 1"/>'
    f"{leg('right')}{leg('left')}</body></worldbody></mujoco>"
)
LEG_INERTIA = 'mass="5" diaginertia="0.2 0.2 0.1"'
TOE = 'pos="0.1 0 -0.99"'


def look(path: Path, text: str) -> Inspection:
    path.write_text(text, encoding="utf-8")
    return inspect_robot(path)


def test_a_sound_robot(tmp_path: Path) -> None:
    inspection = look(tmp_path / "biped.xml", SOUND)
    assert inspection.sound
    assert inspection.loadable
    assert inspection.robot is not None
    assert inspection.robot.total_mass == 20.0


@pytest.mark.parametrize("name", builtin_robots())
def test_the_library_is_sound(name: str) -> None:
    assert inspect_robot(name).findings == ()


def test_robots_without_a_file_are_sound() -> None:
    assert inspect_robot(human(60, 1.6)).sound


@pytest.mark.parametrize(
    ("old", "new", "once", "kind", "words"),
    [
        (
            LEG_INERTIA,
            LEG_INERTIA.replace("5", "5.1"),
            True,
            FindingKind.ASYMMETRY,
            r"mass of right_hip and left_hip \(5.1, 5\)",
        ),
        (
            'range="-1 1"',
            'range="-1 1" damping="0.3"',
            True,
            FindingKind.ASYMMETRY,
            r"damping of right_hip and left_hip \(0.3, 0\)",
        ),
        (
            'friction="0.8"',
            'friction="0.7"',
            True,
            FindingKind.FRICTION,
            r"right_leg 0.7 and 0.8, left_leg 0.8",
        ),
        (
            TOE,
            'pos="0.1 0 -0.95"',
            False,
            FindingKind.CONTACT,
            r"right_leg_toe is 40 mm above the sole of right_leg",
        ),
        (
            'range="-1 1"',
            'range="-60 60"',
            False,
            FindingKind.LIMIT,
            r"left_hip may turn 9.55 times around. Degrees for radians\?",
        ),
        (
            'range="-1 1"',
            'range="0.5 1"',
            False,
            FindingKind.LIMIT,
            r"left_hip stands at 0 in the file, outside its range 0.5 … 1",
        ),
        (
            'diaginertia="1 1 1"',
            'diaginertia="1000 1000 1000"',
            False,
            FindingKind.INERTIA,
            r"'trunk' has the radius of gyration 10 m, more than twice .* extent of 1.29 m",
        ),
    ],
    ids=["mass", "damping", "friction", "toe", "degrees", "range", "gyration"],
)
def test_what_is_found(
    tmp_path: Path, old: str, new: str, once: bool, kind: FindingKind, words: str
) -> None:
    text = SOUND.replace(old, new, 1 if once else -1)
    assert text != SOUND
    inspection = look(tmp_path / "biped.xml", text)
    assert inspection.loadable
    found = [one.message for one in inspection.findings if one.kind is kind]
    assert found, inspection.text()
    assert any(re.search(words, message) for message in found), found
    # Nothing else is said, but that a change of one side is also a difference of both.
    assert {one.kind for one in inspection.findings} <= {kind, FindingKind.ASYMMETRY}


def test_an_inertia_that_violates_the_triangle_inequality(tmp_path: Path) -> None:
    """Moments 1, 3, 1: y is more than x and z together. In the plane y alone acts, and is 3."""
    text = SOUND.replace('diaginertia="1 1 1"', 'diaginertia="1 3 1"')
    inspection = look(tmp_path / "biped.xml", text)
    with pytest.warns(RobotWarning, match="no body has the inertia that the file gives trunk"):
        assert load_robot(tmp_path / "biped.xml").model.inertia[2] == 3.0
    told = {one.kind: one.message for one in inspection.findings}
    assert "'trunk' has the principal moments 1, 1, 3 kg m²" in told[FindingKind.INERTIA]
    assert inspection.robot is not None
    assert inspection.loadable


def test_a_file_that_asks_for_other_inertias(tmp_path: Path) -> None:
    """MuJoCo replaces 1, 3, 1 by their mean, 5/3: the file wants it so, but it is not silent."""
    text = SOUND.replace('diaginertia="1 1 1"', 'diaginertia="1 3 1"')
    text = text.replace("<compiler", '<compiler balanceinertia="true"')
    path = tmp_path / "biped.xml"
    inspection = look(path, text)
    assert inspection.loadable
    assert FindingKind.INERTIA in {one.kind for one in inspection.findings}
    with pytest.warns(RobotWarning, match="inertias of trunk violate the triangle inequality"):
        robot = load_robot(path)
    assert robot.model.inertia[2] == pytest.approx(5.0 / 3.0)
    sound = SOUND.replace("<compiler", '<compiler balanceinertia="true"')
    assert look(path, sound).sound


def test_a_tensor_that_violates_the_triangle_inequality(tmp_path: Path) -> None:
    """Products of inertia turn sound-looking diagonal entries into impossible moments."""
    text = SOUND.replace('diaginertia="1 1 1"', 'fullinertia="1 1 1 0.9 0 0"')  # 0.1, 1, 1.9
    found = look(tmp_path / "biped.xml", text).findings[0]
    assert "the principal moments 0.1, 1, 1.9 kg m²" in found.message


@pytest.mark.parametrize("moment", ["0.3", "-0.1"])
def test_impossible_inertia_in_urdf(tmp_path: Path, moment: str) -> None:
    path = load_robot("bravo7").save(tmp_path / "bravo7.urdf")
    sound = path.read_text("utf-8")
    assert inspect_robot(path).sound
    inspection = look(path, sound.replace('ixx="0.1522"', f'ixx="{moment}"', 1))
    assert any(
        one.kind is FindingKind.INERTIA and "right_thigh" in one.message
        for one in inspection.findings
    ) == (moment == "-0.1"), inspection.text()  # 0.3 <= 2 * 0.1522 is a body
    inspection = look(path, sound.replace('ixx="0.1522"', 'ixx="0.31"', 1))
    assert inspection.findings[0].kind is FindingKind.INERTIA
    assert "'right_thigh' has the principal moments" in inspection.findings[0].message


def test_links_that_move_without_mass(tmp_path: Path) -> None:
    text = SOUND.replace(LEG_INERTIA, 'mass="0" diaginertia="0 0 0"', 1)
    inspection = look(tmp_path / "biped.xml", text)
    assert not inspection.loadable
    assert any(
        one.kind is FindingKind.MASS and "'right_leg'" in one.message for one in inspection.findings
    )


def test_a_massless_link_with_a_heavy_one_behind() -> None:
    build = RobotBuilder("fork")
    root = build.hinge("a", None, mass=1, inertia=1)
    bare = build.hinge("b", root, at=(0, -1))
    for name in ("c", "d"):
        build.hinge(name, bare, mass=1, inertia=0.1, at=(0, -2))
    (found,) = [
        one for one in inspect_robot(build.build()).findings if one.kind is FindingKind.MASS
    ]
    assert "moves, by joint 'b', and has no mass" in found.message


def test_soles_that_are_not_level(tmp_path: Path) -> None:
    first, second, third = SOUND.partition('<body name="left_leg">')
    longer = third.replace("-0.99", "-1.02")
    inspection = look(tmp_path / "biped.xml", first + second + longer)
    (found,) = [one for one in inspection.findings if one.kind is FindingKind.FOOT]
    assert "not level" in found.message
    assert "left_leg -0.03 m" in found.message


def test_a_joint_out_of_the_plane_is_a_finding(tmp_path: Path) -> None:
    text = SOUND.replace('axis="0 1 0" range', 'axis="1 0 0" range')
    inspection = look(tmp_path / "biped.xml", text)
    assert inspection.robot is None
    (found,) = inspection.findings
    assert "'right_hip' of body 'right_leg' turns about (1, 0, 0)" in found.message
    assert inspection.text().startswith("findings")


def test_what_the_reader_warns_of_is_a_finding(tmp_path: Path) -> None:
    text = SOUND.replace("<compiler", '<option density="1.2"/><compiler')
    (found,) = look(tmp_path / "biped.xml", text).findings
    assert found.kind is FindingKind.FILE
    assert "air" in found.message


@pytest.mark.parametrize("thing", ["bravo8", "no/such/file.xml", "x" * 5000, "a\0b.xml", ""])
def test_what_cannot_be_looked_at(thing: str) -> None:
    with pytest.raises(RobotError):
        inspect_robot(thing)


def test_a_file_that_is_called_as_a_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bravo7").write_text("not a robot")
    assert inspect_robot("bravo7").sound


def test_a_file_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / "half.xml"
    path.write_text(SOUND[: len(SOUND) // 2])
    with pytest.raises(RobotError, match=r"half.xml: this is not well-formed XML"):
        inspect_robot(os.fspath(path))


def test_the_text_shows_the_tree() -> None:
    lines = inspect_robot("bravo7").text().splitlines()
    tree = [line[:15].rstrip() for line in lines if "hinge" in line or "slide" in line]
    assert tree == [
        *("root_x", "root_z", "root_pitch"),
        *("├ right_hip", "│ right_knee", "│ right_ankle"),
        *("└ left_hip", "  left_knee", "  left_ankle"),
    ]
    knee = next(line for line in lines if "left_knee" in line)
    for word in ("left_shank", "hinge +y", "3.4875", "0.0624", "-0.1745 … 2.269", "± 300"):
        assert word in knee


def test_the_text_shows_what_joints_have() -> None:
    build = RobotBuilder("one")
    build.hinge(
        "a",
        None,
        mass=1,
        inertia=1,
        damping=0.2,
        armature=0.3,
        stiffness=4,
        dry_friction=5,
        speed=6,
    )
    text = inspect_robot(build.build()).text()
    assert "armature 0.3, damping 0.2, spring 4, dry friction 5, speed 6" in text


def test_facts_are_plain() -> None:
    inspection = inspect_robot("bravo7")
    told = facts(inspection)
    assert inspection.robot is not None
    assert told["mass_kg"] == pytest.approx(75.0)
    assert told["lower"][:3] == [None] * 3
    np.testing.assert_array_equal(told["lower"][3:], inspection.robot.model.lower[3:])
    assert told["findings"] == []
