"""What became of a run: why it fell, how close it came to its limits, what would change that."""
