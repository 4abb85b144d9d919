"""When a simulation is, and when what is due next."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, cell


class Clock(Bundle):
    """The time of a simulation and what its loop goes by.

    Attributes
    ----------
    start : float
        Time at which steps began to be counted (s).
    time : float
        Time now (s).
    index : int
        Steps begun since `start`.
    until : float
        Time at which the loop comes back (s).
    pause : int
        Index at which it does.
    control_every : int
        Steps between two calls of the controller, zero if they go by time.
    control_period : float
        Seconds between two calls, zero for at every step.
    calls : int
        How often the controller has been called; of one that goes by time and was set later, how
        often it would have been.
    answered : int
        Whether a controller in Python has been, for this instant.
    record_every : int
        Steps between two rows of the record.
    fallen_height : float
        Height of the centre of mass above the ground below which the robot has fallen (m).
    begun, moving : int
        Whether the first instant has been prepared; whether this one has been decided, so that
        what is left is to move on: 2 where it was to be the last.
    finishing : int
        Whether this instant is to be decided and recorded, but not to be left.
    forked : int
        Whether the loop has told that its end shapes the steps.
    row_margin, event_margin : int
        Rows and events that an instant may add to the record.
    """

    start: float = cell(float)
    time: float = cell(float)
    index: int = cell(int)
    until: float = cell(float)
    pause: int = cell(int)
    control_every: int = cell(int)
    control_period: float = cell(float)
    calls: int = cell(int)
    answered: int = cell(int)
    record_every: int = cell(int)
    fallen_height: float = cell(float)
    begun: int = cell(int)
    moving: int = cell(int)
    finishing: int = cell(int)
    forked: int = cell(int)
    row_margin: int = cell(int)
    event_margin: int = cell(int)
