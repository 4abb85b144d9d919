"""Rows and columns of which the derivative of a time step is made, each by hand or by numpy.

Kernels run as plain Python here.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from heelstrike.contact.sets import HALF_LINE, LINE
from heelstrike.sim import Scheme
from heelstrike.sim.contacts.rows import BRAKE, COUPLING, DRY_JOINT, LOOP, POINT, STOP
from heelstrike.sim.linearized import time_step as its

STEP = 0.01
NQ = NV = 3
COLUMNS = NQ + NV + 2 + 2  # two torques, two numbers


def rows_of(count: int = 8) -> Any:
    """Active rows in which nobody has written."""
    width = count + COLUMNS
    return SimpleNamespace(
        held=np.full((count, NV), 77.0), change=np.full((count, COLUMNS), 77.0),
        response=np.full((NV, width), 77.0), system=np.full((count, width), 77.0),
        order=np.full(count, 77), rubbing=np.full(count, 77.0), point=np.full(count, 77), rank=77,
    )  # fmt: skip


MODEL: Any = SimpleNamespace(
    nq=NQ, nv=NV, nu=2, nc=3, actuator_joint=np.array([2, 0]), friction_scale=[1.0, 2.0, 0.5],
)  # fmt: skip


def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copy an array, as kernels do by words."""
    target[:] = source


