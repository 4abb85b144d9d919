"""What a viewer gets of an instant."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.analysis import friction_use, zero_moment_point
from heelstrike.analysis.intervals import event_impulse
from heelstrike.dynamics import center_of_mass, link_poses
from heelstrike.robot import read_mjcf
from heelstrike.view.live.frames import MOST_PUSHES, Layout, mean_forces


def field(layout: Layout, frames: np.ndarray, name: str) -> np.ndarray:
    begin = layout.begin[name]
    return frames[:, begin : begin + layout.widths[name]]


def test_a_frame_holds_the_row() -> None:
    run = walking.walk(steps=2)
    layout = Layout(run.robot)
    rows = [299, 300, 301]
    frames = layout.frames(run, rows, ())
    assert frames.shape == (2, layout.width)
    assert field(layout, frames, "time").ravel().tolist() == run.time[300:302].tolist()
    poses = link_poses(run.robot, run.position[300])
    pose = field(layout, frames, "pose")[0].reshape(-1, 3)
    np.testing.assert_allclose(pose[:, :2], poses.origin, atol=1e-12)
    np.testing.assert_allclose(pose[:, 2], poses.angle, atol=1e-12)
    center = center_of_mass(run.robot, run.position[300])
    np.testing.assert_allclose(field(layout, frames, "center")[0], center, atol=1e-12)
    # Its forces are those of the step that led there.
    before = zero_moment_point(run).total[299]
    np.testing.assert_allclose(field(layout, frames, "pressure")[0], before, atol=1e-4)
    joints = run.robot.model.actuator_joint
    assert np.array_equal(field(layout, frames, "joint")[0], run.position[300, joints])
    assert np.array_equal(field(layout, frames, "torque")[0], run.torque[300])
    np.testing.assert_allclose(
        field(layout, frames, "used")[0], friction_use(run).foot[299], rtol=1e-9
    )
    energy = field(layout, frames, "energy")
    np.testing.assert_allclose(energy[:, 0] + energy[:, 1], energy[:, 2])
    assert np.isnan(field(layout, frames, "push")).all()


def test_feet_on_one_side_are_told_apart() -> None:
    """Both feet of the left of a robot of four are not "left"."""
    robot = hs.load_robot("bravo7")
    names = ("rear_left_foot", "front_left_foot")
    feet = tuple(dataclasses.replace(f, name=n) for f, n in zip(robot.feet, names, strict=True))
    four = SimpleNamespace(feet=feet)
    layout = Layout(robot)
    plain = [trace.label for trace in layout.of_feet("used", "", "1").traces]
    assert plain == ["right", "left"]
    layout.robot = four
    assert [t.label for t in layout.of_feet("used", "", "1").traces] == ["rear left", "front left"]


def test_an_impact_between_two_frames_is_seen_with_its_impulse() -> None:
    run = walking.walk(steps=2)  # a foot lands in the step before 0.7 s
    rows = np.array([690, 706])
    mean = mean_forces(run, rows)
    held = np.diff(run.time)[690:706]
    impulse = (run.contact_force[690:706] * held[:, None, None]).sum(axis=0)
    np.testing.assert_allclose(mean[0] * held.sum(), impulse, rtol=1e-9, atol=1e-12)
    assert mean[0, :, 0].sum() > 1.2 * run.robot.weight


def test_impulses_that_only_events_know_are_in_the_forces() -> None:
    run = hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=0.75,
        method=hs.EventDriven(),
    )
    jumps = event_impulse(run)
    row = int(np.flatnonzero(jumps.any(axis=(1, 2)))[0])
    jump = jumps[row]
    around = np.array([row - 5, row + 6])
    without = dataclasses.replace(run, events=())
    elapsed = run.time[around[1]] - run.time[around[0]]
    more = (mean_forces(run, around) - mean_forces(without, around))[0] * elapsed
    assert more[:, 0].sum() == pytest.approx(jump[:, 1].sum())  # on level ground
    assert more[:, 1].sum() == pytest.approx(jump[:, 0].sum())
    assert more[:, 0].sum() > 1.0


def test_pushes_are_drawn_where_they_act_and_no_longer() -> None:
    run = walking.walk(steps=1)
    layout = Layout(run.robot)
    trunk, _ = hs.Push("trunk", force=(1.0, 0.0), start=0.0, duration=0.0).place(run.robot)
    push = hs.Push(trunk, force=(50.0, -3.0), start=0.2, duration=0.1, point=(0.0, 0.1))
    rows = [198, 200, 201, 300, 301]
    drawn = field(layout, layout.frames(run, rows, [push]), "push").reshape(4, MOST_PUSHES, 4)
    assert np.isfinite(drawn[:, 0, 0]).tolist() == [False, True, True, False]
    assert np.isnan(drawn[:, 1:]).all()
    assert drawn[1, 0, 2:].tolist() == [50.0, -3.0]
    poses = link_poses(run.robot, run.position[201])
    angle = poses.angle[trunk]
    place = poses.origin[trunk] + 0.1 * np.array([np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(drawn[1, 0, :2], place, atol=1e-12)
    # As many as there is room for.
    many = [push] * (MOST_PUSHES + 3)
    drawn = field(layout, layout.frames(run, [200, 250], many), "push")
    assert np.isfinite(drawn).all()


@pytest.mark.parametrize("name", hs.builtin_robots())
def test_every_curve_is_in_the_frame(name: str) -> None:
    layout = Layout(hs.load_robot(name))
    described = layout.described()
    used = [curve["at"] for panel in described["panels"] for curve in panel["curves"]]
    assert len(used) == len(set(used))
    assert all(0 < place < described["width"] for place in used)
    limits = [panel["limits"] for panel in described["panels"] if panel["group"] == "torques"]
    assert all(limits) == bool(np.isfinite(layout.robot.model.torque_lower).all())
    assert sum(width for _, width in described["fields"].values()) == described["width"]


def test_motors_of_slides_give_forces() -> None:
    robot = read_mjcf(
        """<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
        <body name="cart"><joint name="along" type="slide" axis="1 0 0"/>
        <geom type="sphere" size="0.1" mass="1"/></body></worldbody>
        <actuator><motor name="along" joint="along"/></actuator></mujoco>""",
        name="cart",
    )
    (panel,) = (each for each in Layout(robot).described()["panels"] if each["group"] == "torques")
    assert (panel["title"], panel["unit"]) == ("along force", "N")
