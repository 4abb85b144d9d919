"""What viewers of a robot in space see and ask for, without a server or a clock."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_humanoid import Shown, ask, go_on, humanoid, standing

import heelstrike as hs
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
from heelstrike.cli.options import METHODS_IN_SPACE, method_called
from heelstrike.dynamics import spatial
from heelstrike.errors import ControllerError
from heelstrike.experiments.space import spatial_law_called
from heelstrike.experiments.watching_in_space import FirstInSpace, SpaceStage
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.live.session import Session
from heelstrike.view.live.stage import GivenStage, Stage
from heelstrike.view.spatial.live import LIVE_SPACE


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    return humanoid(tmp_path_factory.mktemp("robot"))


def watching(what: Any) -> tuple[Session, Shown]:
    shown = Shown()
    if isinstance(what, Stage):
        session = Session(shown, stage=what)
    elif isinstance(what, SpatialRun):
        session = Session(shown, run=what)
    else:
        session = Session(shown, stage=GivenStage(what))
    session.begin()
    return session, shown


def test_what_is_shown_is_what_was_simulated(robot: hs.SpatialRobot) -> None:
    session, shown = watching(standing(robot))
    assert shown.told["light"]["level"] == "good"
    assert session.cursor == 0.0
    go_on(session, 0.3)
    whole = hs.simulate(
        robot, hs.HoldPosture(robot, kp=300.0, kd=8.0), state=robot.reference_state(), duration=0.4
    )
    row = session.history.row_at(session.cursor)
    np.testing.assert_array_equal(shown.field("position"), whole.position[row])
    np.testing.assert_array_equal(shown.field("torque"), whole.torque[row])
    center = spatial.center_of_mass(robot, whole.position[row])
    np.testing.assert_allclose(shown.field("center"), center, atol=1e-12)
    force = shown.field("force").reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(force, [0.0, 0.0, robot.weight], atol=0.02 * robot.weight)
    assert shown.field("pressing").sum() == pytest.approx(force[2])
    margin = spatial_zero_moment_point(whole, np.array([row])).margin
    np.testing.assert_allclose(shown.field("margin"), margin, atol=1e-9)
    assert margin[0] > 0.05
    assert [joint["label"] for joint in shown.layout["joints"]][:2] == ["neck", "left hip"]
    groups = {panel["group"] for panel in shown.layout["panels"]}
    assert groups == {"joints", "torques", "feet", "energy"}


def test_it_is_pushed_in_space_and_taken_back(robot: hs.SpatialRobot) -> None:
    """What was simulated again is the same bit by bit; a push of the plane is refused in words."""
    session, shown = watching(standing(robot, stop_when_fallen=False))
    go_on(session, 0.2)
    head = robot.link_names.index("head")
    held = {"link": head, "point": [0.0, 0.0, 0.1], "force": [0.0, 60.0, 0.0]}
    assert ask(session, "hold", **held) == ""
    go_on(session, 0.25)
    assert shown.field("speed")[1] > 0.01  # to the left
    go_on(session, 0.4)
    ask(session, "release")
    go_on(session, 0.5)
    assert session.live is not None
    first, there = session.live.time, session.live.simulation.state
    ask(session, "seek", time=0.3)
    drawn = shown.field("push").reshape(-1, 6)
    np.testing.assert_allclose(drawn[0, 3:], [0.0, 60.0, 0.0])
    ask(session, "seek", time=0.45)
    ask(session, "resume")
    session.live.simulation.advance(first)
    np.testing.assert_array_equal(session.live.simulation.state.q, there.q)
    assert "three numbers" in ask(session, "hold", **(held | {"force": [1.0, 0.0]}))
    assert " N on " in ask(session, "random push")


def test_joints_are_moved_and_the_robot_stands_again(robot: hs.SpatialRobot) -> None:
    session, shown = watching(standing(robot))
    go_on(session, 0.1)
    assert session.live is not None
    before = session.live.time
    for angle in (0.2, 0.3, 0.4):
        assert ask(session, "pose", joint="left_ankle_joint", value=angle) == ""
    assert session.live.time == before  # a slider does not move time
    state = session.live.simulation.state
    assert robot.positions(state)["left_ankle_joint"] == 0.4
    assert float(session.live.simulation.contacts.gap.min()) == pytest.approx(0.0, abs=1e-9)
    at = shown.layout["joints"][2]["at"]
    assert shown.seen[at] == 0.4
    assert "no joint" in ask(session, "pose", joint="tail", value=0.0)
    assert "no slider" in ask(session, "pose", joint="root", value=0.0)


def test_a_joint_is_moved_on_a_box_as_on_the_ground(robot: hs.SpatialRobot) -> None:
    """The plane is 0.2 m below: the robot stays on its box, and stands in nothing."""
    box = hs.Box(center=(0.0, 0.0, 0.1), size=(2.0, 2.0, 0.2))
    start = robot.reference_state()
    start.q[2] += 0.2
    simulation = hs.Simulation(
        robot, hs.HoldPosture(robot, kp=300.0, kd=8.0), state=start,
        ground=hs.SpatialGround(boxes=(box,)),
    )  # fmt: skip
    simulation.advance(0.01)
    before = simulation.state.q[2]
    for angle in (0.2, -0.2):
        state = LIVE_SPACE.moved(simulation, "left_ankle_joint", angle)
        simulation.state = state
        assert float(simulation.contacts.gap.min()) == pytest.approx(0.0, abs=1e-9)
        assert 0.0 < state.q[2] - before < 0.1


def test_friction_acts_at_once_and_events_are_told(robot: hs.SpatialRobot) -> None:
    session, shown = watching(standing(robot))
    go_on(session, 0.05)
    assert ask(session, "choose", name="friction", value=0.0) == ""
    assert session.live is not None
    assert session.live.simulation.ground.friction == 0.0
    go_on(session, 0.3)
    told = {SpatialEventKind(int(kind)) for _, kind, _ in shown._events}
    assert SpatialEventKind.SLIP in told
    ask(session, "play", on=False)
    note = ask(session, "event", direction=-1, kinds=["slip"])
    assert "slip (" in note
    assert "foot" in note
    ask(session, "reset")
    assert session.cursor == 0.0


def test_a_run_is_watched(robot: hs.SpatialRobot) -> None:
    run = hs.simulate(
        robot, state=robot.reference_state(), duration=0.2, stop_when_fallen=False,
        pushes=hs.Push("trunk", force=(0.0, 0.0, -50.0), start=0.1, duration=0.05),
    )  # fmt: skip
    session, shown = watching(run)
    ask(session, "seek", time=0.12)
    np.testing.assert_array_equal(
        shown.field("position"), run.position[session.history.row_at(0.12)]
    )
    assert shown.field("push")[5] == -50.0
    assert "is over" in ask(session, "random push")


def test_every_choice_can_be_had(robot: hs.SpatialRobot, tmp_path: Path) -> None:
    law = tmp_path / "mine.py"
    law.write_text(
        "import numpy as np\nclass Mine:\n    def __init__(self, robot): self.nu = robot.nu\n"
        "    def torque(self, t, state, contacts): return np.full(self.nu, 0.5)\n"
    )
    own = spatial_law_called(f"{law}:Mine")
    first = FirstInSpace(method="time-stepping", laws=[own], friction=0.6, slope=3.0)
    stage = SpaceStage({"small.xml": robot}, method_called, METHODS_IN_SPACE, first)
    values = stage.fitted({})
    for control in stage.controls(values):
        assert control.accepts(control.value), control
        for value in control.options or (control.low, control.high):
            assert control.accepts(value), control
    assert values["controller"] == own.name
    assert (values["friction"], values["slope"]) == (0.6, 3.0)
    simulation = stage.simulation(values | {"above": 0.2}, lambda words: None)
    assert float(simulation.contacts.gap.min()) == pytest.approx(0.2 * np.cos(np.deg2rad(3.0)))
    simulation.step()
    np.testing.assert_array_equal(simulation.record.torque[0], 0.5)
    held = stage.simulation(values | {"controller": "HoldPosture"}, lambda words: None)
    assert isinstance(held.controller, hs.HoldPosture)
    session, shown = watching(stage)
    assert "cannot be" in ask(session, "choose", name="controller", value="nobody's")
    assert ask(session, "choose", name="controller", value="no torque") == ""
    go_on(session, 0.1)
    assert np.all(shown.field("torque") == 0.0)


@pytest.mark.parametrize(
    ("words", "told"),
    [("hold-postur", "HoldPosture"), ("ComputedTorque", "There is HoldPosture")],
)
def test_unknown_laws_are_refused(words: str, told: str) -> None:
    with pytest.raises(ControllerError, match=told):
        spatial_law_called(words)


def test_a_law_of_the_plane_is_told_what_it_is_called_with(
    robot: hs.SpatialRobot, tmp_path: Path
) -> None:
    law = tmp_path / "planar.py"
    law.write_text("def make(robot, gait):\n    raise AssertionError\n")
    first = FirstInSpace(method="time-stepping", laws=[spatial_law_called(f"{law}:make")])
    with pytest.raises(ControllerError, match="is called with a robot, which it does not take"):
        SpaceStage({"small.xml": robot}, method_called, METHODS_IN_SPACE, first)


def test_what_a_robot_cannot_do_is_not_offered(robot: hs.SpatialRobot, tmp_path: Path) -> None:
    """Hold a posture without motors, be dropped without floating."""
    path = tmp_path / "swing.xml"
    path.write_text(
        '<mujoco model="swing"><worldbody><body name="arm" pos="0 0 1"><joint name="pivot" '
        'axis="0 1 0"/><geom type="sphere" size="0.05" pos="0.1 0 -0.3" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    swing = hs.load_robot(path, dimension=3)
    first = FirstInSpace(method="time-stepping", laws=[spatial_law_called("HoldPosture")])
    with pytest.raises(ControllerError, match="has none"):
        SpaceStage({"swing": swing}, method_called, METHODS_IN_SPACE, first)
    stage = SpaceStage({"small": robot, "swing": swing}, method_called, METHODS_IN_SPACE, first)
    assert "above" in stage.fitted({})
    values = stage.fitted({"robot": "swing"})
    assert "above" not in values
    offered = {control.name: control for control in stage.controls(values)}
    assert offered["controller"].options == ("no torque",)
    assert stage.simulation(values, lambda words: None).robot is swing


def test_the_friction_shown_is_that_of_the_ground_and_not_of_a_box(robot: hs.SpatialRobot) -> None:
    box = hs.Box(center=(3.0, 0.0, 0.1), size=(1.0, 1.0, 0.2), friction=0.1)
    ground = hs.SpatialGround(friction=0.8, boxes=(box,))
    (control,) = GivenStage(standing(robot, ground=ground)).controls({})
    assert control.value == 0.8
    assert "but for boxes" in control.label
    (control,) = GivenStage(standing(robot)).controls({})
    assert control.label == "friction μ"
