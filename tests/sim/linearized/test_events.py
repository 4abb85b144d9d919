"""How events of a run are put together, what holds between them, and which are refused: by hand.

The run is a table that somebody wrote; the robots are small.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.contact.linearized.motion import ActiveContacts
from heelstrike.errors import SimulationError
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.linearized import step as its
from heelstrike.sim.linearized.inputs import NONE, TORQUE, Inputs
from heelstrike.sim.linearized.step import Motion, Saltation
from heelstrike.sim.run import Event

PAIR: Any = mechanisms.block(width=0.4, height=0.2)
"""Two points, three coordinates, no motors."""


def event(
    time: float, kind: EventKind = EventKind.TOUCHDOWN, contact: int = 0,
    impulse: tuple[float, float] = (0.0, 0.0),
) -> Event:  # fmt: skip
    return Event(time=time, kind=kind, contact=contact, impulse=impulse)


def run_of(*events: Event, rows: int = 5, **other: Any) -> Any:
    """A run of rows 0.1 s apart, in which nothing touches anything."""
    given = {
        "robot": PAIR, "events": events, "saturations": 0, "pushes": (), "ground": hs.Ground(),
        "time": 0.1 * np.arange(rows), "contact_force": np.zeros((rows, 2, 2)),
        "slip_velocity": np.zeros((rows, 2)), "stop_torque": np.zeros((rows, 3)),
        "position": np.zeros((rows, 3)), "velocity": np.zeros((rows, 3)),
        "torque": np.zeros((rows, 0)),
    }  # fmt: skip
    return SimpleNamespace(**(given | other))


def held_by(
    resting: tuple[int, ...], sliding: tuple[tuple[int, int], ...], joints: tuple[int, ...]
) -> ActiveContacts:
    return ActiveContacts(resting=resting, sliding=sliding, joints=joints)


# Which events there are.


def test_events_of_one_instant_are_together_and_those_outside_left_out() -> None:
    """After the beginning, up to the end and what belongs to it."""
    times = [0.05, 0.1, 0.2, 0.2 + 5e-12, 0.2 + 3e-11, 0.3, 0.4, 0.4 + 5e-12, 0.4 + 3e-11]
    events = [event(each) for each in times]
    found = its._instants(run_of(*events), 0.1, 0.4)
    assert [[each.time for each in instant] for instant in found] == [
        [0.2, 0.2 + 5e-12], [0.2 + 3e-11], [0.3], [0.4, 0.4 + 5e-12],
    ]  # fmt: skip
    assert its._instants(run_of(*events), 0.5, 0.9) == []


@pytest.mark.parametrize("kind", list(EventKind))
def test_events_without_a_derivative_are_refused_up_to_the_end(kind: EventKind) -> None:
    refused = kind.name in {
        "ZENO", "PAINLEVE", "ENERGY_GAIN", "BRIDGE", "WEDGED", "JOINT_SLIP", "JOINT_STICK",
        "JOINT_BRAKE",
    }  # fmt: skip
    run = run_of(event(0.1), event(0.2, kind))
    its._refuse(PAIR, run, 0.199)
    for end in (0.2, 0.3):
        if refused:
            with pytest.raises(SimulationError, match=f"{kind.name} at t = 0.2 s cannot be lin"):
                its._refuse(PAIR, run, end)
        else:
            its._refuse(PAIR, run, end)


def test_robots_and_runs_without_a_derivative_are_refused() -> None:
    model = SimpleNamespace(dry_friction=np.array([0.0, 0.0]))
    robot: Any = SimpleNamespace(name="it", model=model, constraints=())
    its._refuse(robot, run_of(), 1.0)
    with pytest.raises(SimulationError, match="torques reached the limits of the motors"):
        its._refuse(robot, run_of(saturations=1), 1.0)
    robot.constraints = ("cable",)
    with pytest.raises(SimulationError, match="constraints from outside of 'it'"):
        its._refuse(robot, run_of(), 1.0)
    robot.constraints, model.dry_friction[1] = (), 1e-9
    with pytest.raises(SimulationError, match="dry friction in the joints of 'it'"):
        its._refuse(robot, run_of(), 1.0)


# What holds.


def test_what_holds_between_two_events_is_what_the_row_in_their_middle_shows() -> None:
    run = run_of(rows=6)
    run.contact_force[2, :, 0] = 5.0, 7.0
    run.slip_velocity[2] = 2e-9, -5e-10
    run.stop_torque[2, 1] = -3.0
    held = its._active(run, 0.05, 0.37, ())
    assert held == ActiveContacts(resting=(1,), sliding=((0, 1),), joints=(1,))
    run.slip_velocity[2] = 1e-9, -2e-9
    run.contact_force[2, 0, 0] = 0.0
    assert its._active(run, 0.05, 0.37, (2,)) == held_by((), ((1, -1),), (1, 2))
    run.contact_force[2, 0, 0] = 1e-12
    assert its._active(run, 0.05, 0.37, ()).resting == (0,)
    assert its._active(run, 0.0, 0.1, ()) == ActiveContacts()
    # Between 0.21 and 0.29 there is no row: that of 0.2 says what comes after it, the last of it.
    assert its._active(run, 0.2, 0.3, ()).resting == (0,)
    run.time[3] = 0.2
    run.contact_force[3, 0, 0] = 9.0
    assert its._active(run, 0.2, 0.4, ()) == held_by((0,), (), ())
    assert its._active(run, 0.1 + 1e-13, 0.3, (2,)).joints == (1, 2)
    # A row just at an event is none between.
    assert its._active(run, 0.2 - 1e-12, 0.2 + 2e-12, ()) == held_by((0,), (), ())


def instant(run: Any, *events: Event, after: bool = True, inputs: Inputs = NONE) -> Any:
    held = ActiveContacts()
    return its._Instant(run, events, held, held if after else None, inputs, (2,))


def test_points_whose_impulse_is_on_the_cone_slide_and_those_within_rest() -> None:
    """Forward where they are pushed backward; joints are held, and those with brakes."""
    friction = np.array([0.5, 0.8])
    events = [
        event(0.2, EventKind.TOUCHDOWN, 0, (2.0, -1.0)),
        event(0.2, EventKind.IMPACT, 1, (2.0, 1.59)), event(0.2, EventKind.JOINT_STOP, 1, (3.0, 0)),
    ]  # fmt: skip
    at = instant(run_of(*events), *events)
    assert at._struck(events, friction) == held_by((1,), ((0, 1),), (1, 2))
    slides = [event(0.2, EventKind.TOUCHDOWN, 1, (2.0, 1.6))]
    assert at._struck(slides, friction) == held_by((), ((1, -1),), (2,))
    nearly = [event(0.2, EventKind.TOUCHDOWN, 1, (2.0, 1.6 * (1.0 - 5e-10)))]
    assert at._struck(nearly, friction).sliding == ((1, -1),)
    within = [event(0.2, EventKind.TOUCHDOWN, 1, (2.0, 1.6 * (1.0 - 5e-9)))]
    assert at._struck(within, friction).resting == (1,)


def test_what_receives_an_impulse_is_struck_and_what_comes_is_fresh() -> None:
    """Faster than 1e-8 m/s; events without an impulse strike nothing."""
    run = run_of(rows=4)
    run.position[:, 1] = 0.1
    run.velocity[2] = [0.0, -2e-8, 0.0]
    events = [
        event(0.2, EventKind.TOUCHDOWN, 0, (2.0, 0.0)), event(0.2, EventKind.SLIP, 1),
        event(0.2, EventKind.IMPACT, 1, (1.0, 0.0)),
    ]  # fmt: skip
    at = instant(run, *events)
    assert (at.time, at.rows) == (0.2, (2, 2))
    assert at.struck == [events[0], events[2]]
    assert at.fresh == [events[0], events[2]]
    run.velocity[2, 1] = -0.9e-8
    assert instant(run, *events).fresh == []
    run.velocity[2] = [0.0, 0.0, 1.0]  # one corner comes down, the other goes up
    assert instant(run, *events).fresh in ([events[0]], [events[2]])
    run.velocity[2, 1] = 1.0
    run.time[3] = 0.2
    assert instant(run, *events).rows == (2, 3)


def test_a_joint_comes_to_either_end_of_its_range() -> None:
    """Towards the upper end the gap falls as the joint rises."""
    build = hs.RobotBuilder("slides")
    one = build.slide("one", None, mass=2.0, inertia=0.1, limits=(-1.0, 3.0), direction=(1.0, 0.0))
    build.slide("two", one, mass=2.0, inertia=0.1, limits=(-1.0, 3.0), direction=(1.0, 0.0))
    robot, zeros = build.build(), np.zeros((4, 2))
    run = run_of(rows=4, robot=robot, position=zeros.copy(), velocity=zeros.copy())
    stop = event(0.2, EventKind.JOINT_STOP, 1, (1.0, 0.0))
    for place, sign in ((1.1, -1.0), (0.9, 1.0)):
        run.position[2, 1] = place
        gradient = instant(run, stop)._gap_gradient(stop)
        assert gradient.tolist() == [0.0, sign, 0.0, 0.0]


# Saltations.


class Told:
    """An instant whose impacts are known: matrices by what comes down first."""

    def __init__(self, *events: Event, rate: list[float] | None = None) -> None:
        self.it = instant(run_of(*events), *events)
        self.it.__dict__["before"] = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
        self.it.__dict__["rate"] = np.array(rate or [1.0, 2.0, 3.0, 0.0, 0.0, 0.0])


def test_events_without_impulses_change_nothing_but_where_slip_ends() -> None:
    """There forces jump as a speed vanishes: I + (f⁺ − f⁻) ∇s / (∇s · f⁻)."""
    speed = np.arange(1.0, 7.0)
    rate = [1.0, 2.0, 3.0, 4.0, 0.0, 6.0]
    jump = np.array(rate) - [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    ends = np.eye(6) + np.outer(jump, speed) / 14.0
    for kind, expected in (
        (EventKind.LIFTOFF, np.eye(6)), (EventKind.SLIP, np.eye(6)), (EventKind.STICK, ends),
        (EventKind.SLIP_REVERSAL, ends),
    ):  # fmt: skip
        told = Told(event(0.2, kind, 1), rate=rate).it
        velocity = np.zeros((2, 2, 6))
        velocity[1, 1] = speed
        told.__dict__["slopes"] = SimpleNamespace(velocity=velocity)
        found = told.saltation()
        np.testing.assert_allclose(found.matrix, expected, rtol=1e-14)
        assert (found.time, found.kinds, found.spread) == (0.2, (kind,), 0.0)
    told = instant(run_of(), event(0.2, EventKind.STICK, 1), after=False)
    told.__dict__["before"] = np.ones(6)
    np.testing.assert_array_equal(told.saltation().matrix, np.eye(6))
    assert told.rate.tolist() == [0.0] * 6


def test_of_several_orders_the_mean_is_taken_and_how_far_they_differ_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = [event(0.2, EventKind.TOUCHDOWN, k, (1.0, 0.0)) for k in range(2)]
    events.insert(1, event(0.2, EventKind.LIFTOFF, 1))
    told = Told(*events).it
    matrices = {"first": np.eye(6), "second": np.diag([1.0, 3.0, 1.0, 1.0, 1.0, 0.5])}
    monkeypatch.setattr(its._Instant, "_orders", lambda _: ["first", "second"])
    monkeypatch.setattr(its._Instant, "_through", lambda _, order: matrices[order])
    found = told.saltation()
    np.testing.assert_allclose(found.matrix, np.diag([1.0, 2.0, 1.0, 1.0, 1.0, 0.75]))
    assert found.spread == 2.0
    assert found.kinds == (EventKind.TOUCHDOWN, EventKind.LIFTOFF)


def test_strikes_follow_each_other_and_the_last_leaves_to_what_comes_after() -> None:
    """Each with the rate after it, the last with that of the motion after all; inputs stay."""
    from heelstrike.contact.linearized.motion import saltation_matrix

    inputs = Inputs(("mass",), {TORQUE: slice(0, 1), "mass": slice(1, 3)})
    told = instant(run_of(), event(0.2), inputs=inputs)
    draw = np.random.default_rng(2)
    told.__dict__["before"], told.__dict__["rate"] = draw.normal(size=6), draw.normal(size=6)

    def strike() -> Any:
        return SimpleNamespace(
            gradient=draw.normal(size=6), before=draw.normal(size=6), after=draw.normal(size=6),
            impact=SimpleNamespace(
                reset=draw.normal(size=(6, 6)), by_numbers=draw.normal(size=(6, 2))
            ),
        )  # fmt: skip

    def wide(vector: Any) -> Any:
        return np.append(vector, [0.0, 0.0, 0.0])

    order, expected = [strike(), strike()], np.eye(9)
    for each, after in zip(order, (order[0].after, told.rate), strict=True):
        reset = np.eye(9)
        reset[:6, :6], reset[:6, 7:] = each.impact.reset, each.impact.by_numbers
        np.testing.assert_array_equal(told._reset(each), reset)
        own = saltation_matrix(reset, wide(each.gradient), wide(each.before), wide(after))
        expected = own @ expected
    np.testing.assert_allclose(told._through(order), expected, rtol=1e-12)


def test_orders_are_all_that_can_be_and_no_more_than_of_three(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def orders(count: int, can_be: Any) -> Any:
        told = instant(run_of(), event(0.2))
        told.__dict__["fresh"] = list(range(count))
        monkeypatch.setattr(its._Instant, "_in_order", lambda _, each: can_be(each))
        return told._orders()

    assert len(orders(3, lambda each: each)) == 6
    assert orders(2, lambda each: each if each[0] == 1 else []) == [(1, 0)]
    with pytest.raises(SimulationError, match=r"4 contact points come down together at t = 0.2 s"):
        orders(4, lambda each: each)
    with pytest.raises(SimulationError, match="no point lands in it, or several cannot land"):
        orders(2, lambda each: [])


def test_what_arrives_is_the_one_point_that_comes_down(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(its._Instant, "_orders", lambda _: [["strike of the first", "last"]])
    for fresh, arrives in (
        ([event(0.2)], "last"), ([], None), ([event(0.2)] * 2, None),
        ([event(0.2, EventKind.JOINT_STOP)], None),
    ):  # fmt: skip
        told = instant(run_of(), event(0.2))
        told.__dict__["fresh"] = fresh
        assert told.arrival() == arrives


@pytest.mark.parametrize(("off", "fits"), [(9e-7, True), (1.1e-6, False)])
@pytest.mark.parametrize("size", [0.5, 3.0])
def test_an_impact_that_is_not_the_simulation_s_is_refused(
    off: float, fits: bool, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By 1e-6 of its largest velocity, or of 1 m/s."""
    events = [event(0.2, EventKind.TOUCHDOWN, 0, (2.0, 0.0)),
              event(0.2, EventKind.IMPACT, 1, (1.0, 0.0))]  # fmt: skip
    run = run_of(*events, rows=4)
    run.time[3] = 0.2
    run.velocity[3] = [0.0, -size - off * max(1.0, size), 0.1]
    asked: dict[str, Any] = {}

    def strikes(
        robot: Any, q: Any, v: Any, before: Any, torque: Any, down: Any, *others: Any
    ) -> Any:
        asked.update(v=v, before=before, down=down, others=others)
        found = SimpleNamespace(impact=SimpleNamespace(velocity=np.array([0.0, -size, 0.1])))
        return [found]

    monkeypatch.setattr(its, "strikes", strikes)
    told = instant(run, *events)
    told.__dict__["before"], told.__dict__["fresh"] = np.ones(6), [events[0]]
    if fits:
        assert len(told._in_order([events[0]])) == 1
    else:
        with pytest.raises(SimulationError, match="points slide, bounce or lift off in it"):
            told._in_order([events[0]])
    ((_, active),) = asked["down"]
    assert active.resting == (0, 1)  # the other takes part, though it was there
    assert asked["v"].tolist() == [0.0, 0.0, 0.0]
    monkeypatch.setattr(its, "strikes", lambda *_: [])
    assert told._in_order([events[0]]) == []


