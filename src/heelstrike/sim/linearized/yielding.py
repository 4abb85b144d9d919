"""Small errors of a motion on compliant ground: its variational equation, with steps of its own.

Position, velocity and the bends of bristles, x = (q, v, s), move by x' = f(x) of
:mod:`heelstrike.sim.compliant.dynamics`, errors by ∂f/∂x along it. Motion and errors are integrated
together by Radau's collocation, which damps what stiff ground damps. Where a point or a joint meets
the ground or its stop, slips or sticks, a step ends: ∂f/∂x jumps there, and f itself where a law
presses at the first touch, as a damper does. An error of x meets that earlier or later by
∇g δx / ġ, and has the jump of f for so long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.linearized.motion import GRAZING
from heelstrike.contact.linearized.partials import FRICTION, differentiated
from heelstrike.contact.linearized.slopes import plane
from heelstrike.dynamics.queries.linearization import solved
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.compliant.corners import Corners
from heelstrike.sim.compliant.dynamics import HELD, Laws, Rates, evaluate
from heelstrike.sim.compliant.law import FrictionForces
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.controller.law import controller_in
from heelstrike.sim.frame import Scene
from heelstrike.sim.linearized.collocation import collocation, stage_equations
from heelstrike.sim.linearized.inputs import TORQUE, Inputs
from heelstrike.sim.linearized.law import AskedAlong
from heelstrike.sim.linearized.time_step import find_pushes
from heelstrike.sim.memory import Memory
from heelstrike.sim.push import share_over_step
from heelstrike.sim.simulation import Simulation

STAGES = 4
"""Nodes of a step, the last its end: collocation of order 7."""

RADAU = 0.5 * (legendre.legroots([0.0] * (STAGES - 1) + [1.0, -1.0]) + 1.0)
RADAU[-1] = 1.0
NODES, MATRIX, WEIGHTS = collocation(RADAU)
COARSE = np.append(collocation(RADAU[:-1])[2], 0.0)
"""Weights of all nodes but the last: of order 3, to tell the error of a step by."""

ACCURATE = 1e-6
"""Error of a step by these weights, in parts of what changes: its own, of order 7, is some 1e-10.
Halving it changes derivatives of bravo7's steps by less than 1e-9 of themselves."""

BEGINS = 1e-7
"""Part of all derivatives of positions, or velocities, above which one must be known as well."""

PENETRATION, SPEED = 1e-4, 0.1
"""Changes of a position (m, rad) or a bend (m), and of a velocity (m/s, rad/s), that matter: parts
of them are told by the same number."""

LAST_CHANGE = 1e-9
"""Last change of Newton's iteration in parts of these: after it there is only rounding."""

NEWTON = 8
"""Iterations after which a step is taken to be too long."""

AT_A_SWITCH = 1e-14
"""Time (s) to which a change of mode is found, so that ∂f/∂x, 1e5 a second on stiff ground, is the
wrong one for a part of 1e-9 at most."""

SHRINK, GROW, SAFETY = 0.2, 4.0, 0.9

AT_LIMITS = "torques reached the limits of the motors, where they cannot be differentiated"
NOT_FOLLOWED = "changes faster than its errors can be followed; use EventDriven()"

RUBBED = 1e-3
"""Change of the coefficient of friction, as a part of it, by which forces of bristles are
differentiated: laws are linear in it, so that any does."""


@kernel
def act(
    model: Model, ground: GroundModel, time: float, laws: Laws, control: Control, memory: Memory,
    corners: Corners, now: Rates, own_rows: Floats, force: Floats,
) -> None:  # fmt: skip
    """Find forces and rates of the state in `memory`, under the commands that are there."""
    scene = Scene(controller_in(control.function), model, ground)
    evaluate(scene, HELD, time, control, memory, laws, corners, now, own_rows, force)


