"""Where the energy of a run comes from and goes to."""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.actuation import actuator_power
from heelstrike.analysis.intervals import (
    brake_impulse,
    event_impulse,
    friction_work,
    impulses_in_events,
    mean_over_intervals,
    stop_impulse,
)
from heelstrike.analysis.motion import motion, run_motion
from heelstrike.dynamics import point_jacobian
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.run import Run


@dataclass(frozen=True, eq=False)
class EnergyBalance:
    """Energy of the robot and the work done on it since the first row, row by row, in J."""

    time: Floats
    """(nt,) Seconds."""
    kinetic: Floats
    potential: Floats
    """kinetic, potential: (nt,) Energy of links, rotors and joint springs; zero height is z = 0."""
    actuators: Floats
    """(nt,) Work of the actuators."""
    dampers: Floats
    """(nt,) Work of the joint dampers, never positive in exact motion."""
    contacts: Floats
    """(nt,) Work of the ground: impacts and sliding friction. An exact contact never adds
    energy."""
    stops: Floats
    """(nt,) Work of the joint stops, of which the same is true."""
    dry_friction: Floats
    """(nt,) Work of dry friction in the joints, never positive in exact motion."""
    brakes: Floats
    """(nt,) Work of the brakes, never positive in exact motion."""
    pushes: Floats
    """(nt,) Work of the pushes."""

    @property
    def total(self) -> Floats:
        """Mechanical energy, (nt,), in J."""
        return self.kinetic + self.potential

    @property
    def residual(self) -> Floats:
        """Change of energy that no work explains, (nt,), in J: the error of the time method."""
        gained = self.total - self.total[:1]
        known = self.actuators + self.dampers + self.contacts + self.stops
        return gained - known - self.dry_friction - self.brakes - self.pushes


def energy_balance(run: Run) -> EnergyBalance:
    """Balance the energy of a run against the work done on its robot.

    Work between two rows is impulse times the mean of the velocities at the two, which for an
    impact is exactly the change of kinetic energy. With ``record_every`` above 1 rows stand for
    the steps between them, and the balance is only as good as the sampling; that of an
    event-driven run is of second order in its `output_period`.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    EnergyBalance
        Energy of each row and the work up to it.
    """
    robot, model = run.robot, run.robot.model
    held = np.diff(run.time)
    mean = 0.5 * (run.velocity[:-1] + run.velocity[1:])
    at_rows = run_motion(run)
    over_steps = motion(robot, run.position[:-1], mean, run.contact_point[:-1])
    if impulses_in_events(run):
        at_instants = (run.world_force * at_rows.contact_velocity).sum(axis=(1, 2))
        contact_work = mean_over_intervals(run, at_instants) * held
        jumps = event_impulse(run)
    else:
        contact_work = np.zeros_like(held)
        jumps = run.world_force[:-1] * held[:, None, None]
    contact_work = contact_work + (jumps * over_steps.contact_velocity).sum(axis=(1, 2))
    stop_work = mean_over_intervals(run, run.stop_torque) * held[:, None] + stop_impulse(run)
    damper_power = -(mean * mean_over_intervals(run, run.velocity)) @ model.damping

    brake_work = friction_work(run, run.brake_torque, run.velocity[:, model.brake_joint])
    brake_work = brake_work + brake_impulse(run) * mean[:, model.brake_joint]

    def summed(work: Floats) -> Floats:
        return np.concatenate(([0.0], np.cumsum(work)))[: len(run.time)]

    return EnergyBalance(
        time=run.time,
        kinetic=at_rows.kinetic,
        potential=at_rows.potential,
        actuators=summed(actuator_power(run).sum(axis=1) * held),
        dampers=summed(damper_power * held),
        contacts=summed(contact_work),
        stops=summed((stop_work * mean).sum(axis=1)),
        dry_friction=summed(friction_work(run, run.friction_torque, run.velocity).sum(axis=1)),
        brakes=summed(brake_work.sum(axis=1)),
        pushes=summed(_push_work(run, mean)),
    )


def _push_work(run: Run, mean: Floats) -> Floats:
    """Work of the pushes between the rows, (nt − 1,), in J; `mean` are the mean velocities."""
    robot = run.robot
    work = np.zeros(len(mean))
    for push in run.pushes:
        link, point = push.place(robot)
        acting = push.time_within(run.time[:-1], run.time[1:])
        for row in np.flatnonzero(acting):
            before = point_jacobian(robot, run.position[row], link, point)[:2]
            if impulses_in_events(run):
                after = point_jacobian(robot, run.position[row + 1], link, point)[:2]
                moved = 0.5 * (before @ run.velocity[row] + after @ run.velocity[row + 1])
            else:
                moved = before @ mean[row]
            work[row] += acting[row] * np.dot(push.force, moved)
    return work
