"""Starting points for the optimiser: steps drawn by inverse kinematics, in a fixed order."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import casadi
import numpy as np

from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.symbolic import TracedDynamics, symbols
from heelstrike.field_texts import dataclass
from heelstrike.gait.request import Request
from heelstrike.gait.sole import leg
from heelstrike.robot.model import Floats

HEIGHTS = (0.97, 0.92, 0.85)
"""Heights of the trunk over the ground, as a share of what straight legs would allow."""
LEANS = (0.0, 0.1)
"""Pitches of the trunk (rad)."""
BENT = 0.5
"""Angle (rad) by which joints inside a leg are bent before inverse kinematics."""
TYPICAL_DURATION = 2.2
"""Step duration in units of sqrt(height / gravity) where none is given."""
TYPICAL_LENGTH = 0.3
"""Step length in standing heights where none is given."""
SWEEPS = 60
START_DAMPING = 1e-4
MET = 1e-9
"""Distance (m, rad) within which a place counts as reached."""
OUT_OF_REACH = 1e-4
"""Distance (m, rad) beyond which it cannot be reached: damping leaves less, stops leave more."""
WEIGHT_OF_TRUNK = 0.1
"""Weight of the trunk's place next to those of the feet, where both cannot be reached."""


@dataclass(frozen=True)
class Start:
    """A step to start from: the parabola through three postures."""

    begin: Floats
    middle: Floats
    end: Floats
    """begin, middle, end: (n,) Positions of the coordinates that the stance foot leaves free, at
    the beginning, in the middle and at the end of the step."""
    duration: float
    length: float
    """duration, length: Duration (s) and length (m) of the step."""

    def motion(self, phases: Floats) -> tuple[Floats, Floats, Floats]:
        """Positions, velocities and accelerations at phases of the step, (n, N) each."""
        begin, middle, end = (part[:, None] for part in (self.begin, self.middle, self.end))
        bow = 4.0 * (middle - 0.5 * (begin + end))
        position = begin + phases * (end - begin) + phases * (1.0 - phases) * bow
        velocity = (end - begin + (1.0 - 2.0 * phases) * bow) / self.duration
        return position, velocity, (0.0 * phases - 2.0) * bow / self.duration**2


def starts(request: Request) -> Iterator[Start]:
    """Steps to start from, the most promising ones first.

    Each goes from the mirror image of a posture with both feet on the ground, through one with the
    swing foot passing the stance foot, to that posture.
    """
    length, duration = typical_step(request)
    free = [*range(request.stance.held, 3), *request.drive.driven]
    kinematics = _Kinematics(request)
    cosine, sine = np.cos(request.slope), np.sin(request.slope)
    bends = (1.0, -1.0) if kinematics.bend_is_free else (1.0,)
    for bend, lean, height in product(bends, LEANS, HEIGHTS):
        legs = height * request.height
        low = float(np.sqrt(max(legs**2 - (0.5 * length) ** 2, (0.5 * legs) ** 2)))
        lift = request.clearance + 0.02 * request.height
        foot = (length * cosine, length * sine + request.rise)
        end = kinematics.posture(foot, (0.5 * foot[0], low + 0.5 * foot[1], lean), bend)
        middle = kinematics.posture((-lift * sine, lift * cosine), (0.0, legs, lean), bend)
        begin = request.mirror.position(end)
        yield Start(begin[free], middle[free], end[free], duration, length)


def typical_step(request: Request) -> tuple[float, float]:
    """Length and duration to start from; as given, or as usual for the robot's size."""
    length, duration = request.step_length, request.step_duration
    usual = TYPICAL_DURATION * request.pendulum_time
    if request.speed is not None:
        # Fast walkers take steps that are both longer and quicker.
        length = float(np.sqrt(TYPICAL_LENGTH * request.height * request.speed * usual))
        duration = length / request.speed
    length = TYPICAL_LENGTH * request.height if length is None else length
    duration = usual if duration is None else duration
    return (
        float(np.clip(length, *request.length_bounds)),
        float(np.clip(duration, *request.duration_bounds)),
    )


