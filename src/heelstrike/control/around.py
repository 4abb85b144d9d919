"""Laws around laws: what stands between a controller and its robot.

A wrapper is two kernels, one before the controller inside is asked and one after it, with
parameters, memory and log of its own. Wrapper and controller make one law: compiled, if the
controller is, and asked in Python, if it is an object. The bundles of both are parts of its own::

    before(t, state, contacts, robot, own parameters, own memory, own log)
    inside(t, memory.own.state, memory.own.contacts, …)    # what it sees is the wrapper's to say
    after(t, state, robot, own parameters, own memory, own log, torque)

The wrapper keeps time by its own period; a controller inside that is called less often is, and its
torques are held meanwhile.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from heelstrike.arguments import positive
from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import is_ours, kernel, within_bounds
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import ARGUMENTS, Contacts, Controller
from heelstrike.sim.controller.law import ControllerFunction, Law, law_of
from heelstrike.sim.controller.robot import ControlState, extents_of

ROBOTS = frozenset(("nq", "nv", "nu", "nc", "nl", "nj", "nf", "axes", "components", "held"))
"""Extents that are the robot's."""

PERIOD = 1e-3
"""Seconds between two calls of a wrapper around a controller that names no period."""


@kernel
def copy(source: Floats, target: Floats) -> None:
    """Copy as many numbers as there is place for."""
    for j in range(target.shape[0]):
        target[j] = source[j]


@kernel
def copy_contacts(contacts: Contacts, told: Contacts) -> None:
    """Copy everything that is told of contact points."""
    copy(contacts.gap, told.gap)
    for i in range(contacts.gap.shape[0]):
        copy(contacts.position[i], told.position[i])
        copy(contacts.normal[i], told.normal[i])
        copy(contacts.force[i], told.force[i])


class Turn(Bundle):
    """When the controller inside is called."""

    every: int = number(int)
    """Calls of the wrapper for one of the controller inside."""
    period: float = number(float)
    inside: float = number(float)
    """period, inside: Seconds between two calls of either."""


class Held(Bundle):
    """What the controller inside asked for last."""

    calls: int = cell(int)
    """Calls of the wrapper."""
    torque: Floats = array("nu")


class Wrapper(NamedTuple):
    """What stands between a controller and its robot.

    Attributes
    ----------
    name : str
        What it does, as in ``sensed(stand)``.
    before, after : kernel
        As above.
    parameters, memory, log : type
        Its bundles; memory has the members `state` and `contacts`, which the controller is shown.
    """

    name: str
    before: Any
    after: Any
    parameters: type[Bundle]
    memory: type[Bundle]
    log: type[Bundle]


class Shown(Bundle):
    """What the controller inside a wrapper is shown: a base of the memories of wrappers."""

    state: ControlState = part(ControlState)
    contacts: Contacts = part(Contacts)


def inside(controller: Controller) -> Law:
    """Return the law that a controller is, or one that asks an object in Python."""
    law = law_of(controller)
    if law is not None:
        return law
    asked: Any = controller
    function = AskedInPython(asked)
    told = function.told
    given = {} if told is None else {k: n for k, n in told.extents.items() if k not in ROBOTS}
    voltage = bool(getattr(asked, "commands_voltage", False))
    return Law(function, memory=given, commands_voltage=voltage)


class AskedInPython(ControllerFunction):
    """A function that asks a controller in Python, and tells its log, if it has one."""

    def __init__(self, asked: Any) -> None:
        kind = type(asked)
        told = getattr(asked, "log", None)
        self.told: Bundle | None = told if isinstance(told, Bundle) else None

        def ask(t: float, state: Any, contacts: Any, torque: Floats) -> None:
            seen = State(state.q, state.v)
            wanted = np.asarray(asked.torque(float(t), seen, contacts), np.float64)
            if wanted.shape != torque.shape:
                raise ControllerError(
                    f"{kind.__name__}.torque returned shape {wanted.shape}; the robot needs "
                    f"{torque.shape}"
                )
            torque[:] = wanted

        def ask_and_tell(t: float, state: Any, contacts: Any, log: Any, torque: Floats) -> None:
            ask(t, state, contacts, torque)
            log.become(told)

        function = ask if self.told is None else ask_and_tell
        function.__annotations__["log"] = type(told)
        function.__name__, function.__qualname__, function.__module__ = (
            kind.__name__, kind.__qualname__, kind.__module__,
        )  # fmt: skip
        super().__init__(function, False, {})
        self.partner = asked

    def __reduce__(self) -> Any:
        """Copies ask a copy of the controller."""
        return type(self), (self.partner,)


