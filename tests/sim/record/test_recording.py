"""What a run keeps of its steps, by numbers known beforehand."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import point
from synthetic_runs import box, pendulum

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.robot import Robot, read_mjcf
from heelstrike.sim import Certificates, EventKind, Scheme
from heelstrike.sim.memory import Memory, allocate_memory
from heelstrike.sim.record.recording import note_extremes

G = 9.81
TOUCHDOWN, LIFTOFF = EventKind.TOUCHDOWN, EventKind.LIFTOFF


def worst(memory: Memory) -> tuple[float, float, float, float]:
    tally = memory.tally
    return tally.penetration, tally.complementarity, tally.cone, tally.non_penetration


def test_worst_values_are_the_worst_of_all_steps_each_for_itself() -> None:
    """Depth of the deepest point and the largest of each residual, wherever in the run."""
    robot = box()
    memory = allocate_memory(robot)
    note = uncompiled(note_extremes)
    steps = [
        # gaps of the two points, then complementarity, cone, non-penetration
        ([0.5, 0.1], [1e-13, 2e-13, 0.0]),
        ([-3e-4, 0.2], [5e-12, 1e-13, 7e-13]),
        ([0.0, -8e-4], [2e-12, 9e-12, 3e-12]),
        ([0.3, -1e-4], [0.0, 0.0, 0.0]),
    ]
    for gap, residual in steps:
        memory.contacts.gap[:] = gap
        memory.assembly.answer.residual[:] = residual
        note(memory.contacts.gap, memory.assembly.answer.residual, memory.tally)
    assert worst(memory) == (8e-4, 5e-12, 9e-12, 3e-12)


def test_points_that_stay_above_the_ground_penetrate_by_nothing() -> None:
    robot = box()
    memory = allocate_memory(robot)
    memory.contacts.gap[:] = [0.1, 0.2]
    residual, note = memory.assembly.answer.residual, uncompiled(note_extremes)
    note(memory.contacts.gap, residual, memory.tally)
    assert worst(memory) == (0.0, 0.0, 0.0, 0.0)


def test_worst_values_come_out_under_their_names() -> None:
    state = box().reference_state()
    simulation = hs.Simulation(box(), state=state)
    tally = simulation._memory.tally
    tally.penetration, tally.complementarity, tally.cone = 1e-3, 2e-12, 3e-12
    tally.non_penetration, tally.energy_gain = 4e-12, 5.0
    found = simulation.record.certificates
    assert found == Certificates(
        penetration=1e-3, complementarity=2e-12, cone=3e-12, non_penetration=4e-12, energy_gain=5.0
    )


@pytest.mark.parametrize("record_every", [1, 7])
def test_compliant_ground_is_penetrated_as_deep_as_statics_says(record_every: int) -> None:
    """Kelvin and Voigt: a block dropped onto springs sinks to twice the depth at rest.

    Without damping, from rest at the surface, z = −(m g / 2 k)(1 − cos ω t) on two points.
    """
    mass, stiffness = 2.0, 4e4
    law = hs.KelvinVoigt(stiffness=stiffness, damping=0.0)
    run = hs.simulate(
        box(),
        state=box().reference_state(),
        duration=0.05,
        method=hs.Compliant(step=1e-4, law=law),
        record_every=record_every,
    )
    deepest = 2.0 * mass * G / (2.0 * stiffness)
    assert np.pi / np.sqrt(2.0 * stiffness / mass) < 0.05  # the lowest point is within the run
    assert run.certificates.penetration == pytest.approx(deepest, rel=1e-3)


def test_the_worst_of_event_driven_runs_is_on_the_ground() -> None:
    run = hs.simulate(
        point(), state=hs.State([0.0, 0.2], [1.0, 0.0]), duration=0.5, method=hs.EventDriven()
    )
    assert 0.0 <= run.certificates.penetration <= 1e-9
    assert run.certificates.penetration >= -run.gap.min()


METHODS: dict[str, tuple[object, float]] = {
    **{scheme.name.lower(): (hs.TimeStepping(step=1e-3, scheme=scheme), 1e-3) for scheme in Scheme},
    "event_driven": (hs.EventDriven(output_period=1e-3), 0.0),
    "compliant": (hs.Compliant(step=1e-4), 1e-4),
}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", METHODS)
def test_slip_has_the_sign_of_the_motion_and_friction_the_other(
    name: str, direction: float
) -> None:
    """A block on friction 0.5 that slides at 2 m/s: v = ±(2 − μ g t), force ∓ μ m g.

    Methods with a step tell the velocity at its end.
    """
    method, ahead = METHODS[name]
    start = hs.State(box().model.reference, np.array([2.0 * direction, 0.0, 0.0]))
    if name in ("paper_explicit", "paper_symplectic", "moreau_jean"):
        method = hs.TimeStepping(step=1e-3, scheme=Scheme[name.upper()], activation=1e-6)
    run = hs.simulate(
        box(),
        state=start,
        duration=0.02,
        method=method,  # type: ignore[arg-type]
        ground=hs.Ground(friction=0.5),
    )
    # Soft ground first takes up the weight; it is under way to that by the end.
    compliant = name == "compliant"
    rows = slice(1, None) if not compliant else slice(0, 0)
    expected = direction * (2.0 - 0.5 * G * (run.time + ahead))
    for contact in range(2):
        np.testing.assert_allclose(run.slip_velocity[rows, contact], expected[rows], atol=1e-9)
    np.testing.assert_allclose(
        run.contact_force.sum(axis=1)[rows],
        np.tile([2.0 * G, -direction * 0.5 * 2.0 * G], (len(run.time[rows]), 1)),
        rtol=1e-9,
    )
    pressed = run.contact_force[..., 0] > 0.0
    assert pressed.any()
    assert np.all(direction * run.slip_velocity[pressed] > 1.8)
    assert np.all(direction * run.contact_force[pressed][:, 1] < 0.0)


def test_a_block_slides_to_rest_as_on_paper() -> None:
    """Every column of the first rows, by hand: 2 kg, friction 0.5, 0.2 m long, 0.1 m high.

    Friction μ m g at the ground, 0.05 m below the centre, has a moment that the points' forces
    balance, 0.1 m before and behind it: each pair differs by μ m g · 0.05 / 0.1.
    """
    h, friction, speed, mass = 0.01, 0.5, 2.0, 2.0
    robot = box()
    run = hs.simulate(
        robot,
        state=hs.State(robot.model.reference, np.array([speed, 0.0, 0.0])),
        duration=0.5,
        method=hs.TimeStepping(step=h),
        ground=hs.Ground(friction=friction),
    )
    first = np.arange(5)
    v = speed - first * friction * G * h
    x = h * np.concatenate([[0.0], np.cumsum(v[1:])])
    rest = robot.model.reference
    np.testing.assert_allclose(run.time[first], [0.0, 0.01, 0.02, 0.03, 0.04], atol=1e-15)
    np.testing.assert_allclose(run.velocity[first], v[:, None] * [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(run.position[first], rest + x[:, None] * [1.0, 0.0, 0.0], atol=1e-12)
    ahead = np.sign(robot.model.contact_position[:, 0])  # which point is in front
    np.testing.assert_array_equal(np.sort(ahead), [-1.0, 1.0])
    pressing = 0.5 * mass * G + 0.5 * ahead * friction * mass * G * 0.05 / 0.1
    np.testing.assert_allclose(np.sort(pressing), [7.3575, 12.2625])
    force = np.stack([pressing, -friction * pressing], axis=-1)
    np.testing.assert_allclose(run.contact_force[first], np.tile(force, (5, 1, 1)), rtol=1e-9)
    at_the_end = (v - friction * G * h)[:, None]
    np.testing.assert_allclose(run.slip_velocity[first], np.tile(at_the_end, 2), atol=1e-12)
    place = np.stack([rest[0] + x[:, None] + 0.1 * ahead, np.zeros((5, 2))], axis=-1)
    np.testing.assert_allclose(run.contact_point[first], place, atol=1e-12)
    np.testing.assert_array_equal(run.contact_normal, np.tile([0.0, 1.0], (51, 2, 1)))
    np.testing.assert_allclose(run.gap[first], 0.0, atol=1e-12)
    assert run.torque.shape == (51, 0)
    np.testing.assert_array_equal(run.stop_torque, 0.0)
    np.testing.assert_array_equal(run.friction_torque, 0.0)
    np.testing.assert_allclose(run.residual, 0.0, atol=1e-12)
    # 2 m/s last 40.8 steps: in the first it slips, in the 41st, from 0.40 s on, it stops.
    assert [(e.kind, e.contact, round(e.time, 9)) for e in run.events] == [
        (EventKind.SLIP, 0, 0.01),
        (EventKind.SLIP, 1, 0.01),
        (EventKind.STICK, 0, 0.41),
        (EventKind.STICK, 1, 0.41),
    ]
    impulse = np.array([event.impulse for event in run.events])
    np.testing.assert_allclose(impulse[:2], h * force, rtol=1e-9)
    left = speed - 40 * friction * G * h
    np.testing.assert_allclose(impulse[2:].sum(axis=0), [mass * G * h, -mass * left], rtol=1e-9)
    assert run.steps == 50
    assert run.saturations == 0


HINGE = """
<mujoco model="hinge">
  <compiler angle="radian"/>
  <worldbody>
    <body name="rod" pos="0 0 2">
      <joint name="swing" type="hinge" axis="0 1 0" frictionloss="{friction}"/>
      <inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="swing" ctrlrange="-25 20" ctrllimited="true"/></actuator>
