"""A number of the robot is declared once: each is followed through all that it appears in."""

from __future__ import annotations

import inspect
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heelstrike.errors import RobotError
from heelstrike.gait.gait import fingerprint
from heelstrike.robot import (
    JointProperties,
    Model,
    Robot,
    RobotBuilder,
    RobotWarning,
    inspect_robot,
    load_robot,
)
from heelstrike.robot.model import NUMBERS, PROPERTIES, SCALES, label
from heelstrike.sim.files.robot_dataset import robot_to_dataset, stored_robot

DERIVED = {"limits", "torque", "gear", "motor_inertia"}  # what several numbers are made of


def built(*, left: dict[str, Any] | None = None, **numbers: Any) -> Robot:
    """Two legs on a trunk, the left of which may differ."""
    build = RobotBuilder("two")
    trunk = build.floating_base("trunk", (0, 1), mass=5, inertia=0.1)
    for side, own in (("right", numbers), ("left", numbers if left is None else left)):
        build.hinge(f"{side}_hip", trunk, **{"mass": 2.0, "inertia": 0.2} | own)
    return build.build()


def given(name: str) -> tuple[str, Any]:
    """Name to the builder, and a value that is not the default."""
    pair = (0.0625, -0.125)
    return PROPERTIES[name].called or name, pair if "axes" in PROPERTIES[name].shape else 0.375


def contents(robot: Robot) -> dict[str, Any]:
    """Return a robot as a run file has it."""
    data = robot_to_dataset(robot)
    found = {str(name): np.array(each.values) for name, each in data.variables.items()}
    found |= {f"@{name}": np.array(value) for name, value in data.attrs.items()}
    return {name: v.astype(str) if v.dtype.kind == "O" else v for name, v in found.items()}


def test_properties_for_type_checkers_are_the_declared_ones() -> None:
    names = {number.called or name for name, number in PROPERTIES.items()}
    assert set(JointProperties.__annotations__) == names | DERIVED


@pytest.mark.parametrize("kind", [Model, JointProperties])
def test_every_number_is_documented_with_its_unit(kind: type) -> None:
    text = inspect.getdoc(kind) or ""
    entries = {
        name: told
        for names, told in re.findall(r"^(\w[\w, ]*) :(.*\n(?:    .*\n?)+)", text, re.MULTILINE)
        for name in names.split(", ")
    }
    for name, number in (NUMBERS if kind is Model else PROPERTIES).items():
        told = entries[number.called or name if kind is JointProperties else name]
        if kind is Model and number.shape:
            assert f"({', '.join(map(str, number.shape))}" in told
        unit = number.unit.split(", ")[0].removesuffix("/rad")  # of a hinge
        assert unit in told or unit in ("", "m", "rad"), name


@pytest.mark.parametrize("name", PROPERTIES)
def test_a_number_goes_from_the_builder_through_files(name: str, tmp_path: Path) -> None:
    key, value = given(name)
    robot, plain = built(**{key: value}), built()
    number = PROPERTIES[name]
    assert np.all(getattr(robot.model, name)[3:] == value)
    if name not in ("mass", "inertia"):
        np.testing.assert_array_equal(getattr(plain.model, name)[3:], number.default)
    assert fingerprint(robot) != fingerprint(plain)
    assert robot_to_dataset(robot)[name].attrs["units"] == number.unit
    # Run files, also those that are older than the number.
    held = contents(robot)
    np.testing.assert_array_equal(
        getattr(stored_robot(held).model, name), getattr(robot.model, name)
    )
    del held[name]
    if number.later:
        assert np.all(getattr(stored_robot(held).model, name) == number.default)
    else:
        with pytest.raises(ValueError, match=f"'{name}' is missing"):
            stored_robot(held)
    # MJCF holds all of them, URDF says what it leaves out.
    back = load_robot(robot.save(tmp_path / "two.xml"))
    np.testing.assert_array_equal(getattr(back.model, name), getattr(robot.model, name))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", RobotWarning)
        urdf = load_robot(robot.save(tmp_path / "two.urdf"))
    kept = np.allclose(getattr(urdf.model, name), getattr(robot.model, name))
    moved = name in ("reference", "rest")  # URDF's zero configuration becomes the reference
    assert kept or moved or any("right_hip, left_hip" in str(one.message) for one in said)


@pytest.mark.parametrize("name", PROPERTIES)
def test_a_number_has_its_bounds_and_its_place_in_an_inspection(name: str) -> None:
    key, value = given(name)
    number = PROPERTIES[name]
    if number.least == 0.0:
        with pytest.raises(RobotError, match=f"joint 'right_hip': {key} must not be negative"):
            built(**{key: -1.0})
    if not number.infinite and not isinstance(value, tuple):
        with pytest.raises(RobotError, match=f"joint 'right_hip': {key} must be finite"):
            built(**{key: np.inf})
    if number.shape == ("nv",):
        assert " 0.375" in inspect_robot(built(**{key: value})).text()
    if number.alike:
        with pytest.warns(RobotWarning, match=f"{label(name)} of right_hip and left_hip"):
            assert built(**{key: value}, left={}).mirror is None


@pytest.mark.parametrize("name", SCALES)
def test_a_file_that_is_older_than_scales_means_the_ground_alone(name: str) -> None:
    build = RobotBuilder("ball")
    build.contact(build.floating_base("ball", mass=1.0, inertia=0.1), (0, 0), **{name: 0.5})
    held = contents(build.build())
    assert getattr(stored_robot(held).model, name) == [0.5]
    with pytest.raises(ValueError, match=f"{name} must be (0 or more|between 0 and 1)"):
        stored_robot({**held, name: np.array([-0.5])})
    del held[name]
    assert getattr(stored_robot(held).model, name) == [1.0]
