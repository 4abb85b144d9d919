"""The laws of time stepping, re-derived step by step from the record.

One row a step is needed (``record_every=1``). With the recorded state (q, v), torques and forces
λ/h of row k and the state of row k + 1 each scheme promises:

- balance: ``M(q)(v⁺ − v) = h (Γ + passive + pushes − H) + Jᵀλ`` at the old state; the linearly
  implicit scheme has ``M + hD + h²K`` in the place of M and ``−h K v`` on the right, K and D
  including the gains of the controller.
- motion: ``q⁺ = q + h v⁺``; the explicit scheme moves with v, Moreau-Jean with the mean of the two.
  The one that resolves impacts may move with another velocity u than v⁺ where a contact arrives,
  or is in the ground, and not where nothing is near; then ``J_n u ≥ −gap/h``.
- contact: ``w_n ≥ b ⟂ λ_n ≥ 0`` with w = J v⁺ and b = −gap/h (gap linearised), b = 0 where
  gap ≤ activation (the paper's), b = −e w_n of before where the gap is foreseen to close
  (Moreau-Jean); b = −e w_n of before, where u is not v⁺, for the contacts that u brings to the
  ground, if they touch already, touched a step ago, or would close freely; elsewhere λ = 0. The
  friction cone, and friction of μ λ_n against what slides. Stops are contacts without friction,
  dry friction of joints a contact with a known normal force.
  In a concave corner a point may be pushed by both faces, and the record has the resultant: there
  it is held against balance and energy only.
- energy: the contact solve takes kinetic energy, but for what b > 0 asks for: λ_n b.

All is measured in kinetic sizes (:class:`scenes.mechanics.Metric`) relative to the size of the
data of the step, ``S = |v| + |v⁺| + h |known forces|``; the forces of contacts are no part of it,
so that a huge force proves nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.sim import Scheme
from scenes.findings import Findings
from scenes.mechanics import Metric, generalised, rates
from scenes.record import Rows, excess_over_cone, friction_that_does_not_oppose

Array = NDArray[Any]

BALANCE = 1e-8
"""Momentum of a step that nothing explains, relative to S."""
LAW = 1e-7
"""Contact laws of a step, relative to S. Certificates promise 1e-9 of problems that are scaled
otherwise."""
MOTION = 1e-10
"""Change of position (m, rad) that the velocity does not explain."""
SINK = 1e-6
"""Depth (m) in the ground that neither the linearised gap nor the turning of the robot explains."""
TOUCHING = 1e-9
"""A contact touches when its gap is no more than this (m)."""
BOUND = (Scheme.GAP_LINEARISED, Scheme.LINEARLY_IMPLICIT, Scheme.IMPACT_RESOLVED)
"""Schemes that bound the gap at the end of the step."""
IN_CORNER, DEEP_IN_CORNER = 1e-3, 5e-2
"""A point that comes this near (m) to a second face of a concave corner may be pushed by both;
schemes that do not bound the gap sink."""
ALONE = 1e-2
"""What is farther (m, rad) than this from everything has nothing to split its step."""
UNDECIDED = 1e-12
"""A gap (m) this near the edge of a scheme's activation may count either way."""


def judge_steps(run: Any, controller: Any = None) -> Findings:
    """Judge a run of time stepping.

    Parameters
    ----------
    run : heelstrike.sim.Run
        Its record, with every step in it.
    controller : JointFeedback, optional
        What controlled it: the linearly implicit scheme takes its gains at the end of the step.
    """
    near = IN_CORNER if run.method.scheme in BOUND else DEEP_IN_CORNER
    return judge_rows(Rows(run, corners=near), controller)


def judge_rows(rows: Any, controller: Any = None) -> Findings:
    """Judge the rows of a run of time stepping, in the plane or in space; see `judge_steps`."""
    found = Findings()
    rows.geometry(found)
    depth = np.max(-rows.gap, initial=0.0)
    found.figures["penetration"] = float(max(depth, 0.0))
    if len(rows.time) > 1:
        _Steps(rows, controller).judge(found)
    return found


