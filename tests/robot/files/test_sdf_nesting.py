"""Models inside models and included ones: the same leg, its shin in a model of its own."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import Robot, load_robot
from tests.robot.files.test_sdf import HIP, MJCF, SHIN, THIGH, assert_same, quiet

KNEE_AXIS = "<axis><xyz>0 -1 0</xyz><limit><effort>20</effort></limit></axis>"
HIP_JOINT = (
    '<joint name="hip" type="revolute"><parent>world</parent><child>thigh</child>'
    f"<axis><xyz>0 1 0</xyz>{HIP}</axis><drake:rotor_inertia>0.0005</drake:rotor_inertia>"
    "<drake:gear_ratio>10</drake:gear_ratio></joint>"
)
THIGH_LINK = f'<link name="thigh"><pose>0.1 0 1 0 0 0</pose>{THIGH}</link>{HIP_JOINT}'


def knee(parent: str, child: str, pose: str = "<pose>0 0 0.02 0 0 0</pose>") -> str:
    return (
        f'<joint name="knee" type="continuous"><parent>{parent}</parent><child>{child}</child>'
        f"{pose}{KNEE_AXIS}</joint>"
    )


def whole(inside: str, version: str = "1.9") -> str:
    return f'<sdf version="{version}"><model name="leg">{THIGH_LINK}{inside}</model></sdf>'


def shin(pose: str = "", more: str = "") -> str:
    return f'<link name="shin">{pose}{SHIN}</link>{more}'


def same_but_for(names: dict[str, str]) -> Robot:
    text = MJCF
    for old, new in names.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    return quiet(text)


PLACED = "<pose>0.15 0 0.6 0 0 0</pose>"
NESTED = {
    "placed by its model": whole(
        f'<model name="low">{PLACED}{shin()}</model>' + knee("thigh", "low::shin")
    ),
    "placed in its model": whole(
        f'<model name="low"><pose>0.1 0 0 0 0 0</pose>{shin("<pose>0.05 0 0.6 0 0 0</pose>")}'
        "</model>" + knee("thigh", "low::shin")
    ),
    "on a link outside": whole(
        f'<model name="low"><pose relative_to="thigh">0.05 0 -0.4 0 0 0</pose>{shin()}</model>'
        + knee("thigh", "low::shin")
    ),
    "a turned model": whole(
        f'<model name="low"><pose>0.15 0 0.6 0 0 {math.pi / 2!r}</pose>'
        f"{shin(f'<pose>0 0 0 0 0 {-math.pi / 2!r}</pose>')}</model>" + knee("thigh", "low::shin")
    ),
    "by a frame of its own": whole(
        '<model name="low" placement_frame="top"><pose>0.15 0 0.9 0 0 0</pose>'
        f'{shin()}<frame name="top" attached_to="shin"><pose>0 0 0.3 0 0 0</pose></frame></model>'
        + knee("thigh", "low::shin")
    ),
    "in two models": whole(
        f'<model name="low"><pose>0.15 0 0 0 0 0</pose><model name="er"><pose>0 0 0.6 0 0 0</pose>'
        f"{shin()}</model></model>" + knee("thigh", "low::er::shin")
    ),
}


@pytest.mark.parametrize("way", NESTED)
def test_a_shin_in_a_model_of_its_own(way: str) -> None:
    assert_same(quiet(NESTED[way]), quiet(MJCF))


def test_joints_inside_and_their_axes_turn_with_their_model() -> None:
    """The whole leg in a model that is turned about the vertical, its axes in the model's frame."""
    axis = (
        '<axis><xyz expressed_in="__model__">0 -1 0</xyz><limit><effort>20</effort></limit></axis>'
    )
    leg = THIGH_LINK.replace("<pose>0.1 0 1", "<pose>-0.1 0 1").replace(
        "1 0 0 0</pose>", "1 0 0 3.141592653589793</pose>", 1
    )
    low = shin("<pose>-0.15 0 0.6 0 0 3.141592653589793</pose>")
    turned = (
        '<sdf version="1.9"><model name="all"><model name="leg">'
        f"<pose>0 0 0 0 0 3.141592653589793</pose>{leg}{low}"
        + knee("thigh", "shin").replace(KNEE_AXIS, axis.replace("0 -1 0", "0 1 0"))
        + "</model></model></sdf>"
    )
    assert_same(quiet(turned), same_but_for({"hip": "leg::hip", "knee": "leg::knee"}))


def put(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


LOW = f'<sdf version="1.9"><model name="low">{shin()}</model></sdf>'


def including(uri: str, more: str = PLACED, *, child: str = "low::shin", merge: str = "") -> str:
    return whole(f"<include{merge}><uri>{uri}</uri>{more}</include>" + knee("thigh", child))


@pytest.mark.parametrize("uri", ["low.sdf", "parts/low", "model://low", "model://low/other.sdf"])
def test_an_included_shin(tmp_path: Path, uri: str) -> None:
    put(tmp_path, "low.sdf", LOW)
    put(tmp_path / "parts" / "low", "model.sdf", LOW)
    put(tmp_path / "shelf" / "low", "other.sdf", LOW)
    put(
        tmp_path / "shelf" / "low",
        "model.config",
        '<model><sdf version="1">other.sdf</sdf></model>',
    )
    path = put(tmp_path, "leg.sdf", including(uri))
    assert_same(load_robot(path, package_path=tmp_path / "shelf"), quiet(MJCF))


def test_an_included_shin_under_another_name_or_none(tmp_path: Path) -> None:
    put(tmp_path, "low.sdf", LOW.replace("<link", "<pose>9 9 9 1 1 1</pose><link", 1))
    named = including("low.sdf", f"<name>left</name>{PLACED}", child="left::shin")
    assert_same(load_robot(put(tmp_path, "a.sdf", named)), quiet(MJCF))
    merged = including("low.sdf", child="shin", merge=' merge="true"')
    assert_same(load_robot(put(tmp_path, "b.sdf", merged)), quiet(MJCF))


def test_a_robot_included_by_a_world(tmp_path: Path) -> None:
    """Sun and ground plane, which few have at hand, are no part of it."""
    put(tmp_path, "leg.sdf", whole(shin(PLACED) + knee("thigh", "shin")))
    world = put(
        tmp_path,
        "world.sdf",
        '<sdf version="1.9"><world name="w"><include><uri>model://sun</uri></include>'
        "<include><uri>leg.sdf</uri></include></world></sdf>",
    )
    assert_same(load_robot(world), quiet(MJCF))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (including("nowhere.sdf"), "nowhere.sdf.*package_path"),
        (including("leg.sdf"), "includes itself"),
        (including("old.sdf"), "version 1.4"),
        (including("two.sdf"), "no SDF file of one"),
        (whole(f"<model>{shin()}</model>"), "no name"),
        (whole(f'<model name="m"><static>1</static>{shin()}</model>'), "static"),
        (whole(f'<model name="m">{shin()}</model>' + knee("thigh", "shin")), "no link 'shin'"),
        (whole(f'<model name="m" placement_frame="f">{shin()}</model>'), "no frame or link 'f'"),
    ],
)
def test_what_cannot_be_put_together_is_refused_in_words(
    tmp_path: Path, text: str, why: str
) -> None:
    put(tmp_path, "old.sdf", LOW.replace("1.9", "1.4"))
    put(tmp_path, "two.sdf", LOW.replace("</sdf>", '<model name="b"/></sdf>'))
    path = put(tmp_path, "leg.sdf", text)
    with pytest.raises(RobotError, match=f"(?s)leg.sdf.*line 1.*{why}"):
        load_robot(path)
