"""``@controller``: control laws as functions of named parameters and memory."""

from __future__ import annotations

import copy
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, update_wrapper
from typing import Any, ClassVar, overload

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import are_numbers, positive, refusal, shown
from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.bundle_type import bundle_at
from heelstrike.compiler.compilation import (
    CompileError,
    compiled_for,
    is_ours,
    kernel,
    within_bounds,
)
from heelstrike.compiler.separate_kernel import SeparateKernel
from heelstrike.compiler.words import VALUE, keep_value, kept_value
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import ARGUMENTS, Contacts, Controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState, extents_of

# Time, then where state, contacts, robot, parameters, memory and log are, and the torques: the
# same for all, so that one compiled loop serves every controller.
CONTROLLER_SIGNATURE = types.void(types.float64, *[types.int64] * 6, types.float64[::1])
CONTROLLER_TYPE = types.FunctionType(CONTROLLER_SIGNATURE)

controller_in = kept_value(CONTROLLER_TYPE)
"""``controller_in(words)``: what :attr:`ControllerFunction.words` keeps."""


class ControllerFunction:
    """What :func:`controller` makes of a function: called with parameters, it returns a law.

    Parameters
    ----------
    function : callable
        The function, or one that Numba has compiled.
    compiles : bool
        Whether it runs inside the compiled loop.
    scope : mapping of str to object
        Where the names in its annotations are looked up first.
    endings : sequence of str
        Reasons for which it ends a run.
    """

    def __init__(
        self, function: Callable[..., None], compiles: bool, scope: Mapping[str, Any],
        endings: Sequence[str] = (),
    ) -> None:  # fmt: skip
        if not callable(function):
            raise ControllerError(refusal("a controller", function, ("Callable",)))
        several = isinstance(endings, Sequence) and not isinstance(endings, str)
        if not several or not all(isinstance(each, str) for each in endings):
            raise ControllerError(f"endings must be several texts, got {shown(endings)}")
        self.python: Callable[..., None] = getattr(function, "py_func", function)
        update_wrapper(self, self.python)
        self.function = function
        self.compiles = compiles
        self.endings = tuple(endings)
        self.partner: Any = None
        self.is_ours = is_ours(self.python)
        self.arguments = list(inspect.signature(self.python).parameters)
        strange = [name for name in self.arguments if name not in ARGUMENTS]
        if strange or "torque" not in self.arguments:
            raise ControllerError(
                f"controller {self.name!r} takes ({', '.join(self.arguments)}); it can take "
                f"{', '.join(ARGUMENTS)}, of which all but torque may be left out"
            )
        self.parameters = self._bundle("parameters", scope)
        self.memory = self._bundle("memory", scope)
        self.log = self._bundle("log", scope)

    def _bundle(self, name: str, scope: Mapping[str, Any]) -> type[Bundle]:
        """Class of parameters, memory or log, as the function is annotated."""
        if name not in self.arguments:
            return Bundle

        hint: Any = inspect.signature(self.python).parameters[name].annotation
        try:
            found = (
                eval(hint, self.python.__globals__, dict(scope)) if isinstance(hint, str) else hint
            )
        except NameError as error:
            found = error
        if not (isinstance(found, type) and issubclass(found, Bundle)):
            raise ControllerError(
                f"controller {self.name!r} must say what its {name} are: annotate the argument "
                f"with a class of heelstrike.Bundle, as in {name}: {name.capitalize()}; got "
                f"{found!r}"
            )
        bundle: type[Bundle] = found
        return bundle

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return self.python.__name__

    def __call__(self, parameters: Bundle | None = None, **options: Any) -> Law:
        """Return the law with these parameters; see :class:`Law`, also for the options."""
        return Law(self, parameters, **options)

    def __reduce__(self) -> str:
        """Copies and pickles are the one of that name, in any process: machine code stays here."""
        return self.python.__qualname__

    def begin(self) -> None:
        """Have another process compile it meanwhile, where that is worth it."""
        if self.is_ours and self.compiles:
            self.separate.begin()

    @cached_property
    def words(self) -> Integers:
        """What loops find it by, compiled: its value in words of memory."""
        return _words(self.finish())

    def finish(self) -> Any:
        """Compile it, or load its machine code.

        Raises
        ------
        ControllerError
            If it cannot be compiled.
        """
        return _finished(self, self.separate)

    @cached_property
    def separate(self) -> SeparateKernel:
        """Its machine code, which loops find by its address."""
        return _separate(self)


@cache
def _keep() -> Any:
    def keep_controller(controller: Any, words: Integers) -> None:
        keep_value(controller, words)

    return compiled_for(types.void(CONTROLLER_TYPE, types.int64[::1]), keep_controller)


def _words(compiled: Any) -> Integers:
    """Return the words that loops find a compiled law by."""
    words = np.zeros(VALUE, dtype=np.int64)
    _keep()(compiled, words)
    return words


