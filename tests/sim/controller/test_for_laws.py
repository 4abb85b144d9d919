"""What laws are made of besides numbers: parts, equations, programmes, queries in Python."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control import (
    LinearEquations,
    Program,
    controlled_robot,
    solve_or_relax,
)
from heelstrike.sim import RunStatus


class Springs(hs.Bundle):
    """Gains of joints."""

    kp: float = hs.number(float)
    kd: float = hs.number(float)


class Both(hs.Bundle):
    """Gains of either side, and what it shall do wrong."""

    right: Springs = hs.part(Springs)
    left: Springs = hs.part(Springs)
    fault: int = hs.number(int)


class Memory(hs.Bundle):
    """What it solves, and what it counts."""

    calls: int = hs.cell(int)
    equations: LinearEquations = hs.part(LinearEquations)
    program: Program = hs.part(Program)
    jacobian: Any = hs.array(3, "nv")
    short: Any = hs.array(2, "nv")
    center: Any = hs.array(2)


class Told(hs.Bundle):
    """What came out."""

    rank: int = hs.cell(int)
    x: Any = hs.array(3)
    least: Any = hs.array(2)


@numba.njit
def spring(state: Any, first: int, springs: Any, torque: Any) -> None:
    """Springs of three joints."""
    for i in range(first, first + 3):
        torque[i] = -springs.kp * state.joint_position[i] - springs.kd * state.joint_velocity[i]


@hs.controller
def composed(state, contacts, robot, parameters: Both, memory: Memory, log: Told, torque):  # type: ignore[no-untyped-def]
    """Springs on either side; beside them, equations and a programme are solved."""
    memory.calls += 1
    spring(state, 0, parameters.right, torque)
    spring(state, 3, parameters.left, torque)
    robot.foot_jacobian(state, memory.calls % 2, memory.jacobian)
    robot.center_of_mass(state, memory.center)
    for i in range(3):
        for j in range(3):
            memory.equations.system[i, j] = 1.0 / (1.0 + i + j)
        memory.equations.system[i, 3] = state.joint_position[i] + 0.1 * i
    log.rank = memory.equations.solve()
    program = memory.program
    for i in range(2):
        log.x[i] = memory.equations.x[i]
        for j in range(2):
            program.hessian[i, j] = 2.0 if i == j else 0.0
            program.rows[0, j] = -1.0
    log.x[2] = memory.equations.x[2]
    program.gradient[0], program.gradient[1] = -2.0, -5.0
    program.bound[0] = -2.0 - state.joint_position[1]
    program.count = 1
    solve_or_relax(program)
    for i in range(2):
        log.least[i] = program.x[i]
    if memory.calls == 300:
        if parameters.fault == 1:
            robot.foot_jacobian(state, 7, memory.jacobian)
        elif parameters.fault == 2:
            robot.foot_jacobian(state, 0, memory.short)
        elif parameters.fault == 3:
            spring(state, 4, parameters.left, torque)
        elif parameters.fault == 4:
            memory.jacobian[3, memory.calls % 2] = 1.0
        elif parameters.fault == 5:
            robot.center_of_mass(state, contacts.position[1])


def law(fault: int = 0) -> Any:
    springs = [Springs(kp=600.0, kd=10.0), Springs(kp=500.0, kd=20.0)]
    memory = {
        "equations": LinearEquations.allocate(unknowns=3),
        "program": Program.allocate(n=2, m=1),
    }
    return composed(Both(right=springs[0], left=springs[1], fault=fault), memory=memory)


def run_of(controller: Any, *, duration: float = 0.02, **options: Any) -> hs.Run:
    start = walking.gait().initial_state
    return hs.simulate(walking.bravo7(), controller, state=start, duration=duration, **options)


@pytest.mark.slow
def test_a_law_of_parts_solves_equations_and_programmes() -> None:
    run = run_of(law())
    assert run.completed, run.message
    hilbert = 1.0 / (1.0 + np.add.outer(np.arange(3), np.arange(3)))
    joints = run.position[:, 3:]
    right = joints[:, :3] + 0.1 * np.arange(3)
    np.testing.assert_allclose(run.log["x"].values, np.linalg.solve(hilbert, right.T).T, rtol=1e-9)
    assert set(run.log["rank"].values) == {3}
    for angle, least in zip(joints[:, 1], run.log["least"].values, strict=True):
        found = hs.solve_quadratic_program(2.0 * np.eye(2), [-2, -5], [[-1, -1]], [-2 - angle])
        np.testing.assert_allclose(least, found.x, atol=1e-12)
    gains = np.repeat([[600.0, 500.0], [10.0, 20.0]], 3, axis=1)
    wanted = -gains[0] * joints - gains[1] * run.velocity[:, 3:]
    np.testing.assert_allclose(run.torque, wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("wrong", [float, "Springs", Springs(kp=1.0, kd=1.0)])
def test_a_part_is_a_class_of_bundles(wrong: Any) -> None:
    with pytest.raises(TypeError, match=r"a part is declared by its class of heelstrike\.Bundle"):
        hs.part(wrong)


def test_equations_that_leave_something_free() -> None:
    equations = LinearEquations.allocate(unknowns=2)
    equations.system[:] = [[1.0, 1.0, 2.0], [2.0, 2.0, 4.0]]
    assert equations.solve() == 1
    assert equations.x.sum() == 2.0
    assert 0.0 in equations.x


def test_a_checked_law_computes_the_same_in_python_and_when_queries_are_compiled() -> None:
    plain, checked = (run_of(law(), duration=0.15, checked=each) for each in (False, True))
    assert checked.completed, checked.message
    np.testing.assert_allclose(checked.position, plain.position, atol=1e-12)
    np.testing.assert_allclose(checked.log["x"].values, plain.log["x"].values, rtol=1e-9)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (1, "reads robot.foot_link[7], beyond its shape (2,)"),
        (2, "writes to memory.short[2, 0], beyond its shape (2, 9)"),
        (3, "reads state.joint_position[6], beyond its shape (6,)"),
        (4, "writes to memory.jacobian[3, 0], beyond its shape (3, 9)"),
        (5, "writes to contacts.position[1][0]: it may write only to torque, memory, log and"),
    ],
)
def test_a_checked_law_is_caught_at_its_300th_call(fault: int, words: str) -> None:
    """By then its queries run compiled, which look at no index."""
    run = run_of(law(fault), duration=0.4, checked=True, on_error="stop")
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert words in run.message
    assert run.message.endswith("(at t = 0.299 s)")


class Asking:
    """A controller in Python that asks as compiled laws do."""

    def __init__(self, robot: hs.Robot) -> None:
        self.robot = controlled_robot(robot)
        self.foot, self.contact = np.zeros((3, robot.nv)), np.zeros((2, robot.nv))
        self.asked: list[Any] = []

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        at = self.robot.estimate
        at.q[:], at.v[:] = state.q, state.v
        self.robot.update(at)
        self.robot.foot_jacobian(at, 1, self.foot)
        self.robot.contact_jacobian(at, contacts, 2, self.contact)
        gap = self.robot.foot_gap(contacts, 1)
        self.asked.append((state.q.copy(), self.foot.copy(), self.contact.copy(), gap))
        return np.zeros(self.robot.nu)


def test_a_controller_in_python_asks_in_the_same_words() -> None:
    robot = walking.bravo7()
    asking = Asking(robot)
    run = run_of(asking, duration=0.01)
    for (q, foot, contact, gap), row in zip(asking.asked, range(len(run.time)), strict=True):
        link = robot.feet[1].link
        np.testing.assert_allclose(foot, dynamics.point_jacobian(robot, q, link, (0.0, 0.0)))
        np.testing.assert_allclose(
            contact, hs.contact_kinematics(robot, q, run.velocity[row]).jacobian[2], atol=1e-12
        )
        assert gap == run.gap[row, list(robot.feet[1].contacts)].min()
