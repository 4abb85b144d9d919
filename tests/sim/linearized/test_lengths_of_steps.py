"""How steps along compliant ground are chosen and where they end; what a change of mode does.

What a step computes is played by a script here: the derivatives themselves are compared elsewhere.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heelstrike.errors import SimulationError
from heelstrike.sim.linearized import yielding as its
from heelstrike.sim.linearized.inputs import TORQUE, Inputs
from heelstrike.sim.linearized.yielding import Look, Panel, Yielding

SPAN = 1e-3


def bare(nq: int = 2, nc: int = 1, inputs: int = 0) -> Any:
    """A motion of so many coordinates and points, at 5 s, that knows nothing of a robot."""
    it: Any = object.__new__(Yielding)
    it._simulation = SimpleNamespace(
        robot=SimpleNamespace(nq=nq, nv=nq, nc=nc), time=5.0,
        _memory=SimpleNamespace(command=np.array([1.0]), pushes="pushes"),
        _work=SimpleNamespace(step=SPAN),
    )  # fmt: skip
    it._inputs = Inputs((), {TORQUE: slice(0, inputs)})
    it.size = 2 * nq + nc
    it._x = np.zeros(it.size)
    it._proposed = np.inf
    return it


def look(modes: bytes = b"air", **given: Any) -> Look:
    usual: dict[str, Any] = {
        "rate": np.zeros(5), "slope": np.zeros((5, 5)), "beyond": np.zeros(3, dtype=bool),
        "gradient": np.zeros((3, 2)), "pressed": np.zeros((2, 3)),
    }  # fmt: skip
    return Look(modes=modes, **(usual | given))


class Steps:
    """Plays the steps of a motion: each script entry is an error, None, or modes that a step meets.

    The numbers of `x` and of the errors tell how many steps were taken.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, meets: Any) -> None:
        self.it, self.meets = bare(), meets
        self.tried: list[tuple[float, float]] = []
        self.switched: list[float] = []
        self.modes = b"air"
        self.shared: list[Any] = []
        monkeypatch.setattr(its, "share_over_step", lambda *given: self.shared.append(given))
        self.it._panel, self.it._look, self.it._switch = self.panel, self.look, self.switch

    def look(self, time: float, x: Any, command: Any) -> Look:
        assert command.tolist() == [1.0]
        return look(self.modes)

    def panel(
        self, begin: float, step: float, x: Any, error: Any, inputs: Any, held: Any, now: Look,
        command: Any,
    ) -> Panel | None:  # fmt: skip
        self.tried.append((begin - 5.0, step))
        told = self.meets(begin - 5.0, step)
        if told is None:
            return None
        modes = told if isinstance(told, bytes) else self.modes
        error_told = 1e-9 if isinstance(told, bytes) else told
        return Panel(x + 1.0, error + 1.0, look(self.modes), (self.modes, modes), error_told)

    def switch(self, time: float, x: Any, change: Any, before: Look, command: Any) -> Look:
        self.switched.append(time - 5.0)
        self.modes = b"ground"
        return look(self.modes)

    def flow(self) -> Any:
        change = np.zeros((6, 1))
        self.it.flow(change, np.zeros((1, 1)))
        return change


