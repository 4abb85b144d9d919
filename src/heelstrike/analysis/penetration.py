"""How deep contact points sink into the ground: not at all, if contact is hard."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.model import Floats
from heelstrike.sim.run import Run


def penetration(run: Run) -> Floats:
    """Depth of every contact point below the ground in each row, (nt, nc), in m; zero above.

    ``run.certificates.penetration`` is the worst over all steps, recorded or not.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    (nt, nc) float
        Metres.
    """
    return np.maximum(0.0, -run.gap)
