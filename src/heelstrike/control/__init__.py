"""Controllers."""

from heelstrike.control.computed_torque import ComputedTorque, Encoder

__all__ = ["ComputedTorque", "Encoder"]
