"""The simulation methods that a campaign can take, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heelstrike as hs
from heelstrike.sim import BristleFriction, RegularisedFriction, Run, RunStatus, Scheme
from scenes.compliant_judge import judge_compliant
from scenes.event_judge import judge_events
from scenes.findings import Findings
from scenes.scene import GRAVITY, Scene
from scenes.step_judge import judge_steps

STEP = 1e-3
DURATION = 1.0
"""Seconds of a step or sample, and of a scene."""

STEPPING = {scheme.name.lower(): scheme for scheme in Scheme}
METHODS = (*STEPPING, "event_driven", "hunt_crossley", "kelvin_voigt")
"""Names of the methods: the schemes of time stepping, event-driven contact, two compliant laws."""


def method_of(name: str, scene: Scene, rows: float | None = STEP, **settings: float) -> Any:
    """Return a method; compliant ground is made as stiff as the weight of the scene wants it.

    `rows` is the time between two rows (s): the step of time stepping, and what an event-driven run
    takes from its dense output, or None for rows at its own steps. `settings` are others of the
    latter: tolerances, the longest step.
    """
    if name in STEPPING:
        return hs.TimeStepping(step=rows or STEP, scheme=STEPPING[name])
    if name == "event_driven":
        return hs.EventDriven(output_period=rows, **settings)
    weight = 0.5 * GRAVITY * sum(link.mass for link in scene.links)
    if name == "hunt_crossley":
        law = hs.HuntCrossley.from_sink(weight=weight, sink=2e-4, restitution=0.5, speed=0.5)
        stiffness = weight / 2e-4
        bristle = BristleFriction(stiffness=stiffness, damping=0.002 * stiffness)
        return hs.Compliant(law=law, friction=bristle, step=STEP)
    if name == "kelvin_voigt":
        law = hs.KelvinVoigt.from_sink(weight=weight, sink=2e-4, restitution=0.3)
        return hs.Compliant(law=law, friction=RegularisedFriction(speed=1e-3), step=STEP)
    raise ValueError(f"unknown method {name!r}; known are {', '.join(METHODS)}")


def bounces(name: str) -> bool:
    """Whether a method knows restitution; the others get the scene's ground without."""
    return name in ("moreau_jean", "impact_resolved", "event_driven")


@dataclass(frozen=True)
class Setting:
    """A scene ready to be simulated, as itself or as one of its twins."""

    scene: Scene
    robot: hs.Robot

    @classmethod
    def of(cls, scene: Scene) -> Setting:
        """Build the robot of a scene."""
        return cls(scene, scene.robot())

    def run(
        self, name: str, *, state: hs.State | None = None, begin: float = 0.0,
        duration: float = DURATION, rows: float | None = STEP, **settings: float,
    ) -> Run:  # fmt: skip
        """Simulate the scene, from its start or from another state at a time `begin`."""
        scene, robot = self.scene, self.robot
        joints = tuple(link.name for link in scene.links)
        setup: dict[str, Any] = {
            "state": scene.state(robot) if state is None else state,
            "method": method_of(name, scene, rows, **settings),
            "ground": scene.ground(restitution=bounces(name)),
            "pushes": scene.pushes(begin),
            "braked": scene.ties.braked(begin, joints),
            "stop_when_fallen": False,
        }
        controller = scene.controller(robot)
        switched = [time for time in scene.ties.switched() if begin < time < begin + duration]
        if not switched:
            return hs.simulate(robot, controller, duration=duration, **setup)
        simulation = hs.Simulation(robot, controller, **setup)
        for time in switched:
            if simulation.advance(time - begin) is not RunStatus.COMPLETED:
                return simulation.record
            simulation.braked = scene.ties.braked(time, joints)
        simulation.advance(duration)
        return simulation.record

    def judge(self, name: str, run: Run) -> Findings:
        """Let the judge of a method look at a run."""
        if name in STEPPING:
            return judge_steps(run, self.scene.controller(self.robot))
        if name == "event_driven":
            return judge_events(run, self.scene.state(self.robot))
        return judge_compliant(run)
