"""What small errors do while contacts hold, and at an impact: derivatives exact to rounding.

Between two events a robot moves under equations, those of the contact points that rest or slide, of
joints at their stops and of its loops; an impact is an equation between two velocities. Both are
linearised here from the kernels' tape. With the formula of :func:`saltation_matrix` they are all
that the linearisation of a walk is made of.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.partials import chosen_numbers, differentiated
from heelstrike.contact.linearized.slopes import plane
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.evaluation import contact_indices, joint_vector
from heelstrike.dynamics.queries.linearization import solved
from heelstrike.errors import ContactProblemError, RobotError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot

GRAZING = 1e-9
"""An event whose function changes more slowly than this, of unit gradient, is a graze."""


@dataclass(frozen=True, kw_only=True)
class ActiveContacts:
    """What holds a robot between two events, or takes part in an impact."""

    resting: tuple[int, ...] = ()
    """Contact points on the ground that do not slide; an impact leaves them at rest."""
    sliding: tuple[tuple[int, int], ...] = ()
    """Contact points on the ground that slide, each with the direction, 1 forward or -1; of an
    impact, those at whose end they still do."""
    joints: tuple[int, ...] = ()
    """Joints at a stop, or held by a latch."""

    @property
    def points(self) -> tuple[int, ...]:
        """All contact points on the ground, first those that rest."""
        return self.resting + tuple(point for point, _ in self.sliding)


@dataclass(frozen=True, eq=False, kw_only=True)
class PhaseLinearization:
    """d/dt (δq, δv) = A (δq, δv) + B δΓ while contacts stay as they are."""

    A: Floats
    """(nq + nv, nq + nv) Derivative of (v, v̇) by (q, v)."""
    B: Floats
    """(nq + nv, nu) Derivative by the joint torques."""
    rate: Floats
    """(nq + nv,) (v, v̇) itself."""
    by_numbers: Floats
    """(nq + nv, k) Derivative of (v, v̇) by the numbers that were asked for, the ground's friction
    last."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ImpactLinearization:
    """An impact and its derivative."""

    velocity: Floats
    """(nv,) Velocity after it."""
    reset: Floats
    """(nq + nv, nq + nv) Derivative of the state after by the state before, DΔ."""
    by_numbers: Floats
    """(nq + nv, k) Derivative of the state after by the numbers that were asked for, the ground's
    friction last."""


@takes(ContactProblemError)
def linearize_contact(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    active: ActiveContacts,
    *,
    ground: Ground | None = None,
    numbers: Sequence[str] = (),
    force: ArrayLike | None = None,
    force_by_q: ArrayLike | None = None,
) -> PhaseLinearization:
    """Linearise the motion of a robot on the ground while its contacts stay as they are.

    Beside what :func:`heelstrike.dynamics.linearize` knows: points that slide, with Coulomb's
    friction, joints at their stops, and slopes. Dry friction of joints does not act.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    torque : (nu,) array
        Joint torques.
    active : ActiveContacts
        What holds. Redundant points, such as heel and toe of one flat foot, are welcome.
    ground : Ground, optional
        Level or sloping ground; ``Ground()`` by default.
    numbers : sequence of str
        Numbers by which to differentiate too: ``"friction"`` of the ground, ``"mass"`` and others
        of the robot's :class:`~heelstrike.robot.model.Model`, all of a name.
    force, force_by_q : (nv,) and (nv, nq) array, optional
        Generalised force that acts besides, and its derivative by position; none by default.

    Returns
    -------
    PhaseLinearization
        A, B and the rate of the state.

    Raises
    ------
    RobotError
        If a vector has the wrong length or there is no such point or joint.
    SimulationError
        If the ground is not one line, or there is no such number.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> state = robot.reference_state()
    >>> held = hs.ActiveContacts(resting=(0, 1))
    >>> hs.linearize_contact(robot, state.q, state.v, [0.0] * robot.nu, held).A.shape
    (18, 18)
    """
    held = _Held(robot, q, v, active, ground, numbers)
    gamma = held.spread(joint_vector(robot, "torque", torque))
    gamma += 0.0 if force is None else np.asarray(force, np.float64)
    at, nv, nq = held.at, robot.nv, robot.nq
    at.look(ahead=1.0)
    held.find_rows()
    solution = held.solved(np.concatenate([gamma - at.balance.lacking, -held.rates()])[:, None])[
        :, 0
    ]
    force = solution[nv:]
    at.look(ahead=1.0, going=solution[:nv], acceleration=solution[:nv], **held.forces(force))
    own = at.partials
    by_state = np.hstack([held.change("q"), held.change("v")])
    besides = 0.0 if force_by_q is None else np.asarray(force_by_q, np.float64)
    lacking = np.hstack([own.lacking_by_q - besides, own.lacking_by_v])
    right = np.zeros((len(solution), by_state.shape[1] + robot.nu + held.columns))
    right[:nv, : nq + nv], right[nv:, : nq + nv] = -lacking, -by_state
    right[robot.model.actuator_joint, nq + nv + np.arange(robot.nu)] = 1.0
    right[:nv, nq + nv + robot.nu :] = held.by_numbers(own.lacking_by_numbers, force)
    found = held.solved(right)[:nv]
    A, B, by_numbers = np.split(
        np.vstack([np.zeros((nq, right.shape[1])), found]), [nq + nv, nq + nv + robot.nu], axis=1
    )
    A[:nq, nq:] = np.eye(nq, nv)
    rate = np.concatenate([at.balance.v, solution[:nv]])
    return PhaseLinearization(A=A, B=B, rate=rate, by_numbers=by_numbers)


