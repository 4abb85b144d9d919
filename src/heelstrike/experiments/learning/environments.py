"""Environments of Gymnasium on hard contact: ``heelstrike/Walk-v0``, ``Walker2d-v0`` and its like.

Importing this module registers them; so does their name with the module before it::

    gymnasium.make("heelstrike.experiments.learning.environments:heelstrike/Walker2d-v0")
    gymnasium.make_vec(
        "heelstrike.experiments.learning.environments:heelstrike/Walker2d-v0", num_envs=64,
        vectorization_mode="vector_entry_point",
    )
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import SimulationError, ViewError
from heelstrike.experiments.learning.course import AT_RESET, Course
from heelstrike.experiments.learning.courses import NAMES, course_of, named_task
from heelstrike.experiments.learning.pictures import Camera, Screen
from heelstrike.robot.model import Floats, Integers

try:
    import gymnasium
    from gymnasium import error, spaces
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as missing:
    raise SimulationError(
        "environments need Gymnasium 1.1 or newer: pip install 'heelstrike[learn]'"
    ) from missing

Array = NDArray[Any]
Info = dict[str, Any]

MODES = ("human", "rgb_array")
"""How environments can be seen: in the browser, in real time, or as pictures."""

FRAMES = 50
"""Frames a second that are told to those who make films: that of a decision, if it is less."""


def _spaces(course: Course) -> tuple[spaces.Box, spaces.Box]:
    size = course.observation.shape[1]
    observation = spaces.Box(-np.inf, np.inf, (size,), np.float64)
    return observation, spaces.Box(-1.0, 1.0, (course.robot.nu,), np.float32)


def _refused(wrong: SimulationError) -> Exception:
    return ValueError(str(wrong))


class TaskEnv(gymnasium.Env[Floats, Array]):
    """One robot that is to run or walk.

    Parameters
    ----------
    task : str
        Name of the task: ``"Walker2d"``, ``"Hopper"``, ``"HalfCheetah"`` or ``"Walk"``.
    render_mode : str, optional
        ``"rgb_array"`` for pictures; ``"human"`` to show each step in the browser, in real time.
    **changes
        Fields of :class:`~heelstrike.experiments.learning.tasks.RunningTask` or
        :class:`~heelstrike.experiments.learning.walk_task.WalkTask` that are to be others, as
        ``ctrl_cost_weight=0.01``.
    """

    metadata: dict[str, Any] = {"render_modes": [*MODES], "render_fps": FRAMES}  # noqa: RUF012

    def __init__(self, task: str, render_mode: str | None = None, **changes: Any) -> None:
        self._lanes = _course(task, 1, changes)
        self.metadata = _metadata(self._lanes)
        self.render_mode = _checked_mode(render_mode, self.metadata)
        self.observation_space: Any
        self.observation_space, self.action_space = _spaces(self._lanes)
        self._given = task, render_mode, changes
        self._camera: Camera | None = None
        self._screen = _screen(self.render_mode, self._lanes)
        self._state = "new"
        self._first = np.zeros(1, dtype=np.int64)

    def __reduce__(self) -> Any:
        """Copies start again."""
        task, mode, changes = self._given
        return _made, (type(self), (task,), {"render_mode": mode, **changes})

    def reset(
        self, *, seed: int | None = None, options: Info | None = None,  # noqa: ARG002
    ) -> tuple[Floats, Info]:  # fmt: skip
        """Begin an episode.

        Parameters
        ----------
        seed : int, optional
            What the noise is drawn with from now on.
        options : dict, optional
            None is known.

        Returns
        -------
        tuple
            Observation and info.
        """
        _check_open(self._state)
        super().reset(seed=seed)
        if seed is not None or self._state == "new":
            self._lanes.seed(0, self.np_random)
        self._lanes.begin(self._first)
        self._state = "begun"
        if self._screen is not None:
            self._screen.show()
        return self._lanes.observation[0].copy(), self._terms(AT_RESET)

    def step(self, action: Array) -> tuple[Floats, float, bool, bool, Info]:
        """Make a decision.

        Parameters
        ----------
        action : (nu,) float
            Parts of the greatest torques.

        Returns
        -------
        tuple
            Observation, reward, whether the episode has ended, False, and info.

        Raises
        ------
        ValueError
            If the action is of another shape, no numbers, or not finite.
        """
        if self._state != "begun":
            _check_begun(self._state)
        lanes = self._lanes
        try:
            lanes.step(np.asarray(action)[None])
        except SimulationError as wrong:
            raise _refused(wrong) from None
        batch = lanes.batch
        info = self._terms(len(lanes.names))
        info["contact_force"] = batch.contact_force[0].copy()
        info["certificate"] = max(
            batch.complementarity.item(), batch.cone.item(), batch.non_penetration.item()
        )
        terminated = bool(lanes.terminated[0])
        if terminated:
            info["cause"] = lanes.cause(0)
        if self._screen is not None:
            self._screen.show()
        return lanes.observation[0].copy(), float(lanes.reward[0]), terminated, False, info

    def _terms(self, count: int) -> Info:
        lanes = self._lanes
        return dict(zip(lanes.names[:count], lanes.terms[0].tolist(), strict=False))

    def render(self) -> Any:
        """Return a picture, (height, width, 3) of 8 bits, if that is the mode.

        In the browser each step is shown without it.
        """
        _check_begun(self._state)
        if self.render_mode != "rgb_array":
            return None
        if self._camera is None:
            self._camera = Camera(self._lanes.robot, self._lanes.batch.lane(0).ground)
        return self._camera.picture(self._lanes.state_of(0))

    def close(self) -> None:
        """Let everything go."""
        self._state = "closed"
        self._lanes.batch.close()
        if self._screen is not None:
            self._screen.close()


class TaskVectorEnv(VectorEnv[Floats, Array, Array]):
    """Many robots that are to run or walk, moved in one call.

    Parameters
    ----------
    task : str
        Name of the task.
    num_envs : int
        How many.
    max_episode_steps : int, optional
        Decisions after which an episode is truncated; by default those of the task.
    autoreset_mode : AutoresetMode or str
        When a lane whose episode has ended starts again: with the next step, with the same, or when
        ``reset(options={"reset_mask": ...})`` says so.
    threads : int
        Threads that move them.
    render_mode : str, optional
        ``"rgb_array"`` for pictures of all; ``"human"`` to show each step of the first lane in the
        browser, in real time.
    **changes
        Fields of the task that are to be others.
    """

    def __init__(
        self, task: str, num_envs: int = 1, *, max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, threads: int = 1,
        render_mode: str | None = None, **changes: Any,
    ) -> None:  # fmt: skip
        self._lanes = course = _course(task, num_envs, changes, threads)
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = _metadata(course) | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = _checked_mode(render_mode, self.metadata)
        self.single_observation_space, self.single_action_space = _spaces(course)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        limit = course.task.max_episode_steps if max_episode_steps is None else max_episode_steps
        self.limit = limit if limit > 0 else np.iinfo(np.int64).max
        self._given: Info = {
            "task": task, "num_envs": num_envs, "max_episode_steps": max_episode_steps,
            "autoreset_mode": self.autoreset_mode, "threads": threads, "render_mode": render_mode,
            **changes,
        }  # fmt: skip
        self._decisions = np.zeros(num_envs, dtype=np.int64)
        self._over = np.zeros(num_envs, dtype=np.bool_)
        self._waiting = self._over.nonzero()[0]
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._masks = [f"_{name}" for name in (*course.names, "contact_force", "certificate")]
        self._cameras: list[Camera] = []
        self._screen = _screen(self.render_mode, course)
        self._state = "new"

    def __reduce__(self) -> Any:
        """Copies start again."""
        return _made, (type(self), (), self._given)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Floats, Info]:
        """Begin episodes in all lanes, or in those of a mask.

        Parameters
        ----------
        seed : int, or sequence of n int or None, optional
            What the noise is drawn with from now on; lane i of a single one has ``seed + i``.
        options : dict, optional
            ``{"reset_mask": (n,) bool}``: the lanes that begin.

        Returns
        -------
        tuple
            Observations and info.

        Raises
        ------
        gymnasium.error.Error
            If seed or mask are not usable.
        """
        _check_open(self._state)
        mask = self._mask(options)
        self._seed(seed)
        chosen = np.flatnonzero(mask)
        self._begin(chosen)
        self._state = "begun"
        info: Info = {
            name: self._lanes.terms[:, place].copy()
            for place, name in enumerate(self._lanes.names[:AT_RESET])
        }
        info |= {f"_{name}": mask.copy() for name in self._lanes.names[:AT_RESET]}
        if self._screen is not None and mask[0]:
            self._screen.show()
        return self._lanes.observation.copy(), info

    def check_begun(self) -> None:
        """Raise what says so if this is closed, or not reset yet."""
        if self._state != "begun":
            _check_begun(self._state)

    def step(self, actions: Array) -> tuple[Floats, Floats, Array, Array, Info]:
        """Make a decision in every lane.

        Parameters
        ----------
        actions : (n, nu) float
            Parts of the greatest torques.

        Returns
        -------
        tuple
            Observations, rewards, which episodes have ended, which are truncated, and info.

        Raises
        ------
        ValueError
            If the actions are of another shape, no numbers, or not finite.
        """
        self.check_begun()
        lanes, waiting = self._lanes, self._waiting
        waits = waiting.size > 0
        went = ~self._over if waits else self._all
        if waits and self.autoreset_mode is AutoresetMode.DISABLED:
            raise error.ResetNeeded(
                f"episodes of lanes {waiting.tolist()} are over: call "
                "reset(options={'reset_mask': terminated | truncated})"
            )
        try:
            lanes.step(actions, went if waits else None)
        except SimulationError as wrong:
            raise _refused(wrong) from None
        self._decisions += 1
        if waits:  # what was over starts again with this step, whatever its action
            self._begin(waiting)
            lanes.reward[waiting] = 0.0
        terminated = lanes.terminated & went
        truncated = (self._decisions >= self.limit) & went & ~terminated
        reward = lanes.reward.copy()
        info = self._info(went)
        ended = terminated | truncated
        self._over, self._waiting = ended, ended.nonzero()[0]
        if self._waiting.size:
            self._tell_ends(ended, terminated, info)
        if self._screen is not None:
            self._screen.show()
        return lanes.observation.copy(), reward, terminated, truncated, info

    def render(self) -> tuple[Array, ...] | None:
        """Return pictures of all lanes, if that is the mode.

        In the browser each step is shown without it.
        """
        _check_begun(self._state)
        if self.render_mode != "rgb_array":
            return None
        lanes = self._lanes
        while len(self._cameras) < self.num_envs:
            ground = lanes.batch.lane(len(self._cameras)).ground
            self._cameras.append(Camera(lanes.robot, ground))
        return tuple(
            camera.picture(lanes.state_of(lane)) for lane, camera in enumerate(self._cameras)
        )

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ARG002 - of the interface
        """Let everything go."""
        self._state = "closed"
        self._lanes.batch.close()
        if self._screen is not None:
            self._screen.close()

    def _begin(self, chosen: Integers) -> None:
        self._lanes.begin(chosen)
        self._decisions[chosen] = 0
        self._over[chosen] = False
        self._waiting = self._over.nonzero()[0]

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        if seed is None:
            return
        if isinstance(seed, int | np.integer):
            seeds: list[Any] = [int(seed) + lane for lane in range(self.num_envs)]
        else:
            try:
                seeds = np.asarray(seed, dtype=object).tolist()
                count = len(seeds)
            except (TypeError, ValueError):  # one of them, or several that are several themselves
                raise error.Error(
                    f"a seed is a whole number ≥ 0, or None; give one, or one a lane, got {seed!r}"
                ) from None
            if count != self.num_envs:
                raise error.Error(
                    f"give one number, or {self.num_envs} seeds, one a lane; got {count}"
                )
        randoms = [None if each is None else seeding.np_random(each)[0] for each in seeds]
        for lane, random in enumerate(randoms):
            if random is not None:
                self._lanes.seed(lane, random)

    def _mask(self, options: Info | None) -> Array:
        mask = None if options is None else options.get("reset_mask")
        if mask is None:
            return self._all
        array = np.asarray(mask)
        if array.dtype != np.bool_ or array.shape != (self.num_envs,):
            raise error.Error(
                f"reset_mask has one truth value a lane, ({self.num_envs},) bool, got shape "
                f"{array.shape} of {array.dtype}"
            )
        if self._state == "new" and not array.all():
            raise error.ResetNeeded("the first reset is one of all lanes, without a reset_mask")
        return array

    def _info(self, went: Array) -> Info:
        terms, batch = self._lanes.terms.copy(), self._lanes.batch
        certificate = np.maximum(batch.complementarity, batch.cone)
        info: Info = {name: terms[:, place] for place, name in enumerate(self._lanes.names)}
        info["contact_force"] = batch.contact_force.copy()
        info["certificate"] = np.maximum(certificate, batch.non_penetration, out=certificate)
        info |= dict.fromkeys(self._masks, went)
        return info

    def _tell_ends(self, ended: Array, terminated: Array, info: Info) -> None:
        """Tell why episodes have ended; start again what does so with the same step."""
        lanes, fell = self._lanes, terminated.nonzero()[0].tolist()
        if fell:
            causes = np.full(self.num_envs, None, dtype=object)
            for lane in fell:
                causes[lane] = lanes.cause(lane)
            info["cause"], info["_cause"] = causes, terminated.copy()
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            return
        over = self._waiting
        final = np.full(self.num_envs, None, dtype=object)
        for lane in over.tolist():
            final[lane] = lanes.observation[lane].copy()
        info["final_obs"], info["_final_obs"] = final, ended.copy()
        names = [name for name in info if not name.startswith(("_", "final"))]
        info["final_info"] = {
            name: info[name].copy() for name in names
        } | {f"_{name}": ended.copy() for name in names}  # fmt: skip
        info["_final_info"] = ended.copy()
        self._begin(over)
        for place, name in enumerate(lanes.names[:AT_RESET]):
            info[name] = lanes.terms[:, place].copy()


def _made(kind: Any, arguments: tuple[Any, ...], options: Info) -> Any:
    return kind(*arguments, **options)


def _course(task: str, lanes: int, changes: Info, threads: int = 1) -> Course:
    if not isinstance(lanes, int) or lanes < 1:
        raise ValueError(f"num_envs must be a whole number ≥ 1, got {lanes!r}")
    return course_of(named_task(task, **changes), lanes, threads=threads)


def _metadata(course: Course) -> Info:
    fps = round(1.0 / course.task.decision_period)
    return {"render_modes": [*MODES], "render_fps": fps}


def _checked_mode(mode: str | None, metadata: Info) -> str | None:
    if mode is not None and mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode is one of {metadata['render_modes']} or None, got {mode!r}")
    return mode


def _screen(mode: str | None, course: Course) -> Screen | None:
    if mode != "human":
        return None
    try:
        return Screen(course)
    except ViewError as missing:
        raise error.DependencyNotInstalled(str(missing)) from None


def _check_open(state: str) -> None:
    if state == "closed":
        raise error.ClosedEnvironmentError("this environment is closed: make another one")


def _check_begun(state: str) -> None:
    _check_open(state)
    if state == "new":
        raise error.ResetNeeded("call reset() before the first step or picture")


def register() -> None:
    """Register the environments with Gymnasium, unless they are."""
    module = __name__
    for task in NAMES:
        name = f"heelstrike/{task}-v0"
        if name not in gymnasium.registry:
            gymnasium.register(
                name, entry_point=f"{module}:TaskEnv", kwargs={"task": task},
                vector_entry_point=f"{module}:TaskVectorEnv",
                max_episode_steps=named_task(task).max_episode_steps,
            )  # fmt: skip


register()
