"""Preview control against the numbers of its paper, and a pole that is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from heelstrike.gait.cart_table.preview import PreviewControl, cart

CONTROL = PreviewControl.of(0.814, 9.8, 5e-3, 320)
"""The problem of the paper: samples of 5 ms, the centre of mass at 0.814 m, 1.6 s of preview."""


def test_gains_are_those_of_the_published_problem() -> None:
    """Recomputed from the equations of Kajita (2003) by another implementation."""
    assert CONTROL.integral == pytest.approx(618.556391935, rel=1e-10)
    assert CONTROL.state == pytest.approx([72738.069653336, 21565.614083213, 177.088557920])
    for samples, gain in (
        (1, -618.5564), (2, -777.4495), (10, -1103.092), (100, -229.1588), (320, -5.041081),
    ):  # fmt: skip
        assert CONTROL.ahead[samples - 1] == pytest.approx(gain, rel=1e-6)


def test_poles_of_the_closed_loop() -> None:
    """Two are the zero of the sampled cart within the unit circle, near exp(−T √(g/h)).

    That motion does not move the zero moment point, and costs nothing.
    """
    transition, jerk = cart(CONTROL.period)
    output = np.array([1.0, 0.0, -CONTROL.height / CONTROL.gravity])
    system = np.block([[transition, jerk[:, None]], [output[None], np.zeros((1, 1))]])
    zeros = scipy.linalg.eigvals(system, np.diag([1.0, 1.0, 1.0, 0.0]))
    inside = min(zeros[np.isfinite(zeros)], key=lambda zero: abs(zero - 0.98)).real
    assert inside == pytest.approx(0.98280056, abs=1e-8)
    rate = np.sqrt(CONTROL.gravity / CONTROL.height)
    assert inside == pytest.approx(np.exp(-CONTROL.period * rate), abs=1e-6)
    whole = np.zeros((4, 4))
    whole[0] = [1.0, *(output @ transition)]
    whole[1:, 1:] = transition
    gains = np.array([CONTROL.integral, *CONTROL.state])
    poles = np.linalg.eigvals(whole - np.outer([output @ jerk, *jerk], gains))
    double = sorted(poles, key=lambda pole: abs(pole - inside))[:2]
    assert np.mean(double) == pytest.approx(inside, rel=1e-7)
    assert np.abs(np.diff(double)).max() < 1e-4  # a double root is known to √rounding
    pair = sorted(poles, key=lambda pole: pole.imag)
    assert pair[-1] == pytest.approx(0.56737395 + 0.27241098j)
