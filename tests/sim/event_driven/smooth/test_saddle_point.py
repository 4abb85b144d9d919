"""Forces and motion at once: robots whose Delassus matrix does not tell the forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot import read_mjcf
from heelstrike.sim import EventKind, RunStatus

HALF = np.pi / 8.0
LIBRARY = Path(hs.__file__).parent / "robot" / "library"


def wheel(inertia: float) -> hs.Robot:
    """The library's rimless wheel with another moment of inertia about its hub."""
    text = (LIBRARY / "rimless_wheel.xml").read_text()
    given = 'diaginertia="1e-6 1e-6 1e-6"'
    assert text.count(given) == 1
    return read_mjcf(text.replace(given, f'diaginertia="{inertia} {inertia} {inertia}"'))


@pytest.mark.parametrize("inertia", [1e-9, 1e-12, 1e-14])
def test_a_wheel_without_inertia_rolls_as_the_closed_form_says(inertia: float) -> None:
    """Coleman 1998: what rolling over a spoke adds to the square of the speed, and an impact keeps.

    An inertia I about the hub changes the speed by about 0.3 I/(m r²) of it, and rtol = 1e-8 leaves
    1e-11 here. Once the impulses of 1e-14 kg m² cancelled to nothing, and it sank into the ground.
    """
    slope = 0.08
    gained = 4.0 * 9.81 * np.sin(HALF) * np.sin(slope)
    kept = np.cos(2.0 * HALF) ** 2
    rate = np.sqrt(gained * kept / (1.0 - kept))
    lean = slope - HALF
    run = hs.simulate(
        wheel(inertia),
        state=hs.State(
            [np.sin(lean), np.cos(lean), slope], [np.cos(lean) * rate, -np.sin(lean) * rate, rate]
        ),
        duration=2.2, method=hs.EventDriven(), ground=hs.Ground(slope=-slope, friction=0.8),
        stop_when_fallen=False,
    )  # fmt: skip
    assert run.status is RunStatus.COMPLETED, run.message
    downs = [event.time for event in run.events if event.kind is EventKind.TOUCHDOWN]
    assert len(downs) >= 2
    assert not [event for event in run.events if event.kind is EventKind.BRIDGE]
    for time in downs:
        after = run.velocity[np.searchsorted(run.time, time, side="right") - 1]
        assert after[2] == pytest.approx(rate, abs=inertia + 1e-11)
    assert run.certificates.penetration <= 1e-12
    assert run.certificates.complementarity <= 1e-9
    assert run.solver.failures == 0


def test_a_push_on_a_wheel_without_inertia_is_held_by_its_spokes() -> None:
    """A force F above the hub would turn it by 4e11 rad/s² if it were free.

    On two spokes it stays, and the moment about the ground shifts the load: m g/2 ± F h/d, where h
    is the height of the force and d the distance of the feet.
    """
    force, above = 1.0, 0.4
    run = hs.simulate(
        wheel(1e-12),
        state=hs.State([0.0, np.cos(HALF), 0.0], np.zeros(3)),
        duration=0.02, method=hs.EventDriven(), ground=hs.Ground(friction=0.8),
        pushes=[
            hs.Push("wheel", force=(force, 0.0), start=0.0, duration=1.0, point=(0.0, above))
        ],
        stop_when_fallen=False,
    )  # fmt: skip
    normal, tangent = run.contact_force[-1, :, 0], run.contact_force[-1, :, 1]
    shift = force * (np.cos(HALF) + above) / (2.0 * np.sin(HALF))
    pressed = np.sort(normal[normal > 0.0])
    np.testing.assert_allclose(pressed, [9.81 / 2.0 - shift, 9.81 / 2.0 + shift], rtol=1e-9)
    assert np.sum(tangent) == pytest.approx(-force, rel=1e-9)
    np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-9)


@pytest.mark.parametrize("inertia", [1e-10, 1e-12])
def test_a_wheel_without_inertia_slides_and_comes_to_rest_as_one_with_some(inertia: float) -> None:
    """Too slippery to roll: a spoke comes down while another slides, and both slide on."""
    rolling = [1.5 * np.cos(HALF), 1.5 * np.sin(HALF), 1.5]
    runs = [
        hs.simulate(
            wheel(about), state=hs.State([0.0, np.cos(HALF), 0.0], rolling), duration=0.6,
            method=hs.EventDriven(), ground=hs.Ground(friction=0.3), stop_when_fallen=False,
        )
        for about in (1e-7, inertia)
    ]  # fmt: skip
    assert runs[1].status is RunStatus.COMPLETED, runs[1].message
    assert [event.kind for event in runs[0].events] == [event.kind for event in runs[1].events]
    for event, other in zip(runs[0].events, runs[1].events, strict=True):
        # 1e-7 of inertia change the motion by as much, relatively.
        assert event.time == pytest.approx(other.time, abs=1e-6)
        np.testing.assert_allclose(event.impulse, other.impulse, atol=1e-6)
    np.testing.assert_allclose(runs[1].velocity[-1], 0.0, atol=1e-9)
