"""Walking policies that nobody here trained, on exact hard contact and in MuJoCo's own loop.

Unitree publishes policies for its humanoids G1, H1 and H1-2 (unitree_rl_gym, BSD-3): TorchScript
networks with a memory, of what the robot senses and of a command (forwards, sideways, turning),
that set targets of the joints fifty times a second for springs and dampers of the published
configuration. Neither policies nor robots are part of this project: CLONE is a clone of
unitreerobotics/unitree_rl_gym.

    pip install torch==2.13.0
    python benchmarks/published_policies.py CLONE [--robots g1 h1 h1_2] [--commands forwards ...]
        [--steps 0.002] [--duration 60] [--friction 1.0] [--pushes] [--json FILE]

Both engines get the same robot: the file's, without the meshes of links that have something else to
stand on, or nothing to do with the ground. A row tells how long the robot stayed up, its mean
velocity along its own heading and yaw rate, the largest mean of the ground's force over 10 ms and
over a step, the slip of feet that carry, how deep they are, and the time of a step (the policy's
own apart). Mean values leave out the first two seconds. `--pushes` seeks, to 10 N, the least force
of 0.1 s on the pelvis from which the robot falls within four seconds, by side and by phase of the
cycle; a walk that one force fells and a larger one does not is not looked for.
"""

from __future__ import annotations

import argparse
import json
import math
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yaml
from machine import load
from numpy.typing import NDArray

import heelstrike as hs

Floats = NDArray[np.float64]

COMMANDS = {
    "forwards": (0.5, 0.0, 0.0),
    "backwards": (-0.5, 0.0, 0.0),
    "sideways": (0.0, 0.3, 0.0),
    "turning": (0.0, 0.0, 0.5),
    "curve": (0.5, 0.0, 0.3),
    "standing": (0.0, 0.0, 0.0),
}
"""Velocity forwards and to the left (m/s), and turn to the left (rad/s)."""

FILES = {
    "g1": "g1_description/g1_12dof.xml",
    "h1": "h1/h1.xml",
    "h1_2": "h1_2/h1_2_12dof.xml",
}
CYCLE = 0.8  # s, of the two phases that the policy is told
SETTLED = 2.0  # s
WINDOW = 0.01  # s
FALLEN = 0.5  # of the first height of the trunk
CARRIES = 1.0  # N, from which a point counts as carrying

SIDES = {"forwards": (1, 0), "backwards": (-1, 0), "left": (0, 1), "right": (0, -1)}
PHASES = (0.0, 0.25, 0.5, 0.75)
PUSHED, LASTS, WATCHED = 4.0, 0.1, 4.0  # s: when, for how long, and how long the walk goes on
LARGEST, FINE = 1280.0, 10.0  # N


class Springs(hs.Bundle):
    """Springs and dampers of the joints, and where the springs pull."""

    target: Floats = hs.array("nu")
    stiffness: Floats = hs.array("nu")
    damping: Floats = hs.array("nu")


@hs.controller
def pull(state: Any, robot: Any, parameters: Springs, torque: Any) -> None:
    """Pull every joint towards its target."""
    for i in range(robot.nu):
        away = parameters.target[i] - state.joint_position[i]
        torque[i] = parameters.stiffness[i] * away - parameters.damping[i] * state.joint_velocity[i]


class Policy:
    """A published policy: what it senses, and the targets that it sets."""

    def __init__(self, clone: Path, robot: str, command: tuple[float, float, float]) -> None:
        import torch

        torch.set_num_threads(1)
        self.torch = torch
        text = (clone / f"deploy/deploy_mujoco/configs/{robot}.yaml").read_text(encoding="utf-8")
        self.config = yaml.safe_load(text)
        self.network = torch.jit.load(str(clone / f"deploy/pre_train/{robot}/motion.pt"))
        self.still = np.array(self.config["default_angles"])
        self.period = self.config["simulation_dt"] * self.config["control_decimation"]
        self.action = np.zeros(self.config["num_actions"])
        self.command = np.array(command) * self.config["cmd_scale"]
        self.seconds = 0.0

    def targets(self, t: float, q: Floats, v: Floats) -> Floats:
        """Return where the springs pull from now on."""
        begin = time.process_time()
        w, x, y, z = q[3:7]
        down = [2 * (w * y - z * x), -2 * (z * y + w * x), 1 - 2 * (w * w + z * z)]
        phase = 2.0 * np.pi * (t % CYCLE) / CYCLE
        sensed = np.concatenate((
            v[3:6] * self.config["ang_vel_scale"],
            down,
            self.command,
            (q[7:] - self.still) * self.config["dof_pos_scale"],
            v[6:] * self.config["dof_vel_scale"],
            self.action,
            [math.sin(phase), math.cos(phase)],
        ))  # fmt: skip
        given = self.torch.from_numpy(sensed.astype(np.float32)).unsqueeze(0)
        with self.torch.no_grad():
            self.action = self.network(given).numpy().squeeze().astype(np.float64)
        self.seconds += time.process_time() - begin
        return self.action * self.config["action_scale"] + self.still


