"""Random scenes with ties: the scene of a seed, with loops, couplings, latches and brakes put in.

``tied_scene(seed)`` is ``random_scene(seed)`` with what a stream of its own draws:

- **loops** (in two of three scenes with three joints or more, one in five of these has two): the
  end of a link is hinged to another link, or of a robot that hangs to the world, where both are in
  the initial pose. Most have three joints or more between their ends, so that they move; one in
  ten locks what is in it, twice over if the links are neighbours.
- **couplings** (in one of four): a joint follows another by a factor of 0.3 to 1.5, either way,
  half of them bent by a square.
- **brakes** (in half, up to two): put on in the first half of the second, one in three from the
  start, for 50 to 600 ms; half of them slip, at the weight of what a joint feels times a few.
- **latches** (on a third of the joints that have stops): they let go when a link with a contact
  touches down.

A scene that got none of these has a brake. The initial velocity is the nearest, by kinetic energy,
that tears at nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.mechanics import Metric, Poses, Tree
from scenes.scene import SALT, Scene, least_inertias, random_scene
from scenes.ties.description import Brake, Coupling, Latch, Loop, Ties
from scenes.ties.mechanics import Tied

STREAM = 7
"""Stands beside salt and seed, so that scenes without ties draw what they always drew."""
MILLISECOND = 1e-3


def tied_scene(seed: int) -> Scene:
    """Return the scene of a seed with ties; see the module for what is drawn."""
    draw = np.random.default_rng([SALT, seed, STREAM])
    scene = random_scene(seed)
    first = 1 if scene.floating else 0
    joints = list(range(first, len(scene.links)))
    loops = _loops(draw, scene, joints)
    couplings = _couplings(draw, scene, joints)
    brakes = _brakes(draw, scene, joints)
    latches = _latches(draw, scene, joints)
    if not (loops or couplings or brakes or latches) and joints:
        brakes = (Brake(joints[-1], np.inf, 0.1, 0.4),)
    return _untorn(replace(scene, ties=Ties(loops, couplings, brakes, latches)))


def _path(scene: Scene, link: int) -> list[int]:
    path = []
    while link >= 0:
        path.append(link)
        link = scene.links[link].parent
    return path


def _joints_between(scene: Scene, link: int, other: int) -> int:
    """How many joints there are on the way from one link to another, or to the world (-1)."""
    ways = [set(_path(scene, each)) if each >= 0 else set() for each in (link, other)]
    return len(ways[0] ^ ways[1])


def _loops(draw: np.random.Generator, scene: Scene, joints: list[int]) -> tuple[Loop, ...]:
    count = int(draw.choice((0, 1, 2), p=(0.35, 0.52, 0.13)))
    if len(joints) < 3:
        return ()
    robot = scene.robot()
    poses = Poses(Tree(robot.model), scene.ordered(scene.q, robot)[None])
    place = {name: i for i, name in enumerate(robot.link_names)}
    loops = []
    for _ in range(count):
        moves = bool(draw.random() < 0.9)
        others = list(range(len(scene.links))) + ([] if scene.floating else [-1])
        pairs = [
            (a, b)
            for a in joints
            for b in others
            if a != b and (_joints_between(scene, a, b) >= 3) == moves
        ]
        if not pairs:
            continue
        a, b = pairs[int(draw.integers(len(pairs)))]
        at = (0.0, 2.0 * scene.links[a].center_of_mass[1])
        numbers = [place[scene.links[each].name] if each >= 0 else -1 for each in (a, b)]
        world = poses.points(np.array(numbers[:1]), np.array([at]))[0, 0]
        other_at = world if b < 0 else poses.local(numbers[1], world)
        loops.append(Loop(a, b, at, (float(other_at[0]), float(other_at[1]))))
    return tuple(loops)


def _couplings(draw: np.random.Generator, scene: Scene, joints: list[int]) -> tuple[Coupling, ...]:
    if draw.random() > 0.25 or len(joints) < 2:
        return ()
    joint, leader = (int(one) for one in draw.choice(joints, size=2, replace=False))
    factor = float(draw.uniform(0.3, 1.5) * draw.choice((-1.0, 1.0)))
    bend = float(draw.uniform(-0.3, 0.3)) if draw.random() < 0.5 else 0.0
    away = [scene.q[scene.links[i].name] - scene.links[i].reference for i in (joint, leader)]
    begin = away[0] - factor * away[1] - bend * away[1] ** 2
    return (Coupling(joint, leader, (float(begin), factor, bend)),)


def _brakes(draw: np.random.Generator, scene: Scene, joints: list[int]) -> tuple[Brake, ...]:
    count = min(int(draw.choice((0, 1, 2), p=(0.5, 0.35, 0.15))), len(joints))
    if count == 0:
        return ()
    inertia = least_inertias(scene)
    brakes = []
    for joint in draw.choice(joints, size=count, replace=False):
        begin = 0.0 if draw.random() < 1.0 / 3.0 else float(draw.uniform(0.0, 0.5))
        felt = inertia[scene.links[joint].name]
        limit = float(felt * draw.uniform(10.0, 300.0)) if draw.random() < 0.5 else np.inf
        times = (begin, begin + float(draw.uniform(0.05, 0.6)))
        on, off = (round(time / MILLISECOND) * MILLISECOND for time in times)
        brakes.append(Brake(int(joint), limit, on, off))
    return tuple(brakes)


def _latches(draw: np.random.Generator, scene: Scene, joints: list[int]) -> tuple[Latch, ...]:
    latches = []
    for joint in joints:
        if (
            np.isfinite(scene.links[joint].limits[0])
            and draw.random() < 1.0 / 3.0
            and scene.contacts
        ):
            end = str(draw.choice(("lower", "upper")))
            release = scene.contacts[int(draw.integers(len(scene.contacts)))].link
            latches.append(Latch(joint, end, release))
    return tuple(latches)


def _untorn(scene: Scene) -> Scene:
    robot = scene.robot()
    q, v = scene.ordered(scene.q, robot)[None], scene.ordered(scene.v, robot)[None]
    poses = Poses(Tree(robot.model), q)
    tied = Tied(robot.model, poses, q)
    v = tied.untorn(Metric(poses.mass_matrix()), v)
    return replace(scene, v=dict(zip(robot.joint_names, v[0].tolist(), strict=True)))
