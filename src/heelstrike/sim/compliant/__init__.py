"""Ground that gives way."""

from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.compliant.method import Compliant

__all__ = ["BristleFriction", "Compliant", "HuntCrossley", "KelvinVoigt", "RegularisedFriction"]
