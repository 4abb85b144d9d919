"""Inverse dynamics with contact: forward dynamics undoes it, and the chosen split is the best."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import parallel_ankles
from robot_cases import NAMED, RobotCase
from scipy.optimize import linprog, minimize

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.contact.queries.force_distribution import ForceDistribution, distribute
from heelstrike.contact.queries.inverse_dynamics import _friction_use
from heelstrike.errors import ContactProblemError, RobotError
from heelstrike.robot import Robot, RobotBuilder

# Both sides solve linear systems of at most thirteen unknowns; accelerations are of order ten.
TOLERANCE = 1e-10

WALKERS = [case for case in NAMED if case.robot().nu and len(case.robot().feet) == 2]
SEEDS = 16
CHOICES = [choice.value for choice in ForceDistribution]


def soles(robot: Robot) -> list[int]:
    """Return the contact points that carry the robot when it stands with both feet flat."""
    bottom = dynamics.contact_positions(robot, robot.model.reference)[:, 1]
    bottom = bottom - robot.model.contact_radius
    return [int(i) for i in np.flatnonzero(bottom < bottom.min() + 1e-9)]


def standing(
    robot: Robot, ground: hs.Ground, contacts: list[int], seed: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a posture with the given contact points on the ground; also their Jacobian."""
    draw = np.random.default_rng(seed)
    q = robot.model.reference + np.append([0.0, 0.0, 0.0], 0.2 * draw.normal(size=robot.nv - 3))
    q = np.clip(q, robot.model.lower, robot.model.upper)
    for _ in range(50):
        now = hs.contact_kinematics(robot, q, 0.0 * q, ground)
        rows = now.jacobian[contacts, 0]
        q = q - np.linalg.pinv(rows) @ now.gap[contacts]
    now = hs.contact_kinematics(robot, q, 0.0 * q, ground)
    assert np.abs(now.gap[contacts]).max() < 1e-12
    return q, now.jacobian[contacts].reshape(-1, robot.nv)


def kept(rows: np.ndarray, vector: np.ndarray, target: np.ndarray | float = 0.0) -> np.ndarray:
    """The nearest vector whose product with the rows is the target."""
    result: np.ndarray = vector + np.linalg.pinv(rows) @ (target - rows @ vector)
    return result


