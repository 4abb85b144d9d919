"""Environments of Gymnasium: the interface, and the same task as its own v5 environments."""

from __future__ import annotations

import os
import pickle
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from fresh_python import fresh_python

gymnasium = pytest.importorskip("gymnasium", minversion="1.1")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

import heelstrike as hs  # noqa: E402
from heelstrike.experiments.learning import environments  # noqa: E402
from heelstrike.experiments.learning.environments import TaskEnv, TaskVectorEnv  # noqa: E402

TASKS = ("Walker2d", "Hopper", "HalfCheetah")
pytestmark = [
    pytest.mark.slow,  # left to `make test` by continuous integration
    pytest.mark.filterwarnings("ignore::UserWarning"),
]


def vector(task: str = "Walker2d", lanes: int = 3, **options: Any) -> Any:
    return gymnasium.make_vec(
        f"heelstrike/{task}-v0", num_envs=lanes, vectorization_mode="vector_entry_point", **options
    )


def actions(lanes: int, count: int, size: int = 6) -> Any:
    return np.random.default_rng(0).uniform(-1, 1, (count, lanes, size)).astype(np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_the_interface_is_kept(task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", category=UserWarning)
        warnings.filterwarnings("ignore", message=".*(maximum|minimum|infinity|Box).*")
        check_env(gymnasium.make(f"heelstrike/{task}-v0", render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("task", TASKS)
def test_reset_observation_and_reward_are_those_of_gymnasium(
    task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same seed begins in the same state; from the same states the same reward follows."""
    if find_spec("imageio") is None:  # Gymnasium asks for it, to take pictures
        monkeypatch.setitem(sys.modules, "imageio", ModuleType("imageio"))
    theirs = gymnasium.make(f"{task}-v5").unwrapped
    ours = TaskEnv(task)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.metadata["render_fps"] == theirs.metadata["render_fps"]
    for seed in (7, 8):
        np.testing.assert_array_equal(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0])
        np.testing.assert_array_equal(ours.reset()[0], theirs.reset()[0])
    action = np.linspace(-1.5, 0.5, ours.action_space.shape[0])
    x = ours.unwrapped._lanes.batch.position[0, 0]
    observation, reward, terminated, _, info = ours.step(action)
    batch = ours._lanes.batch
    np.testing.assert_allclose(batch.torque[0], ours._lanes.gear * np.clip(action, -1, 1))
    speed = (batch.position[0, 0] - x) / theirs.dt
    theirs.set_state(batch.position[0].copy(), batch.velocity[0].copy())
    np.testing.assert_array_equal(observation, theirs._get_obs())
    wanted, terms = theirs._get_rew(speed, action)
    assert reward == pytest.approx(wanted, abs=1e-12)
    for name, value in terms.items():
        assert info[name] == pytest.approx(value, abs=1e-12)
    assert terminated == (not getattr(theirs, "is_healthy", True))


@pytest.mark.parametrize(
    ("q", "healthy"),
    [((0.0, 0.81, 0.99), True), ((0.0, 0.79, 0.0), False), ((0, 1.0, 1.01), False)],
)
def test_an_episode_ends_where_gymnasium_ends_it(q: tuple[float, ...], healthy: bool) -> None:
    environment = TaskEnv("Walker2d")
    environment.reset(seed=0)
    lanes = environment._lanes
    start = lanes.initial.q.copy()
    start[:3] = q
    lanes.batch.reset(None, hs.State(start, np.zeros(9)))
    lanes._assess(np.arange(1))
    assert bool(lanes.terminated[0]) != healthy
    assert (lanes.cause(0) == "it is healthy") == healthy


def test_lanes_of_a_vector_are_single_environments() -> None:
    lanes, seed = vector(), 11
    singles = [gymnasium.make("heelstrike/Walker2d-v0") for _ in range(3)]
    observed = lanes.reset(seed=seed)[0]
    for i, single in enumerate(singles):
        np.testing.assert_array_equal(observed[i], single.reset(seed=seed + i)[0])
    over = np.zeros(3, dtype=bool)
    for action in actions(3, 60):
        observed, reward, terminated, truncated, info = lanes.step(action)
        for i, single in enumerate(singles):
            if over[i]:
                expected = (single.reset()[0], 0.0, False, False, {})
            else:
                expected = single.step(action[i])
            np.testing.assert_array_equal(observed[i], expected[0])
            assert (reward[i], terminated[i], truncated[i]) == expected[1:4]
            if expected[2]:
                assert info["cause"][i] == expected[4]["cause"]
        over = terminated | truncated
    assert lanes.unwrapped._lanes.batch.time.max() < 60 * 0.008


def test_three_ways_to_begin_anew() -> None:
    given = actions(3, 80)
    modes = {mode: vector(autoreset_mode=mode, max_episode_steps=9) for mode in AutoresetMode}
    for lanes in modes.values():
        lanes.reset(seed=3)
    same, disabled = modes[AutoresetMode.SAME_STEP], modes[AutoresetMode.DISABLED]
    seen = 0
    for action in given[:30]:
        observed, reward, terminated, truncated, info = same.step(action)
        other, its_reward, its_end, its_cut, _ = disabled.step(action)
        ended = terminated | truncated
        np.testing.assert_array_equal(ended, its_end | its_cut)
        np.testing.assert_array_equal(reward, its_reward)
        np.testing.assert_array_equal(observed[~ended], other[~ended])
        for lane in np.flatnonzero(ended):
            seen += 1
            np.testing.assert_array_equal(info["final_obs"][lane], other[lane])
            assert info["_final_obs"][lane]
        if ended.any():
            with pytest.raises(gymnasium.error.ResetNeeded, match="reset_mask"):
                disabled.step(action)
            again = disabled.reset(options={"reset_mask": ended})[0]
            np.testing.assert_array_equal(again, observed)
    assert seen >= 9
    following = modes[AutoresetMode.NEXT_STEP]
    for action in given[:9]:
        *_, terminated, truncated, _ = following.step(action)
    assert truncated.any()
    assert not (terminated & truncated).any()
    _, reward, *_ = following.step(given[10])
    assert (reward[truncated] == 0.0).all()


def test_what_is_wrong_is_said() -> None:
    lanes, single = vector(), TaskEnv("Walker2d")
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        lanes.step(actions(3, 1)[0])
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        single.step(np.zeros(6))
    lanes.reset(seed=np.int64(1))
    lanes.reset(seed=[1, None, 3])
    single.reset(seed=0)
    for wrong, words in (
        (np.zeros((3, 5)), "shape"), (np.full((3, 6), np.nan), "lane 2 is not finite"),
        (np.full((3, 6), "a"), "numbers"), (None, "numbers"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            lanes.step(wrong)
    with pytest.raises(ValueError, match="not finite"):
        single.step(np.full(6, np.inf))
    for env in (lanes, single):
        for seed in (-1, "a", 1.5, [1, 2], [1, "a", 2], [[1], [2], [3]], {"a": 1}):
            with pytest.raises(gymnasium.error.Error, match=r"(?i)seed"):
                env.reset(seed=seed)
    np.testing.assert_array_equal(
        lanes.reset(seed=np.array([4, 5, 6]))[0], lanes.reset(seed=np.int64(4))[0]
    )
    with pytest.raises(gymnasium.error.Error, match="truth value"):
        lanes.reset(options={"reset_mask": [0, 1, 1]})
    for make in (lambda: TaskEnv("Ant"), lambda: TaskVectorEnv("Walker2d", 0)):
        with pytest.raises(ValueError, match=r"task|num_envs"):
            make()
    with pytest.raises(ValueError, match="render_mode"):
        TaskEnv("Walker2d", render_mode="ansi")
    copy = pickle.loads(pickle.dumps(single))
    np.testing.assert_array_equal(copy.reset(seed=0)[0], single.reset(seed=0)[0])
    for each in (lanes, single):
        for _ in range(2):
            each.close()
        for late in (each.reset, each.render, lambda: each.step(actions(3, 1)[0])):  # noqa: B023
            with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="closed"):
                late()


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(5), np.zeros((6, 1)), 0.5, np.zeros(0), "abcdef", None, np.full(6, None),
        np.zeros(6, dtype=bool), np.zeros(6, dtype=complex), np.full(6, np.nan),
        np.array([0, 0, 0, 0, 0, -np.inf]), [[1.0], [2.0, 3.0]],
    ],
    ids=repr,
)  # fmt: skip
def test_a_refused_action_changes_nothing(wrong: Any) -> None:
    """The next good one leads to where it would have led without it, in one and in many."""
    given = actions(2, 2)
    single, lanes, untouched = TaskEnv("Walker2d"), vector(lanes=2), vector(lanes=2)
    single.reset(seed=9)
    for each in (lanes, untouched):
        each.reset(seed=9)
    for action in given:
        with pytest.raises(ValueError, match=r"action|shape|sequence"):
            single.step(wrong)
        with pytest.raises(ValueError, match=r"action|shape|sequence"):
            lanes.step([wrong, wrong])
        expected = untouched.step(action)
        for found, wanted in zip(lanes.step(action)[:4], expected, strict=False):
            np.testing.assert_array_equal(found, wanted)
        np.testing.assert_array_equal(single.step(action[0])[0], expected[0][0])


def test_actions_of_whole_numbers_and_beyond_the_range_are_taken() -> None:
    """What is beyond is cut, and costs as much as it asked for, as in Gymnasium."""
    for wide, cut in ((np.full(6, 3), np.ones(6)), ([-1e3] * 6, -np.ones(6))):
        one, other = TaskEnv("Walker2d"), TaskEnv("Walker2d")
        for each in (one, other):
            each.reset(seed=2)
        found, wanted = one.step(wide), other.step(cut)
        np.testing.assert_array_equal(found[0], wanted[0])
        cost = 1e-3 * (np.square(wide).sum() - np.square(cut).sum())
        assert found[1] == pytest.approx(wanted[1] - cost, rel=1e-12)


def observed_by(lanes: Any, seed: int = 5) -> list[str]:
    seen = [lanes.reset(seed=seed)[0]]
    seen += [lanes.step(action)[0] for action in actions(2, 3, 3)]
    return [float(each).hex() for each in np.array(seen).ravel()]


def test_environments_go_on_in_a_fork_and_in_another_process(tmp_path: Path) -> None:
    """Threads of the first process are not there in the second; a pickle starts again."""
    lanes = TaskVectorEnv("Hopper", 2, threads=2)
    expected = observed_by(lanes)
    if hasattr(os, "fork"):
        told = tmp_path / "told"
        child = os.fork()
        if not child:
            told.write_text(" ".join(observed_by(lanes)), encoding="ascii")
            os._exit(0)
        os.waitpid(child, 0)
        assert told.read_text(encoding="ascii").split() == expected
    assert observed_by(lanes) == expected
    kept = tmp_path / "kept"
    kept.write_bytes(pickle.dumps(lanes))
    program = (
        "import pickle, sys, pathlib, numpy as np\n"
        "lanes = pickle.loads(pathlib.Path(sys.argv[1]).read_bytes())\n"
        "seen = [lanes.reset(seed=5)[0]]\n"
        "given = np.random.default_rng(0).uniform(-1, 1, (3, 2, 3)).astype(np.float32)\n"
        "seen += [lanes.step(action)[0] for action in given]\n"
        "print(*[float(each).hex() for each in np.array(seen).ravel()])"
    )
    assert fresh_python("-c", program, str(kept)).stdout.split() == expected


@pytest.mark.slow
def test_they_work_in_processes_that_are_spawned() -> None:
    """Gymnasium's own vector of processes, which begin from nothing, makes and moves them."""
    name = f"{environments.__name__}:heelstrike/Hopper-v0"
    given = {"num_envs": 2, "vectorization_mode": "async"}
    spawned = gymnasium.make_vec(name, **given, vector_kwargs={"context": "spawn"})
    ours = TaskVectorEnv("Hopper", 2)
    try:
        np.testing.assert_array_equal(spawned.reset(seed=5)[0], ours.reset(seed=5)[0])
        for action in actions(2, 5, 3):
            np.testing.assert_array_equal(spawned.step(action)[0], ours.step(action)[0])
    finally:
        spawned.close()


def test_walks_are_environments_too() -> None:
    options: Any = {"reference": "posture", "randomise": {"push": (5.0, 10.0)}}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(maximum|minimum|infinity|Box).*")
        walk = gymnasium.make("heelstrike/Walk-v0", render_mode="rgb_array", **options)
        check_env(walk.unwrapped)
    lanes = vector("Walk", 2, **options)
    lanes.reset(seed=1)
    *_, info = lanes.step(np.zeros((2, 6)))
    assert info["contact_force"].shape == (2, walk.unwrapped._lanes.robot.nc, 2)
    assert (info["reward_speed"] > 0.0).all()
    with pytest.raises(ValueError, match="fields"):
        gymnasium.make("heelstrike/Walk-v0", colour="red")


def test_fields_of_the_task_can_be_others_and_pictures_are_taken() -> None:
    single = gymnasium.make("heelstrike/Hopper-v0", render_mode="rgb_array", healthy_reward=5.0)
    single.reset(seed=0)
    info = single.step(np.zeros(3, dtype=np.float32))[4]
    assert info["reward_survive"] == 5.0
    assert 0.0 <= info["certificate"] < 1e-9
    picture = single.render()
    assert picture.shape == (480, 480, 3)
    assert len(np.unique(picture)) > 2


def test_names_are_registered_once() -> None:
    environments.register()
    assert gymnasium.spec("heelstrike/Walker2d-v0").max_episode_steps == 1000