@dataclass
class Walk:
    """What came of a walk."""

    robot: str
    engine: str
    command: str
    step: float
    upright: float
    """How long (s)."""
    forwards: float
    sideways: float
    """forwards, sideways: Mean velocity along the heading and to its left (m/s)."""
    turning: float
    """Mean yaw rate (rad/s)."""
    peak: float
    mean_peak: float
    """peak, mean_peak: Largest force of the ground within a step, and over 10 ms, in weights."""
    slip: float
    """Mean speed at which points that carry slide (mm/s)."""
    deepest: float
    """Greatest penetration (m)."""
    microseconds: float
    """Of a step, without the policy."""
    certified: float = math.nan
    """Share of the steps whose contact problem was certified at 1e-9."""
    message: str = ""


def bare_file(clone: Path, robot: str, folder: Path) -> Path:
    """Write a robot's file with no meshes but those of leaves that have nothing else to stand on.

    Both engines read that: what its feet are made of, and no hulls that meet each other.
    """
    source = (clone / "resources/robots" / FILES[robot]).resolve()
    root = ElementTree.parse(source).getroot()
    kept: set[str] = set()
    for body in root.iter("body"):
        shapes = [each for each in body.findall("geom") if each.get("contype") != "0"]
        hulls = [each for each in shapes if "mesh" in each.attrib]
        needed = body.find("body") is None and len(hulls) == len(shapes)
        for geom in body.findall("geom"):
            if "mesh" in geom.attrib and not (needed and geom in hulls):
                body.remove(geom)
        kept |= {geom.get("mesh", "") for geom in hulls if needed}
    for asset in root.findall("asset"):
        for mesh in asset.findall("mesh"):
            if (mesh.get("name") or Path(mesh.get("file", "")).stem) not in kept:
                asset.remove(mesh)
    for compiler in root.findall("compiler"):
        compiler.set("meshdir", str(source.parent / compiler.get("meshdir", "")))
    path = folder / f"{robot}.xml"
    path.write_text(ElementTree.tostring(root, encoding="unicode"), encoding="utf-8")
    return path


def measured(
    times: Floats, q: Floats, v: Floats, force: Floats, slip: Floats, weight: float, step: float
) -> dict[str, float]:
    """Means and peaks of a walk: rows of states, of the ground's force and of sliding speeds."""
    kept = times >= SETTLED
    if np.count_nonzero(kept) < 3:
        return dict.fromkeys(("forwards", "sideways", "turning", "peak", "mean_peak", "slip"), 0.0)
    w, x, y, z = q[kept, 3:7].T
    yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    c, s = np.cos(yaw), np.sin(yaw)
    along = c * v[kept, 0] + s * v[kept, 1]
    aside = -s * v[kept, 0] + c * v[kept, 1]
    span = max(1, round(WINDOW / step))
    sums = np.concatenate(([0.0], np.cumsum(force[kept])))
    means = (sums[span:] - sums[:-span]) / span if len(sums) > span else sums[-1:] / len(sums)
    return {
        "forwards": float(along.mean()),
        "sideways": float(aside.mean()),
        "turning": float((yaw[-1] - yaw[0]) / (times[kept][-1] - times[kept][0])),
        "peak": float(force[kept].max()) / weight,
        "mean_peak": float(means.max()) / weight,
        "slip": 1e3 * float(slip[kept].mean()),
    }


