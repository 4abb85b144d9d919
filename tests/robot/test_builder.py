"""Robots built in Python: the same as from a file, and what an error says."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import BodyTable, Robot, RobotBuilder, RobotWarning, human, load_robot
from heelstrike.robot.files.reading import read_mjcf


def built_bravo7() -> Robot:
    """bravo7 from the numbers in its file."""
    build = RobotBuilder("bravo7")
    trunk = build.floating_base(
        "trunk", (0, 0.9538), mass=50.85, inertia=3.1777, center_of_mass=(0, 0.3155)
    )
    for side in ("right", "left"):
        link, at = trunk, (0.0, 0.0)
        for joint, name, mass, inertia, center, length, low, high in (
            ("hip", "thigh", 7.5, 0.1522, -0.191, 0.441, -90, 90),
            ("knee", "shank", 3.4875, 0.0624, -0.1917, 0.4428, -10, 130),
            ("ankle", "foot", 1.0875, 0.0184, -0.0351, 0.0, -60, 60),
        ):
            link = build.hinge(
                f"{side}_{joint}",
                link,
                at=at,
                link=f"{side}_{name}",
                mass=mass,
                inertia=inertia,
                center_of_mass=(0, center),
                limits=np.radians([low, high]),
                torque=300,
            )
            at = (0.0, -length)
        build.sole(link, heel=(-0.1, -0.07), toe=(0.1, -0.07), friction=0.75)
    return build.build()


def test_a_built_robot_is_the_one_of_the_file() -> None:
    """Every number to round-off (the file's soles are boxes, its ranges degrees), every name."""
    built, read = built_bravo7(), load_robot("bravo7")
    for field, values in read.model.members().items():
        np.testing.assert_allclose(
            built.model.members()[field], values, rtol=1e-15, atol=2e-15, err_msg=field
        )
    for field in ("joint_names", "link_names", "actuator_names", "contact_names", "feet"):
        assert getattr(built, field) == getattr(read, field), field
    assert built.contact_friction == read.contact_friction
    assert built.floating
    assert built.mirror is not None
    assert read.mirror is not None
    for field in ("joint", "sign", "contact", "foot"):
        np.testing.assert_array_equal(getattr(built.mirror, field), getattr(read.mirror, field))


def test_everything_a_joint_has_is_what_mjcf_says_of_it() -> None:
    build = RobotBuilder("arm", gravity=3.7)
    rail = build.slide(
        "rail", None, at=(0.1, 0.2), direction=(3, 4), mass=2, reference=0.3, limits=(-1, 2)
    )
    arm = build.hinge(
        "arm",
        rail,
        at=(0.5, -0.1),
        sense=-1,
        mass=1.5,
        inertia=0.2,
        center_of_mass=(0.3, 0.1),
        reference=0.4,
        limits=(-0.5, 1.5),
        damping=0.3,
        stiffness=4,
        rest=0.25,
        dry_friction=0.7,
        armature=0.01,
        gear=50,
        motor_inertia=2e-5,
        torque=(-10, 20),
        speed=6,
    )
    build.contact(arm, (0.6, 0.2), radius=0.05, friction=0.6)
    built = build.build()
    read = read_mjcf(
        """<mujoco model="arm"><compiler angle="radian"/><option gravity="0 0 -3.7"/>
        <custom><numeric name="speed_limit:arm" data="6"/></custom>
        <worldbody><body name="rail" pos="0.1 0 0.2">
          <joint name="rail" type="slide" axis="3 0 4" ref="0.3" range="-1 2"/>
          <inertial pos="0 0 0" mass="2" diaginertia="1e-14 1e-14 1e-14"/>
          <body name="arm" pos="0.5 0 -0.1">
            <joint name="arm" axis="0 -1 0" ref="0.4" range="-0.5 1.5" damping="0.3" stiffness="4"
              springref="0.25" frictionloss="0.7" armature="0.01"/>
            <inertial pos="0.3 0 0.1" mass="1.5" diaginertia="0.2 0.2 0.2"/>
            <geom type="sphere" size="0.05" pos="0.6 0 0.2" friction="0.6"/>
          </body></body></worldbody>
        <actuator><motor name="arm" joint="arm" gear="50" armature="2e-5" ctrlrange="-0.2 0.4"/>
        </actuator></mujoco>"""
    )
    for field, values in read.model.members().items():
        np.testing.assert_allclose(
            built.model.members()[field], values, rtol=1e-14, atol=1e-13, err_msg=field
        )
    assert built.joint_names == read.joint_names
    assert built.contact_friction == read.contact_friction == (0.6,)


def test_left_and_right_that_differ_are_found() -> None:
    build = RobotBuilder("lame")
    trunk = build.floating_base("trunk", mass=1, inertia=1)
    build.hinge("left_hip", trunk, mass=1, inertia=1)
    build.hinge("right_hip", trunk, mass=2, inertia=1)
    with pytest.warns(RobotWarning, match=r"mass of left_hip and right_hip \(1, 2\)"):
        assert build.build().mirror is None


def test_a_builder_may_go_on() -> None:
    build = RobotBuilder("chain")
    first = build.hinge("a", None, mass=1, inertia=1)
    one = build.build()
    build.hinge("b", first, mass=1, inertia=1)
    assert (one.nv, build.build().nv) == (1, 2)


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ({"mass": -1}, "joint 'b': mass must not be negative, got -1"),
        ({"inertia": math.nan}, "inertia must be finite"),
        ({"mass": "heavy"}, "mass must be a number, got 'heavy'"),
        ({"center_of_mass": (1, 2, 3)}, "center_of_mass must be a pair"),
        ({"limits": (1, -1)}, "limits must go from low to high, got 1 to -1"),
        ({"torque": -5}, "torque must not be negative"),
        ({"torque": 0}, "torque must go from low to high"),
        ({"sense": 2}, "sense is 1 or -1"),
        ({"parent": "nowhere"}, "joint 'b' is attached to link 'nowhere'.*Links are: a"),
        ({"name": "a"}, "there is a joint 'a' already"),
        ({"link": "a"}, "there is a link 'a' already"),
    ],
)
def test_mistakes(properties: dict[str, object], words: str) -> None:
    build = RobotBuilder("wrong")
    build.hinge("a", None, mass=1, inertia=1)
    given = {"name": "b", "parent": "a", "mass": 1} | properties
    with pytest.raises(RobotError, match=words):
        build.hinge(given.pop("name"), given.pop("parent"), **given)  # type: ignore[arg-type, misc]
    assert build.build().nv == 1  # what failed left no trace