# Motions.


def test_a_motion_is_the_product_of_its_flows_and_saltations() -> None:
    draw = np.random.default_rng(7)
    flows = tuple(draw.normal(size=(3, 2, 2)))
    events = tuple(
        Saltation(time=0.1, kinds=(), matrix=each, spread=0.0)
        for each in draw.normal(size=(3, 2, 2))
    )
    first = flows[2] @ events[1].matrix @ flows[1] @ events[0].matrix @ flows[0]
    section = Motion(flows, events, None)
    np.testing.assert_allclose(section.until_the_last, first)
    np.testing.assert_allclose(section.matrix, events[2].matrix @ first)
    np.testing.assert_allclose(Motion(flows, events[:2], None).matrix, first)
    np.testing.assert_array_equal(Motion(flows[:1], (), None).matrix, flows[0])


@pytest.mark.parametrize("section", [True, False])
def test_flows_go_from_event_to_event(section: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a section up to its last event; otherwise up to the end."""
    run = run_of(event(0.15), event(0.2), event(0.3), rows=9)
    run.contact_force[:, 0, 0] = 1.0
    went: list[Any] = []

    def flow(begin: float, end: float, active: Any) -> Any:
        went.append((begin, end))
        return np.eye(2) * (len(went) + 1)

    def saltation(self: Any) -> Any:
        return Saltation(time=self.time, kinds=(self.after is None,), matrix=np.eye(2), spread=0.0)  # type: ignore[arg-type]

    monkeypatch.setattr(its._Instant, "saltation", saltation)
    monkeypatch.setattr(its._Instant, "arrival", lambda _: "it")
    variation: Any = SimpleNamespace(flow=flow, braked=(), inputs=NONE)
    found = its.linearized(run, 0.31, variation, section=section, begin=0.1)
    ends = [(0.1, 0.15), (0.15, 0.2), (0.2, 0.3)]
    assert went == (ends if section else [*ends, (0.3, 0.31)])
    assert [each.time for each in found.saltations] == [0.15, 0.2, 0.3]
    assert [each.kinds[0] for each in found.saltations] == [False, False, section]
    assert found.arrival == ("it" if section else None)
    assert found.matrix[0, 0] == (24.0 if section else 120.0)
