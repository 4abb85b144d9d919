"""Closed loops, coupled joints, latches and brakes: scenes that have them, and their laws."""