def machine_code_of(law: ControllerFunction, seen: Mapping[str, Any]) -> Integers:
    """Compile a law that is shown other bundles; return the words that loops find it by.

    Parameters
    ----------
    law : ControllerFunction
        The law.
    seen : mapping of str to type
        Classes of `state`, `contacts` and `robot`.

    Raises
    ------
    ControllerError
        If it cannot be compiled.
    """
    return _words(_finished(law, _separate(law, seen)))


def _finished(law: ControllerFunction, separate: SeparateKernel) -> Any:
    """Return the machine code of a law, compiled or loaded."""
    try:
        return separate.finish()
    except CompileError as error:
        raise ControllerError(
            f"controller {law.name!r} cannot be compiled; @controller(compile=False) runs it in "
            f"Python. {error}"
        ) from error


_SEEN: Mapping[str, Any] = {"state": ControlState, "contacts": Contacts, "robot": ControlledRobot}
"""What laws are shown in the plane."""


def _separate(law: ControllerFunction, seen: Mapping[str, Any] = _SEEN) -> SeparateKernel:
    """Return the machine code of a law that is shown bundles of some classes."""
    # Stock controllers have tests that see to their indices.
    function = kernel(law.function) if law.is_ours else within_bounds(law.function)
    return SeparateKernel(
        _called_by_address(law, function, seen), lambda: CONTROLLER_SIGNATURE,
        boundscheck=not law.is_ours,
    )  # fmt: skip


def _called_by_address(
    law: ControllerFunction, function: Any, seen: Mapping[str, Any]
) -> Callable[..., None]:
    """Return what loops call: it finds the bundles at their addresses and calls the function."""
    kinds: dict[str, Any] = {
        **seen,
        "parameters": law.parameters.settable(),
        "memory": law.memory.settable(),
        "log": law.log.settable(),
    }
    given = (f"{name}_at({name})" if name in kinds else name for name in law.arguments)
    text = f"def call({', '.join(ARGUMENTS)}): function({', '.join(given)})"
    scope = {f"{name}_at": bundle_at(kind) for name, kind in kinds.items()}
    scope |= {"function": function, "__name__": law.python.__module__}
    # Machine code is kept beside the file of the function, under its name.
    place = law.python.__code__
    exec(compile(text, place.co_filename, "exec"), scope)
    call: Any = scope["call"]
    call.__code__ = call.__code__.replace(co_firstlineno=place.co_firstlineno)
    call.__name__, call.__qualname__ = law.python.__name__, law.python.__qualname__
    called: Callable[..., None] = call
    return called


@overload
def controller(function: Callable[..., None], /) -> ControllerFunction: ...


@overload
def controller(
    *, compile: bool = True, endings: Sequence[str] = ()
) -> Callable[[Callable[..., None]], ControllerFunction]: ...


def controller(
    function: Callable[..., None] | None = None, /, *, compile: bool = True,
    endings: Sequence[str] = (),
) -> Any:  # fmt: skip
    """Make a function a control law that runs inside the compiled loop.

    The function takes ``(t, state, contacts, robot, parameters, memory, log, torque)``, or those of
    them that it needs, and writes the joint torques (nu,), in N m, into `torque`. `parameters`,
    `memory` and `log` are bundles of its own, which their annotations name; what it writes into its
    log is recorded with every row of the run. What the function makes when it is called with
    parameters is a controller for :func:`heelstrike.simulate`.

    Its own indices are checked, those of the functions it calls are not: an index beyond an array
    raises IndexError, which like any exception ends the run; ``simulate(..., checked=True)`` names
    the array and the index. Of a function that ``numba.njit`` has compiled they are not checked
    either; it runs as Numba compiled it.

    Parameters
    ----------
    function : callable
        ``t`` is the time in s; ``state`` has `q` (nq,), `v` (nv,), `joint_position` (nu,) and
        `joint_velocity` (nu,), copies of the robot's; ``contacts`` has `position`, `normal`, `gap`
        and `force` of the contact points; ``robot`` has the sizes `nq`, `nv`, `nu`, `nc`, `nl`, its
        `model`, and queries such as ``robot.gravity_force(state, torque)``, see
        :class:`~heelstrike.control.ControlledRobot`.
    compile : bool
        False runs the function as it is, in Python, where a debugger can stop in it.
    endings : sequence of str
        Reasons for which it ends a run: ``robot.stop(0)`` ends it with this instant, with status
        ``stopped`` and the first of these words in its message.

    Returns
    -------
    ControllerFunction
        What makes laws; or, without `function`, what makes a function one.

    Raises
    ------
    ControllerError
        If the arguments of the function are others, or its bundles are not known.

    Examples
    --------
    >>> import numpy as np
    >>> import heelstrike as hs
    >>> class Gains(hs.Bundle):
    ...     kp: np.ndarray = hs.array("nu")
    ...     kd: np.ndarray = hs.array("nu")
    >>> @hs.controller(compile=False)
    ... def stand(state, robot, parameters: Gains, torque):
    ...     robot.gravity_force(state, torque)
    ...     torque -= parameters.kp * state.joint_position + parameters.kd * state.joint_velocity
    >>> robot = hs.load_robot("bravo7")
    >>> law = stand(Gains(kp=np.full(6, 600.0), kd=np.full(6, 10.0)))
    >>> start = robot.reference_state()
    >>> hs.simulate(robot, law, state=start, duration=0.01, control_period=0.005).completed
    True
    """
    scope = sys._getframe(1).f_locals

    def make(function: Callable[..., None]) -> ControllerFunction:
        return ControllerFunction(function, compile, scope, endings)

    return make if function is None else make(function)


