"""A motion to start from: feet in their places, the trunk above, by inverse kinematics."""

from __future__ import annotations

import numpy as np

from heelstrike.arguments import are_numbers, shown
from heelstrike.dynamics import contact_positions, inverse_kinematics
from heelstrike.dynamics.loops import count_rows
from heelstrike.errors import GaitError, RobotError
from heelstrike.gait.motion.instant import size_of
from heelstrike.gait.motion.program import (
    STAGES,
    MotionProgram,
    beginnings,
    endings,
    gauss_points,
    phases_of,
)
from heelstrike.gait.motion.request import MotionRequest, Repeat
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State

LOWERED = 0.95
"""Height of the trunk, as a share of that on straight legs."""
BENT = 0.4
"""Angle (rad) by which joints inside a leg are bent before inverse kinematics."""
TILT = 0.25
"""Angle (rad) of a foot that stands on its heel or its toe."""
CYCLES = 2
"""Repetitions before and after a motion in which footholds are looked for."""


def guess_of(program: MotionProgram, *, lean: float = 0.0, lowered: float = LOWERED) -> Floats:
    """Return unknowns to start from."""
    from scipy.interpolate import CubicSpline  # takes long to import

    request = program.request
    durations = request.usual
    distance = _distance(request, durations)
    if request.guess is not None:
        drawn: _Drawing = _Given(request)
    elif request.repeat is Repeat.NEVER and request.start is not None and request.end is not None:
        drawn = _Between(request, durations)
    else:
        drawn = _Walking(request, durations, distance, lean, lowered)
    ends = np.cumsum(durations)
    positions, velocities, accelerations, forces = [], [], [], []
    for p, phase in enumerate(request.phases):
        start, pieces = ends[p] - durations[p], phase.pieces
        fine = np.linspace(0.0, 1.0, 2 * pieces + 3)
        path = CubicSpline(fine, [drawn.at(start + durations[p] * share, p) for share in fine])
        at = {
            grid: phases_of(grid_of(pieces))
            for grid, grid_of in (("end", endings), ("begin", beginnings), ("gauss", gauss_points))
        }
        positions.append(path(at["end"]).T)
        velocities.append(path(at["begin"], 1).T / durations[p])
        bend = path(at["gauss"], 2).T / durations[p] ** 2
        accelerations.append(bend.reshape(-1, pieces, STAGES))
        forces.append(_forces(request, p, durations))
    return program.packed(positions, velocities, accelerations, forces, durations, distance)


def _distance(request: MotionRequest, durations: Floats) -> float:
    if request.speed is not None:
        return float(request.speed * durations.sum())
    low, high = request.distance
    return float(np.clip(0.3 * size_of(request.robot), low, high))


def _forces(request: MotionRequest, p: int, durations: Floats) -> Floats:
    """The weight, shared evenly; more of it where flight goes before, (forces, N)."""
    stands, robot = request.standing[p], request.robot
    rows = 2 * robot.nc + count_rows(robot.model)
    force = np.zeros((rows, STAGES * request.phases[p].pieces))
    if stands.normal:
        supported = sum(
            d for d, each in zip(durations, request.standing, strict=True) if each.normal
        )
        share = robot.weight * durations.sum() / supported / len(stands.normal)
        force[[2 * i for i in stands.normal]] = share
    return force


class _Drawing:
    """Positions at times of a phase."""

    def at(self, time: float, phase: int) -> Floats:
        """Positions (nv,)."""
        raise NotImplementedError


class _Between(_Drawing):
    """Evenly from one position to another."""

    def __init__(self, request: MotionRequest, durations: Floats) -> None:
        assert request.start is not None
        assert request.end is not None
        self._ends, self._total = (request.start.q, request.end.q), float(durations.sum())

    def at(self, time: float, phase: int) -> Floats:
        del phase
        share = time / self._total
        share = share**2 * (3.0 - 2.0 * share)
        first, last = self._ends
        return (1.0 - share) * first + share * last


class _Given(_Drawing):
    """As whoever asks knows it."""

    def __init__(self, request: MotionRequest) -> None:
        self._request = request

    def at(self, time: float, phase: int) -> Floats:
        del phase
        request = self._request
        assert request.guess is not None
        try:
            given = request.guess(time)
        except Exception as error:
            raise GaitError(
                f"the guess function failed at {time:.3g} s: {type(error).__name__}: {error}"
            ) from error
        found = np.asarray(given if are_numbers(given) else np.nan, dtype=np.float64)
        if found.shape != (request.robot.nv,) or not np.all(np.isfinite(found)):
            raise GaitError(
                f"guess must return {request.robot.nv} finite positions, of all coordinates; at "
                f"{time:.3g} s it returned {shown(given)}"
            )
        return found


