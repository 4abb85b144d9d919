"""Gaits over a phase of the robot's own instead of time: what virtual constraints follow."""
