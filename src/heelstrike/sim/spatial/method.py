"""Time stepping of robots in space, as the frame of simulations calls it."""

from __future__ import annotations

from typing import Any, ClassVar

from heelstrike.compiler.bundle import Bundle, number
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.spatial.certified_solve import try_ways
from heelstrike.contact.spatial.ground import SpatialGroundModel
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind, Scheme
from heelstrike.sim.frame import DONE, SOLVER_FAILED, Common, Kernels, Scene
from heelstrike.sim.method import Method
from heelstrike.sim.record.recording import FARTHEST, FASTEST
from heelstrike.sim.setting import Setting
from heelstrike.sim.spatial.controlled import (
    SpatialControl,
    ask_in_space,
    limit_torque_in_space,
)
from heelstrike.sim.spatial.memory import SpatialMemory
from heelstrike.sim.spatial.record import (
    NO_IMPULSE,
    SpatialRecord,
    log_spatial_event,
    note_deepest,
    note_row_when_due,
    note_spatial_events,
)
from heelstrike.sim.spatial.stepping import find_state, take_step
from heelstrike.sim.spatial.table import lay_out_table
from heelstrike.sim.time_stepping import TimeStepping
from heelstrike.sim.time_stepping.method import refuse_restitution

# ruff: noqa: ARG001 - the kernels of all methods have the same arguments

ENERGY_GAIN = int(EventKind.ENERGY_GAIN)
UNCERTIFIED = int(EventKind.UNCERTIFIED)

BY_NATURE = (
    "in space a point that begins to slide chooses among all directions, and comes to rest by "
    "stopping in two of them at once: events of that kind are not located yet"
)
SPRINGS = "its springs and dampers of the ground are written for the plane"

SCHEMES = (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED)
"""Those that there are in space."""

OF_THE_PLANE = ("solver", "activation", "bounded_restitution")
"""Settings of time stepping that nothing in space asks for."""


class SpatialStepping(Bundle):
    """What the kernels of time stepping in space read."""

    step: float = number(float)
    """Length of a step (s)."""
    resolves: int = number(int)
    """Whether impacts are whole within their step."""


@dataclass(frozen=True)
class InSpace(Method):
    """How a robot in space goes through time."""

    settings: TimeStepping
    """What the user asked for."""

    work: ClassVar[Any] = SpatialStepping

    @property
    def asked_for(self) -> Method:
        """The time stepping that the user asked for."""
        return self.settings

    @property
    def name(self) -> str:
        """What runs and files call it."""
        return self.settings.name

    @property
    def step_length(self) -> float:  # type: ignore[override]
        """Length of every step."""
        return self.settings.step

    @property
    def row_period(self) -> tuple[str, float]:
        """A row a step."""
        return self.settings.row_period

    @property
    def solves_with(self) -> str:
        """What is tried first, and mostly does."""
        return "newton"

    def new_work(self, robot: Any) -> SpatialStepping:  # noqa: ARG002 - the same for all
        """Return what its kernels read."""
        resolves = self.settings.scheme is Scheme.IMPACT_RESOLVED
        return SpatialStepping(step=self.settings.step, resolves=int(resolves))

    def room(self, robot: Any) -> tuple[int, int]:
        """Return how many rows and events a step may add to the record."""
        return 1, 2 * len(lay_out_table(robot, walls=False).kind) + 4

    def check(self, setting: Setting) -> None:
        """Refuse what is for the plane only, and restitution where impacts are plastic."""
        refuse_restitution(self.settings.scheme, setting, (Scheme.IMPACT_RESOLVED,))
        if setting.checked:
            raise SimulationError(
                "checked=True looks at the indices of laws of robots in the plane; in space leave "
                "it out, and make the law with compile=False to see what Python says of it"
            )


def way_in_space(method: Method) -> InSpace:
    """Return the time stepping that a simulation in space goes by.

    Raises
    ------
    SimulationError
        If it is another method, or a scheme of the plane only; with the reason.
    """
    if isinstance(method, InSpace):
        return method
    if not isinstance(method, TimeStepping):
        why = {"EventDriven": BY_NATURE, "Compliant": SPRINGS}.get(type(method).__name__, "")
        raise SimulationError(
            f"{type(method).__name__} simulates robots in the plane only"
            f"{why and f': {why}'}. For a robot in space use TimeStepping(step=...)"
        )
    if method.scheme not in SCHEMES:
        raise SimulationError(
            f"Scheme.{method.scheme.name} is for robots in the plane; in space there are "
            f"{' and '.join(f'Scheme.{scheme.name}' for scheme in SCHEMES)}"
        )
    for name in OF_THE_PLANE:
        if getattr(method, name) != getattr(TimeStepping, name):
            raise SimulationError(
                f"TimeStepping({name}={getattr(method, name)!r}) is for robots in the plane; leave "
                f"{name} out"
            )
    return InSpace(method)


