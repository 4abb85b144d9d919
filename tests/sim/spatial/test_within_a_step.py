"""What a step in space is put together of, each part by itself before an independent value.

Kernels of the step run as plain Python; what they are compared with are differences, the dense
equations of motion of :mod:`heelstrike.dynamics.spatial`, and energies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.spatial.certified_solve import block_workspace
from heelstrike.contact.spatial.modes import NOT_FOUND, OPEN, SLIP, SOLVED, STICK
from heelstrike.dynamics import spatial
from heelstrike.errors import ControllerError, SimulationError
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.record.record import Told
from heelstrike.sim.spatial import space
from heelstrike.sim.spatial.candidates import assemble, complete, entry_speed, list_candidates
from heelstrike.sim.spatial.impact import closes, energy_of_impact, pose_impact_of
from heelstrike.sim.spatial.memory import (
    MOST_ITERATIONS,
    SpatialMemory,
    SpatialReported,
    allocate_spatial_memory,
)
from heelstrike.sim.spatial.record import note_deepest, note_spatial_events
from heelstrike.sim.spatial.space import SPACE, SpatialLook
from heelstrike.sim.spatial.stepping import (
    call_what_is_missed,
    find_free_velocity,
    find_slip,
    find_state,
    forgive_depth,
    goes_on_wedged,
    note_answer_of,
    note_relaxed,
    share_forces,
    solve_positions,
    take_step,
)
from heelstrike.sim.spatial.table import (
    BALL_STOP,
    DRY_JOINT,
    NEVER_TOUCHED,
    POINT,
    STOP,
    WALL,
    BlockTable,
    lay_out_table,
    most_rows_of,
)

STEP = 1e-3

TOY = """<body name='trunk' pos='0 0 0.1'><freejoint/>
<geom type='box' size='0.2 0.15 0.1' mass='4'/>
<body name='arm' pos='0.1 0 0.1'>
<joint name='shoulder' axis='0 1 0' range='-1 0.5' limited='true' frictionloss='0.4' damping='0.1'/>
<geom type='sphere' pos='0.3 0.05 0' size='0.04' mass='1'/></body>
<body name='bob' pos='-0.1 0.1 0.1'>
<joint name='neck' type='ball' range='0 0.6' limited='true'/>
<geom type='box' pos='0 0.02 0.2' size='0.05 0.03 0.02' mass='0.5'/></body>
<body name='drawer' pos='0 -0.1 0.1'><joint name='slide' type='slide' axis='0 0.6 0.8'/>
<geom type='sphere' pos='0 0 0.1' size='0.02' mass='0.3'/></body></body>"""
"""A box on corners with an arm that has a range and dry friction, a ball joint, and a drawer."""
MOTOR = "<actuator><motor name='motor' joint='shoulder'/></actuator>"

WALLS = hs.SpatialGround(
    friction=0.6, restitution=0.4, normal=(0.05, -0.1, 1.0),
    boxes=(hs.Box(center=(0.55, 0.1, 0.2), size=(0.6, 1.5, 0.5), yaw=0.3, friction=0.2),),
)  # fmt: skip
"""A slope with a box that stands askew in the way."""


@dataclass(frozen=True)
class Posed:
    """A robot somewhere, with all that its steps write to."""

    robot: hs.SpatialRobot
    memory: SpatialMemory
    ground: hs.SpatialGround

    def found(self, q: np.ndarray) -> SpatialMemory:
        """Find gaps and equations at some position."""
        memory = self.memory
        uncompiled(find_state)(
            self.robot.model, self.ground.model(), q, memory.v, memory.equations, memory.blocks,
            memory.contacts, memory.feet,
        )  # fmt: skip
        return memory

    def gap_rates(self, v: np.ndarray) -> np.ndarray:
        """Rates of all gaps at a velocity, by central differences."""
        ahead, behind = (
            self.found(spatial.integrate(self.robot, self.memory.q, v, side)).blocks.gap.copy()
            for side in (1e-6, -1e-6)
        )
        self.found(self.memory.q)
        with np.errstate(invalid="ignore"):  # those that are infinite
            return (ahead - behind) / 2e-6

    def rows(self, entry: int) -> np.ndarray:
        """Jacobian of an entry: of a point at the foot of its face, else by differences."""
        memory, table, robot = self.memory, self.memory.blocks, self.robot
        if table.kind[entry] in (POINT, WALL):
            link = int(robot.model.contact_link[table.owner[entry]])
            poses = spatial.link_poses(robot, memory.q)
            local = poses.rotation[link].T @ (memory.feet.foot[entry] - poses.origin[link])
            jacobian = spatial.point_jacobian(robot, memory.q, link, local)[:3]
            return memory.feet.frame[entry].reshape(3, 3) @ jacobian
        if table.kind[entry] == DRY_JOINT:
            return np.eye(robot.nv)[[table.owner[entry]]]
        return np.array([[self.gap_rates(one)[entry] for one in np.eye(robot.nv)]])


@pytest.fixture
def posed(made: Maker) -> Posed:
    robot = made(TOY, MOTOR)
    rng = np.random.default_rng(5)
    push = hs.Push("arm", force=(3.0, -2.0, 5.0), start=0.0004, duration=1.0, point=(0.1, 0.0, 0.2))
    memory = allocate_spatial_memory(robot, (push,), walls=True)
    v = rng.normal(size=robot.nv)
    memory.v[:] = v
    memory.q[:] = spatial.integrate(robot, robot.reference_state().q, v, 0.2)
    memory.q[:3] = (0.02, 0.0, 0.12)
    memory.torque[:] = 1.7
    there = Posed(robot, memory, WALLS)
    there.found(memory.q)
    return there


# The table.


def test_the_table_has_what_may_hold_the_robot(made: Maker) -> None:
    """Points, their walls if there are any, both ends of a range, cones of balls, dry friction."""
    robot = made(TOY, MOTOR)
    nc = robot.nc
    for walls in (False, True):
        table = lay_out_table(robot, walls=walls)
        kinds = [POINT] * nc + [WALL] * 2 * nc * walls + [STOP, STOP, BALL_STOP, DRY_JOINT]
        assert table.kind.tolist() == kinds
        points = nc * (1 + 2 * walls)
        assert table.owner[:points].tolist() == [*range(nc)] * (1 + 2 * walls)
        first = robot.model.first_velocity
        shoulder, neck = (robot.joint_names.index(name) for name in ("shoulder", "neck"))
        assert table.owner[points:].tolist() == [shoulder, shoulder, neck, first[shoulder]]
        assert table.side[points : points + 3].tolist() == [1.0, -1.0, -1.0]
        assert table.set.tolist() == [CONE] * points + [HALF_LINE] * 3 + [INTERVAL]
        assert table.size.tolist() == [3] * points + [1] * 4
        assert most_rows_of(table) == 3 * points + 4
        assert table.mode.tolist() == [OPEN] * (points + 3) + [STICK]
        assert np.all(np.isinf(table.gap))
        assert np.all(table.touching == NEVER_TOUCHED)
        assert table.wall[:nc].tolist() == ([*range(nc, 2 * nc)] if walls else [-1] * nc)
        assert table.wall[nc : 2 * nc].tolist() == (
            [*range(2 * nc, 3 * nc)] if walls else [-1] * len(table.wall[nc : 2 * nc])
        )
        assert np.all(table.wall[2 * nc :] == -1)
        assert table.last[-1] == first[shoulder]
        assert table.last[-2] == first[neck] + 2


# Gaps and rows.


def test_gaps_open_as_fast_as_they_say(posed: Posed) -> None:
    """Of points, walls, both ends of a range and the cone of a ball joint, by differences."""
    memory, table = posed.memory, posed.memory.blocks
    v = np.random.default_rng(6).normal(size=posed.robot.nv)
    rates = posed.gap_rates(v)
    kinds = set()
    for entry, kind in enumerate(table.kind.tolist()):
        if kind == DRY_JOINT or not np.isfinite(table.gap[entry]):
            continue
        kinds.add(kind)
        speed = uncompiled(entry_speed)(
            posed.robot.model, memory.equations.tree, entry, table, memory.feet, memory.q, v
        )
        assert speed == pytest.approx(rates[entry], abs=1e-7), entry
    assert kinds == {POINT, WALL, STOP, BALL_STOP}


def test_gaps_of_joints_are_how_far_they_may_turn(posed: Posed) -> None:
    table, robot, q = posed.memory.blocks, posed.robot, posed.memory.q
    place = robot.model.first_position
    angle = q[place[robot.joint_names.index("shoulder")]]
    at = place[robot.joint_names.index("neck")]
    turn = 2.0 * math.atan2(np.linalg.norm(q[at + 1 : at + 4]), abs(q[at]))
    wanted = [angle + 1.0, 0.5 - angle, 0.6 - turn]
    assert table.gap[np.isin(table.kind, (STOP, BALL_STOP))] == pytest.approx(wanted)


def test_points_have_friction_and_restitution_of_what_they_are_at(posed: Posed) -> None:
    table, nc = posed.memory.blocks, posed.robot.nc
    seen = np.isfinite(table.gap[nc : 2 * nc])
    assert seen.any()
    both = np.c_[table.friction[:nc], table.friction[nc : 2 * nc]][seen]
    assert np.array_equal(np.sort(both, axis=1), [[0.2, 0.6]] * len(both))
    assert np.all(table.restitution[:nc] == 0.4)


def test_the_problem_of_a_step_is_that_of_the_dense_equations(posed: Posed) -> None:
    """Free velocity J v + g/h and Delassus matrix J M⁻¹ Jᵀ, of all kinds of entries."""
    robot, memory, table = posed.robot, posed.memory, posed.memory.blocks
    nc = robot.nc
    wall = nc + int(np.argmin(table.gap[nc : 2 * nc]))
    chosen = np.array([0, 3, wall, *np.flatnonzero(~np.isin(table.kind, (POINT, WALL)))])
    size = table.size[chosen]
    first, rows = np.r_[0, np.cumsum(size)], int(size.sum())
    problem, assembly = memory.assembly.problem, memory.assembly
    next_v = np.random.default_rng(7).normal(size=robot.nv)
    uncompiled(assemble)(
        robot.model, STEP, table, memory.feet, memory.q, memory.v, next_v, memory.equations.tree,
        memory.equations.factor, len(chosen), chosen, first, table.last[chosen], assembly.rows,
        problem.free, assembly.before,
    )  # fmt: skip
    problem.first[: len(first)], assembly.count, assembly.complete = first, len(chosen), 0
    assembly.last[: len(chosen)] = table.last[chosen]
    uncompiled(complete)(robot.model, assembly)
    gaps = table.gap.copy()
    jacobian = np.vstack([posed.rows(int(entry)) for entry in chosen])
    wanted = jacobian @ next_v
    wanted[first[:-2]] += gaps[chosen[:-1]] / STEP  # dry friction, the last one, has no gap
    np.testing.assert_allclose(problem.free[:rows], wanted, atol=1e-6)
    np.testing.assert_allclose(
        assembly.before[: len(chosen)], (jacobian @ memory.v)[first[:-1]], atol=1e-6
    )
    mass = spatial.mass_matrix(robot, memory.q)
    dense = jacobian @ np.linalg.solve(mass, jacobian.T)
    np.testing.assert_allclose(problem.delassus[:rows, :rows], dense, atol=1e-6)


def test_the_free_velocity_is_that_of_the_equations_of_motion(posed: Posed) -> None:
    """M (v⁺ − v) = h (τ + passive − bias + Jᵀf), with a push that acts in 0.6 of the step."""
    robot, memory = posed.robot, posed.memory
    uncompiled(find_free_velocity)(
        robot.model, 0.0, STEP, memory.q, memory.v, memory.torque, memory.pushes,
        memory.equations, memory.next_v,
    )  # fmt: skip
    q, v = memory.q.copy(), memory.v.copy()
    torque = np.zeros(robot.nv)
    torque[robot.model.actuator_velocity] = 1.7
    jacobian = spatial.point_jacobian(robot, q, "arm", (0.1, 0.0, 0.2))[:3]
    pushed = 0.6 * jacobian.T @ [3.0, -2.0, 5.0]
    force = torque + spatial.passive_force(robot, q, v) - spatial.bias_force(robot, q, v) + pushed
    change = np.linalg.solve(spatial.mass_matrix(robot, q), STEP * force)
    np.testing.assert_allclose(memory.next_v, v + change, atol=1e-11)


def test_slip_is_the_velocity_across_the_normal_of_what_takes_part(posed: Posed) -> None:
    robot, memory = posed.robot, posed.memory
    v = np.random.default_rng(8).normal(size=robot.nv)
    candidate = np.array([1, 3, robot.nc])  # two points and a wall
    memory.reaction.slip[:] = 9.0
    uncompiled(find_slip)(
        robot.model, v, memory.feet, memory.blocks.kind, 3, candidate, memory.equations.tree,
        memory.reaction.slip,
    )  # fmt: skip
    wanted = np.zeros((robot.nc, 2))
    for contact in (1, 3):
        wanted[contact] = (posed.rows(contact) @ v)[1:]
    np.testing.assert_allclose(memory.reaction.slip, wanted, atol=1e-12)


def test_forces_are_told_where_they_are_looked_for(posed: Posed) -> None:
    """Those of a wall are added as the vectors that they are; joints do the work of their gaps."""
    robot, memory, table = posed.robot, posed.memory, posed.memory.blocks
    table.force[:] = np.random.default_rng(9).normal(size=table.force.shape)
    forces, frames = table.force.copy(), memory.feet.frame.reshape(-1, 3, 3)
    reaction = memory.reaction
    uncompiled(share_forces)(
        robot.model, memory.q, table, memory.feet, memory.contacts.force, reaction.stop_torque,
        reaction.friction_torque,
    )  # fmt: skip
    for contact in range(robot.nc):
        wall = robot.nc + contact
        told = frames[contact].T @ memory.contacts.force[contact]
        wanted = frames[contact].T @ forces[contact] + frames[wall].T @ forces[wall]
        np.testing.assert_allclose(told, wanted, atol=1e-12)
    stops = np.flatnonzero(np.isin(table.kind, (STOP, BALL_STOP)))
    wanted = sum(forces[entry, 0] * posed.rows(int(entry))[0] for entry in stops)
    np.testing.assert_allclose(reaction.stop_torque, wanted, atol=1e-6)
    (dry,) = np.flatnonzero(table.kind == DRY_JOINT)
    wanted = forces[dry, 0] * np.eye(robot.nv)[table.owner[dry]]
    np.testing.assert_allclose(reaction.friction_torque, wanted, atol=1e-15)


# Candidates.


def listed(posed: Posed, gaps: dict[int, float], v: np.ndarray) -> set[int]:
    """What takes part in a step with some gaps; all other entries are far away."""
    memory, table = posed.memory, posed.memory.blocks
    table.gap[:] = np.inf
    for entry, gap in gaps.items():
        table.gap[entry] = gap
    uncompiled(list_candidates)(
        posed.robot.model, STEP, memory.equations.tree, table, memory.feet, memory.q, v,
        memory.assembly,
    )  # fmt: skip
    return set(memory.assembly.candidate[: memory.assembly.count].tolist())


def test_what_could_act_within_a_step_takes_part(posed: Posed) -> None:
    """Within 5 mm, or at twice the speed; joints within 20 mrad; called ones and dry friction."""
    robot, table = posed.robot, posed.memory.blocks
    (dry,) = np.flatnonzero(table.kind == DRY_JOINT)
    lower, upper, ball = np.flatnonzero(np.isin(table.kind, (STOP, BALL_STOP))).tolist()
    still = np.zeros(robot.nv)
    near = {0: 4.9e-3, 1: 5.1e-3, lower: 19e-3, upper: 21e-3, ball: -0.1}
    assert listed(posed, near, still) == {0, lower, ball, dry}
    table.called[1] = 1
    assert listed(posed, near, still) == {0, 1, lower, ball, dry}
    table.called[1] = 0
    # The first joint velocity that brings the upper end nearer, 12 rad/s: 24 mrad at twice that.
    turns = still.copy()
    turns[robot.model.first_velocity[robot.joint_names.index("shoulder")]] = 12.0
    assert upper in listed(posed, {upper: 23e-3}, turns)
    assert upper not in listed(posed, {upper: 25e-3}, turns)
    assert lower not in listed(posed, {lower: 23e-3}, turns)
    turns *= 100.0
    assert upper not in listed(posed, {upper: 0.41}, turns)  # so fast is nothing


def test_the_problem_begins_as_the_last_one_ended(posed: Posed) -> None:
    memory, table = posed.memory, posed.memory.blocks
    rng = np.random.default_rng(10)
    table.impulse[:] = rng.normal(size=table.impulse.shape)
    table.mode[:] = rng.integers(0, 3, table.mode.size)
    (dry,) = np.flatnonzero(table.kind == DRY_JOINT)
    lower = int(np.flatnonzero(table.kind == STOP)[0])
    assert listed(posed, {2: 0.0, lower: 0.0}, np.zeros(posed.robot.nv)) == {2, lower, dry}
    problem, answer = memory.assembly.problem, memory.assembly.answer
    assert problem.count == 3
    assert problem.first[:4].tolist() == [0, 3, 4, 5]
    assert problem.set[:3].tolist() == [CONE, HALF_LINE, INTERVAL]
    assert problem.bound[:3] == pytest.approx([0.0, 0.0, 0.4 * STEP])
    assert problem.friction[0] == table.friction[2]
    assert answer.mode[:3].tolist() == table.mode[[2, lower, dry]].tolist()
    wanted = [*table.impulse[2], table.impulse[lower, 0], table.impulse[dry, 0]]
    assert answer.impulse[:5].tolist() == wanted


def test_what_a_step_would_miss_is_called(posed: Posed) -> None:
    """An end of a range that the velocity found leads through, and that took no part."""
    robot, memory, table = posed.robot, posed.memory, posed.memory.blocks
    upper = int(np.flatnonzero(table.kind == STOP)[1])
    table.gap[:] = np.inf
    table.gap[upper], table.called[:] = 0.03, 0
    v = np.zeros(robot.nv)
    shoulder = robot.model.first_velocity[robot.joint_names.index("shoulder")]

    def missed(speed: float, *candidates: int) -> bool:
        v[shoulder] = speed
        return bool(uncompiled(call_what_is_missed)(
            robot.model, STEP, memory.equations.tree, memory.feet, memory.q, v, len(candidates),
            np.array([*candidates, 0]), table,
        ))  # fmt: skip

    assert not missed(29.0)
    assert not missed(31.0, upper)
    assert not table.called.any()
    assert missed(31.0)
    assert np.flatnonzero(table.called).tolist() == [upper]
    assert not missed(31.0)


def test_answers_are_kept_and_forces_add_up_over_parts_of_a_step(posed: Posed) -> None:
    memory, table, assembly = posed.memory, posed.memory.blocks, posed.memory.assembly
    (dry,) = np.flatnonzero(table.kind == DRY_JOINT)
    listed(posed, {1: 0.0, 2: 0.0}, np.zeros(posed.robot.nv))
    table.mode[:] = SLIP
    table.impulse[:] = table.force[:] = 0.5
    assembly.answer.mode[:3] = [STICK, OPEN, SLIP]
    assembly.answer.impulse[:7] = np.arange(7.0)
    assembly.answer.velocity[:7] = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]  # the second one has left
    impact = 10.0 + np.arange(7.0)
    uncompiled(note_answer_of)(0.25 * STEP, STEP, 7, impact, assembly, table)
    assert table.mode[[1, 2, dry]].tolist() == [STICK, OPEN, SLIP]
    assert table.mode[0] == table.mode[3] == OPEN
    assert table.impulse[1].tolist() == [0.0, 1.0, 2.0]
    assert table.impulse[2].tolist() == [3.0, 4.0, 5.0]
    assert table.impulse[dry, 0] == 6.0
    assert not table.impulse[0].any()
    np.testing.assert_allclose(table.force[1], 0.5 + impact[:3] / STEP)
    np.testing.assert_allclose(table.force[dry, 0], 0.5 + impact[6] / STEP)
    assert table.force[0].tolist() == [0.5] * 3
    assert table.touching[[1, 2, dry]].tolist() == [7, NEVER_TOUCHED, NEVER_TOUCHED]
    assert memory.blocks is table


# Wedges.


def test_only_shallow_depths_are_forgiven(posed: Posed) -> None:
    """0.1 mm and no more; and what is not in the ground is asked as before."""
    table, assembly = posed.memory.blocks, posed.memory.assembly

    def forgiven(*gaps: float) -> tuple[bool, list[float]]:
        listed(posed, dict(enumerate(gaps)), np.zeros(posed.robot.nv))
        assembly.problem.free[: 3 * len(gaps)] = np.repeat(gaps, 3) / STEP
        changed = uncompiled(forgive_depth)(STEP, table, assembly)
        return bool(changed), (assembly.problem.free[: 3 * len(gaps) : 3] * STEP).tolist()

    assert forgiven(-0.9e-4, 2e-4) == (True, pytest.approx([0.0, 2e-4]))
    assert forgiven(-0.9e-4, -1.1e-4) == (False, pytest.approx([-0.9e-4, -1.1e-4]))
    assert forgiven(0.0, 2e-4) == (False, pytest.approx([0.0, 2e-4]))
    assert np.all(assembly.problem.free[1:3] == 0.0)


def test_wedged_steps_are_asked_again_after_1_2_4_8_steps(posed: Posed) -> None:
    wedge = posed.memory.wedge
    wedge.wedged = NEVER_TOUCHED
    asked = []
    for step in range(20, 60):
        if not uncompiled(goes_on_wedged)(step, wedge):
            asked.append(step - 20)
        uncompiled(note_relaxed)(step, wedge)
        assert wedge.relaxed == 1
    assert asked == [0, 1, 2, 4, 8, 16, 32]
    assert not uncompiled(goes_on_wedged)(70, wedge)  # it was free in between
    uncompiled(note_relaxed)(70, wedge)
    assert wedge.since == 70


def test_where_there_is_no_way_out_none_is_asked_for(posed: Posed) -> None:
    """A solve that fails is tried once without; one that is wedged begins without."""
    memory, table, assembly, wedge = (
        posed.memory, posed.memory.blocks, posed.memory.assembly, posed.memory.wedge
    )  # fmt: skip
    asked: list[float] = []

    def solve(_: object, both: tuple[Any, ...]) -> int:
        asked.append(float(both[0].free[0]))
        return SOLVED if asked[-1] >= 0.0 else NOT_FOUND

    solved = partial(
        uncompiled(solve_positions, {call_at: solve}), table=table, solver=memory.solver,
        assembly=assembly, wedge=wedge, factor=memory.equations.factor, holding=memory.holding,
    )  # fmt: skip
    wedge.wedged = NEVER_TOUCHED
    for steps, tries in ((0, 2), (1, 2), (2, 2), (3, 1), (4, 2), (5, 1)):
        listed(posed, {0: -5e-5}, np.zeros(posed.robot.nv))
        assembly.problem.free[:3] = (-0.05, 0.0, 0.0)
        asked.clear()
        assert solved(posed.robot.model, STEP, steps) == SOLVED
        assert len(asked) == tries
        assert wedge.relaxed == 1
        assert wedge.wedged == steps
    listed(posed, {0: 1e-3}, np.zeros(posed.robot.nv))
    assembly.problem.free[:3] = (-1.0, 0.0, 0.0)
    assert solved(posed.robot.model, STEP, 6) == NOT_FOUND
    assert wedge.relaxed == 0


# Impacts.


def test_an_impact_makes_as_much_energy_as_the_robot_has_more(posed: Posed) -> None:
    """½ vᵀMv after less before, of impulses that push it on; none is told of where it loses."""
    robot, memory = posed.robot, posed.memory
    impact = memory.impact
    mass = spatial.mass_matrix(robot, memory.q)
    jacobian = np.vstack([posed.rows(0), posed.rows(1)])
    its, rng = impact.problem, np.random.default_rng(11)
    for side in (1.0, -1.0):
        v = side * np.linalg.solve(mass, jacobian.T @ np.ones(6))
        impulse = np.abs(rng.normal(size=6))
        after = v + np.linalg.solve(mass, jacobian.T @ impulse) if side > 0 else 0.1 * v
        impulse = impulse if side > 0 else -0.9 * np.ones(6) * side
        its.count, its.first[:3] = 2, [0, 3, 6]
        impact.bounce[:2] = rng.normal(size=2)
        bounce = np.zeros(6)
        bounce[[0, 3]] = impact.bounce[:2]
        its.free[:6] = jacobian @ v + bounce
        impact.answer.velocity[:6] = jacobian @ after + bounce
        impact.answer.impulse[:6] = impulse
        made = 0.5 * after @ mass @ after - 0.5 * v @ mass @ v
        assert (made > 0.0) == (side > 0.0)
        told = uncompiled(energy_of_impact)(impact)
        assert told == pytest.approx(max(made, 0.0), rel=1e-9)


def test_the_impact_is_of_what_touches_with_its_bounces(posed: Posed) -> None:
    """Gaps taken out of the free velocity, e v_n put in; what does not touch is left out."""
    table, assembly, impact = posed.memory.blocks, posed.memory.assembly, posed.memory.impact
    (dry,) = np.flatnonzero(table.kind == DRY_JOINT)
    gaps = {0: 2e-4, 1: -3e-4, 2: 4e-4}
    assert listed(posed, gaps, np.zeros(posed.robot.nv)) == {0, 1, 2, dry}
    rng = np.random.default_rng(12)
    problem = assembly.problem
    half = rng.normal(size=(10, 10))
    problem.delassus[:10, :10] = half @ half.T
    assembly.complete, model = 1, posed.robot.model
    free = rng.normal(size=10)
    free[[0, 3, 6]] = [-0.5, -0.4, 1.0]  # the first two come down, the third does not
    problem.free[:10] = free
    assembly.before[:4] = [-1.0, -2.0, -3.0, 0.0]
    assembly.answer.velocity[:10] = 0.0
    assembly.answer.velocity[6] = 1.0
    table.touching[:] = NEVER_TOUCHED
    table.restitution[:3] = [0.5, 0.25, 0.5]
    assert uncompiled(closes)(STEP, 3, table, assembly)
    uncompiled(pose_impact_of)(model, STEP, 3, False, True, table, assembly, impact)
    its = impact.problem
    assert its.count == 3
    assert impact.member[:3].tolist() == [0, 1, 3]
    assert its.first[:4].tolist() == [0, 3, 6, 7]
    kept = [0, 1, 2, 3, 4, 5, 9]
    wanted = free[kept]
    wanted[0] += -2e-4 / STEP + 0.5 * -1.0
    wanted[3] += 3e-4 / STEP + 0.25 * -2.0
    np.testing.assert_allclose(its.free[:7], wanted, atol=1e-12)
    np.testing.assert_array_equal(its.delassus[:7, :7], problem.delassus[np.ix_(kept, kept)])
    assert its.bound[2] == pytest.approx(0.4 * STEP)
    uncompiled(pose_impact_of)(
        model, STEP, 3, True, True, table, assembly, impact
    )  # not asked to come out
    assert its.free[3] == pytest.approx(free[3] + 0.25 * -2.0)
    uncompiled(pose_impact_of)(model, STEP, 3, False, False, table, assembly, impact)  # no bounces
    assert its.free[3] == pytest.approx(free[3] + 3e-4 / STEP)
    # What touched in the step before, with no new one, makes no impact.
    listed(posed, {0: 2e-4}, np.zeros(posed.robot.nv))
    problem.free[0], assembly.answer.velocity[0], table.touching[0] = -0.5, 0.0, 3
    assert not uncompiled(closes)(STEP, 3, table, assembly)
    assert uncompiled(closes)(STEP, 4, table, assembly)


# Events and the worst of a run.


def test_events_tell_what_each_entry_does() -> None:
    """Touchdown, slip, stick and lift-off of a point, an end of a range, dry friction; no walls."""
    table = BlockTable.allocate(
        entries=4, kind=np.array([POINT, WALL, STOP, DRY_JOINT]), owner=np.array([0, 0, 5, 3]),
        gap=np.array([0.0, 0.0, 0.0, np.inf]),
    )  # fmt: skip
    reported = SpatialReported.allocate(entries=4)
    told = Told.allocate(ne=40, components=3)
    v, slip = np.zeros(6), np.zeros((1, 2))

    def step(number: int) -> list[tuple[float, EventKind, int]]:
        begin = told.events
        uncompiled(note_spatial_events)(
            number * STEP, (number + 1) * STEP, STEP, number == 0, v, slip, table, told, reported
        )
        new = range(begin, told.events)
        return [
            (round(told.event_time[i] / STEP), EventKind(told.event_kind[i]), told.event_contact[i])
            for i in new
        ]

    table.force[0], table.force[1] = (10.0, 1.0, 2.0), (3.0, 0.0, 0.0)
    assert step(0) == []  # it stands as the run begins
    slip[0] = (0.6e-6, 0.9e-6)
    assert step(1) == [(2, EventKind.SLIP, 0)]
    assert step(2) == []
    slip[0] = (0.6e-6, 0.6e-6)
    assert step(3) == [(4, EventKind.STICK, 0)]
    table.force[0], table.gap[0] = 0.0, 0.5e-7
    assert step(4) == []  # it does not press, but is not away yet
    table.gap[0] = 2e-7
    assert step(5) == [(5, EventKind.LIFTOFF, 0)]
    table.force[0, 0], table.force[2, 0], v[3] = 20.0, 4.0, 2e-6
    slip[0] = (0.0, -2e-6)
    assert step(6) == [
        (7, EventKind.TOUCHDOWN, 0), (7, EventKind.SLIP, 0), (7, EventKind.JOINT_STOP, 5),
        (7, EventKind.JOINT_SLIP, 3),
    ]  # fmt: skip
    assert told.event_impulse[told.events - 4].tolist() == pytest.approx([20.0 * STEP, 0.0, 0.0])
    v[3], table.force[2, 0], table.gap[2] = -0.5e-6, 0.0, 1.0
    assert step(7) == [(8, EventKind.JOINT_STICK, 3)]


def test_the_deepest_point_of_all_steps_is_kept() -> None:
    """Of points and walls alone, which come first; joints beyond their range do not count."""
    tally = SimpleNamespace(penetration=1e-5)
    for gaps, worst in (
        ([0.3, -2e-6, -9.0], 1e-5), ([-2e-4, 0.1, -9.0], 2e-4), ([0.1, -3e-4, 0.0], 3e-4),
        ([0.2, 0.1, 0.0], 3e-4),
    ):  # fmt: skip
        uncompiled(note_deepest)(2, np.array(gaps), tally)
        assert tally.penetration == worst


# Whole steps, of solves that end as they are told.


@dataclass
class Hovering:
    """A ball 0.5 mm above the ground, whose solves push nothing and leave the residuals given."""

    robot: hs.SpatialRobot
    memory: SpatialMemory
    efforts: list[int] = field(default_factory=list)

    def step(self, residual: float, status: int = SOLVED) -> bool:
        """Take a step of 1 ms of which each solve ends like this; note its effort."""

        def solve(_: object, both: tuple[Any, ...]) -> int:
            _, work, answer = both
            self.efforts.append(work.settings.effort)
            answer.impulse[:], answer.velocity[:], answer.residual = 0.0, 1.0, residual
            return status

        memory, model, ground = self.memory, self.robot.model, hs.SpatialGround().model()
        uncompiled(find_state)(
            model, ground, memory.q, memory.v, memory.equations, memory.blocks, memory.contacts,
            memory.feet,
        )  # fmt: skip
        step = uncompiled(take_step, {call_at: solve})
        return bool(step(model, ground, 0.0, STEP, True, memory))


@pytest.fixture
def hovering(made: Maker) -> Hovering:
    robot = made("<body name='ball'><freejoint/><geom type='sphere' size='0.1' mass='1'/></body>")
    memory = allocate_spatial_memory(robot)
    memory.q[:] = robot.reference_state().q
    memory.q[2] = 0.1005
    return Hovering(robot, memory)


def test_the_worst_residual_of_all_steps_is_kept(hovering: Hovering) -> None:
    worst = []
    for residual in (1e-10, 3e-10, 2e-10):
        assert hovering.step(residual)
        assert hovering.memory.reaction.residual == residual
        worst.append(hovering.memory.tally.residual)
    assert worst == [1e-10, 3e-10, 3e-10]
    assert hovering.efforts == [MOST_ITERATIONS] * 3
    assert hovering.memory.v[2] == pytest.approx(-3.0 * STEP * 9.81)


def test_a_step_that_is_nearly_solved_is_taken_in_eighths_and_told(hovering: Hovering) -> None:
    """Halved three times, then each part is tried with more effort; the way is the same."""
    memory = hovering.memory
    assert hovering.step(1e-7, NOT_FOUND)
    assert hovering.efforts == [400] * 3 + [400, 20000] * 8
    assert memory.settings.effort == 400
    counts = memory.step
    assert (counts.parts, counts.halved, counts.uncertified, counts.relaxed) == (8, 1, 1, 0)
    assert memory.tally.residual == 1e-7
    assert memory.v[2] == pytest.approx(-STEP * 9.81)
    assert memory.q[2] == pytest.approx(0.1005 - 9.81 * STEP**2 / 64.0 * 36.0)  # 1 + 2 + … + 8
    assert hovering.step(1e-10)  # the next one begins anew
    assert (counts.parts, counts.halved, counts.uncertified) == (1, 0, 0)


def test_a_step_that_is_not_nearly_solved_is_not_taken(hovering: Hovering) -> None:
    memory = hovering.memory
    before = memory.q.copy()
    assert hovering.step(1e-10)
    kept, speed = memory.q.copy(), memory.v.copy()
    assert not np.array_equal(kept, before)
    assert not hovering.step(2e-6, NOT_FOUND)
    assert memory.tally.unsolved == 2e-6
    assert memory.tally.residual == 1e-10
    assert np.array_equal(memory.q, kept)
    assert np.array_equal(memory.v, speed)
    assert not hovering.step(np.nan, NOT_FOUND)
    assert memory.tally.unsolved == np.inf


# What simulations in space are made of.


def test_solvers_have_room_for_the_largest_of_a_batch(made: Maker) -> None:
    """In whatever order they come, and for walls only where there are boxes."""
    small = made("<body name='ball'><freejoint/><geom type='sphere' size='0.1' mass='1'/></body>")
    large = made(TOY, MOTOR)
    plane = hs.SpatialGround()
    nc = large.nc
    for settings, entries, rows, speeds in (
        ([(small, plane)], 1, 3, small.nv),
        ([(small, plane), (large, plane)], nc + 4, 3 * nc + 4, large.nv),
        ([(large, plane), (small, plane)], nc + 4, 3 * nc + 4, large.nv),
        ([(large, plane), (large, WALLS), (small, plane)], 3 * nc + 4, 9 * nc + 4, large.nv),
    ):
        scratch = SPACE.scratch([SimpleNamespace(robot=r, ground=g) for r, g in settings])
        assert scratch.assembly.candidate.shape == (entries,)
        assert scratch.assembly.rows.shape[0] == rows
        assert scratch.assembly.problem.delassus.shape == (rows, rows)
        assert scratch.impact.impulse.shape == (rows,)
        assert scratch.solver.scaled.matrix.shape == (rows, rows)
        assert scratch.solver.iterate.mode.shape == (entries,)
        assert scratch.assembly.change.shape == (speeds,)


def test_the_height_of_a_robot_is_that_above_the_plane(made: Maker) -> None:
    robot = made(TOY, MOTOR)
    q = robot.reference_state().q
    ground = hs.SpatialGround(normal=(0.3, 0.0, 1.0), height=0.2)
    center = spatial.center_of_mass(robot, q)
    n = np.array([0.3, 0.0, 1.0]) / math.sqrt(1.09)
    wanted = n @ (center - [0.0, 0.0, 0.2])
    assert SPACE.height(robot, hs.State(q, np.zeros(robot.nv)), ground) == pytest.approx(wanted)


def test_ground_with_and_without_boxes_does_not_take_the_place_of_the_other(made: Maker) -> None:
    robot = made(TOY, MOTOR)
    for walls in (False, True):
        memory = allocate_spatial_memory(robot, walls=walls)
        with_boxes, without = WALLS, hs.SpatialGround()
        SPACE.check_fit(with_boxes if walls else without, memory)
        words = "has no boxes, and .* one with some" if walls else "has boxes, and .* with none"
        with pytest.raises(SimulationError, match=words):
            SPACE.check_fit(without if walls else with_boxes, memory)


def test_what_touched_is_forgotten_with_the_ground_and_stops_with_the_place(made: Maker) -> None:
    memory = allocate_spatial_memory(made(TOY, MOTOR), walls=True)
    kind, touching = memory.blocks.kind, memory.blocks.touching
    touching[:], memory.wedge.wedged = 8, 8
    SPACE.laid(memory)
    stays = np.isin(kind, (STOP, BALL_STOP))
    assert np.all(touching[stays] == 8)
    assert np.all(touching[~stays] == NEVER_TOUCHED)
    assert memory.wedge.wedged == NEVER_TOUCHED
    memory.wedge.wedged = 8
    SPACE.moved(hs.State(memory.q, memory.v), made(TOY, MOTOR), memory)
    assert np.all(touching == NEVER_TOUCHED)
    assert memory.wedge.wedged == NEVER_TOUCHED


def test_latches_brakes_and_voltages_are_of_the_plane(made: Maker) -> None:
    robot = made(TOY, MOTOR)
    memory = allocate_spatial_memory(robot)
    state = robot.reference_state()
    assert SPACE.held(robot, state, WALLS, (), None) == ((), ())
    assert SPACE.still_latched(robot, [], memory) == []
    assert SPACE.would_brake(robot, (), memory) is False
    assert SPACE.latched(robot, memory) == SPACE.braked(robot, memory) == ()
    for refused, word in (
        (lambda: SPACE.held(robot, state, WALLS, ("neck",), ()), "latches"),
        (lambda: SPACE.held(robot, state, WALLS, (), (0,)), "brakes"),
        (lambda: SPACE.latch(robot, state, WALLS, ["neck"], memory), "latches"),
        (lambda: SPACE.brake(robot, state, [0], memory), "brakes"),
        (lambda: SPACE.still_latched(robot, ["neck"], memory), "latches"),
        (lambda: SPACE.would_brake(robot, ["neck"], memory), "brakes"),
    ):
        with pytest.raises(SimulationError, match=f"^{word} are for robots in the plane"):
            refused()
    assert SPACE.commands_voltage(object(), robot) is False
    with pytest.raises(ControllerError, match="commands voltages"):
        SPACE.commands_voltage(SimpleNamespace(commands_voltage=True), robot)


def test_friction_is_that_of_the_face_below_and_unknown_at_a_wall(
    made: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A box 1 µm before a wall: its corners ahead meet both, those behind the ground alone."""
    monkeypatch.setattr(space, "find_state", uncompiled(find_state))
    robot = made(
        "<body name='b' pos='0 0 0.1'><freejoint/><geom type='box' size='.2 .1 .1'/></body>"
    )
    q, v = robot.reference_state().q, np.zeros(6)
    wall = hs.Box(center=(0.7, 0.0, 0.5), size=(1.0, 2.0, 1.0), friction=0.2)
    for apart, ahead in ((0.5e-6, np.nan), (2e-6, 0.3)):
        q[0] = -apart
        ground = hs.SpatialGround(friction=0.3, boxes=(wall,))
        found = SpatialLook(robot).friction(ground, q, v)
        x = spatial.contact_positions(robot, q)[:, 0]
        low = spatial.contact_positions(robot, q)[:, 2] < 0.1
        wanted = np.where(x > 0.0, ahead, 0.3)
        np.testing.assert_array_equal(found[low], wanted[low])
    flat = SpatialLook(robot).friction(hs.SpatialGround(friction=0.3), q, v)
    assert flat == pytest.approx(0.3)


def test_a_solver_has_its_own_settings_and_counts(made: Maker) -> None:
    memory = allocate_spatial_memory(made(TOY, MOTOR))
    assert memory.solver.settings.address == memory.settings.address
    assert memory.solver.tally.address == memory.solves.address
    usual = block_workspace(1, 3, ready=False).settings
    assert memory.settings.tolerance == usual.tolerance == 1e-9
    assert memory.settings.ways == usual.ways
    assert memory.settings.effort < usual.effort
    assert memory.settings.floor > 0.0
