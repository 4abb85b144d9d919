"""What viewers ask for, without a server or a clock."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.dynamics import link_poses
from heelstrike.sim import EventKind
from heelstrike.view.live import live_simulation
from heelstrike.view.live import session as sessions
from heelstrike.view.live.board import Board
from heelstrike.view.live.frames import Layout
from heelstrike.view.live.session import Session
from heelstrike.view.live.stage import GivenStage, Stage
from heelstrike.wording import counted

TICK = 0.016
TRUNK_LINK, _ = hs.Push("trunk", force=(1.0, 0.0), start=0.0, duration=0.0).place(walking.bravo7())


class Shown(Board):
    """A board that is looked at without JSON."""

    def __init__(self) -> None:
        super().__init__()
        self.told: dict[str, Any] = {}
        self.course: list[np.ndarray] = []
        self.seen: np.ndarray | None = None

    def begin(self, scene: Any) -> None:
        super().begin(scene)
        self.scene, self.course, self.seen = scene, [], None

    def add(self, frames: Any, events: Any = ()) -> None:
        super().add(frames, events)
        self.course += list(frames)
        self.seen = self.course[-1]

    def look(self, frame: Any) -> None:
        super().look(frame)
        self.seen = frame

    def cut(self, time: float) -> None:
        super().cut(time)
        self.course = [frame for frame in self.course if frame[0] <= time]

    def state(self, state: Any) -> None:
        super().state(state)
        self.told |= state

    def field(self, name: str) -> np.ndarray:
        begin, width = self.scene["layout"]["fields"][name]
        assert self.seen is not None
        return self.seen[begin : begin + width]


def walker(controller: Any = None, **options: Any) -> hs.Simulation:
    robot = walking.bravo7()
    return hs.Simulation(
        robot,
        hs.ComputedTorque(robot, walking.gait()) if controller is None else controller,
        state=walking.gait().initial_state,
        **options,
    )


def watching(what: hs.Simulation | hs.Run | Stage) -> tuple[Session, Shown]:
    """Return a session that has begun, and its board."""
    shown = Shown()
    if isinstance(what, hs.Run):
        session = Session(shown, run=what)
    else:
        session = Session(shown, stage=what if isinstance(what, Stage) else GivenStage(what))
    session.begin()
    return session, shown


def go_on(session: Session, until: float) -> None:
    for _ in range(2000):
        if session.cursor >= until - 1e-9:
            return
        session.update(min(TICK, until - session.cursor + 1e-9))
    raise AssertionError(f"stays at {session.cursor}: {session.history.newest}")


def ask(session: Session, do: str, viewer: str = "a", **more: Any) -> str:
    """Ask for something; return the note that comes back."""
    session.obey(viewer, {"do": do, **more})
    return session._board.told["note"]


def test_the_simulation_goes_on_as_by_itself() -> None:
    session, shown = watching(walker())
    go_on(session, 0.9)
    whole = walking.walk(steps=2)
    part = session.history.part(0, len(session.history) - 1)
    rows = len(part.time)
    assert rows > 890
    assert np.array_equal(part.position, whole.position[:rows])
    assert np.array_equal(part.contact_force, whole.contact_force[:rows])
    kept = np.array([frame[0] for frame in shown.course])
    assert (np.diff(kept) > 0.0).all()
    assert np.diff(kept).max() < 1.5 / 60.0 + 2e-3
    assert {event[1] for event in shown._events} == {EventKind.TOUCHDOWN, EventKind.LIFTOFF}
    assert shown.told["light"]["level"] == "good"
    ask(session, "play", on=False)
    for _ in range(2):  # what is halted is told as it is, and so is what starts again
        newest = session.history.newest
        assert newest is not None
        problems = counted(newest.solver.solves, "contact problem", "contact problems")
        assert shown.told["light"]["text"].startswith(problems)
        ask(session, "reset")


@pytest.mark.parametrize("rate", [0.1, 8.0])
def test_slower_and_faster(rate: float) -> None:
    session, shown = watching(walker())
    go_on(session, 0.1)
    ask(session, "rate", value=rate)
    for _ in range(12):
        session.update(TICK)
    # A machine under load may be slower, never faster.
    assert 0.1 < session.cursor <= 0.1 + 12 * TICK * rate + 1e-3
    times = np.array([frame[0] for frame in shown.course if frame[0] > 0.105])
    # Slowly every step that is seen is there, quickly as many frames as at real time.
    assert np.diff(times).max() < max(rate * TICK, 1.5 / 60.0) + 2e-3


def test_back_and_forth() -> None:
    session, shown = watching(walker())
    go_on(session, 0.3)
    ask(session, "seek", time=0.1004)
    assert not session.playing
    assert shown.seen[0] == pytest.approx(0.1)
    ask(session, "step", rows=-1)
    assert shown.seen[0] == pytest.approx(0.099)
    ask(session, "step", rows=1)
    assert shown.seen[0] == pytest.approx(0.1)
    ask(session, "seek", time=-5.0)
    ask(session, "step", rows=-1)
    assert shown.seen[0] == 0.0
    ask(session, "seek", time=9.0)
    end = float(session.history.time[-1])
    assert shown.seen[0] == end
    ask(session, "step", rows=1)  # beyond the end one step is simulated
    assert session.history.time[-1] == pytest.approx(end + 1e-3)
    ask(session, "seek", time=0.25)
    ask(session, "play", on=True)
    frames = len(shown.course)
    session.update(TICK)  # what has been is played again
    assert len(shown.course) == frames
    go_on(session, 0.35)  # and then goes on
    assert session.history.time[-1] >= 0.35 - 1e-9
    assert len(shown.course) > frames


def test_events_are_jumped_to() -> None:
    session, shown = watching(walker())
    go_on(session, 1.5)
    kinds = [event.kind for event in session.history.events]
    assert kinds.count(EventKind.TOUCHDOWN) == 4  # heel and toe, twice
    ask(session, "event", direction=-1, kinds=["touchdown"])
    assert session.cursor == pytest.approx(1.4)
    assert shown.told["note"] == "at 1.4 s: touchdown (right foot heel, right foot toe)"
    # The force of the step in which the foot landed is seen.
    pressing = shown.field("pressing")
    assert pressing.max() > 3.0 * walking.bravo7().weight
    ask(session, "event", direction=-1, kinds=["touchdown"])
    assert session.cursor == pytest.approx(0.7)
    ask(session, "event", direction=1)
    assert session.cursor == pytest.approx(1.399)  # the other foot leaves
    assert "no later event" in ask(session, "event", direction=1, kinds=["joint_stop"])
    assert "no earlier event" in ask(session, "event", direction=-1, kinds=["slip"])


def test_a_pull_pushes_as_long_as_it_lasts() -> None:
    session, shown = watching(walker())
    go_on(session, 0.2)
    trunk = TRUNK_LINK
    ask(session, "hold", link=trunk, point=[0.0, 0.2], force=[40.0, 0.0])
    begin = session.live.time
    session.update(TICK)
    assert shown.field("push")[2:4].tolist() == [40.0, 0.0]
    ask(session, "hold", link=trunk, point=[0.0, 0.2], force=[0.0, 30.0])
    session.update(TICK)
    assert shown.field("push")[2:4].tolist() == [0.0, 30.0]
    middle, end = session.live.pushes[0].end, session.live.time
    ask(session, "release")
    session.update(TICK)
    assert np.isnan(shown.field("push")).all()
    go_on(session, 0.4)
    # The same pushes, given beforehand.
    pushes = [
        hs.Push(trunk, force=force, start=start, duration=stop - start, point=(0.0, 0.2))
        for force, start, stop in (((40.0, 0.0), begin, middle), ((0.0, 30.0), middle, end))
    ]
    same = walker(pushes=pushes)
    same.advance(0.4)
    part = session.history.part(0, session.history.row_at(0.399))
    expected = same.record.position[: len(part.time)]
    np.testing.assert_allclose(part.position, expected, atol=1e-9)  # ends of windows are rounded
    assert np.abs(expected - walking.walk(steps=2).position[: len(part.time)]).max() > 1e-3


def test_two_viewers_pull_at_once_and_one_leaves() -> None:
    session, shown = watching(walker())
    for viewer, link in (("a", 3), ("b", 4)):
        ask(session, "hold", viewer, link=link, point=[0.0, 0.0], force=[5.0, 0.0])
    session.update(TICK)
    assert np.isfinite(shown.field("push")).sum() == 8
    ask(session, "leave", "b")
    session.update(TICK)
    assert np.isfinite(shown.field("push")).sum() == 4


def test_it_goes_on_from_an_earlier_time_bit_by_bit() -> None:
    session, shown = watching(walker())
    go_on(session, 0.3)
    ask(session, "random push")
    assert " N on " in shown.told["note"]
    go_on(session, 0.6)
    kept = session.history.part(0, len(session.history) - 1)
    ask(session, "seek", time=0.35)  # within the push
    ask(session, "resume")
    assert session.history.time[-1] == pytest.approx(0.35)
    assert session.playing
    assert max(frame[0] for frame in shown.course) == pytest.approx(0.35)
    go_on(session, 0.6)
    again = session.history.part(0, session.history.row_at(0.599))
    assert np.array_equal(again.position, kept.position[: len(again.time)])
    # Before the push it is as if it had not been.
    ask(session, "seek", time=0.29)
    ask(session, "resume")
    go_on(session, 0.5)
    free = session.history.part(0, session.history.row_at(0.499))
    assert np.array_equal(free.position, walking.walk(steps=2).position[: len(free.time)])


def test_a_joint_of_the_halted_robot_is_moved() -> None:
    session, shown = watching(walker())
    robot = walking.bravo7()
    go_on(session, 0.3)
    before = session.live.simulation.state
    knee = robot.joint_index("left_knee")
    assert ask(session, "pose", joint="left_knee", value=1.2) == ""
    assert not session.playing
    state = session.live.simulation.state
    assert state.q[knee] == 1.2
    changed = np.flatnonzero(state.q != before.q)
    assert set(changed) <= {knee, robot.joint_index("root_z")}  # it stands on the ground
    assert session.live.simulation.contacts.gap.min() == pytest.approx(0.0, abs=1e-9)
    assert np.array_equal(state.v, before.v)
    sliders = {each["name"]: each for each in shown.scene["layout"]["joints"]}
    assert set(sliders) == set(robot.joint_names[3:])
    assert shown.seen[sliders["left_knee"]["at"]] == 1.2
    assert (sliders["left_knee"]["low"], sliders["left_knee"]["high"]) == (
        robot.model.lower[knee], robot.model.upper[knee],
    )  # fmt: skip
    assert shown.seen[0] == session.cursor == session.live.time
    # Beyond its range it comes to the end of it; it goes on from there, and can be taken back.
    ask(session, "pose", joint="left_knee", value=9.0)
    assert session.live.simulation.state.q[knee] == robot.model.upper[knee]
    ask(session, "play", on=True)
    go_on(session, 0.32)
    ask(session, "seek", time=0.2)
    ask(session, "pose", joint="left_knee", value=0.5)
    assert session.history.time[-1] == session.live.time == pytest.approx(0.2)
    assert session.live.simulation.state.q[knee] == 0.5
    assert "has no joint" in ask(session, "pose", joint="tail", value=1.0)
    assert "not a finite number" in ask(session, "pose", joint="left_knee", value="nan")


def test_joints_that_carry_the_robot_through_the_world_have_no_slider() -> None:
    compass = hs.load_robot("compass_gait")
    assert [each["name"] for each in Layout(compass).described()["joints"]] == [
        "right_leg", "left_leg",
    ]  # fmt: skip
    assert Layout(hs.load_robot("rimless_wheel")).described()["joints"] == []


def test_friction_acts_at_once_and_is_there_when_gone_back() -> None:
    session, _ = watching(walker())
    go_on(session, 0.2)
    assert ask(session, "choose", name="friction", value=0.02) == ""
    assert session.live.simulation.ground.friction == 0.02
    go_on(session, 0.32)
    assert any(event.kind is EventKind.SLIP for event in session.history.events)
    ask(session, "seek", time=0.25)
    ask(session, "resume")
    assert session.live.simulation.ground.friction == 0.02
    ask(session, "seek", time=0.1)
    ask(session, "resume")
    assert session.live.simulation.ground.friction == 0.75


def test_what_cannot_be_is_refused_in_words() -> None:
    session, shown = watching(walker())
    go_on(session, 0.05)
    for command, words in (
        ({"do": "fly"}, "unknown command 'fly'"),
        ({"do": "choose", "name": "friction", "value": -1.0}, "friction cannot be -1.0"),
        ({"do": "choose", "name": "friction", "value": float("nan")}, "friction cannot be nan"),
        ({"do": "choose", "name": "friction", "value": True}, "friction cannot be True"),
        ({"do": "choose", "name": "weather", "value": 1.0}, "weather cannot be 1.0"),
        ({"do": "seek"}, "cannot be read"),
        ({"do": "seek", "time": "nan"}, "not a finite number"),
        ({"do": "rate", "value": [1]}, "cannot be read"),
        ({"do": "hold", "link": 99, "point": [0, 0], "force": [1, 0]}, "links 0 to"),
        ({"do": "hold", "link": 2, "point": [0], "force": [1, 0]}, "two numbers"),
        ({"do": "hold", "link": 2, "point": [0, 0], "force": [1e999, 0]}, "not a finite number"),
        ({"do": ["play"]}, "unknown command"),
    ):
        session.obey("a", command)
        assert words in shown.told["note"], command
    go_on(session, 0.1)  # nothing of it did harm


@pytest.mark.parametrize("seed", range(3))
def test_nothing_that_viewers_do_breaks_it(seed: int) -> None:
    """Commands at random, many of them nonsense: each is carried out or refused in words."""
    random = np.random.default_rng(seed)
    session, shown = watching(walker())
    values = [0, 1, -1, 0.3, 1e9, -1e300, float("inf"), float("nan"), True, None, "", "x", [], {}]

    def some() -> Any:
        return values[random.integers(len(values))]

    def number() -> float:
        return float(random.normal())

    kinds = ["play", "step", "seek", "event", "rate", "hold", "release", "random push", "choose",
             "pose", "reset", "resume", "leave", "nothing"]  # fmt: skip
    for _ in range(150):
        do = str(random.choice(kinds))
        sane: dict[str, Any] = {
            "on": True, "rows": random.choice([-1, 1]), "time": 0.5 * abs(number()),
            "direction": random.choice([-1, 1]), "value": abs(number()), "name": "friction",
            "joint": str(random.choice(walking.bravo7().joint_names)),
            "link": int(random.integers(-1, 10)), "point": [number(), number()],
            "force": [200.0 * number(), 200.0 * number()],
        }  # fmt: skip
        if random.random() < 0.3:
            sane[str(random.choice(list(sane)))] = some()
        session.obey(str(random.choice(["a", "b"])), {"do": do, **sane})
        if random.random() < 0.6:
            session.update(TICK)
        times = session.history.time
        assert (np.diff(times) > 0.0).all()
        assert times[0] - 1e-9 <= session.cursor <= times[-1] + 1e-9
        assert shown.seen is not None
        assert shown.seen[0] == pytest.approx(times[session.history.row_at(session.cursor)])
        assert [frame[0] for frame in shown.course] == sorted(frame[0] for frame in shown.course)


def test_a_fall_ends_it_and_it_can_be_taken_back() -> None:
    session, shown = watching(walker())
    trunk = TRUNK_LINK
    ask(session, "hold", link=trunk, point=[0.0, 0.2], force=[-900.0, -2000.0])
    for _ in range(300):
        session.update(TICK)
        if not session.playing:
            break
    assert shown.told["over"]
    assert "fell" in shown.told["message"]
    assert "fell" in ask(session, "play", on=True)
    assert not session.playing
    ask(session, "release")
    ask(session, "seek", time=0.0)
    ask(session, "resume")
    assert not shown.told["over"]
    assert shown.told["message"] == ""
    go_on(session, 0.2)
    ask(session, "reset")
    assert session.cursor == 0.0


class InPython:
    """A controller that takes no part in snapshots."""

    def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
        return np.zeros(6)


def test_a_controller_without_snapshots_cannot_be_taken_back() -> None:
    session, shown = watching(walker(InPython()))
    go_on(session, 0.05)
    assert not shown.told["returns"]
    ask(session, "seek", time=0.02)
    assert "takes no part in snapshots" in ask(session, "resume")
    assert "takes no part in snapshots" in ask(session, "reset")
    ask(session, "play", on=True)
    go_on(session, 0.1)


class Gives(InPython):
    """A controller that gives up after a while."""

    def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
        if t > 0.03:
            raise ValueError("no torque is left")
        return np.zeros(6)


def test_a_controller_that_fails_ends_it_in_words() -> None:
    session, shown = watching(walker(Gives()))
    for _ in range(10):
        session.update(TICK)
    assert not session.playing
    assert "no torque is left" in shown.told["message"]
    assert session.cursor == pytest.approx(0.03, abs=2e-3)
    ask(session, "seek", time=0.01)  # what has been can be looked at
    assert shown.told["message"] == ""


def test_a_run_is_looked_at() -> None:
    run = walking.walk(steps=2)
    session, shown = watching(run)
    assert not shown.scene["live"]
    assert shown.seen[0] == 0.0
    assert shown.course[-1][0] == run.time[-1]
    go_on(session, 0.3)
    assert "there is nothing to push" in ask(session, "random push")
    assert "there is nothing to push" in ask(session, "hold", link=0, point=[0, 0], force=[0, 0])
    ask(session, "seek", time=float(run.time[-1]))
    ask(session, "play", on=True)  # from the beginning
    session.update(TICK)
    assert session.cursor == pytest.approx(TICK)
    ask(session, "seek", time=1.39)
    ask(session, "play", on=True)
    for _ in range(3):
        session.update(TICK)
    assert session.cursor == run.time[-1]
    assert not session.playing


def test_a_simulation_that_has_been_going_shows_its_past() -> None:
    simulation = walker()
    simulation.advance(0.4)
    session, shown = watching(simulation)
    assert shown.course[0][0] == 0.0
    assert session.cursor == pytest.approx(0.4)
    ask(session, "seek", time=0.2)
    assert "the earliest instant that is kept" in ask(
        session, "resume"
    )  # from before it was watched
    ask(session, "reset")
    assert session.cursor == pytest.approx(0.4)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_mistake_of_ours_is_not_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = Shown()
    session = Session(shown, run=walking.walk(steps=1))
    monkeypatch.setattr(Session, "obey", lambda *_: 1 / 0)
    session.ask("a", {"do": "nothing"})
    session.start()
    session.join(60.0)
    assert "ZeroDivisionError" in shown.told["message"]


class Broken(GivenStage):
    """A stage that cannot make what it is asked for."""

    def simulation(self, values: Any, progress: Any) -> hs.Simulation:
        raise hs.GaitError("there is no such gait; walk slower")


def test_what_cannot_begin_says_why() -> None:
    session, shown = watching(Broken(walker()))
    assert shown.told["note"] == "there is no such gait; walk slower"
    assert "nothing to see yet" in ask(session, "play", on=True)
    session.update(TICK)
    assert not session.playing
    # What acts at once on a walk begins one where there is none.
    assert ask(session, "choose", name="friction", value=0.3).startswith("there is no such gait")


class Slow(Broken):
    """A stage that shows where it would begin before it fails."""

    def outline(self, values: Any) -> tuple[hs.Robot, hs.State, hs.Ground]:
        return walking.bravo7(), walking.gait().initial_state, hs.Ground()


def test_where_it_begins_is_seen_before_there_is_a_simulation() -> None:
    """The robot in its pose, and no forces; once a walk has begun it stays instead."""
    session, shown = watching(Slow(walker()))
    assert session.live is None
    expected = link_poses(walking.bravo7(), walking.gait().initial_state.q)
    pose = shown.field("pose").reshape(-1, 3)
    np.testing.assert_array_equal(pose, np.column_stack((expected.origin, expected.angle)))
    assert not shown.field("force").any()
    walks, shown = watching(walker())
    go_on(walks, 0.1)
    walks._stage = Slow(walker())
    ask(walks, "reset")
    assert len(shown.course) > 1


def test_updates_come_however_many_commands_do(monkeypatch: pytest.MonkeyPatch) -> None:
    session, _ = watching(walking.walk(steps=1))
    clock, obeyed = itertools.count(step=0.01), itertools.count(1)
    monkeypatch.setattr(sessions.clock_time, "perf_counter", lambda: next(clock))

    def obey(*_: Any) -> None:
        assert next(obeyed) < 100, "commands that keep coming leave no time for an update"
        session.ask("a", {"do": "nothing"})

    monkeypatch.setattr(session, "obey", obey)
    session.ask("a", {"do": "nothing"})
    session._obey_until(0.0, wait=False)
    assert next(obeyed) > 1  # and where updates are late, commands are obeyed all the same


def test_commands_that_wait_are_not_without_bounds() -> None:
    session, _ = watching(walking.walk(steps=1))
    for _ in range(2 * sessions.MOST_COMMANDS):
        session.ask("a", {"do": "seek", "time": 0.0})
    assert session._commands.qsize() == sessions.MOST_COMMANDS
    session.ask("a", {"do": "release"})  # or it would pull forever
    assert session._commands.qsize() == sessions.MOST_COMMANDS + 1


def test_a_slider_leaves_the_past_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_simulation, "MOST_SNAPSHOTS", 4)
    session, shown = watching(walker())
    go_on(session, 0.1)
    for friction in np.linspace(0.75, 0.6, 10):
        assert ask(session, "choose", name="friction", value=float(friction)) == ""
    ask(session, "seek", time=0.05)
    assert ask(session, "resume") == ""
    assert session.live is not None
    assert session.live.simulation.ground.friction == 0.75
    assert shown.seen is not None


def test_what_was_set_later_is_not_told_of_earlier_times() -> None:
    session, shown = watching(walker())
    go_on(session, 0.05)
    ask(session, "choose", name="friction", value=0.6)
    go_on(session, 0.1)
    assert shown.told["values"] == {"friction": 0.6}
    ask(session, "seek", time=0.02)
    ask(session, "resume")
    assert shown.told["values"] == {"friction": 0.75}
    ask(session, "choose", name="friction", value=0.6)
    ask(session, "reset")
    assert session.live is not None
    assert session.live.simulation.ground.friction == 0.75
    assert shown.told["values"] == {"friction": 0.75}
