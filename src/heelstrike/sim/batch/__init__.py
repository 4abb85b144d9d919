"""Many simulations at once: the batch that stays, and simulate_batch(), which is built on it."""