@takes(ContactProblemError)
def linearize_impact(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    active: ActiveContacts,
    *,
    ground: Ground | None = None,
    numbers: Sequence[str] = (),
) -> ImpactLinearization:
    """Linearise an impact: the velocity after it, and the derivative of the state after it.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State just before.
    active : ActiveContacts
        What receives impulses. What was on the ground and comes off is not among them.
    ground : Ground, optional
        Level or sloping ground; ``Ground()`` by default. Points bounce by its restitution if they
        come down, joints do not.
    numbers : sequence of str
        Numbers by which to differentiate too, as of :func:`linearize_contact`.

    Returns
    -------
    ImpactLinearization
        Velocity after, and derivative.

    Raises
    ------
    RobotError
        If a vector has the wrong length or there is no such point or joint.
    SimulationError
        If the ground is not one line, or there is no such number.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> state = robot.reference_state()
    >>> struck = hs.ActiveContacts(resting=(0, 1))
    >>> impact = hs.linearize_impact(robot, state.q, state.v - 0.1, struck)
    >>> still = hs.contact_kinematics(robot, state.q, impact.velocity).velocity[:2]
    >>> bool(abs(still).max() < 1e-12)
    True
    """
    held = _Held(robot, q, v, active, ground, numbers)
    at, nv, nq = held.at, robot.nv, robot.nq
    v_before = at.balance.v
    at.look(ahead=0.0, going=v_before)
    held.find_rows()
    came = held.rates()
    # Points that are on their way up are not thrown down.
    back = held.bounces * (came < GRAZING)
    resting = {name: value.copy() for name, value in at.partials.members().items()}
    before = held.change("q")
    momentum = at.balance.matrix @ v_before
    solution = held.solved(np.concatenate([momentum, -back * came])[:, None])[:, 0]
    after, force = solution[:nv], solution[nv:]
    at.look(ahead=0.0, going=after, acceleration=after - v_before, **held.forces(force))
    right = np.zeros((len(solution), nq + nv + held.columns))
    right[:nv, :nq] = resting["lacking_by_q"] - at.partials.lacking_by_q
    right[nv:, :nq] = -held.change("q") - back[:, None] * before
    right[:nv, nq : nq + nv] = at.balance.matrix
    right[nv:, nq : nq + nv] = -back[:, None] * held.rows
    numbers_alone = at.partials.lacking_by_numbers - resting["lacking_by_numbers"]
    right[:nv, nq + nv :] = held.by_numbers(numbers_alone, force)
    found = held.solved(right)[:nv]
    reset, by_numbers = np.split(np.vstack([np.eye(nq, right.shape[1]), found]), [nq + nv], axis=1)
    return ImpactLinearization(velocity=after, reset=reset, by_numbers=by_numbers)


@takes(ContactProblemError)
def saltation_matrix(
    reset: ArrayLike, gradient: ArrayLike, before: ArrayLike, after: ArrayLike
) -> Floats:
    """Saltation matrix of an event: what a small error before it is just after it.

    S = DΔ + (f⁺ − DΔ f⁻) ∇gᵀ / (∇g · f⁻): a disturbed motion meets the event earlier or later, and
    spends the difference under the other rate. The monodromy matrix of a hybrid motion is the
    product of its flows' and its events' matrices (M. A. Aizerman, F. R. Gantmakher, *On the
    stability of periodic motions*, 1958; R. I. Leine, H. Nijmeijer, *Dynamics and bifurcations of
    non-smooth mechanical systems*, 2004).

    Parameters
    ----------
    reset : (n, n) array
        Derivative DΔ of the state after by the state before; the identity where nothing jumps.
    gradient : (n,) array
        Derivative ∇g of the function whose zero is the event.
    before, after : (n,) array
        Rates f⁻ and f⁺ of the state just before and just after.

    Returns
    -------
    (n, n) float
        The matrix.

    Raises
    ------
    SimulationError
        If shapes do not fit, or the motion only grazes the event, ∇g · f⁻ = 0: errors then have no
        derivative.

    Examples
    --------
    A ball falls on the ground at 2 m/s under 10 m/s² and bounces by e = 0.5:

    >>> import numpy as np
    >>> from heelstrike import saltation_matrix
    >>> saltation_matrix(np.diag([1.0, -0.5]), [1.0, 0.0], [-2.0, -10.0], [1.0, -10.0])
    array([[-0.5,  0. ],
           [ 7.5, -0.5]])
    """
    jump, normal = np.asarray(reset, np.float64), np.asarray(gradient, np.float64)
    f, g = np.asarray(before, np.float64), np.asarray(after, np.float64)
    if jump.shape != (normal.size, normal.size) or not f.shape == g.shape == normal.shape:
        raise SimulationError(
            f"a saltation matrix needs a square reset and vectors of its size; got shapes "
            f"{jump.shape}, {normal.shape}, {f.shape} and {g.shape}"
        )
    crossing = float(normal @ f)
    if not abs(crossing) > GRAZING * float(np.linalg.norm(normal)):
        raise SimulationError(
            f"the motion only grazes the event, whose function changes by {crossing:.3g} a "
            "second: errors have no derivative there"
        )
    matrix: Floats = jump + np.outer(g - jump @ f, normal) / crossing
    return matrix


