"""Environment steps a second, beside those of Gymnasium and MuJoCo in the same run.

``python benchmarks/learning.py speed`` moves Walker2d with random actions, resets included: the
native vector and a single environment in a Python loop, the physics alone (the same lanes, which
start again in the same states, without observations, rewards and noise), Gymnasium's own
environments one by one (sync) and in processes (async), and MuJoCo's ``rollout``. ``... identical``
compares lanes with single simulations, bit by bit. ``... endure`` makes many steps and prints how
memory grows, why episodes ended, and the worst certificates. ``... walk --policy FILE`` commands
speeds to a policy of Walk-v0 and to footstep feedback, pushes both, and prints who is upright after
20 s and how far mean speeds are off. ``... defects --policy FILE`` runs a policy in MuJoCo at
several time steps and on floors of several coefficients of friction, and here likewise.
``... call`` times a policy of two layers of 64 in the compiled loop.

Times are processor times of this process but for async, whose work is done by others (clock); of
each the best of several repetitions is printed, which are interleaved.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import heelstrike as hs

if find_spec("imageio") is None:  # Gymnasium imports it for films, which nobody takes here
    sys.modules["imageio"] = ModuleType("imageio")

import gymnasium

from heelstrike.control.policy.network import Layer, load_network
from heelstrike.experiments.learning import environments
from heelstrike.experiments.learning import transfer as worlds
from heelstrike.experiments.learning.courses import told_task
from heelstrike.experiments.learning.running import RunningCourse
from heelstrike.experiments.learning.tasks import RUNNING, RunningTask
from heelstrike.experiments.learning.walk_task import WalkTask
from heelstrike.experiments.walk import design

Timed = Callable[[], tuple[int, float]]


def timed(
    steps: Callable[[], int], begin_anew: Callable[[], Any],
    clock: Callable[[], float] = time.process_time,
) -> Timed:  # fmt: skip
    """Return what times some steps, but for what comes before the first."""

    def once() -> tuple[int, float]:
        begin_anew()
        begin = clock()
        count = steps()
        return count, clock() - begin

    return once


def speed(task: str, lanes: int, decisions: int, repetitions: int, *, peers: bool) -> None:
    """Print steps a second."""
    actions = np.random.default_rng(0).uniform(
        -1, 1, (decisions, lanes, RunningCourse(RUNNING[task]).robot.nu)
    )
    actions = actions.astype(np.float32)
    vector = environments.TaskVectorEnv(task, lanes)
    single = environments.TaskEnv(task)
    course = RunningCourse(RUNNING[task], lanes)
    kept: list[Any] = []
    first: list[Any] = []

    def run_vector() -> int:
        for action in actions:
            vector.step(action)
        return decisions * lanes

    def keep_episodes() -> None:
        """Note the very episodes that the vector goes through, to move them without it."""
        vector.reset(seed=0)
        batch = vector._lanes.batch
        first.extend((batch.position.copy(), batch.velocity.copy()))
        for action in actions:
            over = np.flatnonzero(vector._over)
            vector.step(action)
            kept.append((over, batch.position[over].copy(), batch.velocity[over].copy()))

    def run_physics() -> int:
        batch = course.batch
        for action, (over, q, v) in zip(actions, kept, strict=True):
            np.multiply(action, course.gear, out=batch.command)
            if over.size:  # these start again, and do not move
                batch._begin_anew(over, q, v)
                moves = np.ones(lanes, dtype=bool)
                moves[over] = False
                batch.step(RUNNING[task].frame_skip, moves)
            else:
                batch.step(RUNNING[task].frame_skip)
        return decisions * lanes

    def run_single() -> int:
        for action in actions[:, 0]:
            if single.step(action)[2]:
                single.reset()
        return decisions

    keep_episodes()
    tried: dict[str, Timed] = {
        f"native vector, {lanes} lanes": timed(run_vector, lambda: vector.reset(seed=0)),
        "physics alone": timed(run_physics, lambda: course.batch.reset(None, hs.State(*first))),
        "single environment, Python loop": timed(run_single, lambda: single.reset(seed=0)),
    }
    if peers:
        few = max(decisions // 10, 1)
        theirs = gymnasium.make_vec(f"{task}-v5", lanes, "sync")
        others = gymnasium.make_vec(f"{task}-v5", lanes, "async")

        def run(env: Any) -> Callable[[], int]:
            def steps() -> int:
                for action in actions[:few]:
                    env.step(action)
                return few * lanes

            return steps

        tried["Gymnasium, sync"] = timed(run(theirs), lambda: theirs.reset(seed=0))
        tried["Gymnasium, async (clock)"] = timed(
            run(others), lambda: others.reset(seed=0), time.perf_counter
        )
        tried["mujoco.rollout, one thread"] = timed(
            rollout(task, lanes, few, actions), lambda: None
        )
    best = dict.fromkeys(tried, 0.0)
    for _ in range(repetitions):
        for name, once in tried.items():
            count, seconds = once()
            best[name] = max(best[name], count / seconds)
    print(f"{task}, random actions, environment steps a second:")
    for name, rate in best.items():
        print(f"  {name:34s} {rate:10.0f}")
    share = best[f"native vector, {lanes} lanes"] / best["physics alone"]
    print(f"  the vector has {share:.2f} of the speed of the physics alone")


def rollout(task: str, lanes: int, decisions: int, actions: Any) -> Callable[[], int]:
    """Return what moves MuJoCo's lanes by its own loop."""
    import mujoco
    from mujoco import rollout as rolling

    env: Any = gymnasium.make(f"{task}-v5").unwrapped
    model, data = env.model, mujoco.MjData(env.model)
    mujoco.mj_forward(model, data)
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    control = np.repeat(actions[:decisions].swapaxes(0, 1), env.frame_skip, axis=1)

    def steps() -> int:
        rolling.rollout(model, data, np.tile(state, (lanes, 1)), control.astype(np.float64))
        return decisions * lanes

    return steps


