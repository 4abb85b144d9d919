"""One policy in several worlds, to see whether what it learned is real or the simulator's."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import numpy as np

from heelstrike.control.policy.network import Network
from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.course import Course
from heelstrike.experiments.learning.courses import LearningTask, course_of, told_task
from heelstrike.experiments.learning.tasks import OF_GYMNASIUM, RUNNING, RunningTask
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim import Compliant, EventDriven, Method, TimeStepping

CONFIDENCE = 1.96
"""Half the width of an interval of 95 %, in standard errors."""

GREAT = 95.0
"""Percentile of the forces that is told."""

SHORTEST = 0.1
"""Distances (m) count as at least this where work is told over distance."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a policy came to in one world."""

    world: str
    """What it is called."""
    returns: Floats
    """(n,) Return of each episode."""
    lengths: Floats
    """(n,) Decisions of each."""
    distances: Floats
    """(n,) How far (m) it came."""
    efforts: Floats
    """(n,) Mean sum of the squared actions."""
    work: Floats
    """(n,) Mechanical work of all motors, positive or negative, over weight and distance."""
    force: Floats
    """(n,) Normal force of the ground, over the weight, that was greater at one decision in
    twenty. The greatest one tells of the time step: in an impact it is the impulse over a step."""
    fell: Floats
    """(n,) 1 where the episode ended because the robot was not healthy, or could not go on."""

    def row(self) -> dict[str, float | str]:
        """Return means, and half the width of the interval of 95 % of the mean return.

        Returns
        -------
        dict
            Numbers by name.
        """
        count = len(self.returns)
        spread = float(self.returns.std(ddof=1)) if count > 1 else float("nan")
        seconds = self.lengths.sum()
        return {
            "world": self.world, "episodes": count, "return": float(self.returns.mean()),
            "interval": CONFIDENCE * spread / float(np.sqrt(count)),
            "fell": float(self.fell.mean()),
            "decisions": float(self.lengths.mean()), "distance": float(self.distances.mean()),
            "work": float(np.median(self.work)), "force": float(np.median(self.force)),
            "effort": float((self.efforts * self.lengths).sum() / max(seconds, 1.0)),
        }  # fmt: skip


def worlds_of(task: LearningTask) -> dict[str, Method]:
    """Return the worlds that a policy is tried in, MuJoCo's left out.

    Parameters
    ----------
    task : RunningTask or WalkTask
        The task; its own step is among those of time stepping. A walker's joints are read once a
        step of it, which is therefore the longest.

    Returns
    -------
    dict
        Simulation methods by name.
    """
    period, worlds = task.decision_period, dict[str, Method]()
    for part in (0.25, 0.5, 1.0, 2.0):
        step = part * task.step
        whole = abs(period / step - round(period / step)) < 1e-9
        if whole and (part <= 1.0 or isinstance(task, RunningTask)):
            worlds[f"time stepping, {1e3 * step:g} ms"] = TimeStepping(step=step)
    return worlds | {"event-driven": EventDriven(), "compliant": Compliant()}


def episodes(
    network: Network, task: LearningTask, method: Method, count: int, *, seed: int = 0,
    world: str = "",
) -> Outcome:  # fmt: skip
    """Try a policy in one of our worlds, without noise in its actions.

    Parameters
    ----------
    network : Network
        The policy.
    task : RunningTask or WalkTask
        The task.
    method : Method
        Simulation method.
    count : int
        Episodes.
    seed : int
        Of the noise that they begin with: the same in all worlds.
    world : str
        What it is called.

    Returns
    -------
    Outcome
        What came of it.

    Raises
    ------
    SimulationError
        If the policy is one of another robot.
    """
    course = course_of(task, count, method=method)
    _check_fits(network, course)
    for lane in range(count):
        course.seed(lane, np.random.default_rng([seed, lane]))
    course.begin(np.arange(count))
    batch, robot = course.batch, course.robot
    moves = robot.model.actuator_joint
    begin = batch.position[:, 0].copy()
    gained, lengths, effort = np.zeros(count), np.zeros(count), np.zeros(count)
    work, forces = np.zeros(count), np.full((task.max_episode_steps, count), np.nan)
    goes = np.ones(count, dtype=bool)
    for decision in range(task.max_episode_steps):
        action = network.act(course.observation, network.begin())
        course.step(action, goes)
        gained[goes] += course.reward[goes]
        effort[goes] += (action[goes] ** 2).sum(axis=1)
        power = np.abs(batch.torque * batch.velocity[:, moves]).sum(axis=1)
        work[goes] += task.decision_period * power[goes]
        forces[decision, goes] = batch.contact_force[goes, :, 0].sum(axis=1)
        lengths[goes] += 1
        goes = goes & ~course.terminated
        if not goes.any():
            break
    distance = batch.position[:, 0] - begin
    return Outcome(
        world,
        gained,
        lengths,
        distance,
        effort / np.maximum(lengths, 1),
        work / (robot.weight * np.maximum(np.abs(distance), SHORTEST)),
        np.nanpercentile(forces, GREAT, axis=0) / robot.weight,
        (~goes).astype(float),
    )


