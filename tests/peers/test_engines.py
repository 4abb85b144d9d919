"""Each engine has our robot, contacts and law of control; who has not, is refused.

Engines that are not installed are left out (``pip install heelstrike[peers]`` brings them). All of
them integrate as our time stepping does, velocity first; what they treat otherwise are dampers and
springs, explicitly or implicitly, which are differences of first order in the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from speed import scenarios

from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.dynamics import contact_positions
from heelstrike.experiments.engines import (
    Engine,
    InvalidRunError,
    Scenario,
    check_flight,
    compared,
    packages,
    peer,
    peers,
    simulators,
)
from heelstrike.experiments.engines.packages import PACKAGES, PARTS_OF_STEPS
from heelstrike.experiments.engines.peer import flight
from heelstrike.experiments.engines.served import engine_process, served
from heelstrike.robot import State, load_robot
from heelstrike.sim import TimeStepping

STEP = 1e-3

SIMULATORS = [
    name for name, package in PACKAGES.items() if package.adapter and name not in PARTS_OF_STEPS
]
RACED = [name for name in SIMULATORS if PACKAGES[name].raced]


FLIGHT = {"ode": 1e-3, "siconos": 1e-3, "simbody": 1e-3, "physx": 1e-4, "newton": 1e-4}
"""How far (m, rad) engines fly from ours that step otherwise, or in single precision: link by link
where joints hold it together (ODE), by the mean of two velocities (Siconos), in an order of its own
(Simbody). Half a step of 1 ms over 0.1 s is 5e-4 at 10 m/s² or rad/s²."""


def engine_called(name: str) -> Engine:
    state = peers(load=False)[name]
    if not compared({name: state}):
        pytest.skip(f"{PACKAGES[name].title} is {state}")
    return simulators([name])[name]


@pytest.fixture(params=SIMULATORS)
def engine(request: pytest.FixtureRequest) -> Engine:
    return engine_called(request.param)


@pytest.fixture(params=RACED)
def raced(request: pytest.FixtureRequest) -> Engine:
    """Engines with laws of control of their own, beside which ours is timed."""
    return engine_called(request.param)


@contextmanager
def refusals() -> Iterator[None]:
    """Skip what an engine is not handed over, with its reason."""
    try:
        yield
    except InvalidRunError as error:
        if "is not given" not in str(error):
            raise
        pytest.skip(str(error))


def test_a_robot_flies_as_ours(engine: Engine, request: pytest.FixtureRequest) -> None:
    # Without dampers there is nothing to treat otherwise: round-off alone, some 1e-15 a step.
    name = request.node.callspec.params["engine"]
    assert check_flight(engine, load_robot("bravo7")) <= FLIGHT.get(name, 1e-12)


def test_forces_are_on_the_point_that_touches(engine: Engine) -> None:
    """The toe of the left foot is 1 mm in the ground, all other points are 30 mm and more above it.

    Only that point may have a force, upwards, and backward where it slides forward.
    """
    robot = load_robot("bravo7")
    q = robot.reference_state().q.copy()
    q[robot.joint_index("left_ankle")] = 0.3
    q[robot.joint_index("right_hip")] = -0.5
    lowest = contact_positions(robot, q)[:, 1]
    toe = int(np.argmin(lowest))
    assert robot.contact_names[toe].startswith("left")
    assert np.delete(lowest - lowest[toe], toe).min() > 0.03
    q[1] -= lowest[toe] + 1e-3
    v = np.zeros(robot.nv)
    v[0] = 1.0
    there = engine.peer(Scenario("one toe", robot, State(q, v), 0.01), STEP)
    there.restart()
    there.hold(np.zeros(robot.nu))
    rows = there.record(3)
    there.close()
    forces = rows[:, robot.nq + robot.nv :].reshape(3, robot.nc, 2)
    normal, tangent = forces[:, toe].T
    assert normal.max() > 10.0  # it may leave the ground after the first step
    assert normal.min() >= 0.0
    assert np.abs(np.delete(forces, toe, axis=1)).max() == 0.0
    if there.tells_friction:
        assert tangent.min() < -1.0
        assert np.all(np.abs(tangent) <= 0.75 * normal * (1.0 + 1e-6) + 1e-6)


def test_a_robot_with_dampers_flies_as_ours(engine: Engine, request: pytest.FixtureRequest) -> None:
    # 0.1 N m s/rad on links of 0.03 kg m² and up: the speeds of 1 rad/s change by 3 rad/s²; half a
    # step of that, for 0.1 s, is 1.5e-4 rad.
    name = request.node.callspec.params["engine"]
    allowed = 1.5e-4 + FLIGHT.get(name, 0.0)
    with refusals():
        assert check_flight(engine, load_robot("walker2d")) <= allowed


def test_a_process_has_one_scenario_after_another(
    engine: Engine, request: pytest.FixtureRequest
) -> None:
    """What an engine leaves behind of a robot that stood does nothing to the next."""
    name = request.node.callspec.params["engine"]
    robot = load_robot("bravo7")
    scenario = Scenario("standing", robot, robot.reference_state(), 0.02)
    process = engine_process(name)
    rows = []
    try:
        for _ in range(2):
            there = served(name, scenario, STEP, process=process)
            there.restart()
            rows.append(there.record(20))
    finally:
        process.end()
    assert rows[0][:, robot.nq + robot.nv :].any()
    np.testing.assert_allclose(rows[0], rows[1], rtol=1e-9, atol=1e-9)


def test_another_robot_is_refused(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot("bravo7")
    heavier = replace(robot, model=robot.model.replaced(inertia=2.0 * robot.model.inertia))
    wrong = replace(
        engine, peer=lambda scenario, step: engine.peer(replace(scenario, robot=heavier), step)
    )
    monkeypatch.setattr(peer, "FLIGHT_ERROR", 1e-6)
    with pytest.raises(InvalidRunError, match="in free flight"):
        check_flight(wrong, robot)


def test_the_law_of_control_is_ours(raced: Engine) -> None:
    """In flight, so that nothing else matters, with commands that change and jump.

    The torque, of up to 40 N m, moves links of 0.02 to 0.15 kg m² by up to 1e3 rad/s²; springs of
    300 N m/rad and dampers of 15 N m s/rad, treated implicitly by some, change it by a share of
    h kd / I, so the joints differ by a few 1e-2 at h = 1 ms and by a tenth of that at h = 0.1 ms.
    """
    robot = load_robot("bravo7")
    start = flight(robot)
    rest = start.state.q[robot.model.actuator_joint]
    pieces = np.zeros((2, robot.nu, 2))
    pieces[0, :, 0] = rest
    pieces[0, :, 1] = 0.5
    pieces[1, :, 0] = rest - 0.05
    law = JointFeedback(robot, pieces, torque=2.0, kp=300.0, kd=15.0, begins=(0.0, 0.06))
    scenario = replace(start, feedback=law)
    errors = []
    for step in (1e-3, 1e-4):
        there = raced.peer(scenario, step)
        there.run()
        ours = scenario.run(TimeStepping(step=step)).position[-1]
        moved = np.abs(ours - start.run(TimeStepping(step=step)).position[-1]).max()
        errors.append(np.abs(there.state().q - ours).max())
    assert moved > 0.05  # it does something
    assert errors[0] <= 2e-2
    assert errors[1] <= 0.2 * errors[0] or errors[1] <= 1e-9


@pytest.mark.parametrize("name", ["bravo7", "walker2d"])
def test_it_stands_on_four_contacts_that_carry_its_weight(raced: Engine, name: str) -> None:
    scenario = scenarios.standing(name, duration=0.5)
    there = raced.peer(scenario, STEP)
    there.settle(there.settling)
    found = there.check()  # raises if it does not
    assert found["active_contacts"] == pytest.approx(4.0, abs=0.04)
    assert found["weight_carried"] == pytest.approx(1.0, abs=1e-2)
    first, second = (there.run() and there.state().q for _ in range(2))
    # A run starts from the same state again; DART's solver also from the forces it had last.
    np.testing.assert_allclose(first, second, rtol=0.0, atol=1e-3)
    assert np.abs(first - scenario.state.q).max() < 0.05


def test_what_should_stand_and_does_not_is_refused(raced: Engine) -> None:
    # In the air, Drake's TAMSI gives up on dampers as stiff as these after 22 ms.
    scenario = scenarios.standing("bravo7", duration=0.01)
    q = scenario.state.q + np.eye(scenario.robot.nq)[1]
    there = raced.peer(replace(scenario, state=State(q, scenario.state.v)), STEP)
    with pytest.raises(InvalidRunError, match="0 to 0 of 4 contacts"):
        there.check()


def test_it_falls_as_ours_onto_the_stops_of_its_knees(raced: Engine) -> None:
    """bravo7 folds up within 0.5 s; its knees stop at 130°.

    Hard contacts come to 5e-3 rad of ours in steps of 1 ms, soft ones to 7e-2.
    """
    scenario = scenarios.falling("bravo7")
    there = raced.peer(scenario, STEP)
    there.run()
    ours = scenario.run(TimeStepping(step=STEP)).position[-1]
    assert ours[4] == pytest.approx(np.deg2rad(130.0), abs=1e-6)
    np.testing.assert_allclose(there.state().q, ours, rtol=0.0, atol=0.1)


def test_pinocchio_has_our_dynamics() -> None:
    pytest.importorskip("pinocchio")
    from heelstrike.experiments.engines.pinocchio_peer import ForwardDynamics

    for name in ("bravo7", "walker2d"):
        part = ForwardDynamics(scenarios.falling(name))
        assert part.check()["acceleration_error"] <= 1e-9
        assert part.run() > 0.0


def test_an_engine_that_cannot_be_loaded_is_named_and_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def adapter(package: Any) -> Any:
        if package.title == "MuJoCo":
            raise ImportError("libmujoco.so: cannot open shared object file")

    monkeypatch.setattr(packages, "_adapter", adapter)
    monkeypatch.setattr(packages.importlib.util, "find_spec", lambda name: name)
    found = peers()
    assert "cannot be loaded: ImportError: libmujoco.so" in found["mujoco"]
    others = [name for name, each in PACKAGES.items() if name != "mujoco" and not each.elsewhere]
    assert [name for name in compared(found) if not PACKAGES[name].elsewhere] == others


def test_by_default_all_are_loaded_that_can_be() -> None:
    found = set(compared(peers())) - set(PARTS_OF_STEPS)
    assert "mujoco" in found
    assert set(simulators()) == found