def test_mistakes_of_the_whole() -> None:
    build = RobotBuilder("wrong")
    with pytest.raises(RobotError, match="wrong: the robot has no links"):
        build.build()
    with pytest.raises(RobotError, match="no direction"):
        build.slide("a", None, direction=(0, 0), mass=1)
    with pytest.raises(TypeError, match="'a' got weight; it may have mass"):
        build.hinge("a", None, weight=1)  # type: ignore[call-arg]
    build.hinge("a", None)
    with pytest.raises(RobotError, match="joint 'a' moves no mass"):
        build.build()
    with pytest.raises(RobotError, match="first link"):
        build.floating_base("trunk")
    with pytest.raises(RobotError, match="a contact point is on link 'b'"):
        build.contact("b", (0, 0))
    with pytest.raises(RobotError, match="radius must not be negative"):
        build.contact("a", (0, 0), radius=-1)


def test_human_of_75_kg_and_1_8_m_is_human7() -> None:
    """human7's source prints the same table with four digits, and the ankle's height as 0.07."""
    made, read = human(75, 1.8).model, load_robot("human7").model
    for field in ("mass", "inertia", "center_of_mass", "offset", "reference", "contact_position"):
        np.testing.assert_allclose(
            getattr(made, field), getattr(read, field), rtol=3e-3, atol=3e-4, err_msg=field
        )


@pytest.mark.parametrize("table", BodyTable)
def test_a_human_weighs_what_was_asked_and_stands(table: BodyTable) -> None:
    for mass, height in ((40.0, 1.4), (110.0, 2.0)):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            robot = human(mass, height, table=table)
        assert robot.total_mass == pytest.approx(mass, rel=1e-14)
        assert robot.floating
        assert robot.mirror is not None
        # Hip at (0.245 + 0.246 + 0.039) of the height.
        assert robot.model.reference[1] == pytest.approx(0.53 * height, rel=1e-14)
    assert human(table=table.value).total_mass == pytest.approx(75.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"mass": 0}, "mass of a human must be positive"),
        ({"height": math.nan}, "height of a human"),
        ({"table": "summer"}, "no table 'summer'.*'winter', 'de_leva'"),
    ],
)
def test_no_human(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(RobotError, match=words):
        human(**arguments)  # type: ignore[arg-type]
