"""The queries as CasADi functions, for a user's own optimisation."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from typing import Any, Concatenate, ParamSpec

import casadi
import numpy as np
from numpy.typing import ArrayLike

from heelstrike import dynamics
from heelstrike.dynamics.queries.evaluation import contact_indices
from heelstrike.dynamics.queries.query import VECTORS, Query, docstring
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.robot.robot import Robot

P = ParamSpec("P")


def _function_of(
    query: Query[P, Any],
) -> Callable[Concatenate[CasadiDynamics, P], casadi.Function]:
    """Make the method that returns a query as a function of symbols; it takes the other arguments.

    Points and frames that the query tells apart become rows below each other.
    """
    asked: Any = query
    names = [name for name in inspect.signature(asked).parameters if name in VECTORS]

    def method(self: CasadiDynamics, /, *others: Any, **named: Any) -> casadi.Function:
        inputs = {name: self._symbol(name) for name in names}
        more = [symbols(value) for name, value in inputs.items() if name not in ("q", "v")]
        value = asked.at(self._traced, *more, *others, **named)
        return self._function(asked.__name__, inputs, _sx(value))

    signature = inspect.signature(asked.at)
    others = {k: one for k, one in signature.parameters.items() if k not in ("at", *VECTORS)}
    itself = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
    method.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[itself, *others.values()], return_annotation="casadi.Function"
    )
    method.__name__, method.__qualname__ = asked.__name__, f"CasadiDynamics.{asked.__name__}"
    summary = (asked.__doc__ or "").split("\n\nParameters")[0]
    meaning = f"Of ({', '.join(names)}), it is a {asked.returns}"
    method.__doc__ = docstring(summary, others, "casadi.Function", meaning)
    return method


def _function_with(
    query: Query[[ArrayLike], Any],
) -> Callable[[CasadiDynamics], casadi.Function]:
    """Do the same with a query whose other argument is a vector, and so an input."""
    method: Any = _function_of(query)
    made: Callable[[CasadiDynamics], casadi.Function] = method
    return made


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
        self._q, self._v = self._symbol("q"), self._symbol("v")
        self._traced = TracedDynamics(robot, symbols(self._q), symbols(self._v))

    mass_matrix = _function_of(dynamics.mass_matrix)
    bias_force = _function_of(dynamics.bias_force)
    gravity_force = _function_of(dynamics.gravity_force)
    coriolis_force = _function_of(dynamics.coriolis_force)
    passive_force = _function_of(dynamics.passive_force)
    applied_force = _function_with(dynamics.applied_force)
    inverse_dynamics = _function_with(dynamics.inverse_dynamics)
    forward_dynamics = _function_with(dynamics.forward_dynamics)
    point_position = _function_of(dynamics.point_position)
    point_velocity = _function_of(dynamics.point_velocity)
    point_jacobian = _function_of(dynamics.point_jacobian)
    point_bias_acceleration = _function_of(dynamics.point_bias_acceleration)
    center_of_mass = _function_of(dynamics.center_of_mass)
    center_of_mass_jacobian = _function_of(dynamics.center_of_mass_jacobian)
    center_of_mass_velocity = _function_of(dynamics.center_of_mass_velocity)
    center_of_mass_bias_acceleration = _function_of(dynamics.center_of_mass_bias_acceleration)
    momentum = _function_of(dynamics.momentum)
    angular_momentum = _function_of(dynamics.angular_momentum)
    momentum_matrix = _function_of(dynamics.momentum_matrix)
    kinetic_energy = _function_of(dynamics.kinetic_energy)
    potential_energy = _function_of(dynamics.potential_energy)
    contact_jacobian = _function_of(dynamics.contact_jacobian)
    contact_bias_acceleration = _function_of(dynamics.contact_bias_acceleration)

    def state_derivative(self) -> casadi.Function:
        """Return (state, torque) → d/dt (q, v) without contact, (nq + nv,).

        The state is (q; v) in one column; motors, dampers and springs act.
        """
        torque = self._symbol("torque")
        force = self._traced.applied_force(symbols(torque))
        rate = casadi.vertcat(self._v, expression(self._traced.forward_dynamics(force)))
        state = casadi.vertcat(self._q, self._v)
        x = casadi.SX.sym("state", state.numel())
        rate = casadi.substitute(rate, state, x)
        return casadi.Function(
            "state_derivative", [x, torque], [rate], ["state", "torque"], ["state_derivative"]
        )

    def linearization(self) -> casadi.Function:
        """Return (state, torque) → (A, B), the derivatives of :meth:`state_derivative`."""
        x = casadi.SX.sym("state", self.robot.nq + self.robot.nv)
        torque = self._symbol("torque")
        rate = self.state_derivative()(x, torque)
        parts = [casadi.jacobian(rate, x), casadi.jacobian(rate, torque)]
        return casadi.Function("linearization", [x, torque], parts, ["state", "torque"], ["A", "B"])

    def link_poses(self) -> casadi.Function:
        """Return (q) → origin (nl, 2) and angle (nl,) of all link frames."""
        work: Any = self._traced.work
        return casadi.Function(
            "link_poses",
            [self._q],
            [casadi.SX(expression(work.origin)), casadi.SX(expression(work.angle))],
            ["q"],
            ["origin", "angle"],
        )

    def contact_equations(self, contacts: Iterable[int | str] | None = None) -> casadi.Function:
        """Return (q, v, acceleration, contact_force, torque) → residual, (nv + 2k,).

        Forward and inverse dynamics with held contact points as one set of equations, to be made
        zero: A v̇ + H − passive − SᵀΓ − Jᵀλ, and J v̇ + J̇v. Whatever is unknown of them, and whatever
        inequality the forces obey, is the user's choice; redundant points do no harm. The contact
        force is n₀ t₀ n₁ t₁ …, in N, on the robot.

        Parameters
        ----------
        contacts : iterable of int or str, optional
            Contact points, all k = nc by default.

        Returns
        -------
        casadi.Function
            Of the inputs above, (nv + 2k,).
        """
        held = self._contacts(contacts)
        inputs = {name: self._symbol(name) for name in ("q", "v", "acceleration")}
        inputs["contact_force"] = casadi.SX.sym("contact_force", 2 * len(held))
        inputs["torque"] = self._symbol("torque")
        residual = contact_equations(self.robot, held, *inputs.values())
        return self._function("contact_equations", inputs, residual, output="residual")

    def contact_forward_dynamics(
        self, contacts: Iterable[int | str] | None = None
    ) -> casadi.Function:
        """Return (q, v, torque) → acceleration (nv,) and contact_force (2k,), points held.

        The points must be independent: two of one flat foot make the equations singular, and
        :meth:`contact_equations` is what to use then.

        Parameters
        ----------
        contacts : iterable of int or str, optional
            Contact points, all k = nc by default.

        Returns
        -------
        casadi.Function
            Of the inputs above, (nv,) and (2k,).
        """
        held = self._contacts(contacts)
        n, k = self.robot.nv, 2 * len(held)
        unknown = casadi.SX.sym("unknown", n + k)
        torque = self._symbol("torque")
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

    def _symbol(self, name: str) -> casadi.SX:
        """Return the symbol of an input: always the same one of the state."""
        known = {"q": self._q, "v": self._v} if hasattr(self, "_v") else {}
        return known.get(name, casadi.SX.sym(name, getattr(self.robot, VECTORS[name])))

    def _function(
        self, name: str, inputs: dict[str, Any], value: Any, output: str = ""
    ) -> casadi.Function:
        return casadi.Function(name, [*inputs.values()], [value], [*inputs], [output or name])


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
    at = TracedDynamics(robot, symbols(q), symbols(v))
    force = at.inverse_dynamics(symbols(acceleration)) - at.passive_force()
    force[robot.model.actuator_joint] -= symbols(torque)
    if not contacts:
        return casadi.SX(expression(force))
    jacobian = at.contact_jacobian(contacts).reshape(-1, robot.nv)
    force = force - jacobian.T @ symbols(contact_force)
    held = jacobian @ symbols(acceleration) + at.contact_bias_acceleration(contacts).ravel()
    return casadi.vertcat(expression(force), expression(held))


def _sx(value: Any) -> casadi.SX:
    """CasADi expression of an object array or a scalar; structural zeros stay sparse."""
    if not isinstance(value, np.ndarray):
        return casadi.SX(value)
    rows = value.reshape(-1, value.shape[-1]) if value.ndim == 3 else value
    return casadi.SX(expression(rows))
