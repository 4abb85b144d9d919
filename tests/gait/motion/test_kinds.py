"""One motion of each kind, as `benchmarks/motion_kinds.py` designed and kept it.

What judges it is MuJoCo's mechanics (`closing`): inverse dynamics, plastic impacts, and the motion
integrated phase by phase.
"""

from __future__ import annotations

import numpy as np
import pytest
from closing import Mechanics, gap, gauss_times, held_rows, lacking, mechanics_of
from motion_kinds import FOLDER, HURDLE, KINDS, file_of, kept

import heelstrike as hs

CLOSED = 1e-8
SMALL = (
    1e-5  # of the weight, or m, that a limit may be missed by between the instants it is held at
)
RELAXED = 1.1e-8  # s; IPOPT relaxes bounds by 1e-8
QUICK = ("single support", "standing up")  # the others are left to `make test`


def loaded(name: str) -> tuple[hs.Robot, hs.Motion, Mechanics]:
    robot = KINDS[name].robot()
    motion = kept(name, robot)
    return robot, motion, mechanics_of(robot, motion.slope)


def test_every_kind_is_kept() -> None:
    assert {each.name for each in FOLDER.iterdir()} == {file_of(name).name for name in KINDS}


@pytest.mark.parametrize("name", KINDS)
def test_it_is_what_was_asked_for(name: str) -> None:
    robot, motion, _ = loaded(name)
    kind = KINDS[name]
    for phase, asked in zip(motion.phases, kind.phases, strict=True):
        low, high = asked.duration
        assert low - RELAXED <= phase.duration <= high + RELAXED
        named = {foot.name: foot.contacts for foot in robot.feet}
        points = [named.get(each) or (robot.contact_names.index(each),) for each in asked.contacts]
        wanted = {robot.contact_names[i] for contacts in points for i in contacts}
        assert set(phase.contacts) == wanted
    if not callable(kind.asked):
        for key in {"distance", "duration", "speed", "slope"} & set(kind.asked):
            assert getattr(motion, key) == pytest.approx(kind.asked[key], rel=1e-9)


@pytest.mark.parametrize("name", KINDS)
def test_nothing_is_lacking(name: str) -> None:
    """What trunk and passive joints need, the ground gives: to rounding."""
    robot, motion, mechanics = loaded(name)
    assert lacking(mechanics, motion) < 1e-8 * robot.weight


@pytest.mark.parametrize("name", KINDS)
def test_the_ground_pushes_in_its_cone(name: str) -> None:
    """Of forces at all times, and of the impulses of landings."""
    robot, motion, _ = loaded(name)
    for phase in motion.phases:
        allowed = SMALL * robot.weight
        for pushed in (phase.forces(np.linspace(0.0, phase.duration, 100)), phase.impulse[None]):
            assert pushed[..., 0].min() > -allowed
            for foot in robot.feet:
                normal, tangent = pushed[:, list(foot.contacts)].sum(axis=1).T
                assert np.all(np.abs(tangent) <= motion.friction * normal + allowed)


@pytest.mark.parametrize("name", KINDS)
def test_what_stands_rests(name: str) -> None:
    """Velocities of contact points by MuJoCo's Jacobians, between the instants held at, too."""
    _, motion, mechanics = loaded(name)
    for phase in motion.phases:
        held = held_rows(mechanics.robot, phase)
        for t in np.linspace(0.0, phase.duration, 20):
            q, v = (phase.coordinates(t, order=order) for order in range(2))
            now = mechanics.at(q, v)
            moving = now.jacobian @ v
            assert max((abs(moving[row]) for row in held), default=0.0) < 1e-3
            assert np.abs(now.tied @ v).max(initial=0.0) < 1e-3


@pytest.mark.parametrize(
    "name",
    [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in KINDS],
)
def test_it_closes(name: str) -> None:
    """Followed by computed torque, it ends where it goes on: after the last landing, if it has."""
    _, motion, mechanics = loaded(name)
    assert gap(mechanics, motion) < CLOSED


def test_the_design_knows_how_it_closes() -> None:
    """Its own estimate, of every motion that was integrated when it was designed."""
    known = []
    for name in KINDS:
        _, motion, _ = loaded(name)
        if np.isfinite(motion.closes_to):
            known.append(name)
            assert motion.closes_to < CLOSED
    assert {"starting", "stopping", "stepping over", "run", "closed loops"} <= set(known)


def test_soles_stay_above_the_obstacle() -> None:
    """All along them and at all times they clear a box of 9 cm, of the 10 that are asked for.

    The design looks at five places of each at instants some 7 ms apart.
    """
    robot, motion, _ = loaded("stepping over")
    closest, share = [np.inf, np.inf], np.linspace(0.0, 1.0, 101)[:, None]
    for t in np.linspace(0.0, motion.duration, 2000):
        places = hs.dynamics.contact_positions(robot, motion.position(t))
        for foot in range(2):
            heel, toe = places[2 * foot : 2 * foot + 2]
            sole = (1.0 - share) * heel + share * toe
            over = np.abs(sole[:, 0] - HURDLE["place"]) <= HURDLE["half_width"]
            closest[foot] = min(closest[foot], sole[over, 1].min(initial=np.inf))
    for least in closest:
        assert HURDLE["height"] - 0.01 < least < 2.0 * HURDLE["height"]


@pytest.mark.parametrize("wrong", [{"height": 0.0}, {"half_width": -1.0}, {"place": np.nan}])
def test_obstacles_that_are_none(wrong: dict[str, float]) -> None:
    robot = hs.load_robot("bravo7")
    with pytest.raises(hs.GaitError, match="of an obstacle must be"):
        hs.over_obstacle(robot, **{**HURDLE, **wrong})


def test_forces_of_loops_are_told() -> None:
    """They are what the joints without a motor need, by MuJoCo's rows; and are kept in the file."""
    robot, motion, mechanics = loaded("closed loops")
    free = np.setdiff1d(np.arange(robot.nv), robot.model.actuator_joint)
    (phase,) = motion.phases
    for t in gauss_times(phase).ravel()[::5]:
        q, v, a = (phase.coordinates(t, order=order) for order in range(3))
        now, pushed = mechanics.at(q, v), phase.forces(t)
        lacks = now.mass @ a + now.force - np.einsum("ikj,ik->j", now.jacobian, pushed)
        lacks -= hs.dynamics.loop_jacobian(robot, q).T @ phase.loop_forces(t)
        assert np.abs(lacks[free]).max() < 1e-8 * robot.weight
    assert np.abs(phase.loop_force).max() > 1.0


def test_laws_refuse_motions_with_loops() -> None:
    robot, motion, _ = loaded("closed loops")
    with pytest.raises(hs.HeelstrikeError, match="a law that follows a motion knows robots"):
        hs.MotionTracking(robot, motion)


def test_a_motion_that_does_not_repeat_is_seen() -> None:
    """The judge can say no: by a wrong distance, and by a force too little."""
    from dataclasses import replace

    robot, motion, mechanics = loaded("single support")
    longer = replace(motion, distance=motion.distance + 1e-6)
    assert gap(mechanics, longer) > 100.0 * CLOSED
    (phase,) = motion.phases
    less = replace(motion, phases=(replace(phase, force=0.999 * phase.force),))
    assert lacking(mechanics, less) > 1e-4 * robot.weight
