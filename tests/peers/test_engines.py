"""Each engine has our robot, contacts and law of control; who has not, is refused.

Engines that are not installed are left out (``pip install heelstrike[peers]`` brings them). All of
them integrate as our time stepping does, velocity first; what they treat otherwise are dampers and
springs, explicitly or implicitly, which are differences of first order in the step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from speed import scenarios

from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.experiments.engines import (
    Engine,
    InvalidRunError,
    check_flight,
    compared,
    packages,
    peer,
    peers,
    simulators,
)
from heelstrike.experiments.engines.packages import PACKAGES, PARTS_OF_STEPS
from heelstrike.experiments.engines.peer import flight
from heelstrike.robot import State, load_robot
from heelstrike.sim import TimeStepping

STEP = 1e-3

SIMULATORS = [
    name for name, package in PACKAGES.items() if package.adapter and name not in PARTS_OF_STEPS
]


@pytest.fixture(params=SIMULATORS)
def engine(request: pytest.FixtureRequest) -> Engine:
    pytest.importorskip(PACKAGES[request.param].module)
    return simulators([request.param])[request.param]


def test_a_robot_flies_as_ours(engine: Engine) -> None:
    # Without dampers there is nothing to treat otherwise: round-off alone, some 1e-15 a step.
    assert check_flight(engine, load_robot("bravo7")) <= 1e-12


def test_a_robot_with_dampers_flies_as_ours(engine: Engine) -> None:
    # 0.1 N m s/rad on links of 0.03 kg m² and up: the speeds of 1 rad/s change by 3 rad/s²; half a
    # step of that, for 0.1 s, is 1.5e-4 rad.
    assert check_flight(engine, load_robot("walker2d")) <= 1.5e-4


def test_another_robot_is_refused(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot("bravo7")
    heavier = replace(robot, model=robot.model.replaced(inertia=2.0 * robot.model.inertia))
    wrong = replace(
        engine, peer=lambda scenario, step: engine.peer(replace(scenario, robot=heavier), step)
    )
    monkeypatch.setattr(peer, "FLIGHT_ERROR", 1e-6)
    with pytest.raises(InvalidRunError, match="in free flight"):
        check_flight(wrong, robot)


def test_the_law_of_control_is_ours(engine: Engine) -> None:
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
        there = engine.peer(scenario, step)
        there.run()
        ours = scenario.run(TimeStepping(step=step)).position[-1]
        moved = np.abs(ours - start.run(TimeStepping(step=step)).position[-1]).max()
        errors.append(np.abs(there.state().q - ours).max())
    assert moved > 0.05  # it does something
    assert errors[0] <= 2e-2
    assert errors[1] <= 0.2 * errors[0] or errors[1] <= 1e-9


@pytest.mark.parametrize("name", ["bravo7", "walker2d"])
def test_it_stands_on_four_contacts_that_carry_its_weight(engine: Engine, name: str) -> None:
    scenario = scenarios.standing(name, duration=0.5)
    there = engine.peer(scenario, STEP)
    there.settle(there.settling)
    found = there.check()  # raises if it does not
    assert found["active_contacts"] == pytest.approx(4.0, abs=0.04)
    assert found["weight_carried"] == pytest.approx(1.0, abs=1e-2)
    first, second = (there.run() and there.state().q for _ in range(2))
    # A run starts from the same state again; DART's solver also from the forces it had last.
    np.testing.assert_allclose(first, second, rtol=0.0, atol=1e-3)
    assert np.abs(first - scenario.state.q).max() < 0.05


def test_what_should_stand_and_does_not_is_refused(engine: Engine) -> None:
    # In the air, Drake's TAMSI gives up on dampers as stiff as these after 22 ms.
    scenario = scenarios.standing("bravo7", duration=0.01)
    q = scenario.state.q + np.eye(scenario.robot.nq)[1]
    there = engine.peer(replace(scenario, state=State(q, scenario.state.v)), STEP)
    with pytest.raises(InvalidRunError, match="0 to 0 of 4 contacts"):
        there.check()


def test_it_falls_as_ours_onto_the_stops_of_its_knees(engine: Engine) -> None:
    """bravo7 folds up within 0.5 s; its knees stop at 130°.

    Hard contacts come to 5e-3 rad of ours in steps of 1 ms, soft ones to 7e-2.
    """
    scenario = scenarios.falling("bravo7")
    there = engine.peer(scenario, STEP)
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
    assert compared(found) == ["drake", "bullet", "dart", "pinocchio"]


def test_by_default_all_are_loaded_that_can_be() -> None:
    found = set(compared(peers())) - set(PARTS_OF_STEPS)
    assert "mujoco" in found
    assert set(simulators()) == found
