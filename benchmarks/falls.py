"""Random falls of every robot of the library, event-driven, each judged from its record.

The robot is let go without a controller on flat ground and followed for 3 s, whatever becomes of
it. Its start is drawn from ``default_rng([7, seed, robot])``, where the number of a robot is the
CRC-32 of its name, in this order: friction from 0.1 to 1; every joint anywhere in its range, one
without a range within 1.5 rad of zero, and so the pitch; velocities of normal distribution, of 1
m/s for the trunk, 1 rad/s for its pitch and 2 rad/s for the joints; the height of the lowest
contact point, up to 0.3 m. Only contact points meet the ground: a trunk without any falls through
it and swings below. Latches begin open.

The judge reads numbers of robot and record alone; poses, speeds and energies come from
``scenes/mechanics.py``, which shares no code with the simulator. It objects when

- the run does not complete;
- at any row a contact point is deeper in the ground than 1e-10 m, or has a force and is not within
  1e-10 m of it, or a joint is beyond its range by more than 1e-10 rad;
- the ground pulls, by more than 1e-9 of the weight;
- a coordinate moves from one row to the next (1 ms, and at events) in another way than its speeds
  there explain (if nothing else is wrong, a second look is taken with rows of 0.1 ms), or time
  does not go on;
- the energy of a robot that nothing drives rises, by more than 1e-6 of what is in play, of which
  the integrator's tolerance (rtol 1e-8) explains a part; what bridges add is told apart;
- bridges last longer than 1e-3 of the run.

    python benchmarks/falls.py run --out falls.jsonl --seeds 100:130 --robots bravo7 walker2d
    python benchmarks/falls.py table falls.jsonl
    python benchmarks/falls.py show walker2d 129

`run` goes on where a file of results ends; a fall of more than 60 s of processor time hangs.
"""

from __future__ import annotations

import argparse
import json
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scenes.campaign import Task, add_arguments, campaign, results_in
from scenes.findings import Findings
from scenes.mechanics import Poses, Tree
from scenes.record import Rows

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from heelstrike.sim import EventKind

Array = NDArray[Any]

DURATION = 3.0
"""Seconds of a fall."""
ROWS, FINE = 1e-3, 1e-4
"""Time between rows (s), and at a second look where speeds change too fast for the first: rows come
from the dense output; a step that cannot be put on the ground at one of them ends there."""
LIMIT = 60.0
"""Processor seconds after which one hangs."""
FREE = 1.5
"""Pitch, and angle of a joint without a range, are drawn from so far either side of zero (rad)."""
DROP = 0.3
"""Greatest height of the lowest contact point (m)."""
TRUNK, PITCH, JOINT = 1.0, 1.0, 2.0
"""Standard deviations of the velocities (m/s, rad/s)."""

UNMOVED = "moves without speed"
PLACE = 1e-10
"""How exactly the ground and the ranges of joints are kept (m, rad)."""
PULL = 1e-9
"""Normal force that may be negative, relative to the weight."""
MOTION = 1e-7
"""Change of a coordinate (m, rad, relative beyond one) that may be without explanation."""
ENERGY = 1e-6
"""Rise of energy, relative to what is in play."""
BRIDGED = 1e-3
"""Part of a run that bridges may last."""


def random_start(robot: hs.Robot, seed: int) -> tuple[float, hs.State]:
    """Draw friction and initial state of a fall; see the module for what is drawn."""
    draw = np.random.default_rng([7, seed, zlib.crc32(robot.name.encode())])
    friction = float(draw.uniform(0.1, 1.0))
    model = robot.model
    low = np.where(np.isfinite(model.lower), model.lower, -FREE)
    high = np.where(np.isfinite(model.upper), model.upper, FREE)
    q, v = draw.uniform(low, high), JOINT * draw.standard_normal(robot.nv)
    q[:2] = 0.0
    v[:2] *= TRUNK / JOINT
    if robot.joint_names[2] == "root_pitch":
        v[2] *= PITCH / JOINT
    q[1] = draw.uniform(0.0, DROP) - heights(robot, q[None]).min()
    return friction, hs.State(q, v)


def heights(robot: hs.Robot, q: Array) -> Array:
    """Heights (T, nc) of the contact points above flat ground, by the judge's own geometry."""
    model = robot.model
    center = Poses(Tree(model), q).points(model.contact_link, model.contact_position)
    return center[..., 1] - model.contact_radius


