"""Runs made up by hand, for tests that know the answer beforehand."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import heelstrike as hs
from heelstrike.dynamics import contact_positions
from heelstrike.robot import read_mjcf
from heelstrike.sim import Certificates, Event, EventKind, RunStatus, SolverCount, Timing
from heelstrike.sim.plane import PLANE
from heelstrike.sim.run import QUANTITIES


def make_run(
    robot: hs.Robot,
    time: ArrayLike,
    *,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    force: ArrayLike | None = None,
    ground: hs.Ground | None = None,
    events: Sequence[Event] = (),
    **others: Any,
) -> hs.Run:
    """Make a run of a robot from what happened in it; whatever is left out is at rest and zero.

    Arrays of one row stand for all rows. Contact points and gaps follow from the positions and the
    ground, which must be flat or a slope.
    """
    ground = hs.Ground() if ground is None else ground
    time = np.asarray(time, dtype=np.float64)
    rows = len(time)

    def full(value: ArrayLike | None, *shape: int) -> np.ndarray:
        return np.broadcast_to(0.0 if value is None else value, (rows, *shape)).astype(np.float64)

    q = full(robot.model.reference if position is None else position, robot.nq)
    normal = np.array([-np.sin(ground.slope), np.cos(ground.slope)])
    center = np.array([contact_positions(robot, row) for row in q]).reshape(rows, robot.nc, 2)
    radius = robot.model.contact_radius
    extents = robot.model.extents | PLANE.row_extents(robot)
    given: dict[str, Any] = {
        "position": q,
        "velocity": velocity,
        "torque": torque,
        "contact_point": center - radius[:, None] * normal,
        "contact_normal": normal,
        "gap": center @ normal - radius,
        "contact_force": force,
    }
    recorded: dict[str, Any] = {
        name: full(given.get(name), *(extents[each] for each in quantity.shape))
        for name, quantity in QUANTITIES.items()
    }
    run = hs.Run(
        robot=robot,
        ground=ground,
        method=hs.TimeStepping(step=float(time[1] - time[0]) if rows > 1 else 1e-3),
        status=RunStatus.COMPLETED,
        message="made up",
        time=time,
        **recorded,
        events=tuple(events),
        certificates=Certificates(0.0, 0.0, 0.0, 0.0),
        solver=SolverCount("lemke", rows, 0, 0, 0),
        steps=max(rows - 1, 0),
        saturations=0,
        timing=Timing(0.0, 0.1),
    )
    return dataclasses.replace(run, **others)


def touchdown(time: float, contact: int, impulse: float = 0.0) -> Event:
    """Return the event of a contact point that meets the ground."""
    return Event(time, EventKind.TOUCHDOWN, contact, (impulse, 0.0))


def liftoff(time: float, contact: int) -> Event:
    """Return the event of a contact point that leaves the ground."""
    return Event(time, EventKind.LIFTOFF, contact, (0.0, 0.0))


def pushes(robot: hs.Robot, feet: Sequence[Sequence[int]], newtons: float = 100.0) -> np.ndarray:
    """Contact forces (nt, nc, 2) of rows in each of which the given feet push."""
    force = np.zeros((len(feet), robot.nc, 2))
    for row, standing in enumerate(feet):
        for foot in standing:
            force[row, list(robot.feet[foot].contacts), 0] = newtons
    return force


SUMMARY_KEYS = {
    "status",
    "steps",
    "distance_m",
    "duration_s",
    "gait",
    "tracking_rms_rad",
    "zmp_min_m",
    "zmp_max_m",
    "zmp_limits_m",
    "friction_use_max",
    "slip_max_m",
    "penetration_max_m",
    "complementarity_max",
    "solver",
    "cost_of_transport",
    "compile_s",
    "wall_s",
    "real_time_factor",
}
"""What the summary of a run has at the least."""

BOX = """
<mujoco model="box">
  <worldbody>
    <geom type="plane" size="10 1 0.1"/>
    <body name="box" pos="0 0 {height}">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" type="hinge" axis="0 1 0"/>
      <geom type="box" size="0.1 0.1 0.05" mass="2"/>
    </body>
  </worldbody>
</mujoco>
"""

PENDULUM = """
<mujoco model="pendulum">
  <worldbody>
    <body name="rod" pos="0 0 2">
      <joint name="swing" type="hinge" axis="0 1 0" damping="{damping}" armature="0.05"
             limited="{limited}" range="-60 60"/>
      <inertial pos="0 0 -0.5" mass="3" diaginertia="0.1 0.1 0.1"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="swing"/></actuator>
</mujoco>
"""


def box(height: float = 0.05) -> hs.Robot:
    """Return a block of 2 kg, 0.2 m long and 0.1 m high, its middle `height` above the origin."""
    return read_mjcf(BOX.format(height=height), name="box")


def pendulum(damping: float = 0.0, *, limited: bool = False) -> hs.Robot:
    """Return a driven pendulum of 3 kg, its centre of mass 0.5 m under the hinge.

    When `limited`, it has stops at ±60°.
    """
    xml = PENDULUM.format(damping=damping, limited=str(limited).lower())
    return read_mjcf(xml, name="pendulum")
