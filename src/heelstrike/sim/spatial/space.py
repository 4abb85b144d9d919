"""Space: what simulations of robots in it are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.compilation import loop_for
from heelstrike.compiler.mold import Mold
from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.ground import SpatialGround, SpatialGroundModel
from heelstrike.dynamics import spatial
from heelstrike.errors import ControllerError, SimulationError
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot, checked_state, quaternion_places
from heelstrike.robot.state import State
from heelstrike.robot.warning import warn
from heelstrike.sim.batch.result import SpatialBatchResult
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law
from heelstrike.sim.dimension import Dimension, Shown
from heelstrike.sim.method import Method
from heelstrike.sim.setting import Setting
from heelstrike.sim.spatial.controlled import (
    SpatialControl,
    SpatialControlState,
    view_of,
    words_in_space,
)
from heelstrike.sim.spatial.held_gains import too_high
from heelstrike.sim.spatial.memory import (
    SpatialMemory,
    SpatialScratch,
    allocate_spatial_memory,
    beside_scratch,
    spatial_mold,
    spatial_scratch,
)
from heelstrike.sim.spatial.method import InSpace, way_in_space
from heelstrike.sim.spatial.record import SpatialRecord
from heelstrike.sim.spatial.run import RECORDED, SpatialCertificates, SpatialRun
from heelstrike.sim.spatial.stepping import find_state
from heelstrike.sim.spatial.table import (
    BALL_STOP,
    NEVER_TOUCHED,
    POINT,
    STOP,
    WALL,
    most_rows_of,
)
from heelstrike.sim.time_stepping.doubts import SimulationWarning
from heelstrike.tolerances import STANDING_GAP


class Space(Dimension):
    """Space x, y, z."""

    ground = SpatialGround
    flat = SpatialGround()
    run = SpatialRun
    quantities = RECORDED
    batch_result = SpatialBatchResult
    record = SpatialRecord
    certificates = SpatialCertificates
    compiles_meanwhile = False  # what it would compile is for the plane
    solved = ("solves", "shortcuts", "fallbacks", "failures")

    def way_of(self, method: Method) -> InSpace:
        """Return the time stepping of space, or refuse what is for the plane."""
        return way_in_space(method)

    def row_extents(self, robot: SpatialRobot) -> dict[str, int]:
        """Extents of rows that the model of a robot does not tell."""
        return {"components": 3}

    def checked_ground(self, ground: Any) -> SpatialGround:
        """Return a ground, that of the plane taken for all y, or refuse what is none."""
        if ground is None:
            return self.flat
        if isinstance(ground, SpatialGround):
            return ground
        if isinstance(ground, Ground):
            return SpatialGround.of_plane(ground)
        raise SimulationError(
            f"ground must be a SpatialGround or a Ground, got {type(ground).__name__}"
        )

    def checked_state(self, robot: SpatialRobot, state: Any) -> State:
        """Return a state of a robot with quaternions of length one, or refuse what is none."""
        return checked_state(robot, state)

    def is_free(self, robot: SpatialRobot) -> bool:
        """Whether any finite numbers are a state: quaternions are of length one."""
        return not quaternion_places(robot.model)

    def height(self, robot: SpatialRobot, state: State, ground: SpatialGround) -> float:
        """Height of the centre of mass above the plane of the ground, along its normal (m)."""
        center = spatial.center_of_mass(robot, state.q)
        return float(np.dot(ground.model().normal, center) - ground.model().height)

    def check(self, way: Method, setting: Setting) -> None:
        """Refuse what cannot be simulated."""
        way.check(setting)

    def new_memory(self, setting: Setting) -> SpatialMemory:
        """Allocate the memory of a simulation."""
        return allocate_spatial_memory(
            setting.robot, setting.pushes, walls=has_walls(setting.ground)
        )

    def begin(self, setting: Setting, memory: SpatialMemory) -> None:
        """Let the memory of a simulation be as the setting says."""
        memory.q[:], memory.v[:] = setting.state.q, setting.state.v

    def scratch(self, settings: Sequence[Setting]) -> SpatialScratch:
        """Allocate what solvers scribble on, for the largest of some simulations."""
        tables = [
            (self.mold(each).cast().blocks, each.robot.model)
            for each in {(each.robot, has_walls(each.ground)): each for each in settings}.values()
        ]
        entries = max(len(table.kind) for table, _ in tables)
        rows = max(most_rows_of(table) for table, _ in tables)
        return spatial_scratch(entries, rows, [model for _, model in tables])

    def mold(self, setting: Setting) -> Mold[SpatialMemory]:
        """Return the mold of the memory of a simulation, with nothing to scribble on."""
        return spatial_mold(setting.robot, walls=has_walls(setting.ground))

    def with_scratch(self, memory: SpatialMemory, scratch: SpatialScratch) -> SpatialMemory:
        """Return a memory that its solvers scribble beside."""
        return beside_scratch(memory, scratch)

    def tallied(self, memory: SpatialMemory, solves_with: str) -> dict[str, Any]:
        """Return counts and worst values of a simulation, as fields of a run."""
        found = super().tallied(memory, solves_with)
        return found | {"solver": replace(found["solver"], relaxed=memory.tally.relaxed)}

    def words_of(self, law: Law) -> Any:
        """Words by which loops find the machine code of a law."""
        return words_in_space(law.function)

    def shown(self, robot: SpatialRobot) -> Shown:
        """Return what the laws of a robot are shown."""
        return Shown(SpatialControl, SpatialControlState, view_of(robot))

    def commands_voltage(self, controller: Any, robot: SpatialRobot) -> bool:
        """Refuse a controller that commands voltages."""
        if getattr(controller, "commands_voltage", False):
            raise ControllerError(
                f"{type(controller).__name__} commands voltages, which motors of robots in the "
                "plane understand; in space command torques"
            )
        return False

    def doubt_gains(
        self, robot: SpatialRobot, law: Law | None, memory: SpatialMemory, step: float, steps: int
    ) -> None:
        """Warn of gains that are too high for torques held over so many steps (s)."""
        told = too_high(robot, law, memory.q, step, steps)
        if told:
            warn(told, SimulationWarning)

    def look(self, robot: SpatialRobot) -> SpatialLook:
        """Return what looks at the contact points of a simulation."""
        return SpatialLook(robot)

    def gaps(
        self, robot: SpatialRobot, state: State, ground: SpatialGround
    ) -> tuple[Floats, Floats]:
        """Gaps of contact points in a state (m), (nc,), and how far up their normals point."""
        seen = SpatialLook(robot).in_state(ground, state.q, state.v)
        return seen.gap, seen.normal[:, 2]

    def way_out(self, ground: SpatialGround) -> str:
        """Say what gets a state out of a ground."""
        beside = ", or move it away from the box that it is in" if has_walls(ground) else ""
        return f"raise the robot{beside}"

    def moved(self, state: State, robot: SpatialRobot, memory: SpatialMemory) -> None:
        """Nothing touches what it touched before."""
        memory.blocks.touching[:] = NEVER_TOUCHED
        memory.wedge.wedged = NEVER_TOUCHED

    def check_fit(self, ground: SpatialGround, memory: SpatialMemory) -> None:
        """Refuse boxes where there were none, or none where there were some."""
        kinds = memory.blocks.kind
        if POINT in kinds and has_walls(ground) is not (WALL in kinds):
            now, before = ("boxes", "none") if has_walls(ground) else ("no boxes", "some")
            raise SimulationError(
                f"this ground has {now}, and the simulation began on one with {before}: begin "
                "another simulation with this ground, from state=simulation.state"
            )

    def laid(self, memory: SpatialMemory) -> None:
        """What touched other ground says nothing of this one."""
        table = memory.blocks
        stays = np.isin(table.kind, (STOP, BALL_STOP))
        table.touching[~stays] = NEVER_TOUCHED
        memory.wedge.wedged = NEVER_TOUCHED

    def unsolved(self, now: str, memory: SpatialMemory) -> str:
        """Say that nothing could certify a contact problem, and what it is like."""
        return (
            f"no contact impulses could be certified at {now}, nor in parts of the step: "
            f"residual {memory.tally.unsolved:.3g}. A smaller step may get past it"
        )


def has_walls(ground: SpatialGround) -> bool:
    """Whether contact points may meet other faces of a ground than the one below them."""
    return len(ground.boxes) > 0


class SpatialLook:
    """A look at a simulation that leaves its memory as it is.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    """

    def __init__(self, robot: SpatialRobot) -> None:
        self._robot = robot

    def in_state(self, ground: SpatialGround, q: Floats, v: Floats) -> Contacts:
        """Return the contact points in a state, without forces."""
        own = spatial_mold(self._robot, walls=has_walls(ground)).cast()
        own.q[:], own.v[:] = q, v
        _find()(self._robot.model, ground.model(), own)
        return own.contacts

    def friction(self, ground: SpatialGround, q: Floats, v: Floats) -> Floats:
        """Coefficient (nc,) of the face under each contact point; NaN of one that is at a wall too.

        What a record has of such a point is the sum of two forces, each with its own cone.
        """
        own = spatial_mold(self._robot, walls=has_walls(ground)).cast()
        find_state(
            self._robot.model, ground.model(), q, v, own.equations, own.blocks, own.contacts,
            own.feet,
        )  # fmt: skip
        table, points = own.blocks, slice(self._robot.nc)
        walls, nearest = table.kind == WALL, np.full(self._robot.nc, np.inf)
        np.minimum.at(nearest, table.owner[walls], table.gap[walls])
        return np.where(nearest <= STANDING_GAP, np.nan, table.friction[points])

    def at_contacts(self, ground: SpatialGround, memory: SpatialMemory) -> Contacts:
        """Return the contact points of the state now, with the forces of the step before."""
        contacts = self.in_state(ground, memory.q, memory.v)
        contacts.force[:] = memory.contacts.force
        return contacts


@cache
def _find() -> Any:
    def find_now(model: SpatialModel, ground: SpatialGroundModel, memory: SpatialMemory) -> int:
        find_state(
            model, ground, memory.q, memory.v, memory.equations, memory.blocks, memory.contacts,
            memory.feet,
        )  # fmt: skip
        return 0

    kinds = SpatialModel, SpatialGroundModel, SpatialMemory
    return loop_for(types.int64(*(kind.compiled_type() for kind in kinds)), find_now)


SPACE = Space()
