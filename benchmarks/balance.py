"""How much footstep feedback withstands, and what it costs.

One controller with one set of gains. For pushes of 0.1 s on the trunk's centre of mass, at phases
of a step, the impulse is raised until the robot does not recover strictly
(:func:`heelstrike.analysis.recovery.recovery`): what is told is the last one of which it and all
smaller ones recovered. Everything else is 100 steps from a seed: where the ground changes, its
random heights, noise. A run counts if it completes, the hip stays above 0.65 of its height above
the ground, the trunk within 0.6 rad of how the gait leans, and the robot comes at least 0.7 of the
way that its steps should take it. Seeds below 1000 were used while the controller was made.

`small` tells what is left, step by step, of the error of the capture point after a push of 3 N s;
`multipliers` by what factor small errors shrink in a step (:func:`heelstrike.floquet_multipliers`);
`drag` of how many drags of 60 N s it recovers, link by link, in eight directions within 0.1, 0.2
and 0.3 s, as a hand drags in the live view; `stand` the largest pushes of a robot that stands;
`commands` how often it starts, walks at three speeds and stops. `--robot` may be a file, of three
dimensions with `--projected`.

Run: python benchmarks/balance.py [price small multipliers push drag hard stand commands]
     [--robot bravo7] [--projected] [--torque 150] [--phases 20] [--rise 5] [--links trunk]
     [--seeds 100] [--first 1000] [--method stepping]
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.analysis.recovery import recovery
from heelstrike.dynamics import contact_positions
from heelstrike.gait.sole import sole, standing_height

HEIGHT, WEIGHT = 0.9538, 75.0 * 9.81  # of bravo7
STEPS = 100
DRAG, DRAG_DURATIONS = 60.0, (0.1, 0.2, 0.3)  # N s of bravo7, and s
HIP, PITCH, WAY = 0.65, 0.6, 0.7
METHODS: dict[str, dict[str, Any]] = {
    "stepping": {},
    "events": {"method": hs.EventDriven(), "control_period": 1e-3},
}


@dataclasses.dataclass(frozen=True)
class Walker:
    """A robot, its gait, its controller, and how to simulate them."""

    robot: hs.Robot
    gait: hs.Gait
    law: hs.FootstepFeedback
    method: dict[str, Any]

    @classmethod
    def of(cls, name: str, method: str, torque: float | None, projected: bool) -> Walker:
        """Design its gait, scaled by its height, and its controller, with weaker motors if asked.

        The gait is that of the motors that the robot has.
        """
        robot = hs.load_robot(name, projected=projected)
        size = standing_height(robot, sole(robot, 0)) / HEIGHT
        gait = hs.optimize_gait(
            robot, step_length=round(0.30 * size, 3), step_duration=round(0.70 * size**0.5, 3)
        )
        if torque is not None:
            model = robot.model
            weaker = model.replaced(
                torque_lower=np.maximum(model.torque_lower, -torque),
                torque_upper=np.minimum(model.torque_upper, torque),
            )
            robot = dataclasses.replace(robot, model=weaker)
        return cls(robot, gait, hs.FootstepFeedback(robot, gait), METHODS[method])

    @property
    def size(self) -> float:
        """Its height, that of bravo7 being one."""
        return standing_height(self.robot, sole(self.robot, 0)) / HEIGHT

    @property
    def unit(self) -> float:
        """What an impulse of 1 N s on bravo7 is for this robot (N s)."""
        weight = float(-self.robot.model.mass.sum() * self.robot.model.gravity[1])
        return weight / WEIGHT * self.size**0.5

    def walk(self, duration: float, controller: Any = None, **options: Any) -> hs.Run:
        """Simulate it from the beginning of its gait."""
        law = self.law if controller is None else controller
        robot = options.pop("robot", self.robot)
        begin = self.gait.initial_state
        setup = self.method | {"record_every": 10} | options
        return hs.simulate(robot, law, state=begin, duration=duration, **setup)

    def push(
        self, impulse: float, phase: float, *, link: int | str = 2, angle: float = 0.0,
        duration: float = 0.1,
    ) -> hs.Push:  # fmt: skip
        """Push a link in the third step, at an angle (rad) above forwards."""
        start = (2.0 + phase) * self.gait.step_duration
        size = impulse / duration
        force = size * float(np.cos(angle)), size * float(np.sin(angle))
        return hs.Push(link, force=force, start=start, duration=duration)


def effort(run: hs.Run) -> float:
    """Mean of the sum of torques squared (N²m²)."""
    return float(np.mean(np.sum(run.torque**2, axis=1)))


def price(walker: Walker) -> None:
    """Tell what walking costs, unpushed on flat ground."""
    gait, duration = walker.gait, 20 * walker.gait.step_duration
    feedback = walker.walk(duration, record_every=1)
    usual = walker.walk(duration, hs.ComputedTorque(walker.robot, gait), record_every=1)
    way = feedback.position[-1, 0] - feedback.position[len(feedback.time) // 2, 0]
    print(
        f"mean torque² {effort(feedback):.1f} N²m², computed torque {effort(usual):.1f}, of the "
        f"gait {gait.cost / gait.step_duration:.1f}; step {way / 10.0:.4f} m, of the gait "
        f"{gait.step_length} m"
    )


def recovers(walker: Walker, push: hs.Push) -> bool:
    """Whether it recovers from a push, strictly."""
    run = walker.walk(push.end + 7.01, pushes=push, record_every=5)
    return bool(recovery(run, after=7.0))


def pushes(walker: Walker, phases: int, rise: float) -> None:
    """Tell the largest push of which it recovers, with all smaller ones."""
    rise *= walker.unit
    for name, sign in (("forwards", 1.0), ("backwards", -1.0)):
        found = []
        for phase in range(phases):
            count = 0
            while count < 40:
                push = walker.push(sign * rise * (count + 1), phase / phases)
                if not recovers(walker, push):
                    break
                count += 1
            found.append(rise * count)
        told = " ".join(f"{each:.3g}" for each in found)
        print(f"push {name}: least {min(found):.3g} N s; by phase {told}", flush=True)


def drags(walker: Walker, phases: int, links: list[str] | None) -> None:
    """Tell of how many drags it recovers: of 60 N s in eight directions, of three durations.

    A drag of the live view pulls at a point of a link in world axes, as strongly as the pointer is
    away from it; a hand that follows the link pulls evenly, as here, at its centre of mass.
    """
    impulse, angles = DRAG * walker.unit, np.arange(0, 360, 45)
    robot = walker.robot
    moving = [robot.link_names[i] for i in np.flatnonzero(robot.model.mass > 0.0)]
    for link in moving if links is None else links:
        for duration in DRAG_DURATIONS:
            failed = {
                int(angle): [
                    phase
                    for phase in range(phases)
                    if not recovers(walker, walker.push(
                        impulse, phase / phases, link=link, angle=np.deg2rad(angle),
                        duration=duration,
                    ))
                ]
                for angle in angles
            }  # fmt: skip
            count = phases * len(angles)
            good = count - sum(map(len, failed.values()))
            told = "; ".join(
                f"{angle}° {' '.join(map(str, each))}" for angle, each in failed.items() if each
            )
            print(
                f"drag {link}, {impulse:.3g} N s in {duration:g} s: {good} of {count}"
                f"{'; not, by direction and phase: ' + told if told else ''}",
                flush=True,
            )


def heavier(robot: hs.Robot, factor: float) -> hs.Robot:
    """Return the robot with another mass of the trunk, of which the controller does not know."""
    mass, inertia = robot.model.mass.copy(), robot.model.inertia.copy()
    mass[2] *= factor
    inertia[2] *= factor
    return dataclasses.replace(robot, model=robot.model.replaced(mass=mass, inertia=inertia))


def ground(
    size: float, seed: int, *, slope: float = 0.0, rise: float = 0.0, rough: float = 0.0,
    friction: float = 0.75, patch: float | None = None,
) -> hs.Ground:  # fmt: skip
    """Ground that changes somewhere between the third and the fifth step."""
    rng = np.random.default_rng(seed)
    start = size * rng.uniform(0.9, 1.5)
    x = [start - 9.0, start]
    z = [0.0, 0.0]
    if rise:
        x.append(start)
        z.append(rise)
    if rough:
        bumps = np.arange(1, 280) * 0.15 * size + start
        x += bumps.tolist()
        z += rng.uniform(-rough, rough, len(bumps)).tolist()
    if patch is not None:
        x.append(start + 0.6 * size)
        z.append(z[-1])
    x.append(x[-1] + 2.0)
    z.append(z[-1])
    heights = np.array(z) + np.tan(slope) * np.maximum(np.array(x) - start, 0.0)
    mu = np.full(len(x) - 1, friction)
    if patch is not None:
        mu[-2] = patch
    return hs.Ground(friction=mu, profile=np.column_stack((x, heights)))


def stays_up(walker: Walker, run: hs.Run, surface: hs.Ground) -> bool:
    """Whether it walked on, hip up and trunk upright."""
    height = run.position[:, 1] - np.array([float(surface.height(x)) for x in run.position[:, 0]])
    usual = run.position[run.time < 2.0 * walker.gait.step_duration, 2].mean()
    upright = np.abs(run.position[:, 2] - usual).max() < PITCH
    way = run.position[-1, 0] - run.position[0, 0] > WAY * STEPS * walker.gait.step_length
    return bool(run.completed and height.min() > HIP * height[0] and upright and way)


def hard(walker: Walker, seeds: range) -> None:
    """Tell of how many seeds it stays up, check by check."""
    size = walker.size
    made: Callable[..., hs.Ground] = partial(ground, size)
    degree = np.pi / 180.0

    def encoders(seed: int, law: Any) -> Any:
        return hs.Sensed(law, encoders=hs.Encoders(bits=14), period=1e-3, seed=seed)

    def everything(seed: int) -> tuple[hs.Ground, dict[str, Any]]:
        surface = made(seed, slope=4.0 * degree, rough=0.015 * size, friction=0.5)
        law = hs.Actuated(encoders(seed, walker.law), delay=3e-3)
        phase = np.random.default_rng(seed).uniform(8.0, 9.0)
        pushed = walker.push(30.0 * (-1.0) ** seed, phase)
        return surface, {
            "controller": law, "robot": heavier(walker.robot, 1.1), "pushes": pushed
        }  # fmt: skip

    checks: dict[str, Callable[[int], tuple[hs.Ground, dict[str, Any]]]] = {}
    for slope in (-12, 12):
        checks[f"slope {slope}°"] = lambda s, a=slope: (made(s, slope=a * degree), {})
    for rise in (-60, 40):
        checks[f"step {rise} mm"] = lambda s, a=rise: (made(s, rise=1e-3 * a * size), {})
    checks["rough ±30 mm"] = lambda s: (made(s, rough=0.03 * size), {})
    checks["patch of μ 0.25"] = lambda s: (made(s, patch=0.25), {})
    for factor in (0.8, 1.2):
        changed = heavier(walker.robot, factor)
        checks[f"trunk × {factor}, ±5 mm"] = lambda s, a=changed: (
            made(s, rough=0.005 * size),
            {"robot": a},
        )
    late = hs.Actuated(walker.law, delay=8e-3, period=1e-3)
    checks["delay 8 ms, ±5 mm"] = lambda s: (made(s, rough=0.005 * size), {"controller": late})
    checks["encoders of 14 bit, ±5 mm"] = lambda s: (
        made(s, rough=0.005 * size),
        {"controller": encoders(s, walker.law)},
    )
    checks["all at once"] = everything
    for name, setup in checks.items():
        fallen = []
        for seed in seeds:
            surface, options = setup(seed)
            run = walker.walk(STEPS * walker.gait.step_duration, ground=surface, **options)
            if not stays_up(walker, run, surface):
                fallen.append(seed)
        told = f"; not {' '.join(map(str, fallen))}" if fallen else ""
        print(f"{name}: {len(seeds) - len(fallen)} of {len(seeds)}{told}", flush=True)


def small(walker: Walker) -> None:
    """Tell how far the capture point is off in the steps after a push of 3 N s.

    From the foot that stands, a tenth of each step after its touchdown, as a part of what the push
    shifted it by.
    """
    duration = 10.0 * walker.gait.step_duration
    mass, rate = walker.robot.model.mass.sum(), walker.law.parameters.reference.rate

    def steps(**options: Any) -> np.ndarray:
        run = walker.walk(duration, record_every=1, **options)
        phase, capture = run.log["phase"].values, run.log["capture_point"].values
        begins = np.nonzero(np.diff(phase) < -0.5)[0] + 1
        found = [np.interp(0.1, phase[i:j], capture[i:j]) for i, j in pairwise(begins)]
        return np.array(found)

    usual = steps()
    for impulse in (3.0, -3.0):
        for phase in (0.1, 0.3, 0.5, 0.7):
            pushed = impulse * walker.unit
            found = steps(pushes=walker.push(pushed, phase))
            off = (found - usual[: len(found)]) / (pushed / (mass * rate))
            told = " ".join(f"{each:+.3f}" for each in off[2:6])
            print(
                f"small push {impulse:+g} N s at {phase}: of the error is left {told}", flush=True
            )


def multipliers(walker: Walker) -> None:
    """Tell how small errors of robot and memory die out, at three sizes of them."""
    begin = walker.gait.initial_state
    for size in (1e-6, 1e-5, 1e-4):
        found = hs.floquet_multipliers(
            walker.robot, begin, walker.law, settling=14, returns=2, disturbance=size,
            **walker.method,
        )  # fmt: skip
        print(f"multipliers at {size:g}: {found}", flush=True)


def stand(walker: Walker, rise: float) -> None:
    """Tell the largest push of a robot that stands, without and with steps."""
    law = hs.FootstepFeedback(walker.robot, walker.gait, speed=0.0)
    rise *= walker.unit
    for name, sign in (("forwards", 1.0), ("backwards", -1.0)):
        firm, most = 0.0, 0.0
        for count in range(1, 200):
            impulse = rise * count
            push = hs.Push(2, force=(10.0 * sign * impulse, 0.0), start=1.0, duration=0.1)
            run = hs.simulate(
                walker.robot, law, state=walker.robot.reference_state(), duration=9.11, pushes=push,
                **(walker.method | {"record_every": 5}),
            )  # fmt: skip
            if not recovery(run, after=8.0):
                break
            most = impulse
            if firm == impulse - rise and run.log["phase"].values.max() == 0.0:
                firm = impulse  # the clock of its steps never ran
        print(f"standing, push {name}: {firm:.3g} N s without a step, {most:.3g} with", flush=True)


def standing(robot: hs.Robot, rng: np.random.Generator) -> hs.State:
    """Return a robot that stands badly: joints and rates are off, one foot touches the ground."""
    q, v = robot.model.reference.copy(), rng.uniform(-0.04, 0.04, robot.nv)
    q[2:] += rng.uniform(-0.02, 0.02, robot.nv - 2)
    q[1] -= (contact_positions(robot, q)[:, 1] - robot.model.contact_radius).min()
    return hs.State(q, v)


def commands(walker: Walker, seeds: range) -> None:
    """Stand, start, walk at three speeds in random order, stop and stand, at random times."""
    usual = walker.gait.step_length / walker.gait.step_duration
    height = walker.robot.model.reference[1]
    law = hs.FootstepFeedback(walker.robot, walker.gait, speed=0.0)
    fallen, reached = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        begin = standing(walker.robot, rng)
        simulation = hs.Simulation(walker.robot, law, state=begin, **walker.method)
        simulation.advance(rng.uniform(1.0, 3.0))
        for share in rng.permutation([0.47, 1.0, 1.4]):
            simulation.parameters.speed = share * usual
            if simulation.status != hs.RunStatus.COMPLETED:
                break
            simulation.advance(simulation.time + rng.uniform(3.0, 5.0))
            place, then = simulation.state.q[0], simulation.time
            simulation.advance(then + 4.0 * walker.gait.step_duration)
            speed = (simulation.state.q[0] - place) / (simulation.time - then)
            reached.append(speed / (share * usual))
        simulation.parameters.speed = 0.0
        if simulation.status == hs.RunStatus.COMPLETED:
            # An alarm fades, and the body rises, in six seconds.
            simulation.advance(simulation.time + rng.uniform(8.0, 10.0))
        state = simulation.state
        still = np.abs(state.v).max() < 0.05 and state.q[1] > 0.9 * height
        if simulation.status != hs.RunStatus.COMPLETED or not still:
            fallen.append(seed)
    told = f"; not {' '.join(map(str, fallen))}" if fallen else ""
    print(
        f"stands, starts, three speeds, stops and stands: {len(seeds) - len(fallen)} of "
        f"{len(seeds)}{told}; speeds reached: {min(reached):.3f} to {max(reached):.3f} of those "
        "asked for"
    )


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    known = ("price", "small", "multipliers", "push", "drag", "hard", "stand", "commands")
    parser.add_argument("what", nargs="*", default=list(known))
    parser.add_argument("--robot", default="bravo7")
    parser.add_argument("--projected", action="store_true", help="a file of three dimensions")
    parser.add_argument("--torque", type=float, help="of motors at most, N m")
    parser.add_argument("--phases", type=int, default=20)
    parser.add_argument("--rise", type=float, default=5.0, help="N s, scaled by the robot")
    parser.add_argument("--links", nargs="+", help="that are dragged; all by default")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=1000, help="first seed")
    parser.add_argument("--method", choices=METHODS, default="stepping")
    asked = parser.parse_args()
    unknown = set(asked.what) - set(known)
    if unknown:
        parser.error(f"there is no {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    walker = Walker.of(asked.robot, asked.method, asked.torque, asked.projected)
    seeds = range(asked.first, asked.first + asked.seeds)
    print(f"{asked.robot}, {asked.method}, {walker.gait}")
    if "price" in asked.what:
        price(walker)
    if "small" in asked.what:
        small(walker)
    if "multipliers" in asked.what:
        multipliers(walker)
    if "push" in asked.what:
        pushes(walker, asked.phases, asked.rise)
    if "drag" in asked.what:
        drags(walker, asked.phases, asked.links)
    if "hard" in asked.what:
        hard(walker, seeds)
    if "stand" in asked.what:
        stand(walker, 0.2 * asked.rise)
    if "commands" in asked.what:
        commands(walker, seeds)


if __name__ == "__main__":
    main()
