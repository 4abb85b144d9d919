"""One motion of each kind: designed, refined until it closes, and kept for the tests.

Run, from the top folder::

    python benchmarks/motion_kinds.py                # all of them
    python benchmarks/motion_kinds.py toe limp       # some of them

Each is designed by `hs.optimize_motion` and written to `tests/gait/motion/kinds`, where the tests
look at it with MuJoCo's equations of motion. A motion closes if computed torque, from its initial
state, brings the robot to where the motion goes on. The table has by how much it misses that state
(m, rad, m/s, rad/s), by the design's own estimate and by MuJoCo's equations, and the time of the
processor.
"""

from __future__ import annotations

import gzip
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np

import heelstrike as hs
from heelstrike import ContactPhase as Phase
from heelstrike import dynamics

TESTS = Path(__file__).parents[1] / "tests"
FOLDER = Path(__file__).parents[1] / "tests" / "gait" / "motion" / "kinds"
STEP = {"distance": 0.30, "duration": 0.70}


@dataclass(frozen=True)
class Kind:
    """A kind of motion."""

    robot: Callable[[], hs.Robot]
    phases: tuple[Phase, ...]
    asked: Callable[[hs.Robot], dict[str, Any]] | dict[str, Any] = field(default_factory=dict)

    def arguments(self, robot: hs.Robot) -> dict[str, Any]:
        """Return what is asked of a motion but its phases."""
        return self.asked(robot) if callable(self.asked) else self.asked


def of_library(name: str) -> Callable[[], hs.Robot]:
    """Return what loads a robot."""
    return lambda: hs.load_robot(name)


def sprung() -> hs.Robot:
    """bravo7 with springs at its knees and ankles."""
    robot = hs.load_robot("bravo7")
    stiffness = robot.model.stiffness.copy()
    for side in ("right", "left"):
        stiffness[robot.joint_names.index(f"{side}_knee")] = 40.0
        stiffness[robot.joint_names.index(f"{side}_ankle")] = 100.0
    return replace(robot, model=robot.model.replaced(stiffness=stiffness))


def geared() -> hs.Robot:
    """bravo7 with motors whose torque falls with their speed."""
    robot = hs.load_robot("bravo7")
    driven = np.isin(np.arange(robot.nv), robot.model.actuator_joint)
    lines = {
        "stall_torque": np.where(driven, 300.0, np.inf),
        "no_load_speed": np.where(driven, 15.0, np.inf),
    }
    return replace(robot, model=robot.model.replaced(**lines))


def round_feet() -> hs.Robot:
    """Return rabbit on discs of 5 cm, which roll."""
    robot = hs.load_robot("rabbit")
    return replace(robot, model=robot.model.replaced(contact_radius=np.full(robot.nc, 0.05)))


def crouched(robot: hs.Robot, knee: float) -> hs.State:
    """bravo7 at rest on both flat feet, on bent knees."""
    q = robot.reference_state().q.copy()
    for side in ("right", "left"):
        for name, angle in (("hip", -0.5 * knee), ("knee", knee), ("ankle", -0.5 * knee)):
            q[robot.joint_names.index(f"{side}_{name}")] += angle
    q[:2] -= dynamics.contact_positions(robot, q).mean(axis=0)
    return hs.State(q, np.zeros(robot.nv))


def rising(robot: hs.Robot) -> dict[str, Any]:
    """From deeply bent knees to less bent ones: on straight legs, two feet are singular."""
    return {"repeat": "never", "start": crouched(robot, 1.6), "end": crouched(robot, 0.5)}


@cache
def walk_of(robot: hs.Robot) -> hs.Motion:
    """Return the usual gait of bravo7 as a motion, which starting and stopping go to and from."""
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    return gait.motion(robot)


def state_of(motion: hs.Motion, time: float) -> hs.State:
    """State of a motion at a time."""
    return hs.State(motion.position(time), motion.velocity(time))


def striding(robot: hs.Robot, stride: float) -> hs.State:
    """bravo7 at rest on bent knees, the right foot at the origin and the left one ahead."""
    q = crouched(robot, 0.5).q
    q[0] += 0.5 * stride
    for foot, place in enumerate((0.0, stride)):
        contacts = robot.model.contact_position[list(robot.feet[foot].contacts)]
        target = np.array([place, 0.0, 0.0])
        q = dynamics.inverse_kinematics(robot, q, foot, target, local=contacts.mean(axis=0)).q
    return hs.State(q, np.zeros(robot.nv))


