"""Smooth phases between events, impacts at events."""

from heelstrike.sim.event_driven.method import EventDriven

__all__ = ["EventDriven"]
