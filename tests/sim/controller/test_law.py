"""Controllers that their authors write as functions of named parameters and memory."""

from __future__ import annotations

import importlib.util
import pickle
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from robot_cases import builtin_xml

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.compiler.compilation import numba_in_use
from heelstrike.control.computed_torque import computed_torque
from heelstrike.robot import read_mjcf
from heelstrike.sim.controller import stance
from heelstrike.sim.method import Method

METHODS = [hs.TimeStepping(), hs.EventDriven(rtol=1e-6), hs.Compliant()]

FROM_OUTSIDE = """
import heelstrike as hs
class Gains(hs.Bundle):
    kp = hs.array("nu")
    kd = hs.array("nu")
    lean = hs.number(float)
class Memory(hs.Bundle):
    calls = hs.cell(int)
@hs.controller
def stand(state, robot, parameters: Gains, memory: Memory, torque):
    memory.calls += 1
    robot.gravity_force(state, torque)
    for i in range(robot.nu):
        spring = parameters.kp[i] * (state.joint_position[i] - parameters.lean)
        torque[i] -= spring + parameters.kd[i] * state.joint_velocity[i] + 1e-3 * memory.calls
"""
"""A module of somebody else's: three parameters, a memory, fifteen lines."""


@pytest.fixture(scope="module")
def outside(tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("outside") / "standing_controller.py"
    assert len(FROM_OUTSIDE.strip().splitlines()) <= 15
    file.write_text(FROM_OUTSIDE)
    specification = importlib.util.spec_from_file_location(file.stem, file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[file.stem] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules[file.stem]


def gains(module: Any) -> Any:
    return module.Gains(kp=np.linspace(500.0, 600.0, 6), kd=np.full(6, 12.0), lean=0.05)


def simulation(controller: Any, method: Method | None = None, **options: Any) -> hs.Simulation:
    robot = walking.bravo7()
    return hs.Simulation(robot, controller, state=robot.reference_state(), method=method, **options)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_one_function_compiled_in_python_and_checked(outside: Any, method: Method) -> None:
    in_python = hs.controller(compile=False)(outside.stand.python)
    runs = []
    for function, checked in ((outside.stand, False), (in_python, False), (outside.stand, True)):
        one = simulation(function(gains(outside)), method, control_period=1e-3, checked=checked)
        one.advance(0.03)
        assert one.status is one.status.COMPLETED, one.message
        runs.append(one.record)
    compiled = runs[0]
    assert np.ptp(compiled.torque, axis=0).min() > 1e-3
    for other in runs[1:]:
        np.testing.assert_allclose(other.torque, compiled.torque, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(other.position, compiled.position, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("checked", [False, True])
def test_snapshots_keep_memory_and_parameters(outside: Any, checked: bool, tmp_path: Path) -> None:
    law = outside.stand(gains(outside))
    first = simulation(law, checked=checked)
    first.advance(0.01)
    first.parameters.lean = 0.03
    first.advance(0.02)
    first.snapshot().save(tmp_path / "kept.npz")
    second = simulation(law, checked=checked)
    second.restore(hs.load_snapshot(tmp_path / "kept.npz"))
    assert second.parameters.lean == 0.03
    for each in (first, second):
        each.advance(0.03)
    np.testing.assert_array_equal(second.state.q, first.state.q)
    np.testing.assert_array_equal(second.record.torque[-1], first.record.torque[-1])


def test_parameters_are_set_as_a_whole_or_one_by_one(outside: Any) -> None:
    soft = outside.Gains(kp=np.full(6, 50.0), kd=np.full(6, 1.0), lean=0.0)
    law = outside.stand(gains(outside))
    ends = []
    for change in (None, "whole", "members"):
        one = simulation(outside.stand(soft) if change is None else law)
        if change == "whole":
            one.parameters = soft
        elif change == "members":
            one.parameters.kp[:] = 50.0
            one.parameters.kd[:] = 1.0
            one.parameters.lean = 0.0
        one.advance(0.02)
        ends.append(one.state.q)
    np.testing.assert_array_equal(ends[1], ends[0])
    np.testing.assert_array_equal(ends[2], ends[0])
    assert law.parameters.kp[0] == 500.0
    with pytest.raises(hs.ControllerError, match="takes Gains as parameters, got Bundle"):
        one.parameters = hs.Bundle()
    with pytest.raises(hs.ControllerError, match=r"kp has shape \(1,\)"):
        one.parameters = outside.Gains(kp=np.ones(1), kd=np.ones(1), lean=0.0)


def test_memory_begins_as_asked_and_gains_are_told(outside: Any) -> None:
    law = outside.stand(gains(outside), memory={"calls": 1000}, stiffness=7.0, damping=np.ones(6))
    plain, told = simulation(outside.stand(gains(outside))), simulation(law)
    driven = walking.bravo7().model.actuator_joint
    assert np.all((told._memory.stiffness - plain._memory.stiffness)[driven] == 7.0)
    assert np.all((told._memory.damping - plain._memory.damping)[driven] == 1.0)
    for each in (plain, told):
        each.step()
    difference = plain.record.torque[0] - told.record.torque[0]
    np.testing.assert_allclose(difference, 1.0, atol=1e-9)


def test_a_law_is_copied_by_pickle(outside: Any) -> None:
    law = pickle.loads(pickle.dumps(outside.stand(gains(outside))))
    assert law.function is outside.stand
    assert law.parameters.lean == 0.05


def test_machine_code_is_good_for_the_queries_it_was_made_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    called = computed_torque.separate._function
    before = numba_in_use().made_of(called)
    assert numba_in_use().made_of(called) == before
    other = stance.point_foot_torque.py_func.__code__  # type: ignore[attr-defined]
    monkeypatch.setattr(stance.flat_foot_torque.py_func, "__code__", other)  # type: ignore[attr-defined]
    assert numba_in_use().made_of(called) != before


class Answers(hs.Bundle):
    """Room for what the queries answer."""

    mass_matrix: np.ndarray = hs.array("nv", "nv")
    bias_force: np.ndarray = hs.array("nv")
    passive_force: np.ndarray = hs.array("nv")
    inverse_dynamics: np.ndarray = hs.array("nv")
    gravity: np.ndarray = hs.array("nu")
    point: np.ndarray = hs.array(2)
    point_jacobian: np.ndarray = hs.array(3, "nv")
    contact_jacobian: np.ndarray = hs.array("nc", 2, "nv")
    foot_pose: np.ndarray = hs.array(3)
    foot_jacobian: np.ndarray = hs.array(3, "nv")
    center: np.ndarray = hs.array(2)
    center_velocity: np.ndarray = hs.array(2)


def ask_everything(state, contacts, robot, memory: Answers, torque):  # type: ignore[no-untyped-def]
    """Ask the robot all there is to ask."""
    robot.mass_matrix(state, memory.mass_matrix)
    robot.bias_force(state, memory.bias_force)
    robot.passive_force(state, memory.passive_force)
    robot.inverse_dynamics(state, state.v, memory.inverse_dynamics)
    robot.gravity_force(state, memory.gravity)
    robot.point_position(state, 4, robot.model.center_of_mass[4], memory.point)
    robot.point_jacobian(state, 4, memory.point, memory.point_jacobian)
    for i in range(robot.nc):
        robot.contact_jacobian(state, contacts, i, memory.contact_jacobian[i])
    robot.foot_pose(state, 1, memory.foot_pose)
    robot.foot_jacobian(state, 1, memory.foot_jacobian)
    robot.center_of_mass(state, memory.center)
    robot.center_of_mass_velocity(state, memory.center_velocity)
    torque[0] = robot.nq + robot.nv + robot.nu + robot.nc + robot.nl


@pytest.mark.parametrize("compiled", [True, False])
def test_queries_answer_as_the_functions_of_dynamics_do(compiled: bool) -> None:
    robot = walking.bravo7()
    draw = np.random.default_rng(2)
    q = robot.reference_state().q + 0.3 * draw.normal(size=robot.nq)
    v = draw.normal(size=robot.nv)
    contacts = hs.sim.Contacts.allocate(nc=robot.nc, axes=2, components=2)
    seen = hs.contact_kinematics(robot, q, v)
    contacts.position[:], contacts.normal[:] = seen.position, seen.normal
    law = hs.controller(compile=compiled)(ask_everything)(robot=robot)
    assert law.torque(0.0, hs.State(q, v), contacts)[0] == 9 + 9 + 6 + 4 + 9
    found = law.remembered
    local = robot.model.center_of_mass[4]
    poses = dynamics.link_poses(robot, q)
    foot = robot.feet[1].link
    still = dynamics.bias_force(robot, q, 0.0 * v)
    expected = {
        "mass_matrix": dynamics.mass_matrix(robot, q),
        "bias_force": dynamics.bias_force(robot, q, v),
        "passive_force": dynamics.passive_force(robot, q, v),
        "inverse_dynamics": dynamics.inverse_dynamics(robot, q, v, v),
        "gravity": still[robot.model.actuator_joint],
        "point": dynamics.point_position(robot, q, 4, local),
        "point_jacobian": dynamics.point_jacobian(robot, q, 4, local),
        "contact_jacobian": seen.jacobian,
        "foot_pose": [*poses.origin[foot], poses.angle[foot]],
        "foot_jacobian": dynamics.point_jacobian(robot, q, foot, np.zeros(2)),
        "center": dynamics.center_of_mass(robot, q),
        "center_velocity": dynamics.center_of_mass_velocity(robot, q, v),
    }
    assert set(expected) == set(Answers.declared)
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(found, name), value, atol=1e-11, err_msg=name)


@hs.controller
def upright(state: Any, robot: Any, torque: Any) -> None:
    """Torques that would bear the weight, were all coordinates zero."""
    seen = robot.estimate
    for j in range(robot.nq):
        seen.q[j] = 0.0
    robot.update(seen)
    robot.gravity_force(seen, torque)


def test_an_estimated_state_is_asked_about_like_the_true_one() -> None:
    robot = walking.bravo7()
    state = walking.gait().initial_state
    torque = upright(robot=robot).torque(0.0, state, None)
    still = dynamics.bias_force(robot, np.zeros(9), np.zeros(9))
    np.testing.assert_allclose(torque, still[robot.model.actuator_joint], atol=1e-11)
    assert np.abs(still - dynamics.bias_force(robot, state.q, 0.0 * state.v)).max() > 1.0


@hs.controller
def stand_flat(state: Any, robot: Any, torque: Any) -> None:
    """Hold the joints still, on a flat foot."""
    robot.flat_foot_torque(state, 0, torque, torque)


def test_a_robot_that_no_flat_foot_holds_gets_no_torque() -> None:
    robot = walking.bravo7()
    assert np.all(np.isfinite(stand_flat(robot=robot).torque(0.0, robot.reference_state(), None)))
    xml = re.sub(r'\s*<motor name="\w+_ankle".*', "", builtin_xml("bravo7"))
    loose = read_mjcf(xml, name="bravo7")
    torque = stand_flat(robot=loose).torque(0.0, loose.reference_state(), None)
    assert np.all(np.isnan(torque))


def test_what_is_no_controller_is_refused() -> None:
    def strange(t, q, torque):  # type: ignore[no-untyped-def]
        torque[0] = q[0]

    def unnamed(parameters, torque):  # type: ignore[no-untyped-def]
        torque[0] = parameters.gain

    def silent(t):  # type: ignore[no-untyped-def]
        return t

    for function, words in (
        (strange, r"'strange' takes \(t, q, torque\)"),
        (silent, "all but torque may be left out"),
        (unnamed, "annotate the argument"),
    ):
        with pytest.raises(hs.ControllerError, match=words):
            hs.controller(function)


def test_what_cannot_be_compiled_is_refused() -> None:
    def open_a_file(torque):  # type: ignore[no-untyped-def]
        torque[0] = len(Path("gains").read_text())

    with pytest.raises(hs.ControllerError, match=r"'open_a_file' cannot be compiled"):
        simulation(hs.controller(open_a_file)())


def test_parameters_must_be_those_of_the_function_and_fit_the_robot(outside: Any) -> None:
    with pytest.raises(hs.ControllerError, match=r"'stand' takes Gains as parameters, got Bundle"):
        outside.stand()
    with pytest.raises(hs.ControllerError, match="takes Gains as parameters, got dict"):
        outside.stand({"kp": 1.0})
    few = outside.Gains(kp=np.zeros(5), kd=np.zeros(5), lean=0.0)
    with pytest.raises(hs.ControllerError, match=r"does not fit robot 'bravo7'.*kp.*\(5,\)"):
        simulation(outside.stand(few))
    with pytest.raises(hs.ControllerError, match=r"call it with them, as in stand\(\.\.\.\)"):
        simulation(outside.stand)
    with pytest.raises(hs.ControllerError, match="memory of controller 'stand' has no steps"):
        outside.stand(gains(outside), memory={"steps": 1})
    with pytest.raises(hs.ControllerError, match=r"damping must be one finite number or 6"):
        simulation(outside.stand(gains(outside), damping=np.ones(2)))
    with pytest.raises(hs.ControllerError, match="does not know its robot"):
        outside.stand(gains(outside)).torque(0.0, walking.bravo7().reference_state(), None)
