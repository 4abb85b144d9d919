"""Macros of xacro: expanded only where asked, in a process of its own."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path

import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, load_robot
from heelstrike.robot.files.ros import xacro

HEAD = '<robot name="leg" xmlns:xacro="http://www.ros.org/wiki/xacro">'
MACRO = """<xacro:macro name="limb" params="name mass">
  <link name="${name}"><inertial><mass value="${mass * 2}"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
</xacro:macro>"""
BODY = """<xacro:arg name="mass" default="1.5"/><link name="world"/>
<xacro:limb name="thigh" mass="$(arg mass)"/>
<joint name="hip" type="continuous"><parent link="world"/><child link="thigh"/>
  <axis xyz="0 1 0"/></joint>"""
installed = pytest.mark.skipif(
    importlib.util.find_spec("xacro") is None, reason="the package xacro is not installed"
)


def write(folder: Path, text: str, name: str = "leg.urdf.xacro") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def load(path: Path, **how: object) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return load_robot(path, **how)  # type: ignore[arg-type]


def test_nothing_is_expanded_unasked(tmp_path: Path) -> None:
    proof = tmp_path / "proof"
    harm = f'<xacro:property name="x" value="${{open({str(proof)!r}, chr(119))}}"/>'
    with pytest.raises(RobotError, match="xacro=True, if you trust it"):
        load(write(tmp_path, HEAD + harm + BODY + "</robot>"))
    assert not proof.exists()


def test_without_the_package_a_sentence_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(RobotError, match="needs the package xacro: pip install xacro"):
        load(write(tmp_path, HEAD + MACRO + BODY + "</robot>"), xacro=True)


@installed
def test_macros_and_arguments(tmp_path: Path) -> None:
    path = write(tmp_path, HEAD + MACRO + BODY + "</robot>")
    assert load(path, xacro=True).model.mass.tolist() == [3.0]
    assert load(path, xacro={"mass": 4}).model.mass.tolist() == [8.0]


@installed
def test_macros_that_come_after_their_use(tmp_path: Path) -> None:
    """As xacro read them until 2016, and files of that time have them."""
    path = write(tmp_path, HEAD + BODY + MACRO + "</robot>")
    assert load(path, xacro=True).model.mass.tolist() == [3.0]


@installed
def test_other_packages_are_found(tmp_path: Path) -> None:
    package = tmp_path / "elsewhere" / "limbs"
    package.mkdir(parents=True)
    write(package, HEAD + MACRO + "</robot>", "limb.xacro")
    include = '<xacro:include filename="$(find limbs)/limb.xacro"/>'
    path = write(tmp_path, HEAD + include + BODY + "</robot>")
    assert load(path, xacro=True, package_path=package.parent).total_mass == 3.0
    with pytest.raises(RobotError, match=r"'limbs' is not found.*package_path="):
        load(path, xacro=True)


@installed
def test_what_xacro_says_is_passed_on(tmp_path: Path) -> None:
    path = write(tmp_path, HEAD + MACRO + BODY.replace('mass="$(arg mass)"', "") + "</robot>")
    with pytest.raises(RobotError, match=r"xacro cannot expand this file: .*mass"):
        load(path, xacro=True)


@installed
def test_a_file_that_never_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro, "LONGEST_EXPANSION", 1.0)
    endless = '<link name="${[0 for i in range(10**9) for j in range(10**9)]}"/>'
    with pytest.raises(RobotError, match="has not finished"):
        load(write(tmp_path, HEAD + endless + "</robot>"), xacro=True)
