"""Ranges of joints that are asked of a gait, narrower than the robot's own."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait.request import ranges_kept

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

STEP = {"step_length": 0.3, "step_duration": 0.7, "starts": 1}


@pytest.mark.parametrize("feet", ["flat", "points"])
def test_a_gait_keeps_to_what_is_asked_at_all_times(feet: str, gait: hs.Gait) -> None:
    """Asked of the right knee alone, a little less than it takes freely, both legs keep to it."""
    step: dict[str, float] = {"step_length": 0.30, "step_duration": 0.70}
    if feet == "points":
        step = {"step_length": 0.25, "step_duration": 0.60, "clearance": 0.02, "friction": 0.6}
    robot = hs.load_robot("bravo7" if feet == "flat" else "rabbit")
    free = gait if feet == "flat" else hs.optimize_gait(robot, **step, starts=1)
    times = np.linspace(0.0, free.step_duration, 5001)
    knees = [k for k, name in enumerate(free.joint_names) if "knee" in name]

    def span(found: hs.Gait) -> tuple[float, float]:
        angles = found.in_step(times)[:, knees]
        return float(angles.min()), float(angles.max())

    low, high = span(free)
    asked = (low + 0.1 * (high - low), high - 0.1 * (high - low))
    right = free.joint_names[knees[0]]
    assert right == "right_knee"
    kept = hs.optimize_gait(robot, **step, starts=1, joint_ranges={right: asked})
    assert asked[0] <= span(kept)[0]
    assert span(kept)[1] <= asked[1]
    assert 0.0 <= kept.margins.joint_range <= 0.01
    assert kept.cost > free.cost


def test_a_counterpart_that_turns_the_other_way_gets_the_mirrored_range() -> None:
    robot = hs.load_robot("bravo7")
    names = robot.joint_names
    right, left = names.index("right_knee"), names.index("left_knee")
    mirror = robot.mirror
    assert mirror is not None
    sign = mirror.sign.copy()
    sign[[right, left]] = -1.0
    reference = robot.model.reference.copy()
    reference[[right, left]] = 0.5, -0.2
    turned = dataclasses.replace(
        robot,
        mirror=dataclasses.replace(mirror, sign=sign),
        model=robot.model.replaced(
            reference=reference,
            lower=np.full(robot.nv, -3.0),
            upper=np.full(robot.nv, 3.0),
        ),
    )
    assert turned.mirror is not None
    lower, upper = ranges_kept(turned, turned.mirror, {"right_knee": (0.4, 1.5)})
    assert (lower[right], upper[right]) == (0.4, 1.5)
    # 0.1 below and 1.0 above the right one's reference: 0.1 above and 1.0 below the left one's.
    assert (lower[left], upper[left]) == pytest.approx((-1.2, -0.1))
    others = np.delete(np.arange(robot.nv), [right, left])
    assert np.all(lower[others] == -3.0)
    assert np.all(upper[others] == 3.0)


def test_an_infinite_end_leaves_the_robot_s_own() -> None:
    robot = hs.load_robot("bravo7")
    knee = robot.joint_names.index("right_knee")
    model = robot.model.replaced(lower=np.full(robot.nv, -0.5), upper=np.full(robot.nv, 2.0))
    assert robot.mirror is not None
    lower, upper = ranges_kept(
        dataclasses.replace(robot, model=model), robot.mirror, {"right_knee": (-np.inf, 1.0)}
    )
    assert (lower[knee], upper[knee]) == (-0.5, 1.0)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"knee": (0.0, 1.0)}, "has no joint 'knee'; its joints are .*right_knee"),
        ({"root_x": (0.0, 1.0)}, "has no joint 'root_x'"),
        ({"right_knee": 1.0}, "'right_knee' needs its lowest and highest position"),
        ({"right_knee": (1.0, 0.0)}, "in rising order .* got (1.0, 0.0)"),
        ({"right_knee": (0.0, np.nan)}, "in rising order"),
        ({"right_knee": ("a", "b")}, "two numbers"),
        ({"right_knee": (0.0, 1.0, 2.0)}, "two numbers"),
        ({"right_knee": (30.0, 31.0)}, "'right_knee' from 30 to 31 has no part in the range"),
        (
            {"right_knee": (0.1, 0.2), "left_knee": (0.3, 0.4)},
            "'left_knee' from 0.3 to 0.4 has no part in the range .* its counterpart",
        ),
        (["right_knee"], "must give ranges by the names of joints"),
    ],
)
def test_what_makes_no_sense_is_told(asked: object, said: str) -> None:
    with pytest.raises(GaitError) as caught:
        hs.optimize_gait(hs.load_robot("bravo7"), **STEP, joint_ranges=asked)
    assert re.search(said.replace("(", r"\(").replace(")", r"\)"), str(caught.value))