@kernel
def rub_with(factor: float, code: int, law: int, friction: FrictionForces) -> None:
    """Ask a law, by the address of its code and of its numbers, on ground of other friction."""
    for contact in range(friction.friction.shape[0]):
        friction.friction[contact] *= factor
    call_at(code, (law, friction))


@kernel
def address_of_friction(laws: Laws) -> int:
    """Where the numbers of the friction law are."""
    return address_of(laws.friction)


@dataclass(frozen=True)
class Look:
    """The motion at an instant: its rate, derivatives, and which branches its laws are on."""

    rate: Floats
    """(n,) x'."""
    slope: Floats
    """(n, n + k) ∂f by x and the inputs."""
    modes: bytes
    """Which points and joints press, slip, and are beyond ground and stops."""
    beyond: NDArray[np.bool_]
    """(nc + nv,) Points in the ground, and joints beyond a stop."""
    gradient: Floats
    """(nc + nv, nq) Of their gaps by position, but for a sign."""
    pressed: Floats
    """(nv, nc + nv) Accelerations that each of these makes."""


@dataclass(frozen=True)
class Panel:
    """A step of motion and errors."""

    x: Floats
    change: Floats
    """x, change: At its end."""
    last: Look
    modes: tuple[bytes, ...]
    """Of all its nodes."""
    error: float
    """In parts of what is allowed."""


