"""What a run in space says: where its mass goes, what carries it, and where the ground pushes."""

from heelstrike.analysis.spatial.motion import CentroidalMotion, centroidal_motion
from heelstrike.analysis.spatial.summary import SpatialSummary, summarize_in_space
from heelstrike.analysis.spatial.support import SupportPolygon, support_polygon
from heelstrike.analysis.spatial.zero_moment_point import SpatialZeroMomentPoint

__all__ = [
    "CentroidalMotion",
    "SpatialSummary",
    "SpatialZeroMomentPoint",
    "SupportPolygon",
    "centroidal_motion",
    "summarize_in_space",
    "support_polygon",
]
