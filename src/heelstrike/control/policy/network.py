"""Networks of a policy: their layers, in numbers and in a file.

A file is a NumPy archive (``.npz``) without pickled objects, which anything can write:

======================  ===========================================================================
``format``              the text ``heelstrike policy 1``
``robot``               name of the robot, text; empty for any
``period``              seconds from one decision to the next
``skipped``             positions at the beginning that are not observed, 1 for x
``velocity_limit``      velocities are observed up to this
``mean``, ``deviation`` (no,) what observations are normalised with
``observation_limit``   normalised observations are cut there
``gear``                (nu,) torque (N m) for an output of 1; outputs are cut at ±1
``kind.i``              text of layer i = 0, 1, ...: ``dense``, ``lstm`` or ``gru``
``activation.i``        of a dense layer: ``linear``, ``tanh``, ``elu`` or ``relu``
``weight.i``            (outputs, inputs) of a dense layer; (4 or 3 outputs, inputs) of others
``bias.i``              one for each row
``recurrent.i``         (4 or 3 outputs, outputs) of lstm (gates i, f, g, o) and gru (r, z, n)
``recurrent_bias.i``    one for each row
``reference.NAME``      if it follows a motion: the fields of :class:`Reference`; how far positions
                        and velocities are off the motion is observed then, and after them
                        commanded speed, sine and cosine of the phase
======================  ===========================================================================

Rows and gates are in the order of PyTorch's ``LSTM`` and ``GRU``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import positive
from heelstrike.array_file import read_arrays, write_arrays
from heelstrike.control.policy.reference import OBSERVED, Reference
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

FORMAT = "heelstrike policy 1"

GATES = {"dense": 1, "lstm": 4, "gru": 3}
ACTIVATIONS = ("linear", "tanh", "elu", "relu")

MOST = 100_000_000
"""Numbers that a file may hold."""


@dataclass(frozen=True, eq=False)
class Layer:
    """A layer of a network.

    Raises
    ------
    ControllerError
        If shapes do not fit, or a number is not finite.
    """

    weight: Floats
    """(gates × outputs, inputs) What inputs are multiplied with."""
    bias: Floats
    """(gates × outputs,)"""
    kind: str = "dense"
    """``"dense"``, ``"lstm"`` or ``"gru"``."""
    activation: str = "linear"
    """What becomes of the outputs of a dense layer: ``"linear"``, ``"tanh"``, ``"elu"`` or
    ``"relu"``."""
    recurrent: Floats | None = None
    recurrent_bias: Floats | None = None
    """recurrent, recurrent_bias: (gates × outputs, outputs) and (gates × outputs,) What the outputs
    of the call before are multiplied with."""

    def __post_init__(self) -> None:
        if self.kind not in GATES:
            raise ControllerError(f"a layer is one of {', '.join(GATES)}; got {self.kind!r}")
        if self.activation not in ACTIVATIONS:
            raise ControllerError(
                f"the activation of a layer is one of {', '.join(ACTIVATIONS)}; got "
                f"{self.activation!r}"
            )
        names: tuple[str, ...] = ("weight", "bias")
        if self.kind != "dense":
            names += ("recurrent", "recurrent_bias")
        for name in names:
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if not np.isfinite(array).all():
                raise ControllerError(f"the {name} of a {self.kind} layer is not finite")
            object.__setattr__(self, name, array)
        rows = self.weight.shape[0] if self.weight.ndim == 2 else 0
        wanted = {"bias": (rows,), "recurrent": (rows, rows // GATES[self.kind]),
                  "recurrent_bias": (rows,)}  # fmt: skip
        wrong = rows == 0 or rows % GATES[self.kind] != 0
        if wrong or any(getattr(self, n).shape != wanted[n] for n in names[1:]):
            shapes = ", ".join(f"{name} {getattr(self, name).shape}" for name in names)
            gates = f"{GATES[self.kind]} × outputs" if GATES[self.kind] > 1 else "outputs"
            rest = "".join(
                f", {name} ({gates}{', outputs' if name == 'recurrent' else ''})"
                for name in names[1:]
            )
            raise ControllerError(
                f"the arrays of a {self.kind} layer must have the shapes weight ({gates}, inputs)"
                f"{rest}; they have {shapes}"
            )

    @property
    def inputs(self) -> int:
        """Numbers that go in."""
        return int(self.weight.shape[1])

    @property
    def outputs(self) -> int:
        """Numbers that come out."""
        return int(self.weight.shape[0]) // GATES[self.kind]


@dataclass(frozen=True, eq=False)
class Network:
    """What a policy decides with, and what its inputs and outputs mean.

    Raises
    ------
    ControllerError
        If the layers do not fit each other, the observation or the actuators.
    """

    layers: tuple[Layer, ...]
    """From observation to action."""
    period: float
    """Seconds from one decision to the next."""
    gear: Floats
    """(nu,) Torque (N m) of each actuator for an output of 1; outputs are cut at ±1."""
    mean: Floats
    deviation: Floats
    """mean, deviation: (no,) What observations are normalised with."""
    observation_limit: float = 10.0
    """Normalised observations are cut there."""
    skipped: int = 1
    """Positions at the beginning that are not observed: 1 for x."""
    velocity_limit: float = np.inf
    """Velocities are observed up to this (m/s, rad/s)."""
    robot: str = ""
    """Name of the robot it was learned with; empty for any."""
    about: dict[str, str] = field(default_factory=dict)
    """What else is to be told of it."""
    reference: Reference | None = None
    """Motion that it follows; torques of the outputs are added to those that do so."""

    def __post_init__(self) -> None:
        for name in ("gear", "mean", "deviation"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 1 or not np.isfinite(array).all():
                raise ControllerError(f"{name} of a policy must be finite numbers in a row")
            object.__setattr__(self, name, array)
        sizes = [self.mean.size, *(layer.outputs for layer in self.layers)]
        wanted = [layer.inputs for layer in self.layers]
        if not self.layers or wanted != sizes[:-1] or sizes[-1] != self.gear.size:
            raise ControllerError(
                f"the layers of a policy do not fit: {self.mean.size} are observed, layers take "
                f"{wanted} and give {sizes[1:]}, and {self.gear.size} actuators are to be driven"
            )
        if self.deviation.shape != self.mean.shape or not (self.deviation > 0.0).all():
            raise ControllerError("deviation of a policy must be positive, as many as the mean")
        positive("the period of a policy", self.period, ControllerError, "s")
        if self.reference is not None:
            every = self.period / self.reference.period
            if self.reference.stiffness.size != self.gear.size or every != round(every, 6):
                raise ControllerError(
                    "the reference of a policy must be one of as many joints as it drives, whose "
                    f"period is a whole part of {self.period} s, got {self.reference.period} s"
                )

    def observed(self, positions: int, velocities: int) -> int:
        """Return how many numbers of a robot it observes.

        Parameters
        ----------
        positions, velocities : int
            Those of the robot.

        Returns
        -------
        int
            The number.
        """
        own = 0 if self.reference is None else OBSERVED
        return positions + velocities - self.skipped + own

    def begin(self) -> list[NDArray[np.float64]]:
        """Return what the layers remember before the first call: zeros.

        Returns
        -------
        list of array
            For each layer; of dense ones nothing.
        """
        sizes = {"dense": 0, "gru": 1, "lstm": 2}
        return [np.zeros((sizes[layer.kind], layer.outputs)) for layer in self.layers]

    def act(self, observation: ArrayLike, memory: list[NDArray[np.float64]]) -> Floats:
        """Return what comes out for an observation, before it is cut: the reference in NumPy.

        Parameters
        ----------
        observation : (no,) float
            What is observed; (n, no) of several robots, if all layers are dense.
        memory : list of array
            What :meth:`begin` returned; it is written to.

        Returns
        -------
        (nu,) float
            Outputs of the last layer.
        """
        limit = self.observation_limit
        x = (np.asarray(observation, dtype=np.float64) - self.mean) / self.deviation
        x = np.clip(x, -limit, limit)
        for layer, kept in zip(self.layers, memory, strict=True):
            x = _OF_KIND[layer.kind](layer, x, kept)
        return x

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a file, by custom ``.npz``; nothing in it can be executed.

        Parameters
        ----------
        path : str or path
            The file. It appears whole or not at all.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        WriteError
            If it cannot be written.
        """
        arrays: dict[str, Any] = {
            "format": FORMAT, "robot": self.robot, "period": self.period, "skipped": self.skipped,
            "velocity_limit": self.velocity_limit, "observation_limit": self.observation_limit,
            "mean": self.mean, "deviation": self.deviation, "gear": self.gear,
        }  # fmt: skip
        for i, layer in enumerate(self.layers):
            arrays |= {f"kind.{i}": layer.kind, f"activation.{i}": layer.activation,
                       f"weight.{i}": layer.weight, f"bias.{i}": layer.bias}  # fmt: skip
            if layer.recurrent is not None and layer.kind != "dense":
                arrays[f"recurrent.{i}"] = layer.recurrent
                arrays[f"recurrent_bias.{i}"] = layer.recurrent_bias
        arrays |= {f"about.{name}": text for name, text in self.about.items()}
        if self.reference is not None:
            arrays |= {f"reference.{k}": v for k, v in vars(self.reference).items()}
        return write_arrays(path, arrays)


