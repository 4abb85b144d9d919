"""Tasks by their names, and the lanes of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.course import Course
from heelstrike.experiments.learning.running import RunningCourse
from heelstrike.experiments.learning.tasks import RUNNING, RunningTask, task_of
from heelstrike.experiments.learning.walk_task import WALK, WalkTask
from heelstrike.experiments.learning.walking import WalkingCourse
from heelstrike.sim import Method

LearningTask = RunningTask | WalkTask

NAMES = (*RUNNING, "Walk")
"""Names of the tasks; those of environments follow from them."""


def named_task(name: str, **changes: Any) -> LearningTask:
    """Return a task.

    Parameters
    ----------
    name : str
        One of :data:`NAMES`.
    **changes
        Fields that are to be others.

    Returns
    -------
    RunningTask or WalkTask
        The task.

    Raises
    ------
    ValueError
        If there is no such task or field.
    """
    if name not in NAMES:
        raise ValueError(f"there is no task {name!r}; there are {', '.join(NAMES)}")
    task: LearningTask = RUNNING[name] if name in RUNNING else WalkTask()
    try:
        return replace(task, **changes)
    except TypeError as error:
        fields = ", ".join(vars(task))
        raise ValueError(f"task {name!r} has the fields {fields}; got {changes}") from error


def told_task(about: Mapping[str, str]) -> LearningTask:
    """Return the task that a policy was trained for, as it tells.

    Parameters
    ----------
    about : mapping of str to str
        What it tells.

    Returns
    -------
    RunningTask or WalkTask
        The task.

    Raises
    ------
    SimulationError
        If it tells of none.
    """
    file = about.get("task")
    if file is None:
        raise SimulationError(
            "the file of this policy does not say what it was trained for: it has no "
            "about.task, such as the text gymnasium:walker2d_v5.xml"
        )
    if file == WALK:
        return WalkTask.told(about)
    return {each.file: each for each in RUNNING.values()}.get(file) or task_of(file)


def course_of(
    task: LearningTask, lanes: int = 1, *, threads: int = 1, method: Method | None = None
) -> Course:
    """Return lanes of a task.

    Parameters
    ----------
    task : RunningTask or WalkTask
        What is to be learned.
    lanes : int
        How many.
    threads : int
        Threads that move them.
    method : Method, optional
        Simulation method; time stepping at the step of the task by default.

    Returns
    -------
    Course
        The lanes.
    """
    kind: Any = WalkingCourse if isinstance(task, WalkTask) else RunningCourse
    course: Course = kind(task, lanes, threads=threads, method=method)
    return course
