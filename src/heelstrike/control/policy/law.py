"""A learned policy as a controller inside the compiled loop."""

from __future__ import annotations

import math
import os

import numpy as np

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.policy.network import ACTIVATIONS, Network, load_network
from heelstrike.control.policy.reference import (
    Following,
    between,
    follow,
    spot,
    stride_at,
)
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

KINDS = ("dense", "lstm", "gru")
DENSE, LSTM, GRU = range(3)
LINEAR, TANH, ELU, RELU = range(4)
assert (ACTIVATIONS[TANH], ACTIVATIONS[ELU], ACTIVATIONS[RELU]) == ("tanh", "elu", "relu")

AT_ONCE = 4
"""Inputs that are multiplied at once."""

SATURATED = 20.0
"""From here on tanh is 1 to the last bit."""

LEADING = 135135.0
OVER_1, OVER_2 = 17325.0, 378.0
UNDER_1, UNDER_2 = 62370.0, 3150.0
"""Coefficients of the continued fraction of tanh, cut after seven terms (Lambert 1768)."""

# Columns of the table of layers, and what a layer remembers in numbers an output.
KIND, ACTIVATION, INPUTS, OUTPUTS, WEIGHTS, KEPT = range(6)
REMEMBERS = {"dense": 0, "gru": 1, "lstm": 2}


class Weights(Bundle):
    """Numbers of a policy."""

    layers: Integers = array("layers", 6, of=int)
    """Kind, activation, inputs, outputs of each layer, and where its weights and what it remembers
    begin."""
    weights: Floats = array("inputs", "rows")
    """Of all layers, one after the other: of each input the weights of all rows, then their biases;
    likewise the recurrent ones. What is beyond the rows of a layer is zero."""
    mean: Floats = array("observed")
    scale: Floats = array("observed")
    """mean, scale: What observations are normalised with; inverse of the deviations."""
    observation_limit: float = number(float)
    skipped: int = number(int)
    velocity_limit: float = number(float)
    """observation_limit, skipped, velocity_limit: Where normalised observations are cut; positions
    that are not observed; up to what velocities are."""
    gear: Floats = array("nu")
    """Torque for an output of 1 (N m)."""
    following: Following = part(Following)
    """The motion that it follows."""
    every: int = number(int)
    """Calls a decision."""
    period: float = number(float)
    """Seconds from one decision to the next."""
    speed: float = cell(float)
    """Commanded speed (m/s), which may be set at any time."""


class State(Bundle):
    """What a policy remembers, and works with."""

    kept: Floats = array("remembered")
    """Outputs and cells of the recurrent layers at the call before."""
    x: Floats = array("width")
    y: Floats = array("4 width")
    z: Floats = array("4 width")
    """x, y, z: What goes into a layer; what comes of it, and of what it remembers."""
    action: Floats = array("nu")
    """What was decided last, from -1 to 1."""
    calls: int = cell(int)
    """Calls so far."""
    phase: float = cell(float)
    speed: float = cell(float)
    since: float = cell(float)
    next_phase: float = cell(float)
    """phase, speed, since, next_phase: Phase (strides), speed (m/s) and time (s) of the last
    decision; phase of the next."""


