"""The linear-quadratic regulator of a walk that repeats, on point feet."""
