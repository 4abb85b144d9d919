"""Friction and restitution of the ground, scaled by the contact point that is on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis import energy_balance, friction_use
from heelstrike.errors import RobotError
from heelstrike.gait.request import Request
from heelstrike.robot import Robot, RobotBuilder, RobotWarning
from heelstrike.robot.model import SCALES

HEIGHT, HALF = 0.1, 0.2
METHODS = [
    hs.EventDriven(rtol=1e-10, atol=1e-12),
    hs.TimeStepping(step=1e-4),
    hs.TimeStepping(step=1e-4, scheme=hs.Scheme.MOREAU_JEAN),
    hs.Compliant(),
]


def sledge(rear: float = 1.0, front: float = 1.0, **others: float) -> Robot:
    """A body of 3 kg on two runners."""
    build = RobotBuilder("sledge")
    body = build.floating_base("body", (0.0, HEIGHT), mass=3.0, inertia=0.05)
    for x, scale in ((-HALF, rear), (HALF, front)):
        build.contact(body, (x, -HEIGHT), friction_scale=scale, **others)
    return build.build()


def loads(rear: float, front: float, gravity: float = 9.81) -> np.ndarray:
    """Normal forces of a sledge that slides forward: no moment about its centre of mass."""
    # Friction at a height below the centre of mass presses the front one.
    moments = [HALF + rear * HEIGHT, -HALF + front * HEIGHT]
    return np.linalg.solve([[1.0, 1.0], moments], [3.0 * gravity, 0.0])


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_each_runner_of_a_sledge_rubs_by_its_own_coefficient(method: Any) -> None:
    robot, ground = sledge(rear=0.5, front=1.5), hs.Ground(friction=0.4)
    start = robot.state({}, {"root_x": 2.0})
    run = hs.simulate(robot, state=start, duration=0.1, method=method, ground=ground)
    normal = loads(0.2, 0.6)
    soft = isinstance(method, hs.Compliant)
    row = len(run.time) // 2
    np.testing.assert_allclose(run.contact_force[row, :, 0], normal, rtol=2e-2 if soft else 1e-6)
    np.testing.assert_allclose(
        run.contact_force[row, :, 1], -np.array([0.2, 0.6]) * normal, rtol=2e-2 if soft else 1e-6
    )
    slowed = (0.2 * normal[0] + 0.6 * normal[1]) / 3.0
    assert run.velocity[-1, 0] == pytest.approx(2.0 - 0.1 * slowed, rel=1e-2 if soft else 1e-6)
    use = friction_use(run)
    np.testing.assert_allclose(use.contact[row], 1.0, rtol=1e-3 if soft else 1e-9)
    assert abs(energy_balance(run).residual[-1]) < 5e-3


@pytest.mark.parametrize("scales", [(0.0, 1.0), (1.0, 0.0)])
def test_a_sledge_with_one_smooth_runner_comes_to_rest_on_the_other(
    scales: tuple[float, float],
) -> None:
    """It is in the same group of contacts as the rough one, whichever comes first."""
    robot, slope = sledge(*scales), 0.1
    ground = hs.Ground(friction=0.6, slope=-slope)
    lying = robot.placed(robot.state({"root_pitch": slope}), ground)
    for speed in (0.0, 0.1):
        start = hs.State(lying.q, [speed * np.cos(slope), -speed * np.sin(slope), 0.0])
        run = hs.simulate(robot, state=start, duration=0.2, method=METHODS[0], ground=ground)
        assert run.completed, run.message
        np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-9)
        held = -3.0 * 9.81 * np.sin(slope) * np.array(scales)
        np.testing.assert_allclose(run.contact_force[-1, :, 1], held, atol=1e-6)


@pytest.mark.parametrize("method", METHODS[:2], ids=str)
def test_a_scale_holds_on_every_segment(method: Any) -> None:
    """Over a joint of two segments, level, so that nothing else changes."""
    robot = sledge(rear=0.5, front=0.5)
    ground = hs.Ground(profile=[[-5, 0], [0.6, 0], [5, 0]], friction=[0.4, 0.2])
    start = robot.state({}, {"root_x": 2.0})
    run = hs.simulate(robot, state=start, duration=0.7, method=method, ground=ground)
    force = run.contact_force
    ratio = -force[..., 1] / force[..., 0]
    np.testing.assert_allclose(ratio[run.contact_point[:, 1, 0] < 0.59], 0.2, rtol=1e-6)
    beyond = run.contact_point[:, 0, 0] > 0.61
    assert np.any(beyond)
    np.testing.assert_allclose(ratio[beyond], 0.1, rtol=1e-6)


def test_in_a_concave_corner_both_faces_are_scaled() -> None:
    """A wheel without friction of its own slides in a notch that would hold another."""
    found = {}
    for scale in (0.0, 1.0):
        build = RobotBuilder("wheel")
        body = build.floating_base("body", (0.0, 0.1 * np.sqrt(2.0)), mass=1.0, inertia=0.01)
        build.contact(body, (0.0, 0.0), radius=0.1, friction_scale=scale)
        robot = build.build()
        notch = hs.Ground(profile=[[-1, 1], [0, 0], [1, 1]], friction=1.0)
        start = robot.state({}, {"root_pitch": 3.0})
        run = hs.simulate(robot, state=start, duration=0.05, ground=notch)
        found[scale] = float(run.velocity[-1, 2])
    assert found[0.0] == pytest.approx(3.0, rel=1e-9)
    assert found[1.0] < 1.0


@pytest.mark.parametrize(
    "method", [hs.EventDriven(), hs.TimeStepping(), METHODS[2]], ids=["events", "steps", "Moreau"]
)
def test_a_ball_bounces_by_the_product(method: Any) -> None:
    build = RobotBuilder("ball")
    ball = build.floating_base("ball", (0.0, 0.2), mass=1.0, inertia=0.01)
    build.contact(ball, (0.0, 0.0), restitution_scale=0.5)
    robot, ground = build.build(), hs.Ground(restitution=0.8)
    state = robot.state({"root_z": 0.05})
    run = hs.simulate(robot, state=state, duration=0.11, method=method, ground=ground)
    fell = np.sqrt(2.0 * 9.81 * 0.05)
    rose = run.velocity[:, 1].max()
    assert rose == pytest.approx(0.4 * fell, rel=3e-2)
    if isinstance(method, hs.EventDriven):
        assert rose == pytest.approx(0.4 * fell, rel=1e-6)


def test_dynamics_know_the_scale() -> None:
    robot, ground = sledge(rear=0.5), hs.Ground(friction=0.4)
    state = robot.reference_state()
    at = hs.contact_kinematics(robot, state.q, state.v, ground)
    np.testing.assert_allclose(at.friction, [0.2, 0.4])


def test_scales_are_numbers_of_the_robot_like_others(tmp_path: Path) -> None:
    """They go through files, change with the model, and formats that cannot hold them say so."""
    robot = sledge(rear=0.5, restitution_scale=0.25)
    back = hs.load_robot(robot.save(tmp_path / "sledge.xml"))
    for name in SCALES:
        np.testing.assert_array_equal(getattr(back.model, name), getattr(robot.model, name))
    with pytest.warns(
        RobotWarning, match=r"friction scale of body_heel; restitution scale of body_heel"
    ):
        robot.save(tmp_path / "sledge.urdf")
    assert "friction scale 0.5, restitution scale 0.25" in hs.inspect_robot(robot).text()
    smooth = replace(robot, model=robot.model.replaced(friction_scale=np.zeros(2)))
    run = hs.simulate(
        smooth, state=smooth.state({}, {"root_x": 1.0}), duration=0.01, method=hs.TimeStepping()
    )
    assert run.velocity[-1, 0] == 1.0
    again = hs.load_run(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(again.robot.model.friction_scale, [0.0, 0.0])


def test_what_a_scale_may_be() -> None:
    with pytest.raises(RobotError, match="friction_scale must not be negative"):
        sledge(rear=-0.1)
    with pytest.raises(RobotError, match=r"restitution_scale .* between 0 and 1, got 1\.5"):
        sledge(restitution_scale=1.5)
    with pytest.raises(RobotError, match="must be finite"):
        sledge(front=np.inf)


def test_custom_data_of_scales_are_looked_at(tmp_path: Path) -> None:
    path = sledge(rear=0.5).save(tmp_path / "sledge.xml")
    text = path.read_text()
    for old, new, told in (
        ("friction_scale:body_heel", "friction_scale:nobody", "no geom of that name"),
        ('data="0.5"', 'data="-2"', "must be 0 or more, got -2"),
    ):
        assert old in text
        path.write_text(text.replace(old, new))
        with pytest.raises(RobotError, match=told):
            hs.load_robot(path)


def test_left_and_right_are_compared_by_them() -> None:
    build = RobotBuilder("two")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=5.0, inertia=0.1)
    for side, scale in (("right", 1.0), ("left", 0.8)):
        leg = build.hinge(f"{side}_hip", trunk, mass=2.0, inertia=0.2)
        build.contact(leg, (0.0, -0.9), friction_scale=scale)
    with pytest.warns(RobotWarning, match="friction scale of right_hip and left_hip"):
        assert build.build().mirror is None


def test_linearised_contact_and_gaits_know_the_scale() -> None:
    """Half of a rough ground is a ground half as rough."""
    half, whole = sledge(rear=0.5, front=0.5), sledge()
    sliding = hs.ActiveContacts(sliding=((0, 1), (1, 1)))
    state = whole.state({}, {"root_x": 1.0})
    none = np.zeros(0)
    found = hs.linearize_contact(
        half, state.q, state.v, none, sliding, ground=hs.Ground(friction=0.8)
    )
    expected = hs.linearize_contact(
        whole, state.q, state.v, none, sliding, ground=hs.Ground(friction=0.4)
    )
    np.testing.assert_allclose(found.rate, expected.rate, rtol=1e-12)
    assert found.rate[3] == pytest.approx(-0.4 * 9.81, rel=1e-9)
    robot = hs.load_robot("bravo7")
    scale = np.where(np.arange(robot.nc) % 2 == 0, 0.5, 0.8)
    worn = replace(robot, model=robot.model.replaced(friction_scale=scale))
    asked = {
        "step_length": 0.3, "step_duration": 0.7, "speed": None, "clearance": 0.03,
        "clearance_profile": None, "zmp_margin": None, "force_margin": None,
        "joint_speed_limit": np.inf, "joint_ranges": None, "impact": True, "intervals": None,
        "starts": 1,
    }  # fmt: skip
    assert Request(robot=worn, friction=0.6, **asked).cone == 0.3
    assert Request(robot=robot, friction=0.6, **asked).cone == 0.6