def fall(robot: str, seed: int, rows: float = ROWS) -> hs.Run:
    """Simulate a fall, with rows so far apart (s)."""
    loaded = hs.load_robot(robot)
    friction, state = random_start(loaded, seed)
    return hs.simulate(
        loaded, state=state, duration=DURATION, method=hs.EventDriven(output_period=rows),
        ground=hs.Ground(friction=friction), stop_when_fallen=False,
    )  # fmt: skip


def judge(run: hs.Run) -> Findings:
    """Judge the record of a fall."""
    found, q, at = Findings(), run.position, run.time
    points, joints = tuple(run.robot.contact_names), tuple(run.robot.joint_names)
    arrived = run.completed and len(at) > 0 and abs(at[-1] - DURATION) <= 1e-9
    if not len(at):
        at = np.zeros(1)
    found.look("does not arrive", np.array([0.0 if arrived else 1.0]), 0.0, at[-1:])
    if not len(run.time):
        return found
    rows = Rows(run, instants=True)
    found.look("time goes back", -np.diff(at), 0.0, at[1:])
    above, force = heights(run.robot, q), run.contact_force[..., 0]
    found.look("in the ground", -above, PLACE, at, points)
    apart = np.where(force > 0.0, np.abs(above), 0.0)
    found.look("force off the ground", apart, PLACE, at, points)
    model = run.robot.model
    weight = float(np.sum(model.mass) * np.linalg.norm(model.gravity))
    found.look("force that pulls", -force / weight, PULL, at, points)
    beyond = np.maximum(model.lower - q, q - model.upper)
    found.look("joint beyond its range", beyond, PLACE, at, joints)
    moved = np.minimum(*unexplained(rows))
    found.look(UNMOVED, moved, MOTION, at[1:], joints)
    judge_energy(rows, found)
    return found


def unexplained(rows: Rows) -> tuple[Array, Array]:
    """Changes of coordinates (T - 1, n) beyond what their speeds explain, reckoned in two ways.

    By Hermite's rule, with the accelerations at both ends, which fails where these jump; and by the
    mean of the speeds, give or take their difference, which fails where a speed turns round.
    """
    q, v, step = rows.q, rows.v, np.diff(rows.time)[:, None]
    pulled = rows.metric.accelerated(rows.smooth + rows.contact_force())
    size = 1.0 + np.abs(q[1:])
    rough = np.diff(q, axis=0) - 0.5 * step * (v[1:] + v[:-1])
    fine = rough + step**2 / 12.0 * np.diff(pulled, axis=0)
    rough = np.maximum(np.abs(rough) - step * np.abs(np.diff(v, axis=0)), 0.0)
    return np.abs(fine) / size, rough / size


def judge_energy(rows: Rows, found: Findings) -> None:
    """Look at the energy, and at what bridges cost."""
    run, at = rows.run, rows.time
    kinetic, potential = rows.energy()
    energy = kinetic + potential
    play = max(float(kinetic.max() + np.ptp(potential)), 1e-300)
    least = np.minimum.accumulate(energy)
    lengths, gains, inside = [0.0], [0.0], np.zeros(len(at), dtype=bool)
    for event in run.events:
        if event.kind is EventKind.BRIDGE:
            length = event.impulse[0]
            begin = int(np.searchsorted(at, event.time - 1e-14))
            end = int(np.searchsorted(at, event.time + length - 1e-14))
            inside[int(np.searchsorted(at, event.time + 1e-14)) - 1] = True
            lengths.append(length)
            gains.append(float(energy[min(end, len(at) - 1)] - energy[begin]))
    # Impulses at the beginning of a bridge are those of forces that act in all its time.
    rise = np.where(inside, 0.0, energy - least)
    found.look("energy rises", rise / play, ENERGY, at)
    total = sum(lengths)
    found.look("bridges last", np.array([total / DURATION]), BRIDGED, at[-1:])
    found.figures |= {
        "bridges": len(lengths) - 1,
        "in bridges (s)": total,
        "longest bridge (s)": max(lengths),
        "energy from bridges (J)": sum(gain for gain in gains if gain > 0.0),
        "energy in play (J)": play,
        "contact events": sum(event.kind is not EventKind.BRIDGE for event in run.events),
    }


