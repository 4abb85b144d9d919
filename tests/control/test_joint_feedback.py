"""Springs and dampers about a reference in time."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import pendulum

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback


def test_compiled_and_plain_forms_are_one_law() -> None:
    robot = walking.bravo7()
    rng = np.random.default_rng(0)
    position = 0.1 * rng.standard_normal((3, 6, 4))
    torque = rng.standard_normal((3, 6, 6))
    law = JointFeedback(robot, position, torque=torque, kp=300.0, kd=15.0, begins=[0.0, 0.05, 0.12])

    class Plain:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return law.torque(t, state, contacts)  # type: ignore[arg-type]

    start = walking.gait().initial_state
    runs = [
        hs.simulate(robot, controller, state=start, duration=0.2) for controller in (law, Plain())
    ]
    np.testing.assert_allclose(runs[0].torque, runs[1].torque, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(runs[0].position, runs[1].position, atol=1e-12)


def test_the_law_is_the_textbook_one() -> None:
    """Γ = Γ_ref + kp (q_ref − q) + kd (q̇_ref − q̇), with q_ref = 0.2 + 0.5 t, Γ_ref = 3."""
    robot = pendulum()
    law = JointFeedback(robot, [[[0.2, 0.5]]], torque=[3.0], kp=7.0, kd=2.0)
    torque = law.torque(0.4, hs.State([0.1], [-0.3]), None)  # type: ignore[arg-type]
    expected = 3.0 + 7.0 * (0.2 + 0.5 * 0.4 - 0.1) + 2.0 * (0.5 + 0.3)
    np.testing.assert_allclose(torque, [expected], rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"position": np.zeros((2, 6, 4))}, "polynomials"),
        ({"position": np.zeros(9)}, r"each of the 6 motors, .* has shape \(9,\)"),
        ({"position": np.zeros(6), "kp": [1.0, 2.0]}, "kp must be"),
        ({"position": np.zeros(6), "kd": np.nan}, "kd must be"),
        ({"position": np.zeros(6), "kd": [1.0, 1.0, np.inf, 1.0, 1.0, 1.0]}, "kd must be"),
    ],
)
def test_shapes_are_checked(options: dict[str, object], words: str) -> None:
    arguments = {"kp": 1.0, "kd": 1.0} | options
    with pytest.raises(hs.ControllerError, match=words):
        JointFeedback(walking.bravo7(), **arguments)  # type: ignore[arg-type]