def per_actuator(name: str, value: ArrayLike, robot: Robot | SpatialRobot) -> NDArray[np.float64]:
    """Return one number for each actuator, (nu,), of one for all or for each."""
    gains = np.array(value, dtype=np.float64) if are_numbers(value) else np.full(1, np.nan)
    if gains.ndim > 1 or gains.size not in (1, robot.nu) or not np.all(np.isfinite(gains)):
        raise ControllerError(
            f"{name} must be one finite number or {robot.nu} (one an actuator), got {value!r}"
        )
    return np.broadcast_to(gains, (robot.nu,)).copy()


class Law:
    """A controller: a function made by :func:`controller`, with its parameters.

    Parameters
    ----------
    function : ControllerFunction
        What decides the torques.
    parameters : Bundle, optional
        Its numbers; required if the function takes parameters.
    memory : mapping of str to number or array, optional
        What its memory begins with, by name of the members; what is not named begins as zero.
        Extents of arrays that are not the robot's are given likewise.
    robot : Robot, optional
        The robot as the law knows it, in the place of the one that is simulated: its numbers may be
        others, so that the model is wrong. Needed to call :meth:`torque` oneself.
    period : float, optional
        Seconds between two calls, unless the simulation is told a `control_period`.
    stiffness, damping : (nu,) float, optional
        Gains −∂Γ/∂q and −∂Γ/∂v of each actuator on its own joint (N m, N m s), for schemes that
        take stiff forces implicitly.
    commands_voltage : bool
        What it writes are no torques but voltages, as parts of the full one: from -1 to 1.

    Raises
    ------
    ControllerError
        If the parameters are not those that the function takes, or the period is none.
    """

    keeps_period: ClassVar[bool] = False
    """Whether it cannot be called at other times than its own."""

    commanded: ClassVar[str] = ""
    """Name of the array among its parameters that is commanded from outside, call by call; empty
    if there is none. Batches have the row of each lane in `command`."""

    def __init__(
        self,
        function: ControllerFunction,
        parameters: Bundle | None = None,
        *,
        memory: Mapping[str, Any] | None = None,
        robot: Robot | None = None,
        period: float | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        commands_voltage: bool = False,
    ) -> None:
        self.memory = dict(memory or {})
        strange = self.memory.keys() - function.memory.declared - function.memory.extent_names
        strange -= function.log.extent_names
        if period is not None:
            positive("the period of a controller", period, ControllerError, "s")
        if strange:
            raise ControllerError(
                f"the memory of controller {function.name!r} has no {', '.join(sorted(strange))}"
            )
        self.function = function
        self.parameters: Any = _fitting(function, Bundle() if parameters is None else parameters)
        self.robot = robot
        self.period = period
        self.stiffness = None if stiffness is None else np.asarray(stiffness, dtype=np.float64)
        self.damping = None if damping is None else np.asarray(damping, dtype=np.float64)
        self.commands_voltage = commands_voltage
        self._asked: AskedLaw | None = None

    def with_parameters(self, parameters: Bundle) -> Law:
        """Return the same law with other parameters.

        Parameters
        ----------
        parameters : Bundle
            Its numbers.

        Returns
        -------
        Law
            The law.
        """
        law = copy.copy(self)
        law.parameters, law._asked = _fitting(self.function, parameters), None
        return law

    def numbers(self, robot: Any) -> tuple[Bundle, Bundle]:
        """Return its parameters, and a memory to begin with, for a robot; all can be set.

        Parameters
        ----------
        robot : Robot
            The robot.

        Returns
        -------
        tuple of Bundle
            Parameters and memory.

        Raises
        ------
        ControllerError
            If they do not fit the robot.
        """
        for name, gains in (("stiffness", self.stiffness), ("damping", self.damping)):
            if gains is not None:
                per_actuator(f"controller {self.function.name!r}: {name}", gains, robot)
        extents = extents_of(robot)
        try:
            self.parameters.check(extents)
            kind = self.function.memory
            known = kind.declared.keys() | kind.extent_names
            begin = {name: each for name, each in self.memory.items() if name in known}
            memory = kind.settable().allocate(extents, **begin)
            memory.check(extents)
        except TypeError as error:
            raise ControllerError(
                f"controller {self.function.name!r} does not fit robot {robot.name!r}: {error}"
            ) from error
        return type(self.parameters).settable()(**self.parameters.members()), memory

    def new_log(self, robot: Any) -> Bundle:
        """Return a log to begin with, all zeros.

        Parameters
        ----------
        robot : Robot
            The robot.

        Returns
        -------
        Bundle
            The log.

        Raises
        ------
        ControllerError
            If an extent of its arrays is neither the robot's nor given with the memory.
        """
        log = self.function.log
        given = {k: v for k, v in self.memory.items() if k in log.extent_names}
        try:
            return log.settable().allocate(extents_of(robot), **given)
        except TypeError as error:
            raise ControllerError(
                f"the log of controller {self.function.name!r} does not fit robot "
                f"{robot.name!r}: {error}. Give sizes of your own when you make the law, as in "
                f"{self.function.name}(memory={{'samples': 4}})"
            ) from error

    def reset(self) -> None:
        """Forget what :meth:`torque` has been asked; runs start again by themselves."""
        self._asked = None

    def torque(self, t: float, state: State, contacts: Contacts | None) -> NDArray[np.float64]:
        """Return the joint torques; at t = 0 it starts again.

        Parameters
        ----------
        t : float
            Time (s).
        state : State
            Where the robot is.
        contacts : Contacts or None
            How it touches the ground; None for as at the call before.

        Returns
        -------
        (nu,) float
            Torques (N m), in the order of the actuators.

        Raises
        ------
        ControllerError
            If the law was made without `robot`.
        """
        if self.robot is None:
            raise ControllerError(
                f"controller {self.function.name!r} does not know its robot; make it with robot=, "
                "or simulate with it"
            )
        if self._asked is None or t <= 0.0:
            self._asked = AskedLaw(self.robot, self, compiled=self.function.compiles)
        return self._asked.torque(t, state, contacts)

    @property
    def remembered(self) -> Any:
        """Memory of the calls of :meth:`torque`; None before the first."""
        return None if self._asked is None else self._asked.numbers.memory

    def __getstate__(self) -> dict[str, Any]:
        """Leave what holds places in this process."""
        return self.__dict__ | {"_asked": None}