def own_period(name: str, controller: Controller, period: float | None) -> float:
    """Return the seconds between two calls of a wrapper: by default the controller's, 1 ms at most.

    Raises
    ------
    ControllerError
        If `period` is no time.
    """
    if period is None:
        return min(inside(controller).period or PERIOD, PERIOD)
    return positive(f"the period of {name!r}", period, ControllerError, "s")


class Around(Law):
    """A wrapper with a controller inside: a law like any other.

    Parameters
    ----------
    wrapper : Wrapper
    controller : Controller
        What is inside.
    own : Bundle
        Parameters of the wrapper.
    period : float, optional
        Seconds between two calls of the wrapper.
    extents : dict of str to int
        Of the wrapper's memory.
    late : bool
        Whether joints move on before what they did has come back as torque. Then schemes are not
        told the gains of the controller: at the end of a step they would act without delay.

    Raises
    ------
    ControllerError
        If there is no such controller, or the periods do not fit.
    """

    keeps_period = True

    def __init__(
        self, wrapper: Wrapper, controller: Controller, own: Bundle, *, period: float | None,
        extents: dict[str, int], late: bool = False,
    ) -> None:  # fmt: skip
        law = inside(controller)
        period = own_period(wrapper.name, controller, period)
        inner = period if law.period is None else law.period
        every = round(inner / period)
        if every < 1 or abs(every * period - inner) > 1e-9 * inner:
            raise ControllerError(
                f"controller {law.function.name!r} is called every {inner} s, which is "
                f"not a multiple of {period} s: give {wrapper.name!r} another period"
            )
        function = composed(wrapper, law.function)
        parts: Any = function.parameters.declared
        numbers = parts["inside"].kind(**law.parameters.members())
        turn = Turn(every=every, period=period, inside=inner)
        super().__init__(
            function, function.parameters(turn=turn, own=own, inside=numbers), robot=law.robot,
            period=period, stiffness=None if late else law.stiffness,
            damping=None if late else law.damping, commands_voltage=law.commands_voltage,
        )  # fmt: skip
        self.inside = law
        self._wrapper, self._extents, self._late = wrapper, dict(extents), late

    def __reduce__(self) -> Any:
        """Copies are made again of wrapper and controller: their bundles have no name."""
        numbers: Any = self.parameters
        more = {name: each for name, each in vars(self).items() if name not in _MADE}
        made_of = self._wrapper, self.inside, numbers.own, self.period, self._extents, self._late
        return _again, (type(self), made_of, more)

    def with_parameters(self, parameters: Bundle) -> Law:
        """Return the same law with other parameters."""
        law: Any = super().with_parameters(parameters)
        kind: Any = self.inside.function.parameters
        law.inside = self.inside.with_parameters(kind(**law.parameters.inside.members()))
        found: Law = law
        return found

    def numbers(self, robot: Robot) -> tuple[Bundle, Bundle]:
        """Return parameters and memory of wrapper and controller."""
        extents = extents_of(robot) | self._extents
        _, remembered = self.inside.numbers(robot)
        kind: Any = self.function.memory.settable()
        try:
            self.parameters.check(extents)
            own = kind.declared["own"].kind.allocate(extents)
            memory = kind(own=own, held=Held.allocate(extents), inside=remembered)
        except TypeError as error:
            raise ControllerError(
                f"controller {self.function.name!r} does not fit robot {robot.name!r}: {error}"
            ) from error
        parameters: Any = type(self.parameters).settable()
        return parameters(**self.parameters.members()), memory

    def new_log(self, robot: Robot) -> Bundle:
        """Return logs of wrapper and controller."""
        kind: Any = self.function.log.settable()
        own = kind.declared["own"].kind.allocate(extents_of(robot) | self._extents)
        log: Bundle = kind(own=own, inside=self.inside.new_log(robot))
        return log


