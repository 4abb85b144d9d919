"""People: recordings of them, and the nearest gaits that hard contact allows."""

from heelstrike.experiments.people.mimicry import Mimicry, mimic

__all__ = ["Mimicry", "mimic"]
