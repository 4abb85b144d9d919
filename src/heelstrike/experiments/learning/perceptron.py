"""Fully connected networks with tanh, their gradients, and the optimiser Adam, in NumPy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


class Perceptron:
    """Layers of tanh and a linear one; weights are (inputs, outputs).

    Parameters
    ----------
    sizes : sequence of int
        Inputs, outputs of each hidden layer, outputs.
    random : Generator
        What the weights begin with: orthogonal matrices (Saxe et al. 2014).
    last_gain : float
        Size of those of the last layer.
    """

    def __init__(
        self, sizes: tuple[int, ...], random: np.random.Generator, last_gain: float
    ) -> None:
        self.parameters: list[Array] = []
        pairs = list(pairwise(sizes))
        for place, (inputs, outputs) in enumerate(pairs):
            gain = last_gain if place == len(pairs) - 1 else np.sqrt(2.0)
            matrix = random.standard_normal((max(inputs, outputs), min(inputs, outputs)))
            basis = np.linalg.qr(matrix)[0]
            weights = gain * (basis if inputs >= outputs else basis.T)
            self.parameters += [
                np.ascontiguousarray(weights, dtype=np.float32),
                np.zeros(outputs, dtype=np.float32),
            ]

    def __call__(self, x: Array) -> tuple[Array, list[Array]]:
        """Return outputs (n, no) of inputs (n, ni), and the inputs of each layer."""
        seen = [x]
        last = len(self.parameters) - 2
        for place in range(0, last + 1, 2):
            x = x @ self.parameters[place]
            x += self.parameters[place + 1]
            if place < last:
                np.tanh(x, out=x)
                seen.append(x)
        return x, seen

    def gradients(self, seen: list[Array], slope: Array) -> list[Array]:
        """Return the gradients of the parameters.

        Parameters
        ----------
        seen : list of array
            Inputs of each layer.
        slope : (n, no) array
            Gradient of the loss by the outputs.

        Returns
        -------
        list of array
            In the order of the parameters.
        """
        found: list[Array] = []
        for place in range(len(self.parameters) - 2, -1, -2):
            x = seen[place // 2]
            found += [slope.sum(axis=0), x.T @ slope]
            if place:
                slope = (slope @ self.parameters[place].T) * (1.0 - x * x)
        return found[::-1]


class Adam:
    """Steps along gradients (Kingma & Ba 2015), whose length is bounded.

    Parameters
    ----------
    parameters : list of array
        What is improved, in place.
    rate : float
        Length of a step.
    longest : float
        Greatest length of the gradient of all parameters together.
    """

    def __init__(self, parameters: list[Array], rate: float, longest: float = 0.5) -> None:
        self.parameters, self.rate, self.longest = parameters, rate, longest
        self.mean = [np.zeros_like(each) for each in parameters]
        self.square = [np.zeros_like(each) for each in parameters]
        self.steps = 0

    def step(self, gradients: list[Array], share: float = 1.0) -> None:
        """Take a step, of a share of the usual length."""
        length = np.sqrt(sum(float(np.vdot(each, each)) for each in gradients))
        scale = min(1.0, self.longest / (length + 1e-8))
        self.steps += 1
        rate = share * self.rate * np.sqrt(1.0 - 0.999**self.steps) / (1.0 - 0.9**self.steps)
        for value, gradient, mean, square in zip(
            self.parameters, gradients, self.mean, self.square, strict=True
        ):
            slope: Any = scale * gradient
            mean += np.float32(0.1) * (slope - mean)
            square += np.float32(0.001) * (slope * slope - square)
            value -= np.float32(rate) * mean / (np.sqrt(square) + np.float32(1e-8))
