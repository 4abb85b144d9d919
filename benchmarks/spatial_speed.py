"""Steps of a humanoid in space, beside MuJoCo's on the same file.

The robot stands with springs and dampers on its joints, is pushed, and falls limp. Ours has joint
stops, a compiled law, the record and a certificate for every step. MuJoCo runs with its defaults,
and with the springs and dampers in its model, so that nothing of Python is within its steps. Both
are timed in turn, in the same process, by the processor's seconds, and the best of several rounds
is told, with what else was running. The contact points of both are those of the file.

Run: python benchmarks/spatial_speed.py g1_29dof.xml [--height 0.79] [--kp 500] [--rounds 5]
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from machine import load

import heelstrike as hs
from heelstrike.dynamics import mass_matrix

STEP = 1e-3
FLOOR = '<geom name="speed_floor" type="plane" size="0 0 1"/>'


def gains(robot: hs.SpatialRobot, q: Any, stiffness: float) -> tuple[Any, Any]:
    """Gains that a joint in the air stands at a millisecond; legs may have more, on the ground."""
    free = 1.0 / np.diag(np.linalg.inv(mass_matrix(robot, q)))[robot.model.actuator_velocity]
    feet = {foot.link for foot in robot.feet}
    legs = set()
    for link in feet:
        while link >= 0:
            legs.add(link)
            link = int(robot.model.parent[link])
    joint = robot.model.velocity_joint[robot.model.actuator_velocity]
    in_leg = np.array([int(each) in legs for each in joint])
    kd = np.where(in_leg, 5.0, np.minimum(2.0, 0.3 * free / STEP))
    kp = np.where(in_leg, stiffness, 20.0 * kd)
    return kp, kd


def ours(robot: hs.SpatialRobot, q: Any, law: Any, duration: float, push: Any) -> Any:
    """A run of ours, and the processor's seconds a step."""
    simulation = hs.Simulation(
        robot, law, state=hs.State(q, np.zeros(robot.nv)), method=hs.TimeStepping(step=STEP),
        pushes=() if push is None else push, stop_when_fallen=False,
    )  # fmt: skip
    begin = time.process_time()
    simulation.advance(duration)
    spent = time.process_time() - begin
    run = simulation.record
    return run, spent / run.steps


def tell(name: str, run: Any) -> None:
    """Print what a run was worth."""
    certificates = run.certificates
    certified = 1.0 - certificates.uncertified / max(run.steps, 1)
    print(
        f"  {name:9s} certified {100.0 * certified:.3f} %, halved {certificates.halved}, "
        f"{run.status.value}, deepest {certificates.penetration:.1e} m, {run.solver}"
    )


def theirs(model: Any, q: Any, kp: Any, kd: Any, steps: int, push: float) -> float:
    """Seconds a step of MuJoCo."""
    data = mujoco.MjData(model)
    data.qpos[: len(q)] = q
    for actuator in range(model.nu):
        joint = model.actuator_trnid[actuator, 0]
        model.jnt_stiffness[joint] = kp[actuator]
        model.dof_damping[model.jnt_dofadr[joint]] = kd[actuator]
        model.qpos_spring[model.jnt_qposadr[joint]] = q[model.jnt_qposadr[joint]]
    begin = time.process_time()
    mujoco.mj_step(model, data, nstep=steps // 10)
    data.qfrc_applied[0] = push
    mujoco.mj_step(model, data, nstep=steps // 10)
    data.qfrc_applied[0] = 0.0
    mujoco.mj_step(model, data, nstep=steps - 2 * (steps // 10))
    return (time.process_time() - begin) / steps


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--kp", type=float, default=500.0)
    parser.add_argument("--push", type=float, default=150.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.0)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    robot = hs.load_robot(options.file, dimension=3)
    q = robot.reference_state().q.copy()
    q[2] -= float(np.min(hs.Simulation(robot, state=hs.State(q, np.zeros(robot.nv))).contacts.gap))
    kp, kd = gains(robot, q, options.kp)
    law = hs.HoldPosture(robot, kp=kp, kd=kd, posture=q, gravity=False)
    limp = hs.HoldPosture(robot, kp=0.0, kd=0.0, posture=q, gravity=False)
    push = hs.Push(0, force=(options.push, 0.0, 0.0), start=0.1 * options.seconds,
                   duration=0.1 * options.seconds)  # fmt: skip
    cases = {"standing": (law, None), "pushed": (law, push), "limp": (limp, None)}
    file = mujoco.MjSpec.from_file(str(options.file))
    if not any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in file.worldbody.geoms):
        file.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    model = file.compile()
    model.opt.timestep = STEP
    steps = round(options.seconds / STEP)
    print(f"{robot!r}; load {load():.1f} on {os.cpu_count()} cores")
    best: dict[str, float] = {}
    last: dict[str, Any] = {}
    for _ in range(options.rounds):
        for name, (control, pushed) in cases.items():
            run, spent = ours(robot, q, control, options.seconds, pushed)
            best[name] = min(best.get(name, np.inf), spent)
            last[name] = run
            stiff = (kp, kd) if control is law else (0.0 * kp, 0.0 * kd)
            force = options.push if pushed is not None else 0.0
            spent = theirs(model, q, *stiff, steps, force)
            best[f"MuJoCo {name}"] = min(best.get(f"MuJoCo {name}", np.inf), spent)
    for name in cases:
        mine, its = best[name], best[f"MuJoCo {name}"]
        print(f"{name}: ours {1e6 * mine:.2f} us, MuJoCo {1e6 * its:.2f} us, {mine / its:.2f} x")
        tell(name, last[name])


if __name__ == "__main__":
    main()
