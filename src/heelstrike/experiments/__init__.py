"""Experiments: a walk with all its results; the paper, figure by figure."""
