"""Runs as labelled datasets and as files."""