@kernel
def multiply(weights: Floats, begin: int, inputs: int, rows: int, x: Floats, y: Floats) -> int:
    """Write bias plus weights times inputs; return where the next weights begin.

    Four inputs at a time: what is written so often would cost more than to multiply.
    """
    last = begin + inputs
    for i in range(rows):
        y[i] = weights[last, i]
    for j in range(inputs // AT_ONCE):
        first = AT_ONCE * j
        row = begin + first
        a, b, c, d = x[first], x[first + 1], x[first + 2], x[first + 3]
        for i in range(rows):
            y[i] += (a * weights[row, i] + b * weights[row + 1, i]) + (
                c * weights[row + 2, i] + d * weights[row + 3, i]
            )
    for j in range(inputs - inputs % AT_ONCE, inputs):
        for i in range(rows):
            y[i] += x[j] * weights[begin + j, i]
    return last + 1


@kernel
def hyperbolic_tangent(value: float) -> float:
    """Tanh without a call or a branch, so that several are computed at once.

    A continued fraction of seven terms at a 32nd of the value, then tanh 2x = 2 tanh x / (1 +
    tanh² x) five times, which does not let relative errors grow.
    """
    x = min(max(value, -SATURATED), SATURATED) / 32.0
    u = x * x
    t = x * (LEADING + u * (OVER_1 + u * (OVER_2 + u)))
    t /= LEADING + u * (UNDER_1 + u * (UNDER_2 + u * 28.0))
    for _ in range(5):
        t = 2.0 * t / (1.0 + t * t)
    return t


@kernel
def activate(activation: int, outputs: int, y: Floats, x: Floats) -> None:
    """Write what an activation makes of some numbers."""
    if activation == TANH:
        for i in range(outputs):
            x[i] = hyperbolic_tangent(y[i])
    elif activation == ELU:
        for i in range(outputs):
            x[i] = y[i] if y[i] > 0.0 else math.expm1(y[i])
    elif activation == RELU:
        for i in range(outputs):
            x[i] = max(y[i], 0.0)
    else:
        for i in range(outputs):
            x[i] = y[i]


@kernel
def logistic(value: float) -> float:
    """1 / (1 + exp(-value))."""
    return 1.0 / (1.0 + math.exp(-value))


@kernel
def remember(kind: int, outputs: int, place: int, memory: State) -> None:
    """Write outputs of a recurrent layer, whose gates are in ``y`` and ``z``, and remember them."""
    kept, y, z, x = memory.kept, memory.y, memory.z, memory.x
    for i in range(outputs):
        if kind == LSTM:
            cell = place + outputs + i
            enter, forget = logistic(y[i] + z[i]), logistic(y[outputs + i] + z[outputs + i])
            new = math.tanh(y[2 * outputs + i] + z[2 * outputs + i])
            kept[cell] = forget * kept[cell] + enter * new
            leave = logistic(y[3 * outputs + i] + z[3 * outputs + i])
            x[i] = leave * math.tanh(kept[cell])
        else:
            reset, update = logistic(y[i] + z[i]), logistic(y[outputs + i] + z[outputs + i])
            new = math.tanh(y[2 * outputs + i] + reset * z[2 * outputs + i])
            x[i] = (1.0 - update) * new + update * kept[place + i]
    for i in range(outputs):
        kept[place + i] = x[i]


@kernel
def observe(state: ControlState, parameters: Weights, memory: State) -> None:
    """Write what is observed, normalised, to ``x``."""
    x, limit, place = memory.x, parameters.velocity_limit, 0
    nq, nv, following = state.q.shape[0], state.v.shape[0], parameters.following
    for i in range(parameters.skipped, nq):
        x[place] = state.q[i]
        place += 1
    for i in range(nv):
        x[place] = min(max(state.v[i], -limit), limit)
        place += 1
    if following.speed.shape[0] > 0:
        at = spot(following.speed, following.motion.shape[1], memory.speed, memory.phase)
        for i in range(place):
            x[i] -= between(following.motion, at, parameters.skipped + i)
        x[place] = memory.speed
        x[place + 1] = math.sin(2.0 * math.pi * memory.phase)
        x[place + 2] = math.cos(2.0 * math.pi * memory.phase)
        place += 3
    limit = parameters.observation_limit
    for i in range(place):
        normal = (x[i] - parameters.mean[i]) * parameters.scale[i]
        x[i] = min(max(normal, -limit), limit)


@kernel
def think(parameters: Weights, memory: State) -> None:
    """Let what is in ``x`` go through all layers; the last one's outputs are in ``x`` then."""
    x, weights = memory.x, parameters.weights
    for layer in range(parameters.layers.shape[0]):
        kind, outputs = parameters.layers[layer, KIND], parameters.layers[layer, OUTPUTS]
        inputs, begin = parameters.layers[layer, INPUTS], parameters.layers[layer, WEIGHTS]
        gates = 4 if kind == LSTM else 3 if kind == GRU else 1
        begin = multiply(weights, begin, inputs, gates * outputs, x, memory.y)
        if kind == DENSE:
            activate(parameters.layers[layer, ACTIVATION], outputs, memory.y, x)
        else:
            own = parameters.layers[layer, KEPT]
            for i in range(outputs):
                x[i] = memory.kept[own + i]
            multiply(weights, begin, outputs, gates * outputs, x, memory.z)
            remember(kind, outputs, own, memory)


@controller
def policy(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Weights, memory: State,
    torque: Floats,
) -> None:  # fmt: skip
    """Torques that a network decides on, beside those that follow its motion, if it has one."""
    follows = parameters.following.speed.shape[0] > 0
    if memory.calls % parameters.every == 0:
        if follows:
            memory.speed, memory.phase, memory.since = parameters.speed, memory.next_phase, t
            stride = stride_at(parameters.following, memory.speed)
            memory.next_phase = memory.phase + parameters.period / stride
        observe(state, parameters, memory)
        think(parameters, memory)
        for i in range(torque.shape[0]):
            memory.action[i] = min(max(memory.x[i], -1.0), 1.0)
    memory.calls += 1
    if follows:
        stride = stride_at(parameters.following, memory.speed)
        phase = memory.phase + (t - memory.since) / stride
        follow(parameters.following, memory.speed, phase, robot, state.q, state.v, torque)
    else:
        for i in range(torque.shape[0]):
            torque[i] = 0.0
    for i in range(torque.shape[0]):
        torque[i] += parameters.gear[i] * memory.action[i]


class Policy(Law):
    """A policy that was learned, from its file: a network that decides at its own rate.

    Parameters
    ----------
    file : str, path or Network
        A file that :meth:`Network.save`, or anything else, wrote in the format of
        :mod:`heelstrike.control.policy.network`; or the network itself.
    robot : Robot or SpatialRobot, optional
        The robot, to see at once whether it fits.
    speed : float, optional
        Speed (m/s) that is commanded to a policy which follows a motion; the lowest of its motions
        by default. ``simulation.parameters.speed`` changes it at any time.
    phase : float
        Where in the stride it begins, from 0 to 1.

    Raises
    ------
    ControllerError
        If there is no such file, or it is no policy, or one of another robot.

    Notes
    -----
    What recurrent layers remember is in the memory of the law: it begins with zeros in every
    simulation and is part of snapshots.
    """

    @takes(ControllerError)
    def __init__(
        self, file: str | os.PathLike[str] | Network,
        robot: Robot | SpatialRobot | None = None, *,
        speed: float | None = None, phase: float = 0.0,
    ) -> None:  # fmt: skip
        network = file if isinstance(file, Network) else load_network(file)
        if robot is not None:
            observed = network.observed(robot.nq, robot.nv)
            fits = observed == network.mean.size and robot.nu == network.gear.size
            if network.reference is not None:
                size = robot.nq + robot.nv + robot.nu
                fits = fits and network.reference.motion.shape[2] == size
            if not fits or network.robot not in ("", robot.name):
                raise ControllerError(
                    f"this policy is one of {network.robot or 'a robot'!r} that observes "
                    f"{network.mean.size} numbers and drives {network.gear.size} actuators; robot "
                    f"{robot.name!r} has {observed} and {robot.nu}"
                )
        reference = network.reference
        if speed is not None and reference is None:
            raise ControllerError(
                "this policy follows no motion, so it has no speed to set: leave speed out"
            )
        if speed is None:
            speed = 0.0 if reference is None else float(reference.speed[0])
        if not (np.isfinite(speed) and np.isfinite(phase)):
            raise ControllerError(f"speed and phase must be finite, got {speed} and {phase}")
        self.network = network
        width = max(network.mean.size, *(layer.outputs for layer in network.layers))
        kept = sum(REMEMBERS[layer.kind] * layer.outputs for layer in network.layers)
        super().__init__(
            policy, _weights(network, speed),
            memory={"remembered": kept, "width": width, "next_phase": float(phase)},
            period=network.period if reference is None else reference.period,
        )  # fmt: skip


def _weights(network: Network, speed: float) -> Weights:
    """Lay the numbers of a network out as the kernels read them."""
    table, words, place, own = [], [], 0, 0
    reference = network.reference
    for layer in network.layers:
        own_words = [layer.weight.T, layer.bias[None]]
        if layer.recurrent is not None and layer.recurrent_bias is not None:
            own_words += [layer.recurrent.T, layer.recurrent_bias[None]]
        activation = ACTIVATIONS.index(layer.activation)
        kind = KINDS.index(layer.kind)
        table.append([kind, activation, layer.inputs, layer.outputs, place, own])
        words += own_words
        place += sum(len(each) for each in own_words)
        own += REMEMBERS[layer.kind] * layer.outputs
    rows = max(each.shape[1] for each in words)
    return Weights(
        layers=np.array(table, dtype=np.int64),
        weights=np.concatenate(
            [np.pad(each, ((0, 0), (0, rows - each.shape[1]))) for each in words]
        ),
        mean=network.mean, scale=1.0 / network.deviation,
        observation_limit=network.observation_limit, skipped=network.skipped,
        velocity_limit=network.velocity_limit, gear=network.gear,
        following=reference.numbers() if reference is not None
        else Following.allocate(speeds=0, phases=0, numbers=0, nu=len(network.gear)),
        every=1 if reference is None else round(network.period / reference.period),
        period=network.period, speed=float(speed),
    )  # fmt: skip