class _Walking(_Drawing):
    """The trunk moves on evenly; a foot stands where the trunk is half-way through its stance."""

    def __init__(
        self, request: MotionRequest, durations: Floats, distance: float, lean: float,
        lowered: float,
    ) -> None:  # fmt: skip
        self._request, self._lean = request, lean
        self._total = float(durations.sum())
        self._speed = distance / self._total
        self._ends = np.cumsum(durations)
        self._spells = [self._spells_of(foot) for foot in range(len(request.robot.feet))]
        robot = request.robot
        self._q = self._bent()
        q = robot.reference_state().q
        lowest = float((contact_positions(robot, q)[:, 1] - robot.model.contact_radius).min())
        self._height = float(q[1]) - lowest - (1.0 - lowered) * size_of(robot)

    def _standing(self, foot: int, step: int) -> frozenset[int]:
        """Contact points of a foot that stand in a phase, of all repetitions."""
        request = self._request
        cycle, phase = divmod(step, len(request.phases))
        points = request.standing[phase].points
        if cycle % 2 and request.repeat is Repeat.MIRRORED:
            mirror = request.robot.mirror
            assert mirror is not None
            points = frozenset(int(mirror.contact[i]) for i in points)
        return points & frozenset(request.robot.feet[foot].contacts)

    def _time(self, step: int) -> float:
        """When a phase begins, of all repetitions."""
        cycle, phase = divmod(step, len(self._ends))
        return cycle * self._total + (self._ends[phase - 1] if phase else 0.0)

    def _spells_of(self, foot: int) -> list[tuple[float, float, float]]:
        """When a foot comes down and leaves, and where it stands meanwhile."""
        count = len(self._ends)
        spells: list[tuple[float, float, float]] = []
        begin: float | None = None
        for step in range(-CYCLES * count, (CYCLES + 1) * count + 1):
            stands = bool(self._standing(foot, step))
            if stands and begin is None:
                begin = self._time(step)
            if not stands and begin is not None:
                end = self._time(step)
                spells.append((begin, end, 0.5 * self._speed * (begin + end)))
                begin = None
        if not spells:
            spells.append((-np.inf, np.inf, 0.0))
        return spells

    def _bent(self) -> Floats:
        robot = self._request.robot
        model = robot.model
        q = robot.reference_state().q.copy()
        driven = set(model.actuator_joint.tolist())
        for foot in robot.feet:
            inside = int(model.parent[foot.link]) if len(foot.contacts) > 1 else foot.link
            if inside in driven:
                for sense in (1.0, -1.0):
                    q[inside] = np.clip(
                        model.reference[inside] + sense * BENT,
                        model.lower[inside],
                        model.upper[inside],
                    )
                    if abs(q[inside] - model.reference[inside]) >= 0.5 * BENT:
                        break
        return q

    def at(self, time: float, phase: int) -> Floats:
        request, q = self._request, self._q
        along = np.array([np.cos(request.slope), np.sin(request.slope)])
        up = np.array([-along[1], along[0]])
        q[:2] = self._speed * time * along + self._height * up
        q[2] = request.robot.model.reference[2] + self._lean * request.robot.model.axis[2, 0]
        for foot in range(len(request.robot.feet)):
            x, z, tilt = self._foot(foot, time, phase)
            target = x * along + z * up
            angle = tilt - request.slope
            local, single = self._pivot(foot, phase)
            try:
                flat = np.array([*target, angle]) if not single else target
                q = inverse_kinematics(request.robot, q, foot, flat, local=local).q
            except RobotError:
                continue
        self._q = q = self._with_loops_closed(q)
        return q.copy()

    def _with_loops_closed(self, q: Floats) -> Floats:
        """Close what inverse kinematics opened; trunk and joints above the feet stay, if they can.

        Where they cannot, the legs move a little, and the optimiser brings the feet back.
        """
        robot = self._request.robot
        if not count_rows(robot.model):
            return q
        kept = {0, 1, 2}
        for foot in robot.feet:
            link = foot.link
            while link >= 0:
                kept.add(link)
                link = int(robot.model.parent[link])
        for keep in (sorted(kept), [0, 1, 2]):
            try:
                return robot.closed(State(q, np.zeros(robot.nv)), keep=keep).q
            except RobotError:
                continue
        return q

    def _pivot(self, foot: int, phase: int) -> tuple[Floats, bool]:
        """Point of a foot that is put in its place, and whether it has no other."""
        contacts = self._request.robot.feet[foot].contacts
        model = self._request.robot.model
        stands = sorted(self._standing(foot, phase)) or list(contacts)
        points = (
            model.contact_position[stands]
            - np.array([[0.0, 1.0]]) * (model.contact_radius[stands][:, None])
        )
        return points.mean(axis=0), len(contacts) == 1

    def _foot(self, foot: int, time: float, phase: int) -> tuple[float, float, float]:
        """Place along the ground and away from it, and tilt, of what :meth:`_pivot` returns."""
        contacts = self._request.robot.feet[foot].contacts
        model = self._request.robot.model
        spells = self._spells[foot]
        stands = self._standing(foot, phase)
        middle = model.contact_position[list(contacts), 0].mean()
        if stands:
            _, _, place = min(spells, key=lambda s: abs(np.clip(time, s[0], s[1]) - time))
            if len(stands) == len(contacts):
                return place, 0.0, 0.0
            offset = model.contact_position[sorted(stands), 0].mean() - middle
            return place + offset, 0.0, TILT if offset > 0.0 else -TILT
        before = [s for s in spells if s[1] <= time + 1e-12]
        after = [s for s in spells if s[0] >= time - 1e-12]
        if not before or not after:
            return self._speed * time, self._request.clearance, 0.0
        share = (time - before[-1][1]) / max(after[0][0] - before[-1][1], 1e-9)
        smooth = share**2 * (3.0 - 2.0 * share)
        place = (1.0 - smooth) * before[-1][2] + smooth * after[0][2]
        return place, 4.0 * (self._request.clearance + 0.02) * share * (1.0 - share), 0.0
