"""What is to be learned: to walk at a commanded speed, on any robot that has a gait."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from heelstrike.control.policy.reference import Reference
from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.motion import motion_of
from heelstrike.experiments.learning.ranges import Ranges
from heelstrike.field_texts import dataclass
from heelstrike.robot.library import load_planar_robot
from heelstrike.robot.robot import Robot

WALK = "walk"
"""What policies tell of their task, beside its fields."""


@dataclass(frozen=True)
class WalkTask:
    """A robot that is to follow a motion at a commanded speed, and to keep its balance.

    Torques are those that follow the motion (:class:`~heelstrike.control.policy.reference.Reference`)
    and the actions times `action_size` by the stiffness of each joint. What is observed are pitch,
    joints and all velocities, then commanded speed, sine and cosine of the phase of the stride.

    The reward of a step is the sum of named terms: for what is to be near what, its weight times
    exp(−(error/width)²); of what costs, minus its weight times the mean square.

    Raises
    ------
    SimulationError
        If a number is out of range.
    """  # noqa: E501 - a name

    file: str = "bravo7"
    """Name of a built-in robot, or its file."""
    reference: str = "gait"
    """What is followed: ``"gait"`` for gaits that are designed over `speeds`, ``"posture"`` for the
    robot as it stands in its file, or the file of a gait."""
    speeds: tuple[float, float] = (0.2, 0.6)
    """Lowest and greatest commanded speed (m/s)."""
    gaits: int = 5
    """Gaits that are designed, evenly over the speeds."""
    command_period: float = 5.0
    """Seconds from one command to the next."""
    step: float = 1e-3
    """Time step (s), and seconds between two readings of the joints."""
    frame_skip: int = 20
    """Steps a decision."""
    friction: float = 0.75
    """Of the ground."""
    stiffness: float = 0.4
    """Stiffness of the joints, over weight by height of the trunk."""
    action_size: float = 0.25
    """Deflection of a joint's spring (rad) that an action of 1 makes good."""
    alive_weight: float = 0.5
    """Reward for a step in which the robot is upright."""
    speed_weight: float = 1.0
    speed_width: float = 0.2
    """speed_weight, speed_width: Of the trunk's speed, which is to be that of the motion (m/s)."""
    joint_weight: float = 0.5
    joint_width: float = 0.2
    """joint_weight, joint_width: Of the root mean square of how far joints are off (rad)."""
    upright_weight: float = 0.5
    upright_width: float = 0.2
    """upright_weight, upright_width: Of the trunk's pitch, which is to be that of the motion (rad).
    """
    effort_weight: float = 0.05
    """Of torques over the torques that lift the robot's weight at the height of its trunk."""
    action_weight: float = 0.05
    """Of the actions."""
    lowest: float = 0.75
    """The robot has fallen where its trunk is lower over the ground than this part of its height in
    the file,"""
    most_pitch: float = 0.8
    """or its pitch (rad) is greater, either way."""
    velocity_limit: float = 20.0
    """Velocities are observed up to this (m/s, rad/s)."""
    reset_noise_scale: float = 0.05
    """Size of the noise of the velocities (m/s, rad/s) that an episode begins with."""
    max_episode_steps: int = 500
    """Decisions after which an episode is truncated."""
    randomise: Ranges = Ranges()
    """What is drawn again for each episode."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "randomise", Ranges.of(self.randomise))
        low, high = (float(each) for each in self.speeds)
        object.__setattr__(self, "speeds", (low, high))
        if not 0.0 <= low <= high < float("inf"):
            raise SimulationError(f"speeds are (lowest, greatest) in m/s, got {self.speeds}")
        for name in ("gaits", "frame_skip", "max_episode_steps"):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= 1):
                raise SimulationError(f"{name} must be a whole number ≥ 1, got {value!r}")
        for name in ("command_period", "step", "speed_width", "joint_width", "upright_width"):
            if not getattr(self, name) > 0.0:
                raise SimulationError(f"{name} must be positive, got {getattr(self, name)!r}")
        if self.reference not in ("gait", "posture") and not self.reference.endswith(".json"):
            raise SimulationError(
                "reference is 'gait', 'posture' or the .json file of a gait, got "
                f"{self.reference!r}"
            )

    @property
    def decision_period(self) -> float:
        """Seconds from one decision to the next."""
        return self.step * self.frame_skip

    @property
    def about(self) -> dict[str, str]:
        """What a policy tells of the task that it was trained for."""
        return {"task": WALK, WALK: json.dumps(asdict(self))}

    @classmethod
    def told(cls, about: Mapping[str, str]) -> WalkTask:
        """Return the task that a policy tells of.

        Parameters
        ----------
        about : mapping of str to str
            What it tells.

        Returns
        -------
        WalkTask
            The task.

        Raises
        ------
        SimulationError
            If it is none.
        """
        try:
            given: dict[str, Any] = json.loads(about[WALK])
            return cls(**given | {"speeds": tuple(given["speeds"])})
        except (KeyError, TypeError, ValueError) as error:
            raise SimulationError(
                f"the file of this policy does not say its task: {error}"
            ) from error

    def robot(self) -> Robot:
        """Load the robot.

        Returns
        -------
        Robot
            The robot.

        Raises
        ------
        RobotError
            If there is none.
        """
        return load_planar_robot(self.file)

    def motion(self) -> Reference:
        """Return the motion that is followed.

        Returns
        -------
        Reference
            The motion; the same object for the same fields.

        Raises
        ------
        SimulationError, GaitError, RobotError
            If there is none.
        """
        return motion_of(
            self.file, self.reference, self.speeds, self.gaits, self.friction, self.stiffness,
            self.step,
        )  # fmt: skip
