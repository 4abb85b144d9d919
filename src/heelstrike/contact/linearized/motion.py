"""What small errors do while contacts hold, and at an impact: derivatives exact to rounding.

Between two events a robot moves under equations, those of the contact points that rest or slide, of
joints at their stops and of its loops; an impact is an equation between two velocities. Both are
linearised here from the traced kernels. With the formula of :func:`saltation_matrix` they are all
that the linearisation of a walk is made of.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.slopes import plane
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.queries.evaluation import contact_indices, joint_vector
from heelstrike.dynamics.queries.linearization import implicit_motion, solved
from heelstrike.errors import ContactProblemError, RobotError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

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


@dataclass(frozen=True, eq=False, kw_only=True)
class ImpactLinearization:
    """An impact and its derivative."""

    velocity: Floats
    """(nv,) Velocity after it."""
    reset: Floats
    """(nq + nv, nq + nv) Derivative of the state after by the state before, DΔ."""


@takes(ContactProblemError)
def linearize_contact(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    active: ActiveContacts,
    *,
    ground: Ground | None = None,
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

    Returns
    -------
    PhaseLinearization
        A, B and the rate of the state.

    Raises
    ------
    RobotError
        If a vector has the wrong length or there is no such point or joint.
    SimulationError
        If the ground is not one line.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> state = robot.reference_state()
    >>> held = hs.ActiveContacts(resting=(0, 1))
    >>> hs.linearize_contact(robot, state.q, state.v, [0.0] * robot.nu, held).A.shape
    (18, 18)
    """
    position, velocity = joint_vector(robot, "q", q), joint_vector(robot, "v", v)
    gamma = joint_vector(robot, "torque", torque)
    flow, slopes, _ = _equations(robot, _checked(robot, active), *plane(ground))
    solution, by_state, by_torque = implicit_motion(flow, slopes, position, velocity, gamma)
    n = robot.nv
    upper = np.hstack([np.zeros((robot.nq, robot.nq)), np.eye(robot.nq, n)])
    return PhaseLinearization(
        A=np.vstack([upper, by_state[:n]]),
        B=np.vstack([np.zeros((robot.nq, robot.nu)), by_torque[:n]]),
        rate=np.concatenate([velocity, solution[:n]]),
    )


@takes(ContactProblemError)
def linearize_impact(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    active: ActiveContacts,
    *,
    ground: Ground | None = None,
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

    Returns
    -------
    ImpactLinearization
        Velocity after, and derivative.

    Raises
    ------
    RobotError
        If a vector has the wrong length or there is no such point or joint.
    SimulationError
        If the ground is not one line.

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
    position, velocity = joint_vector(robot, "q", q), joint_vector(robot, "v", v)
    _, _, slopes = _equations(robot, _checked(robot, active), *plane(ground))
    n, m = robot.nv, slopes.size1_in(2)
    nothing = np.zeros(m)
    system, _, by_velocity, _ = map(np.array, slopes(position, velocity, nothing))
    constant = np.array(slopes(position, velocity, nothing)[3])
    solution = solved(system, -constant.reshape(-1, 1), n)[:, 0]
    by_position = np.array(slopes(position, velocity, solution)[1])
    after = solved(system, -np.hstack([by_position, by_velocity]), n)[:n]
    upper = np.hstack([np.eye(robot.nq), np.zeros((robot.nq, n))])
    return ImpactLinearization(velocity=solution[:n], reset=np.vstack([upper, after]))


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


@lru_cache(maxsize=64)
def _equations(
    robot: Robot, active: ActiveContacts, normal: tuple[float, float], friction: float,
    restitution: float,
) -> tuple[casadi.Function, casadi.Function, casadi.Function]:  # fmt: skip
    """Equations of motion under the contacts, their Jacobians, and those of an impact.

    The motion's are functions of (q, v, (v̇, λ), Γ) with Jacobians by (v̇, λ), (q, v) and Γ; the
    impact's of (q, v⁻, (v⁺, p)), given as Jacobians by (v⁺, p), q, v⁻ and the equations themselves.
    """
    import casadi

    from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols

    n = robot.nv
    sizes = {"q": robot.nq, "v": n, "acceleration": n, "torque": robot.nu}
    q, v, acceleration, torque = (casadi.SX.sym(name, size) for name, size in sizes.items())
    at = TracedDynamics(robot, symbols(q), symbols(v))
    rows, bias, pushes, bounces = _rows(at, active, normal, friction, restitution)
    force = casadi.SX.sym("force", rows.size1())
    motion = at.inverse_dynamics(symbols(acceleration)) - at.passive_force()
    motion[robot.model.actuator_joint] -= symbols(torque)
    moved = casadi.vertcat(expression(motion) - pushes.T @ force, rows @ acceleration + bias)
    mass = expression(at.mass_matrix())
    came = rows @ v
    # Points that are on their way up are not thrown down.
    thrown = casadi.DM(bounces) * (came < GRAZING) * came
    collided = casadi.vertcat(
        mass @ (acceleration - v) - pushes.T @ force, rows @ acceleration + thrown
    )
    unknown = casadi.vertcat(acceleration, force)
    ways = unknown, casadi.vertcat(q, v), torque
    given = casadi.SX.sym("unknown", n + rows.size1())
    arguments = [q, v, given, torque]

    def of(value: Any) -> Any:
        return casadi.densify(casadi.substitute(value, unknown, given))

    return (
        casadi.Function("motion", arguments, [of(moved)]),
        casadi.Function("slopes", arguments, [of(casadi.jacobian(moved, x)) for x in ways]),
        casadi.Function(
            "impact", arguments[:3],
            [*(of(casadi.jacobian(collided, x)) for x in (unknown, q, v)), of(collided)],
        ),
    )  # fmt: skip


def _rows(
    at: Any, active: ActiveContacts, normal: tuple[float, float], friction: float,
    restitution: float,
) -> tuple[Any, Any, Any, list[float]]:  # fmt: skip
    """Rows J of what is held, J̇v, rows along which forces act, and how much of J v⁻ comes back."""
    import casadi

    from heelstrike.dynamics.queries.symbolic import expression

    model, up = at.model, np.array(normal)
    directions = dict(active.sliding)
    rows, bias, pushes, bounces = [], [], [], []
    for i, link, center in at.contact_centers(active.points):
        radius = float(model.contact_radius[i])
        x, z, turn = at.bias_acceleration(link, center)
        two = at.zeros(2, model.nv)
        at.run(write_point_rows, model, at.work, link, center - radius * up, up, 0, two)
        rows.append(two[0])
        bias.append(up[0] * x + up[1] * z)
        bounces.append(restitution * float(model.restitution_scale[i]))
        if i in directions:
            rubbing = friction * float(model.friction_scale[i])
            pushes.append(two[0] - directions[i] * rubbing * two[1])
        else:
            rows.append(two[1])
            bias.append(up[1] * x - up[0] * z - radius * turn)
            pushes += list(two)
            bounces.append(0.0)
    for joint in active.joints:
        unit = at.zeros(model.nv)
        unit[joint] = 1.0
        rows.append(unit)
        pushes.append(unit)
        bias.append(0.0)
        bounces.append(0.0)
    if count_rows(model):
        loops = list(at.loop_jacobian())
        rows += loops
        pushes += loops
        bias += list(at.loop_bias_acceleration())
        bounces += [0.0] * len(loops)
    if not rows:
        empty = casadi.SX(0, model.nv)
        return empty, casadi.SX(0, 1), empty, bounces
    return (
        expression(np.array(rows)), casadi.vertcat(*bias), expression(np.array(pushes)), bounces,
    )  # fmt: skip
