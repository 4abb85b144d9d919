"""One scene in space under one scheme: run, judged and compared with its twins."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from heelstrike.sim import Scheme
from heelstrike.sim.spatial.run import RECORDED
from scenes.findings import Findings
from scenes.mechanics import Metric
from scenes.space.ground import Terrain
from scenes.space.mechanics import SpatialPoses, SpatialTree
from scenes.space.record import SpatialRows
from scenes.space.scene import (
    SpaceScene,
    mirrored,
    mirrored_numbers,
    random_space_scene,
    renumbered,
)
from scenes.step_judge import judge_rows, unexplained_steps

Array = NDArray[Any]

SCHEMES = {
    "impact_resolved": Scheme.IMPACT_RESOLVED, "gap_linearised": Scheme.GAP_LINEARISED,
}  # fmt: skip
"""Names of the schemes that robots in space have."""
STEP, DURATION = 1e-3, 1.0
"""Seconds of a step, and of a scene."""
INSTANTS = 6
"""How many steps of a scene are compared with those of its twins."""
SAME = 1e-6
"""Difference that steps of twins may have, in kinetic size relative to the data of the step."""


@dataclass(frozen=True)
class SpaceSetting:
    """A scene ready to be simulated, as itself or as one of its twins."""

    scene: SpaceScene
    robot: Any

    @classmethod
    def of(cls, scene: SpaceScene) -> SpaceSetting:
        """Build the robot of a scene."""
        return cls(scene, scene.robot())

    def run(
        self, name: str, *, state: hs.State | None = None, torque: Array | None = None,
        duration: float = DURATION,
    ) -> Any:  # fmt: skip
        """Simulate the scene from its start, or without pushes from a state under some torques."""
        scene, robot = self.scene, self.robot
        bounces = name == "impact_resolved"
        ground = scene.ground()
        given: Any = {
            "state": scene.state(robot) if state is None else state,
            "method": hs.TimeStepping(step=STEP, scheme=SCHEMES[name]),
            "ground": ground if bounces else hs.SpatialGround(
                friction=ground.friction, normal=ground.normal, boxes=ground.boxes
            ),
            "pushes": scene.pushes() if state is None else (),
            "stop_when_fallen": False,
        }  # fmt: skip
        law = scene.controller(robot) if torque is None else _Held(torque) if robot.nu else None
        return hs.simulate(robot, law, duration=duration, **given)

    def judge(self, run: Any) -> Findings:
        """Judge a run of it; steps that were taken in parts have no record of the parts.

        Which they were is not recorded: as many steps as that, the least explained, are left out.
        How many and how far they are from balance is told.
        """
        found = Findings()
        terrain = self.scene.terrain().grown_together()
        parts, left_out = _without_halved(run, terrain)
        found.figures["steps left out"] = len(left_out)
        found.figures["largest of them"] = float(left_out.max(initial=0.0))
        for part in parts:
            found.take(judge_rows(SpatialRows(part, terrain)))
        certified = np.array([float(run.certificates.uncertified)])
        found.look("steps not certified", certified, 0.5, run.time)
        return found


def _without_halved(run: Any, terrain: Terrain) -> tuple[list[Any], Array]:
    """Return a run in pieces between as many unexplained steps as were taken in parts.

    And how far from balance each of those steps is.
    """
    count = run.certificates.halved
    if not count or len(run.time) < 3:
        return [run], np.zeros(0)
    worst, broken = unexplained_steps(SpatialRows(run, terrain))
    ends = np.sort(worst[:count]).tolist()
    edges = [0, *(row + 1 for row in ends), len(run.time)]
    return [
        replace(run, **{name: getattr(run, name)[a:b] for name in ("time", *RECORDED)})
        for a, b in pairwise(edges)
        if b > a + 1
    ], broken[:count]


class _Held:
    """Torques that stay as they are."""

    def __init__(self, torque: Array) -> None:
        self._torque = torque

    def torque(self, t: float, state: Any, contacts: Any) -> Array:  # noqa: ARG002
        """Return them."""
        return self._torque


class _Twin:
    """A twin of a setting, and how its numbers are told in the words of the original."""

    def __init__(self, name: str, original: SpaceSetting, scene: SpaceScene) -> None:
        self.name, self.mirror = name, name == "mirrored"
        self.original, self.setting = original, SpaceSetting.of(scene)

    def told(self, values: Array, names: str, *, back: bool = False) -> Array:
        """Numbers of the original by the names that a robot gives them, in the order of the twin.

        With `back` those of the twin in the order of the original.
        """
        source, target = self.original.robot, self.setting.robot
        if back:
            source, target = target, source
        named = dict(zip(getattr(source, names), values.tolist(), strict=True))
        if self.mirror and names != "actuator_names":
            named = mirrored_numbers(named)
        return np.array([named[name] for name in getattr(target, names)])

    def step(self, name: str, run: Any, row: int) -> Any:
        """Simulate the step from a row of the original."""
        state = hs.State(
            self.told(run.position[row], "position_names"),
            self.told(run.velocity[row], "velocity_names"),
        )
        torque = self.told(run.torque[row], "actuator_names")
        return self.setting.run(name, state=state, torque=torque, duration=STEP)


def compare_twins(original: SpaceSetting, name: str, run: Any) -> Findings:
    """Compare single steps of a run with those of its twins, which begin from the same rows.

    The original begins again from each row, too: without what it remembers of the step before and
    without pushes. Coulomb's law may have several solutions: where a twin ends elsewhere and
    its own record breaks no law, both are right, and the instant is counted.
    """
    found = Findings()
    twins = [
        _Twin("mirrored", original, mirrored(original.scene)),
        _Twin("renumbered", original, renumbered(original.scene)),
    ]
    again = _Twin("begun again", original, original.scene)
    compared = several = 0
    for row in _instants(original.scene, run):
        base = again.step(name, run, row)
        if not base.completed:
            continue
        for twin in twins:
            other = twin.step(name, run, row)
            compared += 1
            apart = np.inf
            if other.completed and len(other.time) == len(base.time):
                v = twin.told(other.velocity[-1], "velocity_names", back=True)
                apart = _apart(base, v)
            if apart > SAME and other.completed and not twin.setting.judge(other).objections:
                several += 1
                continue
            found.look(f"twin: {twin.name}", np.array([apart]), SAME, run.time[row:])
    found.figures["twins compared"] = compared
    found.figures["twins with another solution"] = several
    return found


def _apart(base: Any, v: Array) -> float:
    """Difference of the velocities after a step in kinetic size, relative to the step's data."""
    poses = SpatialPoses(SpatialTree(base.robot.model), base.position[:1])
    metric = Metric(poses.mass_matrix())
    forced = STEP * metric.of_force(poses.bias_force(base.velocity[:1]))
    unit = metric.of_velocity(base.velocity[:1]) + metric.of_velocity(base.velocity[-1:]) + forced
    return float(metric.of_velocity((v - base.velocity[-1])[None])[0] / (unit[0] + 1e-9))


