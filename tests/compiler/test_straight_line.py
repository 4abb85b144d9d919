"""Straight-line code computes what the kernels compute, for every robot it is made for."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from llvmlite import ir
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike.compiler import machine_code
from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.compiler.recordings import trigonometry
from heelstrike.compiler.recordings.recording import Program, Recording
from heelstrike.compiler.recordings.tape import Tape, Value
from heelstrike.compiler.straight_line import add_function, play
from heelstrike.contact.ground import Ground
from heelstrike.dynamics.workspace import Workspace
from heelstrike.sim.contacts.straight_line import (
    KERNELS,
    MOST_COORDINATES,
    room_of,
    straight_line_programs,
    usual_points,
)
from heelstrike.sim.controller.interface import Contacts

# Both sides do the same few hundred operations in another order, with products and sums fused.
ROUNDING = 1e-11
WRITER = fingerprint(add_function)


@numba.njit
def called(address: int, *arguments: Any) -> None:
    play(address, arguments)


def arguments(case: RobotCase, seed: int) -> list[tuple[Any, ...]]:
    """Arguments of all kernels at a random state; the arrays that carry results are shared."""
    rng = np.random.default_rng(seed)
    model, nv, nc = case.robot().model, case.robot().nv, case.robot().nc
    tree = Workspace.allocate(model.extents)
    matrix, factor = np.zeros((nv, nv)), np.zeros((nv, nv))
    q = model.reference + rng.uniform(-1.0, 1.0, nv)
    v = rng.uniform(-3.0, 3.0, nv)
    contacts = Contacts.allocate(model.extents, components=2)
    contacts.position[:] = rng.uniform(-1.0, 1.0, (nc, 2))
    contacts.normal[:] = rng.normal(size=(nc, 2))
    impulse = rng.uniform(-1.0, 1.0, (nc, 2))
    x, w = rng.uniform(-1.0, 1.0, (2, nv))
    points = usual_points(case.robot())
    room = room_of(len(points))
    rows, delassus = np.zeros((2 * len(points), nv)), np.zeros((room, room))
    torque, bias = rng.uniform(-9.0, 9.0, case.robot().nu), np.zeros(nv)
    ground = Ground(slope=rng.uniform(-0.5, 0.5), friction=0.7, restitution=0.2).model()
    located = Contacts.allocate(model.extents, components=2)
    return [
        (model, q, v, tree, matrix, factor, bias),
        (model, factor, x),
        (model, points, tree, contacts, factor, rows, delassus),
        (model, points, contacts, v, tree, np.zeros((nc, 2))),
        (model, points, contacts, factor, impulse, tree, np.zeros(nv), w),
        (model, q, v, torque, bias, factor, np.zeros(nv), np.zeros(nv)),
        (model, ground, tree, located, np.zeros(nc), np.zeros(nc)),
    ]


def results(arguments: list[tuple[Any, ...]]) -> dict[str, Any]:
    (_, _, _, tree, _, factor, bias), (*_, x), (*_, delassus), (*_, velocity), *more = arguments
    (*_, w), (*_, v_dot), (_, _, _, located, friction, restitution) = more
    scratch = ("acceleration", "force", "composite", "zero")
    kept = {name: array for name, array in tree.members().items() if name not in scratch}
    return kept | {
        "factor": factor, "bias": bias, "solved": x, "delassus": delassus, "velocity": velocity,
        "pushed": w, "v_dot": v_dot, "friction": friction, "restitution": restitution,
        "position": located.position, "normal": located.normal, "gap": located.gap,
    }  # fmt: skip


@pytest.mark.parametrize("case", [*NAMED, *RANDOM[:6]], ids=lambda case: case.name)
def test_equals_the_kernels(case: RobotCase) -> None:
    programs = straight_line_programs(case.robot().model, usual_points(case.robot()))
    if case.robot().nv > MOST_COORDINATES:
        assert not programs.any()
        return
    assert programs[0]
    for seed in range(3):
        loops, straight = arguments(case, seed), arguments(case, seed)
        for place, loop in enumerate(KERNELS):
            loop(*loops[place])
            if programs[place]:
                called(programs[place], *straight[place])
            else:
                loop(*straight[place])
        expected, found = results(loops), results(straight)
        mass = loops[0][4]  # accelerations are as exact as the forces that they take
        expected["v_dot"], found["v_dot"] = mass @ expected["v_dot"], mass @ found["v_dot"]
        for name, value in expected.items():
            size = max(1.0, np.abs(value).max(initial=0.0))
            np.testing.assert_allclose(found[name], value, atol=ROUNDING * size, err_msg=name)


def test_robots_that_differ_in_numbers_share_their_code() -> None:
    model, points = NAMED[0].robot().model, usual_points(NAMED[0].robot())
    heavier = model.replaced(mass=1.5 * model.mass)
    np.testing.assert_array_equal(
        straight_line_programs(model, points), straight_line_programs(heavier, points)
    )


@pytest.mark.parametrize("fused", [False, True], ids=["rounded twice", "fused"])
def test_sine_and_cosine_to_the_last_digits(fused: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if fused and not machine_code.can_fuse():
        pytest.skip("the processor has no fused multiply-add")
    monkeypatch.setattr(trigonometry, "can_fuse", lambda: fused)
    lanes = 8
    vector = ir.VectorType(ir.DoubleType(), lanes)
    module = ir.Module("trigonometry")
    pointers = [vector.as_pointer()] * 3
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), pointers), "both")
    builder = ir.IRBuilder(function.append_basic_block())
    values = trigonometry.sine_and_cosine(builder, builder.load(function.args[0], align=8))
    for value, place in zip(values, function.args[1:], strict=True):
        builder.store(value, place, align=8)
    builder.ret_void()
    (address,) = machine_code.addresses(["both"], b"trigonometry %d" % fused, "", lambda: module)

    rng = np.random.default_rng(0)
    quarters = np.arange(-400, 400) * (np.pi / 4.0)
    spread = [rng.uniform(-size, size, 4000) for size in (1e-9, 1e-3, 1.0, 10.0, 1e3, 1e6)]
    angles = np.concatenate([quarters, *spread, [0.0, -0.0, 5e-324, np.nan, np.inf, 1e300, 0, 0]])
    sine, cosine = np.empty_like(angles), np.empty_like(angles)
    for begin in range(0, len(angles), lanes):
        part = slice(begin, begin + lanes)
        called(address, angles[part], sine[part], cosine[part])
    usual = np.abs(angles) <= 1e6
    for found, exact in ((sine, np.sin(angles[usual])), (cosine, np.cos(angles[usual]))):
        # NumPy's own are right to half a unit in the last place or a little more.
        error = np.abs(found[usual] - exact) / np.spacing(np.abs(exact))
        assert error.max() <= 2.0
    assert np.isnan(sine[np.isnan(angles)]).all()
    assert np.isnan(cosine[np.isnan(angles)]).all()


def test_a_tape_folds_zeros_and_ones_and_does_nothing_twice() -> None:
    tape = Tape()
    a, b = tape.array("x", (2,))
    assert a * 0.0 == 0.0
    assert 0.0 * a == 0.0
    assert a + 0.0 is a
    assert 1.0 * a is a
    product = a * b
    count = len(tape.values)
    assert isinstance(b * a, Value)
    assert (b * a).place == product.place
    assert len(tape.values) == count


def test_a_tape_tells_a_number_from_the_place_of_a_value() -> None:
    tape = Tape()
    _, second, third = tape.array("x", (3,))
    assert second.place == 1
    assert (third + second).place != (third + 1.0).place


@kernel
def exchange(x: np.ndarray, y: np.ndarray) -> None:
    first = x[0]
    x[0] = x[1]
    x[1] = y[0]
    y[0] = first


def test_everything_is_read_before_anything_is_written() -> None:
    x, y = np.array([1.0, 2.0]), np.array([3.0])
    module = ir.Module("exchange")
    add_function(module, Recording(Program(exchange, {"x": x, "y": y})))
    (address,) = machine_code.addresses(["exchange"], b"exchange", WRITER, lambda: module)
    called(address, x, y)
    assert (x.tolist(), y.tolist()) == ([2.0, 3.0], [1.0])


@kernel
def cross(x: np.ndarray, y: np.ndarray) -> None:
    y[1] = x[0] + 1.0
    y[0] = x[1] + 1.0


def test_arguments_may_be_the_same_array() -> None:
    x = np.array([1.0, 5.0])
    module = ir.Module("cross")
    add_function(module, Recording(Program(cross, {"x": x, "y": np.zeros(2)})))
    (address,) = machine_code.addresses(["cross"], b"cross", WRITER, lambda: module)
    called(address, x, x)
    assert x.tolist() == [6.0, 2.0]


class Counted(Bundle):
    value: np.ndarray = array("n")
    count: int = cell(int)


def test_what_a_recording_would_take_for_a_constant_is_refused() -> None:
    def counting(counted: Counted) -> None:
        counted.count += 1

    with pytest.raises(TypeError, match="counted has cells"):
        Recording(Program(counting, {"counted": Counted.allocate(n=1)}))


def test_scratch_may_have_cells_and_is_written_nowhere() -> None:
    def doubling(counted: Counted, x: np.ndarray) -> None:
        counted.count = x.shape[0]
        for i in range(counted.count):
            counted.value[i] = x[i] + x[i]
            x[i] = counted.value[i]

    arguments = {"counted": Counted.allocate(n=2), "x": np.zeros(2)}
    recording = Recording(Program(doubling, arguments, scratch=("counted",)))
    assert [name for name, *_ in recording.written()] == ["x", "x"]
    assert not recording.left()


def constant(number: float) -> ir.Module:
    """Module of a function that writes a number."""
    module = ir.Module("constant")
    pointer = ir.DoubleType().as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [pointer]), "constant")
    builder = ir.IRBuilder(function.append_basic_block())
    builder.store(ir.Constant(ir.DoubleType(), number), function.args[0])
    builder.ret_void()
    return module


def test_threads_that_ask_at_once_get_one_engine(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The engine holds the code: a second one in its place would free what others are to call."""
    monkeypatch.setattr(machine_code, "directories", lambda _: [tmp_path])
    written = []

    def write() -> ir.Module:
        written.append(time.sleep(0.1))
        return constant(1.0)

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(
            lambda _: machine_code.addresses(["constant"], b"test of threads", "", write), range(2)
        )
    assert first == second
    assert len(written) == 1


def test_code_is_kept_for_the_next_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(machine_code, "directories", lambda _: [tmp_path])

    def loaded(described: bytes, number: float) -> float:
        machine_code._loaded.clear()
        (address,) = machine_code.addresses(["constant"], described, "", lambda: constant(number))
        result = np.zeros(1)
        called(address, result)
        return float(result[0])

    monkeypatch.setattr(machine_code, "_loaded", {})
    assert loaded(b"one", 1.0) == 1.0
    assert loaded(b"one", 2.0) == 1.0  # from the file
    assert loaded(b"two", 2.0) == 2.0
    assert len(list(tmp_path.iterdir())) == 2


def test_arrays_with_gaps_are_refused() -> None:
    with pytest.raises(TypeError, match="C-contiguous"):
        called(0, np.zeros((3, 2))[:, 0])
