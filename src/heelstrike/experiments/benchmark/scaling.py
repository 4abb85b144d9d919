"""What a step costs with more joints, and with more contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.experiments.benchmark.own import NEVER, InvalidRunError
from heelstrike.experiments.benchmark.scenarios import FRICTION, chain, plank
from heelstrike.experiments.benchmark.stopwatch import best_of, timed
from heelstrike.robot import Robot, State, read_mjcf
from heelstrike.sim import Run, TimeStepping, simulate

STEP = 1e-3
STEPS = 500
SETTLING = 3000
JOINTS = (2, 3, 5, 8, 12, 20, 30, 45, 60)
CONTACTS = (0, 2, 4, 8, 16, 32, 64)


def measure_scaling(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time a swinging chain by its joints, and a plank at rest by its contact points."""
    joints = (2, 8, 30) if quick else JOINTS
    contacts = (0, 4, 16) if quick else CONTACTS
    result: dict[str, Any] = {
        "joints": [_measure(chain(n), n, quick=quick, peers=peers) for n in joints],
        "contacts": [_measure(plank(n), n, quick=quick, peers=peers) for n in contacts],
    }
    for name in ("joints", "contacts"):
        result[f"{name}_slope"] = {
            side: _slope(result[name], f"{side}_us")
            for side in ("heelstrike", "mujoco")
            if f"{side}_us" in result[name][-1]
        }
        result[f"{name}_crossover"] = _crossover(result[name])
    return result


def _measure(xml: str, size: int, *, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    robot = read_mjcf(xml, name="test body")
    state = _start(robot)
    method, ground = TimeStepping(step=STEP), Ground(friction=FRICTION)

    def run(record_every: int = NEVER) -> Run:
        done = simulate(
            robot,
            state=state,
            duration=STEPS * STEP,
            method=method,
            ground=ground,
            record_every=record_every,
            stop_when_fallen=False,
        )
        if not done.completed:
            raise InvalidRunError(f"{robot.name} of {size}: {done.message}")
        return done

    _check_contacts(run(record_every=1))
    works = {"heelstrike": lambda: run().timing.wall_s}
    if "mujoco" in peers:
        works["mujoco"] = _mujoco(xml, state)
    best = best_of(works, seconds=0.1 if quick else 1.0, least=3)
    return {"size": size, **{f"{name}_us": 1e6 * t / STEPS for name, t in best.items()}}


def _start(robot: Robot) -> State:
    q = robot.model.reference.copy()
    if not robot.floating:
        q += 0.3
    return State(q, np.zeros(robot.nv))


def _check_contacts(run: Run) -> None:
    """Check that all points carry in every step, and together the whole weight."""
    robot = run.robot
    if robot.nc == 0:
        return
    carried = run.contact_force[..., 0].sum(axis=1)
    if not np.allclose(carried, robot.weight, rtol=1e-9) or np.any(run.gap > 1e-9):
        raise InvalidRunError(f"the ground carries {carried.min():.3g} to {carried.max():.3g} N")
    if run.certificates.complementarity > 1e-9 or run.solver.failures:
        raise InvalidRunError(f"contact problems are solved to {run.certificates} only")


def _mujoco(xml: str, state: State) -> Any:
    import mujoco
    from mujoco import rollout

    from heelstrike.experiments.benchmark.mujoco_peer import Options, configured

    spec = mujoco.MjSpec.from_string(xml)
    for geom in spec.geoms:
        geom.friction = FRICTION, 0.0, 0.0
    model = configured(spec, Options(step=STEP))
    data = mujoco.MjData(model)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    data.qpos[:], data.qvel[:] = state.q, state.v
    packed = np.zeros((1, mujoco.mj_stateSize(model, kind)))
    mujoco.mj_getState(model, data, packed[0], kind)
    points = int(np.count_nonzero(model.geom_contype))
    if points:
        for _ in range(SETTLING):
            mujoco.mj_step(model, data)
        if data.ncon != points:
            raise InvalidRunError(f"{data.ncon} of {points} points touch in MuJoCo")
        mujoco.mj_getState(model, data, packed[0], kind)
    states = np.zeros((1, STEPS, packed.shape[1]))
    none = np.zeros((1, STEPS, model.nsensordata))
    control = np.zeros((1, 1, model.nu))
    return timed(
        lambda: rollout.rollout(
            model, data, packed, control, nstep=STEPS, state=states, sensordata=none
        )
    )


def _slope(rows: Sequence[dict[str, Any]], name: str) -> float:
    """Exponent of size to which the cost grows, over the upper half of the sizes."""
    upper = [row for row in rows if row["size"] > 0][-max(2, len(rows) // 2) :]
    size = np.log([row["size"] for row in upper])
    cost = np.log([row[name] for row in upper])
    return float(np.polyfit(size, cost, 1)[0])


def _crossover(rows: Sequence[dict[str, Any]]) -> int | None:
    """Smallest size from which on the peer is faster; None if there is none."""
    if "mujoco_us" not in rows[0]:
        return None
    slower = [row["size"] for row in rows if row["heelstrike_us"] > row["mujoco_us"]]
    return min(slower) if slower else None
