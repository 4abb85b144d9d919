"""Another process walks from the last engine on, until it is enough."""

from __future__ import annotations

import importlib.util
import multiprocessing
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import walking

from heelstrike.experiments.engine_comparison import two_processes
from heelstrike.experiments.engine_comparison.settings import DEFAULTS
from heelstrike.experiments.engine_comparison.two_processes import Work, another_process
from heelstrike.experiments.engine_comparison.whole import Part
from heelstrike.experiments.walk import Case

BEGINS = 300.0
"""Seconds within which its first row is there, compiled on a slow machine."""


def test_it_is_given_the_engines_backwards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[Work] = []

    class Threads:
        """As processes are begun, but here."""

        Event = staticmethod(threading.Event)

        @staticmethod
        def Process(*, target: Any, args: Any) -> threading.Thread:  # noqa: N802 - their name
            return threading.Thread(target=target, args=args)

    def fill(work: Work, enough: threading.Event) -> None:
        begun.append(work)
        enough.wait(BEGINS)

    monkeypatch.setattr(two_processes.multiprocessing, "get_context", lambda _: Threads)
    monkeypatch.setattr(two_processes, "_fill", fill)
    with another_process(Work((), ("mujoco", "ode", "bullet"), tmp_path)):
        pass
    assert [work.engines for work in begun] == [("bullet", "ode", "mujoco")]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("pybullet") is None, reason="needs pybullet")
def test_another_process_begins_with_the_last_engine(tmp_path: Path) -> None:
    gait = walking.gait()
    case = Case(robot=walking.bravo7(), gait=gait)
    part = Part("ComputedTorque", 1, step_sizes=(1e-3,), settings=(DEFAULTS,))
    work = Work(((part, case),), ("mujoco", "bullet"), tmp_path, quick=True)
    with another_process(work):
        end = time.monotonic() + BEGINS
        while not (rows := list(tmp_path.glob("*-defaults-*"))) and time.monotonic() < end:
            time.sleep(0.05)
    assert rows
    assert not multiprocessing.active_children()
    times = {file.name.split("-")[0]: file.stat().st_mtime for file in tmp_path.iterdir()}
    assert min(set(times) - {"heelstrike"}, key=times.__getitem__) == "bullet"
