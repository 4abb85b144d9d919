"""Pushes that a standing robot in space withstands, by the law that holds its balance.

The robot stands in a posture with bent knees for a second, and is pushed at a link for 0.1 s; it
withstands the push if it is up three seconds later. HoldBalance is called every 2 ms, HoldPosture
at every step with gains that the step bears. Beside them stands the push that would bring the
capture point of a pendulum of the height of the centre of mass to the edge of the soles: a law that
leaves its feet where they are does better only by swinging its trunk.

A robot may withstand one push and fall by a smaller one. So all pushes of a grid are tried, from
none to half more than brings the capture point to the edge, and their outcomes are printed in a
row. What is told is the largest push up to which none of the grid makes the robot fall.

Run: python benchmarks/spatial_balance.py FILE.xml [--bent 0.3] [--link trunk] [--spacing 0.5]
"""

from __future__ import annotations

import argparse
import os
import warnings
from pathlib import Path
from typing import Any

import machine
import numpy as np

import heelstrike as hs
from heelstrike.control.spatial.gains import bearable_gains
from heelstrike.control.spatial.soles import soles_in_space
from heelstrike.dynamics import spatial

DURATION = 0.1
SIDES = {"forwards": (1.0, 0.0), "backwards": (-1.0, 0.0), "to the left": (0.0, 1.0)}


def crouched(robot: hs.SpatialRobot, bent: float) -> np.ndarray:
    """Bend hips, knees and ankles that turn about y so that the soles stay flat, and stand."""
    q = robot.reference_state().q.copy()
    for place, name in enumerate(robot.joint_names):
        pitches = abs(robot.model.axis[place, 1]) > 0.9
        for part, angle in (("hip", -bent), ("knee", 2.0 * bent), ("ankle", -bent)):
            if pitches and part in name:
                q[robot.model.first_position[place]] += angle
    simulation = hs.Simulation(robot, state=hs.State(q, np.zeros(robot.nv)))
    q[2] -= float(np.min(simulation.contacts.gap))
    return q


def outcomes(
    robot: hs.SpatialRobot, law: Any, q: np.ndarray, link: str, side: tuple[float, float],
    period: float | None, impulses: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Whether it withstands each push (N s)."""
    stands = []
    for impulse in impulses:
        force = tuple(impulse / DURATION * part for part in (*side, 0.0))
        push = hs.Push(link, force=force, start=1.0, duration=DURATION)
        run = hs.simulate(
            robot, law, state=hs.State(q, np.zeros(robot.nv)), duration=4.0, pushes=push,
            control_period=period, record_every=100,
        )  # fmt: skip
        stands.append(run.completed)
    return np.array(stands)


def told(impulses: np.ndarray, stands: np.ndarray) -> str:
    """Say up to which push all are withstood, and what comes after."""
    least = int(np.argmin(stands)) if not stands.all() else len(stands)
    below = f"{impulses[least - 1]:.2f}" if least > 0 else "none"
    row = "".join("o" if stood else "x" for stood in stands)
    return f"all up to {below} N s, the largest {impulses[stands].max(initial=0.0):.2f}; {row}"


def reach(robot: hs.SpatialRobot, q: np.ndarray, side: tuple[float, float]) -> float:
    """Impulse (N s) that brings the capture point to the edge of the soles."""
    soles = soles_in_space(robot, q)
    poses = spatial.link_poses(robot, q)
    turned = [poses.rotation[link] for link in soles.link]
    middle = [
        poses.origin[link] + turn @ local
        for link, turn, local in zip(soles.link, turned, soles.middle, strict=True)
    ]
    along = np.array([*side, 0.0])
    edges = [
        at @ along + half @ np.abs(axes @ turn.T @ along)[:2]
        for at, turn, axes, half in zip(middle, turned, soles.axes, soles.half, strict=True)
    ]
    start = np.mean(middle, axis=0) @ along
    rate = np.sqrt(np.linalg.norm(robot.model.gravity) / soles.height)
    return float(robot.total_mass * rate * (max(edges) - start))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--bent", type=float, default=0.3, help="of the knees, half (rad)")
    parser.add_argument("--link", help="that is pushed; the trunk by default")
    parser.add_argument("--spacing", type=float, default=0.5, help="of the pushes (N s)")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    robot = hs.load_robot(options.file, dimension=3)
    link = options.link or robot.link_names[0]
    q = crouched(robot, options.bent)
    kp, kd = bearable_gains(robot, 1e-3, kp=600.0, kd=15.0)
    laws = {
        "HoldBalance": (hs.HoldBalance(robot, posture=q), 2e-3),
        "HoldPosture": (hs.HoldPosture(robot, posture=q, kp=kp, kd=kd), None),
    }
    print(f"{robot!r}; load {machine.load():.1f} on {os.cpu_count()} cores")
    print("o: up three seconds later, x: fallen; from the smallest push on")
    for name, side in SIDES.items():
        edge = reach(robot, q, side)
        impulses = np.arange(options.spacing, 1.5 * edge, options.spacing)
        print(f"{name}: capture point at the edge: {edge:.1f} N s", flush=True)
        for law, (made, period) in laws.items():
            stands = outcomes(robot, made, q, link, side, period, impulses)
            print(f"  {law:11s} {told(impulses, stands)}", flush=True)


if __name__ == "__main__":
    main()
