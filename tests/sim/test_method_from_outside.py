"""A method of one's own: made of public names, and as good as those of the package."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
import xarray
from synthetic_runs import box

import heelstrike as hs
from heelstrike.sim import (
    DONE,
    FrictionLaw,
    Kernels,
    Method,
    NormalLaw,
    Setting,
    UnknownMethod,
    add_pushes,
    contact_rows,
    contact_velocity,
    evaluate_equations,
    kernel,
    locate_contacts,
    note_events,
    note_extremes,
    note_row_when_due,
    passive_force,
    share_over_step,
    solve_mass_matrix,
)

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration


class Numbers(hs.Bundle):
    """What the kernels read."""

    step: float = hs.number(float)
    stiffness: float = hs.number(float)
    damping: float = hs.number(float)
    order: int = hs.number(int)


@kernel
def prepare(model: Any, ground: Any, memory: Any, work: Any) -> None:
    evaluate_equations(model, memory.q, memory.v, memory.equations)
    locate_contacts(model, ground, memory.equations.tree, memory.contacts, memory.surface)


@kernel
def decide(
    scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any
) -> int:  # fmt: skip
    model, equations = scene.model, memory.equations
    force, rate = equations.force, equations.rate
    passive_force(model, memory.q, memory.v, force)
    for i in range(model.actuator_joint.shape[0]):
        force[model.actuator_joint[i]] += memory.torque[i]
    if share_over_step(clock.time, work.step, memory.pushes):
        add_pushes(model, equations.tree, memory.pushes, force)
    contacts, assembly = memory.contacts, memory.assembly
    directions = assembly.directions
    for point in range(model.contact_link.shape[0]):
        speed, slip = contact_velocity(model, equations.tree, contacts, point)
        push = -work.stiffness * contacts.gap[point] - work.damping * speed
        push = max(push, 0.0) if contacts.gap[point] < 0.0 else 0.0
        contacts.force[point, 0] = push
        contacts.force[point, 1] = -memory.surface.friction[point] * push * np.tanh(slip / 1e-2)
        memory.reaction.slip[point] = slip
        contact_rows(model, equations.tree, contacts, point, 0, assembly.problem.first, directions)
        for j in range(memory.v.shape[0]):
            for k in range(2):
                force[j] += directions.jacobian[k, j] * contacts.force[point, k]
    for j in range(memory.v.shape[0]):
        rate[j] = force[j] - equations.bias[j]
    solve_mass_matrix(model, equations, rate)
    for j in range(memory.v.shape[0]):
        memory.next_v[j] = memory.v[j] + work.step * rate[j]
    note_extremes(contacts.gap, assembly.answer.residual, memory.tally)
    note_events(
        model, clock.time, clock.time + work.step, work.step, memory.tally.steps, memory.q,
        memory.v, memory.next_v, memory.breakaway, equations.tree, contacts, memory.reaction,
        memory.loops.constraint_force, memory.rows, record.told, memory.reported,
    )  # fmt: skip
    return DONE


@kernel
def report(
    scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any
) -> None:  # fmt: skip
    note_row_when_due(memory, clock, record)


@kernel
def move(
    scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Any
) -> int:  # fmt: skip
    for j in range(memory.v.shape[0]):
        old = memory.v[j]
        memory.v[j] = memory.next_v[j]
        memory.q[j] += work.step * (memory.v[j] if work.order == 0 else old)
    memory.tally.steps += 1
    clock.time = clock.start + (clock.index + 1) * work.step
    return DONE


class Order(enum.Enum):
    VELOCITY_FIRST = 0
    POSITION_FIRST = 1


@dataclass(frozen=True)
class Spring:
    """A law from outside, of a method from outside."""

    stiffness: float = 2e4
    damping: float = 2e2


@dataclass(frozen=True, kw_only=True)
class SpringDamper(Method):
    """Euler's method on springs and dampers."""

    kernels = Kernels(None, prepare, decide, report, move)
    work = Numbers

    step: float = 1e-4
    law: Spring = field(default_factory=Spring)
    order: Order = Order.VELOCITY_FIRST
    attempts: int = 3
    note: str = "soft"
    limit: float | None = None
    strict: bool = False

    @property
    def step_length(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def row_period(self) -> tuple[str, float]:
        return "step", self.step

    @property
    def solves_with(self) -> str:
        return "springs"

    def new_work(self, robot: hs.Robot) -> Numbers:
        return Numbers(
            step=self.step,
            stiffness=self.law.stiffness,
            damping=self.law.damping,
            order=self.order.value,
        )

    def room(self, robot: hs.Robot) -> tuple[int, int]:
        return 1, 2 * (robot.nc + robot.nv) + len(robot.joint_names)

    def check(self, setting: Setting) -> None:
        if setting.robot.nc == 0:
            raise hs.SimulationError("nothing to stand on")


@dataclass(frozen=True, kw_only=True)
class Impulsive(SpringDamper):
    impulses_in_events = True


METHOD = SpringDamper(law=Spring(stiffness=3e4), attempts=5, note="mine", strict=True)
DURATION = 0.1
PUSH = hs.Push("box", force=(2.0, 0.0), start=0.02, duration=0.03)


def drop(method: Method = METHOD, **more: Any) -> hs.Run:
    """A box that falls by 5 mm, is pushed, and comes to rest."""
    robot = box(0.063)
    start = np.array(robot.model.reference)
    start[1] += 5e-3
    return hs.simulate(
        robot, **{"state": hs.State(start, [0.3, 0.0, 0.0]), "duration": DURATION, "method": method,
                  "pushes": [PUSH], **more},
    )  # fmt: skip


@pytest.fixture(scope="module")
def run() -> hs.Run:
    return drop()


def test_it_lands_and_stands(run: hs.Run) -> None:
    assert run.completed, run.message
    assert run.steps == round(DURATION / METHOD.step)
    assert {event.kind.name for event in run.events} >= {"TOUCHDOWN"}
    mass = float(np.sum(run.robot.model.mass))
    push = np.sum(run.contact_force[:-1, :, 0]) * METHOD.step
    gained = run.velocity[-1, 1] - run.velocity[0, 1]
    assert push > 0.1
    assert push == pytest.approx(mass * (gained + 9.81 * DURATION), rel=1e-9)
    assert "SpringDamper" in repr(run)


def test_record_every(run: hs.Run) -> None:
    thin = drop(record_every=10)
    np.testing.assert_array_equal(thin.position, run.position[::10])


def test_pushes_act(run: hs.Run) -> None:
    assert run.final_state.q[0] > drop(pushes=[]).final_state.q[0] + 1e-4


def test_a_snapshot_goes_on_as_if_nothing_had_been(run: hs.Run, tmp_path: Path) -> None:
    half = drop(duration=DURATION / 2)
    assert half.final is not None
    kept = hs.load_snapshot(half.final.save(tmp_path / "half.npz"))
    rest = hs.simulate(half.robot, state=kept, duration=DURATION / 2, method=METHOD)
    np.testing.assert_array_equal(rest.position[-1], run.position[-1])
    with pytest.raises(hs.SimulationError):
        hs.simulate(half.robot, state=kept, duration=0.01, method=replace(METHOD, step=2e-4))


def test_controllers_compiled_and_in_python() -> None:
    gait = walking.gait()
    stock = hs.ComputedTorque(walking.bravo7(), gait)
    calls = []

    class InPython:
        def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
            calls.append(t)
            return stock.torque(t, state, contacts)

    compiled, asked = (
        hs.simulate(walking.bravo7(), law, state=gait.initial_state, duration=0.01, method=METHOD)
        for law in (stock, InPython())
    )
    assert compiled.completed, compiled.message
    assert np.ptp(compiled.torque[:, 0]) > 0.0
    assert calls == pytest.approx(compiled.time)
    np.testing.assert_allclose(asked.torque, compiled.torque, atol=1e-6)


def test_it_is_read_again_as_data_or_with_its_class(run: hs.Run, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.nc")
    again = hs.load_run(path, classes=[SpringDamper, Spring])
    assert again.method == METHOD
    assert type(again.method.attempts) is int  # type: ignore[union-attr]
    for classes in ([], [SpringDamper], [Spring]):
        data = hs.load_run(path, classes=classes)
        assert isinstance(data.method, UnknownMethod)
        assert data.method.name == "SpringDamper"
        assert data.method.settings == {
            "step": 1e-4, "law": "Spring", "law_stiffness": 3e4, "law_damping": 2e2,
            "order": "velocity_first", "attempts": 5, "note": "mine", "limit": "none", "strict": 1,
        }  # fmt: skip
    np.testing.assert_array_equal(data.position, run.position)
    assert str(data.summary()) == str(again.summary())
    assert "SpringDamper" in repr(data)
    with pytest.raises(hs.SimulationError, match="SpringDamper is here as data only"):
        drop(data.method)  # type: ignore[arg-type]
    first, second = (
        xarray.load_dataset(each, engine="h5netcdf")
        for each in (path, data.save(tmp_path / "again.nc"))
    )
    assert first.identical(second)
    assert hs.load_run(tmp_path / "again.nc", classes=[SpringDamper, Spring]).method == METHOD


def test_where_impulses_are_comes_back(run: hs.Run, tmp_path: Path) -> None:
    impulsive = replace(run, method=Impulsive())
    data = hs.load_run(impulsive.save(tmp_path / "run.nc"))
    assert isinstance(data.method, UnknownMethod)
    assert data.method.impulses_in_events
    assert not hs.load_run(run.save(tmp_path / "run.nc")).method.impulses_in_events


class Renamed(hs.TimeStepping):
    """A method of the package under another name."""


def test_a_class_with_no_settings_of_its_own_comes_back(run: hs.Run, tmp_path: Path) -> None:
    method = Renamed(step=2e-3)
    path = replace(run, method=method).save(tmp_path / "run.nc")
    again = hs.load_run(path, classes=[Renamed]).method
    assert type(again) is Renamed
    assert again == method


def test_settings_that_do_not_fit_its_class(run: hs.Run, tmp_path: Path) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Strict(SpringDamper):
        def __post_init__(self) -> None:
            if self.attempts < 9:
                raise ValueError("nine attempts at least")

    Strict.__name__ = "SpringDamper"
    path = run.save(tmp_path / "run.nc")
    with pytest.raises(hs.RunFileError, match="settings of method do not fit: nine attempts"):
        hs.load_run(path, classes=[Strict, Spring])


def test_compare(tmp_path: Path) -> None:
    """Softly or hard, the box falls for as long and loses about as much speed."""
    robot = box(0.063)
    start = np.array(robot.model.reference)
    start[1] += 5e-3
    found = hs.compare(
        robot, methods={"hard": hs.TimeStepping(step=1e-4), "soft": METHOD},
        state=hs.State(start, [0.3, 0.0, 0.0]), duration=DURATION,
    )  # fmt: skip
    assert set(found.runs) == {"hard", "soft"}
    hard, soft = found.runs.values()
    falls = hard.time < 0.03
    np.testing.assert_allclose(soft.position[falls], hard.position[falls], atol=1e-12)
    assert soft.certificates.penetration > 1e-4 > hard.certificates.penetration
    assert "soft" in str(found)


@dataclass(frozen=True, kw_only=True)
class Turf(NormalLaw):
    """A law from outside: blades that bend and give no more than so much, on an oily floor."""

    stiffness: float = 5e4
    most: float = 30.0
    damping: float = 1e2
    name: str = "grass"

    @kernel
    def force(self, gap: float, speed: float) -> tuple[float, float, float]:
        blades = self.most * np.tanh(-self.stiffness * gap / self.most)
        softer = 1.0 - (blades / self.most) ** 2
        if blades <= self.damping * speed:
            return 0.0, 0.0, 0.0
        return blades - self.damping * speed, -self.stiffness * softer, -self.damping


@dataclass(frozen=True)
class Oil(FrictionLaw):
    """Friction that grows with the speed up to the cone's edge; it keeps no bend."""

    drag: float = 20.0

    @kernel
    def force(self, friction: float, normal: float, speed: float, bend: float) -> Any:
        limit = friction * normal
        if self.drag * abs(speed) < limit:
            return (-self.drag * speed, 0.0, -self.drag, 0.0), (0.0, 0.0, 0.0, 0.0), False
        side = 1.0 if speed > 0.0 else -1.0
        return (-side * limit, -side * friction, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), True


@pytest.fixture(scope="module")
def on_turf() -> hs.Run:
    return drop(hs.Compliant(law=Turf(), friction=Oil(), step=1e-3), duration=1.0, pushes=[])


def test_a_contact_law_from_outside(on_turf: hs.Run) -> None:
    """The box stands as deep as its weight asks for, and oil stops it as it stops anything.

    Four corners carry 9.81 m / 4 each, ``most tanh(k δ / most)``; the speed falls like
    exp(−4 drag t / m) once no corner slides.
    """
    run = on_turf
    assert run.completed, run.message
    mass = float(np.sum(run.robot.model.mass))
    share = 9.81 * mass / np.sum(run.gap[-1] < 0.0)
    law = Turf()
    deep = law.most / law.stiffness * np.arctanh(share / law.most)
    assert -run.gap[-1].min() == pytest.approx(deep, rel=1e-3)
    kinds = [event.kind.name for event in run.events]
    assert kinds.index("TOUCHDOWN") < kinds.index("SLIP")
    slow = (run.time > 0.6) & (np.abs(run.velocity[:, 0]) > 1e-9)
    closed = np.sum(run.gap[slow][0] < 0.0)
    rate = np.polyfit(run.time[slow], np.log(np.abs(run.velocity[slow, 0])), 1)[0]
    assert rate == pytest.approx(-closed * Oil().drag / mass, rel=1e-2)
    assert "Turf" in run.solver.name


def test_it_is_recorded_saved_loaded_and_compared(on_turf: hs.Run, tmp_path: Path) -> None:
    path = on_turf.save(tmp_path / "run.nc")
    assert hs.load_run(path, classes=[Turf, Oil]).method == on_turf.method
    data = hs.load_run(path, classes=[Turf])
    assert isinstance(data.method, UnknownMethod)
    assert data.method.settings["law_most"] == 30.0
    assert data.method.settings["friction_drag"] == 20.0
    np.testing.assert_array_equal(data.contact_force, on_turf.contact_force)
    robot = on_turf.robot
    found = hs.compare(
        robot, methods={"turf": on_turf.method, "foam": hs.Compliant(law=Turf(stiffness=2e3))},
        state=hs.State(on_turf.position[0], on_turf.velocity[0]), duration=0.1,
    )  # fmt: skip
    turf, foam = found.runs.values()
    assert foam.certificates.penetration > 1.2 * turf.certificates.penetration > 1e-4


def test_a_law_that_is_none() -> None:
    class Bare(NormalLaw):
        pass

    class Broken(NormalLaw):
        @kernel
        def force(self, gap: float, speed: float) -> Any:
            return self.nothing * gap

    for law, words in (
        (dataclass(frozen=True)(Bare)(), "Bare has no kernel: write force"),
        (dataclass(frozen=True)(Broken)(), "Broken cannot be compiled"),
        (Oil(), "another normal law, got Oil"),
    ):
        with pytest.raises(hs.SimulationError, match=words):
            drop(hs.Compliant(law=law))
