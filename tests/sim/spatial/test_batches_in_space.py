"""Many simulations in space at once: each is what it is alone, to the last bit."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.control.policy.network import Layer, Network
from heelstrike.errors import SimulationError
from heelstrike.sim.spatial.run import RECORDED

TRUNK = (
    "<body name='trunk' pos='0 0 0.75'><freejoint/><geom type='sphere' size='0.1' mass='5'/>"
    "{left}{right}</body>"
)
LEG = (
    "<body name='{side}' pos='0 {y} 0'><joint name='{side}_hip' axis='0 1 0' range='-1 1' "
    "limited='true'/><geom type='box' pos='0 0 -0.7' size='0.1 0.05 0.05' mass='1'/></body>"
)
MOTORS = (
    "<actuator><motor name='left' joint='left_hip'/><motor name='right' joint='right_hip'/>"
    "</actuator>"
)
FORCES = (0.0, 8.0, -12.0, 300.0)
"""Of the pushes of the lanes; by the last one it falls."""


@pytest.fixture
def robot(made: Maker) -> hs.SpatialRobot:
    legs = {side: LEG.format(side=side, y=y) for side, y in (("left", 0.15), ("right", -0.15))}
    return made(TRUNK.format(**legs), MOTORS)


def lanes_of(robot: hs.SpatialRobot) -> list[dict[str, Any]]:
    """What the lanes are: pushes, friction and velocity differ."""
    return [
        {
            "state": robot.state(velocity={"trunk_vx": 0.02 * i}),
            "pushes": (hs.Push("trunk", force=(force, 5.0, 0.0), start=0.1, duration=0.1),),
            "ground": hs.SpatialGround(friction=0.4 + 0.1 * i),
        }
        for i, force in enumerate(FORCES)
    ]


def columns(each: list[dict[str, Any]]) -> dict[str, list[Any]]:
    return {name: [lane[name] for lane in each] for name in each[0]}


def law_for(robot: hs.SpatialRobot) -> hs.HoldPosture:
    return hs.HoldPosture(robot, kp=400.0, kd=8.0)


@pytest.mark.parametrize("threads", [1, 2])
def test_runs_are_those_that_are_simulated_alone(robot: hs.SpatialRobot, threads: int) -> None:
    lanes = lanes_of(robot)
    law = law_for(robot)
    batch = hs.simulate_batch(
        robot, law, duration=0.8, record_every=5, threads=threads, **columns(lanes)
    )
    assert batch.completed.tolist() == [True, True, True, False]
    assert batch.status[3] is hs.RunStatus.FELL
    assert "fell" in batch.message[3]
    for i, lane in enumerate(lanes):
        alone, run = hs.simulate(robot, law, duration=0.8, record_every=5, **lane), batch.run(i)
        for name in ("time", *RECORDED):
            assert np.array_equal(getattr(run, name), getattr(alone, name)), name
        assert run.events == alone.events
        assert run.certificates == alone.certificates
        assert run.solver == alone.solver
        assert batch.residual[i] == alone.certificates.residual
        assert batch.steps[i] == alone.steps
        assert batch.solves[i] == alone.solver.solves
        simulation = hs.Simulation(robot, law, **lane)
        simulation.advance(0.8)
        assert np.array_equal(batch.position[i], simulation.state.q)
        assert np.array_equal(batch.velocity[i], simulation.state.v)
        assert batch.time[i] == simulation.time


def test_lanes_that_stay_move_as_simulations_do(robot: hs.SpatialRobot) -> None:
    lanes, law = lanes_of(robot), law_for(robot)
    batch = hs.Batch(robot, law, threads=2, **columns(lanes))
    alone = [hs.Simulation(robot, law, **lane) for lane in lanes]
    for until in (0.05, 0.3, 0.8):
        batch.advance(until)
        for each in alone:
            if each.status is hs.RunStatus.COMPLETED:
                each.advance(until)
        for i, each in enumerate(alone):
            assert np.array_equal(batch.position[i], each.state.q)
            assert np.array_equal(batch.velocity[i], each.state.v)
            assert batch.time[i] == each.time
    assert batch.going.tolist() == [True, True, True, False]
    assert batch.status[3] is hs.RunStatus.FELL
    assert batch.message(3) == alone[3].message
    batch.reset(np.array([False, False, False, True]))
    batch.step(20)
    again = hs.simulate(robot, law, duration=0.02, **lanes[3])
    assert np.array_equal(batch.position[3], again.position[-1])
    batch.close()


def test_snapshots_of_lanes_are_those_of_simulations(robot: hs.SpatialRobot) -> None:
    lanes, law = lanes_of(robot)[:2], law_for(robot)
    batch = hs.Batch(robot, law, **columns(lanes))
    batch.advance(0.15)
    kept = batch.snapshot()
    batch.advance(0.4)
    there = batch.position.copy()
    batch.restore(kept)
    batch.advance(0.4)
    assert np.array_equal(batch.position, there)
    one = hs.Simulation(robot, law, state=kept[1], record_every=2**62)
    one.advance(0.4)
    assert np.array_equal(one.state.q, there[1])


def test_a_lane_is_laid_anew(robot: hs.SpatialRobot) -> None:
    lanes, law = lanes_of(robot), law_for(robot)
    batch = hs.Batch(robot, law, state=lanes[0]["state"], lanes=2)
    batch.step(10)
    batch.lay(1, **{name: lanes[1][name] for name in ("state", "pushes", "ground")})
    batch.step(150)
    alone = hs.simulate(robot, law, duration=0.15, **lanes[1])
    assert np.array_equal(batch.position[1], alone.position[-1])


def test_quaternions_of_states_are_made_unit(robot: hs.SpatialRobot) -> None:
    batch = hs.Batch(robot, None, state=robot.reference_state(), lanes=2)
    begin = robot.reference_state()
    q = np.tile(begin.q, (2, 1))
    q[:, 3:7] *= 1.0 + 1e-8
    batch.reset(state=hs.State(q, np.zeros((2, robot.nv))))
    assert np.linalg.norm(batch.position[:, 3:7], axis=1) == pytest.approx(1.0, abs=1e-15)
    q[1, 3:7] *= 2.0
    with pytest.raises(hs.RobotError, match="run 1: the quaternion"):
        batch.reset(state=hs.State(q, np.zeros((2, robot.nv))))


def test_torques_are_commanded_from_outside(robot: hs.SpatialRobot) -> None:
    batch = hs.Batch(robot, hs.HeldTorque(robot), state=robot.reference_state(), lanes=2)
    batch.command[:] = [[1.0, -1.0], [0.5, 0.5]]
    batch.step(30)
    assert np.array_equal(batch.torque, batch.command)
    alone = hs.simulate(
        robot, hs.HeldTorque(robot, [1.0, -1.0]), state=robot.reference_state(), duration=0.03
    )
    assert np.array_equal(batch.position[0], alone.position[-1])


def test_robots_of_the_plane_and_of_space_do_not_mix(robot: hs.SpatialRobot) -> None:
    flat = hs.load_robot("compass_gait")
    with pytest.raises(SimulationError, match="all in the plane or all in space"):
        hs.Batch([robot, flat], state=robot.reference_state())


def policy_of(robot: hs.SpatialRobot) -> Network:
    rng = np.random.default_rng(4)
    observed = robot.nq + robot.nv - 2
    layers = (
        Layer(0.3 * rng.normal(size=(8, observed)), rng.normal(size=8), activation="tanh"),
        Layer(0.3 * rng.normal(size=(2, 8)), np.zeros(2)),
    )
    return Network(
        layers, mean=np.zeros(observed), deviation=np.ones(observed), gear=np.full(2, 5.0),
        period=0.02, skipped=2,
    )  # fmt: skip


def test_a_policy_decides_at_its_own_rate(robot: hs.SpatialRobot) -> None:
    """What NumPy says of the network, every 20 ms, is what acts."""
    network = policy_of(robot)
    run = hs.simulate(robot, hs.Policy(network, robot), state=robot.reference_state(), duration=0.2)
    first, last = network.layers
    for row in range(0, 200, 20):
        seen = np.r_[run.position[row, 2:], run.velocity[row]]
        x = np.clip(seen, -network.observation_limit, network.observation_limit)
        action = last.weight @ np.tanh(first.weight @ x + first.bias) + last.bias
        wanted = 5.0 * np.clip(action, -1.0, 1.0)
        assert run.torque[row : row + 20] == pytest.approx(np.tile(wanted, (20, 1)), abs=1e-12)


def test_the_lock_is_released_while_lanes_move(robot: hs.SpatialRobot) -> None:
    """Python goes on in this thread while another one is in the loop: it counts."""
    batch = hs.Batch(robot, law_for(robot), state=robot.reference_state(), lanes=8)
    batch.step(2)
    begun, over = threading.Event(), threading.Event()

    def move() -> None:
        begun.set()
        batch.step(4000)
        over.set()

    thread = threading.Thread(target=move)
    thread.start()
    begun.wait()
    counted = 0
    while not over.is_set():
        time.sleep(1e-4)
        counted += 1
    thread.join()
    assert counted > 1


ROOT = (
    "<body name='root' pos='0 0 0.1'><freejoint/><geom type='sphere' size='0.1' mass='2'/>"
    "{limbs}</body>"
)
LIMB = (
    "<body name='l{i}' pos='0.25 {y} 0'><joint name='j{i}' axis='0 0 1'/>"
    "<geom type='sphere' size='0.1' mass='1'/>{more}</body>"
)


@pytest.fixture
def unlike(made: Maker) -> dict[str, hs.SpatialRobot]:
    """Three limbs on a body, and in a row: as many rows, but chains of other lengths."""
    motors = "".join(f"<motor name='m{i}' joint='j{i}'/>" for i in range(3))
    after = f"<actuator>{motors}</actuator>"
    star = "".join(LIMB.format(i=i, y=0.25 * (i - 1), more="") for i in range(3))
    serial = ""
    for i in (2, 1, 0):
        serial = LIMB.format(i=i, y=0, more=serial)
    return {
        "star": made(ROOT.format(limbs=star), after),
        "serial": made(ROOT.format(limbs=serial), after),
    }


@pytest.mark.parametrize("order", [("star", "serial"), ("serial", "star")])
def test_chains_of_other_lengths_have_room(
    unlike: dict[str, hs.SpatialRobot], order: tuple[str, str]
) -> None:
    robots = [unlike[name] for name in order]
    assert {robot.model.longest for robot in robots} == {7, 9}
    v = np.r_[0.5, 0.2, 0.0, 0.0, 0.0, 0.4, 1.0, -2.0, 1.5]
    states = [hs.State(robot.reference_state().q, v) for robot in robots]
    batch = hs.simulate_batch(robots, state=states, duration=0.1, threads=1)
    for i, (robot, state) in enumerate(zip(robots, states, strict=True)):
        alone = hs.simulate(robot, state=state, duration=0.1)
        assert batch.completed[i]
        assert np.array_equal(batch.position[i], alone.position[-1])


BOX = hs.Box(center=(3.0, 0.0, 0.1), size=(1.0, 1.0, 0.2))


def test_grounds_that_do_not_lie_in_columns_are_not_blamed_on_robots(
    robot: hs.SpatialRobot,
) -> None:
    for boxes in ((), (BOX,)), ((BOX,), ()):
        grounds = [hs.SpatialGround(boxes=each) for each in boxes]
        with pytest.raises(SimulationError, match="the grounds of a batch must all have boxes"):
            hs.Batch(robot, state=robot.reference_state(), ground=grounds)


def test_a_lane_that_starts_again_is_given_no_ground_without_room(robot: hs.SpatialRobot) -> None:
    batch = hs.Batch(robot, state=robot.reference_state(), lanes=2)
    with pytest.raises(SimulationError, match="this ground has boxes"):
        batch._renew(0, ground=hs.SpatialGround(boxes=(BOX,)))
    batch.advance(0.01)
    assert batch.going.all()
    batch.close()
