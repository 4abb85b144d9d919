"""What is another question in space about the equations of motion."""

from __future__ import annotations

from numpy.typing import ArrayLike

from heelstrike.dynamics.queries import equations_of_motion
from heelstrike.dynamics.spatial import kernels
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.robot.model import Floats


@equations_of_motion.forward_dynamics.in_space(equations_of_motion.forward_dynamics.returns)
def forward_dynamics(at: SpatialEvaluation, force: ArrayLike) -> Floats:
    """Acceleration under a generalised force: there are no loops."""
    total, size = at.vector("force", force), at.model.nv
    return at.filled((size,), kernels.forward_dynamics, at.model, total, at.work, at.tree())
