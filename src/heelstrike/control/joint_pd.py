"""Springs and dampers on the joints about a gait, with as much feedforward as one likes.

    Γ = Γ_ff + kp (q_ref − q) + kd (q̇_ref − q̇)

Γ_ff is nothing, what bears the weight on the stance foot (q̈ = q̇ = 0), or what the gait needs
(q̈ = q̈_ref, at the state as it is). Unlike computed torque the feedback does not go through the
mass matrix: gains are in N m/rad, as motor drives have them.
"""

from __future__ import annotations

from enum import StrEnum

from numpy.typing import ArrayLike

from heelstrike.arguments import one_of
from heelstrike.compiler.bundle import array, number
from heelstrike.control.arguments import check_gait, gains_of
from heelstrike.control.computed_torque import pitch_of
from heelstrike.control.followed_gait import FollowedGait, followed
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Gait
from heelstrike.gait.polynomials import motion_in_piece, place_in_step
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance_clock import StanceClock, exchange_at_touchdown, has_landed


class Feedforward(StrEnum):
    """How much of the robot's dynamics a law of springs and dampers feeds forward.

    Attributes
    ----------
    NONE
        Nothing.
    GRAVITY
        The torques that bear the weight on the flat stance foot, at rest.
    FULL
        Those that the gait needs: inertia, velocities and weight.
    """

    NONE = "none"
    GRAVITY = "gravity"
    FULL = "full"


class Parameters(FollowedGait):
    """Numbers of the law."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Stiffness (N m/rad) and damping (N m s/rad)."""
    weight: int = number(int)
    motion: int = number(int)
    """weight, motion: Whether the weight, and whether velocities and accelerations are fed
    forward."""


class Memory(StanceClock):
    """What the law remembers."""

    position: Floats = array("nu")
    velocity: Floats = array("nu")
    acceleration: Floats = array("nu")
    """position, velocity, acceleration: Of the gait."""


@controller
def joint_pd(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    exchange_at_touchdown(
        t, t - memory.start, parameters.earliest, contacts, robot.contact_foot, memory
    )
    landed = has_landed(t, parameters.landing, state, contacts, robot, memory)
    piece, inside, moves = place_in_step(
        t - memory.start, parameters.latest, parameters.breakpoints
    )
    terms = parameters.coefficients[memory.stance, piece]
    for i in range(robot.nu):
        position, velocity, acceleration = motion_in_piece(terms, i, inside, moves)
        memory.position[i] = position
        memory.velocity[i] = velocity
        memory.acceleration[i] = parameters.motion * acceleration
        torque[i] = 0.0
    if parameters.weight == 1:
        seen = state
        if parameters.motion == 0:
            seen = robot.estimate
            for j in range(robot.nq):
                seen.q[j] = state.q[j]
            for j in range(robot.nv):
                seen.v[j] = 0.0
            robot.update(seen)
        robot.flat_foot_torque(seen, memory.stance, memory.acceleration, torque)
    for i in range(robot.nu):
        torque[i] += parameters.kp[i] * (memory.position[i] - state.joint_position[i])
        if landed:
            torque[i] += parameters.kd[i] * (memory.velocity[i] - state.joint_velocity[i])


class JointPD(Law):
    """Follow a gait on flat feet with springs and dampers on the joints, step after step.

    Parameters
    ----------
    robot : Robot
        A floating robot with two feet, mirror symmetric, all joints but the trunk's actuated, or
        driven by such through closed loops and couplings.
    gait : Gait
        The gait to follow, on flat feet.
    kp, kd : float or (nu,) array
        Stiffness (N m/rad) and damping (N m s/rad).
    feedforward : Feedforward or its name
        What is known of the dynamics: ``"none"``, ``"gravity"`` or ``"full"``.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or gait or gains do not fit it.

    Notes
    -----
    Torques are held over a step of time stepping: the damping of a joint that moves little inertia,
    an ankle in swing, must stay below inertia over step, or the linearly implicit scheme be used.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    >>> law = hs.JointPD(robot, gait, kp=1000.0, kd=20.0, feedforward="full")
    >>> hs.simulate(robot, law, state=gait.initial_state, duration=1.4).completed
    True
    """

    def __init__(
        self,
        robot: Robot,
        gait: Gait,
        *,
        kp: ArrayLike,
        kd: ArrayLike,
        feedforward: Feedforward | str = Feedforward.FULL,
    ) -> None:
        check_gait(robot, gait)
        refuse_loops(robot, "springs and dampers about a gait", ControllerError, loops=False)
        pitch_of(robot)
        known = one_of(Feedforward, "feedforward", feedforward, ControllerError)
        if gait.point_feet:
            raise ControllerError(
                "springs and dampers about a gait need flat feet; for a gait on point feet use "
                "ComputedTorque"
            )
        kp, kd = gains_of("kp", kp, robot), gains_of("kd", kd, robot)
        parameters = Parameters(
            kp=kp,
            kd=kd,
            **followed(gait),
            weight=int(known is not Feedforward.NONE),
            motion=int(known is Feedforward.FULL),
        )
        begin = {"stance": gait.stance_foot, "landed": 1}
        super().__init__(joint_pd, parameters, memory=begin, robot=robot, stiffness=kp, damping=kd)
        self.gait = gait