def load_network(path: str | os.PathLike[str]) -> Network:
    """Read a network from a file.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    Network
        The network.

    Raises
    ------
    ControllerError
        If there is no such file, or it is no policy, or damaged.
    """
    arrays = read_arrays(path, "a policy", ControllerError, 8 * MOST)
    if str(arrays.get("format")) != FORMAT:
        raise ControllerError(f"{path}: not a policy in the layout {FORMAT!r}")
    try:
        return _network(arrays)
    except ControllerError as error:
        raise ControllerError(f"{path}: damaged, {error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise ControllerError(f"{path}: damaged, {error} is missing or no number") from error


def _network(arrays: Mapping[str, Any]) -> Network:
    layers: list[Layer] = []
    while f"kind.{len(layers)}" in arrays:
        i = len(layers)
        kind = str(arrays[f"kind.{i}"])
        recurs = kind in ("lstm", "gru")
        layers.append(
            Layer(
                arrays[f"weight.{i}"], arrays[f"bias.{i}"], kind, str(arrays[f"activation.{i}"]),
                arrays[f"recurrent.{i}"] if recurs else None,
                arrays[f"recurrent_bias.{i}"] if recurs else None,
            )
        )  # fmt: skip
    about = {k.removeprefix("about."): str(v) for k, v in arrays.items() if k.startswith("about.")}
    reference = None
    if "reference.motion" in arrays:
        named = {each.name: arrays[f"reference.{each.name}"] for each in fields(Reference)}
        reference = Reference(**named | {"period": float(named["period"])})
    return Network(
        tuple(layers), float(arrays["period"]), arrays["gear"], arrays["mean"],
        arrays["deviation"], float(arrays["observation_limit"]), int(arrays["skipped"]),
        float(arrays["velocity_limit"]), str(arrays["robot"]), about, reference,
    )  # fmt: skip


def _dense(layer: Layer, x: Floats, kept: Floats) -> Floats:  # noqa: ARG001
    y: Floats = x @ layer.weight.T + layer.bias
    if layer.activation == "tanh":
        return np.tanh(y)
    if layer.activation == "elu":
        return np.where(y > 0.0, y, np.expm1(np.minimum(y, 0.0)))
    return np.maximum(y, 0.0) if layer.activation == "relu" else y


def _logistic(x: Floats) -> Floats:
    return 1.0 / (1.0 + np.exp(-x))


def _lstm(layer: Layer, x: Floats, kept: Floats) -> Floats:
    assert layer.recurrent is not None
    assert layer.recurrent_bias is not None
    gates = layer.weight @ x + layer.bias + layer.recurrent @ kept[0] + layer.recurrent_bias
    i, f, g, o = gates.reshape(4, -1)
    kept[1] = _logistic(f) * kept[1] + _logistic(i) * np.tanh(g)
    kept[0] = _logistic(o) * np.tanh(kept[1])
    return kept[0].copy()


def _gru(layer: Layer, x: Floats, kept: Floats) -> Floats:
    assert layer.recurrent is not None
    assert layer.recurrent_bias is not None
    r, z, n = (layer.weight @ x + layer.bias).reshape(3, -1)
    own_r, own_z, own_n = (layer.recurrent @ kept[0] + layer.recurrent_bias).reshape(3, -1)
    z = _logistic(z + own_z)
    n = np.tanh(n + _logistic(r + own_r) * own_n)
    kept[0] = (1.0 - z) * n + z * kept[0]
    return kept[0].copy()


_OF_KIND = {"dense": _dense, "lstm": _lstm, "gru": _gru}
