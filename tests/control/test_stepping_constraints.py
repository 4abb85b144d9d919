"""Footstep feedback on point feet: nothing on the cycle, and back to it from far away."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.compiler.compilation import uncompiled
from heelstrike.control import stepping_constraints as law_module
from heelstrike.control.feasible import nearing
from heelstrike.control.stepping_constraints import Memory, follow, shift_at_end, take_up
from heelstrike.gait.phased.surface import Surface
from heelstrike.sim import Contacts

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

Floats = NDArray[np.float64]


@cache
def family() -> hs.StepFamily:
    """Half a metre in half a second, the knees always bent."""
    robot = hs.load_robot("rabbit_optimtraj")
    gait = hs.optimize_gait(
        robot, step_length=0.5, step_duration=0.5, clearance=0.05, friction=0.5, starts=1,
        joint_ranges={"right_knee": (0.2, 2.6), "right_hip": (-0.8, 1.5)},
    )  # fmt: skip
    return hs.StepFamily.around(hs.PhasedGait.from_gait(robot, gait))


@cache
def zero() -> hs.ZeroDynamics:
    return hs.zero_dynamics(family().gait)


def trial(controller: hs.SteppingConstraints | hs.VirtualConstraints) -> hs.Trial:
    return hs.Trial(
        robot=family().gait.robot, controller=controller, state=zero().initial_state,
        step_length=zero().step_length, step_duration=zero().period, settling=5.0,
    )  # fmt: skip


def on_the_walk(theta: float) -> hs.State:
    """State of the walk that repeats at a phase."""
    surface = Surface(family().gait)
    _, added = surface.motion(zero().touchdown)
    energy = zero().contraction * zero().fixed_point + added(theta)
    rate = np.sqrt(2.0 * energy) / surface.inertia(theta)
    return hs.State(surface.position(theta), rate * surface.tangent(theta))


def in_the_air(state: hs.State) -> Contacts:
    """Contact points with the stance foot alone on the ground."""
    robot, stance = family().gait.robot, family().gait.robot.feet[0].contacts[0]
    position = dynamics.contact_positions(robot, state.q)
    force = np.zeros((2, 2))
    force[stance, 0] = robot.weight
    gap = np.full(2, 0.05)
    gap[stance] = 0.0
    return Contacts(position=position, normal=np.tile([0.0, 1.0], (2, 1)), gap=gap, force=force)


def memory_with(draw: np.random.Generator) -> Memory:
    """Memory of a step on some slope, off the gait as it began."""
    extents = {"nu": 4, "terms": 25, "levels": 33, "axes": 2, "nv": 7, "n": 4, "m": 19}
    parts, f = Memory.allocate(extents), family()
    powers = [1.0, 0.4, 0.16]
    parts.coefficients[:] = np.tensordot(powers, f.coefficients, 1)
    parts.middle[:] = np.tensordot(powers, f.middle, 1)
    parts.half[:] = np.tensordot(powers, f.half, 1)
    parts.missing[:], parts.bend[:] = 0.1 * draw.normal(size=(2, 4))
    parts.first_phase = f.gait.phase_range[0]
    return parts


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.slow
def test_derivatives_of_the_gait_that_changes(seed: int) -> None:
    """Against central differences, with a shift that goes over to another along the step."""
    draw = np.random.default_rng(seed)
    memory = memory_with(draw)
    a, b, c = draw.uniform(-0.5, 0.5, 3)

    def at(theta: float) -> tuple[Floats, Floats, Floats]:
        follow(memory, theta, a + b * theta + c * theta**2, b + 2.0 * c * theta, 2.0 * c)
        take_up(memory, theta)
        return memory.value.copy(), memory.gradient.copy(), memory.curvature.copy()

    h = 1e-4
    for theta in np.linspace(*family().gait.phase_range, 7)[1:-1]:
        low, (_, gradient, curvature), high = at(theta - h), at(theta), at(theta + h)
        np.testing.assert_allclose(gradient, (high[0] - low[0]) / (2.0 * h), atol=1e-5)
        np.testing.assert_allclose(curvature, (high[1] - low[1]) / (2.0 * h), atol=1e-4)


def test_what_is_missing_at_first_is_taken_up_and_fades() -> None:
    memory = memory_with(np.random.default_rng(5))
    start, width = memory.first_phase, 2.0 * law_module.FADES * memory.half[0]
    found = {}
    for u in (0.0, 0.999999, 1.0):
        follow(memory, start + u * width, 0.0, 0.0, 0.0)
        without = memory.value.copy(), memory.gradient.copy()
        take_up(memory, start + u * width)
        found[u] = memory.value - without[0], memory.gradient - without[1]
    np.testing.assert_allclose(found[0.0][0], memory.missing, atol=1e-14)
    np.testing.assert_allclose(found[0.0][1], memory.bend / width, atol=1e-14)
    for u in (0.999999, 1.0):
        np.testing.assert_allclose(found[u][0], 0.0, atol=1e-12)
        np.testing.assert_allclose(found[u][1], 0.0, atol=1e-9)


@pytest.mark.parametrize("shift", [-0.7, 0.0, 0.4])
def test_where_a_step_begins_or_ends_says_the_shift(shift: float) -> None:
    memory = memory_with(np.random.default_rng(0))
    powers = np.array([1.0, shift, shift**2])
    for side in (-1.0, 1.0):
        theta = powers @ memory.middle + side * (powers @ memory.half)
        assert shift_at_end(memory, theta) == pytest.approx(shift, abs=1e-9)


@pytest.mark.parametrize("part", [0.1, 0.4, 0.9])
def test_on_the_walk_that_repeats_it_is_the_law_without_feedback(part: float) -> None:
    first, last = family().gait.phase_range
    state = on_the_walk(first + part * (last - first))
    plain = hs.VirtualConstraints(family().gait).torque(0.0, state, in_the_air(state))
    fed_back = hs.SteppingConstraints(family()).torque(0.0, state, in_the_air(state))
    np.testing.assert_allclose(fed_back, plain, atol=1e-5 * np.abs(plain).max())


@pytest.mark.parametrize("swing", [-4.0, 4.0])
def test_it_asks_no_more_of_the_ground_than_that_can_bear(swing: float) -> None:
    """The swing leg is too fast or too slow: to mend that at once the stance foot would slip."""
    first, last = family().gait.phase_range
    robot = family().gait.robot
    state = on_the_walk(first + 0.3 * (last - first))
    v = state.v.copy()
    v[robot.joint_names.index("left_hip")] += swing
    room = {}
    for law in (hs.VirtualConstraints(family().gait), hs.SteppingConstraints(family())):
        kept = law.torque(0.0, state, in_the_air(state))  # the step has begun
        assert np.all(np.isfinite(kept))
        torque = law.torque(0.0, hs.State(state.q, v), in_the_air(state))
        motion = hs.contact_forward_dynamics(
            robot, state.q, v, torque, ground=hs.Ground(friction=50.0)
        )
        normal, tangent = motion.contact_force[robot.feet[0].contacts[0]]
        room[type(law)] = min(0.6 * normal - abs(tangent), normal - 0.1 * robot.weight)
        most = np.abs(torque).max()
    assert most <= robot.model.torque_upper.max() * (1.0 + 1e-9)
    assert room[hs.VirtualConstraints] < -1.0
    assert room[hs.SteppingConstraints] > -1e-6 * robot.weight


@pytest.mark.parametrize(("period", "rate"), [(0.0, 100.0), (1e-2, 50.0)])
def test_a_joint_is_braked_before_the_end_of_its_range(period: float, rate: float) -> None:
    """Without gains nothing else would: it goes on at 8 rad/s, a tenth of a radian before it.

    Called every 10 ms it is braked less: what is held so long would throw it back.
    """
    first, last = family().gait.phase_range
    robot = family().gait.robot
    state = on_the_walk(first + 0.3 * (last - first))
    knee = robot.joint_names.index("left_knee")
    braked = {}
    for law in (
        hs.VirtualConstraints(family().gait, kp=0.0, kd=0.0),
        hs.SteppingConstraints(family(), kp=0.0, kd=0.0, friction=5.0),
    ):
        law.torque(0.0, state, in_the_air(state))  # the step has begun
        assert law._asked is not None
        law._asked.numbers.control.robot.period = period
        q, v = state.q.copy(), state.v.copy()
        q[knee], v[knee] = law_module._bounds(family(), 0.6).upper[-1] - 0.1, 8.0
        torque = law.torque(1e-3, hs.State(q, v), in_the_air(state))
        motion = hs.contact_forward_dynamics(robot, q, v, torque, ground=hs.Ground(friction=50.0))
        braked[type(law)] = -motion.acceleration[knee]
    assert braked[hs.VirtualConstraints] < 0.0
    # It may come nearer as exp(-rate t) does, twice over.
    assert braked[hs.SteppingConstraints] == pytest.approx(2.0 * rate * 8.0 - rate**2 * 0.1)


@pytest.mark.parametrize("period", [1e-3, 5e-3, 1e-2, 3e-2, 0.1])
def test_a_joint_that_is_braked_from_call_to_call_comes_to_rest_within_its_range(
    period: float,
) -> None:
    """It is slow enough at first, brakes as hard as it must and holds that until the next call."""
    rate = uncompiled(nearing)(period)
    place, speed = -1.0, 0.5 * rate
    for _ in range(int(100.0 / (rate * period)) + 1):
        acceleration = min(-2.0 * rate * speed - rate**2 * place, 0.0)
        place += period * speed + 0.5 * period**2 * acceleration
        speed += period * acceleration
        assert place < 1e-9
        assert speed > -1e-9
    assert place == pytest.approx(0.0, abs=1e-6)


def test_the_multipliers_with_feedback() -> None:
    """Same fixed point; without response δ² and what is not believed of a slope; with it less."""
    start = zero().initial_state
    robot = family().gait.robot
    found = {
        response: hs.find_limit_cycle(
            robot, start, hs.SteppingConstraints(family(), response=response, trust=0.7),
            memory=("slope",),
        )
        for response in (0.0, 0.5)
    }  # fmt: skip
    sizes = np.abs(found[0.0].multipliers)
    np.testing.assert_allclose(sizes[:2], [zero().contraction, 0.3], atol=1e-6)
    assert sizes[2] < 1e-5
    assert np.abs(found[0.5].multipliers[0]) < 0.7 * zero().contraction
    for cycle in found.values():
        np.testing.assert_allclose(cycle.state.q, start.q, atol=1e-8)
        np.testing.assert_allclose(cycle.state.v, start.v, atol=1e-6)


@pytest.mark.slow
def test_it_stands_what_the_law_without_feedback_does_not() -> None:
    """A push after which no energy is left to come over the stance foot."""
    laws = hs.SteppingConstraints(family()), hs.VirtualConstraints(family().gait)
    began = trial(laws[0]).begins
    push = hs.Push(2, force=(-300.0, 0.0), start=began, duration=0.1)
    for law, stands in zip(laws, (True, False), strict=True):
        pushed = trial(law).run(began + 0.1, pushes=[push])
        assert bool(trial(law).recovered(pushed, (began, began + 0.1))) is stands


def test_it_walks_on_ground_that_gives_way() -> None:
    """There an impact takes a while: velocities before it are not what a step begins with."""
    law, robot = hs.SteppingConstraints(family()), family().gait.robot
    start, method = zero().initial_state, hs.Compliant()
    run = hs.simulate(robot, law, state=start, duration=2.0, method=method)
    assert run.completed, run.message
    usual = run.time[-1] * zero().step_length / zero().period
    assert run.final_state.q[0] - start.q[0] == pytest.approx(usual, rel=0.05)
    assert np.abs(run.torque).max() < 0.5 * robot.model.torque_upper.max()


def test_it_keeps_its_speed_down_a_slope() -> None:
    """Of seven degrees, which takes a third of it from the law without feedback."""
    down = hs.Ground(profile=np.array([(-1.0, 0.0), (1.25, 0.0), (101.25, -12.5)]))
    lost = []
    for law in (hs.SteppingConstraints(family()), hs.VirtualConstraints(family().gait)):
        began = trial(law).begins
        run = trial(law).run(began, ground=down)
        found = trial(law).recovered(run, (began, began), same_speed=False)
        assert found.recovered, found.reason
        lost.append(abs(found.speed - found.normal_speed))
    assert lost[0] < 0.5 * lost[1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kp": -1.0}, "kp must not be negative"),
        ({"response": -0.1}, "response must not be negative"),
        ({"trust": 1.5}, "trust lies from 0 to 1"),
        ({"friction": 0.0}, "friction must be a positive number"),
    ],
)
def test_what_it_refuses(options: dict[str, float], said: str) -> None:
    with pytest.raises(hs.ControllerError, match=said):
        hs.SteppingConstraints(family(), **options)  # type: ignore[arg-type]
