"""What can go wrong when a run is drawn."""

from __future__ import annotations

from heelstrike.errors import HeelstrikeError


class ViewError(HeelstrikeError, ValueError):
    """A figure or animation was asked for that cannot be drawn or written."""
