"""Errors a user can meet, each worded for a person: what was wrong, where, and what to do."""

from __future__ import annotations


class HeelstrikeError(Exception):
    """Base of every error that heelstrike raises on purpose."""


class RobotError(HeelstrikeError, ValueError):
    """A robot is unknown, its file cannot be read, or it is not a robot we can simulate."""


class GaitError(HeelstrikeError, ValueError):
    """A gait request or a gait file is not usable."""


class InfeasibleGaitError(GaitError):
    """No gait satisfies the request; the message names the constraints in conflict."""


class GaitNotFoundError(InfeasibleGaitError):
    """No gait was found that satisfies the request, which does not prove that there is none.

    The message names the constraints that were in conflict where the optimiser came nearest.
    """


class ControllerError(HeelstrikeError, ValueError):
    """A controller was set up wrongly or returned torques of the wrong shape."""


class ContactProblemError(HeelstrikeError, ValueError):
    """The data of a contact problem are malformed."""


class SimulationError(HeelstrikeError, ValueError):
    """The arguments of a simulation are not usable (before anything is simulated)."""


class LimitCycleError(HeelstrikeError, RuntimeError):
    """No limit cycle was found: the robot does not walk on, or its steps do not converge."""


class RunFileError(HeelstrikeError, ValueError):
    """A run cannot be saved, or a saved run cannot be read."""


class WriteError(HeelstrikeError, OSError):
    """A file cannot be written; an older one of its name is as it was."""


class ViewError(HeelstrikeError, ValueError):
    """A figure or animation was asked for that cannot be drawn or written."""
