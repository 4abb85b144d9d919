"""Motors stay on their speed-torque line.

Theory: with the stall torque τ₀ and the no-load speed ω₀ at the joint, D = τ₀ / ω₀, a motor under
the part u of its full voltage gives τ = τ₀ u - D ω with |u| ≤ 1. So -τ₀ ≤ τ + D ω ≤ τ₀, whatever it
is asked for, at every velocity at which a torque acts.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.errors import ControllerError, RobotError, SimulationError
from heelstrike.robot.motors import torque_range
from heelstrike.sim import Scheme
from heelstrike.sim.controller.motors import limit_torque, motor_damping, motor_torque
from heelstrike.sim.memory import allocate_memory

STALL, FREE, DAMPING = 40.0, 8.0, 2.0
METHODS = {
    "time stepping": hs.TimeStepping(),
    "linearly implicit": hs.TimeStepping(scheme=Scheme.LINEARLY_IMPLICIT),
    "event-driven": hs.EventDriven(),
    "compliant": hs.Compliant(),
}


class Wave(hs.Bundle):
    """Commands that swing, each at a rate of its own."""

    size: np.ndarray = hs.array("nu")
    rate: np.ndarray = hs.array("nu")


@hs.controller
def swing(t: float, parameters: Wave, torque: Any) -> None:
    for i in range(torque.shape[0]):
        torque[i] = parameters.size[i] * np.cos(parameters.rate[i] * t)


def steady(size: float, **options: Any) -> hs.Law:
    """The same command forever."""
    return swing(Wave(size=np.array([size]), rate=np.zeros(1)), **options)


class Held:
    """The same command forever, asked for from Python and held."""

    def __init__(self, command: float, *, commands_voltage: bool = False) -> None:
        self.command, self.commands_voltage = command, commands_voltage

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return np.array([self.command])


def shaft(**more: Any) -> hs.Robot:
    """A flywheel on a motor."""
    build = hs.RobotBuilder("shaft")
    motor = {"torque": np.inf, "stall_torque": STALL, "no_load_speed": FREE}
    build.hinge("shaft", None, **{"inertia": 0.5, "mass": 1.0, "damping": DAMPING} | motor | more)
    return build.build()


def tumbler(seed: int) -> hs.Robot:
    """A tree of links at random that falls to the ground, every joint with a motor at random."""
    draw = np.random.default_rng(seed)
    build = hs.RobotBuilder(f"tumbler {seed}")
    names = [build.floating_base("trunk", (0.0, 0.8), mass=3.0, inertia=0.05)]
    for k in range(draw.integers(1, 4)):
        names.append(
            build.hinge(
                f"joint {k}",
                names[draw.integers(len(names))],
                at=(draw.uniform(-0.1, 0.1), draw.uniform(-0.2, 0.0)),
                mass=draw.uniform(0.5, 2.0),
                inertia=draw.uniform(0.01, 0.05),
                center_of_mass=(0.0, -0.1),
                armature=0.05,
                torque=draw.choice([8.0, 30.0, np.inf]),
                stall_torque=draw.uniform(2.0, 20.0),
                no_load_speed=draw.choice([draw.uniform(1.0, 10.0), np.inf], p=[0.8, 0.2]),
            )
        )
        build.contact(names[-1], (0.0, -0.2))
    return build.build()


def distance_beyond(robot: hs.Robot, run: hs.Run) -> float:
    """How far torques are beyond the line at the velocity beside them, relative to the stall."""
    joint = robot.model.actuator_joint
    stall, free = robot.model.stall_torque[joint], robot.model.no_load_speed[joint]
    at_rest = run.torque + stall / free * run.velocity[:, joint]  # what it would be without D ω
    size = stall + stall / free * np.abs(run.velocity[:, joint])
    return float(np.max((np.abs(at_rest) - stall) / size))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("method", METHODS)
def test_no_torque_of_any_method_exceeds_the_line(method: str, seed: int) -> None:
    """Held and continuous commands, torques and voltages, through impacts and stops."""
    robot = tumbler(seed)
    draw = np.random.default_rng([seed, 1])
    voltage = seed % 2 == 1
    size = draw.uniform(0.5, 2.0, robot.nu) * (1.0 if voltage else 20.0)
    law = swing(Wave(size=size, rate=draw.uniform(1, 40, robot.nu)), commands_voltage=voltage)
    for period in (None, 0.02):
        run = hs.simulate(
            robot,
            law,
            state=robot.reference_state(),
            duration=0.5,
            method=METHODS[method],
            control_period=period,
            stop_when_fallen=False,
        )
        assert run.completed, run.message
        assert len(run.events) > 0
        assert run.saturations > 0
        assert distance_beyond(robot, run) <= 1e-12
        lower, upper = torque_range(robot.model, run.velocity)
        slack = 1e-12 * (1.0 + np.abs(run.torque))
        assert np.all((run.torque >= lower - slack) & (run.torque <= upper + slack))


@pytest.mark.parametrize("u", [0.7, -1.0])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("controller", [steady, Held])
def test_steady_speed_under_constant_voltage(method: str, u: float, controller: Any) -> None:
    """0 = τ₀ u - (D + d) ω; after 4 s, 56 time constants of 1/14 s, e⁻⁵⁶ is left of the start."""
    run = hs.simulate(
        shaft(),
        controller(u, commands_voltage=True),
        state=hs.State([0.0], [0.0]),
        duration=4.0,
        method=METHODS[method],
    )
    expected = STALL * u / (STALL / FREE + DAMPING)
    np.testing.assert_allclose(run.velocity[-1, 0], expected, rtol=1e-8)
    np.testing.assert_allclose(
        run.torque[:, 0], STALL * u - STALL / FREE * run.velocity[:, 0], rtol=0, atol=1e-12 * STALL
    )
    assert run.saturations == 0


def test_the_way_to_the_steady_speed_is_exponential() -> None:
    """I ω̇ = τ₀ u - (D + d) ω, under the tolerance of the integration."""
    run = hs.simulate(
        shaft(), steady(0.5, commands_voltage=True), state=hs.State([0.0], [3.0]), duration=0.3,
        method=hs.EventDriven(rtol=1e-10, atol=1e-12),
    )  # fmt: skip
    rate = (STALL / FREE + DAMPING) / 0.5
    end = 0.5 * STALL / (STALL / FREE + DAMPING)
    expected = end + (3.0 - end) * np.exp(-rate * run.time)
    np.testing.assert_allclose(run.velocity[:, 0], expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_a_torque_is_followed_as_far_as_the_line_lets_it(method: str) -> None:
    """Held at 25 N m, the motor follows up to the speed 3 rad/s, and then goes down the line."""
    run = hs.simulate(
        shaft(damping=0.0), Held(25.0), state=hs.State([0.0], [0.0]), duration=2.0,
        method=METHODS[method],
    )  # fmt: skip
    speed = run.velocity[:, 0]
    expected = np.minimum(25.0, STALL - STALL / FREE * speed)
    np.testing.assert_allclose(run.torque[:, 0], expected, rtol=0, atol=1e-12 * STALL)
    assert np.any(speed < 3.0)
    np.testing.assert_allclose(speed[-1], FREE, rtol=1e-6)
    if method == "time stepping":
        assert run.saturations == np.sum(expected < 25.0)


def test_beyond_the_no_load_speed_the_motor_brakes_whatever_limits_and_commands_say() -> None:
    robot = shaft(torque=(-5.0, 30.0), damping=0.0)
    run = hs.simulate(robot, Held(30.0), state=hs.State([0.0], [12.0]), duration=0.01)
    assert run.torque[0, 0] == STALL - STALL / FREE * 12.0 == -20.0
    assert [float(end[0]) for end in torque_range(robot.model, [12.0])] == [-20.0, -20.0]
    assert [float(end[0]) for end in torque_range(robot.model, [4.0])] == [-5.0, 20.0]


def test_limits_of_the_torque_stand_under_a_voltage_too() -> None:
    run = hs.simulate(
        shaft(torque=15.0), Held(1.0, commands_voltage=True), state=hs.State([0.0], [0.0]),
        duration=1.0,
    )  # fmt: skip
    expected = np.minimum(15.0, STALL - STALL / FREE * run.velocity[:, 0])
    np.testing.assert_array_equal(run.torque[:, 0], expected)
    assert run.saturations == np.sum(expected == 15.0)


def test_a_voltage_beyond_the_full_one_is_the_full_one() -> None:
    start = hs.State([0.0], [1.0])
    runs = [
        hs.simulate(shaft(), Held(u, commands_voltage=True), state=start, duration=0.1)
        for u in (-1.0, -3.0)
    ]
    np.testing.assert_array_equal(runs[0].velocity, runs[1].velocity)
    assert [run.saturations for run in runs] == [0, len(runs[1].time)]


def test_a_motor_without_a_line_does_as_before() -> None:
    """A no-load speed alone is no line; without it the stall torque is a limit."""
    start = hs.State([0.0], [20.0])
    alone = hs.simulate(shaft(stall_torque=np.inf), Held(70.0), state=start, duration=0.05)
    assert np.all(alone.torque == 70.0)
    level = hs.simulate(shaft(no_load_speed=np.inf), Held(70.0), state=start, duration=0.05)
    assert np.all(level.torque == STALL)


def test_an_implicit_scheme_takes_the_drag_of_the_winding_at_the_end_of_the_step() -> None:
    """D h / I = 8: explicitly each step would overshoot by seven times the way."""
    robot = shaft(damping=0.0, inertia=0.005)
    run = hs.simulate(
        robot, steady(0.5, commands_voltage=True), state=hs.State([0.0], [0.0]), duration=0.4,
        method=hs.TimeStepping(step=8e-3, scheme=Scheme.LINEARLY_IMPLICIT),
    )  # fmt: skip
    assert np.all(np.diff(run.velocity[:, 0]) >= 0.0)
    np.testing.assert_allclose(run.velocity[-1, 0], 0.5 * FREE, rtol=1e-9)


@pytest.mark.parametrize("voltage", [0, 1])
@pytest.mark.parametrize("command", [0.1, 0.6, 1.0, 9.0])
@pytest.mark.parametrize("speed", [-9.0, 1.0, 7.9, 12.0])
def test_damping_is_the_slope_of_the_torque(voltage: int, command: float, speed: float) -> None:
    """Against a difference; no point lies on a corner of the line."""
    model = shaft(torque=(-11.0, 13.0)).model
    command = min(command, 1.0) if voltage else command
    torque = uncompiled(motor_torque)
    near, far = (
        torque(model, 0, voltage, command, np.array([speed + change])) for change in (-1e-3, 1e-3)
    )
    found = uncompiled(motor_damping)(model, 0, voltage, command, np.array([speed]))
    assert found == pytest.approx((near - far) / 2e-3, abs=1e-9)


def test_compliant_ground_takes_a_held_voltage_implicitly() -> None:
    """A winding that stops the motor in 1 µs costs steps only until it has."""
    robot = shaft(damping=0.0, inertia=1e-3, stall_torque=8e3)
    run = hs.simulate(
        robot, Held(0.5, commands_voltage=True), state=hs.State([0.0], [0.0]), duration=0.2,
        method=hs.Compliant(),
    )  # fmt: skip
    assert run.steps < 1000
    np.testing.assert_allclose(run.velocity[-1, 0], 0.5 * FREE, rtol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_a_snapshot_holds_what_is_commanded(method: str, tmp_path: Path) -> None:
    """Taken between two calls of the controller, while torques leave the line's command."""

    def simulation() -> hs.Simulation:
        robot = tumbler(2)
        law = swing(Wave(size=np.full(robot.nu, 1.5), rate=np.full(robot.nu, 9.0)),
                    commands_voltage=True)  # fmt: skip
        return hs.Simulation(
            robot, law, state=robot.reference_state(), method=METHODS[method], control_period=0.05
        )

    whole, taken = simulation(), simulation()
    for one in (whole, taken):
        one.advance(0.13)
    path = taken.snapshot().save(tmp_path / "kept.npz")
    back = simulation()
    back.restore(hs.load_snapshot(path))
    for one in (whole, back):
        one.advance(0.3)
    np.testing.assert_array_equal(whole.state.q, back.state.q)
    np.testing.assert_array_equal(whole.state.v, back.state.v)