def episodes_in_mujoco(
    network: Network, task: RunningTask, count: int, *, seed: int = 0, step: float | None = None,
    floor_friction: float | None = None,
) -> Outcome:  # fmt: skip
    """Try a policy in Gymnasium's own environment of the task, on MuJoCo.

    Parameters
    ----------
    network : Network
        The policy.
    task : RunningTask
        One of Gymnasium's.
    count : int
        Episodes.
    seed : int
        Of the noise that they begin with: as in :func:`episodes`.
    step : float, optional
        Time step (s), a whole part of a decision; that of its file by default.
    floor_friction : float, optional
        Coefficient of friction of the floor; that of its file by default.

    Returns
    -------
    Outcome
        What came of it.
    """
    import gymnasium

    if "imageio" not in sys.modules and find_spec("imageio") is None:
        sys.modules["imageio"] = ModuleType("imageio")  # it is asked for, for films; none are taken
    name = next(name for name, each in RUNNING.items() if each.file == task.file)
    environment: Any = gymnasium.make(f"{name}-v5").unwrapped
    rows = []
    model, data = environment.model, environment.data
    if step is not None:
        model.opt.timestep, environment.frame_skip = step, round(task.decision_period / step)
    if floor_friction is not None:
        model.geom("floor").friction[0] = floor_friction
    weight = -float(model.opt.gravity[2] * model.body_mass.sum())
    motors = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    for lane in range(count):
        environment.np_random = np.random.default_rng([seed, lane])
        observation, _ = environment.reset()
        begin, gained, effort, fell = environment.data.qpos[0], 0.0, 0.0, False
        length, work, forces = 0, 0.0, []
        while length < task.max_episode_steps and not fell:
            action = network.act(observation, network.begin())
            observation, reward, fell, _, _ = environment.step(action)
            gained, effort = gained + float(reward), effort + float((action**2).sum())
            length += 1
            power = np.abs(data.qfrc_actuator[motors] * data.qvel[motors]).sum()
            work += task.decision_period * float(power)
            forces.append(_normal_force(model, data))
        distance = environment.data.qpos[0] - begin
        way = weight * max(abs(distance), SHORTEST)
        rows.append(
            (
                gained,
                length,
                distance,
                effort / length,
                work / way,
                np.percentile(forces, GREAT) / weight,
                float(fell),
            )
        )
    return Outcome("MuJoCo", *np.array(rows).T)


def transfer(
    network: Network, count: int = 100, *, seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[Outcome]:  # fmt: skip
    """Try a policy in all worlds.

    Parameters
    ----------
    network : Network
        A policy of dense layers that a :class:`Trainer` made, or that says its task likewise.
    count : int
        Episodes in each.
    seed : int
        Of the noise that they begin with.
    progress : callable
        Told the name of each world before it is tried.

    Yields
    ------
    Outcome
        Of one world after the other, MuJoCo's last if the task is one of Gymnasium's.

    Raises
    ------
    SimulationError
        If the policy does not tell its task, or has layers that are not dense.
    """
    task = told_task(network.about)
    if any(layer.kind != "dense" for layer in network.layers):
        raise SimulationError("transfer tries policies of dense layers only")
    for world, method in worlds_of(task).items():
        progress(world)
        yield episodes(network, task, method, count, seed=seed, world=world)
    if isinstance(task, RunningTask) and task.file.startswith(OF_GYMNASIUM):
        progress("MuJoCo")
        yield episodes_in_mujoco(network, task, count, seed=seed)


def _normal_force(model: Any, data: Any) -> float:
    """Return the sum of the normal forces of all contacts (N)."""
    import mujoco

    wrench, total = np.zeros(6), 0.0
    for contact in range(data.ncon):
        mujoco.mj_contactForce(model, data, contact, wrench)
        total += wrench[0]
    return float(total)


def _check_fits(network: Network, course: Course) -> None:
    observed, driven = course.observation.shape[1], course.robot.nu
    if (network.mean.size, network.gear.size) != (observed, driven):
        raise SimulationError(
            f"this policy observes {network.mean.size} numbers and drives {network.gear.size} "
            f"actuators; robot {course.robot.name!r} has {observed} and {driven}"
        )
