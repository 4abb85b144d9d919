"""What is another question in space about the momentum of the whole robot."""

from __future__ import annotations

from heelstrike.dynamics.queries import momenta
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.robot.model import Floats


@momenta.angular_momentum.in_space("(3,) float: In N m s, in world axes.")
def angular_momentum(at: SpatialEvaluation) -> Floats:
    """Moment of momentum about the centre of mass."""
    return momenta.momentum.at(at)[3:]
