"""Gains that are too high for the step are told, where a joint really chatters."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs

STEP, INERTIA = 1e-3, 0.02
"""Of a step (s), and of a wheel about its axle (kg m²)."""

WHEEL = f"""<body name='wheel' pos='0 0 1'><joint name='axle' axis='0 0 1'/>
<inertial pos='0 0 0' mass='1' diaginertia='{INERTIA} {INERTIA} {INERTIA}'/></body>"""
MOTOR = "<actuator><motor joint='axle'/></actuator>"


def swings(share: float, kp: float, made: Maker) -> tuple[bool, float]:
    """Whether it warns of h² kp + 2 h kd that is so many times 4 I, and how it goes on."""
    robot = made(WHEEL, MOTOR)
    kd = (4.0 * INERTIA * share - STEP**2 * kp) / (2.0 * STEP)
    law = hs.HoldPosture(robot, kp=kp, kd=kd)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", hs.SimulationWarning)
        run = hs.simulate(
            robot, law, state=hs.State(np.array([0.1]), np.zeros(1)), duration=0.2,
            method=hs.TimeStepping(step=STEP),
        )  # fmt: skip
    warned = any(
        "joint 'axle'" in str(each.message) and "chatters" in str(each.message) for each in told
    )
    return warned, float(np.abs(run.velocity[-20:]).max())


@pytest.mark.parametrize("kp", [0.0, 2e4])
def test_it_warns_where_a_wheel_begins_to_chatter(kp: float, made: Maker) -> None:
    """Modulus one at h² kp + 2 h kd = 4 I: v⁺ = v − h (kp q + kd v) / I, q⁺ = q + h v⁺."""
    calm, little = swings(0.97, kp or 1.0, made)
    loud, much = swings(1.03, kp or 1.0, made)
    assert (calm, loud) == (False, True)
    assert much > 1e3 * little


def test_torques_that_are_held_longer_bear_less(made: Maker) -> None:
    robot = made(WHEEL, MOTOR)
    law = hs.HoldPosture(robot, kp=1.0, kd=1.8 * INERTIA / STEP)
    state = robot.reference_state()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hs.Simulation(robot, law, state=state, method=hs.TimeStepping(step=STEP))
    with pytest.warns(hs.SimulationWarning, match=r"too high .* over 0\.002 s.* 2\.6 times as far"):
        hs.Simulation(
            robot, law, state=state, method=hs.TimeStepping(step=STEP), control_period=2.0 * STEP
        )


@pytest.mark.parametrize(
    ("damped", "stiff", "settles"), [(0.2, 3.5, False), (1.9, 0.5, True), (0.5, 0.25, True)]
)
def test_torques_that_are_held_over_steps_are_judged_as_such(
    damped: float, stiff: float, settles: bool, made: Maker
) -> None:
    """Gains in parts of I / T and I / T², for T of ten steps: two that one step of T misjudges."""
    robot, period = made(WHEEL, MOTOR), 10.0 * STEP
    law = hs.HoldPosture(robot, kp=stiff * INERTIA / period**2, kd=damped * INERTIA / period)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", hs.SimulationWarning)
        run = hs.simulate(
            robot, law, state=hs.State(np.array([1e-6]), np.zeros(1)), duration=1.0,
            method=hs.TimeStepping(step=STEP), control_period=period,
        )  # fmt: skip
    assert (not told) is settles
    first, last = (np.abs(part).max() for part in (run.position[:20], run.position[-20:]))
    assert last < 0.1 * first if settles else last > 10.0 * first


def test_springs_without_dampers_grow_when_they_are_held(made: Maker) -> None:
    """A damper of the joint makes up for that."""
    state = hs.State(np.array([0.1]), np.zeros(1))
    for damping, quiet in ((0.0, False), (0.02, True)):
        joint = WHEEL.replace("axis=", f"damping='{damping}' axis=")
        robot = made(joint, MOTOR)
        law = hs.HoldPosture(robot, kp=2.0, kd=0.0)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", hs.SimulationWarning)
            run = hs.simulate(
                robot, law, state=state, duration=4.0, method=hs.TimeStepping(step=STEP),
                control_period=5.0 * STEP,
            )  # fmt: skip
        assert (not told) is quiet
        assert bool(np.abs(run.position[-1000:]).max() < 0.1) is quiet


def test_the_warning_points_at_the_line_of_the_user(made: Maker) -> None:
    robot = made(WHEEL, MOTOR)
    law = hs.HoldPosture(robot, kp=1.0, kd=3.0 * INERTIA / STEP)
    state, method = robot.reference_state(), hs.TimeStepping(step=STEP)
    with pytest.warns(hs.SimulationWarning) as run:
        hs.simulate(robot, law, state=state, method=method, duration=STEP)
    with pytest.warns(hs.SimulationWarning) as begun:
        hs.Simulation(robot, law, state=state, method=method)
    assert [each.filename for each in (*run, *begun)] == [__file__] * 2
