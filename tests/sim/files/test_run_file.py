"""Saved runs: every method's comes back, and files that are damaged or hostile are refused."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import random
import time
import types
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from damage import damaged_bytes
from stored_files import run_file
from synthetic_runs import box, make_run

import heelstrike as hs
from heelstrike.sim import BristleFriction, RegularisedFriction, RunStatus, Scheme
from heelstrike.sim.files import hdf5_contents
from heelstrike.sim.files import run_file as run_file_module
from heelstrike.sim.files.run_file import load_run, save
from heelstrike.sim.files.seal import LENGTH, seal_holds

METHODS: dict[str, Any] = {
    **{scheme.name: hs.TimeStepping(scheme=scheme, step=1.25e-3) for scheme in Scheme},
    "solver and activation": hs.TimeStepping(solver="gauss_seidel", activation=1e-6),
    "event-driven": hs.EventDriven(),
    "event-driven, swing feet pass": hs.EventDriven(swing_feet_pass=True, solver="lemke"),
    "event-driven, every step": hs.EventDriven(output_period=None, rtol=1e-6, max_step=0.01),
    "Hunt-Crossley, bristles": hs.Compliant(
        law=hs.HuntCrossley(stiffness=1e6, exponent=1.0), friction=BristleFriction(stiffness=1e5)
    ),
    "Kelvin-Voigt, regularised": hs.Compliant(
        law=hs.KelvinVoigt(stiffness=1e5),
        friction=RegularisedFriction(speed=1e-2),
        stop=hs.HuntCrossley(),
        rtol=1e-4,
    ),
}


def same_arrays(one: hs.Run, other: hs.Run) -> list[str]:
    """Names of the arrays that differ in any bit."""
    return [
        field.name
        for field in dataclasses.fields(hs.Run)
        if isinstance(array := getattr(one, field.name), np.ndarray)
        and (
            array.dtype != getattr(other, field.name).dtype
            or array.shape != getattr(other, field.name).shape
            or array.tobytes() != getattr(other, field.name).tobytes()
        )
    ]


@pytest.mark.parametrize("name", METHODS)
def test_every_method_comes_back(name: str, tmp_path: Path) -> None:
    """A box that drops onto a slope and slides: arrays equal bit by bit, everything else equal."""
    robot = box(0.063)
    run = hs.simulate(
        robot,
        state=hs.State(robot.model.reference, [0.3, 0.0, 0.2]),
        duration=0.1,
        method=METHODS[name],
        ground=hs.Ground(friction=0.3, slope=0.1),
        pushes=[hs.Push("box", force=(2.0, 0.0), start=0.02, duration=0.03)],
    )
    assert run.completed, run.message
    assert run.events
    again = load_run(run.save(tmp_path / "run.nc"))
    assert not same_arrays(run, again)
    assert type(again.method) is type(run.method)
    assert again.method == METHODS[name]
    for field in ("status", "message", "events", "certificates", "solver", "steps", "saturations"):
        assert getattr(again, field) == getattr(run, field), field
    assert again.timing == run.timing
    (push,), (same,) = run.pushes, again.pushes
    assert (same.force, same.start, same.duration) == (push.force, push.start, push.duration)
    np.testing.assert_equal(same.place(again.robot), push.place(robot))
    again.summary()  # a run like any other


def test_there_is_no_method_without_a_round_trip() -> None:
    from heelstrike.sim.files import settings

    assert {type(method) for method in METHODS.values()} == set(settings.METHODS.values())
    laws = {
        type(value)
        for method in METHODS.values()
        for value in (getattr(method, name, None) for name in ("law", "friction", "stop"))
        if value is not None
    }
    assert laws == set(settings.LAWS.values())


def test_files_of_version_0_1_still_load(tmp_path: Path) -> None:
    walk = load_run(run_file("time_stepping", tmp_path))
    assert walk.method == hs.TimeStepping(
        step=1e-3, scheme=Scheme.LINEARLY_IMPLICIT, activation=1e-8
    )
    assert walk.completed
    assert walk.robot.name == "bravo7"
    assert walk.ground.slope == 0.02
    kinds = [event.kind.name for event in walk.events]
    assert kinds == ["TOUCHDOWN", "SLIP", "TOUCHDOWN", "SLIP", "STICK", "STICK"]
    assert walk.time.tolist() == [2e-3 * k for k in range(16)]
    assert walk.position[-1, 1] == pytest.approx(9.53783243e-01, abs=1e-9)
    assert walk.contact_force.sum() == pytest.approx(13124.67687688789, rel=1e-12)
    (push,) = walk.pushes
    assert push.force == (30.0, 0.0)
    block = load_run(run_file("compliant", tmp_path))
    assert block.method == hs.Compliant(
        law=hs.KelvinVoigt(), friction=RegularisedFriction(), step=1e-3
    )
    assert block.steps == 203
    assert len(block.events) == 3
    assert block.contact_force.sum() == pytest.approx(8158.700116898806, rel=1e-12)
    assert block.ground.profile is not None
    saved = load_run(walk.save(tmp_path / "again.nc"))
    assert not same_arrays(walk, saved)


def test_words_that_netcdf_cannot_hold_are_not_worth_a_run(tmp_path: Path) -> None:
    run = make_run(box(), [0.0, 1.0])
    run = dataclasses.replace(
        run, message="half \ud800, null \0", error=ValueError("\0"), status=RunStatus.INTERRUPTED
    )
    again = load_run(run.save(tmp_path / "run.nc"))
    assert again.message == "half \\ud800, null \\0"


@dataclasses.dataclass(frozen=True)
class Gridded(hs.TimeStepping):
    grid: Any = (1.0, 2.0)


@dataclasses.dataclass(frozen=True)
class Lawful(hs.TimeStepping):
    law: Any = hs.KelvinVoigt()  # noqa: RUF009 - frozen


UNREADABLE: dict[str, tuple[Any, str]] = {
    "no dataclass": (types.SimpleNamespace(), "SimpleNamespace is not a frozen dataclass"),
    "a list": (Gridded(), r"its setting grid is neither number nor text, but \(1.0, 2.0"),
    "a name that is ours": (
        dataclasses.make_dataclass("EventDriven", [], bases=(hs.TimeStepping,), frozen=True)(),
        "heelstrike has a EventDriven of its own",
    ),
    "a law with a list": (Lawful(law=Gridded()), "its setting grid is neither"),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_method_that_could_not_be_read_again_is_refused(name: str, tmp_path: Path) -> None:
    method, words = UNREADABLE[name]
    run = dataclasses.replace(make_run(box(), [0.0, 1.0]), method=method)
    with pytest.raises(hs.RunFileError, match=rf"could not be read again: {words}.*in memory"):
        run.save(tmp_path / "run.nc")
    assert not list(tmp_path.iterdir())


# Damage


@pytest.fixture(scope="module")
def saved_now(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("saved")
    return save(load_run(run_file("compliant", folder)), folder / "sealed.nc").read_bytes()


@pytest.fixture
def sealed(saved_now: bytes, tmp_path: Path) -> Path:
    """Return a file as it is saved now."""
    path = tmp_path / "sealed.nc"
    path.write_bytes(saved_now)
    return path


@pytest.fixture
def unsealed(tmp_path: Path) -> Path:
    """Return a file without a checksum, which HDF5 itself has to make sense of."""
    return run_file("compliant", tmp_path)


@pytest.mark.slow
def test_no_damage_goes_unseen(sealed: Path, tmp_path: Path) -> None:
    """What is read of a damaged file is what was saved, or nothing."""
    whole = load_run(sealed)
    content = sealed.read_bytes()
    path = tmp_path / "damaged.nc"
    draw = random.Random(0)
    refused = 0
    for _ in range(80):
        damaged = damaged_bytes(content, draw)
        path.write_bytes(damaged)
        if damaged[:-LENGTH] == content[:-LENGTH]:
            continue
        with pytest.raises(hs.RunFileError, match=r"damaged\.nc: "):
            load_run(path)
        refused += 1
    assert refused > 65
    assert not same_arrays(whole, load_run(sealed))


def test_one_flipped_bit_in_the_numbers(sealed: Path, tmp_path: Path) -> None:
    run = load_run(sealed)
    content = bytearray(sealed.read_bytes())
    content[content.index(run.position[3].tobytes())] ^= 1
    path = tmp_path / "flipped.nc"
    path.write_bytes(content)
    with pytest.raises(hs.RunFileError, match=r"flipped\.nc: damaged: .*checksum"):
        load_run(path)


@pytest.mark.parametrize("missing", [1, LENGTH // 2, LENGTH - 20])
def test_a_seal_that_is_cut_short(sealed: Path, missing: int, tmp_path: Path) -> None:
    path = tmp_path / "cut.nc"
    path.write_bytes(sealed.read_bytes()[:-missing])
    with pytest.raises(hs.RunFileError, match=r"cut\.nc: damaged"):
        load_run(path)


@pytest.mark.slow
def test_damage_where_there_is_no_checksum(unsealed: Path, tmp_path: Path) -> None:
    content = unsealed.read_bytes()
    path = tmp_path / "damaged.nc"
    draw = random.Random(1)
    refused = 0
    for _ in range(12):
        path.write_bytes(damaged_bytes(content, draw))
        with contextlib.suppress(hs.RunFileError):
            load_run(path)
            refused -= 1
        refused += 1
    assert refused > 5


def test_bytes_over_which_the_library_hangs(
    unsealed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A heap of texts whose first object is as long as nothing: HDF5 2.0 goes round in it."""
    content = bytearray(unsealed.read_bytes())
    place = content.index(b"GCOL")
    content[place + 16 : place + 4096] = bytes(4080)
    path = tmp_path / "hanging.nc"
    path.write_bytes(content)
    monkeypatch.setattr(run_file_module, "PATIENCE", 3.0)
    begin = time.monotonic()
    with pytest.raises(hs.RunFileError, match=r"hanging\.nc"):
        load_run(path)
    assert time.monotonic() - begin < 600.0  # it ends


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("import os; os.abort()", "crashes on this file"),
        ("raise ValueError('so it is')", "so it is"),
        ("import time; time.sleep(3600)", "has not finished with this file after 2 s"),
        ("raise MemoryError", "asks for more than"),
    ],
    ids=["crash", "refusal", "hang", "memory"],
)
def test_whatever_happens_to_who_reads_strange_bytes(
    unsealed: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    program: str,
    words: str,
) -> None:
    reader = tmp_path / "reader.py"
    reader.write_text(f"def answer(order):\n    {program}\n")
    monkeypatch.setattr(hdf5_contents, "__file__", str(reader))
    monkeypatch.setattr(run_file_module, "PATIENCE", 2.0 if "sleep" in program else 60.0)
    with pytest.raises(hs.RunFileError, match=rf"compliant\.nc: .*{words}"):
        load_run(unsealed)