@pytest.mark.parametrize("bounces", [False, True])
@pytest.mark.parametrize("rate", [0.0, 100.0])
def test_rows_of_points_are_normals_and_the_tangents_of_what_sticks(
    bounces: bool, rate: float
) -> None:
    """What slips pushes along J_n ∓ μ J_t; gaps and bounces change what a row asks for."""
    draw, rows = np.random.default_rng(3), rows_of()
    jacobian, along, bounce = draw.normal(size=(3, 6, NV))
    candidate = np.array([2, 0, 1, 2, 1])
    mode = np.array([STICK, OPEN, SLIP_FORWARD, SLIP_BACKWARD, STICK])
    impulse = np.arange(1.0, 11.0)
    friction, restitution = np.array([0.5, 0.0, 0.8]), np.array([0.1, 0.2, 0.3])
    found = uncompiled(its.write_points)(
        MODEL, 4, candidate, impulse, mode, rate, bounces, bounce, friction, restitution, jacobian,
        along, rows,
    )  # fmt: skip
    assert found == 4
    # Normal and tangent of point 2; normals of point 1, without friction, and of point 2.
    held = [4, 5, 2, 4]
    np.testing.assert_array_equal(rows.held[:4], jacobian[held])
    pushes = jacobian[held].copy()
    pushes[3] += 0.8 * jacobian[5]
    np.testing.assert_allclose(rows.response[:, :4].T, pushes)
    change = np.zeros((4, COLUMNS))
    change[:, :NV] = along[held]
    for row, normal in ((0, 4), (2, 2), (3, 4)):
        change[row, :NV] += rate * jacobian[normal]
        if bounces:
            back = restitution[normal // 2]
            change[row, :NV] += back * bounce[normal]
            change[row, NQ : NQ + NV] = back * jacobian[normal]
    np.testing.assert_allclose(rows.change[:4], change)
    np.testing.assert_allclose(rows.rubbing[:4], [0.0, 0.0, -1.0 * 5.0 * 2.0, 7.0 * 0.5])
    assert rows.point[[0, 2, 3]].tolist() == [2, 1, 2]
    forward = uncompiled(its.write_points)(
        MODEL, 1, candidate, impulse, np.array([SLIP_FORWARD]), 0.0, False, bounce, friction,
        restitution, jacobian, along, rows,
    )  # fmt: skip
    assert forward == 1
    np.testing.assert_allclose(rows.response[:, 0], jacobian[4] - 0.8 * jacobian[5])
    # What sticks without friction has no tangent.
    one = uncompiled(its.write_points)(
        MODEL, 1, np.array([1]), impulse, np.array([STICK]), 0.0, False, bounce, friction,
        restitution, jacobian, along, rows,
    )  # fmt: skip
    assert one == 1
    np.testing.assert_allclose(rows.response[:, 0], jacobian[2])


def test_rows_of_joints_are_units() -> None:
    """Of stops that press, latches that hold, and dry joints that stick."""
    rows, owner, side = rows_of(), np.array([0, 1, 2, 1, 0]), np.array([1.0, -1.0, 1.0, 1.0, 1.0])
    mode = np.array([9, STICK, OPEN, OPEN, STICK, SLIP_FORWARD])
    assembly = SimpleNamespace(
        begin=np.zeros(9, int), until=np.zeros(9, int), candidate=np.array([9, 1, 2, 0, 3, 4]),
        problem=SimpleNamespace(set=np.array([9, HALF_LINE, HALF_LINE, LINE, 9, 9])),
    )  # fmt: skip
    for kind, first, last in ((STOP, 1, 4), (DRY_JOINT, 4, 6)):
        assembly.begin[kind], assembly.until[kind] = first, last
    assert uncompiled(its.write_joints)(2, mode, 100.0, assembly, owner, side, rows) == 5
    expected = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_array_equal(rows.held[2:5], expected)
    np.testing.assert_array_equal(rows.response[:, 2:5].T, expected)
    change = np.zeros((3, COLUMNS))
    change[0, 1], change[1, 0] = -100.0, 100.0
    np.testing.assert_array_equal(rows.change[2:5], change)
    assert rows.rubbing[2:5].tolist() == [0.0] * 3
    assert np.all(rows.held[:2] == 77.0)


def test_rows_of_loops_turn_and_brakes_hold_their_joints() -> None:
    draw, rows = np.random.default_rng(4), rows_of()
    jacobian = draw.normal(size=(2, NV))
    partials = SimpleNamespace(
        loop_along_by_q=draw.normal(size=(2, NV)), loop_along_by_v=draw.normal(size=(2, NV))
    )
    found = uncompiled(its.write_loops)(
        1, 3, 6, np.array([9, 9, 9, 0, 1, 2]), np.array([9, 2]), np.array([LOOP, COUPLING, BRAKE]),
        np.array([9, 9, 1]), jacobian, partials, rows,
    )  # fmt: skip
    assert found == 4
    np.testing.assert_array_equal(rows.held[1:3], jacobian)
    np.testing.assert_array_equal(rows.response[:, 1:3].T, jacobian)
    np.testing.assert_array_equal(rows.held[3], [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(rows.response[:, 3], [0.0, 0.0, 1.0])
    change = np.zeros((3, COLUMNS))
    change[:2, :NV], change[:2, NV : 2 * NV] = partials.loop_along_by_q, partials.loop_along_by_v
    np.testing.assert_array_equal(rows.change[1:4], change)


def test_what_acts_without_impulses_is_by_position_velocity_torque_and_numbers() -> None:
    draw, rows, active = np.random.default_rng(5), rows_of(), 3
    lacking = SimpleNamespace(
        lacking_by_q=draw.normal(size=(NV, NQ)), lacking_by_v=draw.normal(size=(NV, NV)),
        lacking_by_numbers=draw.normal(size=(NV, 2)),
    )  # fmt: skip
    uncompiled(its.write_free)(MODEL, STEP, active, lacking, rows)
    expected = np.zeros((NV, COLUMNS))
    expected[:, :3], expected[:, 3:6] = -STEP * lacking.lacking_by_q, -STEP * lacking.lacking_by_v
    expected[2, 6] = expected[0, 7] = STEP
    expected[:, 8:] = -STEP * lacking.lacking_by_numbers
    np.testing.assert_allclose(rows.response[:, active : active + COLUMNS], expected)
    pushed = draw.normal(size=(NV, NQ))
    uncompiled(its.push_free)(STEP, active, pushed, rows.response)
    expected[:, :3] += STEP * pushed
    uncompiled(its.stiffen)(STEP, 0.5, active + NQ, np.array([10.0, 0.0, 30.0]), rows.response)
    expected[:, 3:6] -= 0.5 * STEP**2 * np.diag([10.0, 0.0, 30.0])
    np.testing.assert_allclose(rows.response[:, active : active + COLUMNS], expected)
    assert np.all(rows.response[:, :active] == 77.0)
    jacobian = draw.normal(size=(6, NV))
    rows.rubbing[:3], rows.point[:3] = [2.0, 0.0, -3.0], [1, 77, 2]
    uncompiled(its.rub)(active, COLUMNS, jacobian, rows)
    expected[:, -1] = 2.0 * jacobian[3] - 3.0 * jacobian[5]
    np.testing.assert_allclose(rows.response[:, active : active + COLUMNS], expected)
    assert np.all(rows.response[:, active + COLUMNS :] == 77.0)


def test_columns_are_solved_with_the_factor_of_the_mass_matrix() -> None:
    """A = Lᵀ D L of a tree, 1/D on the diagonal."""
    draw, parent = np.random.default_rng(6), np.array([-1, 0, 1, 1, 0])
    factor, lower = np.full((5, 5), np.nan), np.eye(5)
    for i in range(5):
        factor[i, i] = draw.uniform(0.5, 2.0)
        j = parent[i]
        while j >= 0:
            factor[i, j] = lower[i, j] = draw.normal()
            j = parent[j]
    matrix = lower.T @ np.diag(1.0 / np.diag(factor)) @ lower
    x = draw.normal(size=(5, 4))
    before = x.copy()
    uncompiled(its.solve_columns)(SimpleNamespace(nv=5, parent=parent), 3, factor, x)
    np.testing.assert_allclose(x[:, :3], np.linalg.solve(matrix, before[:, :3]), rtol=1e-11)
    np.testing.assert_array_equal(x[:, 3], before[:, 3])


@pytest.mark.parametrize("dependent", [False, True])
def test_velocities_meet_what_rows_ask_for(dependent: bool) -> None:
    """J dv⁺ = −∂(J v⁺ + c), where dv⁺ is what is free, the velocity itself, and impulses' doing."""
    draw, rows, active = np.random.default_rng(7), rows_of(), 2
    rows.held[:2] = draw.normal(size=(2, NV))
    if dependent:
        rows.held[2] = 2.0 * rows.held[0]
        active = 3
    rows.change[:active] = draw.normal(size=(active, COLUMNS))
    if dependent:
        rows.change[2] = 2.0 * rows.change[0]
    half = draw.normal(size=(NV, NV + 2))
    inverse = np.linalg.inv(half @ half.T)
    rows.response[:, :active] = inverse @ rows.held[:active].T
    free = draw.normal(size=(NV, COLUMNS))
    rows.response[:, active : active + COLUMNS] = free
    uncompiled(its.find_impulses)(active, rows)
    assert rows.rank == 2
    result = np.full((NV, COLUMNS), 77.0)
    uncompiled(its.add_impulses)(NQ, active, rows, result)
    np.testing.assert_allclose(rows.held[:active] @ result, -rows.change[:active], atol=1e-11)
    # And by impulses alone: what they change is A⁻¹ Jᵀ times something.
    own = free.copy()
    own[:, NQ : NQ + NV] += np.eye(NV)
    across = np.linalg.svd(rows.held[:2])[2][2]
    np.testing.assert_allclose(across @ np.linalg.solve(inverse, result - own), 0.0, atol=1e-10)


@pytest.mark.parametrize(
    ("scheme", "after", "before"),
    [(Scheme.IMPACT_RESOLVED, 1.0, 0.0), (Scheme.MOREAU_JEAN, 0.5, 0.5),
     (Scheme.PAPER_EXPLICIT, 0.0, 1.0), (Scheme.LINEARLY_IMPLICIT, 1.0, 0.0)],
)  # fmt: skip
def test_positions_follow_the_velocity_of_the_scheme(
    scheme: Scheme, after: float, before: float
) -> None:
    draw = np.random.default_rng(8)
    moves, velocity = draw.normal(size=(2, NV, COLUMNS))
    state = np.full((NQ + NV, COLUMNS), 77.0)
    uncompiled(its.write_state)(NQ, int(scheme), STEP, moves, velocity, state)
    expected = np.vstack((after * STEP * moves, velocity))
    expected[:NQ, :NQ] += np.eye(NQ)
    expected[:NQ, NQ : NQ + NV] += before * STEP * np.eye(NQ)
    np.testing.assert_allclose(state, expected)


def test_there_is_room_for_the_numbers_that_are_asked_for() -> None:
    """Columns of position, velocity, torques, numbers of the robot, and of friction at last."""
    robot = mechanisms.block()
    for numbers, friction in (((), False), (("mass",), True)):
        slopes = its.allocate_slopes(robot, numbers, friction=friction)
        count = sum(getattr(robot.model, name).size for name in numbers)
        assert slopes.state.shape == (6, 6 + count + friction)
        assert (slopes.rubs, slopes.turning) == (int(friction), 0.5)
    assert its.allocate_slopes(robot).rubs == 0


def test_the_equations_of_a_step_are_posed_at_its_beginning() -> None:
    balance = SimpleNamespace(
        q=np.zeros(3), v=np.zeros(2), added=np.zeros(2), normal=np.zeros((2, 2))
    )
    uncompiled(its.pose_balance, replace={its.copy_words: copy})(
        np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0]), np.array([6.0, 7.0]),
        np.array([[0.0, 1.0], [0.6, 0.8]]), balance,
    )  # fmt: skip
    assert (balance.q.tolist(), balance.v.tolist()) == ([1.0, 2.0, 3.0], [4.0, 5.0])
    assert balance.added.tolist() == [6.0, 7.0]
    assert balance.normal.tolist() == [[0.0, 1.0], [0.6, 0.8]]


class Posed:
    """A step of two points, two rows of loops and a brake, whose rows are played by a script."""

    def __init__(self, scheme: Scheme, **flags: Any) -> None:
        self.asked: list[tuple[Any, ...]] = []
        count = 5
        first = np.array([0, 2, 4, 5, 6, 7])
        assembly = SimpleNamespace(
            begin=np.zeros(9, int), until=np.zeros(9, int), candidate=np.array([1, 0, 9, 9, 9]),
            problem=SimpleNamespace(first=first), answer="answer",
        )  # fmt: skip
        for kind, begin, until in ((POINT, 0, 2), (LOOP, 2, count)):
            assembly.begin[kind], assembly.until[kind] = begin, until
        balance = SimpleNamespace(
            acceleration=np.zeros(NV), push=np.full((3, 2), 9.0), ahead=np.full(2, 9.0),
            pull=np.full(2, 9.0), rows="rows", factor=None,
        )  # fmt: skip
        self.slopes = SimpleNamespace(
            balance=balance, v=np.array([1.0, 2.0, 3.0]), turning=0.5, active=rows_of(),
            partials=SimpleNamespace(along_by_q="along"), bounce_by_q="bounce", rubs=flags["rubs"],
            loops=SimpleNamespace(jacobian="loops"), pushed_by_q="pushed",
        )  # fmt: skip

        def play(name: str, value: Any = None) -> Any:
            def asked(*given: Any) -> Any:
                self.asked.append((name, *given))
                return value

            return asked

        parts = {
            its.evaluate: play("evaluate"), its.write_points: play("points", 3),
            its.write_joints: play("joints", 4), its.write_loops: play("loops", 6),
            its.write_free: play("free"), its.push_free: play("push"), its.stiffen: play("stiffen"),
            its.rub: play("rub"), its.solve_columns: play("solve"),
            its.find_impulses: play("impulses"), its.add_impulses: play("add"),
        }  # fmt: skip
        surface = SimpleNamespace(friction="friction", restitution="restitution")
        table = SimpleNamespace(owner="owner", side="side", kind="kind")
        model = SimpleNamespace(nq=NQ, nv=NV, nc=3, brake_joint="brakes", stiffness="its stiffness")
        uncompiled(its.differentiate_problem, replace=parts)(
            model, STEP, int(scheme), "stiffness", flags["pushed"], table, surface, assembly,
            np.array([1.5, 2.0, 2.0]), np.arange(1.0, 8.0), "mode", flags["gaps"],
            flags["bounces"], self.slopes, np.zeros((NV, COLUMNS)),
        )  # fmt: skip

    def of(self, name: str) -> list[tuple[Any, ...]]:
        return [each[1:] for each in self.asked if each[0] == name]


def test_a_problem_of_a_step_is_looked_at_as_it_was_solved() -> None:
    """Accelerations and forces are velocities and impulses over the step; brakes pull no loop."""
    found = Posed(Scheme.IMPACT_RESOLVED, rubs=0, pushed=False, gaps=True, bounces=False)
    balance = found.slopes.balance
    np.testing.assert_allclose(balance.acceleration, [50.0, 0.0, -100.0])
    np.testing.assert_allclose(balance.push, [[300.0, 400.0], [100.0, 200.0], [0.0, 0.0]])
    assert balance.ahead[1] == 0.5 * STEP
    np.testing.assert_allclose(balance.pull, [500.0, 600.0])
    assert not found.of("push") + found.of("stiffen") + found.of("rub")
    (points,) = found.of("points")
    assert points[1] == 2
    assert points[5:10] == (1.0 / STEP, False, "bounce", "friction", "restitution")
    ((active, mode, rate, *_),) = found.of("joints")
    assert (active, mode, rate) == (3, "mode", 1.0 / STEP)
    ((active, first, last, *others),) = found.of("loops")
    assert (active, first, last) == (4, 2, 5)
    assert others[1:5] == ["brakes", "kind", "owner", "loops"]
    assert found.of("free")[0][1:3] == (STEP, 6)
    assert found.of("solve")[0][1] == 6 + COLUMNS
    assert found.of("impulses")[0][0] == 6
    assert found.of("add")[0][:2] == (NQ, 6)
    names = [each[0] for each in found.asked]
    assert names == [
        "evaluate", "points", "joints", "loops", "free", "solve", "impulses", "add"
    ]  # fmt: skip


def test_springs_pushes_and_friction_are_added_where_they_act() -> None:
    found = Posed(Scheme.LINEARLY_IMPLICIT, rubs=1, pushed=True, gaps=False, bounces=True)
    assert found.of("points")[0][5:7] == (0.0, True)
    assert found.of("push")[0][:3] == (STEP, 6, "pushed")
    assert found.of("stiffen")[0][:4] == (STEP, 1.0, 6 + NQ, "stiffness")
    assert found.of("rub")[0][:3] == (6, COLUMNS, "rows")
    found = Posed(Scheme.MOREAU_JEAN, rubs=0, pushed=False, gaps=False, bounces=True)
    assert found.of("stiffen")[0][:4] == (STEP, 0.5, 6 + NQ, "its stiffness")


@pytest.mark.parametrize("happens", [0, 1])
@pytest.mark.parametrize("scheme", [Scheme.IMPACT_RESOLVED, Scheme.MOREAU_JEAN])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("pushed", [0, 1])
def test_a_step_is_one_problem_or_two(
    happens: int, scheme: Scheme, restitution: float, pushed: int
) -> None:
    """Gaps are in the positions' one, restitution in the other; positions move with the first."""
    asked: list[tuple[Any, ...]] = []

    def play(name: str) -> Any:
        return lambda *given: asked.append((name, *given))

    surface = SimpleNamespace(restitution=np.array([9.0, restitution]))
    assembly = SimpleNamespace(
        begin=np.zeros(9, int), until=np.ones(9, int), candidate=np.array([1]),
        answer=SimpleNamespace(impulse="impulse", mode="mode"),
    )  # fmt: skip
    impact = SimpleNamespace(
        happens=happens, arriving="arriving v", arriving_impulse="arriving impulse",
        arriving_mode="arriving mode",
    )  # fmt: skip
    slopes = SimpleNamespace(
        q="q", v="v", balance="balance", tree=None, pushed_by_q="pushed", arriving="arriving",
        after="after", state="state", bounce_by_q=np.zeros((2, NQ)),
        partials=SimpleNamespace(along_by_q=np.arange(6.0).reshape(2, 3)),
    )  # fmt: skip
    parts = {
        its.pose_balance: play("pose"), its.find_pushes: play("pushes"),
        its.evaluate: play("evaluate"), its.differentiate_problem: play("problem"),
        its.write_state: play("state"), its.copy_words: copy,
    }  # fmt: skip
    uncompiled(its.differentiate_step, replace=parts)(
        SimpleNamespace(nq=NQ), STEP, int(scheme), "stiffness", "next v", "added", "normal",
        "table", surface, assembly, impact, SimpleNamespace(link=np.zeros(pushed)), slopes,
    )  # fmt: skip
    names = [each[0] for each in asked]
    assert names.count("pushes") == pushed
    bounces = restitution > 0.0
    assert names.count("evaluate") == int(bounces)
    assert slopes.bounce_by_q.any() == bounces
    if bounces:
        np.testing.assert_array_equal(slopes.bounce_by_q, slopes.partials.along_by_q)
    problems = [each[1:] for each in asked if each[0] == "problem"]
    assert len(problems) == 1 + happens
    gaps = scheme is Scheme.IMPACT_RESOLVED and happens == 0
    last = problems[-1]
    assert last[4] == (pushed == 1)
    assert last[8:15] == ("next v", "impulse", "mode", gaps, bounces and not gaps, slopes, "after")
    if happens:
        told = ("arriving v", "arriving impulse", "arriving mode", True, False, slopes, "arriving")
        assert problems[0][8:15] == told
    (state,) = (each[1:] for each in asked if each[0] == "state")
    assert state == (
        NQ, int(scheme), STEP, "arriving" if happens else "after", "after", "state"
    )  # fmt: skip


@hs.controller
def constant(torque: Any) -> None:
    """Ask for 3 and −4 N."""
    torque[0], torque[1] = 3.0, -4.0


def test_masses_act_beside_torques_as_they_do_in_closed_form() -> None:
    """v⁺ = v + h τ / m: by torque h / m, by mass −h τ / m², of two slides one after the other."""
    build = hs.RobotBuilder("slides", gravity=0.0)
    for name, mass in (("one", 2.0), ("two", 5.0)):
        build.slide(name, None, mass=mass, inertia=0.1, direction=(1.0, 0.0), torque=100.0)
    robot = build.build()
    simulation = hs.Simulation(
        robot, constant(), state=hs.State(np.zeros(2), np.zeros(2)), stop_when_fallen=False,
        method=hs.TimeStepping(step=STEP),
    )  # fmt: skip
    found = hs.step_derivatives(simulation, numbers=("mass",))
    np.testing.assert_allclose(found.torque[2:], np.diag([STEP / 2.0, STEP / 5.0]))
    by_mass = np.diag([-STEP * 3.0 / 4.0, STEP * 4.0 / 25.0])
    np.testing.assert_allclose(found.numbers["mass"][2:], by_mass)
    np.testing.assert_allclose(found.numbers["mass"][:2], STEP * by_mass)


def test_pushes_are_looked_at_where_the_step_begins() -> None:
    asked: list[tuple[Any, ...]] = []

    def slopes(model: Any, tree: Any, pushes: Any, by_q: Any) -> None:
        assert not by_q.any()
        asked.append((model, tree, pushes))
        by_q += 2.0

    found = np.full((2, 3), 9.0)
    uncompiled(
        its.find_pushes,
        replace={
            its.forward_kinematics: lambda *given: asked.append(given),
            its.add_push_slopes: slopes,
        },
    )("model", "q", "pushes", "tree", found)
    assert asked == [("model", "q", "tree"), ("model", "tree", "pushes")]
    assert np.all(found == 2.0)
