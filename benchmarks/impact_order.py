"""Order of convergence of time stepping on impacts of several contacts.

Of random scenes (those of ``benchmarks/scenes``, on flat ground, without dry friction, discs,
restitution and pushes) those are taken in which an impact strikes at least two contacts or stops at
once, and nothing else happens for 20 of the longest steps before and after it. Each is begun a
little before the impact, at 8 phases of a step, and ends 2 ms behind it. The error is that of the
velocity against event-driven simulation (rtol 1e-11) from the same state, relative to the largest
velocity or 1; the worst of the phases counts, since where in a step an impact falls changes the
error more than the step does. The order is that between the longest and the shortest step.

An impact that strikes twice within 20 steps has no order: a contact a nanometre above the ground
touches or does not, as rounding has it. Such scenes are named, as all others that fall short.

Run: python benchmarks/impact_order.py [--scenes 100] [--seed 0] [--scheme impact-resolved]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scenes.scene import Scene, placed, random_scene

import heelstrike as hs
from heelstrike.sim import EventKind, Run, Scheme

STEPS = (1e-4, 1e-5, 1e-6)
PHASES = 8
ALONE = 20 * STEPS[0]
"""Seconds around an impact in which nothing else may happen."""
SMALL = 1e-8
"""An error this small is that of event-driven simulation."""
ORDER = 0.9
FLAT = np.array([[0.0, 0.0], [1.0, 0.0]])


@dataclass(frozen=True)
class Impact:
    """A scene, the state a little before its impact, and how long until shortly after it (s)."""

    scene: Scene
    robot: hs.Robot
    state: hs.State
    span: float

    def events(self, state: hs.State, span: float) -> Run:
        """Simulate it event-driven, as exactly as that goes."""
        return self.run(state, span, hs.EventDriven(rtol=1e-11, atol=1e-13, output_period=None))

    def run(self, state: hs.State, span: float, method: hs.EventDriven | hs.TimeStepping) -> Run:
        """Simulate it from a state on."""
        return hs.simulate(
            self.robot,
            self.scene.controller(self.robot),
            state=state,
            duration=span,
            method=method,
            ground=hs.Ground(friction=float(self.scene.friction[0])),
            record_every=10**9 if isinstance(method, hs.TimeStepping) else 1,
            stop_when_fallen=False,
        )

    def error(self, scheme: Scheme, step: float) -> float:
        """Return the largest error of the velocity behind the impact, over the phases."""
        worst = 0.0
        for phase in range(PHASES):
            later = step * phase / PHASES
            state = self.events(self.state, later).final.state if phase > 0 else self.state
            span = int((self.span - later) / step) * step
            found = self.run(state, span, hs.TimeStepping(step=step, scheme=scheme)).final.state.v
            exact = self.events(self.state, later + span).velocity[-1]
            size = max(1.0, float(np.abs(exact).max()))
            worst = max(worst, float(np.abs(found - exact).max()) / size)
        return worst


def impacts(seed: int) -> Iterator[tuple[int, Impact]]:
    """Yield scenes with an impact of several contacts, with their seeds."""
    while True:
        scene = random_scene(seed)
        seed += 1
        if not scene.floating or scene.kind != "ordinary" or len(scene.links) > 8:
            continue
        found = one_impact(simplified(scene))
        if found is not None:
            yield seed - 1, found


def simplified(scene: Scene) -> Scene:
    """Return a scene on flat ground without what would end the steps' first order by itself."""
    simple = replace(
        scene,
        corners=FLAT,
        friction=scene.friction[:1],
        restitution=np.zeros(1),
        shoves=(),
        links=tuple(replace(link, dry_friction=0.0) for link in scene.links),
        contacts=tuple(replace(contact, radius=0.0) for contact in scene.contacts),
    )
    return placed(simple, float(np.random.default_rng(scene.seed).uniform(0.0, 0.2)))


def one_impact(scene: Scene) -> Impact | None:
    """Find the first impact of several contacts of a scene that is alone."""
    robot = scene.robot()
    whole = Impact(scene, robot, scene.state(robot), 0.6)
    method = hs.EventDriven(rtol=1e-10, atol=1e-12, output_period=ALONE / 8.0)
    run = whole.run(whole.state, whole.span, method)
    times = np.unique([event.time for event in run.events])
    for time in times:
        struck = [
            event
            for event in run.events
            if event.time == time
            and event.kind in (EventKind.TOUCHDOWN, EventKind.IMPACT)
            and event.impulse[0] > 1e-3
        ]
        alone = np.sum(np.abs(times - time) <= 1.3 * ALONE) == 1
        begin = int(np.searchsorted(run.time, time - 1.1 * ALONE)) - 1
        if len(struck) >= 2 and alone and begin >= 0 and time + 1.3 * ALONE < run.time[-1]:
            state = hs.State(run.position[begin], run.velocity[begin])
            return replace(whole, state=state, span=float(time + ALONE - run.time[begin]))
    return None


def main() -> None:
    """Measure the order on so many scenes, and name those that fall short."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scheme", default="impact-resolved")
    options = parser.parse_args()
    scheme = Scheme[options.scheme.upper().replace("-", "_")]
    reached = 0
    source = impacts(options.seed)
    for _ in range(options.scenes):
        seed, impact = next(source)
        errors = [impact.error(scheme, step) for step in STEPS]
        decades = np.log10(STEPS[0] / STEPS[-1])
        order = np.log10(max(errors[0], 1e-300) / max(errors[-1], 1e-300)) / decades
        if order >= ORDER or errors[-1] < SMALL:
            reached += 1
        else:
            print(f"seed {seed}: order {order:.2f}, errors", *(f"{one:.1e}" for one in errors))
    print(f"{scheme}: order ≥ {ORDER} (or error < {SMALL}) in {reached} of {options.scenes}")


if __name__ == "__main__":
    main()