def test_another_program_may_add_to_a_file(sealed: Path) -> None:
    assert seal_holds(sealed)
    with h5py.File(sealed, "a") as file:
        file.attrs["remark"] = "the third try"
        file["position"].attrs["remark"] = "smooth"
    assert seal_holds(sealed) is None
    assert load_run(sealed).completed


def _array(name: str, values: Any, **options: Any) -> Any:
    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, data=values, **options)

    return change


def _claims(name: str, shape: tuple[int, ...], chunks: tuple[int, ...] | None = None) -> Any:
    def change(file: h5py.File) -> None:
        del file[name]
        maxshape = (None, *shape[1:])
        file.create_dataset(name, shape=shape, dtype="f8", chunks=chunks, maxshape=maxshape)

    return change


def _texts_without_end(file: h5py.File) -> None:
    """Every one of many texts is the same, long one: a small file that is a large list."""
    del file["robot/joint_names"]
    kind = h5py.string_dtype()
    names = file.create_dataset("robot/joint_names", shape=(5000,), dtype=kind, fillvalue="x" * 999)
    assert names.id.get_storage_size() < 200000


def _elsewhere(file: h5py.File) -> None:
    del file["gap"]
    file["gap"] = h5py.ExternalLink("other.nc", "gap")


def _outside(file: h5py.File) -> None:
    shape = file["gap"].shape
    del file["gap"]
    file.create_dataset("gap", shape=shape, dtype="f8", external=[("/dev/zero", 0, 10**6)])


