"""What depends on whether a robot lives in the plane or in space, and on nothing else.

Simulation, batch, record and files are written once. What differs they ask of the dimension of the
robot: the classes of its memory, ground and run, and what is to be said about its states.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

from numpy.typing import NDArray

from heelstrike.arguments import refusal
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.sim.controller.interface import Contacts
    from heelstrike.sim.controller.law import Law
    from heelstrike.sim.method import Method
    from heelstrike.sim.run import AnyRun, Quantity
    from heelstrike.sim.setting import Setting

AnyRobot = Robot | SpatialRobot


class Look(Protocol):
    """A look at contact points that leaves the memory of a simulation as it is."""

    def at_contacts(self, ground: Any, memory: Any) -> Contacts:
        """Return the contact points of the state now, with the forces of the step before."""
        ...


class Shown(NamedTuple):
    """What laws are shown.

    Attributes
    ----------
    control : type
        Class of what loops hand along.
    state : type
        Class of the state.
    robot : Bundle
        The robot.
    """

    control: Any
    state: Any
    robot: Any


class Dimension(ABC):
    """The plane, or space; nothing has latches, brakes or an implicit scheme by itself."""

    ground: ClassVar[type]
    """Class of its ground, which makes one of numbers by `of_numbers`."""
    flat: ClassVar[Any]
    """Its ground where nobody gives one."""
    run: ClassVar[type[AnyRun]]
    quantities: ClassVar[Mapping[str, Quantity]]
    """run, quantities: Class of its runs, and what they record."""
    batch_result: ClassVar[Any]
    """Class of what many simulations came to; its fields are what is counted of each."""
    record: ClassVar[Any]
    """Class of its records."""
    certificates: ClassVar[type]
    """Worst values of a run, all of them in the tally of its memory."""
    compiles_meanwhile: ClassVar[bool]
    """Whether another process may compile a stock law while the loop is compiled."""
    solved: ClassVar[tuple[str, ...]]
    """What is counted of the contact problems of a run, in the tally of its solver."""

    def way(self, method: Any) -> Method:
        """Return what goes through time as a method says, time stepping if none is asked for.

        Refuse what is no method, and one that is not for it.
        """
        from heelstrike.sim.method import Method, UnknownMethod
        from heelstrike.sim.time_stepping import TimeStepping

        if isinstance(method, UnknownMethod):
            raise SimulationError(
                f"{method.name} is here as data only, as its file tells of it; load the run with "
                f"the class, or those of its laws: load_run(path, classes=[{method.name}])"
            )
        if not (method is None or isinstance(method, Method)):
            raise SimulationError(
                f"method must be a simulation method such as TimeStepping(), got {method!r}"
                + (f"; write {method.__name__}()" if isinstance(method, type) else "")
            )
        return self.way_of(TimeStepping() if method is None else method)

    @abstractmethod
    def way_of(self, method: Method) -> Method:
        """Return what goes through time as a method says, or refuse one that is not for it."""

    @abstractmethod
    def row_extents(self, robot: Any) -> dict[str, int]:
        """Extents of rows that the model of a robot does not tell."""

    @abstractmethod
    def checked_ground(self, ground: Any) -> Any:
        """Return a ground, the usual one if none is given, or refuse what is none."""

    @abstractmethod
    def checked_state(self, robot: Any, state: Any) -> State:
        """Return a state of a robot, or refuse what is none."""

    def is_plain(self, robot: Any, ground: Any) -> bool:
        """Whether a robot and the numbers of a ground have none of ``sim.frame.PLAIN``."""
        return False

    @abstractmethod
    def is_free(self, robot: Any) -> bool:
        """Whether any finite numbers are a state of a robot."""

    @abstractmethod
    def height(self, robot: Any, state: State, ground: Any) -> float:
        """Height of the centre of mass above the ground (m)."""

    def held(
        self, robot: Any, state: State, ground: Any, latched: Any, braked: Any
    ) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
        """Which latches and brakes hold as a simulation begins."""
        _refuse_joints(robot, "latches", latched)
        _refuse_joints(robot, "brakes", braked)
        return (), ()

    @abstractmethod
    def check(self, way: Method, setting: Setting) -> None:
        """Refuse what cannot be simulated."""

    @abstractmethod
    def new_memory(self, setting: Setting) -> Any:
        """Allocate the memory of a simulation."""

    @abstractmethod
    def begin(self, setting: Setting, memory: Any) -> None:
        """Let the memory of a simulation be as the setting says."""

    @abstractmethod
    def scratch(self, settings: Sequence[Setting]) -> Any:
        """Allocate what solvers scribble on, for the largest of some simulations."""

    @abstractmethod
    def mold(self, setting: Setting) -> Any:
        """Return the mold of the memory of a simulation, with nothing to scribble on."""

    @abstractmethod
    def with_scratch(self, memory: Any, scratch: Any) -> Any:
        """Return a memory that its solvers scribble beside."""

    @abstractmethod
    def words_of(self, law: Law) -> Any:
        """Words by which loops find the machine code of a law."""

    @abstractmethod
    def shown(self, robot: Any) -> Shown:
        """Return what the laws of a robot are shown."""

    @abstractmethod
    def commands_voltage(self, controller: Any, robot: Any) -> bool:
        """Return whether a controller commands voltages, or refuse one that cannot."""

    def take_gains(  # noqa: B027 - not every dimension has such a scheme
        self, robot: Any, law: Law | None, voltage: bool, memory: Any
    ) -> None:
        """Note which joint forces an implicit scheme takes at the end of a step."""

    def doubt_gains(  # noqa: B027 - in the plane they are not judged
        self, robot: Any, law: Law | None, memory: Any, step: float, steps: int
    ) -> None:
        """Warn of gains that are too high for torques held over so many steps, where judged."""

    @abstractmethod
    def look(self, robot: Any) -> Look:
        """Return what looks at the contact points of a simulation."""

    @abstractmethod
    def gaps(self, robot: Any, state: State, ground: Any) -> tuple[Floats, Floats]:
        """Gaps of contact points in a state (m), (nc,), and how far up their normals point."""

    @abstractmethod
    def way_out(self, ground: Any) -> str:
        """Say what gets a state out of a ground."""

    def latched(self, robot: Any, memory: Any) -> tuple[str, ...]:
        """Joints that latches hold."""
        return ()

    def latch(
        self, robot: Any, state: State, ground: Any, joints: Iterable[str | int], memory: Any
    ) -> None:
        """Let latches hold these joints and no others."""
        _refuse_joints(robot, "latches", joints)

    def braked(self, robot: Any, memory: Any) -> tuple[str, ...]:
        """Joints whose brakes are on."""
        return ()

    def brake(self, robot: Any, state: State, joints: Iterable[str | int], memory: Any) -> None:
        """Put the brakes of these joints on, and let the others go."""
        _refuse_joints(robot, "brakes", joints)

    def still_latched(self, robot: Any, joints: Any, memory: Any) -> list[str]:
        """Which of these joints a latch holds now."""
        _refuse_joints(robot, "latches", joints)
        return []

    def would_brake(self, robot: Any, joints: Any, memory: Any) -> bool:
        """Whether the brakes of these joints, and no others, are not those that are on."""
        _refuse_joints(robot, "brakes", joints)
        return False

    @abstractmethod
    def moved(self, state: State, robot: Any, memory: Any) -> None:
        """See to what follows from a state that was set from outside."""

    def check_fit(self, ground: Any, memory: Any) -> None:  # noqa: B027 - there may be for any
        """Refuse a ground that a simulation which has begun has no memory for."""

    def laid(self, memory: Any) -> None:  # noqa: B027 - methods may remember that themselves
        """Forget what touches the ground, because another has been laid."""

    @abstractmethod
    def unsolved(self, now: str, memory: Any) -> str:
        """Say that nothing could certify a contact problem, and what it is like."""

    def ground_of(self, numbers: Mapping[str, NDArray[Any]]) -> Any:
        """Make a ground of its numbers."""
        kind: Any = self.ground
        return kind.of_numbers(numbers)

    @property
    def worst(self) -> tuple[str, ...]:
        """What is in its certificates."""
        kind: Any = self.certificates
        return tuple(each.name for each in fields(kind))

    @property
    def tallied_names(self) -> tuple[str, ...]:
        """Counts and worst values in the tally of a simulation."""
        return ("steps", "saturations", *self.worst)

    def counted(self, memory: Any) -> dict[str, Any]:
        """Return counts and worst values of a simulation."""
        return {
            **{name: getattr(memory.tally, name) for name in self.tallied_names},
            **{name: getattr(memory.solver.tally, name) for name in self.solved},
        }

    def nothing_counted(self) -> dict[str, Any]:
        """Return the same of one that has not begun."""
        return dict.fromkeys((*self.tallied_names, *self.solved), 0)

    def tallied(self, memory: Any, solves_with: str) -> dict[str, Any]:
        """Return counts and worst values of a simulation, as fields of a run."""
        from heelstrike.sim.run import SolverCount

        found = self.counted(memory)
        return {
            "certificates": self.certificates(**{name: found[name] for name in self.worst}),
            "solver": SolverCount(solves_with, **{name: found[name] for name in self.solved}),
            "steps": found["steps"],
            "saturations": found["saturations"],
        }


def _refuse_joints(robot: Any, what: str, joints: Any) -> None:
    """Refuse joints that latches or brakes are to hold."""
    from heelstrike.sim.contacts.latches import several

    if joints is not None and len(tuple(several(what, joints))) > 0:
        raise SimulationError(
            f"{what} are for robots in the plane; robot {robot.name!r} in space has none"
        )


def dimension_of(robot: Any) -> Dimension:
    """Return the dimension that a robot lives in; space is loaded with the first of its robots.

    Raises
    ------
    SimulationError
        If it is no robot.
    """
    if isinstance(robot, SpatialRobot):
        from heelstrike.sim.spatial.space import SPACE

        return SPACE
    if not isinstance(robot, Robot):
        raise SimulationError(refusal("robot", robot, ("Robot",)))
    from heelstrike.sim.plane import PLANE

    return PLANE
