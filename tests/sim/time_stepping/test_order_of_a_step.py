"""How a time step goes on: what is asked in which order, what is asked again, and what is noted.

Everything that a step calls is played by a script here; kernels run as plain Python.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from every_row import ROBOT

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import RAY, SOLVED
from heelstrike.contact.workspace import PROGRAM_ROWS
from heelstrike.sim import Scheme
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, LOOP, POINT, SECOND_FACE, STOP
from heelstrike.sim.time_stepping import method as its

STEP = 0.01


class Played:
    """Functions that keep how they were called and answer as somebody says."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self.answers = answers
        self.calls: list[tuple[Any, ...]] = []
        self.parts = {getattr(its, name): self._part(name) for name in answers}

    def _part(self, name: str) -> Callable[..., Any]:
        def play(*given: Any) -> Any:
            self.calls.append((name, *given))
            answer = self.answers[name]
            return answer(*given) if callable(answer) else answer

        return play

    def names(self) -> list[str]:
        return [each[0] for each in self.calls]

    def of(self, name: str) -> list[tuple[Any, ...]]:
        return [each[1:] for each in self.calls if each[0] == name]


class Step:
    """One call of `solve_step`, with so many candidates of each kind."""

    def __init__(
        self,
        scheme: Scheme = Scheme.IMPACT_RESOLVED,
        *,
        solves: Any = True,
        relaxes: Any = False,
        through: Any = False,
        calls: Any = lambda _: None,
        wedged: bool = False,
        outside: int = 0,
        near: int = 2,
        corners: int = 0,
        deepest: float = 0.0,
        bounces: bool = False,
        modes_change: bool = False,
        count: int | None = None,
    ) -> None:
        self.relaxed_when_solved: list[int] = []
        happens = 0

        def solve(model: Any, near: int, count: int, work: Any, memory: Any) -> bool:
            self.relaxed_when_solved.append(work.impact.relaxed)
            work.impact.happens = happens
            return bool(solves.pop(0)) if isinstance(solves, list) else solves

        def relax(linearised: bool, deepest: float, bounces: bool, steps: int, impact: Any) -> bool:
            again = relaxes.pop(0) if isinstance(relaxes, list) else relaxes
            impact.relaxed = int(again)
            return bool(again)

        def may(*given: Any) -> bool:
            return bool(through.pop(0)) if isinstance(through, list) else through

        self.played = Played(
            {
                "stays_wedged": wedged,
                "free_velocity": None,
                "select_candidates": near,
                "select_stops": near + (0 if count == 0 else 1),
                "hold_latched": near + (count != 0),
                "select_constraints": near + 2,
                "list_dry_joints": lambda n, *_: n + (count != 0),
                "select_corners": lambda *given: given[2] + 1,
                "append_loops": lambda n, *_: n + (count != 0),
                "free_loops": None,
                "left_alone": (deepest, bounces),
                "close_gaps": None,
                "solve_candidates": solve,
                "relax": relax,
                "modes_change": modes_change,
                "may_go_through": may,
                "call_points": lambda *given: calls(given[-1]),
                "call_joints": None,
                "dismiss": None,
                "note_touching": None,
                "note_answer": None,
                "join_forces": None,
                "note_group": lambda kind, first, until, assembly: self.note(kind, first, until),
                "are_there": lambda kind, _: kind == SECOND_FACE and corners > 0,
            }
        )
        self.groups: list[tuple[int, int, int]] = []
        answer = SimpleNamespace(mode="mode", residual=np.full(3, 9.0))
        self.impact = SimpleNamespace(
            relaxed=7,
            happens=7,
            gains=7,
            bounce=np.full(4, 7.0),
            corner=SimpleNamespace(near=corners),
            calls=SimpleNamespace(count=0, called="called"),
            arriving="arriving",
            touching="touching",
        )
        self.memory = SimpleNamespace(
            assembly=SimpleNamespace(
                answer=answer, candidate="candidate", problem="problem", directions=None
            ),
            rows=SimpleNamespace(
                set="set",
                gap="gap",
                latch_stop="latch",
                first=np.arange(9),
                outside=SimpleNamespace(kernel=np.zeros((outside, 2))),
            ),
            surface=SimpleNamespace(friction="friction", restitution="restitution"),
            loops=SimpleNamespace(held="held"),
            q="q",
            v="v",
            next_v="next v",
            contacts=SimpleNamespace(gap="gaps"),
            second_faces="faces",
            equations=SimpleNamespace(tree="tree"),
            usual="usual",
            tally=SimpleNamespace(steps=5),
            torque="torque",
            stiffness="stiffness",
            pushes="pushes",
            breakaway="breakaway",
            reaction=SimpleNamespace(mode="before"),
        )
        work = SimpleNamespace(step=STEP, scheme=int(scheme), activation=0.3, impact=self.impact)
        run = uncompiled(its.solve_step, replace=self.played.parts)
        self.solved = run("model", False, 2.0, work, self.memory)

    def note(self, kind: int, first: int, until: int) -> int:
        self.groups.append((kind, first, until))
        return until