def _virtual(file: h5py.File) -> None:
    shape = file["gap"].shape
    del file["gap"]
    layout = h5py.VirtualLayout(shape=shape, dtype="f8")
    layout[:] = h5py.VirtualSource("other.nc", "gap", shape=shape)
    file.create_virtual_dataset("gap", layout)


def _attribute(name: str, value: Any) -> Any:
    def change(file: h5py.File) -> None:
        file.attrs[name] = value

    return change


def _set(name: str, place: Any, value: float) -> Any:
    def change(file: h5py.File) -> None:
        file[name][place] = value

    return change


def _reference(file: h5py.File) -> None:
    file.attrs["message"] = file["gap"].ref


HOSTILE = {
    "NaN in the positions": (_set("position", (4, 1), np.nan), "'position' is not finite in row 4"),
    "infinite force": (_set("contact_force", (2, 1, 0), np.inf), "'contact_force' is not finite"),
    "NaN in the times": (_set("time", 3, np.nan), "'time' is not finite in row 3"),
    "time goes back": (_set("time", 3, -1.0), "'time' goes backwards"),
    "NaN in an event": (_set("event_time", 0, np.nan), "'event_time' is not finite"),
    "NaN in the ground": (_set("ground_corner", (0, 0), np.nan), "'ground_corner' is not finite"),
    "NaN in the robot": (_set("robot/mass", 0, np.nan), "'mass' is not finite in row 0"),
    "a robot's index": (_set("robot/contact_link", 0, 2**40), "contact_link points outside"),
    "a foot that is not there": (_array("robot/contact_foot", [0, 9]), "contact_foot points"),
    "half an index": (_array("robot/parent", [-1.0, 0.5, 1.0]), "does not hold whole numbers"),
    "wrong shape": (_array("position", np.zeros((3, 31))), "has shape 3 × 31 instead of 31 × 3"),
    "no dimensions": (_array("position", 1.0), "has shape"),
    "texts for numbers": (_array("position", ["a"] * 31), "holds text, not numbers"),
    "complex numbers": (_array("position", np.zeros((31, 3), complex)), "holds no numbers"),
    "records": (_array("position", np.zeros(31, [("a", "f8")])), "holds no numbers"),
    "numbers for names": (
        _array("robot/joint_names", np.arange(3)),
        "'joint_names' holds numbers, not text",
    ),
    "a group for an array": (lambda f: (f.pop("gap"), f.create_group("gap")), "'gap' is missing"),
    "an array for a group": (
        lambda f: (f.pop("robot"), f.create_dataset("robot", data=1.0)),
        "it holds no robot",
    ),
    "huge dimensions": (_claims("position", (10**9, 3), (10**4, 3)), "more than a file of its"),
    "a huge chunk": (_claims("position", (31, 3), (2**27, 3)), "more than a file of its"),
    "a huge array of no rows": (_claims("time", (2**40,), (2**20,)), "more than a file of its"),
    "texts without end": (_texts_without_end, "more text than there is"),
    "an array in another file": (_elsewhere, "lies in another file"),
    "an array outside of HDF5": (_outside, "lies in another file"),
    "an array put together": (_virtual, "lies in another file"),
    "a soft link in a circle": (
        lambda f: (f.pop("gap"), f.__setitem__("gap", h5py.SoftLink("/gap"))),
        "'gap' is missing",
    ),
    "another packer": (_array("gap", np.zeros((31, 4)), compression="lzf"), "packed in a way"),
    "a list for a text": (_attribute("message", ["a", "b"]), "'message' is missing, or neither"),
    "a large array for a number": (_attribute("steps", np.zeros(5000)), "'steps' is missing"),
    "nothing for a number": (_attribute("steps", h5py.Empty("f8")), "'steps'"),
    "a reference": (_reference, "'message' is missing, or neither"),
    "bytes that are no text": (
        _attribute("message", np.bytes_(b"\xff\xfe")),
        "damaged",
    ),
    "NaN steps": (_attribute("steps", np.nan), "attribute 'steps' is NaN"),
    "negative steps": (_attribute("steps", -3), "'steps' is -3, not a count"),
    "half a step": (_attribute("steps", 2.5), "'steps' is 2.5, not a count"),
    "NaN time step": (_attribute("method_step", np.nan), "'method_step' is NaN"),
    "no law": (_attribute("method_law", "none"), "must be HuntCrossley"),
    "no step": (_attribute("method_step", "none"), "damaged: step must be a number, got None"),
    "a method for a law": (_attribute("method_law", "EventDriven"), "must be HuntCrossley"),
    "no name of a method": (_attribute("method", "x " * 9999), "the method is called 'x x"),
    "layout as text": (_attribute("heelstrike_format", "one"), "is not a number"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files(name: str, unsealed: Path) -> None:
    change, words = HOSTILE[name]
    with h5py.File(unsealed, "a") as file:
        change(file)
    with pytest.raises(hs.RunFileError, match=words) as caught:
        load_run(unsealed)
    assert str(unsealed) in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_a_run_that_failed_may_hold_what_made_it_fail(tmp_path: Path) -> None:
    run = make_run(box(), [0.0, 1.0], status=RunStatus.DIVERGED)
    run.contact_force[1, 0, 0] = np.nan
    again = load_run(run.save(tmp_path / "run.nc"))
    assert np.isnan(again.contact_force[1, 0, 0])


@pytest.mark.skipif(os.name != "posix", reason="there are no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.nc"
    os.mkfifo(pipe)
    with pytest.raises(hs.RunFileError, match="not a regular file"):
        load_run(pipe)


def test_paths_that_are_none(tmp_path: Path) -> None:
    for path in ("a\0b", tmp_path / ("x" * 300)):
        with pytest.raises(hs.RunFileError):
            load_run(path)