def _checked(robot: Robot, active: ActiveContacts) -> ActiveContacts:
    """Return contacts whose points and joints there are."""
    contact_indices(robot, active.points)
    if any(not 0 <= joint < robot.nv for joint in active.joints):
        raise RobotError(
            f"robot {robot.name!r} has joints 0 to {robot.nv - 1}, not {list(active.joints)}"
        )
    return active


class _Held:
    """Equations of a robot under contacts: rows J of what is held, and rows P of its forces.

    They differ where a point slides: its friction acts with its normal force.
    """

    def __init__(
        self, robot: Robot, q: ArrayLike, v: ArrayLike, active: ActiveContacts,
        ground: Ground | None, numbers: Sequence[str],
    ) -> None:  # fmt: skip
        normal, friction, restitution = plane(ground)
        position, velocity = joint_vector(robot, "q", q), joint_vector(robot, "v", v)
        self._robot, self._active = robot, _checked(robot, active)
        dynamic, self._rubs = chosen_numbers(numbers)
        self.at = differentiated(robot.model, dynamic)
        self.at.place(position, velocity, normal)
        self.columns = self.at.partials.lacking_by_numbers.shape[1] + self._rubs
        model = robot.model
        self._scale = model.friction_scale
        self._way = {point: -way * friction * self._scale[point] for point, way in active.sliding}
        self._points = [
            row
            for point in dict.fromkeys(active.points)
            for row in ((2 * point,) if point in self._way else (2 * point, 2 * point + 1))
        ]
        ends = len(self._points), len(active.joints), count_rows(model)
        self._split = np.cumsum(ends)
        back = restitution * model.restitution_scale
        self.bounces = np.zeros(sum(ends))
        self.bounces[: ends[0]] = [back[row // 2] * (row % 2 == 0) for row in self._points]

    def find_rows(self) -> None:
        """Take the rows of what is held from where the equations are looked at."""
        rows, loops = self.at.balance.rows, self.at.loops.jacobian
        joints = np.eye(self._robot.nv)[list(self._active.joints)]
        self.rows = np.vstack([rows[self._points], joints, loops])
        pushes = self.rows.copy()
        for place, row in enumerate(self._points):
            pushes[place] += self._way.get(row // 2, 0.0) * rows[row // 2 * 2 + 1]
        n, m = self._robot.nv, len(self.rows)
        self._system = np.zeros((n + m, n + m))
        self._system[:n, :n], self._system[:n, n:] = self.at.balance.matrix, -pushes.T
        self._system[n:, :n] = self.rows

    def spread(self, torque: Floats) -> Floats:
        """Return generalised forces of torques."""
        force = np.zeros(self._robot.nv)
        force[self._robot.model.actuator_joint] = torque
        return force

    def rates(self) -> Floats:
        """How what is held goes: s."""
        balance, joints = self.at.balance, list(self._active.joints)
        still = balance.going[joints] if balance.ahead[0] == 0.0 else np.zeros(len(joints))
        return np.concatenate([balance.along[self._points], still, balance.loop_along])

    def change(self, x: str) -> Floats:
        """Derivative of s by q or v, but for what x is in it."""
        partials = self.at.partials
        along, loops = getattr(partials, f"along_by_{x}"), getattr(partials, f"loop_along_by_{x}")
        joints = np.zeros((len(self._active.joints), along.shape[1]))
        return np.vstack([along[self._points], joints, loops])

    def forces(self, found: Floats) -> dict[str, Floats]:
        """Return what holds, by points and loops."""
        push = np.zeros((self._robot.nc, 2))
        for row, force in zip(self._points, found, strict=False):
            push[divmod(row, 2)] = force
            if row // 2 in self._way:
                push[row // 2, 1] = self._way[row // 2] * force
        return {"push": push, "pull": found[self._split[1] :]}

    def by_numbers(self, lacking: Floats, found: Floats) -> Floats:
        """Force by numbers of the robot, then by the ground's friction."""
        friction = np.zeros((self._robot.nv, int(self._rubs)))
        ways = dict(self._active.sliding)
        for row, force in zip(self._points, found, strict=False):
            if self._rubs and row // 2 in ways:
                along = -ways[row // 2] * self._scale[row // 2] * force
                friction[:, 0] += along * self.at.balance.rows[row + 1]
        return np.hstack([-lacking, friction])

    def solved(self, right: Floats) -> Floats:
        """Solve for accelerations or velocities, then forces."""
        return solved(self._system, right, self._robot.nv)