def lifted(robot: hs.Robot, share: float, side: str) -> np.ndarray:
    """How joints of a leg bend in the course of its swing, to start the optimiser from."""
    bent = np.zeros(robot.nv)
    for name, angle in (("hip", -0.4), ("knee", 0.8), ("ankle", -0.4)):
        bent[robot.joint_names.index(f"{side}_{name}")] = 4.0 * share * (1.0 - share) * angle
    return bent


def passing(
    robot: hs.Robot, knots: list[tuple[float, np.ndarray]], side: str
) -> Callable[[float], Any]:
    """Return positions that pass evenly through others at times, a leg bent in its swing."""
    times = np.array([time for time, _ in knots])

    def at(time: float) -> Any:
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(knots) - 2))
        share = float(np.clip((time - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0))
        even = (1.0 - share) * knots[k][1] + share * knots[k + 1][1]
        return even + (lifted(robot, share, side) if times[k] == 0.0 else 0.0)

    return at


def starting(robot: hs.Robot) -> dict[str, Any]:
    """From rest, feet together, to the middle of the walk's second step, on the left foot."""
    walk, start = walk_of(robot), crouched(robot, 0.5)
    end = state_of(walk, 1.5 * walk.duration)
    knots = [(0.0, start.q), (0.7, walk.position(walk.duration)), (1.05, end.q)]
    guess = passing(robot, knots, "left")
    return {"repeat": "never", "start": start, "end": end, "guess": guess}


def stopping(robot: hs.Robot) -> dict[str, Any]:
    """From the middle of a step of the walk, on the right foot, to rest on both feet."""
    walk, end = walk_of(robot), striding(robot, 0.25)
    start = state_of(walk, 0.5 * walk.duration)
    knots = [(0.0, start.q), (0.35, end.q), (1.05, end.q)]
    guess = passing(robot, knots, "left")
    return {"repeat": "never", "start": start, "end": end, "guess": guess}


HURDLE = {"place": 0.15, "height": 0.10, "half_width": 0.02}
"""An obstacle between two footholds of the walk (m)."""


def stepping_over(robot: hs.Robot) -> dict[str, Any]:
    """Two steps of the walk, with an obstacle between the first two footholds."""
    walk = walk_of(robot)
    start, end = (state_of(walk, share * walk.duration) for share in (0.2, 2.2))
    return {
        "repeat": "never", "start": start, "end": end,
        "constraint": hs.over_obstacle(robot, **HURDLE),
        "guess": lambda time: walk.position(time + 0.2 * walk.duration),
    }  # fmt: skip


def linked_ankles() -> hs.Robot:
    """Biped whose ankle motors sit on its shanks: each drives its ankle by a lever and a rod.

    The levers keep from where they are in line with their rods.
    """
    from mechanisms import parallel_ankles

    robot = parallel_ankles()
    levers = [robot.joint_names.index(f"{side}_motor") for side in ("right", "left")]
    lower, upper = robot.model.lower.copy(), robot.model.upper.copy()
    lower[levers], upper[levers] = -1.0, 1.0
    return replace(robot, model=robot.model.replaced(lower=lower, upper=upper))


def sprung_ankles() -> hs.Robot:
    """The same with springs at the ankles, which have no motors of their own."""
    robot = linked_ankles()
    stiffness = robot.model.stiffness.copy()
    for side in ("right", "left"):
        stiffness[robot.joint_names.index(f"{side}_ankle")] = 100.0
    return replace(robot, model=robot.model.replaced(stiffness=stiffness))


def of_user(now: hs.gait.Instant) -> Any:
    """Torques and speeds of the motors."""
    return casadi.sumsqr(now.torque) + 50.0 * casadi.sumsqr(now.motor_velocity)


BRAVO7, RABBIT = of_library("bravo7"), of_library("rabbit")
FLAT = (Phase("right_foot", duration=0.7),)
TOE = Phase("right_foot_toe", duration=(0.05, 0.3), pieces=3)
KINDS = {
    "single support": Kind(BRAVO7, FLAT, STEP),
    "uphill": Kind(BRAVO7, FLAT, {**STEP, "slope": np.deg2rad(8.0)}),
    "downhill": Kind(BRAVO7, FLAT, {**STEP, "slope": np.deg2rad(-8.0)}),
    "toe": Kind(BRAVO7, (Phase("right_foot", duration=(0.3, 0.6)), TOE), STEP),
    "rolling": Kind(round_feet, (Phase("right_tibia", duration=0.6),), {"distance": 0.25}),
    "limp": Kind(
        RABBIT,
        (
            Phase("right_tibia", duration=(0.55, 0.8)),
            Phase("left_tibia", duration=(0.2, 0.5)),
        ),
        {"distance": 0.5, "duration": 1.0, "repeat": "same"},
    ),
    "standing up": Kind(
        BRAVO7, (Phase("right_foot", "left_foot", duration=0.6, pieces=4),), rising
    ),
    "springs": Kind(sprung, FLAT, STEP),
    "electrical energy": Kind(geared, FLAT, {**STEP, "cost": "electrical_energy"}),
    "user's cost": Kind(BRAVO7, FLAT, {**STEP, "cost": of_user}),
    "run": Kind(
        RABBIT,
        (
            Phase("right_tibia", duration=(0.05, 0.3), pieces=4),
            Phase(duration=(0.05, 0.3), pieces=3),
        ),
        {"speed": 2.0},
    ),
    "starting": Kind(
        BRAVO7,
        (Phase("right_foot", duration=0.7), Phase("left_foot", duration=0.35, pieces=4)),
        starting,
    ),
    "stopping": Kind(
        BRAVO7,
        (
            Phase("right_foot", duration=0.35, pieces=4),
            Phase("right_foot", "left_foot", duration=0.7),
        ),
        stopping,
    ),
    "stepping over": Kind(
        BRAVO7,
        (
            Phase("right_foot", duration=0.56),
            Phase("left_foot", duration=0.7),
            Phase("right_foot", duration=0.14, pieces=2),
        ),
        stepping_over,
    ),
    "closed loops": Kind(linked_ankles, (Phase("right_ankle", duration=0.6),), {"distance": 0.25}),
    "closed loops and springs": Kind(
        sprung_ankles, (Phase("right_ankle", duration=0.6),), {"distance": 0.25}
    ),
}


def file_of(name: str) -> Path:
    """Return where a kind is kept."""
    plain = "".join(each if each.isalnum() else "_" for each in name)
    return FOLDER / f"{plain}.json.gz"


def keep(motion: hs.Motion, path: Path) -> None:
    """Write a motion, packed, the same file for the same motion."""
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "motion.json"
        motion.save(plain)
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(gzip.compress(plain.read_bytes(), mtime=0))


def kept(name: str, robot: hs.Robot) -> hs.Motion:
    """Read the motion of a kind."""
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "motion.json"
        plain.write_bytes(gzip.decompress(file_of(name).read_bytes()))
        return hs.load_motion(plain, robot)


def designed(name: str) -> str:
    """Design the motion of a kind, keep it, and return its row of the table."""
    from closing import gap, lacking, mechanics_of

    kind = KINDS[name]
    robot = kind.robot()
    asked = kind.arguments(robot)
    begin = time.process_time()
    motion = hs.optimize_motion(robot, kind.phases, **asked)
    spent = time.process_time() - begin
    mechanics = mechanics_of(robot, motion.slope)
    keep(motion, file_of(name))
    counts = " + ".join(str(len(each.pieces)) for each in motion.phases)
    cells = (
        name, robot.name, f"{spent:.1f}", f"{motion.cost:.4g}",
        "yes" if motion.optimal else "no", counts, f"{motion.closes_to:.0e}",
        f"{gap(mechanics, motion):.0e}", f"{lacking(mechanics, motion):.0e}",
        f"{file_of(name).stat().st_size / 1024:.0f}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Design, keep, and print the table."""
    sys.path.insert(0, str(TESTS))  # the judge is among them, and a robot
    head = "motion, robot, design (s), cost (N²m²s), optimal, pieces, closes to, by MuJoCo"
    columns = [*head.split(", "), "lacks (N)", "kB"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for name in sys.argv[1:] or KINDS:
        try:
            print(designed(name), flush=True)
        except hs.GaitError as error:
            print(f"| {name} | {error} |", flush=True)


if __name__ == "__main__":
    main()
