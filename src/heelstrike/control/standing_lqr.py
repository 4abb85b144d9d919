"""The linear-quadratic regulator of a robot that stands.

While the ground holds the feet, and closed loops and couplings what they join, J δq = 0 leaves
motions δq = N y, the columns of N an orthonormal basis of the null space of J, whose rank may be
less than its rows: heel and toe of one foot hold three coordinates by four rows. About a posture at
rest, with torques that bear the weight,

    d/dt (y, ẏ) = A (y, ẏ) + B δτ,

A and B those of :func:`heelstrike.dynamics.linearize`, projected by N. Of the torques there are
more than motions: the regulator takes those of least cost, so that feet are not pressed apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array
from heelstrike.contact import ContactInverseDynamics, contact_inverse_dynamics, contact_kinematics
from heelstrike.control.arguments import must_be, numbers_of, positive, weights_of
from heelstrike.control.zero_order_hold import over_an_interval
from heelstrike.dynamics import linearize, loop_displacement, loop_jacobian
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.tolerances import STANDING_GAP

HELD = 1e-9
"""Singular values of J below this part of the largest are zero."""


class Parameters(Bundle):
    """Numbers of the law."""

    posture: Floats = array("nq")
    """Where the coordinates shall be (m, rad)."""
    feedforward: Floats = array("nu")
    """Torques that hold it there (N m)."""
    by_position: Floats = array("nu", "nv")
    by_velocity: Floats = array("nu", "nv")
    """by_position, by_velocity: Gains (N m/m, N m/rad; N s, N m s)."""


@controller
def standing_lqr(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, torque: Floats
) -> None:
    """Joint torques of the regulator."""
    for i in range(robot.nu):
        total = parameters.feedforward[i]
        for j in range(robot.nv):
            away = state.q[j] - parameters.posture[j]
            total -= parameters.by_position[i, j] * away
            total -= parameters.by_velocity[i, j] * state.v[j]
        torque[i] = total


@dataclass(frozen=True, eq=False)
class LinearStanding:
    """How a robot moves about a posture while the ground holds its feet, and its loops hold."""

    basis: Floats
    """(nv, k) N: motions of the coordinates that leave the feet where they are, and loops closed;
    orthonormal columns."""
    A: Floats
    B: Floats
    """A, B: (2 k, 2 k) and (2 k, nu) d/dt (y, ẏ) = A (y, ẏ) + B δτ."""
    torque: Floats
    """(nu,) Torques that hold the posture (N m)."""
    contacts: tuple[int, ...]
    """Contact points that hold."""


def linear_standing(robot: Robot, posture: ArrayLike) -> LinearStanding:
    """Linearise a robot that stands at rest on level ground; see above.

    Parameters
    ----------
    robot : Robot
        The robot.
    posture : (nq,) array
        Its coordinates (m, rad), with contact points on the ground z = 0; these are held.

    Returns
    -------
    LinearStanding
        Motions that the feet allow, and their equations.

    Raises
    ------
    ControllerError
        If no contact point touches the ground, the posture cannot be held there, or nothing of the
        robot can move.
    """
    from scipy.linalg import null_space

    refuse_loops(robot, "a regulator of standing", ControllerError, loops=False)
    if not robot.nu:
        raise ControllerError(f"robot {robot.name!r} has no motors, so no regulator can hold it")
    q, rest = numbers_of("posture", posture), np.zeros(robot.nv)
    if q.shape != (robot.nq,) or not np.all(np.isfinite(q)):
        raise ControllerError(f"a posture is of {robot.nq} finite numbers, got {q.tolist()}")
    _refuse_what_is_open(robot, q)
    kinematics = contact_kinematics(robot, q, rest)
    touching = tuple(int(i) for i in np.flatnonzero(np.abs(kinematics.gap) < STANDING_GAP))
    if not touching and robot.floating:
        _refuse_what_floats(robot, kinematics.gap)
    held = contact_inverse_dynamics(robot, q, rest, rest, contacts=touching)
    _refuse_what_falls(robot, held)
    jacobian = kinematics.jacobian[list(touching)].reshape(-1, robot.nv)
    jacobian = np.concatenate([jacobian, loop_jacobian(robot, q)])
    basis = null_space(jacobian, rcond=HELD) if len(jacobian) else np.eye(robot.nv)
    if not basis.shape[1]:
        raise ControllerError(f"the ground holds all of robot {robot.name!r}: nothing can move")
    linear = linearize(robot, q, rest, held.torque, contacts=touching)
    n = robot.nv
    both = np.kron(np.eye(2), basis)
    return LinearStanding(
        basis, both.T @ linear.A @ both, both.T @ linear.B[: 2 * n], held.torque, touching
    )


def _refuse_what_is_open(robot: Robot, q: Floats) -> None:
    open_by = float(np.abs(loop_displacement(robot, q)).max(initial=0.0))
    if open_by > STANDING_GAP:
        raise ControllerError(
            f"in this posture a loop or coupling of robot {robot.name!r} is open by {open_by:.3g}: "
            "take robot.closed(state).q"
        )


def _refuse_what_floats(robot: Robot, gap: Floats) -> None:
    if not robot.nc:
        raise ControllerError(f"robot {robot.name!r} has no contact points to stand on")
    side = "above" if gap.min() > 0.0 else "below"
    raise ControllerError(
        f"robot {robot.name!r} does not stand in this posture: its lowest contact point is "
        f"{abs(gap.min()):.3g} m {side} the ground. Use robot.standing(hs.Ground()).q"
    )


def _refuse_what_falls(robot: Robot, held: ContactInverseDynamics) -> None:
    if held.feasible:
        return
    strong = not np.any(held.torque_excess > 0.0)
    advice = "its centre of mass over its feet" if strong else "its joints nearer to straight"
    raise ControllerError(
        f"robot {robot.name!r} cannot rest in this posture: {held.message}. Bring {advice}"
    )


class StandingLQR(Law):
    """Stand in a posture by the linear-quadratic regulator of the robot on its feet.

    τ = τ₀ − K (y, ẏ) has the least cost ∫ δqᵀW_q δq + δq̇ᵀW_v δq̇ + δτᵀR δτ dt of all linear laws,
    for small disturbances and as long as the feet stay where they are. What y is follows from all
    coordinates but where the trunk is, so that it does not matter where the robot stands. See
    ``docs/lqr.md`` for the theory and what it cannot do.

    Parameters
    ----------
    robot : Robot
        The robot.
    posture : (nq,) array, optional
        Its coordinates (m, rad) with its feet on level ground; the reference posture by default.
    position_weight, velocity_weight : float or (nv,) array
        Diagonals of W_q and W_v, of each coordinate (1/m², 1/rad²; s²/m², s²/rad²).
    torque_weight : float or (nu,) array
        Diagonal of R, 1/(N m)².
    period : float or None
        Seconds between two calls, for which the regulator is found: torques are held meanwhile.
        None for a law that acts continuously.

    Attributes
    ----------
    linear : LinearStanding
        What the regulator was found for.
    gain : (nu, 2 k) float
        K.
    poles : (2 k,) complex
        Poles of the closed loop (1/s); with a period, logarithms of the eigenvalues of the map from
        call to call, over the period.

    Raises
    ------
    ControllerError
        If the robot cannot stand so, a weight does not fit, or the motors cannot stabilise it.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> law = hs.StandingLQR(robot)
    >>> push = hs.Push("trunk", force=(100.0, 0.0), start=0.1, duration=0.1)  # 10 N s
    >>> start = robot.reference_state()
    >>> run = hs.simulate(robot, law, state=start, duration=2.0, pushes=push)
    >>> run.completed, bool(abs(run.final_state.q[2]) < 0.01)
    (True, True)
    """

    @takes(ControllerError)
    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        position_weight: ArrayLike = 1e4,
        velocity_weight: ArrayLike = 1e3,
        torque_weight: ArrayLike = 1.0,
        period: float | None = 1e-3,
    ) -> None:
        must_be(Robot, "robot", robot)
        if period is not None:
            positive("period", period)
        q = robot.reference_state().q if posture is None else numbers_of("posture", posture)
        linear = linear_standing(robot, q)
        by_position = weights_of("position_weight", position_weight, robot.nv)
        by_velocity = weights_of("velocity_weight", velocity_weight, robot.nv)
        by_torque = weights_of("torque_weight", torque_weight, robot.nu, positive=True)
        basis = linear.basis
        k = basis.shape[1]
        cost = np.zeros((2 * k, 2 * k))
        cost[:k, :k] = basis.T @ (by_position[:, None] * basis)
        cost[k:, k:] = basis.T @ (by_velocity[:, None] * basis)
        self.gain, self.poles = _regulator(robot, linear, cost, np.diag(by_torque), period)
        self.linear = linear
        # y of what is seen: all coordinates but the trunk's place.
        seen = np.ones(robot.nv)
        slides = robot.model.axis[:, 0] == 0.0
        seen[np.setdiff1d(np.flatnonzero(slides), robot.model.actuator_joint)] = 0.0
        found = np.linalg.pinv(seen[:, None] * basis) * seen
        parameters = Parameters(
            posture=q.copy(),
            feedforward=linear.torque,
            by_position=self.gain[:, :k] @ found,
            by_velocity=self.gain[:, k:] @ found,
        )
        super().__init__(standing_lqr, parameters, robot=robot, period=period)


def _regulator(
    robot: Robot, linear: LinearStanding, cost: Floats, effort: Floats, period: float | None
) -> tuple[Floats, NDArray[np.complex128]]:
    """Gains of the regulator and poles of the closed loop."""
    from scipy.linalg import solve_continuous_are, solve_discrete_are

    A, B = linear.A, linear.B
    try:
        if period is None:
            value = solve_continuous_are(A, B, cost, effort)
            gain = np.linalg.solve(effort, B.T @ value)
            poles = np.linalg.eigvals(A - B @ gain)
        else:
            A, B = over_an_interval(A, B, period)
            value = solve_discrete_are(A, B, period * cost, period * effort)
            gain = np.linalg.solve(period * effort + B.T @ value @ B, B.T @ value @ A)
            poles = np.log(np.linalg.eigvals(A - B @ gain).astype(complex)) / period
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ControllerError(
            f"no regulator stabilises robot {robot.name!r} in this posture: its motors do not "
            f"control the fall, or the weights give it no cost ({error})"
        ) from None
    if not np.all(poles.real < 0.0):
        raise ControllerError(
            f"no regulator stabilises robot {robot.name!r} in this posture: its motors do not "
            "control the fall"
        )
    order = np.argsort(poles.real)[::-1]
    return gain, poles[order].astype(complex)