def _instants(scene: SpaceScene, run: Any) -> list[int]:
    """Rows from which twins begin: before events, and others at random."""
    draw = np.random.default_rng([scene.seed, 2])
    rows = len(run.time)
    moments = np.array(sorted({event.time for event in run.events}))
    near = np.searchsorted(run.time, moments) - 1
    chosen = draw.permutation(near)[: INSTANTS // 2].tolist() if len(near) else []
    chosen += draw.integers(0, max(rows - 2, 1), size=INSTANTS // 2).tolist()
    return [row for row in sorted(set(chosen)) if 0 <= row < rows - 2]


def run_space_scene(method: str, seed: int, *, twins: bool = True) -> dict[str, Any]:
    """Run, judge and compare one scene; everything in the result is numbers and text."""
    begin = time.process_time()
    scene = random_space_scene(seed)
    result: dict[str, Any] = {
        "method": method, "seed": seed, "kind": scene.kind, "family": "space",
    }  # fmt: skip
    try:
        setting = SpaceSetting.of(scene)
        run = setting.run(method)
    except HeelstrikeError as error:
        return result | {"status": "refused", "message": str(error)}
    result |= {"status": run.status.value, "message": run.message, "rows": len(run.time)}
    result |= {"end": float(run.time[-1]) if len(run.time) else 0.0}
    result["simulated_s"] = time.process_time() - begin
    found = setting.judge(run)
    found.figures["relaxed"] = run.certificates.relaxed
    found.figures["halved"] = run.certificates.halved
    result |= found.as_dict()
    if twins and run.completed:
        result["twins"] = compare_twins(setting, method, run).as_dict()
    result["seconds"] = time.process_time() - begin
    return result