</mujoco>
"""


def hinge(friction: float = 0.0) -> Robot:
    """Return a rod of 3 kg on a hinge, its centre 0.5 m below, driven within −25 … 20 N m."""
    return read_mjcf(HINGE.format(friction=friction), name="hinge")


class Steady:
    """A torque that does not change."""

    def __init__(self, torque: float) -> None:
        self.answer = np.array([torque])

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return self.answer


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stop_pushes_back_with_what_statics_asks(side: float) -> None:
    """A rod held at its stop by 20 N m: the stop bears what its weight does not."""
    angle = side * np.pi / 3.0
    run = hs.simulate(
        pendulum(limited=True),
        Steady(20.0 * side),
        state=hs.State([angle], [0.0]),
        duration=0.01,
    )
    weight = 3.0 * G * 0.5 * np.sin(angle)
    np.testing.assert_allclose(run.torque, 20.0 * side)
    np.testing.assert_allclose(run.stop_torque, weight - 20.0 * side, rtol=1e-9)
    np.testing.assert_allclose(run.position, angle, atol=1e-12)


@pytest.mark.parametrize("torque", [1.5, -1.5])
def test_dry_friction_that_holds_is_minus_what_it_holds(torque: float) -> None:
    run = hs.simulate(hinge(2.0), Steady(torque), state=hs.State([0.0], [0.0]), duration=0.01)
    np.testing.assert_allclose(run.friction_torque, -torque, rtol=1e-9)
    np.testing.assert_allclose(run.velocity, 0.0, atol=1e-12)


TWO_HINGES = """
<mujoco model="two_hinges">
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0 0 2">
      <joint name="shoulder" type="hinge" axis="0 1 0" frictionloss="30"/>
      <inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>
      <body name="lower" pos="0 0 -1">
        <joint name="elbow" type="hinge" axis="0 1 0" frictionloss="10"/>
        <inertial pos="0 0 -0.5" mass="2" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(output_period=1e-3)])
