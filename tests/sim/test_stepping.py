"""Simulations that are stepped, pushed, kept and taken up again, here and in another process."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from fresh_python import fresh_python
from synthetic_runs import box

import heelstrike as hs
from heelstrike.sim import RunStatus, Scheme, snapshot
from heelstrike.sim import simulation as simulation_module
from heelstrike.sim.record.record import allocate_record

METHODS = {
    "time stepping": hs.TimeStepping(),
    "linearly implicit": hs.TimeStepping(step=2e-3, scheme=Scheme.LINEARLY_IMPLICIT),
    "event driven": hs.EventDriven(),
    "event driven, a row a step": hs.EventDriven(output_period=None),
    "compliant": hs.Compliant(),
}


class Sway:
    """Torques that depend on all calls before: a controller in Python that can be kept."""

    def __init__(self) -> None:
        self.calls = 0

    def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
        self.calls += 1
        return 0.1 * np.sin(0.7 * self.calls) - 0.5 * state.v[3:]

    def snapshot(self) -> np.ndarray:
        return np.array([self.calls])

    def restore(self, numbers: np.ndarray) -> None:
        self.calls = int(numbers[0])


def computed_torque() -> hs.ComputedTorque:
    return hs.ComputedTorque(walking.bravo7(), walking.gait(), encoder=hs.Encoder())


CONTROLLERS = {"stock": computed_torque, "python": Sway, "none": lambda: None}


def simulation(method: str, controller: str = "stock", **options: Any) -> hs.Simulation:
    start = {"state": walking.gait().initial_state} | options
    return hs.Simulation(
        walking.bravo7(), CONTROLLERS[controller](), method=METHODS[method], **start
    )


def assert_same(one: hs.Run, other: hs.Run, since: float = -1.0) -> None:
    """Rows and events of one run are those of another from a time on, to the last bit."""
    for name in ("time", "position", "velocity", "torque", "contact_force", "gap", "residual"):
        mine, its = (getattr(run, name)[run.time > since + 1e-9] for run in (one, other))
        np.testing.assert_array_equal(mine, its, name)
    mine, its = ([e for e in run.events if e.time > since + 1e-9] for run in (one, other))
    assert mine == its


@pytest.mark.parametrize("method", METHODS)
def test_a_simulation_that_is_advanced_is_that_of_simulate(method: str) -> None:
    stepped = simulation(method)
    assert stepped.advance(0.3) is RunStatus.COMPLETED
    run = hs.simulate(
        walking.bravo7(), computed_torque(), state=walking.gait().initial_state,
        method=METHODS[method], duration=0.3,
    )  # fmt: skip
    assert_same(run, stepped.record)
    assert stepped.record.certificates == run.certificates
    assert stepped.record.message == run.message


@pytest.mark.parametrize("method", METHODS)
def test_steps_add_up(method: str) -> None:
    stepped, advanced = simulation(method, "none"), simulation(method, "none")
    while stepped.time < 0.05:
        assert stepped.step() is RunStatus.COMPLETED
    advanced.advance(stepped.time)
    if not method.startswith("event driven"):  # whose steps end where they are told to
        np.testing.assert_array_equal(stepped.state.q, advanced.state.q)
        assert stepped.record.steps == advanced.record.steps
    np.testing.assert_allclose(stepped.state.q, advanced.state.q, atol=1e-7)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("method", METHODS)
def test_looking_at_the_record_changes_nothing(method: str, controller: str) -> None:
    looked, left = simulation(method, controller), simulation(method, controller)
    for k in range(40):
        looked.step()
        left.step()
        if k % 7 == 0:
            assert looked.record.time[-1] == looked.time
            assert len(looked.contacts.gap) == 4
    assert_same(left.record, looked.record)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("method", METHODS)
def test_forgetting_the_record_changes_nothing(method: str, controller: str) -> None:
    pushes = [
        hs.Push("trunk", force=(9.0, 0.0), start=start, duration=0.004)
        for start in (0.002, 0.0105, 0.018)
    ]
    looked, left = (simulation(method, controller, pushes=pushes) for _ in range(2))
    for time in (0.005, 0.012, 0.02):
        looked.advance(time)
        left.advance(time)
        looked.forget()
        assert (looked.record.time >= looked.time - 1e-9).all()
        # Only what is over is forgotten.
        assert looked.record.pushes == tuple(push for push in pushes if push.end >= looked.time)
    looked.advance(0.03)
    left.advance(0.03)
    assert_same(left.record, looked.record, since=0.02)
    assert looked.record.time[0] >= 0.02 - 1e-9


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("steps", [0, 1, 23])
def test_a_snapshot_goes_on_to_the_last_bit(method: str, controller: str, steps: int) -> None:
    """In a simulation that has done something else meanwhile, through a push and an impact."""
    push = hs.Push("trunk", force=(20.0, 0.0), start=0.02, duration=0.05)
    never = simulation(method, controller, pushes=push)
    for _ in range(steps):
        never.step()
    kept = never.snapshot()
    other = simulation(
        method, controller, state=hs.State(walking.gait().initial_state.q, np.ones(9))
    )
    other.advance(0.03)
    other.restore(kept)
    assert other.time == never.time
    for each in (never, other):
        for _ in range(60):
            each.step()
    np.testing.assert_array_equal(never.state.q, other.state.q)
    np.testing.assert_array_equal(never.state.v, other.state.v)
    assert_same(never.record, other.record, since=kept.time)


FRESH = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import heelstrike as hs
from {module} import simulation
kept = hs.load_snapshot(sys.argv[2])
again = simulation(sys.argv[3], sys.argv[4], state=kept)
for _ in range(50):
    again.step()
np.savez(sys.argv[5], q=again.state.q, v=again.state.v, time=again.time)
"""


