"""What viewers of a walk can choose, and the walks made of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.cli.options import METHODS, method_called
from heelstrike.experiments.laws import law_called
from heelstrike.experiments.watching import (
    DESIGNED,
    NOTHING,
    First,
    WalkStage,
)


def stage(robot: str = "bravo7", **options: Any) -> WalkStage:
    return WalkStage(robot, method_called, METHODS, First(**options))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gait") / "mine.json"
    walking.gait().save(path)
    return path


def begun(walks: WalkStage, **chosen: Any) -> hs.Simulation:
    values = walks.fitted(walks.fitted({}) | chosen)
    assert values.items() >= chosen.items()
    return walks.simulation(values, lambda _: None)


@pytest.mark.parametrize("name", hs.builtin_robots())
def test_every_robot_has_values_that_it_accepts(name: str) -> None:
    walks = stage(name)
    controls = walks.controls(walks.fitted({}))
    for control in controls:
        assert control.accepts(control.value), control
        for value in control.options or (control.low, control.high):
            assert control.accepts(value), control
        assert not control.accepts("nothing of the kind")
        assert not control.accepts(None)
    names = {control.name for control in controls}
    moved = {"controller", "speed"} if walks._robot(name).nu else set()
    if moved:  # each law that is offered has controls that go with it
        (laws,) = (control.options for control in controls if control.name == "controller")
        for law in laws:
            assert walks.fitted({"controller": law})["controller"] == law
    assert names == {"robot", "gait", "friction", "slope", "roughness", "method", "step"} | moved


def test_another_robot_brings_its_own_values() -> None:
    walks = stage()
    (robot,) = (control for control in walks.controls({}) if control.name == "robot")
    values = walks.fitted({}) | {"speed": 0.6, "friction": 0.5}
    kept = {name: value for name, value in values.items() if name not in robot.resets}
    other = walks.fitted(kept | {"robot": "compass_gait"})
    assert other["friction"] == 0.5
    assert other["slope"] == -3.0
    assert other["method"] == "event-driven"
    assert "speed" not in other


def test_a_walk_of_some_choices(saved: Path) -> None:
    walks = stage(gait=saved, friction=0.7, slope=1.0, seed=3)
    simulation = begun(walks)
    assert simulation.robot.name == "bravo7"
    assert isinstance(simulation.controller, hs.FootstepFeedback)
    assert simulation.ground.slope == pytest.approx(np.deg2rad(1.0))
    assert simulation.ground.friction == 0.7
    assert simulation.method == hs.TimeStepping(step=1e-3)
    # The robot stands on its slope.
    assert abs(simulation.contacts.gap).min() < 1e-6
    simulation = begun(walks, method="event-driven", step="2 ms", controller=NOTHING)
    assert simulation.method == hs.EventDriven()
    assert simulation.controller is None
    simulation = begun(walks, step="0.5 ms", controller="ComputedTorqueByEncoders")
    assert simulation.method == hs.TimeStepping(step=5e-4)
    assert simulation.controller.parameters.encoder_period > 0.0
    assert simulation.advance(0.1) is hs.sim.RunStatus.COMPLETED


def test_rough_ground_on_a_slope(saved: Path) -> None:
    walks = stage(gait=saved, seed=3)
    ground = begun(walks, roughness=0.01, slope=-2.0).ground
    x = np.linspace(0.5, 20.0, 400)
    off = ground.height(x) - np.tan(np.deg2rad(-2.0)) * x
    assert 0.005 < np.abs(off).max() <= 0.01
    np.testing.assert_allclose(ground.height(0.2), np.tan(np.deg2rad(-2.0)) * 0.2)
    again = begun(stage(gait=saved, seed=3), roughness=0.01, slope=-2.0).ground
    assert np.array_equal(again.height(x), ground.height(x))
    other = begun(stage(gait=saved, seed=4), roughness=0.01, slope=-2.0).ground
    assert not np.array_equal(other.height(x), ground.height(x))


def test_a_gait_is_designed_for_the_speed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from heelstrike.experiments import watching

    asked: list[Any] = []

    def design(robot: hs.Robot, size: Any, *, friction: float, progress: Any) -> hs.Gait:
        asked.append((size.length / size.duration, friction))
        progress(0.5)
        return walking.gait()

    monkeypatch.setattr(watching, "design", design)
    walks, told = stage(friction=0.6), []
    values = walks.fitted({}) | {"speed": 0.5}
    for friction in (0.6, 0.3):  # what the slider says later is no matter to the gait
        walks.simulation(values | {"friction": friction}, told.append)
    assert asked == [(pytest.approx(0.5), 0.6)]
    assert told[-1].endswith("50 %")
    walks.simulation(values | {"speed": 0.4}, told.append)
    assert len(asked) == 2


def test_a_saved_gait_is_offered_for_its_robot_only(saved: Path) -> None:
    walks = stage(gait=saved)
    assert walks.fitted({})["gait"] == "mine.json"
    assert "speed" not in walks.fitted({})  # it has its own
    assert "speed" in walks.fitted({"gait": DESIGNED})
    assert walks.fitted({"robot": "geyer7"})["gait"] == DESIGNED
    with pytest.raises(hs.GaitError):
        stage("geyer7", gait=saved)


def test_the_law_at_first_steps_where_balance_needs_it_or_is_the_one_asked_for(saved: Path) -> None:
    assert stage().fitted({})["controller"] == "FootstepFeedback"
    assert stage("rabbit").fitted({})["controller"] == "ComputedTorque"
    asked = stage(gait=saved, laws=[law_called("JointPD"), law_called("WholeBody")])
    controls = {control.name: control for control in asked.controls(asked.fitted({}))}
    assert controls["controller"].options[:2] == ("JointPD", "WholeBody")
    assert isinstance(begun(asked).controller, hs.JointPD)
    # Of another robot, which cannot have them, the usual one.
    assert asked.fitted({"robot": "rabbit"})["controller"] == "ComputedTorque"
    with pytest.raises(hs.ControllerError, match="WholeBody cannot drive robot 'rabbit'"):
        stage("rabbit", laws=[law_called("WholeBody")])


def test_a_law_that_stands_needs_no_gait() -> None:
    walks = stage()
    values = walks.fitted({"controller": "StandingLQR"})
    assert not {"gait", "speed"} & values.keys()
    simulation = walks.simulation(values, lambda _: None)
    assert isinstance(simulation.controller, hs.StandingLQR)


def test_own_robots_and_gaits_are_in_the_lists(saved: Path, tmp_path: Path) -> None:
    file, other = tmp_path / "robot.xml", tmp_path / "other.json"
    walking.bravo7().save(file)
    walking.gait().save(other)
    walks = WalkStage([file, "rabbit"], method_called, METHODS, First(gait=[saved, other]))
    controls = {control.name: control for control in walks.controls(walks.fitted({}))}
    assert controls["robot"].options[:2] == (str(file), "rabbit")
    assert controls["gait"].options == ("mine.json", "other.json", DESIGNED)
    assert "mine.json" not in walks.fitted({"robot": "rabbit"})["gait"]
    assert begun(walks, gait="other.json").robot.nu == 6


def test_the_outline_is_where_the_walk_begins(saved: Path) -> None:
    """With a gait that is known; otherwise the robot stands, on a slope too."""
    walks = stage(gait=saved)
    robot, state, _ = walks.outline(walks.fitted({}))
    np.testing.assert_array_equal(state.q, walking.gait().initial_state.q)
    walks = stage(slope=2.0)
    robot, state, ground = walks.outline(walks.fitted({}))
    assert abs(hs.contact_kinematics(robot, state.q, state.v, ground).gap).max() < 1e-6
    walks = stage("rimless_wheel")  # what cannot stand is shown all the same
    assert walks.outline(walks.fitted({}))[0].name == "rimless_wheel"
