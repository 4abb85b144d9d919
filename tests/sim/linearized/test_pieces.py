"""Pieces of which linearised steps and flows are made, each by a value that is known otherwise."""

from __future__ import annotations

import math
from types import SimpleNamespace

import mechanisms
import numpy as np
import pytest
from numpy.polynomial import legendre

import heelstrike as hs
from heelstrike.contact.linearized.motion import ImpactLinearization
from heelstrike.contact.linearized.slopes import along_the_ground, plane
from heelstrike.contact.linearized.strikes import Strike
from heelstrike.contact.modes import ContactMode
from heelstrike.errors import SimulationError
from heelstrike.sim.closed_sets import Scheme
from heelstrike.sim.contacts.rows import POINT, SECOND_FACE
from heelstrike.sim.linearized.collocation import collocation
from heelstrike.sim.linearized.flow import MATRIX, NODES, STAGES, WEIGHTS
from heelstrike.sim.linearized.inputs import LAW, NONE, TORQUE, Inputs, inputs_of
from heelstrike.sim.linearized.mode_changes import _others, other_modes
from heelstrike.sim.linearized.pushed import pushed, switches
from heelstrike.sim.linearized.refusals import refuse_inputs, refuse_step

OPEN, STICK, FORWARD, BACKWARD = (
    ContactMode.OPEN, ContactMode.STICK, ContactMode.SLIP_FORWARD, ContactMode.SLIP_BACKWARD
)  # fmt: skip


# Collocation.


def test_collocation_integrates_polynomials_exactly() -> None:
    """Of degree s − 1 to each node, whatever the nodes are: ∫₀^c t^k = c^(k+1) / (k + 1)."""
    nodes, matrix, weights = collocation(np.array([0.1, 0.35, 0.8]))
    for k in range(3):
        np.testing.assert_allclose(matrix @ nodes**k, nodes ** (k + 1) / (k + 1), atol=1e-14)
        assert weights @ nodes**k == pytest.approx(1.0 / (k + 1), abs=1e-14)


def test_gauss_s_nodes_make_a_flow_of_order_eight() -> None:
    """Of x' = x a stretch of one gives the Padé approximation of e, which lacks 1e-7 of it."""
    assert STAGES == 4
    np.testing.assert_allclose(2.0 * NODES - 1.0, legendre.leggauss(4)[0], atol=1e-15)
    for k in range(8):
        assert pytest.approx(1.0 / (k + 1), abs=1e-14) == WEIGHTS @ NODES**k
    after = 1.0 + WEIGHTS @ np.linalg.solve(np.eye(4) - MATRIX, np.ones(4))
    up = [math.comb(4, k) / math.comb(8, k) / math.factorial(k) for k in range(5)]
    assert after == pytest.approx(sum(up) / sum((-1) ** k * u for k, u in enumerate(up)), rel=1e-13)


def test_stretches_end_where_pushes_switch() -> None:
    """Each switch once and in order; those at the ends or outside change nothing within."""
    pushes = [
        hs.Push(0, force=(1.0, 0.0), start=0.25, duration=0.25),
        hs.Push(0, force=(1.0, 0.0), start=0.125, duration=0.125),
        hs.Push(0, force=(1.0, 0.0), start=0.0, duration=5.0),
    ]
    assert switches(pushes, 0.0, 0.375) == [0.0, 0.125, 0.25, 0.375]
    assert switches(pushes, 0.125, 0.25) == [0.125, 0.25]
    assert switches((), 0.2, 0.7) == [0.2, 0.7]


def test_a_push_is_a_force_whose_lever_turns_with_the_block() -> None:
    """Generalised force (F, M) of a free block, M = z F_x − x F_z of the lever; ∂M/∂θ of that."""
    robot, angle = mechanisms.block(width=0.4, height=0.2), 0.3
    force, lever = np.array([30.0, -40.0]), np.array([0.1, 0.2])
    q = np.array([0.5, 0.7, angle])
    block = robot.link_names[-1]
    push = hs.Push(block, force=(30.0, -40.0), start=0.2, duration=0.3, point=(0.1, 0.2))

    def turned(at: float) -> float:
        x = np.cos(at) * lever[0] + np.sin(at) * lever[1]
        z = -np.sin(at) * lever[0] + np.cos(at) * lever[1]
        return float(z * force[0] - x * force[1])

    assert pushed(robot, q, (), 0.3) == {}
    found = pushed(robot, q, (push,), 0.3)
    np.testing.assert_allclose(found["force"], [30.0, -40.0, turned(angle)], rtol=1e-12)
    slope = np.zeros((3, 3))
    slope[2, 2] = (turned(angle + 1e-6) - turned(angle - 1e-6)) / 2e-6
    np.testing.assert_allclose(found["force_by_q"], slope, atol=1e-7)
    for time, acts in ((0.2, True), (0.19, False), (0.5, False)):
        assert pushed(robot, q, (push,), time)["force"].any() == acts


# Columns.


