"""The same scene seen in a mirror, with its links in another order, or begun again half way.

Physics does not know left from right, nor in which order links and contacts are listed. A twin is
begun from a state of the run, and what comes out is compared with the run itself, in kinetic size
relative to the velocity and what the known forces do in the time compared:

- time stepping: one step, at instants at which contacts change and others at random. ``begun
  again`` is the run's own robot without what it remembers of the step before.
- event-driven: from a row up to ten rows before an event until a row after it, and over pieces
  without events. Windows with more than two events are not compared: differences in the last
  digits may grow there.
- compliant: from the start until two samples after the first touch, since the bristles of a state
  on the ground are not part of the record.

Coulomb's law may have several solutions. Where a twin of time stepping differs and its own record
breaks no law, both are right; such instants are counted, not objected to. So are windows of
event-driven twins that begin with other contact forces in the same state: what stuck goes on to
stick, and what is put there again leaves if it can.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from scenes.event_judge import judge_events
from scenes.findings import Findings
from scenes.mechanics import Metric, Poses, Tree
from scenes.methods import STEP, STEPPING, Setting
from scenes.scene import Scene

Array = NDArray[Any]

STEPS, EVENTS, SAMPLES = 1e-6, 1e-4, 1e-4
"""Differences that twins may have, by the kind of method."""
INSTANTS = 12
WINDOWS = 4
"""How many steps of time stepping, and windows of event-driven runs, are compared."""
OTHER_FORCES = 1e-6
"""Part by which contact forces in one state differ that are not the same solution."""
LEAD = 10
"""Most rows between the beginning of a window and its event."""


def mirrored(scene: Scene) -> Scene:
    """Return the scene as a mirror at x = 0 shows it; joints keep their coordinates."""

    def flip(pair: tuple[float, float]) -> tuple[float, float]:
        return (-pair[0], pair[1])

    links = tuple(
        replace(
            link,
            at=flip(link.at),
            center_of_mass=flip(link.center_of_mass),
            slide=None if link.slide is None else flip(link.slide),
            sense=-link.sense,
        )
        for link in scene.links
    )
    return replace(
        scene,
        links=links,
        contacts=tuple(replace(one, at=flip(one.at)) for one in scene.contacts),
        corners=(scene.corners * [-1.0, 1.0])[::-1].copy(),
        friction=scene.friction[::-1].copy(),
        restitution=scene.restitution[::-1].copy(),
        q=mirrored_state(scene.q),
        v=mirrored_state(scene.v),
        shoves=tuple(
            replace(one, point=flip(one.point), force=flip(one.force)) for one in scene.shoves
        ),
    )


def mirrored_state(values: dict[str, float]) -> dict[str, float]:
    """Return coordinates or velocities by joint as the mirror shows them."""
    return {k: -x if k in ("root_x", "root_pitch") else x for k, x in values.items()}


def renumbered(scene: Scene) -> Scene:
    """Return the scene with its links in another order, parents first, and so its contacts."""
    draw = np.random.default_rng([scene.seed, 1])
    order: list[int] = [0]
    while len(order) < len(scene.links):
        ready = [
            i
            for i, link in enumerate(scene.links)
            if i not in order and (link.parent in order or link.parent < 0)
        ]
        order.append(int(draw.choice(ready)))
    place = {old: new for new, old in enumerate(order)}
    links = tuple(
        replace(scene.links[old], parent=place.get(scene.links[old].parent, -1)) for old in order
    )
    return replace(
        scene,
        links=links,
        contacts=tuple(replace(one, link=place[one.link]) for one in scene.contacts[::-1]),
        shoves=tuple(replace(one, link=place[one.link]) for one in scene.shoves),
    )


class Twin:
    """A twin of a setting, and how its states are told in the words of the original."""

    def __init__(self, name: str, original: Setting, scene: Scene, *, mirror: bool) -> None:
        self.name, self.mirror = name, mirror
        self.original, self.setting = original, Setting.of(scene)

    def _swap(self, q: Array, v: Array, source: hs.Robot, target: hs.Robot) -> hs.State:
        both = []
        for values in (q, v):
            named = dict(zip(source.joint_names, values.tolist(), strict=True))
            named = mirrored_state(named) if self.mirror else named
            both.append(Scene.ordered(named, target))
        return hs.State(both[0], both[1])

    def there(self, q: Array, v: Array) -> hs.State:
        """Return a state of the original as the twin's."""
        return self._swap(q, v, self.original.robot, self.setting.robot)

    def back(self, q: Array, v: Array) -> hs.State:
        """Return a state of the twin as the original's."""
        return self._swap(q, v, self.setting.robot, self.original.robot)


def twins_of(original: Setting) -> tuple[Twin, ...]:
    """Return the twins of a setting."""
    scene = original.scene
    return (
        Twin("mirrored", original, mirrored(scene), mirror=True),
        Twin("renumbered", original, renumbered(scene), mirror=False),
        Twin("begun again", original, scene, mirror=False),
    )


