"""What a run in space says: motion, zero moment point, support polygon, figures on one page."""

from heelstrike.analysis.spatial.motion import SpatialMotion, motion_in_space
from heelstrike.analysis.spatial.summary import SpatialSummary, summarize_in_space
from heelstrike.analysis.spatial.support import (
    SpatialPressure,
    capture_point_in_space,
    pressure_in_space,
)

__all__ = [
    "SpatialMotion",
    "SpatialPressure",
    "SpatialSummary",
    "capture_point_in_space",
    "motion_in_space",
    "pressure_in_space",
    "summarize_in_space",
]
