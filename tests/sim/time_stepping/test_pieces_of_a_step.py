"""Pieces of a time step, each by hand: who takes part, free terms, matrices, what is called again.

Kernels run as plain Python here, some with a script in the place of what they call.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from every_row import ARM, HIP, KNEE, ROBOT, ROWS, STOPS, memory_of

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import RAY, SOLVED, STICK
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.workspace import contact_problem
from heelstrike.errors import SimulationError
from heelstrike.sim import Scheme
from heelstrike.sim.contacts.candidates import Listing
from heelstrike.sim.contacts.rows import CONSTRAINT, SECOND_FACE, STOP
from heelstrike.sim.memory import allocate_memory
from heelstrike.sim.time_stepping import method as its
from heelstrike.sim.time_stepping.impact import NEVER, allocate_impact
from heelstrike.sim.time_stepping.method import Rule

STEP = 0.01
"""Speeds of 5 m/s and 20 rad/s reach 5 cm and 0.2 rad in it; nothing beyond 1 m is looked at."""
LINEARISED = (Scheme.GAP_LINEARISED, Scheme.LINEARLY_IMPLICIT, Scheme.IMPACT_RESOLVED)


def rule(scheme: Scheme, *, activation: float = 0.0, calls: int = 0, relaxed: int = 0) -> Rule:
    return Rule(STEP, int(scheme), activation, calls, relaxed)


def listing(entries: int, rows: int = 2) -> Listing:
    """Room for some entries of two rows each, with friction 0.5 and mode 1."""
    size = entries + 2
    return Listing(
        np.zeros(size, int), np.full(size, 0.5), np.ones(size, int), np.full(size, 77),
        np.full(size, 77), contact_problem(size, free=np.full(rows * size, 77.0)),
    )  # fmt: skip


# Contact points.


def selected(
    scheme: Scheme, gap: list[float], normal: list[float], *, before: list[float] | None = None,
    restitution: float = 0.5, curvature: float = 0.0, called: list[int] | None = None,
    **options: Any,
) -> tuple[list[int], list[float], list[float]]:  # fmt: skip
    """Which points take part, and their normal free terms and bounces; tangents are 0.1, 0.2, …"""
    count, nothing = len(gap), np.zeros(len(gap))
    places = listing(count)
    contacts = SimpleNamespace(gap=np.array(gap))
    usual = SimpleNamespace(point_velocity=np.full((count, 2), np.nan))

    def find(model: Any, given: Any, v: Any, straight: bool, tree: Any, its_usual: Any) -> None:
        assert (given, v, straight) == (contacts, "next v", True)
        usual.point_velocity[:, 0], usual.point_velocity[:, 1] = (
            normal,
            0.1 * np.arange(1, count + 1),
        )

    speeds = nothing if before is None else before
    select = uncompiled(
        its.select_candidates,
        replace={
            its.are_usual: lambda *_: True, its.find_velocities: find,
            its.curvature_acceleration: lambda _, __, ___, contact, bend: bend * (contact + 1),
            its.contact_velocity: lambda _, __, ___, contact: (speeds[contact], 9.0),
        },
    )  # fmt: skip
    bounce = np.full(count + 1, 77.0)
    surface = SimpleNamespace(
        restitution=np.full(count, restitution), curvature=np.full(count, curvature)
    )
    found = select(
        SimpleNamespace(nc=count), curvature != 0.0, rule(scheme, **options), contacts, surface,
        "next v", np.array(called or nothing), None, usual, bounce, places,
    )  # fmt: skip
    free, candidate = places.problem.free, places.candidate[:found].tolist()
    np.testing.assert_allclose(free[1 : 2 * found : 2], [0.1 * (each + 1) for each in candidate])
    assert np.diff(places.problem.first[: found + 1]).tolist() == [2] * found
    return candidate, free[0 : 2 * found : 2].tolist(), bounce[:found].tolist()


@pytest.mark.parametrize("scheme", LINEARISED)
def test_points_take_part_that_could_come_down_within_the_step(scheme: Scheme) -> None:
    """At 5 m/s, or at twice their free speed; gaps over the step are in their free terms."""
    gaps = [0.04, 0.05, 0.051, 0.12, 0.12, 0.999, 1.001, -0.01]
    speeds = [0.0, 9.0, 9.0, -6.1, -5.9, -60.0, -60.0, 1.0]
    found, free, _ = selected(scheme, gaps, speeds)
    assert found == [0, 1, 3, 5, 7]
    np.testing.assert_allclose(free, [speeds[i] + gaps[i] / STEP for i in found])
    called = [0, 0, 1, 0, 1, 0, 1, 0]
    assert selected(scheme, gaps, speeds, called=called, calls=2)[0] == [0, 1, 2, 3, 4, 5, 7]
    assert selected(scheme, gaps, speeds, called=called)[0] == [0, 1, 3, 5, 7]
    assert selected(scheme, [2.0, 1.1], [-900.0, -900.0])[0] == []


def test_on_curved_ground_half_of_what_turns_is_in_a_rate() -> None:
    """½ h κ v² more, which may bring a point near; other schemes look at the gap as it is."""
    found, free, _ = selected(
        Scheme.IMPACT_RESOLVED, [0.0, 0.06, 0.01], [0.0, -2.9, 1.0], curvature=-20.0
    )
    assert found == [0, 1, 2]
    np.testing.assert_allclose(free, [-0.1, -2.9 - 0.2 + 6.0, 1.0 - 0.3 + 1.0])
    assert selected(Scheme.IMPACT_RESOLVED, [0.0, 0.06, 0.01], [0.0, -2.9, 1.0])[0] == [0, 2]
    _, free, _ = selected(Scheme.PAPER_SYMPLECTIC, [0.0], [0.3], curvature=-20.0)
    assert free == [0.3]


@pytest.mark.parametrize("scheme", [Scheme.PAPER_EXPLICIT, Scheme.PAPER_SYMPLECTIC])
def test_the_paper_s_schemes_decide_by_the_gap_alone(scheme: Scheme) -> None:
    found, free, _ = selected(
        scheme, [0.0, 0.001, 0.0011, -0.1], [1.0, 2.0, 3.0, 4.0], activation=0.001
    )
    assert (found, free) == ([0, 1, 3], [1.0, 2.0, 4.0])
    assert selected(scheme, [1e-9, -1e-9], [0.0, 0.0])[0] == [1]


def test_moreau_and_jean_decide_in_the_middle_of_the_step_and_bounce() -> None:
    gaps, before = [0.02, 0.02, 0.02, 0.3], [-4.2, -4.0, -3.6, -70.0]
    found, free, bounce = selected(
        Scheme.MOREAU_JEAN, gaps, [1.0, 2.0, 3.0, 4.0], before=before, activation=0.001
    )
    assert found == [0, 1, 3]
    np.testing.assert_allclose(bounce, [-2.1, -2.0, -35.0])
    np.testing.assert_allclose(free, [1.0 - 2.1, 2.0 - 2.0, 4.0 - 35.0])
    found, free, bounce = selected(
        Scheme.MOREAU_JEAN, gaps, [1.0, 2.0, 3.0, 4.0], before=before, relaxed=1
    )
    assert (found, free, bounce) == ([0, 1, 3], [1.0, 2.0, 4.0], [77.0] * 3)


# Joint stops.


def stopped(
    scheme: Scheme, q: dict[int, float], next_v: dict[int, float], *,
    v: dict[int, float] | None = None, called: tuple[int, ...] = (), **options: Any,
) -> tuple[list[int], list[float]]:  # fmt: skip
    """Which stops take part, and their free terms, behind one candidate of two rows."""
    memory = memory_of()
    places = Listing(
        memory.rows.set, np.zeros(99), np.zeros(99, int), memory.assembly.candidate,
        memory.assembly.answer.mode, memory.assembly.problem,
    )  # fmt: skip
    places.problem.first[1] = 2

    def full(values: dict[int, float] | None) -> Any:
        vector = np.zeros(ROBOT.nv)
        for joint, value in (values or {}).items():
            vector[joint] = value
        return vector

    calls = np.zeros(len(ROWS.kind), int)
    calls[list(called)] = 1
    found = uncompiled(its.select_stops)(
        ROBOT.model, rule(scheme, **options), 1, full(q), full(v), full(next_v), calls, memory.rows,
        places,
    )  # fmt: skip
    assert np.diff(places.problem.first[: found + 1]).tolist() == [2] + [1] * (found - 1)
    free = places.problem.free[2 : found + 1].tolist()
    return [int(each) - STOPS[0] for each in places.candidate[1:found]], free


@pytest.mark.parametrize("scheme", LINEARISED)
def test_stops_take_part_that_could_be_reached_within_the_step(scheme: Scheme) -> None:
    """Of hip ≥ −1, −2 ≤ knee ≤ 0.5 and arm ≤ 3: at 20 rad/s, or at twice their free rate."""
    assert stopped(scheme, {}, {}) == ([], [])
    found, free = stopped(scheme, {HIP: -0.81}, {HIP: 3.0})
    assert (found, free) == ([0], pytest.approx([3.0 + 0.19 / STEP]))
    assert stopped(scheme, {HIP: -0.8 + 1e-9}, {HIP: -9.0})[0] == []
    found, free = stopped(scheme, {KNEE: 0.31}, {KNEE: 3.0})
    assert (found, free) == ([2], pytest.approx([-3.0 + 0.19 / STEP]))
    found, free = stopped(scheme, {KNEE: -1.5}, {KNEE: -26.0})
    assert (found, free) == ([1], pytest.approx([-26.0 + 0.5 / STEP]))
    assert stopped(scheme, {KNEE: -1.5}, {KNEE: -24.0})[0] == []
    assert stopped(scheme, {KNEE: -1.5}, {KNEE: 26.0})[0] == []
    found, free = stopped(scheme, {ARM: 3.1}, {ARM: -1.0})
    assert (found, free) == ([3], pytest.approx([1.0 - 0.1 / STEP]))
    # Called ones, too, and whoever is near beside them.
    assert stopped(scheme, {}, {}, called=(STOPS[1], STOPS[3]), calls=2)[0] == [1, 3]
    assert stopped(scheme, {}, {}, called=(STOPS[1],))[0] == []
    assert stopped(scheme, {HIP: -0.9}, {}, called=(STOPS[1],), calls=1)[0] == [0, 1]
    assert stopped(scheme, {HIP: -0.9}, {}, called=(STOPS[1],))[0] == [0]


def test_stops_of_other_schemes_go_by_the_gap() -> None:
    scheme = Scheme.PAPER_EXPLICIT
    found, free = stopped(scheme, {HIP: -1.0, KNEE: 0.4999}, {HIP: 2.0, KNEE: 3.0}, activation=1e-3)
    assert (found, free) == ([0, 2], [2.0, -3.0])
    assert stopped(scheme, {HIP: -1.0, KNEE: 0.4999}, {}) == ([0], [0.0])
    scheme = Scheme.MOREAU_JEAN
    q = {HIP: -0.9, KNEE: 0.4}
    assert stopped(scheme, q, {HIP: 7.0, KNEE: 8.0}, v={HIP: -21.0, KNEE: -21.0}) == ([0], [7.0])
    assert stopped(scheme, q, {HIP: 7.0, KNEE: 8.0}, v={HIP: 21.0, KNEE: 21.0}) == ([2], [-8.0])
    assert stopped(scheme, q, {}, v={HIP: -19.0, KNEE: 19.0})[0] == []
    assert stopped(scheme, q, {}, v={HIP: -19.0, KNEE: 19.0}, activation=0.01)[0] == [0, 2]


# Second faces of corners, and constraints from outside.


def cornered(
    scheme: Scheme, gap: float, after: float, before: float = 0.0, far: float = 0.9, **options: Any
) -> tuple[list[int], list[float], list[float]]:
    """Which of the second faces of two points, entries 5 and 6, take part; the first is far."""
    places, row = listing(8), np.array([[3.0, 0.0], [0.0, 4.0], [1.0, 0.0], [0.0, 1.0]])
    places.problem.first[:2] = 0, 2
    directions = SimpleNamespace(jacobian=np.full((8, 2), np.nan))

    def rows(
        model: Any, tree: Any, faces: Any, point: int, place: int, first: Any, to: Any
    ) -> None:
        assert faces == "faces"
        to.jacobian[first[place] : first[place] + 2] = row[2 * point : 2 * point + 2]

    bounce, gaps = np.full(4, 77.0), np.full(8, np.nan)
    gaps[5:7] = far, gap
    found = uncompiled(its.select_corners, replace={its.contact_rows: rows})(
        SimpleNamespace(nc=2), rule(scheme, **options), 1, 5, np.array([before, 0.0]),
        np.array([after, 0.7]), None, "faces", gaps, np.full(8, 0.5), directions, bounce, places,
    )  # fmt: skip
    if found > 1:
        assert places.problem.free[2 * found - 1] == 0.7
    return (
        places.candidate[1:found].tolist(), places.problem.free[2 : 2 * found : 2].tolist(),
        bounce[1:found].tolist(),
    )  # fmt: skip


def test_second_faces_take_part_as_first_ones_do() -> None:
    for scheme in LINEARISED:
        assert cornered(scheme, 0.05, 2.0) == ([6], [pytest.approx(7.0)], [77.0])
        assert cornered(scheme, 0.051, 2.0)[0] == []
        assert cornered(scheme, 0.12, -6.1)[0] == [6]
        assert cornered(scheme, 0.12, -5.9)[0] == []
    assert cornered(Scheme.MOREAU_JEAN, 0.02, 2.0, -4.1) == (
        [6], [pytest.approx(2.0 - 2.05)], [pytest.approx(-2.05)]
    )  # fmt: skip
    assert cornered(Scheme.MOREAU_JEAN, 0.02, 2.0, -4.1, relaxed=1) == ([6], [2.0], [77.0])
    assert cornered(Scheme.MOREAU_JEAN, 0.02, 2.0, -3.9)[0] == []
    assert cornered(Scheme.MOREAU_JEAN, 0.02, 2.0, -3.9, activation=0.001)[0] == [6]
    assert cornered(Scheme.PAPER_EXPLICIT, 0.001, 2.0, activation=0.001) == ([6], [2.0], [77.0])
    assert cornered(Scheme.PAPER_EXPLICIT, 0.0011, 2.0, activation=0.001)[0] == []
    for far, found in ((1.0, [5, 6]), (1.0 + 1e-9, [6])):  # beyond 100 m/s none is looked at
        assert cornered(Scheme.IMPACT_RESOLVED, 0.0, -50.0, far=far)[0] == found


def constrained(
    scheme: Scheme, gap: float, after: float, before: float = 0.0, *, bias: float = 0.0,
    sets: int = CONE, called: int = 0, **options: Any,
) -> tuple[int, float, float, float, float]:  # fmt: skip
    """A constraint of velocities `after` and 0.7: how many take part; free terms, bounce, bound."""
    places = listing(8)
    places.set[:] = sets
    places.problem.first[:2] = 0, 2
    jacobian = np.zeros((3, 2, 2))
    jacobian[2] = np.eye(2)
    rows = SimpleNamespace(
        first=np.zeros(9, int), end=np.zeros(9, int), owner=np.array([9, 9, 9, 1, 2]),
        set=np.array([9, 9, 9, CONE, sets]),
        components=np.full(5, 2 if sets in (CONE, INTERVAL) else 1),
        limit=np.full(5, 30.0),
        outside=SimpleNamespace(
            jacobian=jacobian, gap=np.array([[9.0, 9.0], [0.9, 9.0], [gap, 9.0]]),
            bias=np.array([[9.0, 9.0], [0.0, 9.0], [bias, 9.0]]),
        ),
    )  # fmt: skip
    rows.first[CONSTRAINT], rows.end[CONSTRAINT] = 3, 5  # the first is far
    bounce, calls = np.full(4, 77.0), np.array([1, 1, 1, 0, called])
    found = uncompiled(its.select_constraints)(
        1, rule(scheme, **options), np.array([before, 0.0]), np.array([after, 0.7]),
        np.full(5, 0.5), calls, rows, bounce, places,
    )  # fmt: skip
    its_rows = int(places.problem.first[found]) - 2 if found > 1 else 0
    assert its_rows == (0 if found == 1 else rows.components[4])
    free = places.problem.free
    return found - 1, free[2], free[3], bounce[1], places.problem.bound[1]


def test_constraints_from_outside_take_part_by_their_gap_and_along_the_chord() -> None:
    for scheme in LINEARISED:
        told = constrained(scheme, 0.05, 2.0, bias=4.0)
        assert told[:3] == (1, pytest.approx(2.0 + 0.02 + 5.0), 0.7)
        assert constrained(scheme, 0.051, 2.0)[0] == 0
        assert constrained(scheme, 0.051, 2.0, called=1, calls=1)[0] == 1
        assert constrained(scheme, 0.051, 2.0, called=1)[0] == 0
        assert constrained(scheme, 0.12, -5.99, bias=-4.0)[0] == 1
        assert constrained(scheme, 0.12, -5.99)[0] == 0
    told = constrained(Scheme.MOREAU_JEAN, 0.02, 2.0, -4.1)
    assert told[:4] == (1, pytest.approx(2.0 - 2.05), 0.7, pytest.approx(-2.05))
    told = constrained(Scheme.MOREAU_JEAN, 0.02, 2.0, -4.1, relaxed=1)
    assert told[:4] == (1, 2.0, 0.7, 77.0)
    assert constrained(Scheme.MOREAU_JEAN, 0.02, 2.0, -3.9)[0] == 0
    assert constrained(Scheme.PAPER_EXPLICIT, 0.001, 2.0, activation=0.001)[:2] == (1, 2.0)
    assert constrained(Scheme.PAPER_EXPLICIT, 0.0011, 2.0, activation=0.001)[0] == 0
    told = constrained(Scheme.IMPACT_RESOLVED, 0.0, 2.0, sets=HALF_LINE)
    assert told[:3] == (1, 2.0, 77.0)
    # What rubs does so wherever it is, by its force over the step.
    told = constrained(Scheme.PAPER_EXPLICIT, 9.0, 2.0, sets=INTERVAL)
    assert (told[0], told[2], told[4]) == (1, 2.0, pytest.approx(0.3))


# The matrix of the usual points, and of what else there is.


def test_there_is_a_program_for_candidates_that_are_all_usual() -> None:
    usual = SimpleNamespace(
        programs=np.array([0, 0, 5, 0]), usual_points=np.array([0, 2]),
        usual_place=np.array([0, -1, 1]),
    )  # fmt: skip
    are = uncompiled(its.are_usual)
    assert are(np.array([0, 2, 1]), 2, 2, usual)
    assert not are(np.array([0, 2, 1]), 3, 2, usual)
    assert not are(np.array([1, 0, 2]), 3, 2, usual)
    assert not are(np.array([0, 2, 1]), 2, 3, usual)
    usual.usual_points = np.array([0, 1, 2])  # all are
    assert are(np.array([1]), 1, 2, usual)


@pytest.mark.parametrize("candidate", [[0, 2, 3], [3, 0], [2], []])
def test_the_matrix_of_the_points_that_are_near_is_part_of_that_of_all(
    candidate: list[int],
) -> None:
    whole, near = np.arange(36.0).reshape(6, 6), len(candidate)
    usual = SimpleNamespace(
        usual_place=np.array([0, -1, 1, 2]), usual_problem=SimpleNamespace(delassus=whole)
    )
    delassus = np.full((8, 8), 77.0)
    uncompiled(its.pick_points)(near, np.array([*candidate, 77]), usual, delassus)
    rows = [2 * [0, -1, 1, 2][point] + i for point in candidate for i in range(2)]
    size = 2 * near
    np.testing.assert_array_equal(delassus[:size, :size], whole[np.ix_(rows, rows)])
    assert np.all(delassus[size:] == 77.0)


def test_what_is_no_point_is_coupled_to_all_before_it() -> None:
    """A point, a stop, a dry joint of two rows, and two rows of loops, the last of these."""
    first, delassus = np.array([0, 2, 3, 5, 6, 7]), np.full((8, 8), 77.0)
    candidate = np.array([1, 4, 3, 77, 77])
    owner, side = np.array([9, 9, 9, 2, 0]), np.array([9.0, 9.0, 9.0, 1.0, -1.0])
    loop, change = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.array([0.1, 0.2, 0.4])
    velocity = np.array([[9.0, 9.0], [0.7, 0.8]])
    uncompiled(its.couple)(1, 3, 4, candidate, first, owner, side, loop, velocity, change, delassus)
    expected = {0: 0.7, 1: 0.8, 2: -0.1, 4: 0.4, 5: 1.7, 6: 3.8}
    for column in range(8):
        found = (delassus[6, column], delassus[column, 6])
        assert found == pytest.approx([expected.get(column, 77.0)] * 2)
    assert [uncompiled(its.last_row)(place, first) for place in range(5)] == [1, 2, 4, 5, 6]
    delassus[:] = 77.0
    uncompiled(its.couple)(1, 3, 1, candidate, first, owner, side, loop, velocity, change, delassus)
    assert delassus[2, :4].tolist() == [0.7, 0.8, -0.1, 77.0]
    row = np.full(3, 9.0)
    uncompiled(its.write_unit)(1, -1.0, row)
    assert row.tolist() == [0.0, -1.0, 0.0]


def test_impulses_of_candidates_change_velocities_by_their_rows() -> None:
    """Points by their program, the others by A⁻¹ Jᵀ, of a dry joint the row that rubs."""
    played: list[Any] = []
    point_impulse, v = np.full((3, 2), 9.0), np.array([1.0, 2.0])
    impulse, jacobian = np.array([0.1, 0.2, 0.3, 99.0, 0.5, 0.6]), np.full((6, 2), np.nan)
    jacobian[[2, 4, 5]] = [[1.0, 0.0], [0.0, 2.0], [3.0, 1.0]]
    push = uncompiled(
        its.push_candidates, replace={its.play: lambda program, _: played.append(program)}
    )
    equations = SimpleNamespace(programs=np.arange(9), factor=None, tree=None, rate=None)
    first, model = np.array([0, 2, 3, 5, 6]), SimpleNamespace(nc=3, nv=2)

    def pushed(near: int, count: int) -> None:
        push(
            model, near, count, None, None, np.array([2, 7, 7, 7]), first, impulse, jacobian,
            equations, point_impulse, v,
        )  # fmt: skip

    pushed(1, 4)
    np.testing.assert_allclose(v, [1.0 + 0.3 + 1.8, 2.0 + 1.0 + 0.6])
    assert point_impulse.tolist() == [[0.0, 0.0], [0.0, 0.0], [0.1, 0.2]]
    assert played == [its.PUSH]
    pushed(0, 0)
    assert played == [its.PUSH]
    assert not point_impulse.any()


# What is called to take part.


def test_a_point_stays_above_the_ground_if_the_known_matrix_says_so() -> None:
    """Its normal velocity is the free one and what the impulses of the candidates make of it."""
    whole = np.zeros((4, 4))
    whole[2, :2] = 2.0, 3.0
    usual = SimpleNamespace(
        programs=np.full(9, 5), usual_place=np.array([0, 1, -1]),
        usual_problem=SimpleNamespace(delassus=whole),
        point_velocity=np.array([[9.0, 9.0], [-1.0, 9.0], [9.0, 9.0]]),
    )  # fmt: skip
    assembly = SimpleNamespace(
        answer=SimpleNamespace(impulse=np.array([0.1, -0.2, 9.0])), candidate=np.array([0, 2])
    )
    stays, speed = uncompiled(its.stays_above), -1.0 + 0.2 - 0.6
    assert stays(STEP, 1, -STEP * speed, 1, assembly, usual)
    assert not stays(STEP, 1, -STEP * speed - 1e-9, 1, assembly, usual)
    assert stays(STEP, 1, -STEP * speed - 4e-10, 1, assembly, usual)
    assert not stays(STEP, 1, 9.0, 2, assembly, usual)  # the other is not known
    assert not stays(STEP, 2, 9.0, 1, assembly, usual)
    assert stays(STEP, 1, STEP * 1.01, 0, assembly, usual)
    usual.usual_place[2] = 1  # another that is known pushes, too
    whole[2, 2:4] = 5.0, 7.0
    assembly.answer.impulse = np.array([0.1, -0.2, 0.3, 0.4])
    speed += 1.5 + 2.8
    assert stays(STEP, 1, -STEP * speed, 2, assembly, usual)
    assert not stays(STEP, 1, -STEP * speed - 1e-9, 2, assembly, usual)
    usual.programs[its.DELASSUS] = 0
    assert not stays(STEP, 1, 9.0, 1, assembly, usual)


@pytest.mark.parametrize(
    ("count", "near", "strikes", "outside", "fast", "gap", "stays", "may"),
    [
        (0, 0, False, True, True, 0.1, False, False),
        (1, 1, False, False, False, 0.1, True, False),
        (1, 1, False, False, False, 0.1, False, True),
        (1, 1, False, True, False, 2.0, True, True),
        (1, 1, False, False, True, 2.0, True, True),
        (2, 1, False, False, False, 0.1, True, True),  # others push, too
        (1, 1, True, False, False, 0.1, True, True),
        (2, 1, True, False, False, 0.05, False, False),  # it is a candidate
        (2, 1, True, False, False, 0.051, False, True),
        (2, 1, True, False, False, 1.0, False, True),
        (2, 1, True, False, False, 1.001, False, False),  # nothing gets there
    ],
)
def test_whether_something_may_be_thrown_through_the_ground(
    count: int, near: int, strikes: bool, outside: bool, fast: bool, gap: float, stays: bool,
    may: bool,
) -> None:  # fmt: skip
    """The first of two points is far."""
    v = np.array([19.9, -20.1 if fast else -19.9, 3.0])

    def below(limit: int, numbers: Any) -> bool:
        assert limit == its.bits_of(20.0)
        return bool(np.all(np.abs(numbers) <= 20.0))

    found = uncompiled(
        its.may_go_through,
        replace={its.stay_below: below, its.stays_above: lambda *_: stays},
    )(
        SimpleNamespace(nc=2),
        STEP,
        near,
        count,
        strikes,
        outside,
        v,
        np.array([9.0, gap]),
        None,
        None,
    )
    assert found == may


def test_what_would_go_through_is_called() -> None:
    """Points and stops that end further than 1e-9 beyond; constraints, but for their bend."""
    calls = SimpleNamespace(count=0, called=np.zeros(len(ROWS.kind), int))
    contacts = SimpleNamespace(gap=np.array([0.1, 0.1, 0.1]))
    usual = SimpleNamespace(every_point="all", point_velocity=None)

    def find(model: Any, given: Any, v: Any, straight: bool, tree: Any, of: Any) -> None:
        assert (given, straight) == (contacts, False)
        usual.point_velocity = np.array([[-10.0 - 3e-7, 9.0], [-10.0 - 5e-8, 9.0], [3.0, -99.0]])

    def usually(candidate: Any, near: int, program: int, of: Any) -> bool:
        assert (candidate, near, program) == ("all", 3, its.VELOCITIES)
        return False

    uncompiled(its.call_points, replace={its.find_velocities: find, its.are_usual: usually})(
        SimpleNamespace(nc=3), STEP, None, contacts, None, usual, calls
    )
    assert np.flatnonzero(calls.called).tolist() == [0]
    assert calls.count == 1

    q, v = np.zeros(ROBOT.nq), np.zeros(ROBOT.nv)
    q[[HIP, KNEE, ARM]] = -0.5, 0.3, 2.9
    v[[HIP, KNEE, ARM]] = -50.0 - 3e-7, 20.0 + 5e-8, 9.0
    calls = SimpleNamespace(count=0, called=np.zeros(len(ROWS.kind), int))
    uncompiled(its.call_joints)(STEP, q, v, ROWS, calls)
    assert np.flatnonzero(calls.called).tolist() == [STOPS[0]]
    v[KNEE], v[HIP] = 20.0 + 3e-7, -50.0 - 5e-8
    uncompiled(its.call_joints)(STEP, q, v, ROWS, calls)
    assert np.flatnonzero(calls.called).tolist() == [STOPS[0], STOPS[2]]


@pytest.mark.parametrize(
    ("bias", "gap", "kind", "called"),
    [
        (0.0, 0.1 - 2e-9, CONE, True), (0.0, 0.1 - 5e-10, CONE, False),
        (0.0, 0.1 - 2e-9, INTERVAL, False), (2e3, 0.1 - 0.11, CONE, True),
        (2e3, 0.1 - 0.09, CONE, False), (-2e3, 0.1 - 2e-9, CONE, True),
    ],
)  # fmt: skip
def test_a_constraint_is_called_if_its_chord_goes_through(
    bias: float, gap: float, kind: int, called: bool
) -> None:
    """The tangent may lead ½ h² J̇ v further: 0.1 m of 2000 m/s²."""
    rows = SimpleNamespace(
        first=np.zeros(9, int), end=np.zeros(9, int), owner=np.array([9, 1]),
        set=np.array([9, kind]),
        outside=SimpleNamespace(
            gap=np.array([[9.0, 9.0], [gap, 9.0]]), bias=np.array([[9.0, 9.0], [bias, 9.0]]),
            jacobian=np.array([[[9.0], [9.0]], [[2.0], [9.0]]]),
        ),
    )  # fmt: skip
    rows.first[CONSTRAINT], rows.end[CONSTRAINT] = 1, 2
    calls = SimpleNamespace(count=0, called=np.zeros(2, int))
    uncompiled(its.call_joints)(STEP, np.zeros(1), np.array([-5.0]), rows, calls)
    assert calls.called.tolist() == [0, int(called)]


# Springs that are taken ahead, positions, and what a wedge is pushed out by.


def test_springs_and_dampers_ahead_are_added_to_the_mass_matrix() -> None:
    added = np.zeros(3)
    stiffness, damping = np.array([100.0, 0.0, 40.0]), np.array([3.0, 2.0, 0.0])
    uncompiled(its.add_springs)(SimpleNamespace(nv=3), 0.1, stiffness, damping, added)
    np.testing.assert_allclose(added, [1.3, 0.2, 0.4])


@pytest.mark.parametrize("solved", [SOLVED, RAY])
def test_a_wedge_is_pushed_out_if_a_way_leads_out(solved: int) -> None:
    impulse, pushed = np.array([1.0, 2.0, 9.0]), []
    impact = SimpleNamespace(
        answer=SimpleNamespace(impulse=np.array([5.0, 6.0, 7.0])),
        problem="way",
        arriving="arriving",
    )
    answer = SimpleNamespace(impulse=impulse, velocity="velocity")
    problem = SimpleNamespace(first=np.array([0, 2, 3]))
    assembly = SimpleNamespace(answer=answer, candidate=None, problem=problem, directions=None)

    def solve(order: Any, way: Any, solver: Any, its_answer: Any) -> int:
        assert (way, its_answer) == ("way", impact.answer)
        return solved

    def push(*given: Any) -> None:
        pushed.append((given[8].tolist(), given[-1]))

    uncompiled(
        its.push_out,
        replace={
            its.solve_contact_kernel: solve,
            its.push_all: push,
            its.pose_way_out: lambda *_: None,
        },
    )(None, 1, 1, False, STEP, None, None, None, None, problem, None, None, None, assembly, impact)
    if solved == SOLVED:
        assert pushed == [([5.0, 6.0, 9.0], "arriving")]
    else:
        assert not pushed
        assert impulse.tolist() == [1.0, 2.0, 9.0]


@pytest.mark.parametrize(
    ("scheme", "happens", "moves"),
    [
        (Scheme.IMPACT_RESOLVED, 0, [3.0, 4.0]), (Scheme.IMPACT_RESOLVED, 1, [5.0, 6.0]),
        (Scheme.PAPER_EXPLICIT, 0, [1.0, 2.0]), (Scheme.PAPER_SYMPLECTIC, 0, [3.0, 4.0]),
        (Scheme.MOREAU_JEAN, 0, [2.0, 3.0]), (Scheme.LINEARLY_IMPLICIT, 0, [3.0, 4.0]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("loops", ["none", "closed", "open"])
def test_positions_move_with_the_velocity_of_the_scheme(
    scheme: Scheme, happens: int, moves: list[float], loops: str
) -> None:
    """From v = (1, 2) to (3, 4), with (5, 6) where an impact arrives."""
    memory = SimpleNamespace(
        q=np.array([0.5, 0.7]), v=np.array([1.0, 2.0]), next_v=np.array([3.0, 4.0]),
        tally=SimpleNamespace(steps=7), loops=None, equations=None,
    )  # fmt: skip
    work = SimpleNamespace(
        scheme=int(scheme), step=STEP,
        impact=SimpleNamespace(happens=happens, arriving=np.array([5.0, 6.0])),
    )  # fmt: skip
    clock = SimpleNamespace(start=2.0, index=4, time=2.04)

    def copy(source: Any, target: Any) -> None:
        target[:] = source

    move = uncompiled(
        its.move,
        replace={
            its.copy_words: copy, its.rows_of: lambda _: 0 if loops == "none" else 2,
            its.close_loops: lambda *_: loops == "closed",
        },
    )  # fmt: skip
    ends = move(SimpleNamespace(model=SimpleNamespace(nq=2, nv=2)), None, memory, work, None, clock)
    np.testing.assert_allclose(memory.q, np.array([0.5, 0.7]) + STEP * np.array(moves))
    assert memory.v.tolist() == [3.0, 4.0]
    assert memory.tally.steps == 8
    if loops == "open":
        assert ends == its.DIVERGED
        assert clock.time == 2.04
    else:
        assert ends == its.DONE
        assert clock.time == pytest.approx(2.05)


# What a method says of itself.


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step": 0.0}, "must be a positive number"), ({"step": -1.0}, "must be a positive number"),
        ({"step": float("inf")}, "must be a positive number"),
        ({"step": float("nan")}, "must be a positive number"),
        ({"activation": -1e-9}, "must be ≥ 0"), ({"activation": float("inf")}, "must be ≥ 0"),
        ({"activation": float("nan")}, "must be ≥ 0"), ({"scheme": 17}, "unknown scheme"),
        ({"solver": "guess"}, "solver"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        hs.TimeStepping(**options)


def test_a_scheme_may_be_given_by_its_number_and_settings_reach_the_kernels() -> None:
    number: Any = int(Scheme.MOREAU_JEAN)
    method = hs.TimeStepping(
        step=2e-3, scheme=number, activation=0.1, solver="gauss_seidel", bounded_restitution=True
    )
    assert method.scheme is Scheme.MOREAU_JEAN
    work = method.new_work(ROBOT)
    assert (work.step, work.scheme, work.activation) == (2e-3, number, 0.1)
    assert work.impact.bounded == 1
    assert work.order[0] == 2
    assert (method.step_length, method.row_period, method.solves_with) == (
        2e-3, ("step", 2e-3), "gauss_seidel"
    )  # fmt: skip
    usual = hs.TimeStepping().new_work(ROBOT)
    assert (usual.step, usual.scheme, usual.activation, usual.impact.bounded) == (
        1e-3, int(Scheme.IMPACT_RESOLVED), 0.0, 0
    )  # fmt: skip
    for known in (work, usual):
        assert np.all(known.impact.touching == NEVER)
        assert known.impact.wedged == NEVER


def test_a_step_has_room_for_all_events_that_it_may_tell() -> None:
    """Two of each point and coordinate, one of each joint, latch and brake; two more of its own."""
    rows, events = hs.TimeStepping().room(ROBOT)
    assert rows == 1
    assert events == 2 * (2 + 7) + len(ROBOT.joint_names) + 1 + 2 + 2


@pytest.mark.parametrize("stops", [False, True])
def test_other_ground_is_touched_by_nothing_yet(stops: bool) -> None:
    """Stops are as they were, unless their ends are others, too; then loops are closed again."""
    method = hs.TimeStepping()
    work, clock = method.new_work(ROBOT), SimpleNamespace(begun=1)
    work.impact.touching[:] = 5
    work.impact.corner.near = 2
    method.forget_ground(ROBOT, work, clock, stops=stops)  # type: ignore[arg-type]
    expected = np.full(len(ROWS.kind), NEVER)
    if not stops:
        expected[list(STOPS)] = 5
    np.testing.assert_array_equal(work.impact.touching, expected)
    assert work.impact.corner.near == 0
    assert clock.begun == (0 if stops else 1)


def test_restitution_is_refused_where_a_scheme_does_not_bounce() -> None:
    for scheme in Scheme:
        method = hs.TimeStepping(scheme=scheme)
        for bounce in (0.0, 0.5, [0.0, 0.5]):
            profile = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.5)]
            setting: Any = SimpleNamespace(ground=hs.Ground(restitution=bounce, profile=profile))
            if bounce and scheme not in (Scheme.IMPACT_RESOLVED, Scheme.MOREAU_JEAN):
                with pytest.raises(SimulationError, match=r"IMPACT_RESOLVED or Scheme.MOREAU_JEAN"):
                    method.check(setting)
            else:
                method.check(setting)


def test_what_went_too_far_is_told() -> None:
    """Deeper than 1 cm in the ground, further than 0.02 rad beyond a stop."""
    method, q = hs.TimeStepping(), ROBOT.reference_state().q
    assert method.doubts(ROBOT, q, 1e-2, 2e-2) == []
    (deep,) = method.doubts(ROBOT, q, 1.1e-2, 0.0)
    assert "0.011 m in the ground" in deep
    (beyond,) = method.doubts(ROBOT, q, 0.0, 2.1e-2)
    assert "0.021 rad or m beyond its stop: Scheme.IMPACT_RESOLVED" in beyond
    assert len(method.doubts(ROBOT, q, 1.0, 1.0)) == 2


def test_room_for_impacts_is_that_for_all_entries() -> None:
    impact = allocate_impact(ROBOT, bounded=True)
    entries = len(ROWS.kind)
    assert impact.touching.shape == impact.bounce.shape == impact.member.shape == (entries,)
    assert impact.arriving.shape == (ROBOT.nv,)
    assert impact.problem.free.shape == impact.arriving_impulse.shape == (2 * entries,)
    assert impact.bounded == 1
    assert allocate_impact(ROBOT).bounded == 0
    memory = allocate_memory(ROBOT)
    assert memory.assembly.candidate.shape == (entries,)
    assert ROWS.end[SECOND_FACE] - ROWS.first[SECOND_FACE] == ROBOT.nc
    assert STICK != SOLVED
    assert ROWS.end[STOP] == STOPS.stop
