"""Falls that are built to have a cause, and whether that is what they are told to have.

Of each kind there are as many as one asks for. bravo7 walks its reference gait under computed
torque (legs that give way: it stands on bent ones); what is done to it, how much and when is drawn
from ``default_rng([seed, kind])``. One that does not fall says nothing and is drawn again; how many
those were is told. The twin, to which nothing is done, must walk on.

    python benchmarks/named_falls.py --each 20

prints how often each cause was named, by the cause that was built.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import built_falls as built
import walking

import heelstrike as hs
from heelstrike.analysis import first_cause
from heelstrike.analysis.diagnosis.symptoms import Cause
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.experiments.what_if import Case

Rng = np.random.Generator
LEGS = ("left", "right")
GAPS = (0.399, 0.698, 0.997, 1.296)
"""Where no foot comes to stand: from here on for 0.1 m."""
EXPLICIT = hs.TimeStepping(step=1e-3, scheme=hs.Scheme.PAPER_EXPLICIT)
MOST_DRAWS = 10
"""Draws for one fall before it is given up."""


def robot(**numbers: np.ndarray) -> hs.Robot:
    """Return bravo7 with other numbers."""
    usual = walking.bravo7()
    return dataclasses.replace(usual, model=usual.model.replaced(**numbers))


def of_joint(name: str, joint: str, value: float) -> np.ndarray:
    """Return a number of all joints, in which that of one is another."""
    usual = walking.bravo7()
    found = np.array(getattr(usual.model, name))
    found[usual.joint_index(joint)] = value
    return found


def push(rng: Rng, forwards: float, upwards: float = 0.0) -> Case:
    """Push the trunk, in N, at any time in the second and third step."""
    start = float(rng.uniform(0.75, 2.05))
    return built.walk(
        pushes=[hs.Push("trunk", force=(forwards, upwards), start=start, duration=0.1)]
    )


def slippery(rng: Rng) -> Case:
    """Let friction be poor everywhere, or on a patch."""
    friction = float(rng.uniform(0.03, 0.10))
    if rng.random() < 0.5:
        return built.walk(ground=hs.Ground(friction=friction))
    begin = float(rng.uniform(0.2, 0.7))
    corners = np.array([(-9.0, 0.0), (begin, 0.0), (begin + 9.0, 0.0), (99.0, 0.0)])
    return built.walk(ground=hs.Ground(friction=[0.75, friction, 0.75], profile=corners))


def tipping_forward(rng: Rng) -> Case:
    """Push it forwards over the toes of its stance foot."""
    return push(rng, float(rng.uniform(250.0, 400.0)))


def tipping_back(rng: Rng) -> Case:
    """Push it backwards over the heel of its stance foot."""
    return push(rng, -float(rng.uniform(250.0, 400.0)))


def scuffing(rng: Rng) -> Case:
    """Put a bar, or a step up, under the swing of a foot."""
    height, wide = float(rng.uniform(0.045, 0.07)), float(rng.uniform(0.01, 0.04))
    edge = float(rng.choice(GAPS) + rng.uniform(0.005, 0.05))
    after = 0.0 if rng.random() < 0.5 else height
    corners = [(-9.0, 0.0), (edge, 0.0), (edge, height), (edge + wide, height)]
    corners += [(edge + wide, after), (99.0, after)] if after == 0.0 else [(99.0, height)]
    return built.walk(ground=hs.Ground(friction=walking.FRICTION, profile=np.array(corners)))


def landing_late(rng: Rng) -> Case:
    """Let the ground step down, in mid-swing and for good."""
    depth = float(rng.uniform(0.03, 0.08))
    edge = float(rng.choice(GAPS) + rng.uniform(0.005, 0.09))
    corners = [(-9.0, 0.0), (edge, 0.0), (edge, -depth), (99.0, -depth)]
    return built.walk(ground=hs.Ground(friction=walking.FRICTION, profile=np.array(corners)))


def weak(rng: Rng) -> Case:
    """Let all motors, or those of a joint of both legs, give little torque."""
    limit = np.full(6, 300.0)
    which = int(rng.integers(0, 3))
    most = {0: 14.0, 1: 9.0, 2: 10.0}[which]
    if rng.random() < 0.5:
        limit[:] = rng.uniform(5.0, 10.0)
    else:
        limit[[which, which + 3]] = rng.uniform(0.3, 0.6) * most
    return built.walk(robot=robot(torque_lower=-limit, torque_upper=limit))


def slow(rng: Rng) -> Case:
    """Let motors be slower than the gait is."""
    hinges = np.arange(9) >= 3
    fastest = float(rng.uniform(0.8, 2.2))
    return built.walk(
        robot=robot(
            stall_torque=np.where(hinges, float(rng.uniform(80.0, 250.0)), np.inf),
            no_load_speed=np.where(hinges, fastest, np.inf),
        )
    )


def stopped(rng: Rng) -> Case:
    """Let a joint end before the gait is where it goes."""
    number, joint, low, high = STOPS[int(rng.integers(0, len(STOPS)))]
    return built.walk(
        robot=robot(**{number: of_joint(number, joint, float(rng.uniform(low, high)))})
    )


STOPS = (
    ("upper", "left_knee", 0.1, 0.35), ("upper", "right_knee", 0.1, 0.35),
    ("lower", "left_hip", -0.25, -0.1), ("upper", "right_hip", -0.1, 0.1),
    ("lower", "right_ankle", -0.2, -0.02), ("upper", "left_ankle", -0.1, 0.1),
)  # fmt: skip
"""Ends of joints that lie inside the gait and outside its beginning (rad)."""


def folding(rng: Rng) -> Crouch:
    """Load it from above, suddenly, as it stands on bent legs of springs without limits."""
    return Crouch(float(rng.uniform(4000.0, 9000.0)))


@dataclasses.dataclass(frozen=True)
class Crouch:
    """bravo7 that stands on bent legs, on springs, under a load from above (N) from 0.5 s on."""

    load: float

    def run(self, on_error: str = "stop") -> hs.Run:
        """Let it stand for 3 s."""
        free = robot(torque_lower=np.full(6, -np.inf), torque_upper=np.full(6, np.inf))
        pose = {f"{leg}_{joint}": angle for leg in LEGS
                for joint, angle in (("hip", -0.5), ("knee", 1.0), ("ankle", -0.5))}  # fmt: skip
        state = free.placed(free.state(pose), hs.Ground())
        law = JointFeedback(free, state.q[free.model.actuator_joint], kp=1000.0, kd=50.0)
        load = hs.Push("trunk", force=(0.0, -self.load), start=0.5, duration=2.0)
        return hs.simulate(
            free, law, state=state, duration=3.0, pushes=[load] if self.load else [],
            on_error=on_error,
        )  # fmt: skip


def faulty(rng: Rng) -> Case:
    """Let the controller go wrong about one joint."""
    joint = f"{rng.choice(LEGS)}_{rng.choice(['hip', 'knee', 'ankle'])}"
    steady = float(rng.choice([-1.0, 1.0]) * rng.uniform(60.0, 150.0))
    fault: Callable[[float], float] = [
        lambda torque: -torque, lambda _: 0.0, lambda _: float("nan"),
        lambda _: steady,
    ][int(rng.integers(0, 4))]  # fmt: skip
    return built.faulty(joint, fault)


def diverging(rng: Rng) -> Case:
    """Give a joint a spring that is too stiff for explicit steps, and take such."""
    joint = f"{rng.choice(LEGS)}_{rng.choice(['hip', 'knee', 'ankle'])}"
    return built.walk(
        robot=robot(stiffness=of_joint("stiffness", joint, 10.0 ** float(rng.uniform(7.0, 12.0)))),
        method=EXPLICIT,
    )


KINDS: dict[Cause, Callable[[Rng], Case | Crouch]] = {
    Cause.SLIPPED: slippery,
    Cause.TIPPED_FORWARD: tipping_forward,
    Cause.TIPPED_BACK: tipping_back,
    Cause.SCUFFED: scuffing,
    Cause.LATE_TOUCHDOWN: landing_late,
    Cause.TORQUE_LIMIT: weak,
    Cause.SPEED_LIMIT: slow,
    Cause.JOINT_STOP: stopped,
    Cause.LEG_GAVE_WAY: folding,
    Cause.CONTROLLER: faulty,
    Cause.NUMERICAL: diverging,
}
"""What is built to cause each."""


@cache
def walks_on(cause: Cause) -> bool:
    """Whether the twins of a kind walk on: the same without what is done to it."""
    case = Crouch(0.0) if cause is Cause.LEG_GAVE_WAY else built.walk()
    run = case.run(on_error="stop")
    return run.completed and first_cause(run, gait_of(cause)) is None


def gait_of(cause: Cause) -> hs.Gait | None:
    """Gait that the robots of a kind follow."""
    return None if cause is Cause.LEG_GAVE_WAY else walking.gait()


def told_cause(cause: Cause, seed: int) -> tuple[str, int]:
    """Build a fall; return what is told of it, and how often it had to be drawn."""
    rng = np.random.default_rng([seed, list(KINDS).index(cause)])
    for draws in range(1, MOST_DRAWS + 1):
        run = KINDS[cause](rng).run(on_error="stop")
        found = first_cause(run, gait_of(cause))
        if found is not None:
            return str(found), draws
    return "no fall", MOST_DRAWS


def main() -> None:
    """Build falls, and print how they are told."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--each", type=int, default=20, help="falls of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    parser.add_argument("--wrong", action="store_true", help="show those that are named wrongly")
    options = parser.parse_args()
    right = total = 0
    for cause in KINDS:
        named: Counter[str] = Counter()
        drawn = 0
        for seed in range(options.seed, options.seed + options.each):
            told, draws = told_cause(cause, seed)
            drawn += draws
            name = told.partition(" at ")[0]
            named[name] += 1
            if options.wrong and name != cause.value:
                print(f"    {cause.value} {seed}: {told}")
        right += named[cause.value]
        total += options.each
        twin = "" if walks_on(cause) else "; THE TWIN FALLS"
        print(f"{cause.value:16s} {dict(named)}, {drawn} drawn{twin}", flush=True)
    print(f"{right} of {total} named rightly, {100.0 * right / total:.1f} %")


if __name__ == "__main__":
    main()