class _Kinematics:
    """Postures with both feet and the trunk in given places, as nearly as the robot can."""

    def __init__(self, request: Request) -> None:
        robot = request.robot
        self._request = request
        q = casadi.SX.sym("q", robot.nv)
        dynamics = TracedDynamics(robot, symbols(q))
        places = []
        for foot in (request.stance, request.swing):
            x, z = dynamics.point_position(foot.link, foot.point)
            turned = dynamics.work.angle[foot.link] - foot.angle
            below = foot.radius * np.array([-np.sin(request.slope), np.cos(request.slope)])
            places += [x - below[0], z - below[1], turned + request.slope][: foot.held]
        places += [*dynamics.work.origin[2], dynamics.work.angle[2]]
        places += [*dynamics.loop_displacement()]
        places_vector = casadi.vertcat(*places)
        self._places = casadi.Function(
            "places", [q], [places_vector, casadi.jacobian(places_vector, q)]
        )
        self._inside: list[int] = []  # hinges between hip and foot, or to a foot that is a point
        for foot in (request.stance, request.swing):
            hinges = [j for j in leg(robot, foot) if robot.model.axis[j, 0] != 0.0]
            self._inside += hinges[1 if foot.flat else 0 : -1]

    @property
    def bend_is_free(self) -> bool:
        """Whether a joint inside a leg may bend both ways from the reference configuration."""
        asked, reference = self._request, self._request.robot.model.reference
        free = (asked.lower < reference - BENT) & (asked.upper > reference + BENT)
        return bool(free[self._inside].any())

    def posture(
        self, swing: tuple[float, float], trunk: tuple[float, float, float], bend: float
    ) -> Floats:
        """Position with the stance foot at the origin, (nv,).

        Parameters
        ----------
        swing : tuple of 2 float
            Place (x, z) of the swing foot; a flat one is level.
        trunk : tuple of 3 float
            Place (x, z) and pitch of the trunk.
        bend : float
            Sense (+1, -1) in which joints inside a leg are bent at first if they may both ways.
        """
        level = [0.0][: self._request.stance.held - 2]  # a flat foot's angle
        closed = [0.0] * count_rows(self._request.robot.model)
        target = np.array([0.0, 0.0, *level, *swing, *level, *trunk, *closed])
        q, missing = self._nearest(self._bent(bend), target, np.ones(target.size))
        if np.abs(missing).max() < OUT_OF_REACH:
            return q
        # Feet in their places are worth more than the trunk's: it may have to lean where hips
        # cannot bend backwards.
        weights = np.ones(target.size)
        last = target.size - len(closed)
        weights[last - len(trunk) : last] = WEIGHT_OF_TRUNK
        return self._nearest(self._bent(bend), target, weights)[0]

    def _nearest(self, q: Floats, target: Floats, weights: Floats) -> tuple[Floats, Floats]:
        """Position in range nearest to targets, (nv,), and what is missing of each."""
        lower, upper = self._request.lower, self._request.upper
        for _ in range(SWEEPS):
            value, jacobian = (np.array(part) for part in self._places(q))
            missing = target - value.ravel()
            if np.abs(missing).max() < MET:
                break
            slopes = weights[:, None] * jacobian
            free = np.full(q.size, True)
            for _ in range(q.size):
                rows = np.where(free, slopes, 0.0)
                normal = rows.T @ rows + START_DAMPING * np.eye(q.size)
                step = np.linalg.solve(normal, rows.T @ (weights * missing))
                held = free & (((q <= lower) & (step < 0.0)) | ((q >= upper) & (step > 0.0)))
                if not held.any():
                    break
                free &= ~held
            q = self._in_range(q + step / max(1.0, np.abs(step).max() / BENT))
        return q, target - np.array(self._places(q)[0]).ravel()

    def _bent(self, bend: float) -> Floats:
        """Reference configuration with the joints inside the legs bent, in range."""
        model = self._request.robot.model
        q = self._in_range(model.reference)
        for j in self._inside:
            for sense in (bend, -bend):  # the other one where a stop is in the way
                q[j] = model.reference[j] + sense * BENT * model.axis[j, 0]
                q = self._in_range(q)
                if abs(q[j] - model.reference[j]) >= 0.5 * BENT:
                    break
        return q

    def _in_range(self, q: Floats) -> Floats:
        return np.clip(q, self._request.lower, self._request.upper)
