"""Random scenes in space, and the mechanics with which their records are judged."""
