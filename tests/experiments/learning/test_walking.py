"""Walk-v0: a motion that is followed, named rewards, what is drawn again, policies in the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.control.policy.network import Layer, Network, load_network
from heelstrike.control.policy.reference import HeldAction, Reference
from heelstrike.experiments.learning.courses import named_task, told_task
from heelstrike.experiments.learning.ranges import Ranges
from heelstrike.experiments.learning.walk_task import WalkTask
from heelstrike.experiments.learning.walking import TERMS, WalkingCourse

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

WALK = WalkTask(speeds=(0.43, 0.43), gaits=1)
STANDS = WalkTask(reference="posture", frame_skip=4)


def begun(task: WalkTask, lanes: int = 1, seed: int = 0) -> WalkingCourse:
    course = WalkingCourse(task, lanes)
    for lane in range(lanes):
        course.seed(lane, np.random.default_rng([seed, lane]))
    course.begin(np.arange(lanes))
    return course


def at(reference: Reference, phase: float) -> Any:
    """Interpolate the motion of the first speed, by NumPy."""
    motion = np.vstack((reference.motion[0], reference.motion[0, :1]))
    places = np.arange(len(motion)) / (len(motion) - 1)
    return np.array([np.interp(phase % 1.0, places, each) for each in motion.T])


def test_actions_of_zero_follow_the_gait_and_every_term_is_as_it_says() -> None:
    course, lanes = begun(WALK, 2), 2
    robot, reference = course.robot, course.motion
    assert reference.speed[0] == pytest.approx(0.43, abs=0.005)
    stride = reference.stride[0]
    batch, nq = course.batch, robot.nq
    phase = course._next_phase.copy()
    for _ in range(20):
        before = batch.position[:, 0].copy()
        action = np.full((lanes, robot.nu), 0.01)
        course.step(action)
        phase += WALK.decision_period / stride
    told = dict(zip(TERMS, course.terms.T, strict=True))
    for lane in range(lanes):
        wanted = at(reference, phase[lane])
        q, v = batch.position[lane], batch.velocity[lane]
        observed = np.concatenate((q[2:] - wanted[2:nq], v - wanted[nq : 2 * nq]))
        turn = 2.0 * np.pi * phase[lane]
        observed = np.concatenate((observed, (0.43, np.sin(turn), np.cos(turn))))
        np.testing.assert_allclose(course.observation[lane], observed, atol=1e-9)
        joints = robot.model.actuator_joint
        off = np.mean((q - wanted[:nq])[joints] ** 2)
        speed = (q[0] - before[lane]) / WALK.decision_period
        effort = np.mean((batch.torque[lane] / (robot.weight * robot.reference_state().q[1])) ** 2)
        terms = {
            "reward_alive": 0.5,
            "reward_speed": np.exp(-(((speed - wanted[nq]) / 0.2) ** 2)),
            "reward_joints": 0.5 * np.exp(-off / 0.2**2),
            "reward_upright": 0.5 * np.exp(-(((q[2] - wanted[2]) / 0.2) ** 2)),
            "reward_effort": -0.05 * effort,
            "reward_action": -0.05 * 1e-4,
        }
        for name, value in terms.items():
            assert told[name][lane] == pytest.approx(value, abs=1e-9), name
        assert course.reward[lane] == pytest.approx(sum(terms.values()), abs=1e-9)
        assert off < 0.05**2  # it does follow
    assert not course.terminated.any()


def test_a_policy_in_the_loop_does_what_it_does_in_the_course(tmp_path: Any) -> None:
    course = begun(replace(WALK, reset_noise_scale=0.0))
    robot, reference = course.robot, course.motion
    random = np.random.default_rng(3)
    size, nu = course.observation.shape[1], robot.nu
    layer = Layer(random.normal(0.0, 0.3, (nu, size)), random.normal(0.0, 0.05, nu))
    network = course.network((layer,), np.zeros(size), np.ones(size), about=course.task.about)
    loaded = load_network(network.save(tmp_path / "policy.npz"))
    assert told_task(loaded.about) == course.task
    for name, value in vars(reference).items():
        np.testing.assert_array_equal(getattr(loaded.reference, name), value)
    policy = hs.Policy(loaded, robot, speed=0.43, phase=float(course._next_phase[0]))
    state = course.state_of(0)
    begin = hs.State(state.q.copy(), state.v.copy())
    decisions = 25
    run = hs.simulate(
        robot, policy, state=begin, duration=decisions * WALK.decision_period,
        method=hs.TimeStepping(step=WALK.step), ground=hs.Ground(friction=WALK.friction),
        stop_when_fallen=False,
    )  # fmt: skip
    for decision in range(decisions):
        np.testing.assert_allclose(
            run.position[decision * WALK.frame_skip], course.batch.position[0], atol=1e-9
        )
        course.step(network.act(course.observation, network.begin()))
    assert np.ptp(run.torque[:, 0]) > 1.0
    with pytest.raises(hs.ControllerError, match="observes"):
        hs.Policy(loaded, hs.load_robot("rabbit"))
    plain = Network((layer,), 0.01, np.ones(nu), np.zeros(size), np.ones(size))
    with pytest.raises(hs.ControllerError, match="no speed to set"):
        hs.Policy(plain, speed=0.3)


def test_lanes_are_simulations_of_what_was_drawn() -> None:
    """Ground, pushes, masses and delays of a second episode, to the last bit."""
    ranges = Ranges(
        friction=(0.3, 1.0), mass=(0.8, 1.2), push=(5.0, 20.0), push_period=(0.03, 0.05),
        delay=(0.0, 0.004), roughness=(0.0, 0.01),
    )  # fmt: skip
    for each in (ranges, replace(ranges, mass=None, delay=None, roughness=None)):
        task = replace(STANDS, randomise=each, max_episode_steps=30)
        course, lanes = begun(task, 3), 3
        random = np.random.default_rng(1)
        course.step(random.uniform(-1.0, 1.0, (lanes, course.robot.nu)))
        course.begin(np.arange(lanes))  # on other ground, with other pushes
        batch = course.batch
        drawn = [batch.lane(lane) for lane in range(lanes)]
        assert len({lane.ground.friction for lane in drawn}) == lanes
        singles = [
            hs.Simulation(
                lane.robot, HeldAction(course.motion, course.gear),
                state=hs.State(batch.position[i].copy(), batch.velocity[i].copy()),
                method=hs.TimeStepping(step=task.step), ground=lane.ground,
                pushes=batch._plans[i].setting.pushes, stop_when_fallen=False,
            )
            for i, lane in enumerate(drawn)
        ]  # fmt: skip
        held: list[Any] = [
            np.append(np.zeros(course.robot.nu), batch.command[i, -3:]) for i in range(3)
        ]
        for _ in range(12):
            action = random.uniform(-1.0, 1.0, (lanes, course.robot.nu))
            phase = course._next_phase.copy()
            course.step(action)
            for i, single in enumerate(singles):
                new = np.concatenate((action[i], (task.speeds[0], phase[i], single.time)))
                new[-3] = course._speed[i]
                for step in range(task.frame_skip):
                    if step == course._delay[i]:
                        held[i] = new
                    single.parameters.command[:] = held[i]
                    single.step()
                if course._delay[i] == task.frame_skip:
                    held[i] = new
                np.testing.assert_array_equal(single.state.q, batch.position[i])
        if each.mass is not None:
            own = course.robot.model.mass > 0.0
            factors = [lane.robot.model.mass[own] / course.robot.model.mass[own] for lane in drawn]
            assert all(0.8 <= factor.min() < factor.max() <= 1.2 for factor in factors)


def test_episodes_are_drawn_by_the_seed_alone() -> None:
    task = replace(STANDS, randomise={"friction": (0.2, 1.0), "push": (5.0, 10.0)},
                   command_period=0.02)  # fmt: skip
    first, again, other = (begun(task, 2, seed) for seed in (0, 0, 1))
    for course in (first, again, other):
        for _ in range(8):
            course.step(np.zeros((2, course.robot.nu)))
    np.testing.assert_array_equal(first.observation, again.observation)
    assert (first.observation != other.observation).any()
    assert first._speed[0] != first._speed[1]
    before = first._speed.copy()
    for _ in range(5):  # 0.02 s are five decisions
        first.step(np.zeros((2, first.robot.nu)))
    assert (first._speed != before).all()
    np.testing.assert_array_equal(first.observation[:, -3], first._speed)


def test_a_fall_ends_an_episode_and_says_so() -> None:
    course = begun(STANDS)
    q = course.robot.reference_state().q.copy()
    for place, value, words in ((1, 0.5, "over the ground"), (2, 0.9, "pitch")):
        bad = q.copy()
        bad[place] = value
        course.batch.reset(None, hs.State(bad, np.zeros(course.robot.nv)))
        course._assess(np.arange(1))
        assert course.terminated[0]
        assert words in course.cause(0)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"speeds": (0.6, 0.2)}, "speeds"), ({"gaits": 0}, "gaits"), ({"step": 0.0}, "step"),
        ({"reference": "nothing"}, "reference"), ({"randomise": {"wind": (0, 1)}}, "by name"),
        ({"randomise": {"mass": (0.0, 1.0)}}, "mass"), ({"randomise": {"push": 3.0}}, "push"),
        ({"file": "compass_gait", "reference": "posture"}, "cannot learn to walk"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(fields: Any, words: str) -> None:
    with pytest.raises(hs.SimulationError, match=words):
        WalkTask(**fields).motion()


def test_lanes_are_commanded_with_as_many_numbers() -> None:
    motion = STANDS.motion()
    robot = STANDS.robot()
    law = HeldAction(motion, np.ones(robot.nu))
    state = robot.reference_state()
    batch = hs.Batch(robot, law, state=state, lanes=2)
    assert batch.command.shape == (2, robot.nu + 3)
    with pytest.raises(hs.SimulationError, match="equally many commands"):
        batch.lay(1, controller=hs.HeldTorque(robot))
    with pytest.raises(hs.SimulationError, match="equally many commands"):
        hs.Batch(robot, [law, hs.HeldTorque(robot)], state=state)


def test_names() -> None:
    assert isinstance(named_task("Walk", gaits=2), WalkTask)
    with pytest.raises(ValueError, match="has the fields"):
        named_task("Walk", colour="red")
    with pytest.raises(hs.SimulationError, match=r"about\.task"):
        told_task({})
    with pytest.raises(hs.SimulationError, match="does not say"):
        told_task({"task": "walk", "walk": "{}"})