def feasible_motion(
    robot: Robot, ground: hs.Ground, contacts: list[int], seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State and acceleration that keep the contact points, gentle enough to be possible."""
    draw = np.random.default_rng(seed)
    q, rows = standing(robot, ground, contacts, seed)
    v = kept(rows, 0.2 * draw.normal(size=robot.nv))
    drift = hs.contact_kinematics(robot, q, v, ground).bias_acceleration[contacts].ravel()
    return q, v, kept(rows, 2.0 * draw.normal(size=robot.nv), -drift)


@pytest.mark.parametrize("distribution", CHOICES)
@pytest.mark.parametrize("slope", [0.0, 0.1])
@pytest.mark.parametrize("case", WALKERS, ids=lambda case: case.name)
def test_forward_dynamics_returns_the_acceleration(
    case: RobotCase, slope: float, distribution: str
) -> None:
    """On both feet, in motion: the torques found make the robot accelerate as asked.

    The forward problem knows only the torques; it finds the contact forces by complementarity.
    Rigid friction may allow a second motion beside the one asked for, when a foot that hardly
    carries could lift instead: such seeds, with less than 5 % of the weight on a foot, are left
    out.
    """
    robot = case.robot()
    ground = hs.Ground(friction=0.8, slope=slope)
    contacts = soles(robot)
    done = 0
    for seed in range(SEEDS):
        q, v, a = feasible_motion(robot, ground, contacts, seed)
        inverse = hs.contact_inverse_dynamics(
            robot, q, v, a, distribution=distribution, ground=ground, contacts=contacts
        )
        kinematics = hs.contact_kinematics(robot, q, v, ground)
        pushed = np.einsum("cdn,cd->n", kinematics.jacobian, inverse.contact_force)
        driven = dynamics.applied_force(robot, q, v, inverse.torque)
        back = dynamics.forward_dynamics(robot, q, v, driven + pushed + inverse.missing_force)
        scale = max(1.0, float(np.abs(a).max()))
        assert np.abs(back - a).max() <= TOLERANCE * scale
        assert np.abs(inverse.contact_acceleration[contacts]).max() <= 1e-9
        if not inverse.feasible:
            assert inverse.message
            continue
        loads = [inverse.contact_force[list(foot.contacts), 0].sum() for foot in robot.feet]
        if min(loads) < 0.05 * robot.weight or kinematics.gap.min() < -1e-9:
            continue
        forward = hs.contact_forward_dynamics(robot, q, v, inverse.torque, ground=ground)
        assert forward.certificate.valid
        assert np.abs(forward.acceleration - a).max() <= TOLERANCE * scale
        done += 1
    assert done >= 2


@pytest.mark.parametrize("name", ["rabbit", "rabbit_optimtraj"])
def test_one_point_foot_lacks_a_moment(name: str) -> None:
    """On one point the five-link walker is underactuated: what is missing is the ankle's moment.

    The missing force does no work on motions that turn the robot otherwise than about its foot;
    when the robot is allowed to turn about the foot as the dynamics demands, it vanishes.
    """
    robot = next(case for case in NAMED if case.name == name).robot()
    ground = hs.Ground(friction=2.0)
    done = 0
    for seed in range(SEEDS):
        q, v, a = feasible_motion(robot, ground, [0], seed)
        kinematics = hs.contact_kinematics(robot, q, v, ground)
        if kinematics.gap[1] < 0.01:
            continue  # the other foot is under the ground
        inverse = hs.contact_inverse_dynamics(robot, q, v, a, contacts=[0], ground=ground)
        assert not inverse.feasible
        assert "root_pitch" in inverse.message
        assert np.abs(inverse.missing_force[:3]).max() > 1e-3
        rows = kinematics.jacobian[0][:, :3]
        turning = np.zeros(robot.nv)
        turning[:3] = np.linalg.svd(rows)[2][2]
        assert np.abs(rows @ inverse.missing_force[:3]).max() <= 1e-9
        inertia = turning @ dynamics.mass_matrix(robot, q) @ turning
        possible = a - turning * (turning @ inverse.missing_force) / inertia
        again = hs.contact_inverse_dynamics(robot, q, v, possible, contacts=[0], ground=ground)
        assert np.abs(again.missing_force).max() <= 1e-9
        if not again.feasible:
            continue
        forward = hs.contact_forward_dynamics(robot, q, v, again.torque, ground=ground)
        scale = max(1.0, float(np.abs(possible).max()))
        assert np.abs(forward.acceleration - possible).max() <= TOLERANCE * scale
        done += 1
    assert done >= 3


def problems(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some contact points in one plane with friction, and the wrench of forces in their cones."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(1, 6))
    x = draw.uniform(-0.5, 0.5, size=count)
    z = draw.choice([0.0, 0.1], size=count)
    effect = np.zeros((3, 2 * count))
    effect[0, 1::2], effect[1, 0::2] = 1.0, 1.0
    effect[2, 0::2], effect[2, 1::2] = -x, z
    friction = draw.uniform(0.2, 1.0, size=count)
    normal = draw.exponential(100.0, size=count) * (draw.random(count) < 0.8)
    forces = np.column_stack((normal, draw.uniform(-1.0, 1.0, size=count) * friction * normal))
    return effect, effect @ forces.ravel(), friction


@pytest.mark.parametrize("seed", range(60))
def test_least_norm_is_least(seed: int) -> None:
    """No forces with the same effect inside the cones are shorter (a general solver agrees)."""
    effect, load, friction = problems(seed)
    forces, inside = distribute(effect, load, friction, ForceDistribution.LEAST_NORM)
    unit = max(1.0, float(np.abs(load).max()))
    assert inside
    assert np.abs(effect @ forces.ravel() - load).max() <= 1e-9 * unit
    normal, tangent = forces.T
    assert np.all(friction * normal - np.abs(tangent) >= -1e-9 * unit)
    edges = np.zeros((3 * friction.size, 2 * friction.size))
    for i, mu in enumerate(friction):
        edges[3 * i : 3 * i + 3, 2 * i : 2 * i + 2] = [[mu, 1.0], [mu, -1.0], [1.0, 0.0]]
    found = minimize(
        lambda x: 0.5 * x @ x,
        forces.ravel() / unit,
        jac=lambda x: x,
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda x: effect @ x - load / unit, "jac": lambda x: effect},
            {"type": "ineq", "fun": lambda x: edges @ x, "jac": lambda x: edges},
        ],
    )
    assert np.linalg.norm(forces) / unit <= np.sqrt(2.0 * found.fun) + 1e-6


@pytest.mark.parametrize("seed", range(60))
def test_least_friction_use_is_least(seed: int) -> None:
    """A linear program finds no forces that use less friction, and finds some that use as much."""
    effect, load, friction = problems(seed)
    unit = max(1.0, float(np.abs(load).max()))
    forces, inside = distribute(effect, load, friction, ForceDistribution.LEAST_FRICTION_USE)
    assert inside
    assert np.abs(effect @ forces.ravel() - load).max() <= 1e-9 * unit
    normal, tangent = forces.T
    loaded = normal > 1e-6 * unit
    use = float(np.max(np.abs(tangent[loaded]) / (friction[loaded] * normal[loaded]), initial=0.0))

    def possible(share: float) -> bool:
        edges = np.zeros((2 * friction.size, 2 * friction.size))
        for i, mu in enumerate(share * friction):
            edges[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[-mu, 1.0], [-mu, -1.0]]
        bounds = [(0.0, None), (None, None)] * friction.size
        return bool(
            linprog(
                np.zeros(2 * friction.size),
                A_ub=edges,
                b_ub=np.zeros(len(edges)),
                A_eq=effect,
                b_eq=load / unit,
                bounds=bounds,
            ).success
        )

    # The program's own tolerance is 1e-7.
    assert possible(use + 1e-4)
    assert use < 1e-4 or not possible(use - 1e-4)


def test_two_feet_share_a_push_as_their_loads() -> None:
    """Two points with normal forces fixed by the moment: least use loads both cones alike.

    A weight of 300 N stands a third of the way between points 1 m apart and is pushed with 60 N:
    the normal forces are 200 and 100 N, and |t|/n = 60/300 at both is the least possible use. Least
    norm shares the push equally, 30 N each.
    """
    effect = np.array([[0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, 0.0]])
    load = np.array([60.0, 300.0, -100.0])
    friction = np.array([0.5, 0.5])
    least, _ = distribute(effect, load, friction, ForceDistribution.LEAST_FRICTION_USE)
    np.testing.assert_allclose(least, [[200.0, 40.0], [100.0, 20.0]], atol=1e-6)
    shortest, _ = distribute(effect, load, friction, ForceDistribution.LEAST_NORM)
    np.testing.assert_allclose(shortest, [[200.0, 30.0], [100.0, 30.0]], atol=1e-9)


def test_pulling_and_slipping_are_told() -> None:
    robot = hs.load_robot("bravo7")
    q, _ = standing(robot, hs.Ground(), [0, 1, 2, 3])
    nothing = np.zeros(robot.nv)
    falling = nothing.copy()
    falling[1] = -20.0  # faster than free fall: the ground would have to pull
    inverse = hs.contact_inverse_dynamics(robot, q, nothing, falling, contacts=range(4))
    assert not inverse.feasible
    assert inverse.pulling.any()
    assert "pull" in inverse.message
    sliding = nothing.copy()
    sliding[0] = 2.0  # weight times 2 m/s² needs a friction of 0.2
    inverse = hs.contact_inverse_dynamics(
        robot, q, nothing, sliding, contacts=range(4), ground=hs.Ground(friction=0.1)
    )
    assert not inverse.feasible
    assert "slip" in inverse.message
    assert inverse.friction_use.max() > 1.9
    total = inverse.contact_force[:, 1].sum()
    assert total == pytest.approx(2.0 * robot.total_mass, rel=1e-9)


def test_robot_in_the_air_needs_what_the_ground_would_give() -> None:
    robot = hs.load_robot("bravo7")
    q = robot.reference_state().q
    q[1] += 1.0
    nothing = np.zeros(robot.nv)
    inverse = hs.contact_inverse_dynamics(robot, q, nothing, nothing)
    np.testing.assert_array_equal(inverse.contact_force, 0.0)
    assert inverse.missing_force[1] == pytest.approx(robot.weight)
    assert "root_z lacks" in inverse.message


def test_sliding_feet_feel_kinetic_friction() -> None:
    """A robot held stiff and pushed along slides on: every point at the edge of its cone."""
    robot = hs.load_robot("bravo7")
    q, _ = standing(robot, hs.Ground(), [0, 1, 2, 3])
    v = np.zeros(robot.nv)
    v[0] = 0.5
    forward = hs.contact_forward_dynamics(
        robot, q, v, np.zeros(robot.nu), ground=hs.Ground(friction=0.3)
    )
    assert forward.certificate.valid
    normal, tangent = forward.contact_force.T
    np.testing.assert_allclose(tangent, -0.3 * normal, rtol=1e-9)


def test_impacts_and_wrong_words_are_refused() -> None:
    robot = hs.load_robot("bravo7")
    q, _ = standing(robot, hs.Ground(), [0, 1, 2, 3])
    v = np.zeros(robot.nv)
    v[1] = -1.0
    with pytest.raises(ContactProblemError, match="impact"):
        hs.contact_forward_dynamics(robot, q, v, np.zeros(robot.nu))
    with pytest.raises(ContactProblemError, match="least_norm"):
        hs.contact_inverse_dynamics(robot, q, v, v, distribution="fair")
    with pytest.raises(RobotError, match="right_foot_heel"):
        hs.contact_inverse_dynamics(robot, q, v, v, contacts=["nose"])


def test_motors_at_every_joint_need_no_ground() -> None:
    """Of the forces that will do, none has the least norm: the torques are those in the air."""
    builder = hs.RobotBuilder("arm")
    upper = builder.hinge("shoulder", None, at=(0.0, 1.0), mass=1.0, inertia=0.1, torque=50.0)
    lower = builder.hinge(
        "elbow",
        upper,
        at=(0.0, -0.5),
        mass=1.0,
        inertia=0.1,
        center_of_mass=(0.1, 0.0),
        torque=50.0,
    )
    builder.contact(lower, (0.0, -0.5))
    arm = builder.build()
    q, v, a = np.zeros(2), np.zeros(2), np.array([1.0, -2.0])
    for distribution in ForceDistribution:
        found = hs.contact_inverse_dynamics(arm, q, v, a, contacts=[0], distribution=distribution)
        assert found.feasible
        assert not found.contact_force.any()
        np.testing.assert_array_equal(found.torque, dynamics.inverse_dynamics(arm, q, v, a))


def test_use_of_the_cone_by_hand() -> None:
    """Loaded, unloaded, rounding beside the load, pulling, and held without a load."""
    force = np.array([[10.0, 3.0], [0.0, 0.0], [1.0, 1e-13], [-2.0, 0.0], [0.0, 1.0], [10.0, -6.0]])
    use = _friction_use(force, np.full(6, 0.5), 1e-9)
    np.testing.assert_allclose(use, [0.6, 0.0, 0.0, np.inf, np.inf, 1.2])


def on_parallel_ankles() -> tuple[Robot, hs.State]:
    robot = parallel_ankles()
    bent = {f"{side}_{joint}": x for side in ("right", "left") for joint, x in BENT.items()}
    state = robot.closed(robot.state(bent), keep=[*robot.joint_names[:3], *bent])
    state = robot.placed(state, hs.Ground())
    return robot, state


BENT = {"hip": -0.3, "knee": 0.6, "motor": -0.3}


def test_through_loops_torques_and_forces_do_what_was_asked() -> None:
    """Forward dynamics with these torques gives the acceleration, and the same forces of loops."""
    robot, state = on_parallel_ankles()
    still = np.zeros(robot.nv)
    found = hs.contact_inverse_dynamics(robot, state.q, still, still, contacts=range(robot.nc))
    assert found.feasible, found.message
    assert found.contact_force[:, 0].sum() == pytest.approx(robot.weight, rel=1e-9)
    back = hs.contact_forward_dynamics(robot, state.q, still, found.torque)
    np.testing.assert_allclose(back.acceleration, 0.0, atol=1e-8)
    np.testing.assert_allclose(found.loop_force, back.loop_force, rtol=1e-6, atol=1e-6)


def test_through_loops_what_they_forbid_is_missing() -> None:
    robot, state = on_parallel_ankles()
    torn = np.zeros(robot.nv)
    torn[robot.joint_index("right_rod")] = 5.0
    still = np.zeros(robot.nv)
    # A rod cannot accelerate alone, but a force that does it would be borne by the loop.
    found = hs.contact_inverse_dynamics(robot, state.q, still, torn, contacts=range(robot.nc))
    np.testing.assert_allclose(found.missing_force, 0.0, atol=1e-6)
    assert np.abs(found.loop_force).max() > 0.0


def test_two_motors_on_one_shaft_share_its_torque() -> None:
    build = RobotBuilder("pair")
    build.hinge("front", None, mass=1.0, inertia=0.1, center_of_mass=(0, -0.5), torque=9)
    build.hinge("rear", None, at=(1, 0), mass=1.0, inertia=0.1, torque=9)
    build.couple("rear", "front")
    pair = build.build()
    q = np.array([0.4, 0.4])
    found = hs.contact_inverse_dynamics(pair, q, np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(found.torque, 0.25 * 9.81 * np.sin(0.4) * np.ones(2), rtol=1e-9)