def test_columns_are_numbered_one_after_the_other() -> None:
    """Torques, numbers of the robot, friction of the ground, then the law's parameters."""
    robot = hs.load_robot("bravo7")
    found = inputs_of(robot, ("friction", "mass"), {"mass": 2, "kp": 3})
    nu, nl = robot.nu, robot.model.mass.size
    assert found.of(TORQUE) == list(range(nu))
    assert found.of("mass") == list(range(nu, nu + nl))
    assert found.of("friction") == [nu + nl]
    assert found.of(LAW + "kp") == [nu + nl + 3, nu + nl + 4, nu + nl + 5]
    assert found.of("damping") == []
    assert found.of_numbers() == list(range(nu, nu + nl + 1))
    assert found.of_parameters() == list(range(nu + nl + 1, nu + nl + 6))
    assert found.size == nu + nl + 6
    assert found.dynamic == ("mass",)
    assert NONE.size == 0
    with pytest.raises(SimulationError, match="colour"):
        inputs_of(robot, ("colour",), {})


# Refusals.


@pytest.mark.parametrize("scheme", list(Scheme))
def test_schemes_refuse_numbers_that_they_take_into_the_mass_matrix(scheme: Scheme) -> None:
    takes = scheme in (Scheme.MOREAU_JEAN, Scheme.LINEARLY_IMPLICIT)
    for name, refused in (("mass", False), ("stiffness", takes), ("damping", takes)):
        if refused:
            with pytest.raises(SimulationError, match=f"{scheme.name} takes {name} into"):
                refuse_inputs(scheme, Inputs(("mass", name)))
        else:
            refuse_inputs(scheme, Inputs(("mass", name)))
    gains = Inputs((), {}, ("kp",))
    if scheme is Scheme.LINEARLY_IMPLICIT:
        with pytest.raises(SimulationError, match="takes kp into"):
            refuse_inputs(scheme, gains)
    else:
        refuse_inputs(scheme, gains)


def plain_step() -> SimpleNamespace:
    """What a step on level ground leaves, of three points: two stick, the last is open."""
    ground = SimpleNamespace(curved=0, normal=np.array([[0.0, 1.0], [0.6, 0.8]]))
    begin, until = np.zeros(12, dtype=int), np.zeros(12, dtype=int)
    until[POINT] = 3
    begin[SECOND_FACE] = until[SECOND_FACE] = 3
    assembly = SimpleNamespace(
        begin=begin, until=until, candidate=np.array([0, 1, 2, 9]),
        answer=SimpleNamespace(mode=np.array([STICK, STICK, OPEN, OPEN])),
    )  # fmt: skip
    normal = np.array([[0.0, 1.0], [0.6, 0.8], [0.1, 0.99]])
    return SimpleNamespace(
        robot=SimpleNamespace(constraints=()), ground=SimpleNamespace(model=lambda: ground),
        _work=SimpleNamespace(impact=SimpleNamespace(relaxed=0, gains=0, bounded=0)),
        _memory=SimpleNamespace(
            torque=np.ones(2), command=np.ones(2), assembly=assembly,
            contacts=SimpleNamespace(normal=normal),
        ),
    )  # fmt: skip


def test_steps_whose_equations_are_known_are_not_refused() -> None:
    step = plain_step()
    refuse_step(step)
    step._work.impact.gains = 1  # restitution that makes energy, and is not scaled back
    refuse_step(step)
    step._work.impact.gains, step._work.impact.bounded = 0, 1
    refuse_step(step)


def test_steps_whose_equations_are_not_known_say_why() -> None:
    def second_face(step: SimpleNamespace) -> None:
        step._memory.assembly.until[SECOND_FACE] = 4
        step._memory.assembly.answer.mode[3] = STICK

    def corner(step: SimpleNamespace) -> None:
        step._memory.assembly.answer.mode[2] = FORWARD

    def saturated(step: SimpleNamespace) -> None:
        step._memory.torque[1] = 0.9

    def scaled_back(step: SimpleNamespace) -> None:
        step._work.impact.gains = step._work.impact.bounded = 1

    for change, words in (
        (second_face, "a concave corner"), (corner, "at a convex corner"),
        (saturated, "a motor on its speed-torque line"), (scaled_back, "scaled back"),
        (lambda step: setattr(step._work.impact, "relaxed", 1), "a wedge"),
        (lambda step: setattr(step.ground.model(), "curved", 1), "smooth ground"),
        (lambda step: setattr(step.robot, "constraints", (1,)), "constraints from outside"),
    ):  # fmt: skip
        step = plain_step()
        change(step)
        with pytest.raises(SimulationError, match=f"{words}.* cannot be differentiated yet"):
            refuse_step(step)


# Changes of mode.