def test_candidates_are_listed_kind_by_kind_and_solved_once() -> None:
    step = Step(corners=2, outside=1)
    assert step.solved
    # Points, stops, constraints, dry joints, second faces and loops: two, one, one, one, one, one.
    assert step.groups == [
        (POINT, 0, 2),
        (STOP, 2, 3),
        (CONSTRAINT, 3, 4),
        (DRY_JOINT, 4, 5),
        (SECOND_FACE, 5, 6),
        (LOOP, 6, 7),
    ]
    names = step.played.names()
    order = [
        "stays_wedged",
        "free_velocity",
        "select_candidates",
        "select_stops",
        "hold_latched",
        "select_constraints",
        "list_dry_joints",
        "select_corners",
        "append_loops",
        "free_loops",
        "solve_candidates",
        "may_go_through",
        "note_touching",
        "note_answer",
        "are_there",
        "join_forces",
    ]
    assert [name for name in names if name in order] == order
    assert "dismiss" not in names
    assert "close_gaps" not in names
    assert step.played.of("free_loops")[0][0] == 7
    assert step.played.of("free_loops")[0][2:4] == ("next v", 0.5 * STEP)
    assert step.played.of("append_loops")[0][1] is step.memory.loops
    assert step.played.of("solve_candidates")[0][1:3] == (2, 7)
    assert step.memory.assembly.answer.residual.tolist() == [0.0, 0.0, 0.0]
    assert (step.impact.happens, step.impact.gains, step.impact.relaxed) == (0, 0, 0)
    assert np.all(step.impact.bounce == 7.0)
    assert step.played.of("note_touching")[0][:3] == (STEP, 7, 5)
    assert step.played.of("note_answer")[0][0] == STEP
    told = step.played.of("may_go_through")[0]
    assert told[1:8] == (STEP, 2, 7, False, True, "next v", "gaps")
    assert step.played.of("stays_wedged")[0][0] == 5
    (rule,) = (given[2] for given in step.played.of("select_candidates"))
    assert rule == its.Rule(STEP, int(Scheme.IMPACT_RESOLVED), 0.3, 0, 0)


def test_kinds_that_are_not_there_are_not_asked() -> None:
    step = Step(near=0, count=0)
    assert step.solved
    for name in ("select_constraints", "select_corners", "solve_candidates", "join_forces"):
        assert name not in step.played.names()
    assert step.groups[-1] == (LOOP, 0, 0)
    step = Step(Scheme.MOREAU_JEAN)
    assert "may_go_through" not in step.played.names()
    assert "note_touching" not in step.played.names()
    assert np.all(step.impact.bounce == 0.0)


def test_what_is_called_takes_part_in_the_step_when_it_is_solved_again() -> None:
    def call(calls: Any) -> None:
        calls.count += 1

    step = Step(through=[True, True, False], calls=call)
    assert len(step.played.of("solve_candidates")) == 3
    rules = [given[2].calls for given in step.played.of("select_candidates")]
    assert rules == [0, 1, 2]
    assert len(step.played.of("dismiss")) == 1
    assert step.played.of("call_points")[0][2] == "next v"
    assert step.played.of("call_joints")[0][1:3] == ("q", "next v")
    # Who calls nobody new is done.
    step = Step(through=True)
    assert len(step.played.of("solve_candidates")) == 1
    assert not step.played.of("dismiss")


