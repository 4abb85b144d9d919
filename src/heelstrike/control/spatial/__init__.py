"""Controllers of robots in space."""
