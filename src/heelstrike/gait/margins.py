"""How far a gait stays from everything that would make it fall, slip, hit or break."""

from __future__ import annotations

from dataclasses import field

from heelstrike.field_texts import dataclass


@dataclass(frozen=True)
class Margins:
    """Worst values of a gait over one step, found on a grid finer than the optimiser's."""

    normal_force: float = field(metadata={"unit": "N"})
    """Least normal force of the ground on the stance foot, in N."""
    friction_use: float
    """Largest |tangential force| / (friction coefficient times normal force); at most 1."""
    zero_moment_point: float = field(metadata={"unit": "m"})
    """Least distance of the zero moment point from the ends of the sole, in m; 0 on a point."""
    clearance: float = field(metadata={"unit": "m"})
    """Least height of the swing foot's contact points above the clearance profile, in m."""
    joint_range: float = field(metadata={"unit": "rad"})
    """Least distance of a joint from the end of its range, the robot's or a narrower one that was
    asked for, in rad (m for a slide); infinite if no joint has one."""
    torque: float = field(metadata={"unit": "Nm"})
    """Least distance of a torque from its limit, in N m (N for a slide); infinite if there are no
    limits."""
    peak_torque: float = field(metadata={"unit": "Nm"})
    """Largest torque (N m) or force (N)."""
    impulse: float = field(metadata={"unit": "Ns"})
    """Normal impulse of the ground at touchdown, in N s."""
    impulse_friction_use: float
    """|Tangential impulse| / (friction coefficient times normal impulse); at most 1."""
    impulse_center: float = field(metadata={"unit": "m"})
    """Distance of the impulse's centre of pressure from the ends of the landing sole, in m."""
    landing_velocity: float = field(metadata={"unit": "m_per_s"})
    """Largest vertical velocity of the landing foot's contact points just before touchdown, in m/s;
    not positive."""
    lift_velocity: float = field(metadata={"unit": "m_per_s"})
    """Least vertical velocity of the rear foot's contact points just after touchdown, in m/s; not
    negative."""
    touchdown_error: float
    """How far (m, rad) the landing foot is from its place flat on the ground."""
    impact_error: float
    """Residual of the equations of the impact, relative to the robot's weight (s m)."""
