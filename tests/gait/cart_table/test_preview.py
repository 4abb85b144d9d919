"""Preview control of the zero moment point with the numbers of Kajita et al. (2003)."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.control import PreviewControl, preview_control

HEIGHT, GRAVITY, PERIOD = 0.814, 9.8, 0.005


def servo() -> PreviewControl:
    return preview_control(height=HEIGHT, gravity=GRAVITY, period=PERIOD, horizon=320)


def test_gains_are_the_published() -> None:
    """Twelve digits: the Riccati equation has condition enough for 1e-11 of them."""
    gains = servo()
    assert gains.sum_gain == pytest.approx(618.556391935, rel=1e-11)
    wanted = [72738.069653336, 21565.614083213, 177.088557920]
    np.testing.assert_allclose(gains.state_gain, wanted, rtol=1e-11)
    ahead = gains.preview_gain[np.array([1, 2, 10, 100, 320]) - 1]
    printed = [-618.5564, -777.4495, -1103.092, -229.1588, -5.041081]
    assert np.all(np.abs(ahead - printed) <= [5e-5, 5e-5, 5e-4, 5e-5, 5e-7])  # half a digit


def test_poles() -> None:
    """A pair as published, and twice the zero of the sampled cart, mirrored into stability.

    p = x − (z/g) ẍ under a jerk held for T has the zeros r and 1/r of
    (T²/6)(r² + 4r + 1) = (z/g)(r − 1)², 0.98280056 as published. (They tend to e^(±T√(g/z)), which
    is 0.98280077.) The small weight of jerk parts the two by 1.2e-5 along the imaginary axis.
    """
    found = np.linalg.eigvals(servo().closed_loop)
    pair = np.sort_complex(found[np.abs(found.imag) > 0.1])
    np.testing.assert_allclose(
        pair, [0.56737395 - 0.27241098j, 0.56737395 + 0.27241098j], atol=6e-9
    )
    squared = PERIOD**2 * GRAVITY / HEIGHT
    cosine = (1.0 + squared / 3.0) / (1.0 - squared / 6.0)
    zero = cosine - np.sqrt(cosine**2 - 1.0)
    assert zero == pytest.approx(0.98280056, abs=6e-9)
    rest = found[np.abs(found.imag) < 0.1]
    np.testing.assert_allclose(rest.real, zero, atol=1e-9)
    np.testing.assert_allclose(np.abs(rest.imag), 6.18e-6, atol=2e-8)


def test_the_cart_follows_steps() -> None:
    """A step of the reference to the side and back is seen ahead of time and followed to 1 cm."""
    reference = np.zeros(1200)
    reference[400:800] = 0.1
    states, zero_moment = servo().follow(reference)
    inside = np.r_[100:360, 440:760, 840:1100]
    assert np.abs(zero_moment - reference)[inside].max() < 0.01
    assert states[399, 0] > 0.02  # the mass moves before the foot
    still = servo().follow(np.full(50, 0.3))[0]
    np.testing.assert_allclose(still[:, 0], 0.3, atol=1e-9)


@pytest.mark.parametrize("options", [{"height": 0.0}, {"height": 1.0, "period": -1.0}])
def test_numbers_that_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(hs.ControllerError, match="must be a positive number"):
        preview_control(**options)  # type: ignore[arg-type]


def test_a_reference_that_is_refused() -> None:
    with pytest.raises(hs.ControllerError, match="array of finite numbers"):
        servo().follow([0.0, np.nan])
