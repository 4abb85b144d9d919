"""URDF in space as Pinocchio reads it: mass matrix, bias force, centre of mass.

Pinocchio has its own parser, joints and conventions, so that nothing of ours or of MuJoCo's is in
its answer. 1e-11 relative leaves room for rounding of some hundred products.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot import RobotWarning

pytest.importorskip("pinocchio")

MOMENTS = {
    "ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2),
}  # fmt: skip


def random_urdf(seed: int, *, held: bool) -> str:
    """A random tree of revolute, continuous, prismatic and fixed joints with turned frames."""
    draw = np.random.default_rng(seed)
    links, joints = [], []
    for k in range(8):
        points = 0.2 * draw.normal(size=(4, 3))
        tensor = sum(p @ p * np.eye(3) - np.outer(p, p) for p in points - points.mean(axis=0))
        moments = " ".join(f'{n}="{float(tensor[at])!r}"' for n, at in MOMENTS.items())
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="{_three(draw)}" rpy="{_three(draw)}"/>'
            f'<mass value="{float(draw.uniform(0.5, 3.0))!r}"/><inertia {moments}/></inertial>'
            "</link>"
        )
        if k:
            kind = draw.choice(["revolute", "continuous", "prismatic", "fixed"])
            axis = draw.normal(size=3)
            axis /= np.linalg.norm(axis)
            joints.append(
                f'<joint name="j{k}" type="{kind}"><parent link="l{draw.integers(k)}"/>'
                f'<child link="l{k}"/><origin xyz="{_three(draw)}" rpy="{_three(draw)}"/>'
                f'<axis xyz="{" ".join(map(repr, axis.tolist()))}"/>'
                '<limit lower="-3" upper="3" effort="50" velocity="9"/></joint>'
            )
    if held:
        links.append('<link name="world"/>')
        joints.append(
            '<joint name="weld" type="fixed"><parent link="world"/><child link="l0"/></joint>'
        )
    return f'<robot name="r">{"".join(links + joints)}</robot>'


def _three(draw: np.random.Generator) -> str:
    return " ".join(map(repr, draw.uniform(-0.5, 0.5, 3).tolist()))


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_urdf(seed: int, held: bool, tmp_path: Path) -> None:
    from corpus.space import Pinocchio, difference  # which converts Pinocchio's conventions

    text = random_urdf(seed, held=held)
    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        robot = hs.load_robot(path, dimension=3)
    assert robot.floating != held
    assert difference(robot, Pinocchio(text, robot)) <= 1e-11