def test_a_step_without_an_answer_is_relaxed_or_fails() -> None:
    step = Step(solves=False)
    assert not step.solved
    assert len(step.played.of("solve_candidates")) == 1
    assert step.played.of("relax")[0][:4] == (True, 0.0, False, 5)
    step = Step(solves=[False, True], relaxes=[True], deepest=-1e-5)
    assert step.solved
    assert step.relaxed_when_solved == [0, 1]
    assert len(step.played.of("close_gaps")) == 1
    assert step.played.of("close_gaps")[0][:3] == (STEP, 5, "gap")
    step = Step(Scheme.MOREAU_JEAN, solves=[False, True], relaxes=[True], bounces=True)
    assert step.solved
    assert not step.played.of("close_gaps")  # gaps are none of its business
    assert not step.played.of("relax")[0][0]


def test_a_wedge_that_lasts_is_relaxed_at_once_until_modes_change() -> None:
    step = Step(wedged=True, deepest=-1e-5)
    assert step.relaxed_when_solved == [1]
    assert step.impact.relaxed == 1
    assert step.played.of("left_alone")[0] == (5, "candidate", "gap", "restitution")
    step = Step(wedged=True, bounces=True)
    assert step.relaxed_when_solved == [1]
    step = Step(wedged=True)  # neither deep nor bouncing: it is over
    assert step.relaxed_when_solved == [0]
    assert step.impact.relaxed == 0
    step = Step(wedged=True, deepest=-1e-5, modes_change=True)
    assert step.relaxed_when_solved == [1, 0]
    assert step.played.of("modes_change")[0][1] == "before"
    step = Step(deepest=-1e-5, modes_change=True)
    assert step.relaxed_when_solved == [0]


# Deciding and noting.


def decided(
    relaxed: int = 0, begins: bool = True, gains: int = 0, solved: bool = True
) -> tuple[int, Played, Any]:
    played = Played(
        {
            "solve_step": solved,
            "note_extremes": None,
            "note_wedge": begins,
            "log_event": None,
            "deepest_point": 3,
            "note_events": None,
            "react": None,
            "share_friction": None,
            "note_brakes": None,
            "note_event": None,
            "hardest_point": 4,
        }
    )
    memory = SimpleNamespace(
        contacts=SimpleNamespace(gap="gap", force="force"),
        tally=SimpleNamespace(steps=5, energy_gain=1.0),
        assembly=SimpleNamespace(answer=SimpleNamespace(residual="residual")),
        solver=SimpleNamespace(tally=SimpleNamespace(relaxed=2)),
        q="q",
        v="v",
        next_v="next v",
        breakaway="breakaway",
        equations=SimpleNamespace(tree="tree"),
        reaction=SimpleNamespace(friction_torque="friction"),
        rows="rows",
        reported="reported",
        loops=SimpleNamespace(
            constraint_force="forces", held="held", brake_force="brakes", braked="braked"
        ),
    )
    work = SimpleNamespace(
        step=STEP, impact=SimpleNamespace(relaxed=relaxed, gains=gains, gain=0.4)
    )
    record = SimpleNamespace(told=SimpleNamespace(events=6))
    clock = SimpleNamespace(time=2.04, start=2.0, index=4)
    scene = SimpleNamespace(model="model", ground=SimpleNamespace(curved=0))
    run = uncompiled(its.decide, replace=played.parts)
    return run(scene, None, memory, work, record, clock), played, memory


def test_a_step_is_decided_and_told() -> None:
    ends, played, memory = decided()
    assert ends == its.DONE
    assert played.of("solve_step")[0][:3] == ("model", False, 2.04)
    told = played.of("note_events")[0]
    assert told[1] == 2.04
    assert told[2] == pytest.approx(2.05)
    assert told[3:9] == (STEP, 5, "q", "v", "next v", "breakaway")
    assert told[9:12] == ("tree", memory.contacts, memory.reaction)
    assert told[12:] == ("forces", "rows", told[14], "reported")
    assert played.of("note_extremes")[0][:2] == ("gap", "residual")
    assert played.of("share_friction")[0] == ("model", "breakaway", "friction", "brakes")
    assert played.of("react")[0][1] == 6
    assert played.of("note_brakes")[0][1:4] == (2.04, STEP, "brakes")
    for name in ("log_event", "note_wedge", "note_event"):
        assert name not in played.names()
    assert memory.solver.tally.relaxed == 2
    assert decided(solved=False)[0] == its.SOLVER_FAILED


