"""What a controller sees of its robot: encoders, an imu unit, sensors in the feet.

What a sensor measures stands in the place of the truth in the state and the contacts that the
controller is shown; what none measures stays true. Truth is in the run, what was measured in its
log.
"""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np

from heelstrike.arguments import check_fields, takes
from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.around import Around, Shown, Wrapper, copy, own_period
from heelstrike.control.noise import normal, seeded
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState, controlled_robot


@dataclass(frozen=True, kw_only=True)
class Encoders:
    """Encoders of the actuated joints; velocities are filtered differences of their readings."""

    bits: int | None = None
    """Counts a turn of the joint, 2 to the power of this; by default angles are not rounded."""
    noise: float = 0.0
    bias: float = 0.0
    """noise, bias: Standard deviation of each reading, and of the constant error of each joint,
    which is drawn once (rad)."""
    rate: float | None = None
    """Readings a second, at most one a period of the wrapper; by default one each."""
    cutoff: float | None = None
    """Cut-off frequency of the first-order filter of the differences (Hz); none by default."""

    def __post_init__(self) -> None:
        _check(self)
        if self.bits is not None and not (isinstance(self.bits, int) and 1 <= self.bits <= 52):
            raise ControllerError(f"Encoders: bits is a whole number from 1 on, got {self.bits!r}")


@dataclass(frozen=True, kw_only=True)
class InertialUnit:
    """Pitch of the trunk and its rate, as an imu measurement unit tells them."""

    noise: float = 0.0
    bias: float = 0.0
    """noise, bias: Standard deviation of each reading of the pitch, and of its constant error
    (rad)."""
    rate_noise: float = 0.0
    rate_bias: float = 0.0
    """rate_noise, rate_bias: The same of its rate (rad/s)."""
    rate: float | None = None
    """Readings a second; by default one a period of the wrapper."""

    def __post_init__(self) -> None:
        _check(self)


@dataclass(frozen=True, kw_only=True)
class FootSensors:
    """Forces at the contact points as sensors in the feet tell them, or switches."""

    noise: float = 0.0
    bias: float = 0.0
    """noise, bias: Standard deviation of each reading, and of the constant error of each component
    (N)."""
    threshold: float | None = None
    """Normal forces that are read as less than this are read as none, and so is what is tangential
    then (N); by default five times noise and bias together, so that a foot in the air reads
    none."""
    switches: bool = False
    """Whether there is only a switch under each point: the normal force reads 1 or 0, the
    tangential one 0."""
    rate: float | None = None
    """Readings a second; by default one a period of the wrapper."""

    def __post_init__(self) -> None:
        _check(self)

    @property
    def least(self) -> float:
        """Least normal force that is read (N)."""
        return 5.0 * (self.noise + self.bias) if self.threshold is None else self.threshold


def _check(sensor: object) -> None:
    """Refuse numbers that no sensor has."""
    check_fields(sensor, ControllerError)
    for each in fields(sensor):  # type: ignore[arg-type]
        value, positive = getattr(sensor, each.name), each.name in ("rate", "cutoff")
        if value is None or isinstance(value, bool):
            continue
        if not (math.isfinite(value) and (value > 0.0 if positive else value >= 0.0)):
            least = "positive" if positive else "≥ 0"
            raise ControllerError(
                f"{type(sensor).__name__}: {each.name} must be {least}, got {value!r}"
            )


class Parameters(Bundle):
    """Numbers of the sensors."""

    period: float = number(float)
    """Seconds between two calls."""
    encoder_every: int = number(int)
    inertial_every: int = number(int)
    foot_every: int = number(int)
    """encoder_every, inertial_every, foot_every: Calls between two readings; 0 for no sensor."""
    resolution: float = number(float)
    encoder_noise: float = number(float)
    encoder_bias: float = number(float)
    smoothing: float = number(float)
    """resolution, encoder_noise, encoder_bias, smoothing: Of the encoders (rad); share of a new
    difference in the velocity."""
    pitch_noise: float = number(float)
    pitch_bias: float = number(float)
    rate_noise: float = number(float)
    rate_bias: float = number(float)
    force_noise: float = number(float)
    force_bias: float = number(float)
    threshold: float = number(float)
    switches: int = number(int)
    late: int = number(int)
    """Calls by which everything is seen late."""
    seeds: Integers = array(2, of=int)


