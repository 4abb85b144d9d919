"""Runs as labelled datasets and files."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import pytest
import walking
import xarray
from robot_cases import walker2d_xml
from synthetic_runs import box, make_run, pendulum

import heelstrike as hs
from heelstrike.compiler.bundle import Bundle
from heelstrike.robot import Robot, read_mjcf
from heelstrike.sim import Event, EventKind, RunStatus, Scheme, SolverCount
from heelstrike.sim.files.dataset import to_dataset
from heelstrike.sim.files.run_file import load_run, save


def same(a: Any, b: Any) -> bool:
    """Whether two records hold exactly the same."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, hs.Ground):
        return same(a.model(), b.model())
    if isinstance(a, Bundle):
        mine, its = a.members(), b.members()
        return mine.keys() == its.keys() and all(same(mine[name], its[name]) for name in mine)
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in dataclasses.fields(a)
        )
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)


def _fall() -> hs.Run:
    flamingo = hs.load_robot("spring_flamingo")
    return hs.simulate(
        flamingo,
        state=hs.State(flamingo.model.reference, np.full(flamingo.nv, 0.3)),
        duration=2.0,
        method=hs.TimeStepping(step=2e-3, scheme=Scheme.PAPER_SYMPLECTIC),
        ground=hs.Ground(friction=0.4, slope=0.05),
        record_every=7,
    )


def _walker() -> hs.Run:
    robot = read_mjcf(walker2d_xml(), name="walker2d")
    return hs.simulate(robot, state=robot.reference_state(), duration=0.05)


def _stairs() -> hs.Run:
    ground = hs.Ground.stairs(rise=0.1, tread=0.3, count=2, friction=0.6)
    return hs.simulate(box(), state=box().reference_state(), duration=0.05, ground=ground)


RUNS = {
    "walk": lambda: walking.walk(steps=2),
    "fall on a slope": _fall,
    "rounded feet, damped joints": _walker,
    "no contacts, no feet": lambda: hs.simulate(
        pendulum(0.1), state=hs.State([1.0], [0.0]), duration=0.1
    ),
    "no actuators, stairs": _stairs,
    "nothing": lambda: make_run(walking.bravo7(), np.zeros(0), status=RunStatus.CONTROLLER_FAILED),
}


@pytest.fixture(params=list(RUNS))
def run(request: pytest.FixtureRequest) -> hs.Run:
    return RUNS[request.param]()


def test_round_trip_is_exact(run: hs.Run, tmp_path: Path) -> None:
    path = save(run, tmp_path / "run.nc")
    again = load_run(path)
    for field in dataclasses.fields(hs.Run):
        if field.name == "final":  # what goes on from it is a file of its own
            continue
        assert same(getattr(run, field.name), getattr(again, field.name)), field.name


def test_run_goes_on_from_its_file(tmp_path: Path) -> None:
    """The robot in the file is the same robot: simulating on from its last state says so."""
    run = walking.walk(steps=1)
    again = load_run(run.save(tmp_path / "run.nc"))
    first, second = (hs.simulate(r.robot, state=r.final_state, duration=0.05) for r in (run, again))
    np.testing.assert_array_equal(first.position, second.position)


def test_labels_and_units() -> None:
    run = walking.walk(steps=1)
    data = to_dataset(run)
    for name, variable in data.data_vars.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    knee = data["position"].sel(coordinate="right_knee")
    np.testing.assert_array_equal(knee, run.position[:, 4])
    push = data["contact_force"].sel(contact="left_foot_toe", component="normal", time=0.3)
    assert push == run.contact_force[np.flatnonzero(run.time == 0.3)[0], 3, 0]
    assert data.attrs["status"] == "completed"
    assert data.attrs["robot"] == "bravo7"
    assert data.attrs["method_scheme"] == "impact_resolved"
    assert data.attrs["heelstrike_version"] == hs.__version__
    assert data["event_time"].size == len(run.events)


def test_other_tools_read_the_file(tmp_path: Path) -> None:
    run = walking.walk(steps=1)
    path = run.save(tmp_path / "run.nc")
    with xarray.open_dataset(path) as data:
        np.testing.assert_array_equal(data["gap"], run.gap)
        assert list(data["contact"].values) == list(run.robot.contact_names)


