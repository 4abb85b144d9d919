"""What a compiled loop needs to ask a controller."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.mold import Mold
from heelstrike.compiler.words import VALUE
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Integers
from heelstrike.sim.controller.guard import guarded_bundle, in_one_block
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlledRobot, ControlState, extents_of
from heelstrike.sim.dimension import AnyRobot, dimension_of

if TYPE_CHECKING:
    from heelstrike.sim.controller.law import Law

# What `Control.conduct` says of the controller: that it is one of this package, whose tests see to
# what it writes; that it is watched; that it wrote beyond its own arrays.
TRUSTED = 0
WATCHED = 1
OVERRAN = 2


class Control(Bundle):
    """The numbers of a controller, and how it is asked."""

    function: Integers = array(VALUE, of=int, address=True)
    """The compiled function, as :func:`~heelstrike.compiler.words.kept_value` reads it."""
    parameters: Integers = array("words", of=int)
    """Words of its parameters; guarded."""
    kept: Integers = array("memory", of=int)
    spare: Integers = array("memory", of=int)
    """kept, spare: Words of its memory and log, and of others for the calls that it shall forget;
    guarded."""
    between_parameters: Integers = array("p", of=int, address=True)
    between_kept: Integers = array("m", of=int, address=True)
    """between_parameters, between_kept: Where in these there are guard words."""
    logged: Integers = array("logged", of=int, address=True)
    """Where among the words of `kept` those of the log are."""
    parameters_at: int = number(int)
    kept_at: int = number(int)
    spare_at: int = number(int)
    log_at: int = number(int)
    spare_log_at: int = number(int)
    """parameters_at, kept_at, spare_at, log_at, spare_log_at: Where the tables of the bundles
    are."""
    state: ControlState = part(ControlState, address=True)
    contacts: Contacts = part(Contacts, address=True)
    robot: ControlledRobot = part(ControlledRobot, address=True)
    """state, contacts, robot: What it is shown."""
    believes: int = number(int)
    """Whether the robot it is shown is another than the one that moves."""
    continuous: int = cell(int)
    """Whether it acts within the steps too; otherwise its torques are held."""
    voltage: int = cell(int)
    """Whether it commands voltages; otherwise torques."""
    in_python: int = cell(int)
    """Whether the loop has to come back for its torques."""
    conduct: int = cell(int)
    """What it has done that it may not."""


class ReadyLaw:
    """A law made ready for a robot: its numbers, a new memory and log, guard words round them.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    law : Law
        The law.
    tree, contacts : Workspace or SpatialWorkspace, and Contacts, optional
        Those of the simulation, which stock controllers are shown; others see copies.
    log : Bundle, optional
        What the log begins with that a controller in Python keeps; by default that of the law.

    Attributes
    ----------
    control : Control
        What loops hand along.
    robot : Robot
        The robot it is shown: that of the law, if it knows another than the one it controls.
    parameters, memory, log : Bundle
        Its numbers, which may be set, what it remembers, and what it tells of itself.

    Raises
    ------
    ControllerError
        If parameters or memory do not fit the robot, or the law knows one that is built otherwise.
    """

    def __init__(
        self, robot: AnyRobot, law: Law, tree: Any = None,
        contacts: Contacts | None = None, log: Bundle | None = None,
    ) -> None:  # fmt: skip
        believes = believes_in_another(law, robot)
        self.robot = robot = law.robot if believes and law.robot is not None else robot
        self._law = law
        extents = extents_of(robot)
        own, laid = _numbers_of(law, robot, log)
        self.parameters, self.memory, self.log = own.parameters, own.kept.memory, own.kept.log
        self._spare = own.spare
        ours = law.function.is_ours and tree is not None and contacts is not None
        sees = {"kinematics": tree} if ours and not believes else {}
        its = dimension_of(robot).shown(robot)
        shown: dict[str, Any] = {
            "state": its.state.allocate(extents, **sees),
            "contacts": contacts if ours else Contacts.allocate(extents),
            "robot": its.robot,
        }
        self._shown: dict[str, Bundle] = {}
        if not ours:
            shown = self._shown = {name: guarded_bundle(each) for name, each in shown.items()}
        self.control = its.control(
            function=np.zeros(VALUE, dtype=np.int64), parameters=own.parameter_words,
            kept=own.kept_words, spare=own.spare_words,
            between_parameters=laid.between[0], between_kept=laid.between[1],
            parameters_at=self.parameters.address, kept_at=self.memory.address,
            spare_at=self._spare.memory.address, log_at=self.log.address,
            spare_log_at=self._spare.log.address, logged=laid.logged,
            believes=believes, conduct=WATCHED if self._shown else TRUSTED, **shown,
        )  # fmt: skip

    def set_parameters(self, parameters: Bundle) -> None:
        """Put other parameters in the place of its own.

        Raises
        ------
        ControllerError
            If they are not such as its own.
        """
        numbers, _ = self._law.with_parameters(parameters).numbers(self.robot)
        try:
            self.parameters.become(numbers)
        except ValueError as error:
            raise ControllerError(
                f"controller {self._law.function.name!r} can only be given parameters of the same "
                f"shapes: {error}"
            ) from error

    def arrays(self) -> Iterator[tuple[str, Any]]:
        """Name the arrays with guard words round them."""
        bundles = {
            "parameters": self.parameters, "memory": self.memory, "log": self.log, **self._shown
        }  # fmt: skip
        for name, bundle in bundles.items():
            yield from bundle.storage(f"{name}.")
        yield from self._spare.memory.storage("memory.")
        yield from self._spare.log.storage("log.")


_NOWHERE = np.zeros(0, dtype=np.int64)


class _Laid(NamedTuple):
    """The numbers of a law for a robot: laid out in blocks, and where in these is what."""

    robot: AnyRobot
    parameters: Bundle
    memory: dict[str, Any]
    mold: Mold[Any]
    between: tuple[Integers, Integers]
    logged: Integers


_LAID: WeakKeyDictionary[Law, _Laid] = WeakKeyDictionary()


def _numbers_of(law: Law, robot: AnyRobot, log: Bundle | None) -> tuple[Any, _Laid]:
    """Return the numbers that a law begins with, and how they were laid out."""
    plain = all(isinstance(value, int | float) for value in law.memory.values())
    if log is not None or not plain:
        laid = _laid_out(law, robot, law.new_log(robot) if log is None else log)
        return laid.mold.cast(), laid
    known = _LAID.get(law)
    wanted = robot, law.parameters, law.memory
    if known is not None and (known.robot, known.parameters, known.memory) == wanted:
        laid = known
    else:
        laid = _LAID[law] = _laid_out(law, robot, law.new_log(robot))
    own = laid.mold.cast()
    places = {name: values for name, _, values in own.parameters.views()}
    for name, _, values in law.parameters.views():  # somebody may have set them
        places[name][...] = values
    return own, laid


def _laid_out(law: Law, robot: AnyRobot, log: Bundle) -> _Laid:
    numbers, memory = law.numbers(robot)
    parameters, parameter_words, between_parameters = in_one_block(numbers)
    kinds: tuple[Any, Any] = type(memory), type(log)
    both = _kept(*kinds)(memory=memory, log=log)
    kept, kept_words, between_kept = in_one_block(both)
    spare, spare_words, _ = in_one_block(both)
    owned: tuple[Any, Any] = type(parameters), type(kept)
    own = _own(*owned)(
        parameters=parameters, kept=kept, spare=spare, parameter_words=parameter_words,
        kept_words=kept_words, spare_words=spare_words,
    )  # fmt: skip
    places = [_places(values, kept_words) for _, _, values in kept.log.views()]
    logged = np.concatenate((*places, _NOWHERE))
    between = between_parameters, between_kept
    return _Laid(robot, law.parameters, dict(law.memory), Mold(own), between, logged)


@cache
def _own(parameters: Any, kept: Any) -> Any:
    """Class of all that is a law's own, with the blocks that its bundles lie in."""
    members = {
        "parameters": part(parameters), "kept": part(kept), "spare": part(kept),
        "parameter_words": array("parameter_words", of=int),
        "kept_words": array("kept_words", of=int), "spare_words": array("kept_words", of=int),
    }  # fmt: skip
    return type("OwnNumbers", (Bundle,), members)


