"""Walkers with virtual constraints whose numbers are published, as robots and gaits of ours.

Three links: J. W. Grizzle, G. Abba, F. Plestan, *Asymptotically stable walking for biped robots:
analysis via systems with impulse effects*, IEEE Transactions on Automatic Control 46(1), 2001.
Five links: Bézier curves after a public pipeline for RABBIT, made invariant under their impact.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

import heelstrike as hs

# Legs apart at the touchdown of the three links (rad).
SPREAD = np.pi / 8.0
# Torso's and swing leg's outputs of the three links over the angle of the stance leg.
TORSO = Polynomial([0.512, 0.073, 0.035, -0.819])
LEGS = Polynomial([-2.27, 3.26, 3.11, 1.89]) * Polynomial([-(SPREAD**2), 0.0, 1.0])
# y₁ = θ₃ − …, y₂ = θ₂ + θ₁ − …, of errors of the two hips: θ₃ = θ₁ − q₁, θ₂ = θ₁ − q₁ + q₂.
OUTPUTS = ((-1.0, 0.0), (-1.0, 1.0))

BEZIER = np.reshape(
    [  # stance hip and knee, swing hip and knee
        -0.024029029449,
        0.083197327637,
        0.231694103144,
        0.409513752007,
        0.293554096720,
        0.470234974413,
        1.364893077529,
        1.382422518307,
        1.359975840721,
        1.276930448323,
        1.403484145518,
        1.276325478931,
        0.470234974413,
        0.625474578100,
        0.709689977585,
        0.619804485064,
        -0.142498131629,
        -0.024029029449,
        1.276325478931,
        1.193345471386,
        1.186490854022,
        2.045201021605,
        2.284101512273,
        1.364893077529,
    ],
    (4, 6),
)
PHASE_RANGE = (-0.149986060497, 0.299994144066)


@cache
def three_link(swing_point: float = 1.0) -> hs.Robot:
    """Legs of 1 m with 5 kg at their middle, 15 kg at the hip, 10 kg half a metre above it.

    The left leg's contact point may be drawn in, so that it passes above the ground.
    """
    build = hs.RobotBuilder("three_link", gravity=9.8)
    # 15 kg at the hip and 10 kg above it: 0.2 m and 0.3 m from their centre of mass.
    trunk = build.floating_base(
        "torso", (0.0, 1.0), mass=25.0, center_of_mass=(0.0, 0.2), inertia=1.5
    )
    for side, place in (("right", 1.0), ("left", swing_point)):
        leg = build.hinge(f"{side}_leg", trunk, mass=5.0, center_of_mass=(0.0, -0.5), torque=np.inf)
        build.contact(leg, (0.0, -place))
    return build.build()


@cache
def three_link_gait() -> hs.PhasedGait:
    """Both hips over the angle of the stance leg."""
    angle = Polynomial([0.0, 1.0])
    stance = angle - TORSO
    joints = stance, LEGS - 2.0 * angle + stance
    series = [Chebyshev.interpolate(each, 5, [-SPREAD, SPREAD]).coef for each in joints]
    return hs.PhasedGait(
        robot=three_link(),
        phase=np.array([0.0, 0.0, 1.0, 1.0, 0.0]),
        phase_range=(-SPREAD, SPREAD),
        coefficients=np.stack(series, axis=1),
    )


@cache
def five_link() -> hs.Robot:
    """Torso of 10 kg and 0.75 m; thighs and shanks of 5 kg and 0.5 m: uniform rods."""
    build = hs.RobotBuilder("five_link", gravity=9.8062)
    trunk = build.floating_base(
        "torso", (0.0, 1.0), mass=10.0, center_of_mass=(0.0, 0.375), inertia=10.0 * 0.75**2 / 12.0
    )
    for side in ("right", "left"):
        parent, place = trunk, (0.0, 0.0)
        for joint in ("hip", "knee"):
            parent = build.hinge(
                f"{side}_{joint}", parent, at=place, mass=5.0, center_of_mass=(0.0, -0.25),
                inertia=5.0 * 0.5**2 / 12.0, torque=np.inf,
            )  # fmt: skip
            place = (0.0, -0.5)
        build.contact(parent, (0.0, -0.5))
    return build.build()


@cache
def five_link_gait() -> hs.PhasedGait:
    """The invariant gait; its phase is the angle of the line from foot to hip, the default."""
    return hs.PhasedGait.from_bezier(five_link(), BEZIER, phase_range=PHASE_RANGE)
