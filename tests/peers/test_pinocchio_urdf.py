"""URDF of planar robots, as it is written, against Pinocchio's own reading of the same text.

Pinocchio takes any numbers for inertias, so that files which MuJoCo refuses have a judge, too. Its
algorithms and its reader share nothing with ours. Install it (package ``pin``) to run this.
"""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.robot import RobotWarning, builtin_robots, load_robot, read_mjcf

pin = pytest.importorskip("pinocchio")

TOLERANCE = 1e-10

PLANAR = {
    "as it is": {},
    "no other moments": {"ixx": "0", "izz": "0"},
    "impossible moments": {"ixx": "0.0001", "izz": "-3"},
}


def urdf_of(name: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("urdf") / f"{name}.urdf"
    text: str = load_robot(name).save(path).read_text("utf-8")
    return text


@pytest.mark.parametrize("moments", PLANAR)
@pytest.mark.parametrize("name", [name for name in builtin_robots() if name != "rimless_wheel"])
def test_planar_urdf(name: str, moments: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Mass matrix and bias force at random states; wheels have no inertia about their hub.

    The inertia of a motor stands in the file's transmission, which Pinocchio does not read.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        text = urdf_of(name, tmp_path_factory)
        for moment, value in PLANAR[moments].items():
            text = re.sub(rf'{moment}="[^"]*"', f'{moment}="{value}"', text)
        robot = read_mjcf(text)
    model = pin.buildModelFromXML(text)
    data = model.createData()
    place = [model.joints[model.getJointId(joint)] for joint in robot.joint_names]
    draw = np.random.default_rng(2)
    for _ in range(10):
        q, v = draw.normal(size=(2, robot.nv))
        at, speed = np.zeros(model.nq), np.zeros(model.nv)
        for k, joint in enumerate(place):
            circle = joint.nq == 2  # of a joint without stops
            at[joint.idx_q : joint.idx_q + joint.nq] = (
                (np.cos(q[k]), np.sin(q[k])) if circle else q[k]
            )
            speed[joint.idx_v] = v[k]
        order = [joint.idx_v for joint in place]
        model.armature[order] = robot.model.armature
        mass = pin.crba(model, data, at)
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.nonLinearEffects(model, data, at, speed)
        for ours, theirs in (
            (dynamics.mass_matrix(robot, q), mass[np.ix_(order, order)]),
            (dynamics.bias_force(robot, q, v), bias[order]),
        ):
            scale = np.abs(theirs).max(initial=1.0)
            np.testing.assert_allclose(ours, theirs, atol=TOLERANCE * scale)