def test_wedges_and_energy_that_is_made_are_told() -> None:
    _, played, memory = decided(relaxed=1)
    assert memory.solver.tally.relaxed == 3
    assert played.of("log_event")[0][:5] == (2.04, its.WEDGED, 3, 0.0, 0.0)
    _, played, memory = decided(relaxed=1, begins=False)
    assert memory.solver.tally.relaxed == 3
    assert not played.of("log_event")
    _, played, memory = decided(gains=1)
    event = played.of("note_event")[0]
    assert event[0] == pytest.approx(2.05)
    assert event[1:5] == (its.ENERGY_GAIN, 4, STEP, "force")
    assert memory.tally.energy_gain == pytest.approx(1.4)


@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize("there", [0, 1])
def test_what_a_step_begins_with(scheme: Scheme, there: int) -> None:
    """Springs that a scheme takes ahead; loops, constraints and corners where there are any."""
    played = Played(
        dict.fromkeys(
            (
                "add_springs",
                "evaluate_equations",
                "locate_in_straight_line",
                "find_loops_of_step",
                "find_constraints",
                "locate_corners",
            )
        )
    )
    memory = SimpleNamespace(
        equations=SimpleNamespace(added="added", programs=np.arange(9), tree="tree"),
        q="q",
        v="v",
        stiffness="both",
        damping="both dampers",
        contacts="contacts",
        surface="surface",
        loops=SimpleNamespace(unknown=np.zeros(there)),
        second_faces="faces",
        rows=SimpleNamespace(
            outside=SimpleNamespace(kernel=np.zeros((there, 2))), first=np.arange(9)
        ),
    )
    work = SimpleNamespace(scheme=int(scheme), step=STEP, impact=SimpleNamespace(corner="corner"))
    model = SimpleNamespace(stiffness="its own", damping="its dampers")
    uncompiled(its.prepare, replace=played.parts)(
        model, SimpleNamespace(concave=there), memory, work
    )
    springs = played.of("add_springs")
    if scheme is Scheme.LINEARLY_IMPLICIT:
        assert springs == [(model, STEP, "both", "both dampers", "added")]
    elif scheme is Scheme.MOREAU_JEAN:
        assert springs == [(model, 0.5 * STEP, "its own", "its dampers", "added")]
    else:
        assert springs == []
    assert played.of("locate_in_straight_line")[0][2] == its.LOCATE
    assert played.of("evaluate_equations") == [(model, "q", "v", memory.equations)]
    for name in ("find_loops_of_step", "find_constraints", "locate_corners"):
        assert len(played.of(name)) == there
    if there:
        assert played.of("locate_corners")[0][3] == SECOND_FACE


# The velocity without contact.


@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize("program", [False, True])
@pytest.mark.parametrize("pushed", [False, True])
def test_velocities_without_contact_are_those_of_a_program_or_of_loops(
    scheme: Scheme, program: bool, pushed: bool
) -> None:
    def play(_: int, given: Any) -> None:
        given[-1][:] = 10.0, 20.0

    def loops(*given: Any) -> None:
        given[-1][:] = 1.0, 2.0

    def push(model: Any, tree: Any, pushes: Any, rate: Any) -> None:
        assert not rate.any()
        rate[:] = 5.0, 7.0

    played = Played(
        {
            "play": play,
            "velocity_by_loops": loops,
            "share_over_step": pushed,
            "add_pushes": push,
            "solve_mass_matrix": lambda model, equations, x: x.__imul__(2.0),
        }
    )
    equations = SimpleNamespace(
        force=np.zeros(2),
        rate=np.full(2, 9.0),
        bias="bias",
        factor="factor",
        tree="tree",
        programs=np.full(9, 3 if program else 0),
    )
    v, next_v = np.array([0.5, 0.6]), np.zeros(2)
    uncompiled(its.free_velocity, replace=played.parts)(
        SimpleNamespace(nv=2),
        STEP,
        int(scheme),
        2.0,
        "q",
        v,
        "torque",
        "stiffness",
        "pushes",
        equations,
        next_v,
    )
    ahead = scheme in (Scheme.LINEARLY_IMPLICIT, Scheme.MOREAU_JEAN)
    straight = program and not ahead
    expected = np.array([0.6, 0.8]) if straight else np.array([1.0, 2.0])
    if pushed:
        expected = expected + STEP * np.array([10.0, 14.0])
    np.testing.assert_allclose(next_v, expected)
    assert played.of("share_over_step") == [(2.0, STEP, "pushes")]


