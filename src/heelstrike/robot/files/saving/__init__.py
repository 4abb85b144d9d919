"""Robots written to files: MJCF, which holds everything, URDF and SDF, which do not."""
