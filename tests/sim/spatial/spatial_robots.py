"""How tests make robots in space."""

from __future__ import annotations

from collections.abc import Callable

import heelstrike as hs

Maker = Callable[..., hs.SpatialRobot]