@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize(("added", "program"), [(0.0, 1), (2.0, 1), (2.0, 0)])
def test_velocities_by_loops_are_those_of_their_scheme(
    scheme: Scheme, added: float, program: int
) -> None:
    """h A⁻¹ (passive + B τ − H − ahead K v); what is added to A has to be weighed."""

    def passive(model: Any, q: Any, v: Any, force: Any) -> None:
        force[:] = 1.0, 2.0

    played = Played(
        {
            "passive_force": passive,
            "weigh": None,
            "solve_mass_matrix": lambda model, equations, x: x.__imul__(3.0),
        }
    )
    programs = np.zeros(9, int)
    programs[its.SOLVE] = program
    equations = SimpleNamespace(
        force=np.zeros(2),
        rate=np.zeros(2),
        bias=np.array([0.3, 0.4]),
        programs=programs,
        added=np.array([0.0, added]),
    )
    model = SimpleNamespace(
        nv=2, nu=1, actuator_joint=np.array([1]), stiffness=np.array([10.0, 20.0])
    )
    v, next_v = np.array([0.5, 0.6]), np.zeros(2)
    uncompiled(its.velocity_by_loops, replace=played.parts)(
        model,
        STEP,
        int(scheme),
        "q",
        v,
        np.array([7.0]),
        np.array([100.0, 200.0]),
        equations,
        next_v,
    )
    force = np.array([1.0 - 0.3, 2.0 + 7.0 - 0.4])
    if scheme is Scheme.LINEARLY_IMPLICIT:
        force -= STEP * np.array([100.0, 200.0]) * v
    elif scheme is Scheme.MOREAU_JEAN:
        force -= 0.5 * STEP * np.array([10.0, 20.0]) * v
    np.testing.assert_allclose(next_v, v + 3.0 * STEP * force)
    weighs = program == 1 and (
        scheme is Scheme.LINEARLY_IMPLICIT or (scheme is Scheme.MOREAU_JEAN and added > 0.0)
    )
    assert len(played.of("weigh")) == int(weighs)


# The problem of the candidates.


class Solve:
    """One call of `solve_candidates`: two usual points, a stop and a row of a loop."""

    def __init__(
        self,
        scheme: Scheme = Scheme.IMPACT_RESOLVED,
        *,
        near: int = 2,
        count: int = 4,
        usual: bool = True,
        corners: bool = False,
        outside: bool = False,
        status: int = SOLVED,
        falls: bool = False,
        relaxed: int = 0,
        members: tuple[int, ...] = (),
        finishes: bool = True,
        room: int = PROGRAM_ROWS,
        rows: int = 6,
    ) -> None:
        def find(*given: Any) -> int:
            given[-1][: len(members)] = members
            return len(members)

        self.changes: list[list[float]] = []

        def couple(*given: Any) -> None:
            self.changes.append(given[9].tolist())

        self.played = Played(
            {
                "rows_of": 1,
                "are_usual": usual,
                "play": None,
                "pick_points": None,
                "solve_mass_matrix": lambda model, equations, x: x.__imul__(2.0),
                "find_velocities": None,
                "couple": couple,
                "write_contact_rows": None,
                "write_joint_rows": None,
                "assemble_delassus": None,
                "solve_restitution": status,
                "solve_contact_kernel": status,
                "falls_into": falls,
                "push_all": None,
                "push_out": None,
                "find_members": find,
                "speed_before": lambda model, entry, *_: -1.0 - entry,
                "leave_others_out": None,
                "pose_impact": None,
                "solve_impact": finishes,
                "are_there": lambda kind, _: corners if kind == SECOND_FACE else outside,
            }
        )
        self.problem = SimpleNamespace(
            first=np.array([0, 2, 4, 5, rows]), delassus="delassus", count=9
        )
        answer = SimpleNamespace(impulse="impulse", mode="mode")
        self.impact = SimpleNamespace(
            happens=0,
            arriving=np.zeros(2),
            relaxed=relaxed,
            touching="touching",
            member=np.full(4, 77),
            bounce=np.full(4, 7.0),
            problem="members",
        )
        self.jacobian = np.full((16, 2), 9.0)
        self.jacobian[5] = 0.5, 0.25
        self.usual_problem = SimpleNamespace(delassus=np.zeros((room, room)), count=8)
        self.small_problem = SimpleNamespace(delassus="small", count=7)
        self.memory = SimpleNamespace(
            assembly=SimpleNamespace(
                problem=self.problem,
                answer=answer,
                candidate=np.array([0, 1, 2, 3]),
                directions=SimpleNamespace(jacobian=self.jacobian),
            ),
            contacts="contacts",
            small_problem=self.small_problem,
            second_faces="faces",
            next_v=np.array([3.0, 4.0]),
            v="v",
            rows=SimpleNamespace(
                owner=np.array([0, 1, 1, 9]), side=np.array([1.0, 1.0, -1.0, 1.0]), gap="gap"
            ),
            loops=SimpleNamespace(rows=SimpleNamespace(jacobian="loops")),
            solver="solver",
            equations=SimpleNamespace(factor="factor", tree="tree"),
            tally=SimpleNamespace(steps=5),
            surface=SimpleNamespace(restitution=np.array([0.5, 0.0, 0.25, 0.0])),
            usual=SimpleNamespace(
                programs=np.arange(9),
                usual_points=np.zeros(2),
                usual_problem=self.usual_problem,
                point_rows=None,
                point_velocity="velocity",
                point_impulse="impulses",
            ),
        )
        work = SimpleNamespace(impact=self.impact, step=STEP, order="order", scheme=int(scheme))
        run = uncompiled(its.solve_candidates, replace=self.played.parts)
        self.solved = run(SimpleNamespace(nv=2), near, count, work, self.memory)