def run_fall(robot: str, seed: int, *, twins: bool = False) -> dict[str, Any]:
    """Run and judge a fall; everything in the result is numbers and text."""
    del twins  # no fall has any
    begin = time.process_time()
    result: dict[str, Any] = {"method": robot, "seed": seed}
    try:
        run = fall(robot, seed)
    except HeelstrikeError as error:
        return result | {"status": "refused", "message": str(error)}
    seconds = time.process_time() - begin
    result |= {"status": run.status.value, "message": run.message, "rows": len(run.time)}
    result |= {"friction": float(run.ground.model().friction[0]), "simulated_s": seconds}
    found = judge(run)
    if found.broken() == (UNMOVED,):
        found = judge(fall(robot, seed, FINE))
        result["fine"] = True
    result |= found.as_dict()
    result["seconds"] = time.process_time() - begin
    return result


def prepare(robot: str) -> None:
    """Compile what the falls of a robot need, so that none has to wait for it."""
    loaded = hs.load_robot(robot)
    hs.simulate(loaded, state=random_start(loaded, 0)[1], duration=0.01, method=hs.EventDriven())


COLUMNS = (
    "robot", "falls", "arrive", "objections", "bridges: median", "most", "longest in all",
    "energy of bridges", "deepest", "off the ground", UNMOVED, "energy rises",
    "CPU s: mean", "most",
)  # fmt: skip


def table(results: list[dict[str, Any]]) -> str:
    """Sum results up, robot by robot, as a table."""
    lines = [COLUMNS, ("---",) * len(COLUMNS)]
    robots = sorted({one["method"] for one in results})
    for robot in [*robots, "all"]:
        some = [one for one in results if robot in (one["method"], "all")]
        judged = [one for one in some if one.get("figures")]
        figures = [one["figures"] for one in judged]

        def worst(law: str, judged: list[dict[str, Any]] = judged) -> str:
            return f"{max((one['worst'].get(law, 0.0) for one in judged), default=0.0):.1e}"

        def most(name: str, figures: list[dict[str, Any]] = figures) -> float:
            return max((one[name] for one in figures), default=0.0)

        bridges = [one["bridges"] for one in figures] or [0]
        seconds = [one["simulated_s"] for one in judged] or [0.0]
        arrive = sum(one["status"] == "completed" for one in some)
        lines.append((
            robot, f"{len(some)}", f"{arrive}",
            f"{sum(bool(one.get('objections', True)) for one in some)}",
            f"{np.median(bridges):g}", f"{max(bridges)}", f"{most('in bridges (s)'):.1e} s",
            f"{most('energy from bridges (J)'):.1e} J", worst("in the ground"),
            worst("force off the ground"), worst(UNMOVED), worst("energy rises"),
            f"{np.mean(seconds):.2f}", f"{max(seconds):.1f}",
        ))  # fmt: skip
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    named = [
        f"- {one['method']} {one['seed']}: {one['status']}. {words(one)} {one.get('message') or ''}"
        for one in results
        if one.get("objections", True)
    ]
    return "\n".join([text, "", *named])


def words(result: dict[str, Any]) -> str:
    """Say what there is to object, in a line."""
    return "; ".join(
        f"{one['law']} {one['size']:.1e}" + (f" ({one['where']})" if one["where"] else "")
        for one in result.get("objections", [])
    )


def main() -> None:
    """Run falls, sum them up, or show one."""
    robots = hs.builtin_robots()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="run falls and append what comes out to a file")
    add_arguments(run, 100, kept=True, of="robots", choices=robots)
    sums = commands.add_parser("table", help="sum a file of results up")
    sums.add_argument("results", type=Path)
    show = commands.add_parser("show", help="run and judge one fall")
    show.add_argument("robot", choices=robots)
    show.add_argument("seed", type=int)
    options = parser.parse_args()
    if options.command == "run":
        task = Task(run_fall, prepare, limit=LIMIT)
        for one in campaign(
            options.out, options.robots, options.seeds, workers=options.workers, task=task,
            twins=False,
        ):  # fmt: skip
            print(f"{one['method']} {one['seed']}: {one['status']}. {words(one)}", flush=True)
        print(table(results_in(options.out)))
    elif options.command == "table":
        print(table(results_in(options.results)))
    else:
        print(json.dumps(run_fall(options.robot, options.seed), indent=2))


if __name__ == "__main__":
    main()
