"""How motions are made to close, what becomes of those that do not, and what is told of them."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from motion_kinds import KINDS, kept

import heelstrike as hs
from heelstrike.gait import MotionPhase
from heelstrike.gait.motion import motion as motions
from heelstrike.gait.motion import optimize
from heelstrike.gait.motion import program as programs
from heelstrike.gait.motion.closing import Follower
from heelstrike.gait.motion.guess import guess_of
from heelstrike.gait.motion.instant import MotionFunctions
from heelstrike.gait.motion.program import MotionProgram, looked_at
from heelstrike.gait.program import satisfied
from heelstrike.robot.loops import row_names

CLOSED = 1e-8
SKETCHY = 0.01  # m, rad, m/s, rad/s; rabbit's run on 2 + 2 pieces misses by 5e-4


def split(motion: hs.Motion, pieces: int) -> hs.Motion:
    """Return the same motion with a phase for every few pieces."""
    phases = []
    for phase in motion.phases:
        for k in range(0, len(phase.pieces), pieces):
            ends = phase.breakpoints[k : k + pieces + 1]
            mine = {"pieces": phase.pieces[k : k + pieces], "force": phase.force[k : k + pieces]}
            phases.append(replace(phase, breakpoints=ends - ends[0], **mine))
    return replace(motion, phases=tuple(phases))


def step(pieces: int) -> list[hs.ContactPhase]:
    return [hs.ContactPhase("right_foot", duration=0.7, pieces=pieces)]


def program_of(robot: hs.Robot, phases: list[hs.ContactPhase], **more: Any) -> MotionProgram:
    asked = {
        "repeat": "mirrored", "distance": 0.3, "duration": None, "speed": None, "start": None,
        "end": None, "friction": 0.75, "clearance": 0.03, "slope": 0.0, "cost": "torque",
        "force_margin": 0.0, "landing_speed": 0.0, **more,
    }  # fmt: skip
    request = optimize.checked_request(robot, phases, **asked)
    functions = MotionFunctions(robot, request.cost, per_metre=False)
    return MotionProgram(request, functions, tuple(looked_at(each.pieces) for each in phases))


def pieces_of(motion: hs.Motion) -> list[int]:
    return [len(phase.pieces) for phase in motion.phases]


def test_a_motion_closes_however_its_duration_is_summed_up(monkeypatch: Any) -> None:
    """Since Python 3.12, `sum` rounds once; that may be an instant after the last phase ends."""
    monkeypatch.setattr(motions, "sum", math.fsum, raising=False)
    robot = hs.load_robot("rabbit")
    many = split(kept("run", robot), 4)
    assert many.ends[-1] < math.fsum(phase.duration for phase in many.phases)
    assert many.duration == many.ends[-1]
    first = many.phases[0].coordinates(0.0, order=1)
    image = many.mirror_sign * first[many.mirror_joint]
    np.testing.assert_array_equal(many.velocity(many.duration), image)
    follower = Follower(robot, many)
    assert follower.missed() < CLOSED
    assert follower.missed_by_phases().max() < CLOSED


def test_two_feet_on_straight_legs_are_followed(bravo7: hs.Robot) -> None:
    """What holds one foot follows from what holds the other, so that its force is any."""
    rising = kept("standing up", bravo7)
    state = bravo7.reference_state()
    (phase,) = rising.phases
    still = np.zeros_like(phase.pieces)
    still[:, 0] = state.q
    rows = np.vstack(optimize._ground_rows(bravo7, state.q, np.array([1.0, 0.0])))
    assert np.linalg.matrix_rank(rows, tol=1e-9) < 6
    rests = replace(
        rising, phases=(replace(phase, pieces=still),), initial_state=hs.State(state.q, state.v)
    )
    assert Follower(bravo7, rests).missed() < CLOSED


def test_what_cannot_be_integrated_is_infinitely_far(bravo7: hs.Robot) -> None:
    motion = kept("single support", bravo7)
    (phase,) = motion.phases
    wild = replace(motion, phases=(replace(phase, pieces=1e160 * phase.pieces),))
    assert Follower(bravo7, wild).missed() == np.inf


def run(pieces: int) -> list[hs.ContactPhase]:
    return [
        hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=pieces),
        hs.ContactPhase(duration=(0.05, 0.3), pieces=pieces),
    ]


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Motions that slip are not refined for that."""
    monkeypatch.setattr(optimize, "STILL", np.inf)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("why", ["at the limit of pieces", "no motion on more pieces"])