class Memory(Shown):
    """What the sensors remember."""

    calls: int = cell(int)
    seeds: Integers = array(2, of=int)
    """The generator of the noise."""
    joint_bias: Floats = array("nu")
    force_bias: Floats = array("nc", "components")
    pitch_bias: float = cell(float)
    rate_bias: float = cell(float)
    """joint_bias, force_bias, pitch_bias, rate_bias: Constant errors."""
    joint: Floats = array("nu")
    joint_rate: Floats = array("nu")
    """joint, joint_rate: Readings of the encoders and the velocity that follows."""
    pitch: float = cell(float)
    pitch_rate: float = cell(float)
    force: Floats = array("nc", "components")
    past_q: Floats = array("late + 1", "nq")
    past_v: Floats = array("late + 1", "nv")
    past_force: Floats = array("late + 1", "nc", "components")
    past_position: Floats = array("late + 1", "nc", "axes")
    past_normal: Floats = array("late + 1", "nc", "axes")
    past_gap: Floats = array("late + 1", "nc")
    """past_q, past_v, past_force, past_position, past_normal, past_gap: Readings of the last calls,
    and where contact points were then, a ring."""


class Log(Bundle):
    """What was measured, as the controller saw it, in the run."""

    measured_position: Floats = array(
        "nq", unit="m or rad", label="generalised positions as the controller saw them"
    )
    measured_velocity: Floats = array(
        "nv", unit="m/s or rad/s", label="generalised velocities as the controller saw them"
    )
    measured_force: Floats = array(
        "nc", "components", unit="N", label="contact forces as the controller saw them"
    )


@kernel
def begin(parameters: Parameters, memory: Memory) -> None:
    """Draw the constant errors."""
    for i in range(2):
        memory.seeds[i] = parameters.seeds[i]
    for i in range(memory.joint_bias.shape[0]):
        memory.joint_bias[i] = parameters.encoder_bias * normal(memory.seeds)
    memory.pitch_bias = parameters.pitch_bias * normal(memory.seeds)
    memory.rate_bias = parameters.rate_bias * normal(memory.seeds)
    for i in range(memory.force_bias.shape[0]):
        for k in range(2):
            memory.force_bias[i, k] = parameters.force_bias * normal(memory.seeds)


@kernel
def read_encoders(state: ControlState, parameters: Parameters, memory: Memory) -> None:
    """Read the joints, and tell their velocities by the differences to the readings before."""
    step, first = parameters.encoder_every * parameters.period, memory.calls == 0
    for i in range(memory.joint.shape[0]):
        reading = state.joint_position[i] + memory.joint_bias[i]
        if parameters.encoder_noise > 0.0:
            reading += parameters.encoder_noise * normal(memory.seeds)
        if parameters.resolution > 0.0:
            reading = parameters.resolution * np.round(reading / parameters.resolution)
        if first:
            memory.joint_rate[i] = state.joint_velocity[i]  # a filter that has been running
        else:
            rate = (reading - memory.joint[i]) / step
            memory.joint_rate[i] += parameters.smoothing * (rate - memory.joint_rate[i])
        memory.joint[i] = reading


@kernel
def read_feet(contacts: Contacts, parameters: Parameters, memory: Memory) -> None:
    """Read forces or switches under the contact points."""
    for i in range(memory.force.shape[0]):
        for k in range(2):
            reading = contacts.force[i, k] + memory.force_bias[i, k]
            if parameters.force_noise > 0.0:
                reading += parameters.force_noise * normal(memory.seeds)
            memory.force[i, k] = reading
        pressed = memory.force[i, 0] > parameters.threshold
        if parameters.switches == 1:
            memory.force[i, 0] = 1.0 if pressed else 0.0
            memory.force[i, 1] = 0.0
        elif not pressed:
            memory.force[i, 0] = 0.0
            memory.force[i, 1] = 0.0


