"""Another process walks from the last engine on, until it is enough."""

from __future__ import annotations

import importlib.util
import multiprocessing
import time
from pathlib import Path

import pytest
import walking

from heelstrike.experiments.engine_comparison.settings import DEFAULTS
from heelstrike.experiments.engine_comparison.two_processes import Work, another_process
from heelstrike.experiments.engine_comparison.whole import Part
from heelstrike.experiments.walk import Case

BEGINS = 300.0
"""Seconds within which its first row is there, compiled on a slow machine."""


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