def test_one_that_does_not_close_is_told(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its closes_to is by how much it misses, and it is the last one that was found."""

    failed = list[bool]()

    def fails(*_: Any) -> None:
        failed.append(True)
        raise hs.GaitNotFoundError("no such motion")

    if why == "at the limit of pieces":
        monkeypatch.setattr(optimize, "MOST_HALVED", 2)
    else:
        monkeypatch.setattr(optimize, "_on_halves", fails)
    rabbit = hs.load_robot("rabbit")
    with pytest.warns(hs.GaitWarning, match="misses the state in which it goes on"):
        motion = hs.optimize_motion(rabbit, run(2), speed=2.0, starts=1)
    assert pieces_of(motion) == [2, 2]
    assert CLOSED < motion.closes_to < SKETCHY
    assert motion.closes_to == pytest.approx(Follower(rabbit, motion).missed(), rel=1e-6)
    assert len(failed) == (why != "at the limit of pieces")


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_progress_goes_on_while_it_is_made_to_close(recwarn: pytest.WarningsRecorder) -> None:
    told: list[float] = []
    rabbit = hs.load_robot("rabbit")
    motion = hs.optimize_motion(rabbit, run(4), speed=2.0, starts=1, progress=told.append)
    assert motion.closes_to < CLOSED
    assert not [each for each in recwarn if issubclass(each.category, hs.GaitWarning)]
    halved = int(np.log2(max(pieces_of(motion)) / 4))
    assert halved >= 1
    assert sum(0.8 < each < 1.0 for each in told) > halved
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_instants_are_added_once() -> None:
    program = program_of(hs.load_robot("rabbit"), run(2), distance=(0.0, 2.0), speed=2.0)
    unknowns = guess_of(program, lean=0.0, lowered=0.95)
    unknowns += 0.1 * np.random.default_rng(0).standard_normal(unknowns.size)
    finer = optimize._with_failing(program, unknowns)
    assert finer is not None
    again = optimize._with_failing(finer, unknowns)
    for grid in (again or finer).grids:
        instants = list(zip(grid.piece.tolist(), grid.share.tolist(), strict=True))
        assert len(instants) == len(set(instants))


def test_each_phase_has_a_limit_of_pieces_of_its_own(monkeypatch: Any) -> None:
    monkeypatch.setattr(optimize, "MOST_HALVED", 8)
    phases = [
        hs.ContactPhase("right_tibia", duration=0.2, pieces=6),
        hs.ContactPhase(duration=0.1, pieces=3),
    ]
    program = program_of(hs.load_robot("rabbit"), phases)
    finer = optimize._halved(program, np.array([1.0, 0.5]))
    assert finer is not None
    assert [each.pieces for each in finer.request.phases] == [6, 6]
    assert optimize._halved(finer, np.array([1.0, 0.5])) is None


def test_polishing_that_breaks_limits_is_dropped(bravo7: hs.Robot, monkeypatch: Any) -> None:
    program = program_of(bravo7, [hs.ContactPhase("right_foot", duration=(0.5, 0.9), pieces=2)])
    given = guess_of(program, lean=0.0, lowered=0.9)
    given = np.clip(given, *program._bounds)
    longer = given.copy()
    longer[program._ends[7] - 1] = 0.9 + 3.0 * max(program.missing(given))
    assert program.missing(longer)[1] == pytest.approx(longer[program._ends[7] - 1] - 0.9)
    monkeypatch.setattr(programs, "satisfied", lambda *_: longer)
    np.testing.assert_array_equal(program.polished(given), given)


class Slopes:
    """A sparse matrix of derivatives, as CasADi returns one."""

    def __init__(self, row: list[float]) -> None:
        self.row = row

    def sparse(self) -> Any:
        return scipy.sparse.csc_matrix(np.array([self.row]))


def test_newton_returns_where_it_came_nearest() -> None:
    """Of the cube root it runs away, twice as far each time; the start is the nearest."""
    bounds, free = (np.zeros(1), np.zeros(1)), np.array([True])

    def slope(x: np.ndarray) -> Slopes:
        return Slopes([float(np.cbrt(x[0]) ** -2 / 3.0)])

    start = np.array([0.1])
    np.testing.assert_array_equal(satisfied(start, np.cbrt, slope, bounds, free), start)
    # It does what it can: x² = 2.
    root = satisfied(
        start + 1.0, lambda x: x**2 - 2.0, lambda x: Slopes([2.0 * x[0]]), bounds, free
    )
    assert root[0] == pytest.approx(np.sqrt(2.0), rel=1e-15)


def test_newton_stops_where_it_is_singular(monkeypatch: Any) -> None:
    def fails(_: Any) -> None:
        raise RuntimeError("Factor is exactly singular")

    monkeypatch.setattr(scipy.sparse.linalg, "splu", fails)
    start, nothing = np.array([0.1]), (np.zeros(1), np.zeros(1))
    found = satisfied(start, np.cbrt, lambda _: Slopes([1.0]), nothing, np.array([True]))
    np.testing.assert_array_equal(found, start)


def test_a_dearer_motion_replaces_no_sketch(bravo7: hs.Robot, monkeypatch: Any) -> None:
    """Of two that are no optima, the cheaper one is kept, whichever it is."""
    program = program_of(bravo7, step(2), cost="mechanical_energy")
    cheap, dear = (
        program.counted(guess_of(program, lean=lean, lowered=0.9)) for lean in (0.0, 0.3)
    )
    spent = [float(program.value(each)[0]) for each in (cheap, dear)]
    if spent[0] > spent[1]:
        cheap, dear = dear, cheap
    assert spent[0] != spent[1]
    for sketch, exact, optimal, kept_one in (
        (cheap, dear, False, cheap), (dear, cheap, False, cheap), (cheap, dear, True, dear),
    ):  # fmt: skip
        sketched = optimize._Found(program, sketch, None, True)
        solved = optimize._Found(program, exact, None, optimal)
        monkeypatch.setattr(optimize, "_solved", lambda *_, found=sketched: found)
        monkeypatch.setattr(optimize, "_resampled", lambda _, unknowns, __: unknowns)
        monkeypatch.setattr(optimize, "_again", lambda *_, found=solved: found)
        found = optimize._solved_to_corners(program, None, 1, lambda _: None)
        np.testing.assert_array_equal(found.unknowns, kept_one)


def test_velocities_that_open_a_loop_are_refused() -> None:
    robot = KINDS["closed loops"].robot()
    motion = kept("closed loops", robot)
    start = motion.initial_state
    v = start.v.copy()
    v[robot.joint_names.index("right_motor")] += 5.0
    with pytest.raises(hs.GaitError, match=r"at the start the loop .* opens at .* m per s"):
        hs.optimize_motion(
            robot, [hs.ContactPhase("right_ankle", duration=0.6)], repeat="never",
            start=hs.State(start.q, v),
        )  # fmt: skip


def test_coupled_joints_are_called_so() -> None:
    build = hs.RobotBuilder("geared")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=1.0, inertia=0.1)
    hip = build.hinge("hip", trunk, mass=1.0, inertia=0.1, torque=10.0)
    knee = build.hinge("knee", hip, at=(0.0, -0.5), mass=1.0, inertia=0.1)
    build.contact(knee, (0.0, -0.5))
    build.couple("knee", "hip", [0.0, 2.0])
    robot = build.build()
    assert row_names(robot) == ["coupling of knee"]
    state = robot.reference_state()
    for q, v, said in (
        (0.3, 0.0, r"coupling of knee is open by 0\.3 rad or m"),
        (0.0, 0.3, r"coupling of knee opens at 0\.3 rad or m per s"),
    ):
        place = robot.joint_names.index("knee")
        given = hs.State(state.q.copy(), state.v.copy())
        given.q[place] += q
        given.v[place] += v
        with pytest.raises(hs.GaitError, match=said):
            hs.optimize_motion(robot, [hs.ContactPhase(duration=0.6)], repeat="never", start=given)


@pytest.mark.parametrize("closes_to", [np.inf, 3e-9, np.nan])
def test_files_keep_how_nearly_it_closes(
    closes_to: float, bravo7: hs.Robot, tmp_path: Path
) -> None:
    motion = replace(kept("single support", bravo7), closes_to=closes_to)
    motion.save(tmp_path / "motion.json")
    assert repr(hs.load_motion(tmp_path / "motion.json").closes_to) == repr(closes_to)


def test_files_keep_forces_of_loops(tmp_path: Path) -> None:
    """Under names that claim no unit; a motion kept under the former names is read, too."""
    robot = KINDS["closed loops"].robot()
    motion = kept("closed loops", robot)
    path = tmp_path / "motion.json"
    motion.save(path)
    text = path.read_text()
    assert '"loop_force": ' in text
    assert "loop_force_N" not in text
    again = hs.load_motion(path, robot)
    for one, other in zip(motion.phases, again.phases, strict=True):
        np.testing.assert_array_equal(one.loop_force, other.loop_force)
        np.testing.assert_array_equal(one.loop_impulse, other.loop_impulse)


@pytest.mark.parametrize(
    ("shape", "said"),
    [((6, 3, 4), '"loop_force" must hold lists of 4 numbers'), ((6, 4, 3), "has 3 rows where 4")],
)
def test_forces_of_loops_have_their_shapes(
    shape: tuple[int, int, int], said: str, tmp_path: Path
) -> None:
    robot = KINDS["closed loops"].robot()
    motion = kept("closed loops", robot)
    (phase,) = motion.phases
    assert phase.loop_force.shape == (6, 4, 4)
    other = replace(phase, loop_force=np.ones(shape), loop_impulse=np.ones(shape[2]))
    replace(motion, phases=(other,)).save(tmp_path / "motion.json")
    with pytest.raises(hs.GaitError, match=said):
        hs.load_motion(tmp_path / "motion.json", robot)


def test_phases_that_were_pickled_before_know_no_loops(bravo7: hs.Robot) -> None:
    (phase,) = kept("single support", bravo7).phases
    state = {name: value for name, value in vars(phase).items() if not name.startswith("loop_")}
    old = MotionPhase.__new__(MotionPhase)
    old.__setstate__(state)
    assert old.loop_forces(0.1).size == 0
    assert old.loop_impulse.size == 0
    again = pickle.loads(pickle.dumps(phase))
    np.testing.assert_array_equal(again.pieces, phase.pieces)