@kernel
def pitch_coordinate(robot: ControlledRobot) -> int:
    """Coordinate in which the trunk turns: the first turning one without a motor, or -1."""
    for i in range(robot.unactuated.shape[0]):
        if robot.model.axis[robot.unactuated[i], 0] != 0.0:
            return int(robot.unactuated[i])
    return -1


@kernel
def read_all(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, parameters: Parameters,
    memory: Memory,
) -> None:  # fmt: skip
    """Read the sensors that are due, and put what they tell into the ring, over the truth."""
    if memory.calls == 0:
        begin(parameters, memory)
    row = memory.calls % memory.past_q.shape[0]
    q, v = memory.past_q[row], memory.past_v[row]
    copy(state.q, q)
    copy(state.v, v)
    if parameters.encoder_every > 0:
        if memory.calls % parameters.encoder_every == 0:
            read_encoders(state, parameters, memory)
        for i in range(robot.nu):
            joint = robot.model.actuator_joint[i]
            q[joint] = memory.joint[i]
            v[joint] = memory.joint_rate[i]
    if parameters.inertial_every > 0:
        pitch = pitch_coordinate(robot)
        if memory.calls % parameters.inertial_every == 0:
            noise = parameters.pitch_noise * normal(memory.seeds)
            memory.pitch = state.q[pitch] + memory.pitch_bias + noise
            noise = parameters.rate_noise * normal(memory.seeds)
            memory.pitch_rate = state.v[pitch] + memory.rate_bias + noise
        q[pitch] = memory.pitch
        v[pitch] = memory.pitch_rate
    if parameters.foot_every == 0:
        for i in range(robot.nc):
            for k in range(2):
                memory.force[i, k] = contacts.force[i, k]
    elif memory.calls % parameters.foot_every == 0:
        read_feet(contacts, parameters, memory)
    for i in range(robot.nc):
        memory.past_gap[row, i] = contacts.gap[i]
        for k in range(2):
            memory.past_force[row, i, k] = memory.force[i, k]
            memory.past_position[row, i, k] = contacts.position[i, k]
            memory.past_normal[row, i, k] = contacts.normal[i, k]


@kernel
def sense(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,  # noqa: ARG001
    parameters: Parameters, memory: Memory, log: Log,
) -> None:  # fmt: skip
    """Show the controller inside what was measured, some calls ago."""
    read_all(state, contacts, robot, parameters, memory)
    seen, told = memory.state, memory.contacts
    row = max(memory.calls - parameters.late, 0) % memory.past_q.shape[0]
    copy(memory.past_q[row], seen.q)
    copy(memory.past_v[row], seen.v)
    if parameters.encoder_every > 0:
        robot.follow_motors(seen)
    robot.update(seen)
    copy(seen.q, log.measured_position)
    copy(seen.v, log.measured_velocity)
    for i in range(robot.nc):
        told.gap[i] = memory.past_gap[row, i]
        for k in range(2):
            told.position[i, k] = memory.past_position[row, i, k]
            told.normal[i, k] = memory.past_normal[row, i, k]
            told.force[i, k] = memory.past_force[row, i, k]
            log.measured_force[i, k] = told.force[i, k]
    memory.calls += 1