@pytest.mark.parametrize(
    ("method", "controller"),
    [("time stepping", "stock"), ("event driven", "python"), ("compliant", "stock")],
)
def test_a_snapshot_goes_on_in_another_process(
    method: str, controller: str, tmp_path: Path
) -> None:
    never = simulation(method, controller)
    for _ in range(17):
        never.step()
    file = never.snapshot().save(tmp_path / "kept.npz")
    # The same module, for a controller in Python is known by it and by its class.
    copy = tmp_path.joinpath(*__name__.split(".")).with_suffix(".py")
    copy.parent.mkdir(parents=True, exist_ok=True)
    for folder in copy.relative_to(tmp_path).parents[:-1]:  # a package comes before one elsewhere
        (tmp_path / folder / "__init__.py").touch()
    copy.write_text(Path(__file__).read_text(encoding="utf-8"))
    places = [str(tmp_path), str(Path(__file__).parents[1])]
    script = FRESH.replace("sys.path.insert(0, sys.argv[1])", f"sys.path[:0] = {places!r}")
    script = script.format(module=__name__)
    fresh_python("-c", script, "", str(file), method, controller, str(tmp_path / "end"))
    for _ in range(50):
        never.step()
    end = np.load(tmp_path / "end.npz")
    assert end["time"] == never.time
    np.testing.assert_array_equal(end["q"], never.state.q)
    np.testing.assert_array_equal(end["v"], never.state.v)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("stop", [0.12, 0.1237])
def test_a_run_goes_on_as_if_it_had_not_stopped(method: str, controller: str, stop: float) -> None:
    if METHODS[method].step_length is not None:
        stop = round(stop / METHODS[method].step_length) * METHODS[method].step_length
    robot, start = walking.bravo7(), walking.gait().initial_state
    options: dict[str, Any] = {"method": METHODS[method]}
    whole = hs.simulate(robot, CONTROLLERS[controller](), state=start, duration=0.2, **options)
    first = hs.simulate(robot, CONTROLLERS[controller](), state=start, duration=stop, **options)
    assert first.final is not None
    assert first.final.time == first.time[-1]
    second = hs.simulate(
        robot, CONTROLLERS[controller](), state=first.final, duration=0.2 - stop, **options
    )
    assert second.time[-1] == pytest.approx(0.2)
    assert_same(whole, second, since=stop)


def test_what_is_pushed_goes_where_it_is_pushed() -> None:
    """A free block of 2 kg: 10 N for 0.1 s is 0.5 m/s, from the very instant it is applied."""
    for method in (hs.TimeStepping(step=1e-3), hs.EventDriven(), hs.Compliant()):
        block = box()
        state = hs.State(block.model.reference + np.array([0.0, 5.0, 0.0]), np.zeros(3))
        pushed = hs.Simulation(block, state=state, method=method)
        pushed.advance(0.2)
        pushed.apply(hs.Push(0, force=(10.0, 0.0), start=0.2, duration=0.1, point=(0.0, 0.0)))
        mass = float(np.sum(block.model.mass))
        pushed.advance(0.25)
        assert pushed.state.v[0] == pytest.approx(0.5 / mass, rel=1e-9)
        pushed.advance(0.5)
        assert pushed.state.v[0] == pytest.approx(1.0 / mass, rel=1e-9)
        assert len(pushed.record.pushes) == 1


