"""Smooth phases between events, impacts at events."""
