"""What a robot makes of the torques that its controller asks for: delay, bandwidth, gears.

Limits of torque and speed-torque lines are the robot's own, as
:mod:`heelstrike.sim.controller.motors` has them, and act after all this; so does dry friction of
its joints, which is exact there.
"""

from __future__ import annotations

import math

from heelstrike.arguments import positive, takes
from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.around import Around, Shown, Wrapper, copy, copy_contacts, own_period
from heelstrike.control.sensing import periods
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState


class Parameters(Bundle):
    """Numbers of the actuators."""

    late: int = number(int)
    """Calls by which torques come late."""
    share: float = number(float)
    """Part of what is missing of a torque that is there after a period, at its mean."""
    left: float = number(float)
    """Part of it that is still missing at the end of the period."""
    efficiency: float = number(float)
    """Of the gears."""


class Memory(Shown):
    """What the actuators remember."""

    calls: int = cell(int)
    asked: Floats = array("late + 1", "nu")
    """Torques of the last calls, a ring."""
    present: Floats = array("nu")
    """Torque of the motors now."""


class Log(Bundle):
    """What was asked for, and what came of it, in the run."""

    asked_torque: Floats = array(
        "nu", unit="N m", label="torques that the controller asked for, before delay and bandwidth"
    )
    given_torque: Floats = array(
        "nu", unit="N m", label="torques that the actuators gave, before limits of the motors"
    )


@kernel
def look(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,  # noqa: ARG001
    parameters: Parameters, memory: Memory, log: Log,  # noqa: ARG001
) -> None:  # fmt: skip
    """Show the controller inside what is shown to this."""
    seen, told = memory.state, memory.contacts
    copy(state.q, seen.q)
    copy(state.v, seen.v)
    robot.update(seen)
    copy_contacts(contacts, told)


@kernel
def act(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters,  # noqa: ARG001
    memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Let torques come late, build up as fast as the motors can, and go through gears."""
    rows = memory.asked.shape[0]
    row, then = memory.calls % rows, (memory.calls - parameters.late) % rows
    known = memory.calls >= parameters.late
    for i in range(torque.shape[0]):
        memory.asked[row, i] = torque[i]
        log.asked_torque[i] = torque[i]
        wanted = memory.asked[then, i] if known else 0.0
        missing = wanted - memory.present[i]
        given = memory.present[i] + parameters.share * missing
        memory.present[i] = wanted - parameters.left * missing
        # A gear takes its share of the power that goes through it, whichever way that is.
        if parameters.efficiency < 1.0:
            if given * state.joint_velocity[i] > 0.0:
                given *= parameters.efficiency
            elif given * state.joint_velocity[i] < 0.0:
                given /= parameters.efficiency
        torque[i] = given
        log.given_torque[i] = given
    memory.calls += 1


ACTUATED = Wrapper("actuated", look, act, Parameters, Memory, Log)


class Actuated(Around):
    """A controller whose torques go through actuators: any controller, compiled or in Python.

    Parameters
    ----------
    controller : Controller
        What decides the torques.
    delay : float
        By how much later torques act, in s; a whole number of periods. Until then there are none.
    bandwidth : float, optional
        Frequency (Hz) at which the motors follow with 1/√2 of the amplitude: a lag of first order,
        found exactly over a period and held at its mean. By default they follow at once.
    efficiency : float
        Of the gears, from 0 to 1: a joint that is driven feels this part of the torque of the
        motor, one that drives the motor feels the torque divided by it. Dry friction and damping
        of joints are numbers of the robot.
    period : float, optional
        Seconds between two calls; by default that of the controller, 1 ms at most.

    Raises
    ------
    ControllerError
        If a number cannot be.

    Notes
    -----
    The run's log holds ``asked_torque`` and ``given_torque``; ``run.torque`` is what acted, within
    the limits of the motors.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> class Steady:
    ...     def torque(self, t, state, contacts):
    ...         return np.full(6, 2.0)
    >>> import numpy as np
    >>> slow = hs.Actuated(Steady(), delay=2e-3)
    >>> run = hs.simulate(robot, slow, state=robot.reference_state(), duration=0.004)
    >>> run.torque[:, 0].tolist()
    [0.0, 0.0, 2.0, 2.0, 2.0]
    """

    @takes(ControllerError)
    def __init__(
        self, controller: Controller, *, delay: float = 0.0, bandwidth: float | None = None,
        efficiency: float = 1.0, period: float | None = None,
    ) -> None:  # fmt: skip
        period = own_period(ACTUATED.name, controller, period)
        late = periods("delay", delay, period)
        share, left = 1.0, 0.0
        if bandwidth is not None:
            positive("the bandwidth", bandwidth, ControllerError, "Hz")
            passed = 2.0 * math.pi * bandwidth * period
            left = math.exp(-passed)
            share = 1.0 - (1.0 - left) / passed
        if not 0.0 < efficiency <= 1.0:
            raise ControllerError(f"the efficiency must be above 0, at most 1, got {efficiency!r}")
        own = Parameters(late=late, share=share, left=left, efficiency=efficiency)
        slow = late > 0 or bandwidth is not None
        super().__init__(
            ACTUATED, controller, own, period=period, extents={"late": late}, late=slow
        )
        if self.commands_voltage and efficiency < 1.0:
            raise ControllerError(
                f"controller {self.function.name!r} commands voltages, to which efficiency "
                "does not apply: leave efficiency out, and give the motor's numbers at "
                "the joint"
            )
        self.delay, self.bandwidth, self.efficiency = delay, bandwidth, efficiency