def compare_twins(original: Setting, name: str, run: Any) -> Findings:
    """Compare a run of a method with those of its twins."""
    found = Findings()
    tolerance = STEPS if name in STEPPING else EVENTS if name == "event_driven" else SAMPLES
    compared = several = 0
    for twin in twins_of(original):
        for row, target in _windows(original.scene, name, run):
            if twin.name == "begun again" and row == 0:
                continue
            begin = float(run.time[row])
            duration = float(run.time[target]) - begin
            state = twin.there(run.position[row], run.velocity[row])
            law = f"twin: {twin.name}"
            try:
                other = twin.setting.run(name, state=state, begin=begin, duration=duration)
            except HeelstrikeError:
                found.look(f"{law} is refused", np.array([np.inf]), tolerance, run.time[row:])
                continue
            compared += 1
            apart = np.inf
            if other.completed and len(other.time):
                end = twin.back(other.position[-1], other.velocity[-1])
                apart = _difference(run, row, target, end, duration)
            differs = apart > tolerance and other.completed
            if differs and is_another_solution(name, run, row, twin, state, other):
                several += 1
                continue
            found.look(law, np.array([apart]), tolerance, run.time[row:])
    found.figures["twins compared"] = compared
    found.figures["twins with another solution"] = several
    return found


def is_another_solution(
    name: str, run: Any, row: int, twin: Twin, state: hs.State, other: Any
) -> bool:
    """Whether a twin that ends elsewhere does so by the laws, which have several solutions.

    Steps of time are solved one by one. Event-driven it has to begin so: with other contact forces
    in the very state in which the original has its own.
    """
    if name in STEPPING:
        return not twin.setting.judge(name, other).objections
    if name != "event_driven":
        return False
    forces = [float(np.sum(one.contact_force[i, :, 0])) for one, i in ((run, row), (other, 0))]
    if abs(forces[0] - forces[1]) <= OTHER_FORCES * max(forces):
        return False
    return not judge_events(other, state).objections


def _difference(run: Any, row: int, target: int, end: hs.State, duration: float) -> float:
    """Difference of states in kinetic size; positions count by the time they take."""
    model = run.robot.model
    pose = Poses(Tree(model), run.position[[row, target]])
    v = run.velocity[[row, target]]
    metric = Metric(pose.mass_matrix())
    torque = np.zeros_like(v)
    torque[:, model.actuator_joint] = run.torque[[row, target]]
    forced = duration * metric.of_force(torque - pose.bias_force(v))
    unit = float((metric.of_velocity(v) + forced).sum()) + 1e-9
    last = Metric(pose.mass_matrix()[1:])
    apart = last.of_velocity((end.v - run.velocity[target])[None])
    moved = last.of_velocity((end.q - run.position[target])[None]) / max(duration, STEP)
    return float((apart + moved)[0]) / unit


def _windows(scene: Scene, name: str, run: Any) -> Iterator[tuple[int, int]]:
    """Rows from which twins begin, and rows at which they are compared."""
    draw = np.random.default_rng([scene.seed, 2])
    time, rows = run.time, len(run.time)
    moments = np.array(sorted({event.time for event in run.events}))
    if name in STEPPING:
        near = np.searchsorted(time, moments) - 1
        chosen = draw.permutation(near)[: INSTANTS // 2].tolist() if len(near) else []
        chosen += draw.integers(0, max(rows - 2, 1), size=INSTANTS // 2).tolist()
        for row in sorted(set(chosen)):
            if 0 <= row < rows - 2:
                yield row, row + 1
    elif name == "event_driven":
        on_grid = np.flatnonzero(np.abs(time / STEP - np.round(time / STEP)) < 1e-6)
        inside = [m for m in moments if 0.002 < m < time[-1] - 0.002]
        chosen = draw.permutation(inside)[:WINDOWS].tolist() if inside else []
        chosen += draw.uniform(0.002, max(time[-1] - 0.002, 0.003), size=WINDOWS // 2).tolist()
        for moment in chosen:
            before = on_grid[time[on_grid] < moment - 0.2 * STEP]
            after = on_grid[time[on_grid] > moment + 0.5 * STEP]
            if not len(before) or not len(after):
                continue
            first = int(before[max(len(before) - int(draw.integers(1, LEAD)), 0)])
            target = int(after[0])
            instants = np.abs(moments - time[first]) < 1e-9
            within = (moments > time[first]) & (moments < time[target] + 1e-9)
            if int(np.sum(within)) <= 2 and not np.any(instants):
                yield first, target
    else:
        first = moments[0] if len(moments) else time[-1]
        target = min(int(np.searchsorted(time, first)) + 2, rows - 2)
        if target > 0:
            yield 0, target
