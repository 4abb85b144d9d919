"""Loops, couplings, brakes and latches of a record: what they do, and the laws they have to keep.

- loops and couplings are closed, φ = 0, and nothing moves against them: J v = 0; of time stepping
  ``J v⁺ + h/2 J̇ v = 0``, the chord between two poses that fit.
- a brake that does not slip holds its joint from row to row; one that does gives no more than its
  limit, and all of it against what slips.

What loops, couplings and brakes do to the coordinates has to be known by every other law. A latch
is a stop that pulls as well as it presses.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.findings import Findings
from scenes.mechanics import Metric, Poses
from scenes.ties.mechanics import Tied, torn

Array = NDArray[Any]

OPEN = 1e-9
"""Displacement (m, rad) of a loop or coupling."""
SPEED = 1e-7
"""Velocity against a tie, relative to the kinetic size of that and of what forces do in a row."""
ROW = 1e-3
"""Time (s) of a row."""
MOVED = 1e-9
"""Way (m, rad) of a joint from row to row that a brake holds."""
LAW = 1e-6
"""Torque of a brake that slips, relative to its limit."""
MOVING = 1e-3
"""Speed (rad/s, m/s) from which a brake slips; smoothed friction creeps below it."""
ATTEMPTS, CLOSED = 8, 1e-13
"""Newton steps that put positions back on the ties, and how far (m, rad) these are from it then."""
AT_THE_END, IN_STEPS = 1e-6, 1e-3
"""Distance (rad, m) from its end up to which a latch may hold: at an instant, and in a record whose
rows tell what is done until the next, or whose stops give way."""


class JudgedTies:
    """The ties at the rows of a record; arrays have no rows of ties where there are none.

    Attributes
    ----------
    any : bool
        Whether there are any.
    tied : Tied
        Loops and couplings.
    metric : Metric
        Kinetic sizes at the rows.
    along : (T, rows) float
        Forces of loops and couplings, along their rows.
    braking : (T, n) float
        Torques of brakes on the coordinates.
    held : (T, n) bool
        Coordinates that a brake which does not slip holds.
    latched : (T, n) bool
        Coordinates that are where a latch may hold them.
    added : (n,) float
        What a scheme of time stepping adds to the diagonal of the mass matrix.
    """

    def __init__(self, run: Any, poses: Any, metric: Metric, *, instants: bool) -> None:
        model, q = run.robot.model, run.position
        self.run, self.metric, self.tree = run, metric, poses.tree
        self.added = np.zeros(q.shape[1])
        self.tied = Tied(model, poses, q, run.velocity)
        loops = run.loop_force.reshape(len(q), 2 * len(model.loop_link))
        self.along = np.concatenate((loops, run.coupling_force), axis=1)
        self.braking = np.zeros_like(q)
        self.held = np.zeros(q.shape, dtype=bool)
        self.latched = np.zeros(q.shape, dtype=bool)
        for brake, joint in enumerate(model.brake_joint):
            self.braking[:, joint] = run.brake_torque[:, brake]
            if not np.isfinite(model.brake_limit[brake]):
                self.held[:, joint] = run.brake_torque[:, brake] != 0.0
        for joint, side in zip(model.latch_joint, model.latch_side, strict=True):
            end = model.upper[joint] if side > 0 else model.lower[joint]
            near = AT_THE_END if instants else IN_STEPS
            self.latched[:, joint] |= np.abs(q[:, joint] - end) <= near
        self.any = bool(self.along.shape[1] or len(model.brake_joint) or len(model.latch_joint))

    def force(self, jacobian: Array | None = None) -> Array:
        """Generalised force (T, n) of loops, couplings and brakes."""
        rows = self.tied.jacobian if jacobian is None else jacobian
        total: Array = np.einsum("trn,tr->tn", rows, self.along[: len(rows)])
        return total + self.braking[: len(rows)]

    def mean_force(self) -> Array:
        """The same between two rows (T - 1, n), of which the first tells the force."""
        rows = self.tied.jacobian
        return self.force(0.5 * (rows[:-1] + rows[1:]))

    def explained(self, row: int, impulse: Array, more: Array) -> Array:
        """Part (n,) of a generalised impulse that ties, and `more` rows (k, n), may have taken."""
        if not self.any and len(more) == 0:
            return np.zeros_like(impulse)
        matrix = self.metric.matrix[row : row + 1]
        change = np.linalg.solve(matrix, impulse[None, :, None])[..., 0]
        rows = np.concatenate((self._rows(row), more[None]), axis=1)
        out: Array = (matrix @ torn(rows, Metric(matrix), change)[..., None])[0, :, 0]
        return out

    def allowed(self, row: int, change: Array) -> Array:
        """What ties leave of a change (n,) of velocity."""
        if not self.any:
            return change
        metric = Metric(self.metric.matrix[row : row + 1])
        out: Array = change - torn(self._rows(row), metric, change[None])[0]
        return out

    def _rows(self, row: int) -> Array:
        """Rows (1, rows, n) of all that could take an impulse: brakes and latches, too."""
        holds = self.held[max(row - 1, 0) : row + 2].any(axis=0) | self.latched[row]
        single = np.eye(len(holds))[holds]
        out: Array = np.concatenate((self.tied.jacobian[row], single))[None]
        return out

    def switches(self) -> Array:
        """Times (s) between rows in which a brake is let go or put on."""
        time, on = self.run.time, self.run.brake_torque != 0.0
        changes = np.flatnonzero(np.any(on[1:] != on[:-1], axis=1))
        out: Array = 0.5 * (time[changes] + time[changes + 1])
        return out

    def put_back(self, q: Array, steps: Array | None = None) -> Array:
        """Positions (S, n) at the ends of some steps, or all, put back on what ties them.

        The way is the shortest by the masses; joints that a brake holds stay where they are.
        """
        steps = np.arange(len(self.held) - 1) if steps is None else steps
        if not (self.along.shape[1] or self.held.any()):
            return q
        q, left = q.copy(), np.arange(len(q))
        for _ in range(ATTEMPTS):
            poses = Poses(self.tree, q[left])
            tied = Tied(self.run.robot.model, poses, q[left])
            at = steps[left]
            stayed = q[left] - self.run.position[at]
            away = np.concatenate((tied.displacement, np.where(self.held[at], stayed, 0.0)), axis=1)
            rows = self._with_brakes(tied.jacobian, at)
            metric = Metric(poses.mass_matrix() + np.diag(self.added))
            q[left] -= torn(rows, metric, 0.0 * stayed, -away)
            left = left[np.abs(away).max(axis=1) > CLOSED]
            if len(left) == 0:
                break
        return q

    def straight(self, step: float, steps: Array) -> Array:
        """Velocities (S, n) with which positions moved in some steps before they were put back.

        They keep to the chord, ``J u + h/2 J̇ v = 0``, and lead to where the positions are.
        """
        q = self.run.position
        u: Array = (q[steps + 1] - q[steps]) / step
        if not self.along.shape[1] or len(steps) == 0:
            return u
        rows = self._with_brakes(self.tied.jacobian[steps], steps)
        before = Metric(self.metric.matrix[steps] + np.diag(self.added))
        along = np.concatenate((self.chord(step)[steps], 0.0 * u), axis=1)
        for _ in range(ATTEMPTS):
            u = u - torn(rows, before, u, along)
            missed = q[steps + 1] - self.put_back(q[steps] + step * u, steps)
            if np.abs(missed).max() < CLOSED:
                break
            u = u + missed / step
        return u

    def chord(self, step: float) -> Array:
        """What J v (T - 1, rows) is in a step of time stepping, or zero where a brake takes hold.

        The velocity that J̇ v is of ends there.
        """
        taken = self.held[:-1].copy()
        taken[1:] &= ~self.held[:-2]
        out: Array = np.where(taken.any(axis=1)[:, None], 0.0, -0.5 * step * self.tied.bias[:-1])
        return out

    def _with_brakes(self, jacobian: Array, steps: Array) -> Array:
        """Rows (S, rows + n, n) of ties and held joints; those of other joints are zero."""
        single = self.held[steps][:, :, None] * np.eye(self.held.shape[1])
        return np.concatenate((jacobian, single), axis=1)

    def judge(
        self, found: Findings, known: Array, step: float | None = None, *, exact: bool = True,
        smooth: Array | bool = True,
    ) -> None:  # fmt: skip
        """Hold the ties of a record to their laws.

        Parameters
        ----------
        found : Findings
        known : (T, n) float
            Generalised forces of all but contacts and ties.
        step : float, optional
            Of time stepping (s).
        exact : bool
            Whether its velocities are those of one step, not those of an impact within it.
        smooth : (T,) bool, optional
            Rows of smooth motion: over a bridge velocities are those of its impulses.
        """
        if not self.any:
            return
        run, tied, names = self.run, self.tied, self.run.robot.joint_names
        size = self.metric.of_velocity(run.velocity) + ROW * self.metric.of_force(known)
        found.look("ties: open", np.abs(tied.displacement), OPEN, run.time)
        against = np.einsum("trn,tn->tr", tied.jacobian, run.velocity)
        weight = np.linalg.norm(
            np.linalg.solve(self.metric.root, np.swapaxes(tied.jacobian, 1, 2)), axis=1
        )
        unit = weight * size[:, None] + 1e-6
        if step is None:
            against = np.where(np.atleast_1d(smooth)[:, None], np.abs(against) / unit, 0.0)
            found.look("ties: moves against them", against, SPEED, run.time)
        elif exact:
            after = np.einsum("trn,tn->tr", tied.jacobian[:-1], run.velocity[1:])
            chord = after - self.chord(step)
            unit = unit[:-1] + weight[:-1] * size[1:, None]
            found.look("ties: moves against them", np.abs(chord) / unit, SPEED, run.time[:-1])
        stays = self.held[:-2] & self.held[1:-1] & self.held[2:]
        way = np.where(stays, np.abs(run.position[2:] - run.position[1:-1]), 0.0)
        found.look("brake: joint moves", way, MOVED, run.time[1:-1], names)
        self._slipping(found)

    def _slipping(self, found: Findings) -> None:
        """What a brake that slips does, where its joint moves one way from row to row."""
        run, model = self.run, self.run.robot.model
        for brake, joint in enumerate(model.brake_joint):
            limit, torque = model.brake_limit[brake], run.brake_torque[:, brake]
            if not np.isfinite(limit):
                continue
            found.look("brake: limit", np.abs(torque) / limit - 1.0, LAW, run.time)
            speed = run.velocity[:, joint]
            way = np.sign(speed[:-1]) * (np.minimum(speed[:-1], speed[1:]) > MOVING)
            way += np.sign(speed[:-1]) * (np.maximum(speed[:-1], speed[1:]) < -MOVING)
            found.look("brake: drives", torque[:-1] * way / limit, LAW, run.time[:-1])
