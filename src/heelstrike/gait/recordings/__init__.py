"""Recordings: motions of joints, of markers, and forces of the ground, from tables of text."""
