"""One motion of each kind, as `benchmarks/motion_kinds.py` designed and kept it.

What judges it is MuJoCo's mechanics (`closing`): inverse dynamics, plastic impacts, and the motion
integrated phase by phase.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from closing import Mechanics, gap, gauss_times, held_rows, lacking, mechanics_of
from motion_kinds import FOLDER, HURDLE, KINDS, file_of, kept

import heelstrike as hs
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.gait.motion import optimize
from heelstrike.gait.motion.closing import Follower

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


@pytest.mark.parametrize("name", KINDS)
def test_the_design_knows_how_it_closes(name: str) -> None:
    """Its own estimate, made again; and as kept, of motions that were integrated when designed."""
    robot, motion, _ = loaded(name)
    missed = Follower(robot, motion).missed()
    assert missed < CLOSED
    if name in {"starting", "stopping", "stepping over", "run", "closed loops"}:
        assert motion.closes_to == pytest.approx(missed, abs=0.03 * CLOSED)


@pytest.mark.slow
@pytest.mark.parametrize("heavier", [1e-4, 1e-2])
@pytest.mark.parametrize("name", ["rolling", "limp"])
def test_motions_of_another_robot_do_not_close(name: str, heavier: float) -> None:
    """Where feet do not hold the trunk, its mass decides: by as much as MuJoCo says."""
    robot, motion, _ = loaded(name)
    mass = robot.model.mass.copy()
    mass[robot.joint_names.index("root_pitch")] *= 1.0 + heavier
    other = replace(robot, model=robot.model.replaced(mass=mass))
    missed = Follower(other, motion).missed()
    assert missed > 0.1 * heavier
    assert missed == pytest.approx(gap(mechanics_of(other, motion.slope), motion), rel=1e-4)


@pytest.mark.slow
def test_a_design_that_may_not_be_halved_tells_what_it_misses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = hs.load_robot("rabbit")
    phase = hs.ContactPhase("right_tibia", duration=0.6, pieces=4)
    monkeypatch.setattr(optimize, "MOST_HALVED", 4)
    with pytest.warns(hs.GaitWarning, match="misses the state"):
        motion = hs.optimize_motion(robot, [phase], distance=0.25)
    assert len(motion.phases[0].pieces) == 4
    assert 10.0 * CLOSED < motion.closes_to < 1e-4
    assert motion.closes_to == pytest.approx(Follower(robot, motion).missed(), rel=1e-6)
    assert motion.closes_to == pytest.approx(gap(mechanics_of(robot, 0.0), motion), rel=1e-3)


def test_closing_is_of_ends_only() -> None:
    """A knee that swings by 0.3 rad within a piece closes all the same; what it lacks tells."""
    robot, motion, mechanics = loaded("single support")
    (phase,) = motion.phases
    pieces, length = phase.pieces.copy(), np.diff(phase.breakpoints)[2]
    swing = 16.0 * 0.3 * np.array([0.0, 0.0, 1.0, -2.0, 1.0, 0.0]) / length ** np.arange(6)
    pieces[2, :, robot.joint_names.index("left_knee")] += swing
    bent = replace(motion, phases=(replace(phase, pieces=pieces),))
    assert Follower(robot, bent).missed() < CLOSED
    assert lacking(mechanics, bent) > 0.1 * robot.weight


@pytest.mark.slow
def test_soles_stay_above_the_obstacle() -> None:
    """All along them and at all times, to a tenth of a millimetre."""
    robot, motion, _ = loaded("stepping over")
    closest, share = [np.inf, np.inf], np.linspace(0.0, 1.0, 201)[:, None]
    for t in np.linspace(0.0, motion.duration, 5001):
        places = hs.dynamics.contact_positions(robot, motion.position(t))
        for foot in range(2):
            heel, toe = places[2 * foot : 2 * foot + 2]
            sole = (1.0 - share) * heel + share * toe
            over = np.abs(sole[:, 0] - HURDLE["place"]) <= HURDLE["half_width"]
            closest[foot] = min(closest[foot], sole[over, 1].min(initial=np.inf))
    for least in closest:
        assert HURDLE["height"] - 1e-4 < least < 1.1 * HURDLE["height"]


def over(hurdle: OwnConstraint, robot: hs.Robot, places: np.ndarray) -> float:
    """Least of what keeps contact points, (nc, 2), above an obstacle."""
    none = {name: casadi.SX(1, 1) for name in ("position", "velocity", "torque", "force")}
    now = Instant(motor_velocity=casadi.SX(1, 1), points=casadi.SX(casadi.DM(places)), **none)
    return float(np.array(casadi.DM(hurdle(now))).min())


@pytest.mark.slow
def test_a_sole_is_seen_wherever_it_is(bravo7: hs.Robot) -> None:
    """No place of it over the box is lower than it says: soles that tilt, stand upright or lie."""
    hurdle, rng = hs.over_obstacle(bravo7, **HURDLE), np.random.default_rng(5)
    low, high = (HURDLE["place"] + side * HURDLE["half_width"] for side in (-1.0, 1.0))
    share, seen = np.linspace(0.0, 1.0, 2001)[:, None], 0
    for k in range(400):
        heel = np.array([rng.uniform(-0.05, 0.35), rng.uniform(0.0, 0.2)])
        angle = 0.5 * np.pi * rng.integers(-2, 3) if k % 4 == 0 else rng.uniform(-np.pi, np.pi)
        toe = heel + 0.2 * np.array([np.cos(angle), np.sin(angle)])
        away = np.array([-5.0, 1.0])
        found = over(hurdle, bravo7, np.array([heel, toe, away, away]))
        sole = (1.0 - share) * heel + share * toe
        within = (sole[:, 0] >= low) & (sole[:, 0] <= high)
        if np.any(within):
            least = float(sole[within, 1].min()) - HURDLE["height"]
            seen += least < 0.0
            assert found <= least + 1e-12
        if sole[:, 1].min() > HURDLE["height"]:
            assert found > 0.0
    assert seen > 50


@pytest.mark.slow
def test_a_foot_away_from_the_obstacle_is_free(bravo7: hs.Robot) -> None:
    hurdle = hs.over_obstacle(bravo7, **HURDLE)
    ahead = np.array([[0.25, 0.0], [0.45, 0.0]])
    assert over(hurdle, bravo7, np.vstack([ahead, ahead - [0.4, 0.0]])) == pytest.approx(0.01)


def test_a_robot_without_feet_steps_over_nothing() -> None:
    build = hs.RobotBuilder("ball")
    build.floating_base("ball", (0.0, 1.0), mass=1.0, inertia=0.1)
    with pytest.raises(hs.GaitError, match="'ball' has no feet to keep above an obstacle"):
        hs.over_obstacle(build.build(), **HURDLE)


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
    robot, motion, mechanics = loaded("single support")
    longer = replace(motion, distance=motion.distance + 1e-6)
    assert gap(mechanics, longer) > 100.0 * CLOSED
    (phase,) = motion.phases
    less = replace(motion, phases=(replace(phase, force=0.999 * phase.force),))
    assert lacking(mechanics, less) > 1e-4 * robot.weight
