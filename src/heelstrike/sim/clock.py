"""When a simulation is, and when what is due next."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, cell


class Clock(Bundle):
    """The time of a simulation and what its loop goes by."""

    start: float = cell(float)
    """Time at which steps began to be counted (s)."""
    time: float = cell(float)
    """Time now (s)."""
    index: int = cell(int)
    """Steps completed since `start`."""
    until: float = cell(float)
    """Time at which the loop comes back (s)."""
    pause: int = cell(int)
    """Index at which it does."""
    control_every: int = cell(int)
    """Steps between two calls of the controller, zero if they go by time."""
    control_period: float = cell(float)
    """Seconds between two calls, zero for at every step."""
    calls: int = cell(int)
    """How often the controller has been called; of one that goes by time and was set later, how
    often it would have been."""
    answered: int = cell(int)
    """Whether a controller in Python has been, for this instant."""
    record_every: int = cell(int)
    """Steps between two rows of the record."""
    fallen_height: float = cell(float)
    """Height of the centre of mass above the ground below which the robot has fallen (m)."""
    begun: int = cell(int)
    moving: int = cell(int)
    """begun, moving: Whether the first instant has been prepared; whether this one has been
    decided, so that what is left is to move on: 2 where it was to be the last."""
    finishing: int = cell(int)
    """Whether this instant is to be decided and recorded, but not to be left."""
    forked: int = cell(int)
    """Whether the loop has told that its end shapes the steps."""
    row_margin: int = cell(int)
    event_margin: int = cell(int)
    """row_margin, event_margin: Rows and events that an instant may add to the record."""
