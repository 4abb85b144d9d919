"""What the ground does to each foot: one force and one moment (paper's F_r, F_l)."""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.motion import Motion, in_world, run_motion
from heelstrike.robot.model import Floats
from heelstrike.robot.sole import soles
from heelstrike.sim.run import Run


def foot_wrenches(run: Run, *, motion: Motion | None = None) -> Floats:
    """Wrench of the ground on each foot, (nt, nf, 3): (f_x, f_z, m_y) in N, N and N m.

    Forces act on the robot, in world axes. The moment is about +y and about the foot's reference
    point, the ankle projected onto the sole (`heelstrike.robot.sole`): the sum of
    z f_x − x f_z over the foot's contact points, (x, z) being measured from that point. Unlike the
    forces of single contact points, the wrench is unique also when the foot lies flat.

    Parameters
    ----------
    run : Run
        The run.
    motion : Motion, optional
        Its motion, if already at hand.

    Returns
    -------
    (nt, nf, 3) float
        Force along x and z, and moment about +y.
    """
    reference = sole_points(run, motion=motion)
    force = run.world_force
    result = np.zeros((len(run.time), len(run.robot.feet), 3))
    for i, foot in enumerate(run.robot.feet):
        contacts = list(foot.contacts)
        arm = run.contact_point[:, contacts] - reference[:, None, i]
        f = force[:, contacts]
        result[:, i, :2] = f.sum(axis=1)
        result[:, i, 2] = (arm[..., 1] * f[..., 0] - arm[..., 0] * f[..., 1]).sum(axis=1)
    return result


def sole_points(run: Run, *, motion: Motion | None = None) -> Floats:
    """World positions (x, z) of the feet's reference points, (nt, nf, 2), in m."""
    motion = run_motion(run) if motion is None else motion
    points = np.zeros((len(run.time), len(run.robot.feet), 2))
    for i, sole in enumerate(soles(run.robot)):
        link = sole.foot.link
        points[:, i] = in_world(
            motion.link_origin[:, link], motion.link_angle[:, link], sole.reference
        )
    return points