@dissolved_kernel
def sound_in_space(q: Floats, v: Floats) -> bool:
    """Whether the state is finite and not absurd."""
    bad = 0
    for i in range(q.shape[0]):
        bad += not abs(q[i]) < FARTHEST
    for i in range(v.shape[0]):
        bad += not abs(v[i]) < FASTEST
    return bad == 0


@kernel
def height_of_mass(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace
) -> float:
    """Height of the centre of mass above the plane of the ground, along its normal."""
    mass = x = y = z = 0.0
    inertia, pivot, normal = tree.inertia, tree.pivot, ground.normal
    for i in range(model.nl):
        mass += inertia[i, 0]
        x += inertia[i, 1]
        y += inertia[i, 2]
        z += inertia[i, 3]
    along = normal[0] * (pivot[0] + x / mass) + normal[1] * (pivot[1] + y / mass)
    return along + normal[2] * (pivot[2] + z / mass) - ground.height


@dissolved_kernel
def prepare(
    model: SpatialModel, ground: SpatialGroundModel, memory: SpatialMemory,
    work: SpatialStepping,
) -> None:  # fmt: skip
    """Find equations of motion and contact points of the state now."""
    find_state(
        model, ground, memory.q, memory.v, memory.equations, memory.blocks, memory.contacts,
        memory.feet,
    )  # fmt: skip


@dissolved_kernel
def decide(
    scene: Scene, control: SpatialControl, memory: SpatialMemory, work: SpatialStepping,
    record: SpatialRecord, clock: Clock,
) -> int:  # fmt: skip
    """Find the state at the end of the step.

    The robot itself stays where it is: a step may be decided that is not taken.
    """
    model, step, q, v = scene.model, memory.step, memory.q, memory.v
    note_deepest(memory.feet.foot.shape[0], memory.blocks.gap, memory.tally)
    for i in range(model.nq):
        memory.kept_q[i] = q[i]
    for k in range(model.nv):
        memory.kept_v[k] = v[k]
    done = take_step(model, scene.ground, clock.time, work.step, work.resolves == 1, memory)
    for i in range(model.nq):
        step.q[i] = q[i]
        q[i] = memory.kept_q[i]
    for k in range(model.nv):
        step.v[k] = v[k]
        v[k] = memory.kept_v[k]
    if step.halved == 1:  # what is recorded is of this instant
        prepare(model, scene.ground, memory, work)
    return DONE if done else SOLVER_FAILED


@dissolved_kernel
def move(
    scene: Scene, control: SpatialControl, memory: SpatialMemory, work: SpatialStepping,
    record: SpatialRecord, clock: Clock,
) -> int:  # fmt: skip
    """Take the step that was decided, and note what happens in it."""
    step, tally = memory.step, memory.tally
    end = clock.start + (clock.index + 1) * work.step
    note_spatial_events(
        clock.time, end, work.step, tally.steps == 0, step.v, memory.reaction.slip,
        memory.blocks, record.told, memory.reported,
    )  # fmt: skip
    if step.uncertified == 1:
        log_spatial_event(end, UNCERTIFIED, -1, NO_IMPULSE, record.told)
    if step.energy_gain > 0.0:
        log_spatial_event(end, ENERGY_GAIN, -1, NO_IMPULSE, record.told)
    for i in range(memory.q.shape[0]):
        memory.q[i] = step.q[i]
    for k in range(memory.v.shape[0]):
        memory.v[k] = step.v[k]
    tally.steps += step.parts
    tally.uncertified += step.uncertified
    tally.halved += step.halved
    tally.relaxed += step.relaxed
    tally.energy_gain += step.energy_gain
    clock.time = end
    return DONE


COMMON = Common(
    (SpatialModel, SpatialGroundModel, SpatialControl, SpatialMemory, SpatialRecord),
    sound_in_space, ask_in_space, limit_torque_in_space, height_of_mass,
    note_row_when_due, try_ways,
)  # fmt: skip

InSpace.kernels = Kernels(None, prepare, decide, None, move, COMMON)