def test_a_snapshot_of_torques_is_none_of_voltages() -> None:
    state = hs.State([0.0], [0.0])
    torques, volts = (
        hs.Simulation(shaft(), steady(0.5, commands_voltage=voltage), state=state)
        for voltage in (False, True)
    )
    with pytest.raises(SimulationError, match=r"another controller, .*swing; .*\(voltages\)"):
        volts.restore(torques.snapshot())


def test_voltages_need_a_motor_that_is_known() -> None:
    robot = shaft(stall_torque=np.inf)
    with pytest.raises(ControllerError, match="Held commands voltages, but the stall torque of"):
        hs.Simulation(robot, Held(0.5, commands_voltage=True), state=robot.reference_state())


def test_a_motor_that_never_turns_is_refused() -> None:
    with pytest.raises(RobotError, match="no-load speed of the motor at joint 'shaft' is 0"):
        shaft(no_load_speed=0.0)


def test_a_command_that_is_no_number_is_named_by_its_place() -> None:
    robot = hs.load_robot("bravo7")
    memory = allocate_memory(robot)
    limit = uncompiled(limit_torque)
    told = memory.v, memory.tally, memory.command, memory.torque
    assert limit(robot.model, 0, *told)
    memory.command[4] = np.inf
    assert not limit(robot.model, 0, *told)
    assert memory.tally.bad_torque == 4