def test_another_controller_begins_anew_and_acts_at_once() -> None:
    swaying = simulation("time stepping", "none")
    swaying.advance(0.01)
    swaying.controller = Sway()
    swaying.advance(0.02)
    torque = swaying.record.torque
    assert not torque[:10].any()
    assert torque[10:].all(axis=1).all()


def test_ground_is_not_laid_into_a_foot() -> None:
    standing = simulation("time stepping")
    standing.advance(0.05)
    before = standing.ground
    with pytest.raises(hs.SimulationError, match=r"would be .* above contact point .*lower it"):
        standing.ground = hs.Ground(profile=[[-1.0, 0.02], [1.0, 0.02]])
    assert standing.ground is before
    standing.ground = hs.Ground(friction=0.1)
    standing.advance(0.1)
    assert standing.record.ground.friction == 0.1


@pytest.mark.parametrize("method", METHODS)
def test_it_goes_on_from_a_state_that_is_set_as_if_it_had_begun_there(method: str) -> None:
    """Whatever touched before: feet on the ground, knees at their stops."""
    robot = walking.bravo7()
    one = simulation(method, "none", stop_when_fallen=False)
    one.advance(0.3)
    bent = robot.state({"left_knee": 1.0, "right_hip": -0.4, "root_z": 1.0}, {"root_z": -0.2})
    bent = robot.placed(bent, one.ground)
    one.state = bent
    np.testing.assert_array_equal(one.state.q, bent.q)
    assert one.time == pytest.approx(0.3)
    one.advance(0.34)
    other = simulation(method, "none", state=bent, stop_when_fallen=False)
    other.advance(0.04)
    # Methods of adaptive steps begin with steps of other lengths; stiff ground needs most of them.
    np.testing.assert_allclose(one.state.q, other.state.q, atol=1e-5)
    np.testing.assert_allclose(one.state.v, other.state.v, atol=1e-3)
    assert one.record.time[-1] == pytest.approx(0.34)


def test_a_state_that_cannot_be_is_not_set() -> None:
    one, robot = simulation("time stepping"), walking.bravo7()
    before = one.state.q
    with pytest.raises(hs.SimulationError, match=r"would be 0.1 m in the ground; robot.placed"):
        one.state = robot.state({"root_z": robot.reference_state().q[1] - 0.1})
    with pytest.raises(hs.SimulationError, match="must have 9 entries"):
        one.state = hs.State(np.zeros(8), np.zeros(9))
    np.testing.assert_array_equal(one.state.q, before)


def test_a_snapshot_brings_its_ground_and_its_pushes() -> None:
    ground = hs.Ground(friction=[0.5, 0.9], profile=[[-9.0, 0.0], [0.7, 0.0], [9.0, 0.0]])
    one = simulation("time stepping", ground=ground)
    one.apply(hs.Push("trunk", force=(5.0, 1.0), start=0.1, duration=0.3))
    one.advance(0.1)
    other = simulation("time stepping", state=one.snapshot())
    np.testing.assert_array_equal(other.ground.model().friction, [0.5, 0.9])
    assert other.record.pushes[0].duration == 0.3
    one.advance(0.3)
    other.advance(0.3)
    np.testing.assert_array_equal(one.state.q, other.state.q)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"method": hs.TimeStepping(step=2e-3)}, "another method"),
        ({"record_every": 2}, "another record_every"),
        ({"control_period": 2e-3}, "another control_period"),
    ],
)
def test_a_snapshot_of_something_else_is_refused(change: dict[str, Any], words: str) -> None:
    kept = simulation("time stepping").snapshot()
    options = {"state": walking.gait().initial_state} | change
    other = hs.Simulation(walking.bravo7(), computed_torque(), **options)  # type: ignore[arg-type]
    with pytest.raises(hs.SimulationError, match=words):
        other.restore(kept)
    rabbit = hs.load_robot("rabbit")
    another = hs.Simulation(rabbit, state=rabbit.reference_state())
    with pytest.raises(hs.SimulationError, match="another robot"):
        another.restore(kept)


