"""Contact points of a walker on discs, against its Jacobians and masses by numpy.

Kernels run as plain Python here.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.sets import CONE
from heelstrike.robot import RobotBuilder
from heelstrike.sim.contacts import geometry, points
from heelstrike.sim.contacts.straight_line import has_programs, usual_points
from heelstrike.sim.memory import Memory, allocate_memory

GROUND = hs.Ground(slope=0.3, friction=0.6, restitution=0.4)


def walker() -> hs.Robot:
    """A trunk with two legs, that touches with a disc and two points of other friction."""
    build = RobotBuilder("walker")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=5.0, inertia=0.4)
    hip = build.hinge("hip", trunk, at=(0.1, 0.0), mass=2.0, inertia=0.1,
                      center_of_mass=(0.0, -0.3), armature=0.05)  # fmt: skip
    knee = build.hinge("knee", hip, at=(0.0, -0.5), mass=1.0, inertia=0.05,
                       center_of_mass=(0.05, -0.2))  # fmt: skip
    other = build.hinge("other", trunk, mass=3.0, inertia=0.2, center_of_mass=(0.0, -0.4))
    build.contact(knee, (0.05, -0.5), radius=0.07, friction_scale=0.5)
    build.contact(other, (0.0, -0.9), restitution_scale=0.5)
    build.contact(trunk, (-0.2, 0.3), radius=0.02)
    return build.build()


ROBOT = walker()


def posed(seed: int) -> tuple[Memory, Any, Any, Any]:
    """Kinematics, points and factors of a random state; Jacobian (2 nc, nv) and mass matrix."""
    draw = np.random.default_rng(seed)
    memory = allocate_memory(ROBOT)
    q, v = draw.normal(size=ROBOT.nq), draw.normal(size=ROBOT.nv)
    model, equations = ROBOT.model, memory.equations
    memory.q[:], memory.v[:] = q, v
    equations.programs[:] = 0
    observe = uncompiled(geometry.observe)
    observe(model, GROUND.model(), q, v, equations.tree, memory.contacts, memory.surface)
    rates = [hs.contact_kinematics(ROBOT, q, unit, GROUND).velocity for unit in np.eye(ROBOT.nv)]
    jacobian = np.transpose([each.ravel() for each in rates])
    return memory, q, jacobian, hs.dynamics.mass_matrix(ROBOT, q)


def test_points_are_located_on_the_rims_of_their_discs() -> None:
    memory, q, _, _ = posed(1)
    at = hs.contact_kinematics(ROBOT, q, memory.v, GROUND)
    np.testing.assert_allclose(memory.contacts.gap, at.gap, rtol=1e-12)
    np.testing.assert_allclose(memory.contacts.position, at.position, rtol=1e-12)
    normal = [-np.sin(0.3), np.cos(0.3)]
    np.testing.assert_allclose(memory.contacts.normal, [normal] * 3, rtol=1e-12)
    scales = ROBOT.model.friction_scale, ROBOT.model.restitution_scale
    assert {0.5, 1.0} == set(scales[0].tolist())
    np.testing.assert_allclose(memory.surface.friction[:3], 0.6 * scales[0])
    np.testing.assert_allclose(memory.surface.restitution[:3], 0.4 * scales[1])
    found = [
        uncompiled(geometry.contact_velocity)(
            ROBOT.model, memory.equations.tree, memory.contacts, contact
        )
        for contact in range(3)
    ]
    np.testing.assert_allclose(found, at.velocity, rtol=1e-11)


@pytest.mark.parametrize("chosen", [[0, 1, 2], [2, 0], [1]])
def test_points_at_once_answer_as_their_jacobian_does(chosen: list[int]) -> None:
    """G = J A⁻¹ Jᵀ, w = J v, and Δv = A⁻¹ Jᵀ λ, by the factor of the mass matrix."""
    memory, _, jacobian, mass = posed(2)
    model, tree, contacts = ROBOT.model, memory.equations.tree, memory.contacts
    factor, which = np.zeros_like(mass), np.array(chosen)
    from heelstrike.dynamics.kernels import factorize

    uncompiled(factorize)(model, mass, factor)
    rows = [2 * point + k for point in chosen for k in range(2)]
    J, size = jacobian[rows], 2 * len(chosen)
    scratch, delassus = np.full((size, ROBOT.nv), 9.0), np.full((size, size), 9.0)
    uncompiled(points.point_delassus)(model, which, tree, contacts, factor, scratch, delassus)
    np.testing.assert_allclose(delassus, J @ np.linalg.solve(mass, J.T), atol=1e-11)
    velocity, v = np.full((3, 2), 9.0), np.random.default_rng(4).normal(size=ROBOT.nv)
    uncompiled(points.point_velocities)(model, which, contacts, v, tree, velocity)
    np.testing.assert_allclose(velocity[chosen].ravel(), J @ v, atol=1e-12)
    others = [point for point in range(3) if point not in chosen]
    assert np.all(velocity[others] == 9.0)
    impulse = np.random.default_rng(5).normal(size=(3, 2))
    after, force = v.copy(), np.zeros(ROBOT.nv)
    uncompiled(points.push_points)(model, which, contacts, factor, impulse, tree, force, after)
    pushed = J.T @ impulse[chosen].ravel()
    np.testing.assert_allclose(after, v + np.linalg.solve(mass, pushed), atol=1e-11)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("everywhere", [False, True])
def test_delassus_matrices_and_impulses_of_single_candidates(
    straight: bool, everywhere: bool
) -> None:
    """By articulated bodies or by the factor; along the branch of a leaf, or of all joints."""
    memory, _, jacobian, mass = posed(3)
    model, equations, assembly = ROBOT.model, memory.equations, memory.assembly
    equations.programs[geometry.EQUATIONS] = int(straight)
    uncompiled(geometry.weigh)(model, equations)
    directions, problem = assembly.directions, assembly.problem
    problem.first[:4], problem.set[:3] = [0, 2, 3, 5], CONE
    directions.half[:], problem.delassus[:] = np.nan, np.nan
    contacts, tree = memory.contacts, equations.tree
    rows = uncompiled(geometry.contact_rows)
    rows(model, tree, contacts, 0, 0, problem.first, directions)
    rows(model, tree, contacts, 1, 2, problem.first, directions)
    unit = uncompiled(geometry.write_unit_row)
    unit(4, 1, 0, -1.0, problem.first, directions.leaf, directions.jacobian)
    assert directions.leaf[:3].tolist() == [model.contact_link[0], 4, model.contact_link[1]]
    if everywhere:
        directions.leaf[:3] = geometry.EVERYWHERE
    J = np.vstack((jacobian[:2], -np.eye(ROBOT.nv)[4], jacobian[2:4]))
    np.testing.assert_allclose(directions.jacobian[:5], J, atol=1e-12)
    problem.set[1] = 1
    uncompiled(geometry.assemble_delassus)(model, 3, equations, directions, problem)
    G = problem.delassus[:5, :5]
    np.testing.assert_allclose(G, J @ np.linalg.solve(mass, J.T), atol=1e-10)
    v = np.ones(ROBOT.nv)
    impulse = np.random.default_rng(6).normal(size=5)
    uncompiled(geometry.add_impulse)(model, 5, impulse, directions, equations, v)
    np.testing.assert_allclose(v, 1.0 + np.linalg.solve(mass, J.T @ impulse), atol=1e-10)


def test_rows_of_zeros_have_zeros_in_the_matrix() -> None:
    memory, _, _, _ = posed(3)
    model, equations, assembly = ROBOT.model, memory.equations, memory.assembly
    uncompiled(geometry.weigh)(model, equations)
    directions, problem = assembly.directions, assembly.problem
    problem.first[:3], problem.set[:2] = [0, 2, 4], 3
    unit = uncompiled(geometry.write_unit_row)
    directions.jacobian[:] = 9.0
    unit(4, 0, 1, 1.0, problem.first, directions.leaf, directions.jacobian)
    unit(3, 1, 1, 1.0, problem.first, directions.leaf, directions.jacobian)
    assert not directions.jacobian[[0, 2]].any()
    problem.delassus[:] = 9.0
    uncompiled(geometry.assemble_delassus)(model, 2, equations, directions, problem)
    assert not problem.delassus[[0, 2], :4].any()
    assert not problem.delassus[:4, [0, 2]].any()
    assert problem.delassus[1, 1] > 0.0


def test_masses_with_something_added_are_solved_with() -> None:
    for straight in (False, True):
        memory, q, _, mass = posed(4)
        model, equations = ROBOT.model, memory.equations
        equations.added[:] = 0.1 * np.arange(1, ROBOT.nv + 1)
        uncompiled(geometry.evaluate_equations)(model, q, memory.v, equations)
        bias = hs.dynamics.bias_force(ROBOT, q, memory.v)
        np.testing.assert_allclose(equations.bias, bias, atol=1e-11)
        equations.programs[geometry.EQUATIONS] = int(straight)
        uncompiled(geometry.weigh)(model, equations)
        heavier = mass + np.diag(equations.added)
        if straight:
            np.testing.assert_allclose(equations.mass_matrix, heavier, atol=1e-11)
            continue
        x = np.random.default_rng(7).normal(size=ROBOT.nv)
        found = x.copy()
        uncompiled(geometry.solve_mass_matrix)(model, equations, found)
        np.testing.assert_allclose(found, np.linalg.solve(heavier, x), atol=1e-10)


def test_on_curved_ground_gaps_accelerate_with_the_square_of_the_speed() -> None:
    """κ s² of the centre of a disc, at 0.1 m over its contact point; nothing of a flat one."""
    model: Any = SimpleNamespace(contact_radius=np.array([0.1]), contact_link=[3])
    contacts: Any = SimpleNamespace(
        position=np.array([[1.0, 2.0]]), normal=np.array([[0.6, 0.8]]), gap=np.array([0.3])
    )
    tree: Any = SimpleNamespace(velocity="velocity")
    parts = {
        geometry.place_of: lambda _, place: (place[0] - 0.5, place[1] - 0.25),
        geometry.velocity_at: lambda *given: asked.append(given) or (2.0, 1.0),
    }
    asked: list[Any] = []
    bend = uncompiled(geometry.curvature_acceleration, replace=parts)
    along = 2.0 * 0.8 - 1.0 * 0.6
    assert bend(model, tree, contacts, 0, 1.5) == pytest.approx(1.5 * along**2)
    assert asked[0][1] == 3
    assert asked[0][2] == pytest.approx((0.56, 1.83))
    told: list[Any] = []

    def curvature(ground: Any, x: float, distance: float, normal: Any) -> float:
        told.append((x, distance))
        return 7.0

    surface: Any = SimpleNamespace(friction="f", restitution="r", curvature=np.zeros(1))
    locate = uncompiled(
        geometry.locate_contacts,
        replace={geometry.path_curvature: curvature, geometry.locate_points: lambda *_: None},
    )
    model.nc = 1
    locate(model, SimpleNamespace(curved=0), tree, contacts, surface)
    assert told == []
    locate(model, SimpleNamespace(curved=1), tree, contacts, surface)
    assert surface.curvature[0] == 7.0
    assert told == [(pytest.approx(1.06), pytest.approx(0.4))]


@pytest.mark.parametrize(
    ("program", "segments", "curved", "plays"),
    [(3, 1, 0, True), (0, 1, 0, False), (3, 2, 0, False), (3, 1, 1, False)],
)
def test_points_are_located_by_a_program_over_one_straight_segment(
    program: int, segments: int, curved: int, plays: bool
) -> None:
    called: list[Any] = []
    run = uncompiled(
        geometry.locate_in_straight_line,
        replace={
            geometry.play: lambda number, given: called.append(("program", number, given)),
            geometry.locate_contacts: lambda *given: called.append(("loops", given)),
        },
    )
    ground: Any = SimpleNamespace(friction=np.zeros(segments), curved=curved)
    surface: Any = SimpleNamespace(friction="f", restitution="r")
    run("model", ground, program, "tree", "contacts", surface)
    if plays:
        assert called == [("program", 3, ("model", ground, "tree", "contacts", "f", "r"))]
    else:
        assert called == [("loops", ("model", ground, "tree", "contacts", surface))]


def test_programs_are_for_robots_that_are_not_too_long() -> None:
    assert [has_programs(nv) for nv in (0, 1, 12, 13)] == [False, True, True, False]
    assert usual_points(ROBOT).tolist() == sorted(
        {point for foot in ROBOT.feet for point in foot.contacts} or range(3)
    )
    feet: Any = SimpleNamespace(feet=(), nc=8)
    assert usual_points(feet).tolist() == list(range(8))
    feet.nc = 9
    assert usual_points(feet).tolist() == []
    feet.feet = (SimpleNamespace(contacts=(5, 2)), SimpleNamespace(contacts=(7,)))
    assert usual_points(feet).tolist() == [2, 5, 7]
