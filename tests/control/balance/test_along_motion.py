"""The whole body along motions of any phases: near them, within limits, on moved footholds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.balance.shifted_feet import LEG_DAMPING, shift_leg
from heelstrike.gait.gait import fingerprint

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

FAST = 2.2
AWAY = 0.02
"""Largest error of joints (rad) in a state that is not on the motion."""


@cache
def motion() -> hs.Motion:
    return walking.gait().motion(walking.bravo7())


def disturbed(seed: int) -> hs.State:
    """A state near that of the motion after a fifth of the step, the stance foot where it was."""
    robot, time = walking.bravo7(), 0.2 * motion().duration
    state = hs.State(motion().position(time), motion().velocity(time))
    moved = np.random.default_rng(seed).uniform(-AWAY, AWAY, robot.nv)
    leg = [robot.joint_names.index(f"right_{each}") for each in ("hip", "knee", "ankle")]
    moved[[0, 1, 2, *leg]] = 0.0
    return hs.State(state.q + moved, state.v)


def asked(law: hs.Controller, state: hs.State) -> np.ndarray:
    contacts = hs.Simulation(law.robot, state=state).contacts
    return np.asarray(law.torque(0.2 * motion().duration, state, contacts))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_without_limits_it_is_motion_tracking(seed: int) -> None:
    """One solves a quadratic programme, the other equations, for the same accelerations."""
    robot, state = walking.bravo7(), disturbed(seed)
    usual = asked(hs.MotionTracking(robot, motion()), state)
    whole = asked(hs.WholeBody(robot, motion(), numbers={"pitch": 0.0}), state)
    np.testing.assert_allclose(whole, usual, atol=1e-4 * np.abs(usual).max())


def test_the_log_tells_of_programmes_that_are_not_solved() -> None:
    """All of them are; where the weight is spoilt behind the back of the law, none is."""
    robot, law = walking.bravo7(), hs.WholeBody(walking.bravo7(), motion(), numbers={"pitch": 0.0})
    state, unsolved = motion().initial_state, []
    for weight in (robot.weight, np.nan):
        law.parameters = law.parameters.replaced(weight=weight)
        run = hs.simulate(robot, law, state=state, duration=0.01)
        unsolved.append(run.log["unsolved"].values[-1])
    assert unsolved[0] == 0
    assert unsolved[1] >= 10


def forces(law: hs.Law, state: hs.State) -> tuple[float, np.ndarray]:
    """Tangential force, and normal ones, of the foot that stands, in parts of the weight."""
    asked(law, state)
    memory = law.remembered
    assert (memory.program.status, memory.program.relaxed) == (0, 0)
    held = np.flatnonzero(law.parameters.stands[memory.phase])
    force = memory.program.x[law.robot.nv : law.robot.nv + len(held)]
    return float(force[held % 2 == 1].sum()), force[held % 2 == 0]


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_the_foot_that_stands_stays_in_its_friction_cone(seed: int) -> None:
    """On ground where it would slide without."""
    robot, state, slippery = walking.bravo7(), disturbed(seed), 0.05
    along, normal = forces(hs.WholeBody(robot, motion(), friction=0.6), state)
    assert abs(along) > 1.02 * slippery * normal.sum()
    along, normal = forces(hs.WholeBody(robot, motion(), friction=slippery), state)
    assert abs(along) == pytest.approx(slippery * normal.sum(), rel=1e-9)
    assert normal.min() >= 0.0


def test_no_point_pulls_at_the_ground() -> None:
    """Where the trunk is to be turned so fast that the foot would tip."""
    robot, state, pulled = walking.bravo7(), disturbed(0), []
    for side in (-1.0, 1.0):
        turned = hs.State(state.q, state.v + side * np.eye(robot.nv)[2])
        _, normal = forces(hs.WholeBody(robot, motion()), turned)
        assert normal.min() >= -1e-12
        pulled.append(normal.min() < 1e-9)
    assert any(pulled)


def test_motors_are_not_asked_for_more_than_they_have() -> None:
    robot, state = walking.bravo7(), disturbed(0)
    free = asked(hs.WholeBody(robot, motion()), state)
    most = 0.8 * np.abs(free).max()
    limits = {"torque_lower": np.full(robot.nu, -most), "torque_upper": np.full(robot.nu, most)}
    weak = replace(robot, model=robot.model.replaced(**limits))
    own = replace(motion(), fingerprint=fingerprint(weak))
    law = hs.WholeBody(weak, own)
    found = asked(law, state)
    assert np.abs(found).max() <= most * (1.0 + 1e-9)
    assert np.abs(found).max() == pytest.approx(most, rel=1e-6)


def test_what_it_refuses() -> None:
    robot = walking.bravo7()
    with pytest.raises(hs.ControllerError, match="a motion has its own speed"):
        hs.WholeBody(robot, motion(), speed=0.5)
    with pytest.raises(hs.ControllerError, match="there is no number 'crouch'; there are friction"):
        hs.FootstepFeedback(robot, motion(), numbers={"crouch": 0.1})
    with pytest.raises(hs.ControllerError, match="friction must be positive"):
        hs.WholeBody(robot, motion(), friction=0.0)
    with pytest.raises(hs.ControllerError, match="pitch must not be negative, got -1"):
        hs.WholeBody(robot, motion(), numbers={"pitch": -1.0})
    with pytest.raises(hs.GaitError, match="designed for robot"):
        hs.WholeBody(walking.rabbit(), motion())


@cache
def running() -> hs.Motion:
    phases = [
        hs.ContactPhase("right_foot_toe", duration=(0.15, 0.3), pieces=4),
        hs.ContactPhase(duration=(0.1, 0.3), pieces=3),
    ]
    return hs.optimize_motion(walking.bravo7(), phases, speed=FAST, starts=1)


def steps(law: hs.Controller, pushes: tuple[hs.Push, ...] = ()) -> float:
    run = hs.simulate(
        walking.bravo7(), law, state=running().initial_state, duration=20.5 * running().duration,
        method=hs.EventDriven(), ground=hs.Ground(friction=running().friction), pushes=pushes,
    )  # fmt: skip
    return float(run.time[-1]) / running().duration


@pytest.mark.slow
def test_moved_footholds_keep_a_run_on_toes_up_for_longer() -> None:
    """In which no motor moves the trunk: sooner or later it falls, or not, by its last digits."""
    robot = walking.bravo7()
    assert steps(hs.WholeBody(robot, running())) < 15.0
    push = hs.Push("trunk", force=(0.01 * robot.weight, 0.0), start=1.0, duration=0.1)
    law = hs.FootstepFeedback(robot, running())
    assert steps(law) > 17.0
    assert steps(law, (push,)) > 17.0


def test_spells_in_the_air_are_those_of_the_motion() -> None:
    """By the heights of the feet: in the air from the touchdown of the other foot to its own."""
    law = hs.FootstepFeedback(walking.bravo7(), motion())
    parameters, _ = law.numbers(walking.bravo7())
    np.testing.assert_allclose(parameters.spell, [[0.0, 0.7], [0.7, 0.0]], atol=1e-12)
    np.testing.assert_array_equal(parameters.before, np.zeros((2, 2)))


@pytest.mark.slow
def test_spells_of_a_run_are_those_of_its_simulation() -> None:
    """From when a foot leaves the ground until it lands, and for how long the other stands then."""
    robot = walking.bravo7()
    law = hs.FootstepFeedback(robot, running())
    run = hs.simulate(
        robot, law, state=running().initial_state, duration=2.2 * running().duration,
        method=hs.EventDriven(), ground=hs.Ground(friction=running().friction),
    )  # fmt: skip
    down = np.array(
        [run.contact_force[:, foot.contacts, 0].sum(axis=1) > 0.0 for foot in robot.feet]
    )
    changes = [run.time[1:][np.diff(each.astype(int)) != 0] for each in down]
    first = int(down[1, 0])  # the foot that stands as the run begins
    left, landed = changes[first][:2]
    other, lifted = changes[1 - first][:2]
    parameters, _ = law.numbers(robot)
    near = {"abs": 2e-3}
    assert parameters.spell[1, first] == pytest.approx(landed - left, **near)
    assert parameters.before[:, first] == pytest.approx([0, 0, other - left, lifted - left], **near)
    assert parameters.after[:, first] == pytest.approx([0.0, lifted - other, 0.0, 0.0], **near)
    assert parameters.stance == pytest.approx([left, 0.0, lifted - other, 0.0], **near)


@pytest.mark.slow
def test_an_error_of_the_capture_point_grows_while_something_stands() -> None:
    """And not in flight: footholds are moved by e exp(ω t) of the stance that is left, smoothly."""
    robot = walking.bravo7()
    law = hs.FootstepFeedback(robot, running())
    stance, flight = (phase.duration for phase in running().phases)
    spell = stance + 2.0 * flight
    for time, other in ((0.4 * stance, flight + 0.4 * stance), (stance + 0.3 * flight, None)):
        state = hs.State(running().position(time), running().velocity(time) + 0.02 * np.eye(9)[0])
        contacts = hs.Simulation(robot, state=state).contacts
        for t in (0.0, min(time, stance), time):
            law.torque(t, state, contacts)
        numbers, memory = law.parameters, law.remembered
        gone = time - memory.start
        stands = [foot.name for foot in robot.feet].index("right_foot")
        for foot in range(2):
            if foot == stands and other is not None:
                continue  # it is down
            if other is not None:
                left, passed = stance - gone, other
            elif foot == stands:
                left, passed = stance, gone
            else:
                left, passed = 0.0, flight + stance + gone
            share = passed / spell
            grown = memory.error * np.exp(numbers.rate * left) * share**2 * (3.0 - 2.0 * share)
            assert abs(memory.error) > 1e-3
            assert memory.shift[foot] == pytest.approx(grown, rel=1e-6)


def test_a_leg_of_one_joint_moves_its_foot_as_far_as_it_can() -> None:
    """Along the ground, with what it cannot keep from going up: by least squares."""
    robot, law = walking.bravo7(), hs.FootstepFeedback(walking.bravo7(), motion())
    state = disturbed(0)
    asked(law, state)
    asking, foot, place = law._asked, 0, 0.01
    assert asking is not None
    seen, memory = asking.control.robot, asking.numbers.memory
    joint = int(seen.leg_joint[foot, 0])
    seen.leg_joint[foot, 1:] = -1
    memory.wanted[:] = 0.0
    shift_leg(foot, place, 0.0, 0.0, asking.control.state, seen, asking.numbers.parameters, memory)
    points = list(robot.feet[foot].contacts)
    z, x = dynamics.contact_jacobian(robot, state.q)[points].mean(axis=0)[:, joint]
    gain = law.parameters.kp[seen.motor[joint]]
    assert memory.wanted[joint] == pytest.approx(gain * place * x / (x * x + z * z + LEG_DAMPING))
    assert np.flatnonzero(memory.wanted).tolist() == [joint]


def test_the_centre_of_mass_is_that_of_the_motion() -> None:
    law = hs.FootstepFeedback(walking.bravo7(), motion())
    parameters, _ = law.numbers(walking.bravo7())
    (phase, *_) = motion().phases
    for k, begin in enumerate(phase.breakpoints[:-1]):
        inside = 0.4 * (phase.breakpoints[k + 1] - begin)
        place = dynamics.center_of_mass(walking.bravo7(), phase.coordinates(begin + inside))
        found = np.polynomial.polynomial.polyval(inside, parameters.mass[k, :, 0])
        assert found == pytest.approx(place[0], abs=1e-9)