def test_exception_of_a_controller_remains_as_text(tmp_path: Path) -> None:
    class Broken:
        def torque(self, t: float, state: object, contacts: object) -> np.ndarray:
            raise ZeroDivisionError("no such thing")

    robot = walking.bravo7()
    run = hs.simulate(robot, Broken(), state=robot.reference_state(), duration=0.1)
    again = load_run(run.save(tmp_path / "run.nc"))
    assert again.error is None
    assert "no such thing" in again.message
    assert "ZeroDivisionError" in to_dataset(run).attrs["error"]


def test_robot_may_be_given(tmp_path: Path) -> None:
    path = walking.walk(steps=1).save(tmp_path / "run.nc")
    robot = hs.load_robot("bravo7")
    assert load_run(path, robot=robot).robot is robot
    with pytest.raises(hs.RunFileError, match="of another robot than 'pendulum'"):
        load_run(path, robot=pendulum())


# What is no run


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file with a run in it."""
    robot = walking.bravo7()
    state = robot.reference_state()
    state.q[1] += 2e-3  # it lands, so that there are events
    run = hs.simulate(robot, state=state, duration=0.05)
    return save(run, tmp_path_factory.mktemp("good") / "run.nc")


@pytest.fixture(scope="module")
def whole(good: Path) -> bytes:
    return good.read_bytes()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"not a run",
        json.dumps({"status": "completed"}).encode(),
        b"\x89HDF\r\n\x1a\n" + bytes(100),
        b"CDF\x01" + bytes(100),
        bytes(range(256)) * 64,
    ],
    ids=["empty", "text", "JSON", "HDF5 in name only", "old NetCDF in name only", "noise"],
)
def test_foreign_files(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "foreign.nc"
    path.write_bytes(content)
    with pytest.raises(hs.RunFileError, match=r"foreign\.nc: not a run"):
        load_run(path)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 1.0])
def test_cut_short(whole: bytes, share: float, tmp_path: Path) -> None:
    path = tmp_path / "cut.nc"
    path.write_bytes(whole[: int(share * (len(whole) - 50))])  # 50 bytes are less than the seal
    with pytest.raises(hs.RunFileError, match=r"cut\.nc"):
        load_run(path)


def test_flipped_bytes_never_end_in_anything_but_a_run_or_a_run_file_error(
    whole: bytes, tmp_path: Path
) -> None:
    draw = np.random.default_rng(0)
    path = tmp_path / "flipped.nc"
    failures = 0
    for _ in range(60):
        content = bytearray(whole)
        for place in draw.integers(0, len(content), 20):
            content[place] ^= int(draw.integers(1, 256))
        path.write_bytes(content)
        try:
            load_run(path)
        except hs.RunFileError:
            failures += 1
    assert failures > 0


def test_dataset_of_something_else(tmp_path: Path) -> None:
    path = tmp_path / "weather.nc"
    xarray.Dataset({"rain": ("day", np.arange(3.0))}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(hs.RunFileError, match="not a run of heelstrike"):
        load_run(path)


def _drop(name: str) -> Any:
    return lambda group: group.__delitem__(name)


def _attribute(**values: Any) -> Any:
    return lambda group: group.attrs.update(values)


def _replaced(name: str, change: Any) -> Any:
    def edit(group: h5py.Group) -> None:
        values = change(group[name][...])
        del group[name]
        group[name] = values

    return edit


def _last_set(value: float) -> Any:
    def change(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values.flat[-1] = value
        return values

    return change


@pytest.mark.parametrize(
    ("group", "edit", "message"),
    [
        (None, _drop("torque"), "'torque' is missing"),
        (None, _drop("ground_friction"), "'ground_friction' is missing"),
        (None, _replaced("gap", lambda v: v.astype("S")), "holds no numbers"),
        (None, _drop("contact_point"), "'contact_point' is missing"),
        (None, _replaced("position", lambda v: v[:, :4]), "has shape 51 × 4 instead of 51 × 9"),
        (None, _replaced("ground_friction", lambda v: v - 9.0), "friction"),
        (None, _replaced("event_contact", _last_set(77)), "contact point that is not there"),
        (None, _replaced("event_kind", _last_set(99)), "99"),
        (None, _attribute(status="splendid"), "status 'splendid' is unknown"),
        (None, _attribute(method="No name"), "the method is called 'No name'"),
        (None, _attribute(method_step=-1.0), "positive"),
        (None, _attribute(method_step="soon"), "not a number"),
        (None, _attribute(heelstrike_format=999), "layout 999"),
        (None, _attribute(message=3), "not text"),
        ("robot", _replaced("parent", _last_set(400)), "parent points outside"),
        ("robot", _replaced("parent", lambda v: v[::-1].copy()), "parent points outside"),
        ("robot", _replaced("contact_link", _last_set(-5)), "contact_link points outside"),
        ("robot", _replaced("actuator_joint", _last_set(9)), "actuator_joint points outside"),
        ("robot", _replaced("mass", _last_set(np.nan)), "'mass' is not finite"),
        ("robot", _replaced("mass", _last_set(-1.0)), "not negative"),
        ("robot", _replaced("mirror_joint", _last_set(0)), "exchange of left and right"),
        ("robot", _replaced("foot_link", _last_set(12)), "foot_link points outside"),
        ("robot", _drop("axis"), "axis"),
        ("robot", _attribute(pivot=1000), "pivot points outside"),
    ],
)
def test_damaged_files_say_what_is_wrong(
    whole: bytes, group: str | None, edit: Any, message: str, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.nc"
    bad.write_bytes(whole)
    with h5py.File(bad, "a") as file:
        edit(file[group or "/"])
    with pytest.raises(hs.RunFileError, match=message) as caught:
        load_run(bad)
    assert "bad.nc" in str(caught.value)


def test_what_is_written_anew_undamaged_makes_a_run(whole: bytes, tmp_path: Path) -> None:
    """What the tests of damaged files do besides the damage does no harm."""
    path = tmp_path / "run.nc"
    path.write_bytes(whole)
    with h5py.File(path, "a") as file:
        for name in ("gap", "robot/parent"):
            _replaced(name, lambda values: values)(file)
        _attribute(method_step=1e-3)(file)
    assert load_run(path).robot.name == "bravo7"


def test_a_small_file_that_claims_to_be_huge(good: Path, tmp_path: Path) -> None:
    """Storage of HDF5 that was never written takes no room and reads as zeros."""
    path = tmp_path / "flood.nc"
    path.write_bytes(good.read_bytes())
    with h5netcdf.File(path, "a") as file:
        file.dimensions["flood"] = 10**11
        file.create_variable("flood", ("flood",), np.float64, chunks=(10**6,))
    with pytest.raises(hs.RunFileError, match="more than a file of its size can"):
        load_run(path)


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(hs.RunFileError, match="there is no file"):
        load_run(tmp_path / "missing.nc")
    with pytest.raises(hs.RunFileError, match="is a folder"):
        load_run(tmp_path)


# Writing


def test_what_older_files_do_not_count_is_none(tmp_path: Path) -> None:
    path = make_run(box(), [0.0, 0.1], solver=SolverCount("lemke", 9, 5, 3, 2, 1, 1)).save(
        tmp_path / "older.nc"
    )
    with h5py.File(path, "a") as file:
        for name in ("solver_combinations", "solver_relaxed", "worst_energy_gain"):
            del file.attrs[name]
        assert "method_bounded_restitution" in file.attrs
        del file.attrs["method_bounded_restitution"]
    again = load_run(path)
    assert again.solver == SolverCount("lemke", 9, 5, 3, 2, 0, 0)
    assert again.certificates.energy_gain == 0.0
    assert again.method == hs.TimeStepping(step=0.1)
    with h5py.File(path, "a") as file:
        del file.attrs["solver_failures"]
    with pytest.raises(hs.RunFileError, match="solver_failures"):
        load_run(path)


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(hs.RunFileError, match=r"there is no folder .*still in memory"):
        walking.walk(steps=1).save(tmp_path / "nowhere" / "run.nc")
    with pytest.raises(hs.RunFileError, match="it is a folder"):
        walking.walk(steps=1).save(tmp_path)


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = walking.walk(steps=1).save(tmp_path / "run.nc")
    before = path.read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(hs.RunFileError, match="No space left"):
        walking.walk(steps=2).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_an_event_of_every_kind(tmp_path: Path) -> None:
    robot: Robot = walking.bravo7()
    kinds = [kind for kind in EventKind if not kind.of_constraint]  # of which it has none
    events = [Event(0.1 * k, kind, k % 4, (1.5 * k, -0.5)) for k, kind in enumerate(kinds)]
    run = make_run(robot, [0.0, 1.0], events=events)
    assert load_run(run.save(tmp_path / "run.nc")).events == run.events