def test_a_span_is_taken_at_once_if_that_is_accurate(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = Steps(monkeypatch, lambda time, step: 0.5)
    change = steps.flow()
    assert steps.tried == [(0.0, SPAN)]
    assert steps.shared == [(5.0, SPAN, "pushes")]
    assert change.ravel().tolist() == [1.0] * 5 + [0.0]  # inputs stay
    assert steps.it._x.tolist() == [1.0] * 5
    # The next one begins with what this one proposes, 0.9 of the fourth root more.
    assert steps.it._proposed == pytest.approx(SPAN * 0.9 * 0.5**-0.25)


def test_steps_grow_fourfold_at_most_and_shrink_fivefold(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = Steps(monkeypatch, lambda time, step: 0.0)
    steps.it._proposed = 1e-5
    steps.flow()
    sizes = [step for _, step in steps.tried]
    assert sizes[:4] == pytest.approx([1e-5, 4e-5, 16e-5, 64e-5])
    assert sum(sizes) == pytest.approx(SPAN, rel=1e-12)
    assert len(sizes) == 5
    steps = Steps(monkeypatch, lambda time, step: 1e9 if step > 1e-5 else 0.5)
    steps.it._proposed = 0.9e-3
    steps.flow()
    assert [step for _, step in steps.tried[:4]] == pytest.approx(
        [0.9e-3, 0.18e-3, 0.036e-3, 0.0072e-3]
    )
    steps = Steps(monkeypatch, lambda time, step: 16.0 if step == SPAN else 1.0)
    change = steps.flow()
    assert steps.tried[1][1] == pytest.approx(SPAN * 0.45)
    assert steps.tried[2] == pytest.approx((SPAN * 0.45, SPAN * 0.45 * 0.9))
    assert change[0, 0] == len(steps.tried) - 1  # what was too wrong is not taken


def test_a_step_ends_where_modes_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """The change at 0.3 ms is found to 1e-14 s; from there on steps are as long as before."""
    at = 0.3e-3

    def meets(time: float, step: float) -> Any:
        met = steps.modes == b"air" and time + step > at
        return b"ground" if met else 0.5

    steps = Steps(monkeypatch, meets)
    steps.flow()
    (found,) = steps.switched
    assert abs(found - at) <= 2e-14
    halves = [step for time, step in steps.tried if time == 0.0]
    assert halves[:3] == pytest.approx([SPAN, 0.5 * SPAN, 0.25 * SPAN])
    # After a step short of it comes half of what is left up to it.
    begin, step = steps.tried[3]
    assert begin == pytest.approx(0.25 * SPAN)
    assert step == pytest.approx(0.5 * (0.5 - 0.25) * SPAN)
    last = steps.tried[-1]
    assert last[0] + last[1] == pytest.approx(SPAN)


def test_steps_that_do_not_converge_are_halved_and_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps = Steps(monkeypatch, lambda time, step: None if step > 0.3 * SPAN else 0.5)
    steps.flow()
    assert [step for _, step in steps.tried[:3]] == pytest.approx([SPAN, 0.5 * SPAN, 0.25 * SPAN])
    assert not steps.switched
    steps = Steps(monkeypatch, lambda time, step: None)
    steps.it._switch = lambda *_: look()  # the same modes again
    with pytest.raises(SimulationError, match="changes faster than its errors can be followed"):
        steps.flow()
    assert steps.tried[-1][1] <= 1e-14 < 2.1 * steps.tried[-1][1]
    steps = Steps(monkeypatch, lambda time, step: 2.0)
    with pytest.raises(SimulationError, match="changes faster than its errors can be followed"):
        steps.flow()


# Changes of mode.


def switched(
    rate: list[float], beyond: list[bool], before: list[bool],
    after_rate: list[float] | None = None,
) -> tuple[Any, list[float]]:  # fmt: skip
    """Errors of one input per number of the state, through a change; where it looked."""
    it, looked = bare(), []
    then = look(
        rate=np.array(after_rate or rate), beyond=np.array(beyond),
        gradient=np.array([[0.0, 2.0], [1.0, 0.0], [0.0, 1.0]]),
        pressed=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    )  # fmt: skip

    def see(time: float, x: Any, command: Any) -> Look:
        looked.append(x.tolist())
        return then

    it._look = see
    change = np.eye(5)
    now = look(rate=np.array(rate), beyond=np.array(before))
    assert it._switch(5.0, np.zeros(5), change, now, None) is then
    return change, looked[0]


def test_what_is_met_earlier_presses_for_longer() -> None:
    """Of point 0, joint 0 and joint 1: pressed ∇g δq / ġ; a bend jumps in its rate."""
    rate = [-3.0, -5.0, 0.1, 0.2, 7.0]
    change, looked = switched(rate, [True, False, False], [False] * 3, [-3.0, -5.0, 0.1, 0.2, 9.0])
    np.testing.assert_allclose(looked, 2e-14 * np.array(rate))
    expected = np.eye(5)
    expected[2:4, 1] = np.array([1.0, 4.0]) * 2.0 / -10.0
    expected[4, 1] = 2.0 * 2.0 / -10.0
    np.testing.assert_allclose(change, expected)
    change, _ = switched(rate, [False, True, True], [False, False, False])
    expected = np.eye(5)
    expected[2:4, 0] = np.array([2.0, 5.0]) / -3.0
    expected[2:4, 1] = np.array([3.0, 6.0]) / -5.0
    np.testing.assert_allclose(change, expected)


def test_what_was_there_or_leaves_or_grazes_makes_no_jump() -> None:
    rate = [-3.0, -5.0, 0.1, 0.2, 7.0]
    for beyond, before in (([True] * 3, [True] * 3), ([False] * 3, [True] * 3)):
        np.testing.assert_array_equal(switched(rate, beyond, before)[0], np.eye(5))
    # Joint 0 grazes, joint 1 does not.
    change, _ = switched([1e-9, -5.0, 0.1, 0.2, 7.0], [False, True, True], [False] * 3)
    assert change[2, 0] == 0.0
    assert change[2, 1] == pytest.approx(3.0 / -5.0)


# How wrong a step is.


def test_errors_are_parts_of_their_blocks_and_of_what_begins() -> None:
    """Of positions, velocities and bends by positions, velocities and each input."""
    it = bare(nq=1, nc=1)
    it._inputs = Inputs((), {TORQUE: slice(0, 1), "mass": slice(1, 3)})
    # Columns: one position, one velocity, three inputs; rows: position, velocity, bend.
    whole = np.array([[2.0, 0.5, 0.0, 3.0, 4.0], [1.0, 8.0, 6.0, 0.0, 0.0], [9.0] * 5])
    least = 1e-7 * np.linalg.norm(whole[0])
    for place, expected in (
        ((0, 0), 1.0 / (2.0 + least)), ((0, 1), 1.0 / (0.5 + least)), ((0, 2), 1.0 / least),
        ((0, 3), 1.0 / (5.0 + least)), ((1, 1), 1.0 / (8.0 + 1e-7 * np.linalg.norm(whole[1]))),
        ((2, 1), 1.0 / (0.5 + least)), ((2, 4), 1.0 / (5.0 + least)),
    ):  # fmt: skip
        error = np.zeros((3, 5))
        error[place] = -1.0
        assert it._parts(error, whole) == pytest.approx(expected, rel=1e-12)
    assert it._parts(np.zeros((3, 5)), whole) == 0.0


def test_a_linear_motion_is_taken_exactly_as_radau_does() -> None:
    """x' = S x + c of constant S: the collocation polynomial, of order 7; inputs push along."""
    it = bare(nq=1, nc=0, inputs=1)
    it._scale = np.ones(2)
    matrix, constant = np.array([[0.0, 1.0], [-40.0, -3.0]]), np.array([0.5, 0.2])
    by_input = np.array([[0.0], [2.0]])
    looked: list[float] = []

    def see(time: float, x: Any, command: Any) -> Look:
        looked.append(time)
        return look(
            b"same", rate=matrix @ x + constant, slope=np.hstack([matrix, by_input]),
            beyond=np.zeros(1, dtype=bool), gradient=np.zeros((1, 1)), pressed=np.zeros((1, 1)),
        )  # fmt: skip

    from scipy.linalg import expm

    it._look, step = see, 0.02
    x, change, inputs, held = (
        np.array([0.3, -0.1]), np.hstack([np.eye(2), np.zeros((2, 1))]),
        np.array([[0.0, 0.0, 1.0]]), np.array([[0.1, 0.2, 0.3]]),
    )  # fmt: skip
    now = see(2.0, x, None)
    found = it._panel(2.0, step, x, change, inputs, held, now, None)
    assert found is not None
    wide = np.zeros((3, 3))
    wide[:2, :2], wide[:2, 2] = matrix, constant
    after = (expm(step * wide) @ np.append(x, 1.0))[:2]
    np.testing.assert_allclose(found.x, after, rtol=1e-10)
    wide[:2, 2] = by_input[:, 0]
    flow = expm(step * wide)
    expected = flow[:2, :2] @ change + np.outer(flow[:2, 2], inputs[0] + held[0])
    np.testing.assert_allclose(found.change, expected, rtol=1e-9)
    assert found.modes == (b"same",) * 4
    assert looked[-1] == pytest.approx(2.02)
    assert found.last.rate == pytest.approx(matrix @ after + constant, rel=1e-6)
    # The error is what the coarse weights differ by, over 1e-6.
    nodes = [expm(step * node * matrix) for node in its.NODES]
    rates = [matrix @ (each @ x) + each @ constant for each in nodes]
    off = step * sum((w - c) * r for w, c, r in zip(its.WEIGHTS, its.COARSE, rates, strict=True))
    assert found.error >= np.abs(off).max() / 1e-6 * 0.99
    it._scale = np.full(2, 1e9)
    assert it._panel(2.0, step, x, change, inputs, held, now, None).error > 0.0


def test_a_step_that_newton_does_not_solve_is_none() -> None:
    it = bare(nq=1, nc=0)
    it._scale = np.ones(2)
    turn = [1.0]

    def jumps(time: float, x: Any, command: Any) -> Look:
        turn[0] = -turn[0]
        return look(
            rate=np.full(2, turn[0]), slope=np.zeros((2, 2)), beyond=np.zeros(1, dtype=bool),
            gradient=np.zeros((1, 1)), pressed=np.zeros((1, 1)),
        )  # fmt: skip

    it._look = jumps
    nothing = np.zeros((2, 1))
    arguments = (0.0, 1.0, np.zeros(2), nothing, np.zeros((0, 1)), np.zeros((0, 1)))
    turns: list[int] = []

    def counted(time: float, x: Any, command: Any) -> Look:
        turns.append(1)
        seen = jumps(time, x, command)
        return look(
            rate=np.full(2, float(len(turns))), slope=seen.slope, beyond=seen.beyond,
            gradient=seen.gradient, pressed=seen.pressed,
        )  # fmt: skip

    it._look = counted
    assert it._panel(*arguments, look(rate=np.zeros(2)), None) is None
    assert len(turns) == 8 * 4
    it._look = lambda *_: look(
        rate=np.full(2, np.nan), slope=np.zeros((2, 2)), beyond=np.zeros(1, dtype=bool),
        gradient=np.zeros((1, 1)), pressed=np.zeros((1, 1)),
    )  # fmt: skip
    assert it._panel(*arguments, look(rate=np.zeros(2)), None) is None


def test_rows_are_multiplied_each_by_its_number() -> None:
    found = its._by(np.array([2.0, 3.0, 9.0]), np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert found.tolist() == [[2.0, 4.0], [9.0, 12.0]]
