"""How far a gait stays from everything that would make it fall, slip, hit or break."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Margins:
    """Worst values of a gait over one step, found on a grid finer than the optimiser's.

    Attributes
    ----------
    normal_force : float
        Least normal force of the ground on the stance foot, in N.
    friction_use : float
        Largest |tangential force| / (friction coefficient times normal force); at most 1.
    zero_moment_point : float
        Least distance of the zero moment point from the ends of the sole, in m; 0 on a point.
    clearance : float
        Least height of the swing foot's contact points above the clearance profile, in m.
    joint_range : float
        Least distance of a joint from the end of its range, the robot's or a narrower one that was
        asked for, in rad (m for a slide); infinite if no joint has one.
    torque : float
        Least distance of a torque from its limit, in N m (N for a slide); infinite if there are
        no limits.
    peak_torque : float
        Largest torque (N m) or force (N).
    impulse : float
        Normal impulse of the ground at touchdown, in N s.
    impulse_friction_use : float
        |Tangential impulse| / (friction coefficient times normal impulse); at most 1.
    impulse_center : float
        Distance of the impulse's centre of pressure from the ends of the landing sole, in m.
    landing_velocity : float
        Largest vertical velocity of the landing foot's contact points just before touchdown, in
        m/s; not positive.
    lift_velocity : float
        Least vertical velocity of the rear foot's contact points just after touchdown, in m/s;
        not negative.
    touchdown_error : float
        How far (m, rad) the landing foot is from its place flat on the ground.
    impact_error : float
        Residual of the equations of the impact, relative to the robot's weight (s m).
    """

    normal_force: float = field(metadata={"unit": "N"})
    friction_use: float
    zero_moment_point: float = field(metadata={"unit": "m"})
    clearance: float = field(metadata={"unit": "m"})
    joint_range: float = field(metadata={"unit": "rad"})
    torque: float = field(metadata={"unit": "Nm"})
    peak_torque: float = field(metadata={"unit": "Nm"})
    impulse: float = field(metadata={"unit": "Ns"})
    impulse_friction_use: float
    impulse_center: float = field(metadata={"unit": "m"})
    landing_velocity: float = field(metadata={"unit": "m_per_s"})
    lift_velocity: float = field(metadata={"unit": "m_per_s"})
    touchdown_error: float
    impact_error: float
