"""Which of two interpolations a family returns: the cheaper one, unless it breaks a limit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait import design
from heelstrike.gait.margins import Margins

KEPT = Margins(
    normal_force=100.0, friction_use=0.5, zero_moment_point=0.0, clearance=0.01, joint_range=0.2,
    torque=10.0, peak_torque=50.0, impulse=5.0, impulse_friction_use=0.5, impulse_center=0.02,
    landing_velocity=-0.1, lift_velocity=0.1, touchdown_error=0.0, impact_error=0.0,
)  # fmt: skip


@dataclass(frozen=True)
class Mixture:
    """A gait between others."""

    spent: float
    margins: Margins


def between(monkeypatch: pytest.MonkeyPatch, linear: Mixture, cubic: Mixture | None) -> Any:
    """What a family of four speeds returns between them."""

    def mixed(request: Any, parts: Any) -> Mixture:
        if len(parts) == 2:
            return linear
        assert len(parts) == 4
        if cubic is None:
            raise GaitError("gait: cost must be a number")
        return cubic

    monkeypatch.setattr(design, "between", mixed)
    speeds = np.array([0.40, 0.45, 0.50, 0.55])
    gaits: Any = {(k,): f"gait {k}" for k in range(4)}
    asked = {"step_duration": 0.7}
    return hs.GaitFamily(hs.load_robot("bravo7"), {"speed": speeds}, asked, gaits, {}).at(
        speed=0.4875
    )


def test_the_cheaper_one_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    dear, cheap = Mixture(9.0, KEPT), Mixture(8.0, KEPT)
    assert between(monkeypatch, dear, cheap) is cheap
    assert between(monkeypatch, cheap, dear) is cheap


@pytest.mark.parametrize(
    "broken",
    [
        {"zero_moment_point": -0.034}, {"friction_use": 1.1}, {"normal_force": -1.0},
        {"clearance": -1e-3}, {"joint_range": -0.01}, {"torque": -1.0}, {"impulse": -1.0},
        {"impulse_friction_use": 1.2}, {"impulse_center": -0.01}, {"landing_velocity": 0.1},
        {"lift_velocity": -0.1},
    ],
)  # fmt: skip
def test_one_that_is_cheaper_by_breaking_a_limit_is_not(
    monkeypatch: pytest.MonkeyPatch, broken: dict[str, float]
) -> None:
    """Unless the linear one breaks it as much."""
    linear, cubic = Mixture(9.0, KEPT), Mixture(8.0, replace(KEPT, **broken))
    assert between(monkeypatch, linear, cubic) is linear
    assert between(monkeypatch, replace(linear, margins=cubic.margins), cubic) is cubic


def test_margins_that_are_kept_may_be_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    less = replace(KEPT, torque=1.0, zero_moment_point=-1e-12, friction_use=0.9)
    cubic = Mixture(8.0, less)
    assert between(monkeypatch, Mixture(9.0, KEPT), cubic) is cubic


def test_one_that_is_no_gait_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    linear = Mixture(9.0, KEPT)
    assert between(monkeypatch, linear, None) is linear
