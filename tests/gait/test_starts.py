"""Steps that the optimiser starts from."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.experiments.walk import typical_step
from heelstrike.gait.optimize import request_of
from heelstrike.gait.program import Program, first_instants
from heelstrike.gait.starts import starts
from heelstrike.gait.transcription import Group, transcribed

IN_PLACE = 0.02  # m, rad


def program_of(name: str) -> Program:
    robot = hs.load_robot(name)
    step = typical_step(robot)
    asked = request_of(
        robot, step_length=step.length, step_duration=step.duration, clearance=step.clearance
    )
    return Program(asked, transcribed(asked), asked.profiles[0], *first_instants(asked))


@pytest.mark.parametrize("name", ["bravo7", "walker2d"])
def test_feet_are_in_their_places_where_hips_do_not_bend_backwards(name: str) -> None:
    """walker2d's hips bend forwards only, so that its trunk has to lean."""
    asked = program_of(name)
    places = [
        k
        for k, (row, _) in enumerate(asked.labelled_rows())
        if row.kind in {Group.TOUCHDOWN_PLACE, Group.TOUCHDOWN_ANGLE}
    ]
    for start in islice(starts(asked.request), 3):
        missing = asked.violations(asked.sampled(start))[places]
        assert np.abs(missing).max() < IN_PLACE
        joints = np.stack([start.begin, start.middle, start.end])
        free = asked.transcription.free
        assert np.all(joints >= asked.request.lower[free])
        assert np.all(joints <= asked.request.upper[free])
