"""Ground that gives way."""