def test_usual_points_alone_are_one_program() -> None:
    step = Solve(count=2)
    assert step.solved
    assert [given[0] for given in step.played.of("play")] == [its.DELASSUS]
    assert step.usual_problem.count == step.problem.count == 2
    assert step.small_problem.count == 7
    assert step.played.of("solve_contact_kernel")[0][1] is step.usual_problem
    for name in ("pick_points", "write_joint_rows", "couple"):
        assert name not in step.played.names()
    (push,) = step.played.of("push_all")
    assert push[1:4] == (2, 2, True)
    assert push[-1] is step.memory.next_v


def test_stops_and_loops_beside_usual_points_are_coupled_to_them() -> None:
    step = Solve()
    assert step.usual_problem.count == step.problem.count == 4
    assert not step.played.of("pick_points")
    assert step.changes == [[0.0, -2.0], [1.0, 0.5]]  # a unit of the stop, the loop's own row
    assert [given[2] for given in step.played.of("couple")] == [2, 3]
    assert [given[1] for given in step.played.of("couple")] == [3, 3]
    assert all(given[-1] is step.usual_problem.delassus for given in step.played.of("couple"))
    assert len(step.played.of("find_velocities")) == 2
    assert step.played.of("find_velocities")[0][3] is True


def test_some_of_the_usual_points_have_a_smaller_problem() -> None:
    step = Solve(near=0, count=2)
    assert not step.played.of("find_velocities") + step.played.of("play")
    assert step.small_problem.count == step.problem.count == 2
    step = Solve(near=1, count=1)  # one of two
    ((near, _, _, delassus),) = step.played.of("pick_points")
    assert (near, delassus) == (1, "small")
    assert step.played.of("solve_contact_kernel")[0][1] is step.small_problem


def test_more_rows_than_there_is_room_for_have_the_problem_of_all() -> None:
    step = Solve(room=5)
    assert step.played.of("pick_points")[0][3] == "small"
    step = Solve(room=5, rows=PROGRAM_ROWS + 1)
    assert step.played.of("pick_points")[0][3] == "delassus"
    assert step.played.of("solve_contact_kernel")[0][1] is step.problem


@pytest.mark.parametrize("how", ["unusual", "corners", "outside"])
def test_others_are_assembled_from_their_rows(how: str) -> None:
    step = Solve(usual=how != "unusual", corners=how == "corners", outside=how == "outside")
    kinds = [given[0] for given in step.played.of("write_contact_rows")]
    assert kinds == [POINT, SECOND_FACE]
    assert [given[3] for given in step.played.of("write_contact_rows")] == ["contacts", "faces"]
    assert step.played.of("assemble_delassus")[0][1] == 4
    assert step.played.of("push_all")[0][3] is False
    assert not step.played.of("pick_points")


