"""Computed torque on point feet: joints obey, the trunk follows, and the gait stays unstable."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control import Encoder
from heelstrike.sim import Contacts

FRICTION = 0.75


rabbit, gait = walking.rabbit, walking.rabbit_gait


def one_step(method: hs.TimeStepping | hs.EventDriven) -> hs.Run:
    return hs.simulate(
        rabbit(),
        hs.ComputedTorque(rabbit(), gait()),
        state=gait().initial_state,
        duration=1.05 * gait().step_duration,
        method=method,
        ground=hs.Ground(friction=FRICTION),
    )


def step_error(run: hs.Run) -> float:
    """Largest error of joints and trunk against the gait before the first touchdown, in rad."""
    inside = run.time < 0.999 * gait().step_duration
    time, position = run.time[inside], run.position[inside]
    joints = position[:, rabbit().model.actuator_joint] - gait().in_step(time)
    trunk = position[:, 2] - gait().pitch(time)
    return float(max(np.abs(joints).max(), np.abs(trunk).max()))


def springy() -> hs.Robot:
    """Rabbit with springs, dampers and rotors in its joints."""
    joints = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    model = rabbit().model.replaced(
        stiffness=80.0 * joints,
        rest=0.3 * joints,
        damping=3.0 * joints,
        armature=0.05 * joints,
    )
    return dataclasses.replace(rabbit(), model=model)


@pytest.mark.parametrize("make", [rabbit, springy])
@pytest.mark.parametrize("seed", range(8))
def test_the_joints_accelerate_as_asked(seed: int, make: Callable[[], hs.Robot]) -> None:
    """The law against forward dynamics with contact, which knows nothing of it.

    In any state with the stance foot at rest, v̇ of the joints is the reference's plus feedback.
    """
    robot, kp, kd = make(), 200.0, 30.0
    draw = np.random.default_rng(seed)
    t = float(draw.uniform(0.05, 0.25))
    joints = robot.model.actuator_joint
    stance = robot.feet[gait().stance_foot].contacts[0]
    q = gait().initial_state.q.copy()
    q[joints] = gait().in_step(t) + 0.02 * draw.normal(size=4)
    q[2] = gait().pitch(t) + 0.02 * draw.normal()
    q[:2] -= dynamics.contact_positions(robot, q)[stance]
    rows = dynamics.contact_jacobian(robot, q)[stance]
    v = np.zeros(robot.nv)
    v[joints] = gait().in_step(t, order=1) + 0.1 * draw.normal(size=4)
    v[2] = gait().pitch(t, order=1) + 0.1 * draw.normal()
    v[:2] = -np.linalg.solve(rows[:, :2], rows @ v)
    ground = hs.Ground(friction=5.0)
    kinematics = hs.contact_kinematics(robot, q, v, ground)
    assert kinematics.gap[1 - stance] > 1e-3
    contacts = Contacts(
        position=dynamics.contact_positions(robot, q),
        normal=np.tile([0.0, 1.0], (2, 1)),
        gap=kinematics.gap,
        force=np.zeros((2, 2)),
    )
    torque = hs.ComputedTorque(robot, gait(), kp=kp, kd=kd).torque(t, hs.State(q, v), contacts)
    wanted = (
        gait().in_step(t, order=2)
        + kp * (gait().in_step(t) - q[joints])
        + kd * (gait().in_step(t, order=1) - v[joints])
    )
    found = hs.contact_forward_dynamics(robot, q, v, torque, ground=ground)
    assert found.contact_force[stance, 0] > 0.0
    scale = np.abs(wanted).max()
    np.testing.assert_allclose(found.acceleration[joints], wanted, atol=1e-9 * scale)
    np.testing.assert_allclose(found.contact_acceleration[stance], 0.0, atol=1e-9 * scale)


def test_the_first_step_is_tracked() -> None:
    """Event-driven at rtol 1e-8, the whole robot stays on the gait: errors are the integrator's.

    They grow like the tipping robot, e^{t √(g/l)} with l = 0.7 m: ninefold in a step.
    """
    run = one_step(hs.EventDriven(rtol=1e-10, atol=1e-12))
    assert run.completed, run.message
    assert step_error(run) <= 1e-6
    landed = [event for event in run.events if event.kind.name == "TOUCHDOWN"]
    assert landed[0].time == pytest.approx(gait().step_duration, abs=1e-6)


def test_time_stepping_tracks_the_first_step_to_first_order() -> None:
    coarse, fine = (step_error(one_step(hs.TimeStepping(step=h))) for h in (1e-3, 5e-4))
    assert coarse <= 5e-3
    assert np.log2(coarse / fine) >= 0.9


def test_the_gait_repeats_but_is_unstable() -> None:
    """It is a fixed point of the step; the tipping about the foot has a multiplier above one.

    An inverted pendulum of rabbit's leg length, 0.8 m, with its mass at 0.7 m, grows by
    e^{0.58 s √(9.81/0.7 s²)} = 8.8 in a step; the multiplier must be of that size.
    """
    cycle = hs.find_limit_cycle(
        rabbit(),
        gait().initial_state,
        hs.ComputedTorque(rabbit(), gait()),
        ground=hs.Ground(friction=FRICTION),
    )
    assert cycle.step_length == pytest.approx(gait().step_length, abs=1e-6)
    assert cycle.period == pytest.approx(gait().step_duration, abs=1e-6)
    assert not cycle.stable
    size = np.abs(cycle.multipliers)
    assert 4.0 < size[0] < 16.0
    assert np.all(size[1:] < 1.0)  # the joints are held, and nothing else tips


def test_joint_encoders_cannot_see_the_trunk() -> None:
    with pytest.raises(hs.ControllerError, match="pitch does not follow from the joints"):
        hs.ComputedTorque(rabbit(), gait(), encoder=Encoder())


def test_a_gait_on_points_is_not_for_soles() -> None:
    with pytest.raises(hs.ControllerError):
        hs.ComputedTorque(hs.load_robot("bravo7"), gait())


def test_feet_of_several_points_are_no_point_feet() -> None:
    robot = rabbit()
    foot = dataclasses.replace(robot.feet[0], contacts=(0, 1))
    with pytest.raises(hs.ControllerError, match="several contact points"):
        hs.ComputedTorque(dataclasses.replace(robot, feet=(foot, robot.feet[1])), gait())
