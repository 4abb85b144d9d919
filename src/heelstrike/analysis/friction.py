"""How much of the friction cone the contact forces use (paper eq. 9, Figure 6)."""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.support import NOTHING, foot_sums
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.run import Run


@dataclass(frozen=True, eq=False)
class FrictionUse:
    """Tangential force over what friction allows, |f_t| / (μ f_n), row by row.

    1 is the edge of the friction cone; NaN where nothing presses.
    """

    contact: Floats
    """(nt, nc) Of each contact point. Two points of one flat sole share their tangential force in a
    way that mechanics does not decide: the run holds the split of least norm."""
    foot: Floats
    """(nt, nf) Of each foot, from the sums over its contact points; unique."""
    total: Floats
    """(nt,) Of all contact points together."""

    @property
    def max(self) -> float:
        """Largest use by any foot at any time; NaN if no foot ever presses."""
        return float(np.fmax.reduce(self.foot, axis=None, initial=np.nan))


def friction_use(run: Run) -> FrictionUse:
    """Compute which share of the friction cone a run uses (paper eq. 9).

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    FrictionUse
        Of each contact point, of each foot and of all, row by row.
    """
    pressing = run.contact_force[..., 0]
    tangential = run.contact_force[..., 1]
    allowed = friction_coefficient(run) * pressing
    floor = NOTHING * run.robot.weight
    parts = (tangential, allowed, pressing)
    return FrictionUse(
        contact=_share(*parts, floor=floor),
        foot=_share(*(foot_sums(run, part) for part in parts), floor=floor),
        total=_share(*(part.sum(axis=1) for part in parts), floor=floor),
    )


def friction_coefficient(run: Run) -> Floats:
    """Friction coefficient between the ground and every contact point, (nt, nc)."""
    ground = run.ground.model()
    corners = ground.vertices[:, 0]
    segment = np.searchsorted(corners, run.contact_point[..., 0], side="right") - 1
    below: Floats = ground.friction[np.clip(segment, 0, len(ground.friction) - 1)]
    return below * run.robot.model.friction_scale


def _share(tangential: Floats, allowed: Floats, pressing: Floats, *, floor: float) -> Floats:
    """|tangential| / allowed; NaN where nothing presses, 0/0 of a frictionless ground is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(tangential) / allowed
    share = np.where((allowed == 0.0) & (tangential == 0.0), 0.0, share)
    return np.where(pressing > floor, share, np.nan)
