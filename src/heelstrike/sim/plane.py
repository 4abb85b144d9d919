"""The plane: what simulations of robots in it are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from heelstrike.compiler.mold import Mold
from heelstrike.contact.ground import Ground, GroundModel
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactWorkspace
from heelstrike.dynamics.queries.momenta import center_of_mass
from heelstrike.errors import SimulationError
from heelstrike.once_each import once_each
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.batch.result import BatchResult
from heelstrike.sim.contacts.brakes import braked_joints, brakes_of, brakes_on, put_on
from heelstrike.sim.contacts.latches import latches_at, latches_of
from heelstrike.sim.contacts.loops import HOLDS, PUT_ON
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.law import Law, commands_voltage
from heelstrike.sim.controller.robot import ControlState, robot_view
from heelstrike.sim.dimension import Dimension, Shown
from heelstrike.sim.look import Look
from heelstrike.sim.memory import Memory, allocate_memory
from heelstrike.sim.method import Method, check_constraints
from heelstrike.sim.record.record import ROW_EXTENTS, Record
from heelstrike.sim.run import QUANTITIES, SOLVED, Certificates, Run
from heelstrike.sim.setting import Setting, check_state


class Plane(Dimension):
    """The plane x, z."""

    ground = Ground
    flat = Ground()
    run = Run
    quantities = QUANTITIES
    batch_result = BatchResult
    record = Record
    certificates = Certificates
    compiles_meanwhile = True
    solved = SOLVED

    def way_of(self, method: Method) -> Method:
        """Return a method as it is."""
        return method

    def row_extents(self, robot: Robot) -> dict[str, int]:
        """Extents of rows that the model of a robot does not tell."""
        return ROW_EXTENTS | {"constraints": len(robot.constraints)}

    def checked_ground(self, ground: Any) -> Ground:
        """Return a ground, the usual one if none is given, or refuse what is none."""
        given = self.flat if ground is None else ground
        if not isinstance(given, Ground):
            raise SimulationError(f"ground must be a Ground, got {type(ground).__name__}")
        return given

    def checked_state(self, robot: Robot, state: State) -> State:
        """Return a state of a robot, or refuse what is none."""
        check_state(robot, state)
        return state

    def is_plain(self, robot: Robot, ground: GroundModel) -> bool:
        """Whether there are points and stops only, on one segment of ground."""
        return not has_rare_rows(robot) and ground.friction.size == 1 and ground.curved == 0

    def is_free(self, robot: Robot) -> bool:
        """Whether any finite numbers are a state: those of closed loops have to close them."""
        return not (robot.model.loops or robot.model.couplings)

    def height(self, robot: Robot, state: State, ground: Ground) -> float:
        """Height of the centre of mass above the ground below it (m)."""
        x, z = center_of_mass(robot, state.q)
        return float(z - float(ground.height(x)))

    def held(
        self, robot: Robot, state: State, ground: Ground, latched: Any, braked: Any
    ) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
        """Which latches and brakes hold as a simulation begins."""
        return latches_at(robot, state, ground, latched), brakes_of(robot, braked)

    def check(self, way: Method, setting: Setting) -> None:
        """Refuse what cannot be simulated."""
        check_constraints(way, setting)
        way.check(setting)

    def new_memory(self, setting: Setting) -> Memory:
        """Allocate the memory of a simulation."""
        return allocate_memory(setting.robot, setting.pushes)

    def begin(self, setting: Setting, memory: Memory) -> None:
        """Let the memory of a simulation be as the setting says."""
        memory.q[:] = setting.state.q
        memory.v[:] = setting.state.v
        memory.loops.held[:] = setting.held
        put_on(setting.robot, setting.braked, setting.state, HOLDS, memory)

    def scratch(self, settings: Sequence[Setting]) -> ContactWorkspace:
        """Allocate what solvers scribble on, for the largest of some simulations."""
        robots = {setting.robot for setting in settings}
        most = max(max(len(allocate_memory(robot).rows.kind), 1) for robot in robots)
        return contact_workspace(most, ready=False)

    def mold(self, setting: Setting) -> Mold[Memory]:
        """Return the mold of the memory of a simulation, with nothing to scribble on."""
        return _mold_of(setting.robot)

    def with_scratch(self, memory: Memory, scratch: ContactWorkspace) -> Memory:
        """Return a memory that its solvers scribble beside."""
        mine = memory.solver
        return memory.replaced(solver=scratch.replaced(settings=mine.settings, tally=mine.tally))

    def words_of(self, law: Law) -> Any:
        """Words by which loops find the machine code of a law."""
        return law.function.words

    def shown(self, robot: Robot) -> Shown:
        """Return what the laws of a robot are shown."""
        return Shown(Control, ControlState, robot_view(robot))

    def commands_voltage(self, controller: Any, robot: Robot) -> bool:
        """Return whether a controller commands voltages, or refuse one that cannot."""
        return commands_voltage(controller, robot)

    def take_gains(self, robot: Robot, law: Law | None, voltage: bool, memory: Memory) -> None:
        """Note which joint forces an implicit scheme takes at the end of a step."""
        model = robot.model
        driven = model.actuator_joint
        memory.stiffness[:] = model.stiffness
        memory.damping[:] = model.damping
        if law is not None:
            memory.stiffness[driven] += 0.0 if law.stiffness is None else law.stiffness
            memory.damping[driven] += 0.0 if law.damping is None else law.damping
        if voltage:
            memory.damping[driven] += model.stall_torque[driven] / model.no_load_speed[driven]

    def look(self, robot: Robot) -> Look:
        """Return what looks at the contact points of a simulation."""
        return Look(robot)

    def gaps(self, robot: Robot, state: State, ground: Ground) -> tuple[Floats, Floats]:
        """Gaps of contact points in a state (m), (nc,), and how far up their normals point."""
        at = contact_kinematics(robot, state.q, state.v, ground)
        return at.gap, at.normal[:, 1]

    def way_out(self, ground: Ground) -> str:
        """Say what gets a state out of a ground."""
        return "robot.placed(state, ground) gives a state that is not"

    def latched(self, robot: Robot, memory: Memory) -> tuple[str, ...]:
        """Joints that latches hold."""
        held = memory.loops.held
        return tuple(name for name, one in zip(robot.latch_names, held, strict=True) if one)

    def latch(
        self, robot: Robot, state: State, ground: Ground, joints: Iterable[str | int],
        memory: Memory,
    ) -> None:  # fmt: skip
        """Let latches hold these joints and no others."""
        memory.loops.held[:] = latches_at(robot, state, ground, joints)

    def braked(self, robot: Robot, memory: Memory) -> tuple[str, ...]:
        """Joints whose brakes are on."""
        return braked_joints(robot, memory.loops.braked)

    def brake(
        self, robot: Robot, state: State, joints: Iterable[str | int], memory: Memory
    ) -> None:
        """Put the brakes of these joints on, and let the others go."""
        put_on(robot, brakes_of(robot, joints), state, PUT_ON, memory)

    def still_latched(self, robot: Robot, joints: Any, memory: Memory) -> list[str]:
        """Which of these joints a latch holds now."""
        named = latches_of(robot, joints)
        held = self.latched(robot, memory)
        return [joint for joint in held if robot.joint_index(joint) in named]

    def would_brake(self, robot: Robot, joints: Any, memory: Memory) -> bool:
        """Whether the brakes of these joints, and no others, are not those that are on."""
        return brakes_of(robot, joints) != brakes_on(memory.loops)

    def moved(self, state: State, robot: Robot, memory: Memory) -> None:
        """Brakes hold where the robot is now."""
        memory.loops.brake_position[:] = state.q[robot.model.brake_joint]

    def unsolved(self, now: str, memory: Memory) -> str:
        """Say that nothing could certify a contact problem, and what it is like."""
        residual = memory.assembly.answer.residual.tolist()
        return f"no contact solver could certify a solution at {now}; residuals {residual}"


PLANE = Plane()


@once_each
def _mold_of(robot: Robot) -> Mold[Memory]:
    nothing = contact_workspace(1, ready=False)
    return Mold(allocate_memory(robot).replaced(solver=nothing))


@once_each
def has_rare_rows(robot: Robot) -> bool:
    """Whether a robot has rows of other kinds than contact points and joint stops."""
    model = robot.model
    dry = model.dry_friction.any() or np.isfinite(model.brake_limit).any()
    joints = model.loops or model.couplings or model.latches or model.brakes
    return bool(dry or joints or robot.constraints)
