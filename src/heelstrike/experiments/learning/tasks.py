"""What is to be learned: the running tasks of Gymnasium's v5 environments, on hard contact.

Observation, action, reward, end of an episode and noise of the reset are those of the files
``walker2d_v5.py``, ``hopper_v5.py`` and ``half_cheetah_v5.py`` of Gymnasium, term by term; the
robot is its file's. What is not the same is the physics. Contact is hard, with the friction that
the file gives the feet (MuJoCo takes the larger one of two bodies). Joint stops are hard: positions
that the noise puts beyond them are back within a step. Time stepping at the file's step takes the
place of the Runge-Kutta of walker and hopper.
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.library import load_planar_robot
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.warning import RobotWarning

OF_GYMNASIUM = "gymnasium:"

EVERYTHING = (-np.inf, np.inf)

WITHOUT_LIMIT = 0.25
"""Part of weight times height that an action of 1 is where a motor has no limit."""


@dataclass(frozen=True)
class RunningTask:
    """A robot that is to run, with the reward of Gymnasium's v5 environments.

    The reward of a step is ``forward_reward_weight`` times the mean speed, plus ``healthy_reward``
    if the robot is healthy, minus ``ctrl_cost_weight`` times the sum of the squared actions.
    """

    file: str
    """Name of a built-in robot, or its file; with ``gymnasium:`` before it one of Gymnasium's."""
    step: float
    """Time step of the file (s)."""
    frame_skip: int
    """Steps a decision."""
    friction: float
    """Friction of the feet on the ground, from the file."""
    forward_reward_weight: float = 1.0
    """Reward for a speed of 1 m/s."""
    ctrl_cost_weight: float = 1e-3
    """Cost of an action of length 1."""
    healthy_reward: float = 1.0
    """Reward for a step in which the robot is healthy."""
    terminate_when_unhealthy: bool = True
    """Whether an episode ends when it is not."""
    healthy_z_range: tuple[float, float] = EVERYTHING
    healthy_angle_range: tuple[float, float] = EVERYTHING
    healthy_state_range: tuple[float, float] = EVERYTHING
    """healthy_z_range, healthy_angle_range, healthy_state_range: Where height (m) and pitch (rad)
    of the trunk are, and all positions but x and z and all velocities, of a healthy robot."""
    velocity_limit: float = np.inf
    """Velocities are observed up to this (m/s, rad/s)."""
    reset_noise_scale: float = 5e-3
    """Size of the noise round the initial state."""
    normal_noise: bool = False
    """Whether the noise of velocities is normal; otherwise uniform, as that of positions."""
    exclude_current_positions_from_observation: bool = True
    """Whether the position along the ground is left out of observations."""
    max_episode_steps: int = 1000
    """Decisions after which an episode is truncated."""

    def gear(self, robot: Robot) -> Floats:
        """Return the torque of each actuator for an action of 1, (nu,) in N m.

        Parameters
        ----------
        robot : Robot
            The robot.

        Returns
        -------
        (nu,) float
            The greatest that its file allows; where that is none, what would lift a part of its
            weight at the length of its legs.
        """
        height = max(float(robot.model.reference[1]), 0.1) if robot.floating else 1.0
        return np.minimum(robot.model.torque_upper, WITHOUT_LIMIT * robot.weight * height)

    @property
    def decision_period(self) -> float:
        """Seconds from one decision to the next."""
        return self.step * self.frame_skip

    @property
    def about(self) -> dict[str, str]:
        """What a policy tells of the task that it was trained for."""
        return {"task": self.file}

    def robot(self) -> Robot:
        """Load the robot.

        Returns
        -------
        Robot
            The robot of the file in the Gymnasium that is installed.

        Raises
        ------
        SimulationError
            If Gymnasium, or the file, is not there.
        """
        name = self.file.removeprefix(OF_GYMNASIUM)
        if name == self.file:
            return load_planar_robot(name)
        found = find_spec("gymnasium")
        if found is None or found.origin is None:
            raise SimulationError(
                "this robot's file is one of Gymnasium's, which is not installed: "
                "pip install 'heelstrike[learn]'"
            )
        path = Path(found.origin).parent / "envs" / "mujoco" / "assets" / name
        if not path.is_file():
            raise SimulationError(f"this Gymnasium has no robot file {path.name}: {path}")
        with warnings.catch_warnings():  # of what is out of date in a file that nobody here wrote
            warnings.simplefilter("ignore", RobotWarning)
            return load_planar_robot(path)


RUNNING = {
    "Walker2d": RunningTask(
        file="gymnasium:walker2d_v5.xml", step=0.002, frame_skip=4, friction=1.9,
        healthy_z_range=(0.8, 2.0), healthy_angle_range=(-1.0, 1.0), velocity_limit=10.0,
    ),
    "Hopper": RunningTask(
        file="gymnasium:hopper.xml", step=0.002, frame_skip=4, friction=2.0,
        healthy_z_range=(0.7, np.inf), healthy_angle_range=(-0.2, 0.2),
        healthy_state_range=(-100.0, 100.0), velocity_limit=10.0,
    ),
    "HalfCheetah": RunningTask(
        file="gymnasium:half_cheetah.xml", step=0.01, frame_skip=5, friction=0.4,
        ctrl_cost_weight=0.1,
        healthy_reward=0.0, terminate_when_unhealthy=False, reset_noise_scale=0.1,
        normal_noise=True,
    ),
}  # fmt: skip
"""The tasks, by the names of Gymnasium's environments."""


def task_of(robot: str) -> RunningTask:
    """Return the task of a robot.

    Parameters
    ----------
    robot : str
        A name among :data:`RUNNING`, whatever its capitals; or a built-in robot or a file, which is
        to run on as a walker does: upright, its trunk neither much lower nor much higher than it
        stands in its file.

    Returns
    -------
    RunningTask
        The task.

    Raises
    ------
    SimulationError, RobotError
        If there is no such robot, or it does not float.
    """
    plain = robot.lower().replace("_", "").replace("-", "")
    for name, task in RUNNING.items():
        if plain == name.lower():
            return task
    loaded = load_planar_robot(robot)
    if not loaded.floating or not loaded.nu:
        raise SimulationError(
            f"robot {loaded.name!r} cannot learn to run: its trunk does not move freely, or it has "
            "no actuators"
        )
    _, z, pitch = loaded.model.reference[:3].tolist()
    return RunningTask(
        file=robot, step=0.002, frame_skip=5, friction=0.75,
        healthy_z_range=(0.7 * z, 1.4 * z), healthy_angle_range=(pitch - 1.0, pitch + 1.0),
        velocity_limit=10.0,
    )  # fmt: skip
