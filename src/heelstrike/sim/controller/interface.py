"""What a controller is to the simulator: a Python object, or a compiled kernel with its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numba import types
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import compiled_for
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State


class Contacts(Bundle):
    """Contact points of a robot as a controller sees them.

    Attributes
    ----------
    position : (nc, 2) float
        World position of each contact point (the lowest point of its disc), in metres.
    normal : (nc, 2) float
        Ground normal under each point.
    gap : (nc,) float
        Distance to the ground, in metres; negative when penetrating.
    force : (nc, 2) float
        Force on the robot, (normal, tangent), of the step before, in newtons.
    """

    position: Floats = array("nc", "axes")
    normal: Floats = array("nc", "axes")
    gap: Floats = array("nc")
    force: Floats = array("nc", "components")


@runtime_checkable
class Controller(Protocol):
    """Anything that can say which joint torques to apply."""

    def torque(self, t: float, state: State, contacts: Contacts) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m, to hold until the next call.

        Parameters
        ----------
        t : float
            Time (s).
        state : State
            Where the robot is.
        contacts : Contacts
            How it touches the ground.

        Returns
        -------
        (nu,) float
            Torques, in the order of the actuators.
        """
        ...


@runtime_checkable
class Partaking(Protocol):
    """A controller in Python whose memory can be kept with a simulation."""

    def snapshot(self) -> ArrayLike:
        """Return its memory as an array of numbers."""
        ...

    def restore(self, numbers: NDArray[np.float64]) -> None:
        """Take up a memory that :meth:`snapshot` returned."""
        ...


@dataclass(frozen=True)
class CompiledController:
    """A controller that runs inside the compiled loop.

    Attributes
    ----------
    kernel : compiled function
        Called as ``kernel(t, q, v, contacts, model, tree, scratch, parameters, memory, torque)``;
        it writes the joint torques (nu,) into ``torque``. See :func:`controller_kernel`.
    parameters : (n,) float
        Its numbers, read only.
    memory : (m,) float
        Its state from call to call, at the start of the run.
    stiffness, damping : (nu,) float, optional
        Gains −∂Γ/∂q and −∂Γ/∂v of each actuator on its own joint (N m, N m s), for the schemes
        that take stiff forces implicitly.
    """

    kernel: Callable[..., None]
    parameters: NDArray[np.float64]
    memory: NDArray[np.float64]
    stiffness: NDArray[np.float64] | None = None
    damping: NDArray[np.float64] | None = None


MODEL_TYPE = Model.compiled_type()
WORKSPACE_TYPE = Workspace.compiled_type()
CONTACTS_TYPE = Contacts.compiled_type()
_VECTOR = types.float64[::1]

CONTROLLER_SIGNATURE = types.void(
    types.float64,
    _VECTOR,
    _VECTOR,
    CONTACTS_TYPE,
    MODEL_TYPE,
    WORKSPACE_TYPE,
    WORKSPACE_TYPE,
    _VECTOR,
    _VECTOR,
    _VECTOR,
)
CONTROLLER_TYPE = types.FunctionType(CONTROLLER_SIGNATURE)


def _is_ours(function: Callable[..., None]) -> bool:
    return str(getattr(function, "__module__", "")).split(".")[0] == __name__.split(".")[0]


def controller_kernel(function: Callable[..., None]) -> Any:
    """Compile a controller so that it can run inside the compiled loop.

    The function takes ``(t, q, v, contacts, model, tree, scratch, parameters, memory, torque)``
    and writes into ``torque`` (nu,). ``tree`` is the dynamics workspace with the kinematics and
    velocities of ``(q, v)``; its scratch fields and all of ``scratch`` may be used freely.
    ``parameters`` is read only, ``memory`` is kept from call to call.

    Its own indices are checked, those of the functions it calls are not: an index beyond an array
    raises IndexError, which like any exception ends the run; ``simulate(..., checked=True)`` names
    the array and the index.

    Parameters
    ----------
    function : callable
        The controller.

    Returns
    -------
    kernel
        What a :class:`CompiledController` is made of.
    """
    checked = not _is_ours(function)  # the tests see to those of this package
    return compiled_for(CONTROLLER_SIGNATURE, function, address=True, boundscheck=checked)


def name_of(controller: Any) -> str:
    """Return what to call a controller: the name of its function, or of its class."""
    kernel = getattr(controller, "kernel", None)
    return str(getattr(kernel, "__name__", "") or type(controller).__name__)


def is_stock(controller: CompiledController) -> bool:
    """Whether a controller is one of this package, whose tests see to what it writes."""
    return _is_ours(controller.kernel)


def read_only(contacts: Contacts) -> Contacts:
    """Return the same contacts, to be looked at only."""
    shown = {name: values.view() for name, values in contacts.members().items()}
    for values in shown.values():
        values.flags.writeable = False
    return Contacts(**shown)


def checked_kernel(controller: CompiledController) -> CompiledController:
    """Return a compiled controller that the loops may call.

    Raises
    ------
    ControllerError
        If its kernel is not compiled for what loops hand to it, or its numbers are not vectors.
    """
    kernel: Any = controller.kernel
    name = name_of(controller)
    if not isinstance(kernel, Dispatcher):
        raise ControllerError(
            f"the kernel of a CompiledController comes from controller_kernel, {name!r} does not: "
            f"it is a {type(kernel).__name__}"
        )
    if tuple(CONTROLLER_SIGNATURE.args) not in kernel.overloads:
        try:
            kernel.compile(CONTROLLER_SIGNATURE)
        except (NumbaError, RuntimeError, TypeError) as error:
            raise ControllerError(
                f"controller {name!r} cannot be compiled for the arguments of a controller; make "
                f"it with controller_kernel. {error}"
            ) from error
    for field in ("parameters", "memory"):
        if np.ndim(getattr(controller, field)) != 1:
            raise ControllerError(
                f"the {field} of controller {name!r} must be a vector, got shape "
                f"{np.shape(getattr(controller, field))}"
            )
    return controller


@controller_kernel
def hold_torque(
    t: float,
    q: Floats,
    v: Floats,
    contacts: Contacts,
    model: Model,
    tree: Workspace,
    scratch: Workspace,
    parameters: Floats,
    memory: Floats,
    torque: Floats,
) -> None:
    """Apply constant joint torques: zero-order hold of whatever decided them."""
    for i in range(torque.shape[0]):
        torque[i] = parameters[i]


def compiled_form(
    robot: Robot, controller: Controller | CompiledController | None
) -> CompiledController | None:
    """Return a controller in the form that runs inside the compiled loop, None if it has none.

    Raises
    ------
    ControllerError
        If it is no controller at all, or one that loops cannot call.
    """
    if controller is None:
        return CompiledController(hold_torque, np.zeros(robot.nu), np.zeros(0))
    if isinstance(controller, CompiledController):
        return checked_kernel(controller)
    make = getattr(controller, "compiled", None)
    compiled = make() if callable(make) else None
    if isinstance(compiled, CompiledController):
        return checked_kernel(compiled)
    if not callable(getattr(controller, "torque", None)):
        raise ControllerError(
            f"a controller needs a method torque(t, state, contacts), "
            f"{type(controller).__name__} has none"
        )
    return None
