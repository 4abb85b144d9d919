"""The laws of event-driven runs, re-derived row by row and impulse by impulse from the record.

Rows are instants of a continuous motion with the contact forces of that very instant; velocities
jump between two rows of one time, by impulses that stand in the events. Promised is:

- balance: between rows the velocity changes by ``∫ M⁻¹ (Γ + passive + pushes − H + Jᵀf) dt``, at a
  jump by ``M⁻¹ Jᵀp``. The integral runs over the polynomial through up to four neighbouring rows
  of the same smooth piece; how much the last row changed it is what it is trusted to.
- motion: the position changes by the integral of the velocity (Hermite's rule, with the
  accelerations at both ends), and not at all at a jump.
- contact law at each row: no penetration; forces within the friction cone, only where the ground
  is touched and not left, friction against the sliding; no point on the ground accelerates into
  it, and none that sticks breaks loose below the limit of its friction. Stops and dry joints alike.
- impact law at each jump: Newton's restitution on the normal velocity, Coulomb's cone on the
  impulses, friction against the sliding that is left.
- bridge law: over the time of a bridge the robot moves freely, its impulses act at its beginning.
  At its end no contact on the ground approaches it, those that were pressed do not leave but by
  restitution, cone and opposition hold with the velocities there, and it has made no energy. How
  far it says that it may be wrong is allowed for. Bridges are counted, and their time.
- energy: the work of motors, dampers, pushes, friction and stops explains its change; an impact
  never makes any, except by Newton's restitution with friction, where the run has to say so.

Velocities count in kinetic sizes relative to ``|v|`` and what the known forces do in a millisecond,
forces relative to the size of the known forces. What happens within an interval in which a push
begins or ends has no row; such intervals are left out and counted. So are those that end in a jam,
before which forces grow without bound (Painlevé's paradox), as 1/t: of these it is asked that they
make no energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.sim import EventKind
from scenes.findings import Findings
from scenes.mechanics import generalised, rates
from scenes.record import Rows, excess_over_cone, friction_that_does_not_oppose

Array = NDArray[Any]

BALANCE = 1e-4
"""Velocity that nothing explains over an interval, relative to that at its ends and what the known
forces do in it. The integration is a thousand times finer, rows of 1 ms hardly are."""
JUMP = 1e-6
"""The same of an impact."""
LAW = 1e-6
"""Contact laws, relative to the size of their data."""
TOUCH = 1e-8
"""Gap (m, rad) up to which a contact or stop is on its limit."""
MOVING = 1e-9
"""Speed (m/s, rad/s) below which nothing slides or leaves."""
CLOSED, RESTING = 1e-13, 1e-10
"""Gap and speed up to which a point is held on the ground, and not in a bounce too small to see."""
DEPTH = 1e-7
"""Penetration (m, rad)."""
MOTION = 1e-6
"""Change of position (m, rad) that the velocity does not explain."""
ENERGY = 1e-4
"""Energy that nothing explains over a run, relative to the greatest that is in it."""
GAIN = 1e-8
"""Energy that an impact makes without saying so, relative to what there is."""
IN_CORNER = 1e-9
"""Distance (m) from a second face up to which a force may be that of both faces of a corner."""
TOGETHER = 5e-11
"""Gap (m) up to which a point takes part in an impact elsewhere."""
ROW = 1e-3
"""What the known forces do in this time (s) is a velocity to reckon with, even at rest."""
BRIEF = 1e-8
"""What is left of bounces shorter than this (s) may be lost: of each that comes to rest, what the
known forces do in it."""
INSTANT = 1e-14
"""Rows and events closer than this (s) are of one time."""
SAME = 4.0 * float(np.finfo(float).eps)
"""Rows and events closer than this part of their time are of one instant of the simulator, too."""
EDGE = 1e-12
"""An event this near (s) to where a push begins or ends happens there."""

POLE = 0.1
"""Time left before a jam, as a part of an interval that leads to it, below which its forces have
grown so far that rows of the interval do not tell their integral."""

IMPULSIVE = (EventKind.TOUCHDOWN, EventKind.IMPACT, EventKind.PAINLEVE)


def judge_events(run: Any, start: Any = None) -> Findings:
    """Judge an event-driven run.

    Parameters
    ----------
    run : heelstrike.sim.Run
        Its record.
    start : State, optional
        Where it began, before any impact of the first instant.
    """
    found = Findings()
    rows = Rows(run, corners=IN_CORNER, instants=True)
    rows.geometry(found)
    found.figures["penetration"] = float(max(np.max(-rows.gap, initial=0.0), 0.0))
    if len(rows.time):
        EventRows(rows, start).judge(found)
    return found


class EventRows:
    """The rows of an event-driven run by instants, and the laws that hold at and between them."""

    def __init__(self, rows: Rows, start: Any) -> None:
        self.rows, self.start = rows, start
        time, run = rows.time, rows.run
        edges = [edge for one in run.pushes for edge in (one.start, one.end)]
        self.edges = np.sort(np.concatenate((edges, rows.ties.switches())))
        # One time after the other: first and last row of each instant.
        new = np.concatenate(([True], np.diff(time) > INSTANT))
        self.first = np.flatnonzero(new)
        self.last = np.concatenate((self.first[1:] - 1, [len(time) - 1]))
        self.instant = time[self.first]
        self.settled = np.isin(np.arange(len(time)), self.last)
        """Rows that show what follows their instant, not what went before."""
        # Where a push begins or ends at the instant of an event, its last row shows what follows.
        events = np.array([event.time for event in run.events])
        met = _distance(time, events) <= INSTANT
        follows = (met & self.settled)[:, None]
        # Without an event nobody knows which side of such an instant its row shows.
        edge = np.abs(time[:, None] - self.edges).min(axis=1, initial=np.inf) <= INSTANT
        self.settled &= met | ~edge
        begins = np.array([one.start for one in run.pushes])
        ends = np.array([one.end for one in run.pushes])
        at = time[:, None]
        acts = np.where(
            follows, (begins <= at) & (at < ends), (begins < at) & (at <= ends)
        )  # fmt: skip
        self.pushed = rows.push(acts.astype(float))
        self.known = rows.smooth + self.pushed
        self.acceleration = rows.metric.accelerated(self.known + rows.contact_force())
        self.force_size = np.maximum(rows.metric.of_force(self.known), 1e-300)
        self.speed_size = rows.metric.of_velocity(rows.v) + ROW * self.force_size
        self.bridges: dict[int, tuple[float, float]] = {}
        """Length of each bridge and how far it may be wrong, by the instant at which it begins."""
        for event in run.events:
            if event.kind is EventKind.BRIDGE:
                self.bridges[self.at(event.time)] = event.impulse
        self.jams = {
            self.at(event.time)
            for event in run.events
            if event.kind is EventKind.PAINLEVE and event.impulse[0] > 0.0
        }
        """Instants in which forces have grown without bound."""
        self.poles = self.jams | self.close_to(self.jams)
        """Those and the instants just before them, in which forces have grown nearly as far."""
        self.smooth = ~np.isin(np.arange(len(time)), self.last[list(self.bridges)])
        """Rows of smooth phases: those at the beginning of bridges have no contact forces."""
        self.settled &= self.smooth
        ahead = np.append(np.diff(self.instant), 1.0)
        self.ahead = np.repeat(ahead, self.last - self.first + 1)
        """Time from a row to the next instant."""
        count = self.last - self.first + 1
        self.next = np.repeat(np.append(self.first[1:], len(time) - 1), count)
        """First row of the next instant."""
        calm = ~self.eventful() | (count > 1)
        self.goes_on = np.repeat(np.append(calm[1:], False), count)
        """Whether that row shows what went before it, and not what an event has made of it."""

    def at(self, time: float) -> int:
        """Instant nearest to a time."""
        after = int(np.searchsorted(self.instant, time))
        near = range(max(after - 1, 0), min(after + 1, len(self.instant)))
        return min(near, key=lambda k: abs(self.instant[k] - time))

    def close_to(self, jams: set[int]) -> set[int]:
        """Instants of other events almost at a jam, each of which ends an interval as it does.

        Forces grow as 1/t, t being the time left. Where little of that is left at the end of an
        interval, its rows do not tell their integral, nor do those of what follows up to the jam.
        """
        span = np.diff(self.instant, prepend=self.instant[0])
        found: set[int] = set()
        for jam in jams:
            left = self.instant[jam] - self.instant[:jam]
            poles = np.flatnonzero(left < POLE * span[:jam])
            found |= set(range(poles[0], jam)) if len(poles) else set()
        return found

    def judge(self, found: Findings) -> None:
        self.rows_in_order(found)
        self.rows.ties.judge(found, self.known, smooth=self.smooth)
        self.forces(found)
        self.impacts(found)
        self.intervals(found)
        found.figures["bridges"] = len(self.bridges)
        found.figures["time on bridges"] = sum(length for length, _ in self.bridges.values())

    def rows_in_order(self, found: Findings) -> None:
        back = np.maximum(-np.diff(self.rows.time), 0.0)
        found.look("time runs back", back, 0.0, self.rows.time)

    # --- Forces at the rows --------------------------------------------------------------------

    def forces(self, found: Findings) -> None:
        rows, size = self.rows, self.force_size[:, None]
        time, names = rows.time, rows.contacts
        if names:
            weight = np.maximum(rows.metric.weight(rows.jacobian), 1e-300)
            unit = size / weight[..., 0]
            speed_unit = weight * self.speed_size[:, None, None] + 1e-9
            pressed = rows.force[..., 0] / unit
            found.look("penetration", -rows.gap, DEPTH, time, names)
            apart = np.minimum(np.abs(rows.gap) / TOUCH * LAW, pressed)
            found.look("contact: force without touch", apart, LAW, time, names)
            leaving = np.minimum(np.abs(rows.speed[..., 0]) / speed_unit[..., 0], pressed)
            # Both faces of a corner have a cone and a speed: their resultant obeys neither.
            one_face = ~rows.cornered
            found.look(
                "contact: force while it leaves or enters",
                np.where(one_face, leaving, 0.0),
                LAW,
                time,
                names,
            )
            cone = excess_over_cone(rows.force, rows.high) / (size / weight[..., 1])
            found.look("friction cone", np.where(one_face, cone, 0.0), LAW, time, names)
            slip = rows.speed[..., 1]
            slides = np.where(np.abs(slip) > MOVING, slip, 0.0)
            wrong = friction_that_does_not_oppose(
                rows.force, slides, rows.low, rows.high, size / weight[..., 1], speed_unit[..., 1]
            )
            found.look("friction opposes", np.where(one_face, wrong, 0.0), LAW, time, names)
            recorded = np.abs(rows.run.slip_velocity - slip) / speed_unit[..., 1]
            recorded = np.where(pressed > LAW, recorded, 0.0)
            found.look("recorded slip", recorded, LAW, time, names)
            self.accelerations(found, weight)
        self.joints(found)

    def accelerations(self, found: Findings, weight: Array) -> None:
        """No point on the ground may accelerate into it, or slide off below its friction limit."""
        rows = self.rows
        rate = rates(rows.jacobian, self.acceleration) + rows.bias_acceleration()
        unit = weight * self.force_size[:, None, None]
        bias = np.abs(rows.bias_acceleration())
        unit = unit + bias
        still = np.abs(rows.speed) < RESTING
        # At a corner a point, or a disc too small, has no acceleration of its gap to speak of.
        plain = ~rows.measured.at_corner & (rows.measured.tied.sum(axis=-1) == 1)
        plain = plain & ~rows.cornered
        on = (np.abs(rows.gap) < CLOSED) & still[..., 0] & plain & self.settled[:, None]
        into = np.where(on & self.seen(-rate[..., 0]), -rate[..., 0] / unit[..., 0], 0.0)
        found.look("contact: acceleration into it", into, LAW, rows.time, rows.contacts)
        pressed = rows.force[..., 0] * weight[..., 0] / self.force_size[:, None]
        both = np.minimum(np.abs(rate[..., 0]) / unit[..., 0], pressed)
        both = np.where(on, both, 0.0)
        found.look("contact: force while it lifts", both, LAW, rows.time, rows.contacts)
        limit = rows.low * rows.force[..., 0] - np.abs(rows.force[..., 1])
        slack = limit * weight[..., 1] / self.force_size[:, None]
        loose = np.minimum(np.abs(rate[..., 1]) / unit[..., 1], slack)
        loose = np.where(on & still[..., 1] & (pressed > LAW), loose, 0.0)
        found.look("sticking point slides off", loose, LAW, rows.time, rows.contacts)

    def seen(self, into: Array) -> Array:
        """Whether an acceleration (T, p) into a limit lasts long enough to lead anywhere.

        At the height of a bounce too small to see, a point as near to the ground as if it were held
        on it falls freely. One that leaves under a force that vanishes may do so a moment early:
        with an acceleration that changes evenly from a to a' over a time T it is deepest at its
        end, or at ``t = 2 T a / (a − a')``, by ``t² (a / 2 + (a' − a) t / 6 T)``.
        """
        change = np.where(self.goes_on[:, None], into[self.next] - into, 0.0)
        ahead = self.ahead[:, None]
        turns = np.divide(-2.0 * into, change, where=change < 0.0, out=np.ones_like(into))
        part = np.clip(turns, 0.0, 1.0)
        return (part * ahead) ** 2 * (into / 2.0 + change * part / 6.0) > CLOSED

    def joints(self, found: Findings) -> None:
        rows, model, run = self.rows, self.rows.model, self.rows.run
        weight = rows.metric.joint_weight()
        size = self.force_size[:, None]
        time, names = rows.time, rows.joints
        speed = np.abs(rows.v) / (weight * self.speed_size[:, None] + 1e-9)
        stop = np.where(rows.ties.latched, 0.0, run.stop_torque * weight / size)
        for side, limit, name in ((1.0, model.lower, "lower"), (-1.0, model.upper, "upper")):
            gap = side * (rows.q - limit)
            found.look(f"{name} stop: beyond it", np.nan_to_num(-gap), DEPTH, time, names)
            pressed = np.maximum(side * stop, 0.0)
            apart = np.minimum(np.nan_to_num(np.abs(gap), posinf=1e9) / TOUCH * LAW, pressed)
            found.look(f"{name} stop: force without touch", apart, LAW, time, names)
            moving = np.minimum(speed, pressed)
            found.look(f"{name} stop: force while it moves", moving, LAW, time, names)
            on = (np.abs(gap) < CLOSED) & (np.abs(rows.v) < RESTING) & self.settled[:, None]
            into = -side * self.acceleration / (weight * size)
            into = np.where(on & self.seen(-side * self.acceleration), into, 0.0)
            found.look(f"{name} stop: acceleration into it", into, LAW, time, names)
        dry, most = run.friction_torque, model.dry_friction
        over = (np.abs(dry) - most) * weight / size
        found.look("dry friction: limit", over, LAW, time, names)
        lacks = np.abs(dry + most * np.sign(rows.v)) * weight / size
        # Over a bridge the mean of it is recorded.
        lacks = np.where((np.abs(rows.v) > MOVING) & self.smooth[:, None], lacks, 0.0)
        found.look("dry friction: opposes", np.minimum(lacks, speed), LAW, time, names)
        slack = (most - np.abs(dry)) * weight / size
        loose = np.minimum(np.abs(self.acceleration) / (weight * size), slack)
        held = (np.abs(rows.v) < RESTING) & (most > 0.0) & self.settled[:, None]
        found.look("dry friction: holds", np.where(held, loose, 0.0), LAW, time, names)

    # --- Impacts -------------------------------------------------------------------------------

    def impulses(self) -> tuple[dict[int, Array], dict[int, Array], dict[int, int], set[int]]:
        """Impulses on contacts and joints by the instant in which they act.

        Also how many there are on the busiest contact, and where energy is said to be made.
        """
        contact: dict[int, Array] = {}
        joint: dict[int, Array] = {}
        most: dict[int, int] = {}
        gains: set[int] = set()
        seen: dict[tuple[int, int, int], int] = {}
        for event in self.rows.run.events:
            k = self.at(event.time)
            if event.kind is EventKind.ENERGY_GAIN:
                gains.add(k)
            stop = event.kind is EventKind.JOINT_STOP
            if event.impulse == (0.0, 0.0) or not (stop or event.kind in IMPULSIVE):
                continue
            key = (k, int(stop), event.contact)
            seen[key] = seen.get(key, 0) + 1
            most[k] = max(most.get(k, 0), seen[key])
            if stop:
                model, q = self.rows.model, self.rows.q[self.first[k], event.contact]
                low, high = model.lower[event.contact], model.upper[event.contact]
                side = 1.0 if abs(q - low) < abs(q - high) else -1.0
                joint.setdefault(k, np.zeros(self.rows.tree.size))[event.contact] += (
                    side * event.impulse[0]
                )
            else:
                contact.setdefault(k, np.zeros((len(self.rows.contacts), 2)))[event.contact] += (
                    self.in_first_frame(k, event)
                )
        return contact, joint, most, gains

    def in_first_frame(self, k: int, event: Any) -> Array:
        """Impulse of an event in the frame of the first of the rows that are one instant here.

        It is told in that of the first row of its own instant: events told apart by rounding are
        together here.
        """
        rows, low, high = self.rows, self.first[k], self.last[k]
        same = np.abs(rows.time[low : high + 1] - event.time) <= SAME * max(event.time, 1e-3)
        row = low + int(np.argmax(same))
        x, z = rows.normal[row, event.contact]
        to_x, to_z = rows.normal[low, event.contact]
        along, across = event.impulse
        force = np.array([along * x + across * z, along * z - across * x])
        return np.array([force @ (to_x, to_z), force @ (to_z, -to_x)])

    def impacts(self, found: Findings) -> None:
        """Jumps between rows of one time, and impulses that have no row before them."""
        rows = self.rows
        contact, joint, most, gains = self.impulses()
        self.kick: dict[int, Array] = {}
        n, points = rows.tree.size, len(rows.contacts)
        found.figures["impacts"] = len(set(contact) | set(joint))
        found.figures["energy gains named"] = len(gains)
        for k, (a, b) in enumerate(zip(self.first, self.last, strict=True)):
            p = contact.get(k, np.zeros((points, 2)))
            s = joint.get(k, np.zeros(n))
            kicked = generalised(rows.acting[a : a + 1], p[None])[0] + s
            before, q_before = rows.v[a], rows.q[a]
            if a == b:
                if not (k == 0 and self.start is not None):
                    self.kick[k] = kicked
                    continue
                before, q_before = self.start.v, self.start.q
            after = rows.v[b]
            time = rows.time[a : a + 1]
            leap = np.abs(rows.q[b] - q_before) / (1.0 + np.abs(q_before))
            found.look("teleport", leap[None], MOTION, time, rows.joints)
            one = slice(a, a + 1)
            matrix = rows.matrix[a]
            size = _size(matrix, before) + _size(matrix, after) + ROW * self.force_size[a]
            left = matrix @ (after - before) - kicked
            left -= rows.ties.explained(a, left, self.couples(k, p))
            unexplained = rows.metric_of(one).of_force(left[None])
            unexplained -= BRIEF * self.force_size[a] * self.resting(b)
            found.look("balance of an impact", unexplained / size, JUMP, time)
            if k in self.bridges:
                self.bridge_law(found, k, one, p, size)
                continue
            gained = 0.5 * (after @ matrix @ after - before @ matrix @ before)
            if k not in gains:
                found.look("impact makes energy", np.array([gained / size**2]), GAIN, time)
            if most.get(k, 0) == 1 and b - a <= 1:
                self.impact_law(found, one, p, s, before, after, size)

    def resting(self, row: int) -> int:
        """How many contact points and stops are at rest on their limits."""
        rows, model = self.rows, self.rows.model
        near = np.minimum(rows.q[row] - model.lower, model.upper - rows.q[row])
        points = (rows.gap[row] <= TOGETHER) & (np.abs(rows.speed[row, :, 0]) <= RESTING)
        stops = (near <= TOGETHER) & (np.abs(rows.v[row]) <= RESTING)
        return int(points.sum() + stops.sum())

    def cornered(self, k: int) -> Array:
        """Which points may be hit by both faces of a corner in an instant.

        On a bridge these are also those that come to the second face by its end.
        """
        row, cornered = self.first[k], self.rows.cornered
        if k not in self.bridges:
            return cornered[row]
        end = self.end_of(k)
        return cornered[row] | cornered[self.first[end] : self.last[end] + 1].any(axis=0)

    def end_of(self, k: int) -> int:
        """Instant at which the bridge that begins at instant k ends."""
        return self.at(self.instant[k] + self.bridges[k][0])

    def couples(self, k: int, p: Array) -> Array:
        """Rows (c, n) of the couples that discs in corners may feel in an instant.

        An event has the resultant of both faces, and not the moment of friction on the other one.
        """
        rows = self.rows
        discs = self.cornered(k) & (rows.model.contact_radius > 0.0) & np.any(p != 0.0, axis=1)
        out: Array = rows.tree.turn[np.unique(rows.model.contact_link[discs])]
        return out

    def bridge_law(self, found: Findings, k: int, one: slice, p: Array, size: float) -> None:
        """What holds at the end of the bridge that begins at instant k."""
        rows, (length, wrong) = self.rows, self.bridges[k]
        end, time = self.end_of(k), rows.time[one]
        apart = abs(self.instant[end] - self.instant[k] - length)
        found.look("bridge: row at its end", np.array([apart]), INSTANT, time)
        begin, last, after = self.first[k], self.last[k], self.first[end]
        kinetic, potential = rows.energy()
        gained = kinetic[after] + potential[after] - kinetic[begin] - potential[begin]
        force = self.pushed[last] - rows.model.damping * rows.v[last]
        force[rows.model.actuator_joint] += rows.run.torque[last]
        work = length * float(force @ rows.v[last])
        # Forces go on to act for the length; what they do in it is small of second order.
        slack = 0.5 * size * (length * self.force_size[last]) + size * wrong
        found.look("bridge makes energy", np.array([(gained - work - slack) / size**2]), GAIN, time)
        if not rows.contacts:
            return
        weight = np.maximum(rows.metric_of(one).weight(rows.jacobian[one]), 1e-300)
        unit, names = size / weight, rows.contacts
        came = rates(rows.jacobian[one], rows.v[begin][None])
        went = rates(rows.jacobian[after : after + 1], rows.v[after][None])
        pressed = p[None, :, 0] / unit[..., 0]
        high, low = rows.high[one], rows.low[one]
        # The ground turns under the robot, and gaps close at leisure, in this time.
        slow = wrong + length * self.force_size[last]
        loose = weight * (size * LAW + slow)
        on = (rows.gap[one] <= TOGETHER) & (rows.gap[after : after + 1] <= TOGETHER)
        into = np.where(on, -went[..., 0] / loose[..., 0], 0.0)
        found.look("bridge: speed into the ground", into, 1.0, time, names)
        bounce = rows.measured.restitution[one] * np.maximum(-came[..., 0], 0.0)
        off = np.maximum(went[..., 0] - bounce, 0.0) / loose[..., 0]
        one_face = ~self.cornered(k)[None]
        off = np.where(on & one_face & (pressed > LAW), off, 0.0)
        found.look("bridge: pressed and leaves", off, 1.0, time, names)
        cone = np.where(one_face, excess_over_cone(p[None], high) / unit[..., 1], 0.0)
        found.look("bridge: cone", cone, LAW, time, names)
        slides = np.where(np.abs(went[..., 1]) > loose[..., 1], went[..., 1], 0.0)
        wrong_way = friction_that_does_not_oppose(
            p[None], slides, low, high, unit[..., 1], weight[..., 1] * size
        )
        found.look("bridge: friction opposes", np.where(one_face, wrong_way, 0.0), LAW, time, names)

    def impact_law(
        self, found: Findings, one: slice, p: Array, s: Array, before: Array, after: Array,
        size: float,
    ) -> None:  # fmt: skip
        rows, time, names = self.rows, self.rows.time[one], self.rows.contacts
        metric = rows.metric_of(one)
        if names:
            weight = np.maximum(metric.weight(rows.jacobian[one]), 1e-300)
            came = rates(rows.jacobian[one], before[None])
            went = rates(rows.jacobian[one], after[None])
            unit = size / weight
            one_face = ~rows.cornered[one]
            on = (rows.gap[one] <= TOGETHER) & (came[..., 0] <= MOVING)
            bounce = rows.measured.restitution[one] * np.minimum(came[..., 0], 0.0)
            # Bounces too short to follow are plastic: their limit is computed instead.
            brief = np.abs(bounce) < 1e-2
            least = np.where(brief, np.minimum(-bounce, 0.0), -bounce)
            over = went[..., 0] - least
            pressed = p[None, :, 0] / unit[..., 0]
            into = np.where(on, -over / (weight[..., 0] * size), 0.0)
            found.look("impact: speed into it", into, LAW, time, names)
            off = np.minimum(
                np.where(brief, np.maximum(np.abs(over) + bounce, 0.0), np.abs(over))
                / (weight[..., 0] * size),
                pressed,
            )
            off = np.where(one_face, off, 0.0)
            found.look("impact: other speed than restitution gives", off, LAW, time, names)
            apart = np.minimum(np.abs(rows.gap[one]) / TOUCH * LAW, pressed)
            found.look("impact: without touch", apart, LAW, time, names)
            high, low = rows.high[one], rows.low[one]
            cone = np.where(one_face, excess_over_cone(p[None], high) / unit[..., 1], 0.0)
            found.look("impact: cone", cone, LAW, time, names)
            wrong = friction_that_does_not_oppose(
                p[None], went[..., 1], low, high, unit[..., 1], weight[..., 1] * size
            )
            found.look("impact: friction opposes", np.where(one_face, wrong, 0.0), LAW, time, names)
        weight = metric.joint_weight()
        pressed = np.abs(s)[None] * weight / size
        moving = np.minimum(np.abs(after)[None] / (weight * size), pressed)
        found.look("impact: stop gives way", moving, LAW, time, rows.joints)

    # --- Between the rows ----------------------------------------------------------------------

    def intervals(self, found: Findings) -> None:
        """Integrate forces, velocities and power from instant to instant."""
        rows, n = self.rows, self.rows.tree.size
        kinetic, potential = rows.energy()
        energy = kinetic + potential
        power = self.power()
        values = np.column_stack((self.acceleration, power))
        eventful = self.eventful()
        momentum, motion, work, times = [], [], [], []
        left_out = 0
        found.figures["jams"] = len(self.jams)
        total = 0.0
        for k in range(len(self.instant) - 1):
            a, b = self.last[k], self.first[k + 1]
            begin, end = self.instant[k], self.instant[k + 1]
            span = end - begin
            if k + 1 in self.poles:
                if k not in self.bridges:  # of a bridge that ends in one its own law asks that
                    self.jam(found, k, energy)
                continue
            if np.any((self.edges > begin - INSTANT) & (self.edges < end + INSTANT)):
                left_out += 1
                continue
            usable = self.piece(k, eventful)
            if len(usable) == 0:
                left_out += 1
                continue
            integral, doubt = _integrate(rows.time[usable], values[usable], begin, end)
            kick = self.kick.get(k + 1)
            jump = np.zeros(n)
            if kick is not None and np.any(kick):
                jump = rows.ties.allowed(b, np.linalg.solve(rows.matrix[b], kick))
            change = rows.v[b] - rows.v[a] - jump
            matrix = rows.matrix[a]
            forced = span * (self.force_size[a] + self.force_size[b])
            size = _size(matrix, rows.v[a]) + _size(matrix, rows.v[b]) + forced + 1e-12
            wrong = _size(matrix, change - integral[:n])
            trust = 2.0 * _size(matrix, doubt[:n])
            momentum.append(max(wrong - trust, 0.0) / size)
            # Where it comes to from its velocity at the beginning, as the forces bend it.
            bent, doubt_q = _integrate(
                rows.time[usable], values[usable, :n], begin, end, twice=True
            )
            leap = np.abs(rows.q[b] - rows.q[a] - span * rows.v[a] - bent)
            leap -= 2.0 * doubt_q + span * np.abs(change - integral[:n])
            if k in self.bridges:
                leap -= self.bridges[k][1]
            motion.append(np.maximum(leap, 0.0) / (1.0 + np.abs(rows.q[b])))
            after = rows.v[b] - jump
            gained = energy[b] - energy[a]
            if kick is not None and np.any(kick):
                gained -= 0.5 * float(kick @ (rows.v[b] + after))
            missing = gained - integral[n]
            total += np.sign(missing) * max(abs(missing) - 2.0 * abs(doubt[n]), 0.0)
            work.append(abs(total))
            times.append(begin)
        found.figures["intervals left out"] = left_out
        if not times:
            return
        at = np.array(times)
        found.look("balance", np.array(momentum), BALANCE, at)
        found.look("teleport between rows", np.array(motion), MOTION, at, rows.joints)
        top = max(float(kinetic.max()), float(np.ptp(potential)), 1e-9)
        found.look("energy", np.array(work) / top, ENERGY, at)

    def jam(self, found: Findings, k: int, energy: Array) -> None:
        """No more energy behind a jam than before it, but for the work of the known forces."""
        a, b = self.last[k], self.last[k + 1]
        span, size = (
            self.instant[k + 1] - self.instant[k],
            _size(self.rows.matrix[a], self.rows.v[a]),
        )
        size += ROW * self.force_size[a]
        work = span * (abs(self.free_power[a]) + abs(self.free_power[b]))
        # What is as near as that to the ground is put on it.
        model = self.rows.model
        work += float(np.sum(model.mass)) * float(np.linalg.norm(model.gravity)) * TOGETHER
        made = (energy[b] - energy[a] - work) / size**2
        found.look("jam makes energy", np.array([made]), GAIN, self.instant[k : k + 1])

    def power(self) -> Array:
        """Power of motors, dampers, pushes, contacts, stops and dry friction, (T,)."""
        rows, model, run = self.rows, self.rows.model, self.rows.run
        force = self.pushed - model.damping * rows.v
        force[:, model.actuator_joint] += run.torque
        self.free_power = np.sum(force * rows.v, axis=1)
        """Power of motors, dampers and pushes alone."""
        power: Array = self.free_power + np.sum(rows.contact_force() * rows.v, axis=1)
        return power

    def eventful(self) -> Array:
        """Whether contact modes may have changed at each instant."""
        changes = np.zeros(len(self.instant), dtype=bool)
        changes |= self.first != self.last
        for k, (length, _) in self.bridges.items():
            changes |= np.abs(self.instant - self.instant[k] - length) <= INSTANT
        for event in self.rows.run.events:
            if event.kind is EventKind.ZENO:  # says when the bounces would have ended: it rests
                continue
            near = self.at(event.time)
            if abs(self.instant[near] - event.time) <= INSTANT:
                changes[near] = True
            elif not np.any(np.abs(self.edges - event.time) <= EDGE):
                # It has no row of its own, as at the edges of pushes: nothing may be integrated
                # across it.
                changes |= np.abs(self.instant - event.time) < 2e-3
        return changes

    def piece(self, k: int, eventful: Array) -> Array:
        """Up to four rows with forces of the smooth piece that holds the interval after instant k.

        After an event only the last row of an instant shows what follows; before one, the first
        does only if there are two.
        """
        low = k
        while low > 0 and k - low < 2 and not eventful[low] and not self._edge(low - 1):
            low -= 1
        high = k + 1
        end = len(self.instant) - 1
        while high < end and high - low < 3 and not eventful[high] and not self._edge(high):
            high += 1
        while low > 0 and high - low < 3 and not eventful[low] and not self._edge(low - 1):
            low -= 1
        usable = [int(self.last[i]) for i in range(low, high)]
        # In the row before an event modes may be those after it, so that it counts if need be only.
        two = self.first[high] != self.last[high]
        if high not in self.poles and (not eventful[high] or (two and len(usable) < 3)):
            usable.append(int(self.first[high]))
        return np.array(usable)

    def _edge(self, k: int) -> bool:
        """Whether a push begins or ends between instants k and k + 1."""
        begin, end = self.instant[k] - INSTANT, self.instant[k + 1] + INSTANT
        return bool(np.any((self.edges > begin) & (self.edges < end)))


def _distance(time: Array, others: Array) -> Array:
    """Distance of each time from the nearest of others, which are in order; infinite without."""
    among = np.concatenate(([-np.inf], others, [np.inf]))
    after = np.searchsorted(among, time).clip(1)
    return np.minimum(among[after] - time, time - among[after - 1])


def _size(matrix: Array, v: Array) -> float:
    return float(np.sqrt(max(v @ matrix @ v, 0.0)))


def _weights(time: Array, begin: float, end: float, twice: bool) -> Array:
    """Weights of values at some times in the integral of the polynomial through them.

    Or in that of its integral, if it is to be integrated twice.
    """
    unit = max(end - begin, float(np.max(np.abs(time - begin))))
    part = (end - begin) / unit
    powers = np.arange(len(time))
    moments = unit * part ** (powers + 1.0) / (powers + 1.0)
    if twice:
        moments *= unit * part / (powers + 2.0)
    return np.linalg.solve(np.vander((time - begin) / unit, increasing=True).T, moments)


def _integrate(
    time: Array, values: Array, begin: float, end: float, *, twice: bool = False
) -> tuple[Array, Array]:
    """Integral of a polynomial through rows, and what the row farthest away does to it."""
    integral = _weights(time, begin, end, twice) @ values
    if len(time) == 1:
        return integral, np.abs(integral)
    near = np.sort(np.argsort(np.abs(time - 0.5 * (begin + end)))[:-1])
    fewer = _weights(time[near], begin, end, twice) @ values[near]
    return integral, np.abs(integral - fewer)
