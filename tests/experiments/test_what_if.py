"""What a report tries: its own advice works, and so does the search for a push and a slope."""

from __future__ import annotations

import dataclasses

import built_falls as falls
import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import first_cause
from heelstrike.analysis.diagnosis.changes import Change, Lever, changes
from heelstrike.experiments import what_if
from heelstrike.experiments.laws import bent_knees, gait_for, law_called

FIRST = {
    "ice": Lever.FRICTION,
    "pushed forwards": Lever.CONTROLLER,
    "pushed backwards": Lever.CONTROLLER,
    "bar": Lever.CONTROLLER,
    "step up": Lever.CONTROLLER,
    "step down": Lever.CONTROLLER,
    "weak motors": Lever.TORQUE_LIMIT,
    "wrong sign": Lever.CONTROLLER,
    "no torque": Lever.CONTROLLER,
    "not a number": Lever.CONTROLLER,
}


@pytest.mark.parametrize("name", falls.KNOWN)
def test_what_to_change_works_when_it_is_done(name: str) -> None:
    case, run = falls.KNOWN[name].case(), falls.run_of(name)
    fall = first_cause(run, walking.gait())
    assert fall is not None
    asked = changes(run, fall, walking.gait())
    assert asked[0].lever is FIRST[name]
    (tried,) = what_if.try_changes(case, asked)  # the first one does
    assert tried.lasted
    assert tried.change == asked[0]


@pytest.mark.slow
def test_knees_that_a_gait_keeps_bent_stay_so() -> None:
    """On point feet a gait is designed with bent knees, and designed again with them."""
    robot = hs.load_robot("rabbit")
    gait = gait_for(robot)
    ranges = bent_knees(robot, gait)
    assert sorted(ranges) == ["left_knee", "right_knee"]
    case = what_if.Case(robot=robot, gait=gait)
    other = what_if.changed(case, Change(Lever.GAIT_CLEARANCE, 1.2 * gait.clearance)).gait
    assert other.clearance == pytest.approx(1.2 * gait.clearance)
    assert bent_knees(robot, other) == ranges
    assert bent_knees(walking.bravo7(), walking.gait()) == {}


@pytest.mark.filterwarnings("error::heelstrike.ControllerWarning")
def test_a_law_that_raises_is_not_told_of_at_every_trial() -> None:
    class Raises:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            if t >= 0.05:
                raise ValueError("as always")
            return np.zeros(6)

    law = dataclasses.replace(
        what_if.PAPER, trial=lambda robot, gait: dataclasses.replace(
            what_if.PAPER.trial(robot, gait), controller=Raises()
        ),
    )  # fmt: skip
    case = falls.walk(law=law)
    assert case.run(on_error="stop").status is hs.sim.RunStatus.CONTROLLER_FAILED
    assert "not tried" in next(iter(what_if.try_disturbances(case))).outcome


def test_a_gait_that_lifts_the_foot_over_the_bar() -> None:
    case, run = falls.KNOWN["bar"].case(), falls.run_of("bar")
    fall = first_cause(run, walking.gait())
    assert fall is not None
    (higher,) = (c for c in changes(run, fall, walking.gait()) if c.lever is Lever.GAIT_CLEARANCE)
    assert higher.value == pytest.approx(0.065)
    (tried,) = what_if.try_changes(case, [higher])
    assert tried.lasted


def test_a_change_that_does_not_help_is_not_said_to() -> None:
    little = Change(Lever.FRICTION, 0.07)
    (tried,) = what_if.try_changes(falls.KNOWN["ice"].case(), [little])
    assert tried.lasted is False
    assert "slipped" in tried.outcome
    impossible = Change(Lever.GAIT_FRICTION, -1.0)
    (tried,) = what_if.try_changes(falls.walk(), [impossible])
    assert tried.lasted is None


def test_changes_are_made_where_they_are_meant() -> None:
    case = falls.weak(9.0)
    stronger = what_if.changed(case, Change(Lever.TORQUE_LIMIT, 12.0)).robot.model
    assert stronger.torque_upper.tolist() == [12.0] * 6
    assert stronger.torque_lower.tolist() == [-12.0] * 6
    ground = what_if.changed(case, Change(Lever.FRICTION, 0.9)).ground
    assert ground.model().friction.tolist() == [0.9]
    shorter = what_if.changed(case, Change(Lever.TIME_STEP, 2e-4)).method
    assert isinstance(shorter, hs.TimeStepping)
    assert shorter.step == 2e-4


def test_pushes_and_slopes_that_a_walk_withstands() -> None:
    """Computed torque next to nothing (some 5 N s, no slope), footstep feedback much."""
    plain = {each.what: each.outcome for each in what_if.try_disturbances(falls.walk())}
    assert list(plain) == list(what_if.TOLD.values())
    forwards, _, climb, descent = plain.values()
    assert 0.0 < float(forwards.split()[0]) < 10.0
    assert climb.startswith("none: ")
    assert descent.startswith("none: ")


def test_what_cannot_be_tried_says_why() -> None:
    (lost,) = what_if.try_disturbances(falls.KNOWN["ice"].case())
    assert lost.outcome == "not tried: undisturbed it does not walk on for 7 s"
    run = make_run(pendulum(), [0.0, 0.1])
    case = what_if.Case(robot=run.robot, gait=None)
    (tried,) = what_if.tried_beside(case, run)
    assert tried.lasted is None
    assert tried.outcome.startswith("not tried: ")


def test_a_law_that_steps_is_not_told_to() -> None:
    """Its record has where it would step."""
    push = [hs.Push("trunk", force=(2000.0, 0.0), start=1.0, duration=0.1)]
    run = dataclasses.replace(falls.walk(pushes=push), law=law_called("FootstepFeedback")).run()
    fall = first_cause(run, walking.gait())
    assert fall is not None
    assert Lever.CONTROLLER not in {each.lever for each in changes(run, fall, walking.gait())}