def test_moreau_and_jean_bounce_in_the_solve_and_have_no_other_impact() -> None:
    step = Solve(Scheme.MOREAU_JEAN, falls=True)
    assert step.solved
    assert step.played.of("solve_restitution")[0][0] == "order"
    assert not step.played.of("solve_contact_kernel") + step.played.of("falls_into")
    assert not Solve(Scheme.MOREAU_JEAN, status=RAY).solved
    for scheme in (Scheme.GAP_LINEARISED, Scheme.PAPER_EXPLICIT):
        assert not Solve(scheme, falls=True).played.of("solve_impact")


def test_an_impact_is_solved_after_the_positions() -> None:
    step = Solve(falls=True, members=(0, 2))
    assert step.solved
    assert step.impact.happens == 1
    assert step.impact.arriving.tolist() == [3.0, 4.0]
    arriving, after = (given[-1] for given in step.played.of("push_all"))
    assert arriving is step.impact.arriving
    assert after is step.memory.next_v
    assert step.played.of("falls_into")[0][:4] == (STEP, 4, "gap", "touching")
    assert step.played.of("find_members")[0][:4] == (STEP, 4, "gap", "touching")
    assert step.impact.bounce.tolist() == [0.5 * -1.0, 0.25 * -3.0, 7.0, 7.0]
    assert step.played.of("leave_others_out")[0][0] == 2
    assert step.played.of("pose_impact")[0][-1] == "members"
    assert step.played.of("solve_impact")[0][1:3] == (step.usual_problem, "members")
    assert not step.played.of("push_out")
    step = Solve(falls=True, members=(0, 1, 2, 3), relaxed=1)
    assert step.impact.bounce.tolist() == [0.0] * 4
    assert not step.played.of("leave_others_out") + step.played.of("speed_before")
    assert step.played.of("pose_impact")[0][-1] is step.usual_problem
    assert len(step.played.of("push_out")) == 1
    assert not Solve(falls=True, members=(0,), finishes=False).solved
    step = Solve(falls=True, status=RAY)
    assert not step.solved
    assert step.impact.happens == 0
    assert not step.played.of("falls_into")
    assert Solve(falls=True, members=(1,)).impact.bounce[0] == 0.0


def test_candidates_are_pushed_by_programs_or_by_the_matrix() -> None:
    played = Played({"push_candidates": None, "add_impulse": None})
    push = uncompiled(its.push_all, replace=played.parts)
    directions = SimpleNamespace(jacobian="jacobian")
    for straight in (True, False):
        push(
            "model",
            1,
            2,
            straight,
            "contacts",
            "points",
            "candidate",
            np.array([0, 2, 3]),
            "impulse",
            directions,
            "equations",
            "impulses",
            "v",
        )
    assert played.names() == ["push_candidates", "add_impulse"]
    assert played.of("add_impulse")[0][1:3] == (3, "impulse")
    assert played.of("push_candidates")[0][1:3] == (1, 2)


@pytest.mark.parametrize("straight", [True, False])
def test_velocities_of_points_are_found_by_their_program_or_of_all(straight: bool) -> None:
    played = Played({"play": None, "point_velocities": None})
    usual = SimpleNamespace(
        point_velocity="velocity", programs=np.arange(9), usual_points="usual", every_point="all"
    )
    uncompiled(its.find_velocities, replace=played.parts)(
        "model", "contacts", "v", straight, "tree", usual
    )
    if straight:
        (given,) = played.of("play")
        assert given == (its.VELOCITIES, ("model", "usual", "contacts", "v", "tree", "velocity"))
    else:
        (given,) = played.of("point_velocities")
        assert given == ("model", "all", "contacts", "v", "tree", "velocity")


def test_a_warning_names_what_is_too_stiff_unless_it_is_taken_ahead() -> None:
    build = hs.RobotBuilder("wheel", gravity=0.0)
    build.hinge("axle", None, mass=1.0, inertia=0.5, stiffness=4e6)
    robot = build.build()
    setting: Any = SimpleNamespace(robot=robot, state=robot.reference_state())
    for scheme in Scheme:
        ahead = scheme in (Scheme.MOREAU_JEAN, Scheme.LINEARLY_IMPLICIT)
        told = hs.TimeStepping(scheme=scheme).warning(setting)
        assert ("'axle' is too stiff for a step of 0.001 s" in told) == (not ahead)
        doubts = hs.TimeStepping(scheme=scheme).doubts(robot, setting.state.q)
        assert len(doubts) == (0 if ahead else 1)
    assert hs.TimeStepping().doubts(ROBOT, ROBOT.reference_state().q) == []