def identical(lanes: int, steps: int, seed: int) -> None:
    """Compare random lanes of Walker2d with single simulations."""
    random = np.random.default_rng(seed)
    task = RUNNING["Walker2d"]
    robot = task.robot()
    start = robot.reference_state()
    states = [
        hs.State(start.q + random.normal(0, 0.05, robot.nq), random.normal(0, 0.5, robot.nv))
        for _ in range(lanes)
    ]
    grounds = [hs.Ground(friction=mu) for mu in random.uniform(0.2, 2.0, lanes)]
    torques = random.uniform(-100, 100, (steps // task.frame_skip, lanes, robot.nu))
    options: Any = {"method": hs.TimeStepping(step=task.step), "stop_when_fallen": False}
    ends = []
    for threads in (1, 2, 5):
        batch = hs.Batch(
            robot, hs.HeldTorque(robot), state=states, ground=grounds, threads=threads, **options
        )
        for torque in torques:
            batch.command[:] = torque
            batch.step(task.frame_skip)
        ends.append(batch)
    different = 0
    for lane in range(lanes):
        single = hs.Simulation(
            robot, hs.HeldTorque(robot), state=states[lane], ground=grounds[lane],
            record_every=2**40, **options,
        )  # fmt: skip
        for torque in torques:
            single.parameters.torque[:] = torque[lane]  # type: ignore[attr-defined]
            for _ in range(task.frame_skip):
                if single.status is hs.RunStatus.COMPLETED:
                    single.step()
        different += not all(
            np.array_equal(batch.position[lane], single.state.q)
            and np.array_equal(batch.velocity[lane], single.state.v)
            for batch in ends
        )
    print(f"{lanes} lanes x {steps} steps, 1, 2 and 5 threads: {different} differ")


def endure(task: str, lanes: int, decisions: int) -> None:
    """Make many steps with random actions; print memory, ends and certificates ten times."""
    vector = environments.TaskVectorEnv(task, lanes)
    random = np.random.default_rng(0)
    vector.reset(seed=0)
    causes: Counter[str] = Counter()
    worst, ends, begin = 0.0, 0, time.process_time()
    with suppress(KeyboardInterrupt):  # what there is by then is told all the same
        for decision in range(1, decisions + 1):
            action = random.uniform(-1, 1, (lanes, vector.single_action_space.shape[0]))
            *_, terminated, truncated, info = vector.step(action)
            worst = max(worst, float(info["certificate"].max()))
            ends += int(terminated.sum() + truncated.sum())
            if terminated.any():
                causes.update(re.sub(r"-?[0-9.]+(e[-+]?[0-9]+)?", "N", each)
                              for each in info["cause"][terminated])  # fmt: skip
            if decision % max(decisions // 10, 1) == 0:
                pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
                done, seconds = decision * lanes, time.process_time() - begin
                print(
                    f"{done:12d} steps, {pages * 4096 / 2**20:7.1f} MB, {ends} ends, "
                    f"worst certificate {worst:.2g}, {done / seconds:.0f} steps/s", flush=True,
                )  # fmt: skip
    for cause, count in causes.most_common():
        print(f"  {count:8d} {cause}")
    going = int(vector._lanes.batch.going.sum())
    print(f"  {ends - sum(causes.values()):8d} truncated; {going} of {lanes} lanes can go on")


def call(lanes: int, repetitions: int) -> None:
    """Print what a call of a policy of Walker2d costs, beside torques that are held."""
    task, random = RUNNING["Walker2d"], np.random.default_rng(0)
    robot = task.robot()
    sizes = (robot.nq + robot.nv - 1, 64, 64, robot.nu)
    layers = [  # the last gives no torque, so that both move alike
        Layer(random.normal(0, 0.1 * (after == 64), (after, before)), np.zeros(after),
              activation="tanh" if after == 64 else "linear")
        for before, after in pairwise(sizes)
    ]  # fmt: skip
    network = RunningCourse(task).network(tuple(layers), np.zeros(sizes[0]), np.ones(sizes[0]))
    network = replace(network, period=task.step)  # called in every step
    best = dict.fromkeys(("held", "policy"), np.inf)
    batches = {
        name: hs.Batch(
            robot, law, lanes=lanes, state=robot.reference_state(), stop_when_fallen=False,
            method=hs.TimeStepping(step=task.step), ground=hs.Ground(friction=task.friction),
        )
        for name, law in (("held", hs.HeldTorque(robot)), ("policy", hs.Policy(network, robot)))
    }  # fmt: skip
    for _ in range(repetitions):
        for name, batch in batches.items():
            batch.reset()
            begin = time.process_time()
            batch.step(50)
            best[name] = min(best[name], (time.process_time() - begin) / (50 * lanes))
    print(f"a policy of 64 x 64: {1e6 * (best['policy'] - best['held']):.2f} us a call")


def walk(policy: Path, count: int, impulse: float, seed: int) -> None:
    """Command speeds to a policy and to footstep feedback, under the same pushes."""
    duration, settled, every = 20.0, 2.0, 3.5
    network = load_network(policy)
    task = told_task(network.about)
    assert isinstance(task, WalkTask)
    assert network.reference is not None
    robot, reference, random = task.robot(), network.reference, np.random.default_rng(seed)
    gait = design(robot, friction=task.friction)
    options: Any = {"duration": duration, "ground": hs.Ground(friction=task.friction)}
    nominal = gait.step_length / gait.step_duration
    for what, speeds, push in (
        (f"track {nominal:.2f} m/s", np.full(count, nominal), 0.0),
        (f"{task.speeds[0]:g} to {task.speeds[1]:g} m/s, pushes of {impulse:g} N s",
         random.uniform(*task.speeds, count), impulse),
    ):  # fmt: skip
        pushes = [
            [hs.Push("trunk", force=(10.0 * push * random.choice((-1.0, 1.0)), 0.0), duration=0.1,
                     start=begin + random.uniform(0.0, 1.4))
             for begin in np.arange(settled, duration - every / 2, every)]
            for _ in range(count)
        ]  # fmt: skip
        rows = [int(np.argmin(np.abs(reference.speed - speed))) for speed in speeds]
        begins = [reference.motion[row, 0] for row in rows]
        states = [
            hs.State(each[: robot.nq], each[robot.nq : robot.nq + robot.nv]) for each in begins
        ]
        tried: dict[str, tuple[Any, Any, Any]] = {
            "policy": (
                [hs.Policy(network, robot, speed=speed) for speed in speeds], states,
                hs.TimeStepping(step=task.step),
            ),
            "footstep feedback": (
                [hs.FootstepFeedback(robot, gait, speed=speed) for speed in speeds],
                gait.initial_state, hs.TimeStepping(step=1e-3),
            ),
        }  # fmt: skip
        for name, (laws, state, method) in tried.items():
            begin = time.process_time()
            found = hs.simulate_batch(
                robot, laws, state=state, pushes=pushes, method=method, record_every=50, **options
            )
            stood = np.array([each is hs.RunStatus.COMPLETED for each in found.status])
            runs = [found.run(i) for i in np.flatnonzero(stood)]
            mean = np.array([
                (run.position[-1, 0] - run.position[k, 0]) / (run.time[-1] - run.time[k])
                for run in runs for k in [int(np.searchsorted(run.time, settled))]
            ])  # fmt: skip
            off = mean - speeds[stood]
            print(
                f"{what}: {name:18s} upright {stood.mean():4.0%} of {count}, mean speed off by "
                f"{np.sqrt(np.mean(off**2)):.3f} m/s rms ({time.process_time() - begin:.1f} s)",
                flush=True,
            )  # fmt: skip


def defects(policy: Path, count: int) -> None:
    """Print what depends on the time step, and on the friction of the floor."""
    network = load_network(policy)
    task = told_task(network.about)
    assert isinstance(task, RunningTask)

    def told(where: str, found: worlds.Outcome) -> None:
        row = found.row()
        print(
            f"{where:44s} return {row['return']:5.0f} ± {row['interval']:4.0f}, fell "
            f"{row['fell']:4.0%}, force {row['force']:5.2f} weights", flush=True,
        )  # fmt: skip

    for part in (0.25, 0.5, 1.0, 2.0):
        step = part * task.step
        told(
            f"MuJoCo, {1e3 * step:g} ms", worlds.episodes_in_mujoco(network, task, count, step=step)
        )
        method = hs.TimeStepping(step=step)
        told(f"here, {1e3 * step:g} ms", worlds.episodes(network, task, method, count))
    for friction in (1.0, 0.5, 0.1):
        found = worlds.episodes_in_mujoco(network, task, count, floor_friction=friction)
        told(f"MuJoCo, floor's friction {friction:g}", found)
        method = hs.TimeStepping(step=task.step)
        own = replace(task, friction=friction)
        told(f"here, friction {friction:g}", worlds.episodes(network, own, method, count))


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("what", choices=["speed", "identical", "endure", "walk", "defects", "call"])
    parser.add_argument("--task", default="Walker2d", choices=list(RUNNING))
    parser.add_argument("--lanes", type=int, default=0)
    parser.add_argument("--decisions", type=int, default=500)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policy", type=Path, default=Path("policy.npz"))
    parser.add_argument("--impulse", type=float, default=20.0)
    parser.add_argument("--no-peers", action="store_true")
    given = parser.parse_args()
    if given.what == "speed":
        speed(
            given.task, given.lanes or 64, given.decisions, given.repetitions,
            peers=not given.no_peers,
        )  # fmt: skip
    elif given.what == "call":
        call(given.lanes or 64, given.repetitions)
    elif given.what == "walk":
        walk(given.policy, given.lanes or 100, given.impulse, given.seed)
    elif given.what == "defects":
        defects(given.policy, given.lanes or 20)
    elif given.what == "endure":
        endure(given.task, given.lanes or 64, given.decisions)
    else:
        identical(given.lanes or 1000, 200, given.seed)


if __name__ == "__main__":
    main()