def at_end(
    mode: ContactMode, impulse: tuple[float, float], velocity: tuple[float, float],
    friction: float = 0.5,
) -> SimpleNamespace:  # fmt: skip
    """A simulation whose one point has ended a step of 1 ms so; the robot weighs 1000 N."""
    begin, until = np.zeros(12, dtype=int), np.zeros(12, dtype=int)
    until[POINT] = 1
    answer = SimpleNamespace(
        mode=np.array([mode]), impulse=np.array(impulse), velocity=np.array(velocity)
    )
    problem = SimpleNamespace(friction=np.array([friction]), first=np.array([0, 2]), count=1)
    assembly = SimpleNamespace(
        begin=begin, until=until, candidate=np.array([0]), answer=answer, problem=problem
    )
    return SimpleNamespace(
        _memory=SimpleNamespace(assembly=assembly), method=SimpleNamespace(step_length=1e-3),
        robot=SimpleNamespace(weight=1000.0, contact_names=("toe",)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("mode", "impulse", "velocity", "friction", "others"),
    [
        (OPEN, (0.0, 0.0), (1.0, 0.0), 0.5, ()),
        (OPEN, (0.0, 0.0), (1e-7, 0.3), 0.5, (FORWARD,)),
        (OPEN, (0.0, 0.0), (1e-7, -0.3), 0.5, (BACKWARD,)),
        (OPEN, (0.0, 0.0), (0.0, 0.0), 0.5, (STICK, FORWARD, BACKWARD)),
        (OPEN, (0.0, 0.0), (0.0, 0.0), 0.0, (FORWARD,)),
        (STICK, (1.0, 0.2), (0.0, 0.0), 0.5, ()),
        (STICK, (1.0, 0.5), (0.0, 0.0), 0.5, (BACKWARD,)),
        (STICK, (1.0, -0.5), (0.0, 0.0), 0.5, (FORWARD,)),
        (STICK, (1e-10, 0.0), (0.0, 0.0), 0.5, (OPEN, FORWARD, BACKWARD)),
        (FORWARD, (1.0, -0.5), (0.0, 0.2), 0.5, ()),
        (FORWARD, (1.0, -0.5), (0.0, 1e-10), 0.5, (STICK,)),
        (BACKWARD, (1e-10, 0.0), (0.0, -0.2), 0.5, (OPEN,)),
    ],
)  # fmt: skip
def test_points_at_a_change_of_mode_are_told(
    mode: ContactMode, impulse: tuple[float, float], velocity: tuple[float, float],
    friction: float, others: tuple[ContactMode, ...],
) -> None:  # fmt: skip
    """By what they could do as well: friction acts against a slip, so −μn is that of a forward one.

    Impulses of less than 1e-9 of the robot's weight over the step are none.
    """
    simulation = at_end(mode, impulse, velocity, friction)
    assert _others(simulation, 0, 1.0) == others
    changes = other_modes(simulation, {})
    assert len(changes) == bool(others)
    if others:
        assert changes[0].contact == "toe"
        assert changes[0].mode == mode.name.lower()
        assert changes[0].others == tuple(each.name.lower() for each in others)


def test_a_named_point_is_put_to_another_side() -> None:
    simulation = at_end(STICK, (1.0, -0.5), (0.0, 0.0))
    (change,) = other_modes(simulation, {"toe": "slip_forward"})
    assert (change.mode, change.others) == ("slip_forward", ("stick",))
    assert simulation._memory.assembly.answer.mode[0] == FORWARD
    for wanted in ({"toe": "open"}, {"heel": "slip_forward"}):
        (name,) = wanted
        with pytest.raises(SimulationError, match=f"'{name}' is not at a change to"):
            other_modes(at_end(STICK, (1.0, -0.5), (0.0, 0.0)), wanted)


# The ground and what comes down on it.


@pytest.mark.parametrize("slope", [-0.3, 0.0, 0.4])
def test_ground_of_one_line_is_known_by_its_slope(slope: float) -> None:
    ground = hs.Ground(slope=slope, friction=0.6, restitution=0.3)
    normal, friction, restitution = plane(ground)
    assert normal == pytest.approx((-math.sin(slope), math.cos(slope)))
    assert (friction, restitution) == (0.6, 0.3)
    assert along_the_ground(ground) == pytest.approx([math.cos(slope), math.sin(slope)])
    assert plane(None)[0] == pytest.approx((0.0, 1.0))


def test_errors_of_a_strike_are_those_of_a_later_or_earlier_one() -> None:
    """A ball at height h and speed −v: δh more makes it bounce δh/v later, from a mirrored course.

    After the bounce it is higher by −e δh than one that bounced before; on the section by nothing.
    """
    speed, e, g = 2.0, 0.7, 9.81
    impact = ImpactLinearization(
        velocity=np.array([e * speed]), reset=np.diag([1.0, -e]), by_numbers=np.zeros((2, 0))
    )
    strike = Strike(
        gradient=np.array([1.0, 0.0]), before=np.array([-speed, -g]),
        after=np.array([e * speed, -g]), impact=impact,
    )  # fmt: skip
    later = 1.0 / speed
    # At the time of the undisturbed bounce plus δt, both seen at the same instant.
    wanted = np.array([[-e, 0.0], [e * g * later + g * later, -e]])
    np.testing.assert_allclose(strike.saltation(), wanted, atol=1e-14)
    # Each at its own bounce: the height is that of the ground, the speed e times the one before.
    np.testing.assert_allclose(strike.section, [[0.0, 0.0], [e * g * later, -e]], atol=1e-14)
