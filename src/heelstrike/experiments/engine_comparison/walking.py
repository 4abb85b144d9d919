"""A robot under a controller of ours in another engine, recorded as a run.

The engine moves the robot; the controller is called with the engine's state and contact forces at
the beginning of each control period, and its torques are held until the next. What the engine tells
is written down as the run that our own methods leave, so that every analysis and figure of runs
says of it what it says of ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.analysis.motion import in_world, motion
from heelstrike.dynamics import center_of_mass, contact_positions
from heelstrike.errors import SimulationError
from heelstrike.experiments.engines.peer import Peer
from heelstrike.robot import Robot, State
from heelstrike.robot.model import Floats
from heelstrike.sim import Controller
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import UnknownMethod
from heelstrike.sim.plane import PLANE
from heelstrike.sim.run import QUANTITIES, Certificates, Event, Run, SolverCount, Timing

FALLEN = 0.5
"""Height of the centre of mass, in that at the start, below which a robot has fallen, as of our own
runs."""

WHOLE = 1e-6
"""How far a control period may be from a whole number of steps, in steps."""

LEAST_FORCE = 1e-9
"""Normal forces below this part of the weight are none, as for our own runs."""


def walk_in(
    peer: Peer,
    controller: Law | Controller | None,
    *,
    control_period: float,
    name: str = "engine",
    begins: float = 0.0,
) -> Run:
    """Simulate the scenario of a peer under a controller, and record it as a run.

    Parameters
    ----------
    peer : Peer
        The engine with its scenario, which has no law of control of its own.
    controller : law, controller or None
        Called every control period; no torques without one.
    control_period : float
        Seconds between two calls; a longer step of the engine goes before.
    name : str
        What the method of the run is called.
    begins : float
        Time (s) at which it begins, for the controller and in the run.

    Returns
    -------
    Run
        One row a step. Its `timing` is that of the engine's steps alone.

    Raises
    ------
    SimulationError
        If the control period is not a whole number of steps.
    InvalidRunError
        If the engine ends, hangs or refuses.
    """
    scenario, step = peer.scenario, peer.step
    robot = scenario.robot
    each = max(1, round(control_period / step))
    if control_period > step and abs(control_period / step - each) > WHOLE:
        raise SimulationError(
            f"the control period, {control_period:g} s, is not a multiple of the step, {step:g} s"
        )
    asked = asked_of(robot, controller)
    model = robot.model
    nq, both = robot.nq, robot.nq + robot.nv
    rows = np.zeros((peer.steps + 1, both + 2 * robot.nc))
    torques = np.zeros((peer.steps + 1, robot.nu))
    rows[0, :nq], rows[0, nq:both] = peer.start.q, peer.start.v
    peer.restart()
    least = FALLEN * float(center_of_mass(robot, peer.start.q)[1])
    status, saturations, done = RunStatus.COMPLETED, 0, 0
    while done < peer.steps:
        q, v = rows[done, :nq], rows[done, nq:both]
        if asked is not None:
            force = rows[done, both:].reshape(-1, 2)
            wanted = asked.torque(begins + done * step, State(q, v), seen(robot, q, force))
            torque = np.clip(wanted, model.torque_lower, model.torque_upper)
            saturations += int(np.sum(torque != wanted))
            peer.hold(torque)
            torques[done : done + each] = torque
        count = min(each, peer.steps - done)
        rows[done + 1 : done + 1 + count] = peer.record(count)
        done += count
        if not np.all(np.isfinite(rows[done, :both])):
            status = RunStatus.DIVERGED
            break
        if robot.floating and center_of_mass(robot, rows[done, :nq])[1] < least:
            status = RunStatus.FELL
            break
    finite = np.all(np.isfinite(rows[: done + 1, :both]), axis=1)
    if not finite.all():
        done = int(np.argmin(finite)) - 1
    # A row has the state, and the torques and forces of the step that follows.
    force = np.concatenate((rows[1 : done + 1, both:], np.zeros((1, 2 * robot.nc))))
    force[-1] = force[-2] if done else 0.0
    torques[done] = torques[max(done - 1, 0)]
    return recorded_run(
        peer, name,
        time=np.asarray(begins + step * np.arange(done + 1), dtype=np.float64),
        position=rows[: done + 1, :nq], velocity=rows[: done + 1, nq:both],
        torque=torques[: done + 1], force=force.reshape(done + 1, -1, 2),
        status=status, saturations=saturations,
    )  # fmt: skip


def recorded_run(
    peer: Peer,
    name: str,
    *,
    time: Floats,
    position: Floats,
    velocity: Floats,
    torque: Floats,
    force: Floats,
    status: RunStatus,
    saturations: int,
) -> Run:
    """Make a run of what an engine told.

    Parameters
    ----------
    peer : Peer
        Where it was told of.
    name : str
        What the method of the run is called.
    time, position, velocity, torque : (nt,), (nt, nq), (nt, nv), (nt, nu) float
        Of each row.
    force : (nt, nc, 2) float
        On the contact points in the step after each row, upwards and forward (N).
    status : RunStatus
        How it ended.
    saturations : int
        Torques that were cut to their limits.
    """
    robot = peer.scenario.robot
    model = robot.model
    extents = model.extents | PLANE.row_extents(robot)
    rows = len(time)
    given: dict[str, Any] = {
        "position": position, "velocity": velocity, "torque": torque, "contact_force": force
    }  # fmt: skip
    points = np.zeros((rows, robot.nc, 2))
    placed = motion(robot, position, velocity, points)
    link = model.contact_link
    points = in_world(
        placed.link_origin[:, link], placed.link_angle[:, link], model.contact_position
    )
    points[..., 1] -= model.contact_radius
    given["contact_point"] = points
    given["gap"] = points[..., 1]
    given["contact_normal"] = np.broadcast_to([0.0, 1.0], points.shape)
    moved = motion(robot, position, velocity, points)
    touching = force[..., 0] > LEAST_FORCE * robot.weight
    slip = np.zeros((rows, robot.nc))
    slip[:-1] = np.where(touching[:-1], moved.contact_velocity[1:, :, 0], 0.0)
    given["slip_velocity"] = slip
    recorded: dict[str, Any] = {
        name: np.ascontiguousarray(
            np.broadcast_to(
                given.get(name, 0.0), (rows, *(extents[str(each)] for each in quantity.shape))
            ),
            dtype=np.float64,
        )
        for name, quantity in QUANTITIES.items()
    }
    deepest = max(0.0, -float(points[..., 1].min(initial=0.0)))
    return Run(
        robot=robot,
        ground=peer.scenario.ground,
        method=UnknownMethod(name, {"step": peer.step}),
        status=status,
        message=f"{name}: {status.value} after {time[-1]:.3f} s",
        time=time,
        **recorded,
        events=_events(time, points[..., 1], force, touching, peer.step),
        certificates=Certificates(deepest, 0.0, 0.0, 0.0),
        solver=SolverCount(name, 0, 0, 0, 0),
        steps=rows - 1,
        saturations=saturations,
        timing=Timing(0.0, peer.seconds),
    )


def asked_of(robot: Robot, controller: Law | Controller | None) -> Any:
    """Return a controller as it is asked from Python.

    Parameters
    ----------
    robot : Robot
        The robot that it moves.
    controller : law, controller or None
        The controller.
    """
    if isinstance(controller, Law):
        return AskedLaw(robot, controller, compiled=True)
    return controller


def seen(robot: Robot, q: Floats, force: Floats) -> Contacts:
    """Return the contact points as a controller sees them.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : (nq,) float
        Where it is.
    force : (nc, 2) float
        On its contact points, upwards and forward (N).
    """
    points = contact_positions(robot, q).reshape(-1, 2).copy()
    points[:, 1] -= robot.model.contact_radius
    normal = np.zeros_like(points)
    normal[:, 1] = 1.0
    return Contacts(position=points, normal=normal, gap=points[:, 1].copy(), force=force.copy())


def _events(
    time: Floats, gap: Floats, force: Floats, touching: Any, step: float
) -> tuple[Event, ...]:
    """Return touchdowns and lift-offs: where the force on a point begins and ends.

    A point that is below the ground when its force begins met it where its way crossed the ground;
    one that is above it does so by the end of the step.
    """
    changes = np.diff(touching.astype(np.int8), axis=0)
    found = []
    for row, contact in np.argwhere(changes):
        after = row + 1
        if changes[row, contact] < 0:
            found.append(Event(float(time[after]), EventKind.LIFTOFF, int(contact), (0.0, 0.0)))
            continue
        high, low = gap[row, contact], gap[after, contact]
        if low > 0.0:
            when = time[min(after + 1, len(time) - 1)]
        elif high > 0.0:
            when = time[row] + step * high / (high - low)
        else:
            when = time[after]
        normal, tangent = step * force[after, contact]
        found.append(
            Event(float(when), EventKind.TOUCHDOWN, int(contact), (float(normal), float(tangent)))
        )
    return tuple(sorted(found, key=lambda event: event.time))