_MADE = (
    "function", "parameters", "memory", "robot", "period", "stiffness", "damping",
    "commands_voltage", "inside", "_asked", "_wrapper", "_extents", "_late",
)  # fmt: skip


def _again(kind: type[Around], made_of: tuple[Any, ...], more: dict[str, Any]) -> Around:
    """Make a wrapper of what it is made of."""
    wrapper, controller, own, period, extents, late = made_of
    law = kind.__new__(kind)
    Around.__init__(law, wrapper, controller, own, period=period, extents=extents, late=late)
    vars(law).update(more)
    return law


class Composed(ControllerFunction):
    """The function of a wrapper and of the controller inside."""

    def __init__(
        self, wrapper: Wrapper, function: ControllerFunction, text: Any, scope: Any
    ) -> None:
        self._made_of = wrapper, function
        super().__init__(text, function.compiles, scope, function.endings)
        self.is_ours = function.is_ours
        self.partner = function.partner

    def __reduce__(self) -> Any:
        """Copies are made again of wrapper and function."""
        return composed, self._made_of

    def begin(self) -> None:
        """Do nothing: other processes find no function that is made here."""


@lru_cache
def composed(wrapper: Wrapper, function: ControllerFunction) -> Composed:
    """Return the function of a wrapper and of the controller inside."""
    parameters: Any = _bundle(
        "Parameters", turn=part(Turn), own=part(wrapper.parameters),
        inside=part(function.parameters.settable()),
    )  # fmt: skip
    memory: Any = _bundle(
        "Memory", own=part(wrapper.memory), held=part(Held),
        inside=part(function.memory.settable()),
    )  # fmt: skip
    log: Any = _bundle(
        "Log", own=part(wrapper.log, flat=True), inside=part(function.log.settable(), flat=True)
    )
    shown = {
        "state": "memory.own.state", "contacts": "memory.own.contacts",
        "parameters": "parameters.inside", "memory": "memory.inside", "log": "log.inside",
        "torque": "held",
    }  # fmt: skip
    given = ", ".join(shown.get(name, name) for name in function.arguments)
    name = re.sub(r"\W", "_", f"{wrapper.name}_{function.name}")  # a lambda has none
    text = f"""
def {name}({", ".join(ARGUMENTS)}):
    before(t, state, contacts, robot, parameters.own, memory.own, log.own)
    held = memory.held.torque
    if memory.held.calls % parameters.turn.every == 0:
        robot.period = parameters.turn.inside
        inside({given})
        robot.period = parameters.turn.period
    memory.held.calls += 1
    for i in range(torque.shape[0]):
        torque[i] = held[i]
    after(t, state, robot, parameters.own, memory.own, log.own, torque)
"""
    python = function.python
    inner: Any = function.function
    if function.compiles:
        inner = kernel(inner) if is_ours(python) else within_bounds(inner)
    scope: dict[str, Any] = {
        "before": wrapper.before, "after": wrapper.after, "inside": inner,
        "__name__": python.__module__,
    }  # fmt: skip
    # Machine code is kept beside the file of the controller.
    place = getattr(python, "__code__", None)
    exec(compile(text, place.co_filename if place else __file__, "exec"), scope)
    made = scope[name]
    if place is not None:  # Numba looks for source text there: it must be that of a function
        made.__code__ = made.__code__.replace(co_firstlineno=place.co_firstlineno)
    made.__qualname__ = f"{wrapper.name}({python.__qualname__})"
    made.__annotations__ = {"parameters": parameters, "memory": memory, "log": log}
    return Composed(wrapper, function, made, {})


def _bundle(name: str, **members: Any) -> type[Bundle]:
    return type(name, (Bundle,), {"__module__": __name__, **members})
