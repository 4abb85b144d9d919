"""Certificates: what a contact solve is worth, measured on the original data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from heelstrike.compilation import kernel
from heelstrike.contact.modes import Solver, SolveStatus
from heelstrike.contact.workspace import Floats


@dataclass(frozen=True)
class Certificate:
    """The residuals of a contact solve and how it came about.

    The residuals are relative and have no unit. The velocity of row i is set against
    ``v_i = max_j |b_j| + |b_i| + sum_j |G_ij lambda_j|``, the speeds in the problem and the size
    of the numbers it was summed from, and an impulse against ``v_i / G_ii``, what it takes to
    make such a velocity. A light body is thus held to the same accuracy as a heavy one beside
    it, and a residual of 1e-16 is what rounding leaves.

    Attributes
    ----------
    status : SolveStatus
        How the solve ended; ``status.text`` says it in words.
    solver : Solver
        The solver whose answer is reported.
    iterations : int
        Iterations (pivots, Newton steps or sweeps) of all solvers tried.
    fallbacks : int
        How many solvers failed before the one reported.
    complementarity : float
        Largest of min(velocity, impulse) over the complementary pairs: normal velocity and
        normal impulse; slip to either side and the friction that still lacks to the cone's
        opposing edge.
    cone : float
        Largest excess of the friction over the cone, or of a normal impulse below zero.
    penetration : float
        Largest negative normal velocity.
    tolerance : float
        What the residuals had to meet.
    """

    status: SolveStatus
    solver: Solver
    iterations: int
    fallbacks: int
    complementarity: float
    cone: float
    penetration: float
    tolerance: float

    @property
    def valid(self) -> bool:
        """Return whether the solve ended well and every residual is within tolerance."""
        return self.status is SolveStatus.SOLVED and self.worst <= self.tolerance

    @property
    def worst(self) -> float:
        """Return the largest residual."""
        return max(self.complementarity, self.cone, self.penetration)

    def __str__(self) -> str:
        return (
            f"{self.solver.value}: {self.status.text} (complementarity "
            f"{self.complementarity:.1e}, cone {self.cone:.1e}, penetration "
            f"{self.penetration:.1e}, {self.iterations} iterations, {self.fallbacks} fallbacks)"
        )


@kernel
def certify(
    count: int,
    delassus: Floats,
    free: Floats,
    friction: Floats,
    slope: Floats,
    impulse: Floats,
    velocity: Floats,
    residual: Floats,
    size: Floats,
) -> float:
    """Compute the velocity an impulse gives and the residuals; return the largest of them.

    The residuals are complementarity, cone and penetration, scaled as in :class:`Certificate`;
    ``size`` receives the scale of each velocity. ``slope`` is not zero where a contact is
    prescribed to slide; its friction then lies on the given edge and its tangential velocity is
    not constrained.
    """
    complementarity = 0.0
    cone = 0.0
    penetration = 0.0
    speeds = 0.0
    for i in range(2 * count):
        speeds = max(speeds, abs(free[i]))
    for contact in range(count):
        row = 2 * contact
        normal_velocity = free[row]
        tangent_velocity = free[row + 1]
        normal_size = speeds + abs(normal_velocity)
        tangent_size = speeds + abs(tangent_velocity)
        # Friction is summed apart from the normal impulses: the sums run side by side.
        normal_friction = 0.0
        tangent_friction = 0.0
        normal_part = 0.0
        tangent_part = 0.0
        for other in range(count):
            column = 2 * other
            part = delassus[row, column] * impulse[column]
            normal_velocity += part
            normal_size += abs(part)
            part = delassus[row, column + 1] * impulse[column + 1]
            normal_friction += part
            normal_part += abs(part)
            part = delassus[row + 1, column] * impulse[column]
            tangent_velocity += part
            tangent_size += abs(part)
            part = delassus[row + 1, column + 1] * impulse[column + 1]
            tangent_friction += part
            tangent_part += abs(part)
        normal_velocity += normal_friction
        normal_size += normal_part
        tangent_velocity += tangent_friction
        tangent_size += tangent_part
        if not (normal_size < math.inf and tangent_size < math.inf):
            penetration = math.inf  # NaN or infinite
        velocity[row] = normal_velocity
        velocity[row + 1] = tangent_velocity
        size[row] = normal_size
        size[row + 1] = tangent_size
        normal_impulse = impulse[row]
        tangent_impulse = impulse[row + 1]
        limit = friction[contact] * normal_impulse

        speed = 0.0 if normal_size == 0.0 else normal_velocity / normal_size
        if delassus[row, row] <= 0.0 or normal_size == 0.0:
            force = 1.0 if normal_impulse > 0.0 else (-1.0 if normal_impulse < 0.0 else 0.0)
        else:
            force = normal_impulse * (delassus[row, row] / normal_size)
        penetration = max(penetration, -speed)
        cone = max(cone, -force)
        complementarity = max(complementarity, min(speed, force))

        if delassus[row + 1, row + 1] > 0.0 and tangent_size > 0.0:
            force_scale = delassus[row + 1, row + 1] / tangent_size
        else:
            both = limit + abs(tangent_impulse)
            force_scale = 1.0 / both if both > 0.0 else 0.0
        if slope[contact] != 0.0:
            cone = max(cone, abs(tangent_impulse - slope[contact] * normal_impulse) * force_scale)
            continue
        cone = max(cone, (abs(tangent_impulse) - limit) * force_scale)
        speed = 0.0 if tangent_size == 0.0 else tangent_velocity / tangent_size
        complementarity = max(complementarity, min(speed, (limit + tangent_impulse) * force_scale))
        complementarity = max(complementarity, min(-speed, (limit - tangent_impulse) * force_scale))
    residual[0] = complementarity
    residual[1] = cone
    residual[2] = penetration
    return max(complementarity, max(cone, penetration))
