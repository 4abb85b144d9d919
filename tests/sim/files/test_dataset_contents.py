"""What a dataset says of a run, written out: names, dimensions, units, labels, and the numbers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import xarray
from synthetic_runs import make_run

import heelstrike as hs
from heelstrike.sim import Certificates, Event, EventKind, Push, RunStatus, SolverCount, Timing
from heelstrike.sim.compliant.contact_law import HuntCrossley, KelvinVoigt, RegularisedFriction
from heelstrike.sim.files.dataset import to_dataset

# Every variable, with its dimensions, unit and description.
CONTENTS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "time": (("time",), "s", "time"),
    "position": (("time", "coordinate"), "m or rad", "generalised positions"),
    "velocity": (("time", "coordinate"), "m/s or rad/s", "generalised velocities"),
    "torque": (("time", "actuator"), "N m", "joint torques within their limits"),
    "stop_torque": (
        ("time", "coordinate"),
        "N m or N",
        "force of the joint stops on the robot",
    ),
    "friction_torque": (
        ("time", "coordinate"),
        "N m or N",
        "dry friction of the joints on the robot",
    ),
    "contact_point": (("time", "contact", "axis"), "m", "world position of the contact points"),
    "contact_normal": (
        ("time", "contact", "axis"),
        "1",
        "ground normal under the contact points",
    ),
    "gap": (("time", "contact"), "m", "distance of the contact points to the ground"),
    "contact_force": (
        ("time", "contact", "component"),
        "N",
        "force on the robot at the contact points, mean over the step that follows",
    ),
    "slip_velocity": (
        ("time", "contact"),
        "m/s",
        "tangential velocity of the contact points at the end of the step",
    ),
    "residual": (("time", "condition"), "1", "relative residuals of the contact problem"),
    "event_time": (("event",), "s", "time of the event"),
    "event_kind": (("event",), "1", "what happened"),
    "event_contact": (
        ("event",),
        "1",
        "index of the contact point, or of the joint of a joint event",
    ),
    "event_impulse": (
        ("event", "component"),
        "N s",
        "impulse on the robot in the step of the event",
    ),
    "ground_corner": (
        ("corner", "axis"),
        "m",
        "corners of the ground; its end segments go on forever",
    ),
    "ground_friction": (
        ("segment",),
        "1",
        "friction coefficient of the segments of the ground",
    ),
    "ground_restitution": (("segment",), "1", "restitution of the segments of the ground"),
    "push_link": (("push",), "1", "index of the link that was pushed"),
    "push_point": (("push", "axis"), "m", "where it was pushed, in the axes of the link"),
    "push_force": (("push", "axis"), "N", "force of the push on the robot"),
    "push_window": (("push", "window"), "s", "beginning and duration of the push"),
}

# What counts along every dimension that has names.
LABELS = {
    "coordinate": [
        "root_x", "root_z", "root_pitch", "right_hip", "right_knee", "right_ankle", "left_hip",
        "left_knee", "left_ankle",
    ],
    "actuator": [
        "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle",
    ],
    "contact": ["right_foot_heel", "right_foot_toe", "left_foot_heel", "left_foot_toe"],
    "axis": ["x", "z"],
    "component": ["normal", "tangent"],
    "condition": ["complementarity", "cone", "non-penetration"],
    "window": ["start", "duration"],
}  # fmt: skip

EVENT_KINDS = {
    "touchdown": 0, "liftoff": 1, "slip": 2, "stick": 3, "slip_reversal": 4, "impact": 5, "zeno": 6,
    "painleve": 7, "energy_gain": 8, "joint_stop": 9, "joint_slip": 10, "joint_stick": 11,
    "bridge": 12, "wedged": 13, "joint_release": 14,
    "joint_brake": 15, "constraint_holds": 16, "constraint_lets_go": 17, "uncertified": 18,
}  # fmt: skip

ROWS = 3

OF_LOOPS = ("loop_force", "coupling_force", "brake_torque", "constraint_force")
"""Quantities of which most robots have nothing: these are in datasets of robots with loops only."""


def recorded(name: str, *shape: int) -> np.ndarray:
    """Numbers of a record that are like those of no other."""
    size = int(np.prod(shape))
    place = [*CONTENTS, *OF_LOOPS].index(name)
    return 1000.0 * place + np.arange(ROWS * size).reshape(ROWS, *shape)


@pytest.fixture(scope="module")
def run() -> hs.Run:
    robot = hs.load_robot("bravo7")
    ground = hs.Ground(
        profile=[[-1.0, 0.0], [0.5, 0.0], [2.0, 0.3]], friction=[0.4, 0.7], restitution=[0.0, 0.1]
    )
    shapes: dict[str, tuple[int, ...]] = {
        "position": (9,),
        "velocity": (9,),
        "torque": (6,),
        "stop_torque": (9,),
        "friction_torque": (9,),
        "contact_point": (4, 2),
        "contact_normal": (4, 2),
        "gap": (4,),
        "contact_force": (4, 2),
        "slip_velocity": (4,),
        "residual": (3,),
        "loop_force": (0, 2),
        "coupling_force": (0,),
        "brake_torque": (0,),
        "constraint_force": (0, 2),
    }
    plain = make_run(robot, [0.0, 0.25, 0.5])
    rows = {name: recorded(name, *shape) for name, shape in shapes.items()}
    return hs.Run(
        robot=robot,
        ground=ground,
        method=hs.TimeStepping(step=0.25, solver="gauss_seidel", activation=1e-4),
        status=RunStatus.FELL,
        message="the robot fell",
        time=plain.time,
        **rows,
        events=(
            Event(0.25, EventKind.TOUCHDOWN, 2, (3.0, -0.5)),
            Event(0.5, EventKind.JOINT_STOP, 7, (1.5, 0.0)),
        ),
        certificates=Certificates(1e-3, 2e-12, 3e-12, 4e-12, 0.5),
        solver=SolverCount("gauss_seidel", 10, 7, 2, 1, 6, 3),
        steps=2,
        saturations=5,
        timing=Timing(0.5, 0.125),
        pushes=(Push("trunk", force=(60.0, -2.0), start=0.1, duration=0.2, point=(0.01, 0.3)),),
    )


@pytest.fixture(scope="module")
def data(run: hs.Run) -> xarray.Dataset:
    return to_dataset(run)


def test_every_variable_and_no_other(data: xarray.Dataset) -> None:
    assert set(data.variables) == CONTENTS.keys() | LABELS.keys()
    assert set(data.data_vars) == CONTENTS.keys() - {"time"}


@pytest.mark.parametrize("name", CONTENTS)
def test_dimensions_unit_and_description(data: xarray.Dataset, name: str) -> None:
    variable = data[name]
    found = (variable.dims, variable.attrs["units"], variable.attrs["long_name"])
    assert found == CONTENTS[name]


@pytest.mark.parametrize("name", LABELS)
def test_names_along_the_dimensions(data: xarray.Dataset, name: str) -> None:
    assert data[name].values.tolist() == LABELS[name]


def test_rows_are_the_records(data: xarray.Dataset, run: hs.Run) -> None:
    assert data["time"].values.tolist() == [0.0, 0.25, 0.5]
    for name in CONTENTS:
        if name != "time" and name.split("_")[0] not in ("event", "ground", "push"):
            np.testing.assert_array_equal(data[name], recorded(name, *data[name].shape[1:]))
            np.testing.assert_array_equal(data[name], getattr(run, name))


def test_events_ground_and_pushes_are_as_told(data: xarray.Dataset) -> None:
    expected = {
        "event_time": [0.25, 0.5],
        "event_kind": [0, 9],
        "event_contact": [2, 7],
        "event_impulse": [[3.0, -0.5], [1.5, 0.0]],
        "ground_corner": [[-1.0, 0.0], [0.5, 0.0], [2.0, 0.3]],
        "ground_friction": [0.4, 0.7],
        "ground_restitution": [0.0, 0.1],
        "push_link": [2],  # the trunk's last joint carries it
        "push_point": [[0.01, 0.3]],
        "push_force": [[60.0, -2.0]],
        "push_window": [[0.1, 0.2]],
    }
    for name, values in expected.items():
        assert data[name].values.tolist() == values, name
    kinds = data["event_kind"].attrs
    found = zip(kinds["flag_meanings"].split(), kinds["flag_values"].tolist(), strict=True)
    assert dict(found) == EVENT_KINDS


def test_attributes(data: xarray.Dataset) -> None:
    expected = {
        "heelstrike_format": 1,
        "title": "heelstrike run of bravo7",
        "robot": "bravo7",
        "status": "fell",
        "message": "the robot fell",
        "method": "TimeStepping",
        "method_step": 0.25,
        "method_scheme": "impact_resolved",
        "method_solver": "gauss_seidel",
        "method_activation": 1e-4,
        "method_bounded_restitution": 0,
        "impulses_in_events": 0,
        "ground_slope": 0.0,
        "ground_has_profile": 1,
        "worst_penetration": 1e-3,
        "worst_complementarity": 2e-12,
        "worst_cone": 3e-12,
        "worst_non_penetration": 4e-12,
        "worst_energy_gain": 0.5,
        "solver_name": "gauss_seidel",
        "solver_solves": 10,
        "solver_shortcuts": 7,
        "solver_fallbacks": 2,
        "solver_failures": 1,
        "solver_combinations": 6,
        "solver_relaxed": 3,
        "steps": 2,
        "saturations": 5,
        "compile_s": 0.5,
        "wall_s": 0.125,
        "error": "",
    }
    versions = {f"{name}_version" for name in ("heelstrike", "numpy", "numba")}
    assert {k: v for k, v in data.attrs.items() if k not in versions} == expected
    assert all(data.attrs[name] for name in versions)
    assert data.attrs["numpy_version"] == np.__version__


def test_push_without_a_point_acts_at_the_centre_of_mass(run: hs.Run) -> None:
    push = Push("trunk", force=(1.0, 0.0), start=0.0, duration=0.1)
    data = to_dataset(dataclasses.replace(run, pushes=(push,)))
    np.testing.assert_allclose(data["push_point"], [[0.0, 0.3155]])


def test_slope_of_the_ground() -> None:
    run = make_run(hs.load_robot("bravo7"), [0.0], ground=hs.Ground(slope=0.05, friction=0.3))
    data = to_dataset(run)
    assert data.attrs["ground_slope"] == 0.05
    assert data.attrs["ground_has_profile"] == 0
    (x0, z0), (x1, z1) = data["ground_corner"].values
    assert (z1 - z0) / (x1 - x0) == pytest.approx(np.tan(0.05))


def test_laws_of_compliant_ground_are_told_number_by_number() -> None:
    method = hs.Compliant(
        law=KelvinVoigt(stiffness=4e5, damping=3e2),
        friction=RegularisedFriction(speed=2e-3),
        stop=HuntCrossley(stiffness=5e4, dissipation=0.25, exponent=1.5),
        step=2e-3,
        rtol=1e-4,
        atol=1e-6,
    )
    run = dataclasses.replace(make_run(hs.load_robot("bravo7"), [0.0]), method=method)
    told = to_dataset(run).attrs
    expected = {
        "method": "Compliant",
        "method_law": "KelvinVoigt",
        "method_law_stiffness": 4e5,
        "method_law_damping": 3e2,
        "method_friction": "RegularisedFriction",
        "method_friction_speed": 2e-3,
        "method_stop": "HuntCrossley",
        "method_stop_stiffness": 5e4,
        "method_stop_dissipation": 0.25,
        "method_stop_exponent": 1.5,
        "method_step": 2e-3,
        "method_rtol": 1e-4,
        "method_atol": 1e-6,
    }
    assert {name: told[name] for name in told if name.startswith("method")} == expected