class Yielding:
    """A motion on compliant ground and its errors, from one sample to the next.

    Parameters
    ----------
    simulation : Simulation
        Beside the one that is looked at, for its memory.
    controller : object with ``torque(t, state, contacts)``, or None
        That of the simulation.
    inputs : Inputs
        What else may change, k numbers.
    answers : bool
        Whether its torques answer to errors, or stay what they are.

    Raises
    ------
    SimulationError
        If what happens has no derivative that is known here.
    """

    def __init__(
        self, simulation: Simulation, controller: Controller | None, inputs: Inputs, *,
        answers: bool,
    ) -> None:  # fmt: skip
        self._simulation, self._inputs, self._answers = simulation, inputs, answers
        robot, model = simulation.robot, simulation.robot.model
        normal, friction, _ = plane(simulation.ground)
        wrong = {
            "constraints from outside": bool(robot.constraints),
            "latches": model.latches > 0,
            "brakes": len(simulation.braked) > 0,
            "friction of zero, by which it is to be differentiated,": (
                friction == 0.0 and FRICTION in inputs.numbers
            ),
        }
        for what, there in wrong.items():
            if there:
                raise SimulationError(f"{what} on compliant ground cannot be differentiated yet")
        self.law: AskedAlong | None = None
        if controller is not None and (answers or simulation._control.continuous):
            self.law = AskedAlong(simulation, controller)
        self._normal, self._friction = np.array(normal), friction
        self._at = differentiated(model, inputs.dynamic)
        self._tree = Workspace.allocate({**model.extents, "components": 2})
        self._pushed = np.zeros((robot.nv, robot.nq))
        self.size = robot.nq + robot.nv + robot.nc
        """How many numbers of position, velocity and bends there are."""
        scale = [PENETRATION] * robot.nq + [SPEED] * robot.nv + [PENETRATION] * robot.nc
        self._scale = np.array(scale)
        self._proposed = np.inf

    def begin(self) -> None:
        """Begin where the simulation is; from there on the motion is one of its own accuracy."""
        memory, bends = self._simulation._memory, self._simulation._work.now.friction.bend
        self._x = np.concatenate([memory.q, memory.v, bends[: self._simulation.robot.nc]])

    def flow(self, change: Floats, held: Floats) -> None:
        """Let errors go through the time from the instant of the simulation to the next sample.

        Parameters
        ----------
        change : (n + k, m) float
            Errors of position, velocity, bends and inputs by what is asked for; changed.
        held : (nu, m) float
            Those of torques that are held.
        """
        simulation, size = self._simulation, self.size
        memory, work, begin = simulation._memory, simulation._work, simulation.time
        share_over_step(begin, work.step, memory.pushes)
        x, command = self._x, memory.command.copy()
        error, inputs = change[:size].copy(), change[size:]
        time, bound, span = 0.0, work.step, work.step
        now = self._look(begin, x, command)
        step = min(self._proposed, span)
        while time < span:
            step = min(step, bound - time)
            panel = self._panel(begin + time, step, x, error, inputs, held, now, command)
            if panel is None or any(each != now.modes for each in panel.modes):
                bound = time + step
                if step > AT_A_SWITCH:
                    step *= 0.5
                    continue
                before, now = now, self._switch(begin + time, x, error, now, command)
                if now.modes == before.modes:
                    raise SimulationError(f"the motion at {begin + time:.6g} s {NOT_FOLLOWED}")
                bound, step = span, self._proposed
                continue
            factor = SAFETY * max(panel.error, 1e-9) ** (-1.0 / STAGES)
            if panel.error > 1.0:
                if step <= AT_A_SWITCH:
                    raise SimulationError(f"the motion at {begin + time:.6g} s {NOT_FOLLOWED}")
                step *= max(factor, SHRINK)
                continue
            time = bound if step == bound - time else time + step
            x, error, now = panel.x, panel.change, panel.last
            if time < bound < span:  # half of what is left, up to the change of mode
                left = bound - time  # halves of the last digit would come to no end
                step = 0.5 * left if left > AT_A_SWITCH else left
            else:
                bound, step = span, step * min(factor, GROW)
                self._proposed = step
        change[:size], self._x = error, x

    def _look(self, time: float, x: Floats, command: Floats) -> Look:
        """Look at the motion in a state, its torques held at `command` if no law answers."""
        simulation, inputs = self._simulation, self._inputs
        robot, model, ground = simulation.robot, simulation.robot.model, simulation.ground.model()
        memory, work, size = simulation._memory, simulation._work, self.size
        nq, nv, nc = robot.nq, robot.nv, robot.nc
        q, v, bend = np.split(x, [nq, nq + nv])
        now, friction = work.now, work.now.friction
        memory.q[:], memory.v[:], friction.bend[:nc] = q, v, bend
        memory.command[:] = command
        law = None
        if self.law is not None and simulation._control.continuous:
            simulation._clock.time = time
            law = self.law.now()
            memory.command[:] = law.torque()
        wanted = memory.command.copy()
        act(
            model, ground, time, work.laws, simulation._control, memory, work.corners, now,
            work.now_rows, work.force,
        )  # fmt: skip
        if not np.array_equal(memory.torque, wanted):
            raise SimulationError(AT_LIMITS)
        normal, force = now.normal, work.force[:nc]
        gap, pressed, slides = normal.gap[:nc] < 0.0, normal.force[:nc] > 0.0, friction.slides[:nc]
        off = (q < model.lower, q > model.upper)
        flags = (gap, pressed, pressed & (slides == 1), *off, now.stop.force > 0.0)
        at = self._at
        at.place(q, v, self._normal)
        at.look(
            ahead=0.0, going=v, acceleration=now.acceleration, push=force,
            pull=now.loop[: len(at.balance.pull)],
        )  # fmt: skip
        own, rows = at.partials, at.balance.rows
        down, along = rows[0::2].copy(), rows[1::2].copy()
        press, slip = np.zeros((nc, size)), np.zeros((nc, size))
        press[:, :nq] = _by(normal.by_gap, down) + _by(normal.by_speed, own.along_by_q[0::2])
        press[:, nq : nq + nv] = _by(normal.by_speed, down)
        slip[:, :nq], slip[:, nq : nq + nv] = own.along_by_q[1::2], along
        slip[~gap] = 0.0
        rub = _by(friction.by_normal, press) + _by(friction.by_speed, slip)
        rub[:, nq + nv :] += np.diag(friction.by_bend[:nc])
        rub[~pressed] = 0.0
        bends = _by(friction.rate_by_normal, press) + _by(friction.rate_by_speed, slip)
        bends[:, nq + nv :] += np.diag(friction.rate_by_bend[:nc])
        acting = np.zeros((nv, size + inputs.size))
        acting[:, :size] = down.T @ press + along.T @ rub
        find_pushes(model, q, memory.pushes, self._tree, self._pushed)
        acting[:, :nq] += self._pushed + np.diag(now.stop.by_gap) - own.lacking_by_q
        acting[:, nq : nq + nv] += np.diag(now.stop.by_speed + now.dry_by_speed) - own.lacking_by_v
        motors = np.zeros((nv, robot.nu))
        motors[model.actuator_joint, np.arange(robot.nu)] = 1.0
        acting[:, [size + column for column in inputs.of(TORQUE)]] = motors
        columns = [
            size + column for column in inputs.of_numbers() if column not in inputs.of(FRICTION)
        ]
        acting[:, columns] = -own.lacking_by_numbers
        slope = np.zeros((size, size + inputs.size))
        rate = np.concatenate([v, now.acceleration, friction.rate[:nc]])
        if FRICTION in inputs.numbers:
            column = size + inputs.of(FRICTION)[0]
            rubbed, bent = self._by_friction()
            acting[:, column] += along.T @ (rubbed * pressed)
            slope[nq + nv :, column] = bent
        if law is not None and self._answers:
            acting[:, : nq + nv] += motors @ law.gains()
            acting[:, [size + column for column in inputs.of_parameters()]] += (
                motors @ law.by_parameters(inputs.parameters)
            )
        contacts = down.T * force[:, 0] + along.T * force[:, 1]
        pressing = np.hstack([contacts * pressed, np.diag(now.stop_force)])
        system, turning = self._closed(now.acceleration)
        right = np.zeros((len(system), acting.shape[1] + pressing.shape[1]))
        right[:nv] = np.hstack([acting, pressing])
        right[nv:, : nq + nv] = -turning
        answer = (
            solved(system, right, nv)[:nv] if len(system) > nv else np.linalg.solve(system, right)
        )
        slope[:nq, nq : nq + nv] = np.eye(nq, nv)
        slope[nq : nq + nv], jump = np.split(answer, [acting.shape[1]], axis=1)
        slope[nq + nv :, :size] = bends
        return Look(
            rate, slope, b"".join(each.tobytes() for each in flags),
            np.concatenate([gap, off[0] | off[1]]), np.vstack([down, np.eye(nv)]), jump,
        )  # fmt: skip

    def _by_friction(self) -> tuple[Floats, Floats]:
        """Tangential forces and rates of bends by the ground's coefficient of friction, (nc,)."""
        work, nc = self._simulation._work, self._simulation.robot.nc
        friction, usual = work.now.friction, work.now.friction.friction.copy()
        law, told = address_of_friction(work.laws), []
        for side in (RUBBED, -RUBBED, 0.0):
            friction.friction[:] = usual
            rub_with(1.0 + side, work.laws.friction_code, law, friction)
            told.append((np.array((friction.force, friction.rate)), friction.slides.copy()))
        (more, slid), (less, _), (here, slides) = told
        # Where a little more friction would hold what slides, a little less.
        change = np.where(slid == slides, more - here, here - less) / (RUBBED * self._friction)
        return change[0, :nc], change[1, :nc]

    def _closed(self, acceleration: Floats) -> tuple[Floats, Floats]:
        """Equations of accelerations and loop forces; accelerations of the loops by (q, v)."""
        at, nv = self._at, self._simulation.robot.nv
        mass, loops = at.balance.matrix.copy(), len(at.balance.pull)
        system = np.zeros((nv + loops, nv + loops))
        system[:nv, :nv] = mass
        if not loops:
            return system, np.zeros((0, 2 * nv))
        at.look(ahead=1.0, going=acceleration)
        rows, own = at.loops.jacobian, at.partials
        system[:nv, nv:], system[nv:, :nv] = -rows.T, rows
        return system, np.hstack([own.loop_along_by_q, own.loop_along_by_v])

    def _panel(
        self, begin: float, step: float, x: Floats, change: Floats, inputs: Floats, held: Floats,
        now: Look, command: Floats,
    ) -> Panel | None:  # fmt: skip
        """Take a step, or return None if it is too long for Newton's iteration."""
        size, stage = self.size, step * MATRIX
        rates, looks = np.tile(now.rate, (STAGES, 1)), []
        for _ in range(NEWTON):
            looks = [
                self._look(begin + step * node, x + at, command)
                for node, at in zip(NODES, stage @ rates, strict=True)
            ]
            lacking = rates - [each.rate for each in looks]
            system = stage_equations(stage, [each.slope[:, :size] for each in looks])
            moved = np.linalg.solve(system, lacking.ravel()).reshape(rates.shape)
            if not np.all(np.isfinite(moved)):
                return None
            rates -= moved
            if np.all(np.abs(stage @ moved) <= LAST_CHANGE * self._scale):
                break
        else:
            return None
        torque = [size + column for column in self._inputs.of(TORQUE)]
        right = [
            each.slope[:, :size] @ change
            + each.slope[:, size:] @ inputs
            + each.slope[:, torque] @ held
            for each in looks
        ]
        own = np.linalg.solve(system, np.vstack(right)).reshape(STAGES, *change.shape)
        after = change + step * np.tensordot(WEIGHTS, own, axes=1)
        coarse = step * np.tensordot(WEIGHTS - COARSE, own, axes=1)
        off = step * (WEIGHTS - COARSE) @ rates
        error = max(self._parts(coarse, after), float(np.abs(off / self._scale).max()))
        modes = tuple(each.modes for each in looks)
        end = x + step * WEIGHTS @ rates
        return Panel(end, after, looks[-1], modes, error / ACCURATE)

    def _parts(self, error: Floats, whole: Floats) -> float:
        """Largest error of a block of derivatives, in parts of the block; of bends, of positions.

        What begins within the step does so as a root of time, of which no step tells a part.
        """
        robot, size = self._simulation.robot, self.size - self._simulation.robot.nc
        ends = [robot.nq, robot.nq + robot.nv]
        groups = [slice(0, robot.nq), slice(robot.nq, size)]
        groups += [slice(size + c.start, size + c.stop) for c in self._inputs.columns.values()]
        position, velocity, _ = np.split(whole, ends)
        worst = 0.0
        for own, block in zip(np.split(error, ends), (position, velocity, position), strict=True):
            least = BEGINS * float(np.linalg.norm(block))
            for group in groups:
                part = float(np.linalg.norm(block[:, group])) + least
                worst = max(worst, float(np.linalg.norm(own[:, group])) / part)
        return worst

    def _switch(
        self, time: float, x: Floats, change: Floats, before: Look, command: Floats
    ) -> Look:
        """Look at the motion just after a change of mode, and let errors go through it."""
        nq, nv = self._simulation.robot.nq, self._simulation.robot.nv
        after = self._look(time, x + 2.0 * AT_A_SWITCH * before.rate, command)
        for met in np.flatnonzero(after.beyond & ~before.beyond):
            crossing = float(after.gradient[met] @ before.rate[:nq])
            if abs(crossing) <= GRAZING:
                continue
            jump = np.zeros(self.size)
            jump[nq : nq + nv] = after.pressed[:, met]
            if met < self._simulation.robot.nc:
                bend = nq + nv + met
                jump[bend] = after.rate[bend] - before.rate[bend]
            change += np.outer(jump, after.gradient[met] @ change[:nq] / crossing)
        return after


def _by(values: Floats, rows: Floats) -> Floats:
    """Rows, each times a number."""
    return np.asarray(values[: len(rows), None] * rows)