def test_snapshots_of_an_older_layout_are_refused_for_that(tmp_path: Path) -> None:
    """Before points could touch two faces, arrays were shorter; such a file is not damaged."""
    kept = simulation("time stepping").snapshot()
    identity = np.array(json.dumps({"format": 1, **kept.identity}))
    np.savez(tmp_path / "old.npz", identity=identity, **kept.arrays)
    with pytest.raises(hs.SimulationError, match="layout 1, this version of heelstrike reads 12"):
        hs.load_snapshot(tmp_path / "old.npz")


@pytest.mark.slow
def test_other_names_of_arrays_are_another_layout() -> None:
    """Files hold arrays by their names: where one is renamed, _FORMAT of sim/snapshot.py is raised.

    Otherwise files that an earlier version wrote are called damaged.
    """
    kept = {method: simulation(method, "none").snapshot().arrays for method in METHODS}
    spatial = hs.load_robot("bravo7", dimension=3)
    still = hs.Simulation(spatial, state=spatial.reference_state())
    kept["in space"] = still.snapshot().arrays
    names = {
        method: sorted(f"{name} {each.dtype}" for name, each in arrays.items())
        for method, arrays in kept.items()
    }
    digest = hashlib.sha256(json.dumps(names, sort_keys=True).encode()).hexdigest()[:16]
    assert (snapshot._FORMAT, digest) == (12, "7c541a7f5e40909e")


def test_files_that_are_no_snapshots_are_refused(tmp_path: Path) -> None:
    with pytest.raises(hs.SimulationError, match="cannot be read"):
        hs.load_snapshot(tmp_path / "nothing.npz")
    (tmp_path / "text.npz").write_text("not an archive")
    np.savez(tmp_path / "other.npz", x=np.ones(3))
    np.save(tmp_path / "array.npy", np.ones(3))
    for name in ("text.npz", "other.npz", "array.npy"):
        with pytest.raises(hs.SimulationError, match="not a snapshot"):
            hs.load_snapshot(tmp_path / name)
    kept = simulation("time stepping").snapshot()
    del kept.arrays["memory.q"]
    with pytest.raises(hs.SimulationError, match="damaged"):
        simulation("time stepping").restore(kept)


def test_a_python_controller_that_cannot_be_kept_is_refused_in_words() -> None:
    class Forgetful:
        def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
            return np.zeros(6)

    some = hs.Simulation(walking.bravo7(), Forgetful(), state=walking.gait().initial_state)
    assert len(some.record.time) == 0  # of a simulation that has not begun, either
    some.advance(0.01)
    with pytest.raises(hs.ControllerError, match=r"Forgetful.torque takes no part .*snapshot\(\)"):
        some.snapshot()
    assert len(some.record.time) == 10  # and none for now
    run = hs.simulate(
        walking.bravo7(), Forgetful(), state=walking.gait().initial_state, duration=0.01
    )
    assert run.final is None


def test_what_has_ended_has_ended_until_it_is_restored() -> None:
    falling = simulation("time stepping", "none")
    kept = falling.snapshot()
    assert falling.advance(5.0) is RunStatus.FELL
    with pytest.raises(hs.SimulationError, match=r"has ended: .* fell .* Restore a snapshot"):
        falling.step()
    falling.restore(kept)
    assert falling.step() is RunStatus.COMPLETED
    with pytest.raises(hs.SimulationError, match="before the present time"):
        falling.advance(0.0005)


@pytest.mark.parametrize("method", METHODS)
def test_a_robot_that_fell_falls_on_without_that_instant_twice(method: str) -> None:
    robot, start = walking.bravo7(), walking.gait().initial_state
    options: dict[str, Any] = {"method": METHODS[method], "control_period": 2e-3}
    fell = hs.simulate(robot, Sway(), state=start, duration=5.0, **options)
    assert fell.status is RunStatus.FELL
    on = fell.time[-1] + 0.05
    whole = hs.simulate(robot, Sway(), state=start, duration=on, stop_when_fallen=False, **options)
    falling = hs.Simulation(robot, Sway(), state=fell.final, stop_when_fallen=False, **options)
    falling.advance(on)
    assert_same(whole, falling.record, since=fell.time[-1])


