"""Stability of walking as numbers: zero dynamics, jumps at impacts, what a walk stands."""