def _fitting(function: ControllerFunction, parameters: Bundle) -> Bundle:
    """Return parameters, or refuse those that a function does not take."""
    if not isinstance(parameters, function.parameters):
        wanted = "none" if function.parameters is Bundle else function.parameters.__name__
        raise ControllerError(
            f"controller {function.name!r} takes {wanted} as parameters, got "
            f"{type(parameters).__name__}"
        )
    return parameters


@controller
def no_torque(torque: Floats) -> None:
    """Apply no torque."""
    for i in range(torque.shape[0]):
        torque[i] = 0.0


def law_of(controller: Controller | None, *, begin: bool = False) -> Law | None:
    """Return the law that a controller is; None if it is an object of Python.

    Parameters
    ----------
    controller : Controller or None
        None applies no torque.
    begin : bool
        Whether a stock one shall be compiled by another process meanwhile.

    Raises
    ------
    ControllerError
        If it is no controller at all.
    """
    if controller is None:
        return Law(no_torque)
    if isinstance(controller, Law):
        if begin:
            controller.function.begin()
        return controller
    if isinstance(controller, ControllerFunction):
        raise ControllerError(
            f"controller {controller.name!r} has no parameters yet: call it with them, as in "
            f"{controller.name}({'...' if 'parameters' in controller.arguments else ''})"
        )
    if not callable(getattr(controller, "torque", None)):
        raise ControllerError(
            f"a controller needs a method torque(t, state, contacts), "
            f"{type(controller).__name__} has none"
        )
    return None


def commands_voltage(controller: Controller | None, robot: Robot) -> bool:
    """Return whether a controller commands voltages, by its attribute `commands_voltage`.

    Raises
    ------
    ControllerError
        If it does, but of a motor nobody knows what torque that is.
    """
    if not getattr(controller, "commands_voltage", False):
        return False
    joints = robot.model.actuator_joint
    unknown = [robot.joint_names[j] for j in joints if np.isinf(robot.model.stall_torque[j])]
    if unknown:
        raise ControllerError(
            f"{type(controller).__name__} commands voltages, but the stall torque of the motors of "
            f"robot {robot.name!r} at {', '.join(unknown)} is not known: give stall_torque and "
            "no_load_speed to the builder, or as custom numbers in its MJCF file"
        )
    return True
