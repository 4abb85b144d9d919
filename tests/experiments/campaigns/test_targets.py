"""What parameters change: numbers of robot, ground, push, start, law, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import campaign_cases as cases
import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.experiments.campaigns.targets import laid
from heelstrike.robot.model import NUMBERS


def others(**known: str) -> set[str]:
    return set(NUMBERS) - set(known)


def test_numbers_of_the_robot() -> None:
    trial = cases.walks()
    before = trial.robot.model
    lane = laid(
        trial,
        {"robot.mass.trunk *": 1.5, "robot.mass.left_foot *": 0.5, "robot.damping +": 0.25,
         "robot.torque_upper.right_knee": 40.0, "robot.friction_scale.left_foot_toe": 0.5},
        0,
    )  # fmt: skip
    after = lane.robot.model
    mass = before.mass.copy()
    mass[2] *= 1.5
    mass[8] *= 0.5
    np.testing.assert_array_equal(after.mass, mass)
    np.testing.assert_array_equal(after.damping, before.damping + 0.25)
    assert after.torque_upper[1] == 40.0
    assert after.friction_scale.tolist() == [1.0, 1.0, 1.0, 0.5]
    changed = {"mass", "damping", "torque_upper", "friction_scale"}
    for name in set(NUMBERS) - changed:
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name), err_msg=name)
    assert trial.robot.model is before
    assert lane.controller is trial.controller  # which knows the robot as it was
    assert lane.state is trial.state


def test_a_longer_shank_lifts_the_robot_by_what_it_is_longer() -> None:
    trial = cases.limp()
    lane = laid(trial, {"robot.length.left_shank *": 1.1, "robot.length.right_shank *": 1.1}, 0)
    assert lane.robot.model.offset[5, 1] == pytest.approx(-0.4428 * 1.1, abs=1e-15)
    for link in (4, 7):
        np.testing.assert_allclose(
            lane.robot.model.center_of_mass[link], 1.1 * trial.robot.model.center_of_mass[link]
        )
    raised = lane.state.q - trial.state.q
    assert raised[1] == pytest.approx(0.04428, abs=1e-12)  # legs are straight as it stands
    np.testing.assert_array_equal(np.delete(raised, 1), 0.0)


def test_the_start() -> None:
    trial = cases.limp()
    lane = laid(trial, {"state.v.root_x": 0.3, "state.q.left_knee +": 0.2}, 0)
    assert lane.state.v[0] == 0.3
    assert lane.state.q[7] == trial.state.q[7] + 0.2
    gap = hs.contact_kinematics(lane.robot, lane.state.q, lane.state.v, lane.ground).gap
    assert gap.min() == pytest.approx(0.0, abs=1e-12)


def test_ground_is_other_beyond_the_edge() -> None:
    trial = cases.walks()
    edge = trial.edge
    lane = laid(trial, {"ground.slope": 0.1, "ground.roughness": 0.01, "ground.friction *": 0.5}, 7)
    x = np.linspace(edge - 2.0, edge + 6.0, 400)
    height = np.array([lane.ground.height(each) for each in x])
    slope = np.tan(0.1) * np.maximum(x - edge, 0.0)
    assert np.abs(height - slope).max() <= 0.01
    assert np.abs(height - slope)[x > edge + 1.0].max() > 0.005
    np.testing.assert_array_equal(height[x <= edge], 0.0)
    assert set(lane.ground.model().friction.tolist()) == {0.375}
    again = laid(trial, {"ground.slope": 0.1, "ground.roughness": 0.01}, 8).ground
    assert not np.array_equal(again.model().vertices, lane.ground.model().vertices)


def test_a_push_has_the_impulse_that_was_asked_for() -> None:
    trial = cases.walks()
    (push,) = laid(trial, {"push.impulse": 30.0, "push.angle": math.pi / 6}, 0).pushes
    assert push.duration == 0.1
    assert push.start == trial.begins
    np.testing.assert_allclose(
        np.array(push.force) * push.duration, [30.0 * math.sqrt(0.75), 15.0], atol=1e-12
    )
    assert laid(trial, {"push.impulse": 0.0}, 0).pushes == ()
    (other,) = laid(trial, {"push.impulse.left_shank": 1.0, "push.start": 0.5}, 0).pushes
    assert (other.link, other.start) == ("left_shank", 0.5)


def test_numbers_of_the_law_and_what_stands_around_it() -> None:
    trial = cases.walks()
    lane = laid(trial, {"controller.kp *": 2.0, "controller.kd.1": 3.0}, 0)
    before, after = trial.controller.parameters, lane.controller.parameters
    np.testing.assert_array_equal(after.kp, 2.0 * before.kp)
    assert after.kd[1] == 3.0
    np.testing.assert_array_equal(np.delete(after.kd, 1), np.delete(before.kd, 1))
    late = laid(trial, {"actuators.delay": 0.0024, "sensors.encoder_noise": 1e-3}, 4).controller
    assert isinstance(late, hs.Actuated)
    assert late.delay == 0.002  # whole periods of 1 ms
    assert isinstance(late.inside, hs.Sensed)
    assert late.inside.encoders.noise == 1e-3


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("mass.trunk", 1.0, "no parameter 'mass.trunk'"),
        ("grund.friction", 1.0, "Did you mean 'ground'"),
        ("robot.mas.trunk", 1.0, "no number 'mas'. Did you mean 'mass'"),
        ("robot.mass.trunc", 1.0, "Did you mean 'trunk'"),
        ("robot.mass.trunk", -1.0, "between 0 and inf"),
        ("robot.parent", 1.0, "no number 'parent'"),
        ("robot.length.trunk", 1.0, r"write 'robot.length.trunk \*'"),
        ("ground.fricton", 1.0, "Did you mean 'friction'"),
        ("ground.friction", -1.0, "friction"),
        ("ground.slope", 1.6, "π/2"),
        ("push.impuls", 1.0, "Did you mean 'impulse'"),
        ("push.duration", 0.0, None),
        ("state.a.left_knee", 1.0, "q and v"),
        ("state.q.left_kne", 1.0, "left_kne"),
        ("controller.kq", 1.0, "no number 'kq'"),
        ("sensors.noise", 1.0, "no 'noise'"),
        ("actuators.delay *", 1.0, "to set"),
        ("actuators.efficiency", 1.5, "efficiency"),
    ],
)
def test_what_there_is_not_is_refused(name: str, value: float, words: str | None) -> None:
    if words is None:
        assert laid(cases.walks(), {name: value}, 0).pushes == ()
        return
    with pytest.raises(hs.HeelstrikeError, match=words):
        laid(cases.walks(), {name: value}, 0)


def test_a_controller_in_python_has_no_numbers() -> None:
    class Own:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.zeros(6)

    trial = replace(cases.limp(), controller=Own())
    with pytest.raises(hs.SimulationError, match="Own has none"):
        laid(trial, {"controller.kp": 1.0}, 0)
    assert walking.bravo7() is trial.robot
