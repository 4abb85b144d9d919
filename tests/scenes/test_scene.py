"""Scenes come from their seeds alone, begin outside the ground, and show what they promise to."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scenes.mechanics import Poses, Tree
from scenes.methods import METHODS, Setting
from scenes.scene import DEGENERATE, Scene, random_scene

import heelstrike as hs


def first_gaps(scene: Scene) -> tuple[hs.Robot, np.ndarray]:
    robot = scene.robot()
    model = robot.model
    poses = Poses(Tree(model), scene.state(robot).q[None])
    center = poses.points(model.contact_link, model.contact_position)
    return robot, (scene.terrain().measure(center).distance - model.contact_radius)[0]


def test_same_seed_same_scene() -> None:
    for seed in (0, 7, 123):
        assert repr(random_scene(seed)) == repr(random_scene(seed))
    assert repr(random_scene(1)) != repr(random_scene(2))


@pytest.mark.parametrize("seed", range(30))
def test_starts_are_above_or_on_the_ground(seed: int) -> None:
    scene = random_scene(seed)
    robot, gap = first_gaps(scene)
    assert -1e-11 < gap.min() < 0.3 + 1e-9
    state = scene.state(robot)
    assert np.all(state.q >= robot.model.lower)
    assert np.all(state.q <= robot.model.upper)


def test_what_is_drawn() -> None:
    """The words of the module, counted over 240 seeds."""
    scenes = [random_scene(seed) for seed in range(240)]
    kinds = Counter(scene.kind for scene in scenes)
    assert set(kinds) == {"ordinary", *DEGENERATE}
    assert 0.85 < kinds["ordinary"] / 240 < 0.95
    sizes = Counter(len(scene.links) for scene in scenes)
    assert set(sizes) == set(range(1, 15))
    links = [link for scene in scenes for link in scene.links]
    assert any(link.slide for link in links)
    assert {link.sense for link in links} == {-1, 1}
    for name in ("damping", "stiffness", "dry_friction", "armature"):
        assert any(getattr(link, name) > 0.0 for link in links)
    assert any(np.isfinite(link.limits[0]) for link in links)
    assert any(one.radius > 0.0 for scene in scenes for one in scene.contacts)
    assert max(len(scene.contacts) for scene in scenes) == 10
    friction = np.array([scene.friction.max() for scene in scenes])
    assert np.sum(friction == 0.0) > 10
    assert np.sum(friction > 1.0) > 10
    assert any(len(set(scene.friction)) > 1 for scene in scenes)
    assert 50 < sum(scene.restitution[0] > 0.0 for scene in scenes) < 110
    assert 30 < sum(not scene.floating for scene in scenes) < 85
    assert any(scene.shoves for scene in scenes)
    assert any(scene.kp for scene in scenes)
    assert any(scene.torque for scene in scenes)
    turns = [np.diff(scene.terrain().normal[:, 0]) for scene in scenes]
    assert any(np.any(turn < -0.1) for turn in turns)  # a concave corner
    assert any(np.any(turn > 0.1) for turn in turns)


@pytest.mark.parametrize("kind", ["in a corner", "on a corner", "flat fall", "at a stop"])
def test_what_is_degenerate_on_purpose(kind: str) -> None:
    scene = next(s for s in map(random_scene, range(1000)) if s.kind == kind)
    robot, gap = first_gaps(scene)
    if kind == "in a corner":
        model = robot.model
        poses = Poses(Tree(model), scene.state(robot).q[None])
        center = poses.points(model.contact_link, model.contact_position)
        last = int(np.argmax(model.contact_radius))
        assert scene.terrain().measure(center[0, last]).tied.sum() == 2
    elif kind == "flat fall":
        assert np.ptp(gap) < 1e-12
        assert len(gap) == 4
    elif kind == "at a stop":
        q = scene.state(robot).q
        assert np.any((q == robot.model.lower) | (q == robot.model.upper))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.slow
def test_every_method_can_begin(method: str) -> None:
    """One millisecond of one scene with everything in it."""
    seed = next(
        seed
        for seed in range(1000)
        if (scene := random_scene(seed)).shoves and scene.kp and scene.restitution[0] > 0.0
    )
    setting = Setting.of(random_scene(seed))
    run = setting.run(method, duration=0.005)
    assert run.completed
    assert not setting.judge(method, run).objections