@pytest.mark.parametrize("method", METHODS)
def test_what_is_changed_acts_where_a_robot_fell(method: str) -> None:
    """A push that begins with that instant is all that is new."""
    fell = hs.simulate(
        walking.bravo7(), state=walking.gait().initial_state, duration=5.0, method=METHODS[method]
    )
    push = hs.Push("trunk", force=(3000.0, 0.0), start=fell.time[-1], duration=1e-2)
    falling, pushed = (
        hs.Simulation(
            walking.bravo7(), state=fell.final, method=METHODS[method], stop_when_fallen=False,
            pushes=pushes,
        )
        for pushes in ((), push)
    )  # fmt: skip
    for one in (falling, pushed):
        one.advance(fell.time[-1] + 0.01)
    robot = walking.bravo7()
    before, after = (
        hs.dynamics.momentum(robot, one.state.q, one.state.v)[0] for one in (falling, pushed)
    )
    assert after - before > 5.0  # of 30 N s, and the ground holds


@pytest.mark.parametrize("method", METHODS)
def test_a_state_that_is_set_knows_nothing_of_the_old_place(method: str) -> None:
    """No force, no touchdown and no lift-off of where the robot was."""
    standing = simulation(method, "none", stop_when_fallen=False)
    standing.advance(0.1)
    assert standing.contacts.force.any()
    up = walking.gait().initial_state
    standing.forget()
    standing.state = hs.State(up.q + np.array([0.0, 0.5, *np.zeros(len(up.q) - 2)]), up.v)
    assert not standing.contacts.force.any()
    standing.advance(0.15)
    assert not [each for each in standing.record.events if each.contact < 4]


def test_ctrl_c_stops_and_the_simulation_goes_on() -> None:
    def interrupt(t: float) -> None:
        raise KeyboardInterrupt

    some, left = simulation("time stepping"), simulation("time stepping")
    assert some.advance(1.0, progress=interrupt) is RunStatus.INTERRUPTED
    assert 0.0 < some.time < 1.0
    assert some.advance(1.0) is RunStatus.COMPLETED
    left.advance(1.0)
    np.testing.assert_array_equal(some.state.q, left.state.q)


def test_controllers_in_python_are_known_by_where_they_are_defined() -> None:
    class Sway:  # by the same name, but another
        def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
            return np.zeros(6)

        def snapshot(self) -> np.ndarray:
            return np.zeros(1)

        def restore(self, numbers: np.ndarray) -> None:
            raise AssertionError("this is not its memory")

    kept = simulation("time stepping", "python").snapshot()
    other = hs.Simulation(walking.bravo7(), Sway(), state=walking.gait().initial_state)
    theirs, its = re.escape(f"{__name__}.Sway"), re.escape(f"{__name__}.{Sway.__qualname__}")
    with pytest.raises(
        hs.SimulationError, match=f"another controller, {theirs}; the simulation has {its}"
    ):
        other.restore(kept)


def test_where_there_is_no_memory_for_more_of_the_record(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was recorded until then is kept, and the simulation goes on when there is some."""
    some, left = simulation("time stepping"), simulation("time stepping")
    chunks = []

    def allocate(*arguments: Any) -> Any:
        if chunks:
            raise MemoryError
        chunks.append(allocate_record(*arguments))
        return chunks[0]

    with monkeypatch.context() as patched:
        patched.setattr(simulation_module, "CHUNK", 64)
        patched.setattr(simulation_module, "allocate_record", allocate)
        assert some.advance(0.2) is RunStatus.INTERRUPTED
    assert "no memory left to record more" in some.message
    assert isinstance(some.error, MemoryError)
    assert some.time == pytest.approx(0.064, abs=2e-3)
    assert some.record.time[-1] == pytest.approx(some.time, abs=2e-3)
    assert some.advance(0.2) is RunStatus.COMPLETED
    left.advance(0.2)
    assert_same(some.record, left.record)


def test_where_there_is_no_memory_for_any_record(monkeypatch: pytest.MonkeyPatch) -> None:
    def allocate(*_: Any) -> Any:
        raise MemoryError

    some = simulation("time stepping")
    monkeypatch.setattr(simulation_module, "allocate_record", allocate)
    with pytest.raises(hs.SimulationError, match="no memory left for the record"):
        some.advance(0.1)
