"""Where the joints of a leg must be for its foot to be where it shall be."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.inverse_kinematics import MISSED, Reaching, leg_joints, reach
from heelstrike.dynamics.queries.evaluation import joint_vector, place_vector
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.coordinates import index_of
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import sole


@dataclass(frozen=True, eq=False)
class LegPose:
    """Joint positions that bring a foot to a place, or as near as the leg reaches."""

    q: Floats
    """(nq,) Positions (m, rad); other coordinates than those of the leg are as they were given."""
    residual: float
    """What is missing, of the kinematics of `q`: the larger of metres and radians."""

    @property
    def reached(self) -> bool:
        """Whether nothing is missing but rounding."""
        return self.residual <= MISSED


def inverse_kinematics(
    robot: Robot, q: ArrayLike, foot: int | str, target: ArrayLike,
    *, local: ArrayLike | None = None,
) -> LegPose:  # fmt: skip
    """Find joints of a leg with which a point of its foot is at a place, and the foot turned so.

    Only actuated joints that move no other foot take part, and stay within their ranges. Of several
    answers it is the one that damped least squares comes to from `q`; a target out of reach gives
    the nearest pose, and says what is missing.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : (nq,) array
        Position to begin with, in m and rad, in the order of ``robot.joint_names``.
    foot : int or str
        Foot, by its index in ``robot.feet`` or its name.
    target : (3,) or (2,) array
        World position (x, z) of the point in m and angle of the foot about +y in rad. Without the
        angle, or with NaN for it, any will do; of a leg with fewer than three joints, always.
    local : (2,) array, optional
        The point in the foot's axes, in m; by default the middle of the sole.

    Returns
    -------
    LegPose
        The positions, and what is missing.

    Raises
    ------
    RobotError
        If the robot has no such foot, no motor moves it alone, or a vector has the wrong length.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike import dynamics
    >>> robot = hs.load_robot("bravo7")
    >>> q = robot.reference_state().q
    >>> step = dynamics.inverse_kinematics(robot, q, "left_foot", (0.2, 0.05, 0.0))
    >>> sole = dynamics.link_poses(robot, step.q).angle[robot.feet[1].link]
    >>> step.reached, abs(float(sole)) < 1e-9
    (True, True)
    """
    index = index_of(robot, "foot", tuple(each.name for each in robot.feet), foot)
    joints = leg_joints(robot)[index]
    if not joints:
        raise RobotError(
            f"robot {robot.name!r}: no actuated joint moves foot {robot.feet[index].name!r} "
            "alone, so it has no leg to solve for"
        )
    pose = np.full(3, np.nan)
    given = np.asarray(target, dtype=np.float64)
    if given.shape not in ((2,), (3,)) or not np.all(np.isfinite(given[:2])):
        raise RobotError(
            f"target must be a place (x, z) in metres, and an angle in rad if the foot is to have "
            f"one, got {target!r}"
        )
    pose[: given.size] = given
    if local is None:
        local = sole(robot, robot.feet[index]).ends.mean(axis=0)
    answer = joint_vector(robot, "q", q).copy()
    point = place_vector("local", local, "xz")
    residual = reach(
        robot.model, np.array(joints), robot.feet[index].link, point, pose,
        Reaching.allocate(robot.model.extents), answer,
    )  # fmt: skip
    return LegPose(answer, float(residual))
