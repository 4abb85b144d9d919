"""A top that spins about a fixed point, without friction (Goldstein, Classical Mechanics, 5.7).

A top whose axis leans by θ precesses steadily at Ω if m g l = Ω (I₃ ω₃ − I₁ Ω cos θ), where ω₃ is
its angular velocity along its axis and I₁ its moment of inertia across it, both about the point.
The angular velocity is then carried round the vertical, ω̇ = Ω z × ω. That holds to rounding: a few
dozen products of order one.
"""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import in_space

from heelstrike.dynamics import spatial

MASS, LENGTH, ACROSS, ALONG, GRAVITY = 0.5, 0.2, 2e-3, 1.5e-3, 9.81
TOP = f"""
<mujoco model="top"><option gravity="0 0 -{GRAVITY}"/><worldbody><body name="top">
  <joint name="tip" type="ball"/>
  <inertial pos="0 0 {LENGTH}" mass="{MASS}" diaginertia="{ACROSS} {ACROSS} {ALONG}"/>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize("lean", [0.1, 0.7, 1.5])
@pytest.mark.parametrize("precession", [0.8, -3.0])
def test_steady_precession(lean: float, precession: float) -> None:
    robot = in_space(TOP)
    about_tip = ACROSS + MASS * LENGTH**2
    spin = (MASS * GRAVITY * LENGTH / precession + about_tip * precession * np.cos(lean)) / ALONG
    turned = 1.1  # about the vertical, which must not matter
    quaternion = product(about([0, 0, 1], turned), about([0, 1, 0], lean))
    axes = spatial.link_poses(robot, quaternion).rotation[0]
    # Along its own axis the top turns at `spin`, the precession's part in it.
    omega = precession * np.array([0.0, 0.0, 1.0]) + (spin - precession * np.cos(lean)) * axes[:, 2]
    found = spatial.forward_dynamics(robot, quaternion, axes.T @ omega, np.zeros(3))
    expected = axes.T @ np.cross([0.0, 0.0, precession], omega)
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(omega).max() ** 2


def test_a_sleeping_top_stays_upright() -> None:
    robot = in_space(TOP)
    assert (
        np.abs(spatial.forward_dynamics(robot, [1, 0, 0, 0], [0, 0, 50.0], np.zeros(3))).max() == 0
    )


def about(axis: list[int], angle: float) -> np.ndarray:
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    real = a[0] * b[0] - a[1:] @ b[1:]
    return np.array([real, *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])
