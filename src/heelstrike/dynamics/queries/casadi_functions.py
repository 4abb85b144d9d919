"""The queries as CasADi functions, for a user's own optimisation."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np

from heelstrike import dynamics
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.evaluation import contact_indices
from heelstrike.dynamics.queries.held import HeldRobot
from heelstrike.dynamics.queries.query import VECTORS, docstring
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.robot.robot import Robot


def _function_of(asked: Any) -> Callable[..., casadi.Function]:
    """Make the method that returns a query as a function of symbols; it takes the other arguments.

    Points and frames that the query tells apart become rows below each other.
    """
    names = [name for name in inspect.signature(asked).parameters if name in VECTORS]

    def method(self: CasadiDynamics, /, *others: Any, **named: Any) -> casadi.Function:
        inputs = {name: self._state.get(name, self._symbol(name)) for name in names}
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
        self._state = {name: self._symbol(name) for name in ("q", "v")}
        self._traced = TracedDynamics(robot, *map(symbols, self._state.values()))

    if TYPE_CHECKING:  # every query is a method, see below

        def __getattr__(self, name: str) -> Callable[..., casadi.Function]: ...

    def state_derivative(self) -> casadi.Function:
        """Return (state, torque) → d/dt (q, v) without contact, (nq + nv,).

        The state is (q; v) in one column; motors, dampers and springs act.
        """
        torque = self._symbol("torque")
        x = casadi.SX.sym("state", self.robot.nq + self.robot.nv)
        at = TracedDynamics(self.robot, symbols(x[: self.robot.nq]), symbols(x[self.robot.nq :]))
        force = at.applied_force(symbols(torque))
        rate = casadi.vertcat(expression(at.v), expression(at.forward_dynamics(force)))
        return self._function("state_derivative", {"state": x, "torque": torque}, rate)

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
            [self._state["q"]],
            [casadi.SX(expression(work.origin)), casadi.SX(expression(work.angle))],
            ["q"],
            ["origin", "angle"],
        )

    def contact_equations(self, contacts: Iterable[int | str] | None = None) -> casadi.Function:
        """Return (q, v, acceleration, contact_force, torque) → residual, (nv + 2k,).

        Forward and inverse dynamics with held contact points as one set of equations, to be made
        zero: A v̇ + H − passive − SᵀΓ − Jᵀλ, and J v̇ + J̇v. Whatever is unknown of them, and whatever
        inequality the forces obey, is the user's choice; redundant points do no harm. The contact
        force is n₀ t₀ n₁ t₁ …, in N, on the robot. A robot with closed loops or coupled joints adds
        their forces along their rows (:func:`heelstrike.dynamics.loop_jacobian`) to the arguments,
        loop_force, and their equations to the residual.

        Parameters
        ----------
        contacts : iterable of int or str, optional
            Contact points, all k = nc by default.

        Returns
        -------
        casadi.Function
            Of the inputs above, (nv + 2k,).
        """
        robot, at = self.robot, self._traced
        held = contact_indices(robot, contacts)
        sizes = {"acceleration": robot.nv, "contact_force": 2 * len(held), "torque": robot.nu}
        if count_rows(robot.model):
            sizes["loop_force"] = count_rows(robot.model)
        more = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
        acceleration, push, torque, *pull = map(symbols, more.values())
        force = at.inverse_dynamics(acceleration) - at.passive_force()
        force[robot.model.actuator_joint] -= torque
        jacobian = at.contact_jacobian(held).reshape(-1, robot.nv)
        force = force - jacobian.T @ push
        rates = jacobian @ acceleration + at.contact_bias_acceleration(held).ravel()
        if pull:
            rows = at.loop_jacobian()
            force = force - rows.T @ pull[0]
            rates = np.concatenate([rates, rows @ acceleration + at.loop_bias_acceleration()])
        residual = expression(np.concatenate([force, rates]))
        return self._function("contact_equations", self._state | more, residual, "residual")

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
        at, torque = self._traced, self._symbol("torque")
        points = contact_indices(self.robot, contacts)
        force = at.applied_force(symbols(torque)) - at.bias_force()
        acceleration, exerted = HeldRobot.on(at, points).accelerated(force)
        along = exerted[: 2 * len(points)].reshape(-1, 2)[:, ::-1].ravel()  # z is the normal
        return casadi.Function(
            "contact_forward_dynamics",
            [*self._state.values(), torque],
            [expression(acceleration), expression(along) if len(along) else casadi.SX(0, 1)],
            ["q", "v", "torque"],
            ["acceleration", "contact_force"],
        )

    def _symbol(self, name: str) -> casadi.SX:
        return casadi.SX.sym(name, getattr(self.robot, VECTORS[name]))

    def _function(
        self, name: str, inputs: dict[str, Any], value: Any, output: str = ""
    ) -> casadi.Function:
        return casadi.Function(name, [*inputs.values()], [value], [*inputs], [output or name])


def _sx(value: Any) -> casadi.SX:
    """CasADi expression of an object array or a scalar; structural zeros stay sparse."""
    if not isinstance(value, np.ndarray):
        return casadi.vertcat(*value) if isinstance(value, tuple) else casadi.SX(value)
    rows = value.reshape(-1, value.shape[-1]) if value.ndim == 3 else value
    return casadi.SX(expression(rows))


for _name, _query in list(vars(dynamics).items()):
    if "float" in getattr(_query, "returns", ""):
        setattr(CasadiDynamics, _name, _function_of(_query))