def test_every_joint_that_friction_holds_is_recorded(
    method: hs.TimeStepping | hs.EventDriven,
) -> None:
    """Two rods at rest, one below the other: each joint bears the moment of what depends on it."""
    upper, lower = 0.5, 0.3
    run = hs.simulate(
        read_mjcf(TWO_HINGES),
        state=hs.State([upper, lower], [0.0, 0.0]),
        duration=0.01,
        method=method,
    )
    elbow = 2.0 * G * 0.5 * np.sin(upper + lower)
    shoulder = (3.0 * 0.5 + 2.0) * G * np.sin(upper) + elbow
    np.testing.assert_allclose(
        run.friction_torque, np.tile([shoulder, elbow], (len(run.time), 1)), rtol=1e-9
    )
    np.testing.assert_allclose(run.velocity, 0.0, atol=1e-12)


@pytest.mark.parametrize(("wanted", "given"), [(30.0, 20.0), (-30.0, -25.0), (20.0, 20.0)])
def test_torques_are_clipped_to_their_own_limit_and_counted(wanted: float, given: float) -> None:
    run = hs.simulate(hinge(), Steady(wanted), state=hs.State([0.0], [0.0]), duration=0.005)
    np.testing.assert_array_equal(run.torque, given)
    clipped = len(run.time) if wanted != given else 0
    assert run.saturations == clipped


def test_events_of_a_step_come_in_the_order_in_which_they_happened() -> None:
    """One mass lands by the end of the step at whose beginning another, numbered after it, leaves.

    Euler steps let the first one fall by g h² k (k + 1) / 2 in k of them; it arrives in the 51st.
    The second is pulled up from the beginning of the 50th on.
    """
    step, falls = 1e-3, 50
    builder = hs.RobotBuilder("two masses", gravity=G)
    for name in ("lands", "leaves"):
        mass = builder.slide(name, None, direction=(0, 1), mass=1.0)
        builder.contact(mass, (0.0, 0.0))
    height = G * step**2 * (falls * (falls + 1) / 2 + falls / 2)
    run = hs.simulate(
        builder.build(),
        state=hs.State(np.array([height, 0.0]), np.zeros(2)),
        duration=0.06,
        method=hs.TimeStepping(step=step),
        pushes=[hs.Push("leaves", force=(0.0, 3.0 * G), start=0.049, duration=0.1)],
    )
    told = [(event.kind, event.contact, pytest.approx(event.time)) for event in run.events]
    assert told == [(EventKind.LIFTOFF, 1, 0.050), (EventKind.TOUCHDOWN, 0, 0.051)]


def test_what_a_step_ends_with_comes_before_what_the_next_begins_with() -> None:
    """A point that bounces for one step comes down and leaves at one time, the same to the bit."""
    run = hs.simulate(
        point(), state=hs.State([0.0, 0.05], [0.2, 0.0]), duration=1.0,
        method=hs.TimeStepping(scheme=Scheme.MOREAU_JEAN),
        ground=hs.Ground(friction=0.5, restitution=0.8), stop_when_fallen=False,
    )  # fmt: skip
    kinds = [event.kind for event in run.events if event.kind in (TOUCHDOWN, LIFTOFF)]
    assert len(kinds) >= 10
    assert kinds == [TOUCHDOWN, LIFTOFF] * (len(kinds) // 2) + [TOUCHDOWN] * (len(kinds) % 2)
    times = np.array([event.time for event in run.events])
    assert np.isin(times, run.time).all()
    assert np.any(np.diff(times) == 0.0)
