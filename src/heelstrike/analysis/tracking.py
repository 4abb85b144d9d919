"""How closely the joints follow a gait (paper Figure 3).

The reference is the one that :class:`heelstrike.control.ComputedTorque` follows. Its phase
restarts, and left and right change places, when the swing foot is on the ground in the second half
of a step; a step that lasts longer than planned goes on along its polynomials for a tenth of its
duration and then holds still. All of it follows from the touchdowns of the run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.analysis.support import stances
from heelstrike.control.followed_motion import EARLIEST, LATEST
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.run import Run
from heelstrike.tolerances import SAME_ROW

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


@dataclass(frozen=True, eq=False)
class ReferenceMotion:
    """What a controller that follows a gait wanted the joints to do, row by row."""

    position: Floats
    velocity: Floats
    """position, velocity: (nt, nu) Reference of the actuated joints, in the order of the actuators
    (rad, rad/s)."""
    stance: Integers
    """(nt,) Index of the foot taken for the stance foot."""
    phase: Floats
    """(nt,) Time since the step began, in s."""
    starts: tuple[float, ...]
    """Times at which steps began, in s."""


def reference_motion(run: Run, gait: Gait) -> ReferenceMotion:
    """Reconstruct the reference that a run followed, from its touchdowns (paper eq. 41).

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait
        The gait it was to follow.

    Returns
    -------
    ReferenceMotion
        Positions and velocities that the joints were to have in each row.

    Raises
    ------
    GaitError
        If the gait does not fit the robot of the run.
    """
    gait.check_joints(run.robot)
    starts = _step_starts(run, gait)
    step = np.searchsorted(np.array(starts) - SAME_ROW, run.time, side="right") - 1
    step = np.maximum(step, 0)
    stance = (gait.stance_foot + step) % 2
    phase = run.time - np.array(starts)[step]
    followed = np.minimum(phase, LATEST * gait.step_duration)
    late = (phase > LATEST * gait.step_duration)[:, None]
    position, velocity = gait.in_step(followed), gait.in_step(followed, order=1)
    other = (stance != gait.stance_foot)[:, None]
    position = np.where(other, gait.mirrored(position), position)
    velocity = np.where(other, gait.mirrored(velocity, order=1), velocity)
    velocity = np.where(late, 0.0, velocity)
    return ReferenceMotion(position, velocity, stance, phase, tuple(starts))


def _step_starts(run: Run, gait: Gait) -> list[float]:
    """Times at which the phase of a gait restarts: the swing foot is down after half a step."""
    if not len(run.time):
        return [0.0]
    on_ground = stances(run)
    starts = [float(run.time[0])]
    swing = 1 - gait.stance_foot
    while True:
        earliest = starts[-1] + EARLIEST * gait.step_duration
        landed = [
            max(stance.touchdown, earliest)
            for stance in on_ground
            if stance.foot == swing and stance.liftoff > earliest
        ]
        if not landed or landed[0] > run.time[-1] + SAME_ROW:
            return starts
        starts.append(landed[0])
        swing = 1 - swing


@dataclass(frozen=True, eq=False)
class TrackingError:
    """Measured minus reference motion of the actuated joints."""

    reference: ReferenceMotion
    """The reference."""
    position: Floats
    velocity: Floats
    """position, velocity: (nt, nu) Errors in rad and rad/s."""

    @property
    def rms(self) -> float:
        """Root mean square of the position error over all rows and joints, in rad."""
        return float(np.sqrt((self.position**2).mean()))

    @property
    def max(self) -> float:
        """Largest position error of any joint, in rad."""
        return float(np.abs(self.position).max())


def tracking_error(run: Run, gait: Gait) -> TrackingError:
    """Compare the joints of a run with the gait they were to follow (paper Figure 3).

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait
        The gait it was to follow.

    Returns
    -------
    TrackingError
        Errors by row and joint, and the reference.

    Raises
    ------
    GaitError
        If the gait does not fit the robot of the run.
    """
    reference = reference_motion(run, gait)
    joints = run.robot.model.actuator_joint
    return TrackingError(
        reference,
        run.position[:, joints] - reference.position,
        run.velocity[:, joints] - reference.velocity,
    )
