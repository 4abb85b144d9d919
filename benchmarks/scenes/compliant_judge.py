"""The laws of compliant ground, re-derived from samples with the mean forces between them.

Within a sample the integration takes steps of its own that the record does not show, so that all is
judged over samples:

- balance of momentum: the linear momentum of a floating robot changes by gravity, pushes and the
  mean contact forces, whatever happens within. Of the other coordinates the balance holds to first
  order in the sample only; a coarse bound is held against it.
- motion: a position changes by no more than the velocities at both ends and the forces between
  allow.
- contact: mean forces within the cone, none where the ground is out of reach; in the last row,
  which holds the forces of its own instant, the law of the ground itself.
- energy: motion, height, joint springs and ground together gain no more than motors and pushes put
  in.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.findings import Findings
from scenes.mechanics import generalised
from scenes.record import Rows, excess_over_cone

Array = NDArray[Any]

MOMENTUM = 1e-2
"""Linear momentum of a sample that nothing explains, relative to the greatest in the run."""
BALANCE = 0.3
"""The same of all coordinates in kinetic size; what a sample can resolve."""
IN_CORNER = 3e-3
"""Distance (m) from a second face up to which a force may be that of both faces of a corner."""
LAW = 1e-6
"""Cone and law of the ground, relative to the force."""
ENERGY = 2e-2
"""Energy gained from nowhere, relative to the greatest in the run."""
MOTION = 1e-6
"""Change of position (m, rad) beyond what is allowed."""


def judge_compliant(run: Any) -> Findings:
    """Judge a run on compliant ground, from its record."""
    found = Findings()
    rows = Rows(run, corners=IN_CORNER)
    rows.geometry(found)
    found.figures["penetration"] = float(max(np.max(-rows.gap, initial=0.0), 0.0))
    if len(rows.time) > 1:
        _Samples(rows).judge(found)
    return found


class _Samples:
    def __init__(self, rows: Rows) -> None:
        run = rows.run
        self.rows = rows
        self.h = float(run.method.step)
        self.time = rows.time[:-1]
        share = [one.time_within(rows.time, rows.time + self.h) / self.h for one in run.pushes]
        self.share = np.stack(share, axis=1) if share else np.zeros((len(rows.time), 0))
        self.pushed = rows.push(self.share)
        self.size = rows.metric.of_velocity(rows.v)

    def judge(self, found: Findings) -> None:
        self.rows.ties.judge(found, self.rows.smooth)
        self.momentum(found)
        self.balance(found)
        self.contacts(found)
        self.energy(found)

    def momentum(self, found: Findings) -> None:
        rows, run, model = self.rows, self.rows.run, self.rows.model
        if not run.robot.floating:
            return
        links = np.arange(rows.tree.size)
        jacobian = rows.poses.jacobian(links, rows.poses.center)
        p = np.einsum("tpcn,tn,p->tc", jacobian, rows.v, model.mass, optimize=True)
        nx, nz = rows.normal[:-1, :, 0], rows.normal[:-1, :, 1]
        normal, tangent = rows.force[:-1, :, 0], rows.force[:-1, :, 1]
        ground = np.stack((normal * nx + tangent * nz, normal * nz - tangent * nx), axis=-1)
        pushes = np.array([one.force for one in run.pushes]).reshape(-1, 2)
        known = model.mass.sum() * model.gravity + self.share[:-1] @ pushes
        left = np.diff(p, axis=0) - self.h * (known + ground.sum(axis=1))
        # Normals turn at corners, where a disc may meet one side and the other within a sample.
        turned = np.linalg.norm(np.diff(rows.normal, axis=0), axis=-1)
        turned[1:] = np.maximum(turned[1:], turned[:-1])
        turned[:-1] = np.maximum(turned[:-1], turned[1:])
        vague = self.h * np.sum(turned * np.linalg.norm(rows.force[:-1], axis=-1), axis=1)
        unit = np.linalg.norm(p, axis=1).max() + self.h * model.mass.sum() * 9.81
        wrong = np.maximum(np.linalg.norm(left, axis=1) - 2.0 * vague, 0.0) / unit
        found.look("linear momentum", wrong, MOMENTUM, self.time)

    def allowed(self) -> Array:
        """Kinetic size of all that acts in a sample, whatever its order."""
        rows = self.rows
        metric = rows.metric
        known = metric.of_force(rows.smooth + self.pushed)
        weight = metric.weight(rows.jacobian)
        acted = (np.abs(rows.force) * weight).sum(axis=(1, 2)) + metric.of_force(rows.ties.force())
        joint = np.abs(rows.run.stop_torque) + np.abs(rows.run.friction_torque)
        return self.h * (known + acted + (joint * metric.joint_weight()).sum(axis=1))

    def balance(self, found: Findings) -> None:
        rows = self.rows
        smooth = rows.smooth
        # Pushes are told as means over the sample already.
        mean = 0.5 * (smooth[:-1] + smooth[1:]) + self.pushed[:-1]
        own = 0.5 * (rows.jacobian[:-1] + rows.jacobian[1:])
        # What both faces of a corner do is told in the frame of the row, where it acted.
        middle = np.where(rows.cornered[:-1, :, None, None], rows.acting[:-1], own)
        acted = generalised(middle, rows.force[:-1])
        acted += rows.run.stop_torque[:-1] + rows.run.friction_torque[:-1]
        acted += rows.ties.mean_force()
        matrix = 0.5 * (rows.matrix[:-1] + rows.matrix[1:])
        change = np.diff(rows.v, axis=0)
        left = np.einsum("tij,tj->ti", matrix, change) - self.h * (mean + acted)
        allowed = self.allowed()[:-1]
        metric = rows.metric_of(slice(None, -1))
        unit = self.size[:-1] + self.size[1:] + allowed
        # When a sudden stop within the sample changes what depends on velocity is not known.
        vague = 0.5 * self.h * metric.of_force(np.diff(smooth, axis=0))
        wrong = np.maximum(metric.of_force(left) - vague, 0.0)
        found.look("balance", wrong / unit, BALANCE, self.time)
        moved = np.diff(rows.q, axis=0) - self.h * rows.v[:-1]
        # In kinetic size, as forces are: |moved| ≤ h times all the velocity that they could give.
        over = metric.of_velocity(moved) - 1.5 * self.h * (allowed + metric.of_velocity(change))
        light = np.sqrt(np.linalg.eigvalsh(rows.matrix[:-1])[:, 0])
        found.look("teleport", np.maximum(over, 0.0) / light, MOTION, self.time)

    def contacts(self, found: Findings) -> None:
        rows, names = self.rows, self.rows.contacts
        if not names:
            return
        size = np.linalg.norm(rows.force, axis=-1).max() + 1e-12
        high = rows.high.copy()
        high[:-1] = np.maximum(high[:-1], high[1:])  # it may have met another segment
        cone = excess_over_cone(rows.force, high) / size
        near = rows.cornered.copy()
        near[:-1] |= rows.cornered[1:]
        cone = np.where(near, 0.0, cone)
        found.look("friction cone", cone, LAW, rows.time, names)
        speed = np.abs(rows.speed[..., 0])
        reach = self.h * (speed[:-1] + speed[1:] + self.allowed()[:-1, None])
        away = np.minimum(rows.gap[:-1], rows.gap[1:]) > reach + 1e-6
        away &= ~near[:-1]
        pressed = np.where(away, np.linalg.norm(rows.force[:-1], axis=-1), 0.0) / size
        found.look("contact: force without touch", pressed, LAW, self.time, names)
        last = slice(-1, None)
        if rows.run.completed:
            law = rows.run.method.law
            own = _normal_force(law, rows.gap[last], rows.speed[last, :, 0])
            wrong = np.abs(own - rows.force[last, :, 0]) / (size + own)
            wrong = np.where(near[last], 0.0, wrong)
            found.look("law of the ground", wrong, LAW, rows.time[last], names)

    def energy(self, found: Findings) -> None:
        rows, run, model = self.rows, self.rows.run, self.rows.model
        kinetic, potential = rows.energy()
        law, stop, friction = run.method.law, run.method.stop, run.method.friction
        stored = _stored(law, rows.gap).sum(axis=1)
        beyond = np.minimum(rows.q - model.lower, model.upper - rows.q)
        stored += _stored(stop, np.where(np.isfinite(beyond), beyond, 1.0)).sum(axis=1)
        # A bristle may hold up to this much and is not in the record.
        bristle = np.zeros_like(stored)
        if hasattr(friction, "stiffness"):
            limit = rows.high * np.maximum(rows.force[..., 0], 0.0)
            bristle = (limit**2).sum(axis=1) / (2.0 * friction.stiffness)
        mean = 0.5 * (rows.v[:-1] + rows.v[1:])
        torque = np.zeros_like(mean)
        held = 0.5 * (run.torque[:-1] + run.torque[1:])
        torque[:, model.actuator_joint] = held
        work = self.h * ((torque + self.pushed[:-1]) * mean).sum(axis=1)
        vague = self.h * (np.abs(torque + self.pushed[:-1]) * np.abs(np.diff(rows.v, axis=0))).sum(
            1
        )
        total = kinetic + potential + stored
        gained = np.diff(total) - work - 0.5 * vague - bristle[:-1]
        top = max(float(kinetic.max()), float(np.ptp(potential)), 1e-9)
        found.look("energy made", np.maximum(gained, 0.0) / top, ENERGY, self.time)


def _normal_force(law: Any, gap: Array, speed: Array) -> Array:
    """Force of Hunt and Crossley's law, or Kelvin and Voigt's, by their textbook formulas."""
    depth = np.maximum(-gap, 0.0)
    if hasattr(law, "exponent"):
        force = law.stiffness * depth**law.exponent * (1.0 - 1.5 * law.dissipation * speed)
    else:
        force = np.where(gap < 0.0, law.stiffness * depth - law.damping * speed, 0.0)
    return np.maximum(force, 0.0)


def _stored(law: Any, gap: Array) -> Array:
    """Elastic energy of such a spring."""
    exponent = getattr(law, "exponent", 1.0)
    depth = np.maximum(-gap, 0.0)
    return law.stiffness * depth ** (exponent + 1.0) / (exponent + 1.0)