@cache
def _kept(memory: Any, log: Any) -> Any:
    """Class of what a law keeps from call to call."""
    return type("Kept", (Bundle,), {"memory": part(memory), "log": part(log)})


def _places(values: Any, block: Integers) -> Integers:
    """Return where in a block of words those of an array within it are."""
    first = (values.ctypes.data - block.ctypes.data) // block.itemsize
    return np.arange(first, first + values.size)


def believes_in_another(law: Law, robot: AnyRobot) -> bool:
    """Whether a law knows another robot than the one it controls, by any of its numbers.

    Raises
    ------
    ControllerError
        If that one has other joints, actuators or contact points.
    """
    known = law.robot
    if known is None or known is robot or known.model is robot.model:
        return False
    for what in ("joint_names", "actuator_names", "contact_names", "link_names"):
        its, ours = getattr(known, what), getattr(robot, what)
        if its != ours:
            raise ControllerError(
                f"controller {law.function.name!r} knows robot {known.name!r}, whose structure "
                f"differs from that of {robot.name!r}: its {what.replace('_', ' ')} are "
                f"{', '.join(its)}, not {', '.join(ours)}. Only numbers may differ"
            )
    mine, its = robot.model.members(), known.model.members()
    return not all(np.array_equal(mine[name], its[name]) for name in mine)