def unexplained_steps(rows: Any) -> tuple[Array, Array]:
    """Return the indices of steps whose momentum nothing explains, the worst first, and how far."""
    broken = _Steps(rows, None).unexplained()
    worst: Array = np.argsort(-broken)
    worst = worst[broken[worst] > BALANCE]
    return worst, broken[worst]


class _Steps:
    def __init__(self, rows: Any, controller: Any) -> None:
        run, model = rows.run, rows.model
        self.rows = rows
        self.scheme = run.method.scheme
        self.activation = run.method.activation
        self.h = float(run.method.step)
        self.time = rows.time[:-1]
        pushes = [one.time_within(rows.time, rows.time + self.h) / self.h for one in run.pushes]
        share = np.stack(pushes, axis=1) if pushes else np.zeros((len(rows.time), 0))
        self.pushed = rows.push(share)[:-1]
        known = rows.smooth[:-1] + self.pushed
        matrix = rows.matrix[:-1]
        self.before, self.after = rows.v[:-1], rows.v[1:]
        if self.scheme in (Scheme.LINEARLY_IMPLICIT, Scheme.MOREAU_JEAN):
            stiffness, damping = model.stiffness.copy(), model.damping.copy()
            ahead = self.h if self.scheme is Scheme.LINEARLY_IMPLICIT else 0.5 * self.h
            if controller is not None and self.scheme is Scheme.LINEARLY_IMPLICIT:
                stiffness[model.actuator_joint] += controller.parameters.kp
                damping[model.actuator_joint] += controller.parameters.kd
            rows.ties.added = ahead * damping + ahead**2 * stiffness
            matrix = matrix + np.diag(rows.ties.added)
            known = known - ahead * stiffness * self.before
        self.metric = Metric(matrix)
        self.matrix = matrix
        self.free = self.before + self.h * self.metric.accelerated(known)
        self.jacobian, self.acting = rows.jacobian[:-1], rows.acting[:-1]
        self.impulse = self.h * rows.force[:-1]
        self.stop, self.dry = self.h * run.stop_torque[:-1], self.h * run.friction_torque[:-1]
        self.tied = self.h * rows.ties.force()[:-1]
        self.known = known
        size = self.metric.of_velocity
        self.size = size(self.before) + size(self.after) + self.h * self.metric.of_force(known)
        self.size = np.maximum(self.size, 1e-100)
        self.gap = rows.gap[:-1]
        self.cornered = rows.cornered[:-1]
        self.split = np.zeros(len(self.time), dtype=bool)
        """Steps whose positions move with another velocity than the one behind them."""
        self.moved = self.after.copy()
        if self.scheme is Scheme.IMPACT_RESOLVED:
            self.split = np.any(rows.missed(self.h, self.after) > MOTION, axis=1)
            split = np.flatnonzero(self.split)
            self.moved[split] = rows.chord(self.h, split)
        self.wedged = rows.wedges(TOUCHING)
        """Whether a wedge is going on, in which steps may leave in the ground what is there."""
        self.asked_for = np.zeros(len(self.time))
        """Energy that the bounds b of the normal velocities ask for."""

    def judge(self, found: Findings) -> None:
        self.rows.ties.judge(found, self.rows.smooth, self.h, exact=not self.split.any())
        self.balance(found)
        self.motion(found)
        self.contacts(found)
        self.stops(found)
        self.dry_joints(found)
        self.energy(found)

    def balance(self, found: Findings) -> None:
        found.look("balance", self.unexplained(), BALANCE, self.time)

    def unexplained(self) -> Array:
        """Momentum (T,) of each step that nothing explains, relative to S."""
        momentum = np.einsum("tij,tj->ti", self.matrix, self.after - self.before)
        acted = generalised(self.acting, self.impulse) + self.stop + self.dry + self.tied
        left = self.rows.explained(momentum - self.h * self.known - acted)
        return self.metric.of_force(left) / self.size

    def motion(self, found: Findings) -> None:
        velocity = self.after
        if self.scheme is Scheme.IMPACT_RESOLVED:
            velocity = np.where((self.split & ~self.alone())[:, None], self.moved, self.after)
        if self.scheme is Scheme.PAPER_EXPLICIT:
            velocity = self.before
        elif self.scheme is Scheme.MOREAU_JEAN:
            velocity = 0.5 * (self.before + self.after)
        left = self.rows.missed(self.h, velocity)
        found.look("teleport", left, MOTION, self.time, self.rows.joints)
        dt = np.abs(np.diff(self.rows.time) - self.h)
        found.look("length of a step", dt, 1e-9, self.time)

    def alone(self) -> Array:
        """Steps (T,) in which nothing acts, and nothing is near the ground or a stop."""
        rows = self.rows
        ways = [self.gap, rows.coordinate[:-1] - rows.lower, rows.upper - rows.coordinate[:-1]]
        ways += [gap[:-1, None] for _, _, gap, _ in rows.stops_of_balls()]
        alone = np.ones(len(self.time), dtype=bool)
        for way in ways:
            alone &= way.min(axis=1, initial=np.inf) > ALONE
        for each in (self.impulse, self.stop, self.dry, self.tied):
            alone &= ~each.reshape(len(self.time), -1).any(axis=1)
        return alone

    def arrives(self, found: Findings, law: str, gap: Array, speed: Array, free: Array) -> Array:
        """Judge where the positions go in split steps; tell whose impact each of them is."""
        after = gap + self.h * speed
        left = np.where(self.may_stay(gap), np.minimum(gap, 0.0), 0.0)
        deep = np.where(self.split[:, None], left - after, 0.0)
        found.look(f"{law}: moved into it", deep / (1.0 + np.abs(gap)), MOTION, self.time)
        touches = after <= TOUCHING
        touched = np.concatenate((gap[:1] <= TOUCHING, touches[:-1]))
        closes = gap + self.h * free < 0.0
        return (gap <= TOUCHING) | (touches & (touched | closes))

    def may_stay(self, gap: Array) -> Array:
        """Where a wedge excuses what stays at its gap (T, n): not what is too deep for that."""
        excused = (gap < TOUCHING) & (gap >= -self.rows.deepest_in_wedge)
        return np.asarray(self.wedged[:, None] & excused)

    def bound(
        self, gap: Array, before: Array, bounce: Array, mine: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Least normal velocity that the scheme asks for, -inf where it asks for none.

        The second array is the largest at which it lets forces act, no less than the first: what
        lies between is excused. The third tells where rounding decides whether it asks at all;
        `mine` tells who takes part in the impacts of split steps.
        """
        held = self.may_stay(gap)
        if mine is not None:
            whole = np.where(mine, -bounce * before, -np.inf)
            asked = np.where(self.split[:, None], whole, -gap / self.h)
            held |= (self.split & self.wedged)[:, None] & mine
            near = self.split[:, None] & (np.abs(gap) < 2.0 * TOUCHING)
        elif self.scheme in BOUND:
            asked, near = -gap / self.h, np.zeros_like(held)
        else:
            foreseen, asked = gap, np.zeros_like(gap)
            if self.scheme is Scheme.MOREAU_JEAN:
                foreseen, asked = gap + 0.5 * self.h * before, -bounce * before
            near = np.abs(foreseen - self.activation) < UNDECIDED
            asked = np.where(foreseen <= self.activation, asked, -np.inf)
            return asked, asked, near
        least = np.where(held, np.minimum(asked, self.rows.speed_in_wedge), asked)
        most = np.where(held, np.maximum(asked, self.rows.speed_in_wedge), asked)
        return least, most, near | (held & ~np.isfinite(least))

    def normals(
        self, law: str, found: Findings, impulse: Array, speed: Array, weight: Array,
        asked: tuple[Array, Array, Array], names: tuple[str, ...],
    ) -> None:  # fmt: skip
        """Judge ``w ≥ b ⟂ λ ≥ 0``, row by row and place; `asked` is what `bound` returns."""
        least, most, near = asked
        size = self.size[:, None]
        unit_of_speed = np.maximum(weight * size, 1e-300)
        unit_of_impulse = size / np.maximum(weight, 1e-300)
        asks = np.isfinite(least)
        low, high = (np.where(asks, each, 0.0) for each in (least, most))
        over = np.where(asks, speed - np.clip(speed, low, high), 0.0) / unit_of_speed
        pushes = impulse / unit_of_impulse
        below = np.where(asks & ~near, -over, 0.0)
        found.look(f"{law}: speed into it", below, LAW, self.time, names)
        both = np.where(asks, np.minimum(np.abs(over), pushes), np.where(near, 0.0, pushes))
        found.look(f"{law}: force without touch", both, LAW, self.time, names)
        found.look(f"{law}: pull", -pushes, LAW, self.time, names)
        gain = np.where(asks, np.maximum(most, 0.0), 0.0) * np.maximum(impulse, 0.0)
        self.asked_for += gain.sum(axis=1)

    def contacts(self, found: Findings) -> None:
        rows, names = self.rows, self.rows.contacts
        if not names:
            return
        weight = self.metric.weight(self.jacobian)
        speed = rates(self.jacobian, self.after)
        before = rates(self.jacobian, self.before)[..., 0]
        mine = None
        if self.scheme is Scheme.IMPACT_RESOLVED:
            moved, free = (rates(self.jacobian, v)[..., 0] for v in (self.moved, self.free))
            mine = self.arrives(found, "contact", self.gap, moved, free)
        least, most, near = self.bound(self.gap, before, rows.measured.restitution[:-1], mine)
        # Of the force of two faces only where it acts is known, and what it does. What is asked of
        # either face is: to push out of the ground, and to bounce.
        came = rows.fastest(np.linalg.norm(rates(self.jacobian, self.before), axis=-1), self.before)
        asked = rows.measured.restitution[:-1] * came
        if self.scheme in BOUND:
            asked = asked + np.maximum(-self.gap, 0.0) / self.h
        pressed = np.where(self.cornered, asked * np.abs(self.impulse).sum(axis=-1), 0.0)
        self.asked_for += pressed.sum(axis=1)
        impulse = np.where(self.cornered[..., None], 0.0, self.impulse)
        near = near | self.cornered
        self.normals(
            "contact",
            found,
            impulse[..., 0],
            speed[..., 0],
            weight[..., 0],
            (least, most, near),
            names,
        )
        size = self.size[:, None]
        sideways = weight[..., 1:].max(axis=-1)
        unit = size / np.maximum(sideways, 1e-300)
        low, high = rows.low[:-1], rows.high[:-1]
        cone = excess_over_cone(impulse, high) / unit
        found.look("friction cone", cone, LAW, self.time, names)
        speed_unit = np.maximum(sideways * size, 1e-300)
        wrong = friction_that_does_not_oppose(impulse, speed[..., 1:], low, high, unit, speed_unit)
        found.look("friction opposes", wrong, LAW, self.time, names)
        slip = np.linalg.norm(rows.slip[:-1] - speed[..., 1:], axis=-1) / speed_unit
        pressed = impulse[..., 0] > 0.0
        found.look("recorded slip", np.where(pressed, slip, 0.0), LAW, self.time, names)
        self.sink(found, speed[..., 0])

    def sink(self, found: Findings, speed: Array) -> None:
        """Penetration that the schemes which bound the gap itself do not allow."""
        if self.scheme not in BOUND:
            return
        rows = self.rows
        moved = np.einsum("tpc,tpc->tp", np.diff(rows.center, axis=0), rows.normal[:-1])
        moved -= rows.lowered()
        turning = moved - self.h * (
            rates(self.jacobian, self.moved)[..., 0] if self.split.any() else speed
        )
        explained = np.maximum(-turning, 0.0)
        if self.cornered.any():  # the nearest face afterwards may be the other one
            world = rows.poses.jacobian(rows.model.contact_link, rows.center)[:-1]
            left = np.diff(rows.center, axis=0) - self.h * rates(world, self.moved)
            own = np.abs(turning - np.einsum("tpc,tpc->tp", left, rows.normal[:-1]))
            explained = np.where(self.cornered, np.linalg.norm(left, axis=-1) + own, explained)
        left = np.where(self.may_stay(self.gap), np.maximum(-self.gap, 0.0), 0.0)
        deep = -rows.gap[1:] - explained - left
        found.look("sunk at a corner", np.maximum(deep, 0.0), SINK, self.time, rows.contacts)

    def stops(self, found: Findings) -> None:
        rows = self.rows
        weight = self.metric.joint_weight()
        nothing = np.zeros_like(self.stop)
        for side, limit, name in ((1.0, rows.lower, "lower"), (-1.0, rows.upper, "upper")):
            has = np.isfinite(limit)
            gap = side * (rows.coordinate[:-1] - np.where(has, limit, -side * 1e9))
            mine = None
            if self.scheme is Scheme.IMPACT_RESOLVED:
                mine = self.arrives(found, f"{name} stop", gap, side * self.moved, side * self.free)
            least, most, near = self.bound(gap, side * self.before, nothing, mine)
            pressed = np.where(rows.ties.latched[:-1], 0.0, np.maximum(side * self.stop, 0.0))
            pressed = np.where(rows.of_balls, 0.0, pressed)
            near = near | rows.ties.latched[:-1]
            self.normals(
                f"{name} stop", found, pressed, side * self.after, weight, (least, most, near),
                rows.joints,
            )  # fmt: skip

        for name, row, gap, force in rows.stops_of_balls():
            weight = self.metric.weight(row[:-1, None, None])[..., 0]

            def along(velocity: Array, row: Array = row) -> Array:
                return np.einsum("tn,tn->t", row[:-1], velocity)[:, None]

            asked = self.bound(gap[:-1, None], along(self.before), 0.0 * weight, self.arrives(
                found, "ball stop", gap[:-1, None], along(self.moved), along(self.free)
            ) if self.scheme is Scheme.IMPACT_RESOLVED else None)  # fmt: skip
            self.normals(
                "ball stop", found, self.h * force[:-1, None], along(self.after), weight, asked,
                (name,),
            )  # fmt: skip

    def dry_joints(self, found: Findings) -> None:
        model, names = self.rows.model, self.rows.joints
        weight = self.metric.joint_weight()
        most = self.h * model.dry_friction
        unit = self.size[:, None] / weight
        found.look("dry friction: limit", (np.abs(self.dry) - most) / unit, LAW, self.time, names)
        lacks = np.abs(self.dry + most * np.sign(self.after)) / unit
        slides = np.abs(self.after) / (weight * self.size[:, None])
        found.look("dry friction: opposes", np.minimum(lacks, slides), LAW, self.time, names)

    def energy(self, found: Findings) -> None:
        size = self.metric.of_velocity
        gained = 0.5 * (size(self.after) ** 2 - size(self.free) ** 2)
        unit = 0.5 * self.size**2
        unasked = (gained - self.asked_for) / unit
        unasked -= np.maximum(np.sum(self.tied * self.after, axis=1), 0.0) / unit
        found.look("energy made in contact", unasked, LAW, self.time)
        kinetic, potential = self.rows.energy()
        top = max(float(kinetic.max()), 1e-12)
        found.figures["energy asked for"] = float(np.maximum(gained, 0.0).sum() / top)
        # Work over a step: impulses times the mean velocity, as for an exact jump.
        mean = 0.5 * (self.before + self.after)
        model, run = self.rows.model, self.rows.run
        acted = generalised(self.acting, self.impulse) + self.stop + self.dry + self.tied
        motors = np.zeros_like(mean)
        motors[:, self.rows.driven] = run.torque[:-1]
        forces = motors + self.pushed - model.damping * self.before
        work = (acted + self.h * forces) * mean
        change = np.diff(kinetic + potential) - work.sum(axis=1)
        drift = float(np.max(np.abs(np.cumsum(change))))
        found.figures["energy drift"] = drift / max(top, float(np.ptp(potential)))
