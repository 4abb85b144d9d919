"""Twins are the same scene, and one that differs is noticed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes.mechanics import Poses, Tree
from scenes.methods import Setting
from scenes.scene import random_scene
from scenes.twins import (
    Twin,
    compare_twins,
    is_another_solution,
    mirrored,
    renumbered,
    twins_of,
)

SEED = 10
"""Falls onto the ground within the time that is simulated here."""


@pytest.mark.parametrize("seed", range(12))
def test_a_mirror_image_of_a_mirror_image(seed: int) -> None:
    scene = random_scene(seed)
    back = mirrored(mirrored(scene))
    assert back.links == scene.links
    assert back.contacts == scene.contacts
    assert back.shoves == scene.shoves
    assert (back.q, back.v) == (scene.q, scene.v)
    np.testing.assert_array_equal(back.corners, scene.corners)
    np.testing.assert_array_equal(back.friction, scene.friction)


@pytest.mark.parametrize("seed", range(12))
def test_twins_have_the_same_energy_and_places(seed: int) -> None:
    """A mirror turns x round and nothing else; another order turns nothing."""
    original = Setting.of(random_scene(seed))
    for twin in twins_of(original)[:2]:
        scene, robot = twin.setting.scene, twin.setting.robot
        state = twin.there(*_state(original))
        own = Poses(Tree(robot.model), state.q[None])
        first = Poses(Tree(original.robot.model), _state(original)[0][None])
        links = [robot.joint_names.index(name) for name in original.robot.joint_names]
        sign = -1.0 if twin.mirror else 1.0
        there = own.center[0, links] * [sign, 1.0]
        heavy = original.robot.model.mass > 0.0
        np.testing.assert_allclose(there[heavy], first.center[0, heavy], atol=1e-12)
        v = _state(original)[1]
        energy = v @ first.mass_matrix()[0] @ v
        assert state.v @ own.mass_matrix()[0] @ state.v == pytest.approx(energy, rel=1e-11)
        back = twin.back(state.q, state.v)
        np.testing.assert_array_equal(back.q, _state(original)[0])
        assert scene.terrain().friction.sum() == pytest.approx(original.scene.friction.sum())


def _state(setting: Setting) -> tuple[np.ndarray, np.ndarray]:
    state = setting.scene.state(setting.robot)
    return state.q, state.v


def test_another_order_is_another_order() -> None:
    scene = random_scene(SEED)
    other = renumbered(scene)
    assert [link.name for link in other.links] != [link.name for link in scene.links]
    assert {link.name for link in other.links} == {link.name for link in scene.links}
    for link in other.links:
        (same,) = (one for one in scene.links if one.name == link.name)
        if link.parent >= 0:
            assert other.links[link.parent].name == scene.links[same.parent].name


@pytest.mark.parametrize("method", ["gap_linearised", "event_driven"])
def test_a_run_that_its_twins_do_not_share(method: str) -> None:
    setting = Setting.of(random_scene(SEED))
    run = setting.run(method, duration=0.4)
    assert run.completed
    found = compare_twins(setting, method, run)
    assert not found.objections
    assert found.figures["twins compared"] >= 6
    velocity = run.velocity + run.time[:, None]
    drifted = compare_twins(setting, method, dataclasses.replace(run, velocity=velocity))
    if method == "event_driven":
        names = {"twin: mirrored", "twin: renumbered", "twin: begun again"}
        assert names <= set(drifted.broken())
    else:  # the twins break no law, so that they count as other solutions; the run's judge objects
        assert drifted.figures["twins with another solution"] > 10


def test_a_wrong_mirror_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    setting = Setting.of(random_scene(SEED))
    run = setting.run("gap_linearised", duration=0.4)
    wrong = dataclasses.replace(
        mirrored(setting.scene), corners=setting.scene.corners - [0.0, 0.01]
    )
    monkeypatch.setattr(
        "scenes.twins.twins_of", lambda one: (Twin("mirrored", one, wrong, mirror=True),)
    )
    found = compare_twins(setting, "gap_linearised", run)
    assert "twin: mirrored" in found.broken() or found.figures["twins with another solution"] > 0


def test_two_solutions_of_one_state_are_named() -> None:
    """A disc on a slope of friction 2.2, held against it by stops, may stick as well as leave."""
    setting = Setting.of(random_scene(6084))
    run = setting.run("event_driven", duration=0.4)
    assert not setting.judge("event_driven", run).objections
    found = compare_twins(setting, "event_driven", run)
    assert not found.objections
    assert found.figures["twins with another solution"] > 0
    # Another motion from there is none of them if it does not begin with other forces.
    twin = twins_of(setting)[2]
    row = int(np.argmin(np.abs(run.time - 0.3)))
    state = twin.there(run.position[row], run.velocity[row])
    other = setting.run("event_driven", state=state, begin=float(run.time[row]), duration=0.01)
    assert is_another_solution("event_driven", run, row, twin, state, other)
    same = dataclasses.replace(other, contact_force=other.contact_force.copy())
    same.contact_force[0] = run.contact_force[row]
    assert not is_another_solution("event_driven", run, row, twin, state, same)
