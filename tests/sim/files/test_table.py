"""Runs as tables of text."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
import walking
from synthetic_runs import make_run

import heelstrike as hs
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.files.table import to_csv
from heelstrike.sim.run import Event


def table(text: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows."""
    heading, *rows = csv.reader(io.StringIO(text))
    return heading, rows


def test_a_walk_as_a_table(tmp_path: Path) -> None:
    """Every number of every recorded time, under the name of what it belongs to and its unit."""
    run = walking.walk(steps=1)
    path = run.save(tmp_path / "walk.CSV")
    headings, rows = table(path.read_text("utf-8"))
    assert headings[0] == "time [s]"
    assert headings[-1] == "events"
    assert len(set(headings)) == len(headings)
    numbers = np.array([row[:-1] for row in rows], dtype=float).T
    columns = dict(zip(headings, numbers, strict=False))
    joint = run.robot.joint_index("left_knee")
    heel = run.robot.contact_names.index("left_foot_heel")
    for heading, values in (
        ("time [s]", run.time),
        ("position left_knee [rad]", run.position[:, joint]),
        ("position root_x [m]", run.position[:, 0]),
        ("velocity root_z [m/s]", run.velocity[:, 1]),
        ("torque left_knee [N m]", run.torque[:, run.robot.actuator_index("left_knee")]),
        ("contact_force left_foot_heel normal [N]", run.contact_force[:, heel, 0]),
    ):
        np.testing.assert_array_equal(columns[heading], values, err_msg=heading)
    recorded = [each for each in run.to_dataset().data_vars.values() if each.dims[:1] == ("time",)]
    assert len(headings) == 2 + sum(each[0].size for each in recorded)


def test_events_stand_in_the_row_that_they_come_before() -> None:
    robot = walking.bravo7()
    kinds = (EventKind.TOUCHDOWN, EventKind.JOINT_STOP, EventKind.BRIDGE, EventKind.LIFTOFF)
    times = (0.0, 0.5, 1.0, 2.5)
    events = [Event(time, kind, 1, (0.0, 0.0)) for time, kind in zip(times, kinds, strict=True)]
    headings, rows = table(to_csv(make_run(robot, [0.0, 1.0, 2.0], events=events)))
    contact = robot.contact_names[1]
    assert [row[headings.index("events")] for row in rows] == [
        f"touchdown {contact}",
        f"joint stop {robot.joint_names[1]}; bridge",
        f"liftoff {contact}",
    ]


def test_a_number_that_is_none_is_an_empty_cell() -> None:
    run = make_run(walking.bravo7(), [0.0])
    run.torque[0, 0] = np.nan
    headings, rows = table(to_csv(run))
    name = run.robot.actuator_names[0]
    assert rows[0][headings.index(f"torque {name} [N m]")] == ""


@pytest.mark.parametrize("name", ["walk.xlsx", "walk.mat", "walk", "walk.nc.gz"])
def test_other_endings_are_refused_in_words(name: str, tmp_path: Path) -> None:
    with pytest.raises(hs.RunFileError, match=r"ends in \.nc .*or \.csv"):
        walking.walk(steps=1).save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_table_is_no_run_to_load(tmp_path: Path) -> None:
    path = walking.walk(steps=1).save(tmp_path / "walk.csv")
    with pytest.raises(hs.RunFileError, match=r"is a table.*load the \.nc file"):
        hs.load_run(path)


def test_forces_of_motors_on_slides_are_in_newtons() -> None:
    """In tables, datasets and figures; torques of the others stay torques."""
    for sliding, turning in ((True, True), (True, False), (False, True)):
        build, parent = hs.RobotBuilder("crane"), None
        if sliding:
            parent = build.slide("cart", None, direction=(1, 0), mass=2, inertia=0.1, torque=9.0)
        if turning:
            build.hinge("jib", parent, mass=1, inertia=0.1, center_of_mass=(0, -0.3), torque=9.0)
        robot = build.build()
        run = hs.simulate(robot, state=robot.reference_state(), duration=2e-3)
        headings, _ = table(to_csv(run))
        assert ("torque cart [N]" in headings) is sliding
        assert ("torque jib [N m]" in headings) is turning
        both = sliding and turning
        unit = "N m or N" if both else "N" if sliding else "N m"
        assert run.to_dataset()["torque"].attrs["units"] == unit
        assert run.plot("stop_torque").axes[0].get_ylabel() == unit
