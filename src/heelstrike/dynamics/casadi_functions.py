"""The queries as CasADi functions, for a user's own optimisation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.evaluation import contact_indices, link_index, plane_vector
from heelstrike.dynamics.symbolic import TracedDynamics, expression, symbols
from heelstrike.robot.robot import Robot


class CasadiDynamics:
    """CasADi functions of a robot's dynamics, exact and differentiable any number of times.

    Every method returns a `casadi.Function` with named inputs and outputs. They are traced from the
    kernels that the simulator runs and mean what the functions of the same name in
    :mod:`heelstrike.dynamics` mean, with the same units, frames and orders. Vectors are columns;
    ``q``, ``v``, ``acceleration`` and ``force`` have nv entries, ``torque`` has nu.

    Parameters
    ----------
    robot : Robot
        The robot whose numbers enter the functions.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike import dynamics
    >>> robot = hs.load_robot("bravo7")
    >>> dynamics.CasadiDynamics(robot).forward_dynamics().name_in()
    ['q', 'v', 'force']
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._q = casadi.SX.sym("q", robot.nv)
        self._v = casadi.SX.sym("v", robot.nv)
        self._traced = TracedDynamics(robot, symbols(self._q), symbols(self._v))

    def mass_matrix(self) -> casadi.Function:
        """Return (q) → mass matrix, (nv, nv)."""
        return self._of_q("mass_matrix", self._traced.mass_matrix())

    def bias_force(self) -> casadi.Function:
        """Return (q, v) → bias force H, (nv,)."""
        return self._of_state("bias_force", self._traced.bias_force())

    def gravity_force(self) -> casadi.Function:
        """Return (q) → gravitational part of the bias force, (nv,)."""
        return self._of_q("gravity_force", self._traced.gravity_force())

    def coriolis_force(self) -> casadi.Function:
        """Return (q, v) → centrifugal and Coriolis part of the bias force, (nv,)."""
        return self._of_state("coriolis_force", self._traced.coriolis_force())

    def passive_force(self) -> casadi.Function:
        """Return (q, v) → force of dampers and springs, (nv,)."""
        return self._of_state("passive_force", self._traced.passive_force())

    def inverse_dynamics(self) -> casadi.Function:
        """Return (q, v, acceleration) → generalised force, (nv,)."""
        a = casadi.SX.sym("acceleration", self.robot.nv)
        force = expression(self._traced.inverse_dynamics(symbols(a)))
        return self._function("inverse_dynamics", {"acceleration": a}, force)

    def forward_dynamics(self) -> casadi.Function:
        """Return (q, v, force) → acceleration without contact, (nv,)."""
        force = casadi.SX.sym("force", self.robot.nv)
        acceleration = expression(self._traced.forward_dynamics(symbols(force)))
        return self._function("forward_dynamics", {"force": force}, acceleration)

    def state_derivative(self) -> casadi.Function:
        """Return (state, torque) → d/dt (q, v) without contact, (nq + nv,).

        The state is (q; v) in one column; motors, dampers and springs act.
        """
        torque = casadi.SX.sym("torque", self.robot.nu)
        force = self._traced.passive_force()
        for place, joint in enumerate(self.robot.model.actuator_joint):
            force[joint] = force[joint] + torque[place]
        rate = casadi.vertcat(self._v, expression(self._traced.forward_dynamics(force)))
        state = casadi.vertcat(self._q, self._v)
        x = casadi.SX.sym("state", state.numel())
        rate = casadi.substitute(rate, state, x)
        return casadi.Function(
            "state_derivative", [x, torque], [rate], ["state", "torque"], ["state_derivative"]
        )

    def linearization(self) -> casadi.Function:
        """Return (state, torque) → (A, B), the derivatives of :meth:`state_derivative`."""
        x = casadi.SX.sym("state", 2 * self.robot.nv)
        torque = casadi.SX.sym("torque", self.robot.nu)
        rate = self.state_derivative()(x, torque)
        parts = [casadi.jacobian(rate, x), casadi.jacobian(rate, torque)]
        return casadi.Function("linearization", [x, torque], parts, ["state", "torque"], ["A", "B"])

    def link_poses(self) -> casadi.Function:
        """Return (q) → origin (nv, 2) and angle (nv,) of all link frames."""
        work: Any = self._traced.work
        return casadi.Function(
            "link_poses",
            [self._q],
            [casadi.SX(expression(work.origin)), casadi.SX(expression(work.angle))],
            ["q"],
            ["origin", "angle"],
        )

    def point_position(self, link: int | str, local: ArrayLike) -> casadi.Function:
        """Return (q) → world position of a point of a link, (2,)."""
        return self._of_q("point_position", self._point(link, local)[1])

    def point_velocity(self, link: int | str, local: ArrayLike) -> casadi.Function:
        """Return (q, v) → velocity (x, z) of a point and its link's rotation, (3,)."""
        jacobian = self._traced.point_jacobian(*self._point(link, local))
        return self._of_state("point_velocity", jacobian @ self._traced.v)

    def point_jacobian(self, link: int | str, local: ArrayLike) -> casadi.Function:
        """Return (q) → rows (x, z, rotation) of the Jacobian of a point, (3, nv)."""
        jacobian = self._traced.point_jacobian(*self._point(link, local))
        return self._of_q("point_jacobian", jacobian)

    def point_bias_acceleration(self, link: int | str, local: ArrayLike) -> casadi.Function:
        """Return (q, v) → J̇v of :meth:`point_jacobian`, (3,)."""
        bias = self._traced.point_bias_acceleration(*self._point(link, local))
        return self._of_state("point_bias_acceleration", bias)

    def center_of_mass(self) -> casadi.Function:
        """Return (q) → world position of the robot's centre of mass, (2,)."""
        return self._of_q("center_of_mass", self._traced.center_of_mass())

    def center_of_mass_jacobian(self) -> casadi.Function:
        """Return (q) → Jacobian of the robot's centre of mass, (2, nv)."""
        rows = self._traced.momentum_matrix()[:2] / self.robot.total_mass
        return self._of_q("center_of_mass_jacobian", rows)

    def momentum(self) -> casadi.Function:
        """Return (q, v) → momentum (x, z) and moment of momentum about the centre of mass, (3,)."""
        return self._of_state("momentum", self._traced.momentum())

    def momentum_matrix(self) -> casadi.Function:
        """Return (q) → centroidal momentum matrix, (3, nv)."""
        return self._of_q("momentum_matrix", self._traced.momentum_matrix())

    def kinetic_energy(self) -> casadi.Function:
        """Return (q, v) → kinetic energy, J."""
        return self._of_state("kinetic_energy", self._traced.energies()[0])

    def potential_energy(self) -> casadi.Function:
        """Return (q) → potential energy, J."""
        return self._of_q("potential_energy", self._traced.energies()[1])

    def contact_jacobian(self, contacts: Iterable[int | str] | None = None) -> casadi.Function:
        """Return (q) → rows n₀ t₀ n₁ t₁ … of contact points on level ground, (2k, nv).

        All contact points of the robot by default.
        """
        rows = self._traced.contact_jacobian(self._contacts(contacts))
        return self._of_q("contact_jacobian", rows)

    def contact_bias_acceleration(
        self, contacts: Iterable[int | str] | None = None
    ) -> casadi.Function:
        """Return (q, v) → J̇v of :meth:`contact_jacobian`, (2k,)."""
        bias = self._traced.contact_bias_acceleration(self._contacts(contacts))
        return self._of_state("contact_bias_acceleration", bias)

    def contact_equations(self, contacts: Iterable[int | str] | None = None) -> casadi.Function:
        """Return (q, v, acceleration, contact_force, torque) → residual, (nv + 2k,).

        Forward and inverse dynamics with held contact points as one set of equations, to be made
        zero: A v̇ + H − passive − SᵀΓ − Jᵀλ, and J v̇ + J̇v. Whatever is unknown of them, and whatever
        inequality the forces obey, is the user's choice; redundant points do no harm. The contact
        force is n₀ t₀ n₁ t₁ …, in N, on the robot.
        """
        held = self._contacts(contacts)
        a = casadi.SX.sym("acceleration", self.robot.nv)
        force = casadi.SX.sym("contact_force", 2 * len(held))
        torque = casadi.SX.sym("torque", self.robot.nu)
        residual = contact_equations(self.robot, held, self._q, self._v, a, force, torque)
        extra = {"acceleration": a, "contact_force": force, "torque": torque}
        return self._function("contact_equations", extra, residual)

    def contact_forward_dynamics(
        self, contacts: Iterable[int | str] | None = None
    ) -> casadi.Function:
        """Return (q, v, torque) → acceleration (nv,) and contact_force (2k,), points held.

        The points must be independent: two of one flat foot make the equations singular, and
        :meth:`contact_equations` is what to use then.
        """
        held = self._contacts(contacts)
        n, k = self.robot.nv, 2 * len(held)
        unknown = casadi.SX.sym("unknown", n + k)
        torque = casadi.SX.sym("torque", self.robot.nu)
        residual = contact_equations(
            self.robot, held, self._q, self._v, unknown[:n], unknown[n:], torque
        )
        matrix = casadi.jacobian(residual, unknown)
        constant = casadi.substitute(residual, unknown, casadi.SX.zeros(n + k))
        parts = casadi.Function("parts", [self._q, self._v, torque], [matrix, constant])
        q, v, tau = (
            casadi.MX.sym(name, size)
            for name, size in (("q", n), ("v", n), ("torque", self.robot.nu))
        )
        system, right = parts(q, v, tau)
        solution = casadi.solve(system, -right)
        return casadi.Function(
            "contact_forward_dynamics",
            [q, v, tau],
            [solution[:n], solution[n:]],
            ["q", "v", "torque"],
            ["acceleration", "contact_force"],
        )

    def _contacts(self, contacts: Iterable[int | str] | None) -> tuple[int, ...]:
        every = range(self.robot.nc)
        return contact_indices(self.robot, every if contacts is None else contacts)

    def _point(self, link: int | str, local: ArrayLike) -> tuple[int, Any]:
        place = link_index(self.robot, link)
        return place, self._traced.point_position(place, plane_vector("local", local))

    def _of_q(self, name: str, value: Any) -> casadi.Function:
        return casadi.Function(name, [self._q], [_sx(value)], ["q"], [name])

    def _of_state(self, name: str, value: Any) -> casadi.Function:
        return self._function(name, {}, _sx(value))

    def _function(self, name: str, extra: dict[str, Any], value: Any) -> casadi.Function:
        inputs = {"q": self._q, "v": self._v, **extra}
        output = "residual" if name == "contact_equations" else name
        return casadi.Function(name, [*inputs.values()], [value], [*inputs], [output])


def contact_equations(
    robot: Robot,
    contacts: tuple[int, ...],
    q: casadi.SX,
    v: casadi.SX,
    acceleration: casadi.SX,
    contact_force: casadi.SX,
    torque: casadi.SX,
) -> casadi.SX:
    """Residual of the equations of motion and of the contact points that the ground holds."""
    dynamics = TracedDynamics(robot, symbols(q), symbols(v))
    force = dynamics.inverse_dynamics(symbols(acceleration)) - dynamics.passive_force()
    for place, joint in enumerate(robot.model.actuator_joint):
        force[joint] = force[joint] - torque[place]
    if not contacts:
        return casadi.SX(expression(force))
    jacobian = dynamics.contact_jacobian(contacts)
    force = force - jacobian.T @ symbols(contact_force)
    held = jacobian @ symbols(acceleration) + dynamics.contact_bias_acceleration(contacts)
    return casadi.vertcat(expression(force), expression(held))


def _sx(value: Any) -> casadi.SX:
    """CasADi expression of an object array or a scalar; structural zeros stay sparse."""
    return casadi.SX(expression(value)) if isinstance(value, np.ndarray) else casadi.SX(value)
