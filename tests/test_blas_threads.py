"""Small matrices are multiplied in one thread: others would wait for more in a busy loop.

The libraries of linear algebra are found among the files that are mapped into this process, and
asked themselves.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from threading import Event
from typing import Any

import casadi
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.blas_threads import one_blas_thread
from heelstrike.experiments.identification import RobotLog
from heelstrike.experiments.identification.fitting import Fitting
from heelstrike.gait.program import SETTINGS, Ipopt, _Watch

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="asks Linux what is mapped")


class Library:
    """An OpenBLAS in this process."""

    def __init__(self, file: str) -> None:
        self.name = Path(file).name
        library = ctypes.CDLL(file)
        for before, after in product(("scipy_", ""), ("64_", "")):
            name = f"{before}openblas_%s_num_threads{after}"
            if hasattr(library, name % "get"):
                self.threads, self.use = (getattr(library, name % each) for each in ("get", "set"))


def libraries() -> list[Library]:
    """All of them: NumPy, SciPy and CasADi have one each."""
    casadi.load_nlpsol("ipopt")
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    files = {line.split(maxsplit=5)[-1] for line in maps}
    return [Library(file) for file in sorted(files) if "openblas" in Path(file).name]


def threads() -> dict[str, int]:
    """Threads that each of them uses."""
    return {each.name: int(each.threads()) for each in libraries()}


@pytest.fixture(autouse=True)
def _two_threads() -> Iterator[None]:
    """Let all of them use two threads, whatever the machine and its environment."""
    before = {each: int(each.threads()) for each in libraries()}
    for each in before:
        each.use(2)
    yield
    for each, count in before.items():
        each.use(count)


def test_in_a_block_all_libraries_use_one_thread() -> None:
    before = threads()
    assert any("casadi" in name for name in before)
    assert set(before.values()) == {2}
    with one_blas_thread():
        assert set(threads().values()) == {1}
    assert threads() == before


@pytest.mark.parametrize("longer", [False, True])
def test_blocks_of_two_threads_leave_all_as_it_was(longer: bool) -> None:
    before, begun, ended = threads(), Event(), Event()

    def block() -> None:
        with one_blas_thread():
            begun.set()
            ended.wait(60.0)

    with ThreadPoolExecutor(1) as pool:
        with one_blas_thread():
            other = pool.submit(block)
            assert begun.wait(60.0)
            if not longer:
                ended.set()
                other.result()
            assert set(threads().values()) == {1}
        ended.set()
        other.result()
    assert threads() == before


def test_ipopt_uses_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def look(watch: _Watch, _: Any) -> list[int]:
        seen.extend(threads().values())
        return [0]

    monkeypatch.setattr(_Watch, "eval", look)
    x, price, prices = casadi.MX.sym("x", 2), casadi.MX.sym("price"), casadi.MX.sym("prices")
    ipopt = Ipopt(
        x, casadi.sumsqr(x), casadi.sum1(x), gradient=2.0 * x, jacobian=casadi.MX.ones(1, 2),
        hessian=(price, prices, 2.0 * price * casadi.MX.eye(2)), settings=SETTINGS,
    )  # fmt: skip
    found, _ = ipopt.solve(x0=[0.0, 0.0], lbg=1.0, ubg=1.0)
    np.testing.assert_allclose(np.array(found["x"]), 0.5)
    assert set(seen) == {1}


def test_identification_uses_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def look(*_: Any) -> None:
        seen.extend(threads().values())
        raise np.linalg.LinAlgError

    monkeypatch.setattr(Fitting, "solve", look)
    build = hs.RobotBuilder("pendulum")
    build.hinge("pivot", None, link="rod", mass=1.0, inertia=0.1, center_of_mass=(0, -1), torque=9)
    time = np.linspace(0.0, 1.0, 100)
    log = RobotLog(time, np.sin(time)[:, None], np.cos(time)[:, None])
    with pytest.raises(hs.SimulationError):
        hs.identify(build.build(), log, encoder_noise=1e-4)
    assert set(seen) == {1}