def pelvis_center(path: Path) -> tuple[float, ...]:
    """Centre of mass of the pelvis alone, where MuJoCo pushes: here what is welded to it is one."""
    inertial = ElementTree.parse(path).getroot().find(".//body[@name='pelvis']/inertial")
    given = "0 0 0" if inertial is None else inertial.get("pos", "0 0 0")
    return tuple(map(float, given.split()))


@dataclass(frozen=True)
class Shove:
    """A force (x, y) in N on the pelvis from an instant on."""

    start: float
    force: tuple[float, float]


def hard(
    path: Path, policy: Policy, name: str, command: str, given: Any, step: float,
    shove: Shove | None = None,
) -> Walk:  # fmt: skip
    """Walk on hard contact."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hs.RobotWarning)
        robot = hs.load_robot(path, dimension=3)
    pushes = [] if shove is None else [
        hs.Push(
            "pelvis", force=(*shove.force, 0.0), start=shove.start, duration=LASTS,
            point=pelvis_center(path),
        )
    ]  # fmt: skip
    stiffness, damping = (
        np.array(policy.config[name], dtype=np.float64) for name in ("kps", "kds")
    )

    def law(target: Floats) -> Any:
        return pull(Springs(target=target, stiffness=stiffness, damping=damping))

    simulation = hs.Simulation(
        robot, law(policy.still), state=robot.reference_state(), method=hs.TimeStepping(step=step),
        ground=hs.Ground(friction=given.friction), stop_when_fallen=True, pushes=pushes,
    )  # fmt: skip
    simulation.step()  # compiled before the clock starts
    begin, policy.seconds, changing = time.process_time(), 0.0, 0.0
    first = float(simulation.state.q[2])
    instants = np.arange(1, round(given.duration / policy.period) + 1) * policy.period
    for instant in instants:
        status = simulation.advance(float(instant))
        state = simulation.state
        if status is not hs.RunStatus.COMPLETED or state.q[2] < FALLEN * first:
            break
        target = policy.targets(float(instant), state.q, state.v)
        changed = time.process_time()
        simulation.controller = law(target)  # it has its own copy of the numbers of a law
        changing += time.process_time() - changed
    seconds = time.process_time() - begin - policy.seconds - changing
    run: Any = simulation.record
    carries = run.contact_force[..., 0] > CARRIES
    slides = np.linalg.norm(run.slip, axis=-1) * carries
    return Walk(
        name, "hard", command, step, float(run.time[-1] + step),
        **measured(
            run.time, run.position, run.velocity, run.world_force[..., 2].sum(axis=1),
            slides.sum(axis=1) / np.maximum(carries.sum(axis=1), 1), robot.weight, step,
        ),
        deepest=run.certificates.penetration,
        microseconds=1e6 * seconds / run.steps,
        certified=1.0 - run.certificates.uncertified / run.steps,
        message=run.message,
    )  # fmt: skip


def mujoco_own(
    path: Path, policy: Policy, name: str, command: str, given: Any, step: float,
    shove: Shove | None = None,
) -> Walk:  # fmt: skip
    """Walk in MuJoCo's own loop, as published: springs at every step, its default contact."""
    import mujoco

    text = path.read_text(encoding="utf-8")
    floor = (
        f'<geom name="floor" type="plane" size="0 0 1" friction="{given.friction} 0.005 0.0001"/>'
    )
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", f"<worldbody>{floor}", 1))
    data = mujoco.MjData(model)
    model.opt.timestep = step
    gains = np.array(policy.config["kps"]), np.array(policy.config["kds"])
    target, every = policy.still, round(policy.period / step)
    count = round(given.duration / step)
    rows = [np.zeros((count, size)) for size in (model.nq, model.nv)]
    force, slip = np.zeros(count), np.zeros(count)
    seconds, deepest, used = 0.0, 0.0, count
    first = float(data.qpos[2])
    wrench, motion = np.zeros(6), np.zeros(6)
    for k in range(count):
        rows[0][k], rows[1][k] = data.qpos, data.qvel
        data.ctrl[:] = (target - data.qpos[7:]) * gains[0] - data.qvel[6:] * gains[1]
        if shove is not None:
            on = shove.start <= k * step < shove.start + LASTS
            data.body("pelvis").xfrc_applied[:2] = shove.force if on else 0.0
        begin = time.process_time()
        mujoco.mj_step(model, data)
        seconds += time.process_time() - begin
        sliding = []
        for one in range(data.ncon):
            mujoco.mj_contactForce(model, data, one, wrench)
            contact = data.contact[one]
            force[k] += (contact.frame.reshape(3, 3).T @ wrench[:3])[2]
            deepest = max(deepest, -contact.dist)
            if wrench[0] > CARRIES:
                body = model.geom_bodyid[contact.geom2]
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, motion, 0)
                place = contact.pos - data.xpos[body]
                sliding.append(np.linalg.norm((motion[3:] + np.cross(motion[:3], place))[:2]))
        slip[k] = np.mean(sliding) if sliding else 0.0
        if (k + 1) % every == 0:
            target = policy.targets((k + 1) * step, data.qpos.copy(), data.qvel.copy())
        if data.qpos[2] < FALLEN * first or not np.all(np.isfinite(data.qpos)):
            used = k + 1
            break
    weight = float(model.body_mass.sum() * 9.81)
    times = np.arange(count) * step
    return Walk(
        name, "MuJoCo", command, step, used * step,
        **measured(
            times[:used], rows[0][:used], rows[1][:used], force[:used], slip[:used], weight, step
        ),
        deepest=deepest,
        microseconds=1e6 * seconds / used,
    )  # fmt: skip


