"""Falls that are built to have a cause, and whether that is what they are told to have.

Of each kind there are as many as one asks for. bravo7 walks its reference gait under computed
torque (legs that give way: it stands on bent ones); what is done to it, how much and when is drawn
from ``default_rng([seed, kind])``. One that does not fall says nothing and is drawn again; how many
those were is told. The twin, to which nothing is done, must walk on.

    python benchmarks/named_falls.py --each 20

prints how often each cause was named, by the cause that was built.

    python benchmarks/named_falls.py --random 220

does two or three of these things at once, each as strong as it happens to be. Which of them caused
the fall is found by leaving some out: causes are the members of every smallest set that makes the
robot fall by itself, and not without any one of its members (J. L. Mackie 1965, *Causes and
conditions*: INUS conditions). If two things are each enough, both are causes. A fall is named
rightly if what is told is one of them.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

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
Changes = Mapping[str, Any]
"""What is done to a walk: its pushes, ground, numbers of the robot, law, method; or a load."""
LEGS = ("left", "right")
GAPS = (0.399, 0.698, 0.997, 1.296)
"""Where no foot comes to stand: from here on for 0.1 m."""
EXPLICIT = hs.TimeStepping(step=1e-3, scheme=hs.Scheme.PAPER_EXPLICIT)
QUICK = 12.0
"""Speed (rad/s) of motors that are quick enough."""
BEYOND = 0.6
"""How far (rad) beyond the end of a joint that stops the gait an end is that lets it pass."""
MILDEST = 0.3
"""Least strength of what is done at random."""
MOST_AT_ONCE = 3
"""How much is done at once at random."""
OF_THEIR_OWN = (Cause.LEG_GAVE_WAY, Cause.NUMERICAL)
"""What is not done at random beside others: the one is no walk, and a spring that is mild enough
for its steps is no numerical trouble but a spring."""
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


def milder(value: float, usual: float, strength: float) -> float:
    """Return a number of which less strength is left: all of it at 1, the usual one at 0."""
    return usual * (value / usual) ** strength


def push(rng: Rng, forwards: float) -> Changes:
    """Push the trunk, in N, at any time in the second and third step."""
    start = float(rng.uniform(0.75, 2.05))
    return {"pushes": [hs.Push("trunk", force=(forwards, 0.0), start=start, duration=0.1)]}


def slippery(rng: Rng, strength: float) -> Changes:
    """Let friction be poor everywhere, or on a patch."""
    friction = milder(float(rng.uniform(0.03, 0.10)), walking.FRICTION, strength)
    if rng.random() < 0.5:
        return {"ground": hs.Ground(friction=friction)}
    begin = float(rng.uniform(0.2, 0.7))
    corners = np.array([(-9.0, 0.0), (begin, 0.0), (begin + 9.0, 0.0), (99.0, 0.0)])
    return {"ground": hs.Ground(friction=[0.75, friction, 0.75], profile=corners)}


def tipping_forward(rng: Rng, strength: float) -> Changes:
    """Push it forwards over the toes of its stance foot."""
    return push(rng, strength * float(rng.uniform(250.0, 400.0)))


def tipping_back(rng: Rng, strength: float) -> Changes:
    """Push it backwards over the heel of its stance foot."""
    return push(rng, -strength * float(rng.uniform(250.0, 400.0)))


def profiled(corners: list[tuple[float, float]]) -> Changes:
    """Let the ground have corners."""
    return {"ground": hs.Ground(friction=walking.FRICTION, profile=np.array(corners))}


def scuffing(rng: Rng, strength: float) -> Changes:
    """Put a bar, or a step up, under the swing of a foot."""
    height, wide = strength * float(rng.uniform(0.045, 0.07)), float(rng.uniform(0.01, 0.04))
    edge = float(rng.choice(GAPS) + rng.uniform(0.005, 0.05))
    after = 0.0 if rng.random() < 0.5 else height
    corners = [(-9.0, 0.0), (edge, 0.0), (edge, height), (edge + wide, height)]
    corners += [(edge + wide, after), (99.0, after)] if after == 0.0 else [(99.0, height)]
    return profiled(corners)


def landing_late(rng: Rng, strength: float) -> Changes:
    """Let the ground step down, in mid-swing and for good."""
    depth = strength * float(rng.uniform(0.03, 0.08))
    edge = float(rng.choice(GAPS) + rng.uniform(0.005, 0.09))
    return profiled([(-9.0, 0.0), (edge, 0.0), (edge, -depth), (99.0, -depth)])


def weak(rng: Rng, strength: float) -> Changes:
    """Let all motors, or those of a joint of both legs, give little torque."""
    limit = np.full(6, 300.0)
    which = int(rng.integers(0, 3))
    most = {0: 14.0, 1: 9.0, 2: 10.0}[which]
    if rng.random() < 0.5:
        limit[:] = milder(float(rng.uniform(5.0, 10.0)), 300.0, strength)
    else:
        few = milder(float(rng.uniform(0.3, 0.6)) * most, 300.0, strength)
        limit[[which, which + 3]] = few
    return {"numbers": {"torque_lower": -limit, "torque_upper": limit}}


def slow(rng: Rng, strength: float) -> Changes:
    """Let motors be slower than the gait is."""
    hinges = np.arange(9) >= 3
    fastest = milder(float(rng.uniform(0.8, 2.2)), QUICK, strength)
    return {
        "numbers": {
            "stall_torque": np.where(hinges, float(rng.uniform(80.0, 250.0)), np.inf),
            "no_load_speed": np.where(hinges, fastest, np.inf),
        }
    }


def stopped(rng: Rng, strength: float) -> Changes:
    """Let a joint end before the gait is where it goes."""
    number, joint, low, high = STOPS[int(rng.integers(0, len(STOPS)))]
    end = float(rng.uniform(low, high))
    end += (1.0 - strength) * (BEYOND if number == "upper" else -BEYOND)
    return {"numbers": {number: of_joint(number, joint, end)}}


STOPS = (
    ("upper", "left_knee", 0.1, 0.35), ("upper", "right_knee", 0.1, 0.35),
    ("lower", "left_hip", -0.25, -0.1), ("upper", "right_hip", -0.1, 0.1),
    ("lower", "right_ankle", -0.2, -0.02), ("upper", "left_ankle", -0.1, 0.1),
)  # fmt: skip
"""Ends of joints that lie inside the gait and outside its beginning (rad)."""


def folding(rng: Rng, strength: float) -> Changes:
    """Load it from above, suddenly, as it stands on bent legs of springs without limits."""
    return {"load": strength * float(rng.uniform(4000.0, 9000.0))}


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


def faulty(rng: Rng, strength: float) -> Changes:
    """Let the controller go wrong about one joint."""
    joint = f"{rng.choice(LEGS)}_{rng.choice(['hip', 'knee', 'ankle'])}"
    steady = strength * float(rng.choice([-1.0, 1.0]) * rng.uniform(60.0, 150.0))
    fault: Callable[[float], float] = [
        lambda torque: -torque, lambda _: 0.0, lambda _: float("nan"),
        lambda _: steady,
    ][int(rng.integers(0, 4))]  # fmt: skip
    return {"law": built.faulty_law(joint, fault)}


def diverging(rng: Rng, strength: float) -> Changes:
    """Give a joint a spring that is too stiff for explicit steps, and take such."""
    joint = f"{rng.choice(LEGS)}_{rng.choice(['hip', 'knee', 'ankle'])}"
    stiff = 10.0 ** (strength * float(rng.uniform(7.0, 12.0)))
    return {"numbers": {"stiffness": of_joint("stiffness", joint, stiff)}, "method": EXPLICIT}


def case_of(*several: Changes) -> Case | Crouch:
    """Return the walk to which several things are done, or the stand under a load."""
    done: dict[str, Any] = {}
    numbers: dict[str, np.ndarray] = {}
    for changes in several:
        if "load" in changes:
            return Crouch(changes["load"])
        numbers |= changes.get("numbers", {})
        done |= {name: each for name, each in changes.items() if name != "numbers"}
    return built.walk(**done, **({"robot": robot(**numbers)} if numbers else {}))


KINDS: dict[Cause, Callable[[Rng, float], Changes]] = {
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
        run = case_of(KINDS[cause](rng, 1.0)).run(on_error="stop")
        found = first_cause(run, gait_of(cause))
        if found is not None:
            return str(found), draws
    return "no fall", MOST_DRAWS


def random_fall(seed: int) -> tuple[hs.Run, set[Cause], int]:
    """Draw a fall at random; return its run, its causes and how often it was drawn.

    Two or three things at once are done to a walk, each as strong as it happens to be. What does
    not fall is drawn again.
    """
    rng = np.random.default_rng([seed, len(KINDS)])
    kinds = [cause for cause in KINDS if cause not in OF_THEIR_OWN]
    draws = 0
    while True:
        draws += 1
        chosen = rng.permutation(len(kinds))[: int(rng.integers(2, MOST_AT_ONCE + 1))]
        done = {
            kinds[k]: KINDS[kinds[k]](rng, float(rng.uniform(MILDEST, 1.0)))
            for k in chosen.tolist()
        }
        touched = [name for each in done.values() for name in touches(each)]
        if len(set(touched)) < len(touched):
            continue  # two grounds, or two pushes: one would hide the other
        run = case_of(*done.values()).run(on_error="stop")
        if told_of(run):
            return run, causes_among(done), draws


def causes_among(done: Mapping[Cause, Changes]) -> set[Cause]:
    """Return what is part of a smallest set that makes the robot fall by itself."""
    enough: list[set[Cause]] = [set(done)]
    for count in range(len(done) - 1, 0, -1):
        for some in combinations(done, count):
            if told_of(case_of(*(done[cause] for cause in some)).run(on_error="stop")):
                enough.append(set(some))
    smallest = [each for each in enough if not any(other < each for other in enough)]
    return set().union(*smallest)


def touches(changes: Changes) -> list[str]:
    """Name what changes set."""
    return [*(changes.keys() - {"numbers"}), *changes.get("numbers", {})]


def told_of(run: hs.Run) -> str:
    """Tell why a walk falls; nothing if it does not."""
    found = first_cause(run, walking.gait())
    return "" if found is None else str(found)


def at_random(count: int, seed: int, *, show: bool) -> None:
    """Draw falls at random, and print how many are named rightly."""
    right = draws = alone = 0
    for number in range(seed, seed + count):
        run, causes, drawn = random_fall(number)
        told = told_of(run)
        good = told.partition(" at ")[0] in {cause.value for cause in causes}
        right, draws, alone = right + good, draws + drawn, alone + (len(causes) == 1)
        if show and not good:
            print(f"    {number}: {told}; caused by {', '.join(sorted(c.value for c in causes))}",
                  flush=True)  # fmt: skip
    print(f"{right} of {count} named rightly, {100.0 * right / count:.1f} %, of {draws} drawn; "
          f"{alone} have one cause")  # fmt: skip


def main() -> None:
    """Build falls, and print how they are told."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--each", type=int, default=20, help="falls of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    parser.add_argument("--wrong", action="store_true", help="show those that are named wrongly")
    parser.add_argument("--random", type=int, default=0, help="falls drawn at random, instead")
    options = parser.parse_args()
    if options.random:
        at_random(options.random, options.seed, show=options.wrong)
        return
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