@kernel
def leave(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters,
    memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Leave the torques as they are."""


SENSED = Wrapper("sensed", sense, leave, Parameters, Memory, Log)


class Sensed(Around):
    """A controller that sees its robot by sensors: any controller, compiled or in Python.

    Positions, normals and gaps of contact points, and what no sensor measures of the state, are
    true, but as late as the rest. What follows by closed loops and couplings follows from what the
    encoders read of the motors.

    Parameters
    ----------
    controller : Controller
        What decides the torques.
    encoders : Encoders, optional
        Of the actuated joints.
    imu : InertialUnit, optional
        Of the trunk's pitch.
    feet : FootSensors, optional
        Under the contact points.
    delay : float
        By how much later everything is seen, in s; a whole number of periods.
    period : float, optional
        Seconds between two looks at the sensors; by default that of the controller, 1 ms at most.
    seed : int
        Of noise and constant errors: the same seed, the same run.

    Raises
    ------
    ControllerError
        If a number cannot be; when it is simulated, if the robot has no pitch to measure.

    Notes
    -----
    The run's log holds ``measured_position``, ``measured_velocity`` and ``measured_force``, beside
    ``run.position``, ``run.velocity`` and ``run.contact_force``, which are true.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> class Relaxed:
    ...     def torque(self, t, state, contacts):
    ...         return -2.0 * state.v[3:]
    >>> seeing = hs.Sensed(Relaxed(), encoders=hs.Encoders(bits=14, noise=1e-4), seed=3)
    >>> run = hs.simulate(robot, seeing, state=robot.reference_state(), duration=0.01)
    >>> bool(abs(run.log["measured_position"].values - run.position).max() < 1e-3)
    True
    """

    @takes(ControllerError)
    def __init__(
        self, controller: Controller, *, encoders: Encoders | None = None,
        imu: InertialUnit | None = None, feet: FootSensors | None = None,
        delay: float = 0.0, period: float | None = None, seed: int = 0,
    ) -> None:  # fmt: skip
        period = own_period(SENSED.name, controller, period)
        late = periods("delay", delay, period)
        seen, unit, under = (
            encoders or Encoders(),
            imu or InertialUnit(),
            feet or FootSensors(),
        )
        each = [
            0 if sensor is None else _calls(sensor.rate, period) for sensor in (encoders, imu, feet)
        ]
        smoothing = 1.0
        if seen.cutoff is not None:
            turned = 2.0 * math.pi * seen.cutoff * max(each[0], 1) * period
            smoothing = turned / (1.0 + turned)
        own = Parameters(
            period=period, encoder_every=each[0], inertial_every=each[1], foot_every=each[2],
            resolution=0.0 if seen.bits is None else 2.0 * math.pi / 2**seen.bits,
            encoder_noise=seen.noise, encoder_bias=seen.bias, smoothing=smoothing,
            pitch_noise=unit.noise, pitch_bias=unit.bias,
            rate_noise=unit.rate_noise, rate_bias=unit.rate_bias,
            force_noise=under.noise, force_bias=under.bias, threshold=under.least,
            switches=int(under.switches), late=late, seeds=np.array(seeded(seed)),
        )  # fmt: skip
        super().__init__(
            SENSED, controller, own, period=period, extents={"late": late}, late=late > 0
        )
        self.encoders, self.imu, self.feet, self.delay = encoders, imu, feet, delay

    def numbers(self, robot: Robot) -> tuple[Bundle, Bundle]:
        """Return parameters and memory, if the robot has what is to be measured."""
        if self.imu is not None and pitch_coordinate(controlled_robot(robot)) < 0:
            raise ControllerError(
                f"robot {robot.name!r} has no trunk that turns freely: there is no pitch for an "
                "imu to measure"
            )
        return super().numbers(robot)


def periods(name: str, time: float, period: float) -> int:
    """Return how many periods a time is.

    Raises
    ------
    ControllerError
        If it is not a whole number of them.
    """
    if not (math.isfinite(time) and time >= 0.0):
        raise ControllerError(f"the {name} must be a number ≥ 0 (s), got {time!r}")
    count = round(time / period)
    if abs(count * period - time) > 1e-6 * period:
        raise ControllerError(
            f"the {name} of {time} s must be a whole number of periods of {period} s"
        )
    return count


def _calls(rate: float | None, period: float) -> int:
    """Return the calls between two readings."""
    if rate is None:
        return 1
    calls = round(1.0 / (rate * period))
    if calls < 1 or abs(calls * rate * period - 1.0) > 1e-6:
        raise ControllerError(
            f"a sensor of {rate} readings a second reads every {1.0 / rate:.6g} s, which is no "
            f"whole number of periods of {period} s: give another rate or period"
        )
    return calls