ENGINES: dict[str, Callable[..., Walk]] = {"hard": hard, "mujoco": mujoco_own}


def least_felling(path: Path, name: str, engine: str, side: str, phase: float, given: Any) -> float:
    """Least force (N) that fells a robot which walks forwards, to `FINE`; infinite if none does."""
    start = CYCLE * (round(PUSHED / CYCLE) + phase)
    setting = argparse.Namespace(**{**vars(given), "duration": start + WATCHED})

    def stands(size: float) -> bool:
        policy = Policy(given.clone, name, COMMANDS["forwards"])
        x, y = SIDES[side]
        shove = Shove(start, (size * x, size * y))
        step = given.steps[0]
        walk = ENGINES[engine](path, policy, name, "forwards", setting, step, shove)
        return walk.upright > setting.duration - 0.1

    low, high = 0.0, LARGEST
    if stands(high):
        return math.inf
    while high - low > FINE:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return high


def tell_pushes(path: Path, name: str, given: Any) -> None:
    """Print what fells a robot, side by side."""
    for side in SIDES:
        for phase in PHASES:
            found = [least_felling(path, name, each, side, phase, given) for each in given.engines]
            words = ", ".join(
                f"{each} {force:.0f} N" for each, force in zip(given.engines, found, strict=True)
            )
            print(f"{name:5} pushed {side:9} at {phase:4.2f} of the cycle: {words}", flush=True)


def main() -> None:
    """Walk, and print a row for every walk."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clone", type=Path)
    parser.add_argument("--robots", nargs="+", default=list(FILES), choices=list(FILES))
    parser.add_argument("--commands", nargs="+", default=["forwards"], choices=list(COMMANDS))
    parser.add_argument("--steps", nargs="+", type=float, default=[0.002])
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--friction", type=float, default=1.0)
    parser.add_argument("--engines", nargs="+", default=["hard", "mujoco"])
    parser.add_argument("--scratch", type=Path, default=Path())
    parser.add_argument("--pushes", action="store_true")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    walks = []
    for name in given.robots:
        path = bare_file(given.clone, name, given.scratch)
        if given.pushes:
            tell_pushes(path, name, given)
            continue
        for command in given.commands:
            for step in given.steps:
                for engine in given.engines:
                    policy = Policy(given.clone, name, COMMANDS[command])
                    one = ENGINES[engine](path, policy, name, command, given, step)
                    walks.append(one)
                    print(
                        f"{name:5} {command:10} {1e3 * step:4.1f} ms {one.engine:6} "
                        f"up {one.upright:5.1f} s  {one.forwards:+.3f} {one.sideways:+.3f} m/s "
                        f"{one.turning:+.3f} rad/s  peak {one.peak:5.2f} {one.mean_peak:4.2f} "
                        f"slip {one.slip:6.2f} mm/s deep {one.deepest:.1e} "
                        f"{one.microseconds:5.1f} us certified {one.certified:.6f} {one.message} "
                        f"load {load():.1f}",
                        flush=True,
                    )
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in walks], indent=1))


if __name__ == "__main__":
    main()
