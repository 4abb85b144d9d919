"""The robot as a compiled controller sees it: its state, and questions about its dynamics.

All positions, velocities and Jacobians are in world axes: x forward, z up, rotations about +y.
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.mold import Mold
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.held import HeldRows
from heelstrike.dynamics.inverse_kinematics import Reaching, leg_joints, reach
from heelstrike.dynamics.kernels import (
    bias_force,
    center_of_mass,
    center_of_mass_bias_acceleration,
    center_of_mass_jacobian,
    composite_inertias,
    first_moments,
    forward_kinematics,
    inverse_dynamics,
    link_velocities,
    mass_matrix,
    momentum,
    momentum_matrix,
    passive_force,
    point_bias_acceleration,
    point_jacobian,
    point_position,
    point_velocity,
)
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.planar import momentum_of, power, spatial
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import ControllerError
from heelstrike.once_each import once_each
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import sole
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller import following, stance
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.raised import EndOfRun
from heelstrike.sim.controller.straight_line import (
    flat_foot_arguments,
    flat_foot_holds,
    flat_foot_programs,
)

NO_ENDING = -1
"""What `ControlledRobot.ending` is while the law lets the run go on."""


class ControlState(Bundle):
    """Where the robot is and how it moves, copied for its controller."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: Position and velocity of the coordinates (m, rad; m/s, rad/s)."""
    joint_position: Floats = array("nu")
    joint_velocity: Floats = array("nu")
    """joint_position, joint_velocity: Those of the actuated joints, in the order of the
    actuators."""
    kinematics: Workspace = part(Workspace)
    """What follows from them, ready for the queries of :class:`ControlledRobot`."""


class ControlledRobot(Bundle):
    """A robot and its dynamics, for use within a controller.

    Every query writes its answer into the array that it is given last.
    """

    model: Model = part(Model, address=True)
    """Its numbers; ``robot.model.actuator_joint[i]`` is the coordinate that actuator i drives."""
    nq: int = number(int)
    nv: int = number(int)
    nu: int = number(int)
    nc: int = number(int)
    nl: int = number(int)
    nf: int = number(int)
    """nq, nv, nu, nc, nl, nf: Positions, velocities, actuators, contact points, links and feet."""
    mass: float = number(float)
    """Of the whole robot (kg)."""
    period: float = cell(float)
    """Seconds between two calls; zero if the controller acts continuously."""
    trial: int = cell(int)
    """Whether the method only tries a state within a step: what is written to memory and log in
    such a call is forgotten, and a plan is best left as it is."""
    ending: int = cell(int)
    """Which ending of its own the law has come to, see :meth:`stop`; -1 for none."""
    foot_link: Integers = array("nf", of=int)
    foot_contact: Integers = array("nf", of=int)
    """foot_link, foot_contact: Link of each foot, and the first of its contact points."""
    foot_sole: Floats = array("nf", 2, 2)
    """Heel and toe of each foot, the ends of its sole, in the foot's axes (m); twice the same of a
    point foot."""
    contact_foot: Integers = array("nc", of=int)
    """Foot that each contact point belongs to, -1 for none."""
    leg_joint: Integers = array("nf", "longest", of=int)
    """Actuated joints that move one foot alone, from the hip down; -1 where there are no more."""
    unactuated: Integers = array("free", of=int)
    """Coordinates without an actuator."""
    estimate: ControlState = part(ControlState)
    """A second state for controllers that estimate the first, to be filled at each call; see
    :meth:`update`."""
    acceleration: Floats = array("nv")
    force: Floats = array("nv")
    passive: Floats = array("nv")
    other: Floats = array("nv")
    three: Floats = array(3)
    reaching: Reaching = part(Reaching)
    motor: Integers = array("nv", of=int)
    """Actuator of each coordinate, -1 for none."""
    held: HeldRows = part(HeldRows)
    """What a foot and the loops hold, of the last query that needed it."""
    flat_foot: Integers = array("nf", of=int, address=True)
    """Addresses of the straight-line code of :meth:`flat_foot_torque`, zero where there is none."""
    flat_hold: Integers = array("nf", 4, of=int)
    """What that holds: link of each foot, and the coordinate that each row is solved for."""
    shares: Floats = array("nu", "nu")
    """acceleration, force, passive, other, three, reaching, shares: Scratch of the queries."""

    @kernel
    def driven_position(self, actuator: int) -> int:
        """Place in q of what an actuator drives."""
        return int(self.model.actuator_joint[actuator])

    @kernel
    def driven_velocity(self, actuator: int) -> int:
        """Place in v of what an actuator drives."""
        return int(self.model.actuator_joint[actuator])

    @kernel
    def stop(self, ending: int) -> None:
        """End the run with this instant, for the reason of that place among the law's `endings`.

        What is only tried, within a step, ends nothing.
        """
        if self.trial == 0:
            self.ending = ending

    @kernel
    def update(self, state: ControlState) -> None:
        """Find joints and kinematics of a state whose `q` and `v` have been written."""
        for i in range(self.nu):
            joint = self.model.actuator_joint[i]
            state.joint_position[i] = state.q[joint]
            state.joint_velocity[i] = state.v[joint]
        forward_kinematics(self.model, state.q, state.kinematics)
        link_velocities(self.model, state.v, state.kinematics)

    @kernel
    def mass_matrix(self, state: ControlState, matrix: Floats) -> None:
        """Mass matrix A(q), (nv, nv)."""
        mass_matrix(self.model, state.kinematics, matrix)

    @kernel
    def bias_force(self, state: ControlState, force: Floats) -> None:
        """Centrifugal, Coriolis and gravitational force H(q, v), (nv,): A v̇ + H is what acts."""
        bias_force(self.model, state.kinematics, force)

    @kernel
    def passive_force(self, state: ControlState, force: Floats) -> None:
        """Generalised force of joint springs and dampers on the robot, (nv,)."""
        passive_force(self.model, state.q, state.v, force)

    @kernel
    def inverse_dynamics(self, state: ControlState, acceleration: Floats, force: Floats) -> None:
        """Generalised force A v̇ + H, (nv,), of an acceleration (nv,)."""
        inverse_dynamics(self.model, acceleration, state.kinematics, force)

    @kernel
    def gravity_force(self, state: ControlState, torque: Floats) -> None:
        """Torques (nu,) of the actuators that bear the weight beyond each joint: H(q, 0)."""
        work, gravity = state.kinematics, self.model.gravity
        composite_inertias(self.model, work)
        for i in range(self.nu):
            joint = self.model.actuator_joint[i]
            weight = momentum_of(work.composite, joint, (0.0, gravity[0], gravity[1]))
            torque[i] = -power(spatial(work.motion, joint), weight)

    @kernel
    def point_position(
        self, state: ControlState, link: int, local: Floats, position: Floats
    ) -> None:
        """World position (x, z) of a point of a link, given in the link's axes."""
        point_position(state.kinematics, link, local, position)

    @kernel
    def point_jacobian(
        self, state: ControlState, link: int, position: Floats, jacobian: Floats
    ) -> None:
        """Jacobian (3, nv) of a point of a link at a world position: x, z and rotation."""
        point_jacobian(self.model, state.kinematics, link, position, jacobian)

    @kernel
    def point_velocity(
        self, state: ControlState, link: int, position: Floats, velocity: Floats
    ) -> None:
        """Velocity (3,) of a point of a link at a world position: x, z and rotation."""
        point_velocity(state.kinematics, link, position, velocity)

    @kernel
    def point_bias_acceleration(
        self, state: ControlState, link: int, position: Floats, acceleration: Floats
    ) -> None:
        """J̇v, (3,), of the Jacobian of a point: its acceleration at v̇ = 0."""
        point_bias_acceleration(state.kinematics, link, position, acceleration)

    @kernel
    def contact_jacobian(
        self, state: ControlState, contacts: Contacts, contact: int, jacobian: Floats
    ) -> None:
        """Jacobian (2, nv) of a contact point: along the ground's normal, then its tangent."""
        link, normal = self.model.contact_link[contact], contacts.normal[contact]
        write_point_rows(
            self.model, state.kinematics, link, contacts.position[contact], normal, 0, jacobian
        )

    @kernel
    def contact_velocity(
        self, state: ControlState, contacts: Contacts, contact: int, velocity: Floats
    ) -> None:
        """Velocity (2,) of a contact point: along the ground's normal, then its tangent."""
        work, link = state.kinematics, self.model.contact_link[contact]
        place = place_of(work, contacts.position[contact])
        moved = velocity_at(work.velocity, link, place)
        velocity[0], velocity[1] = into_frame(contacts.normal[contact], moved)

    @kernel
    def contact_bias_acceleration(
        self, state: ControlState, contacts: Contacts, contact: int, acceleration: Floats
    ) -> None:
        """J̇v, (2,), of the gap and the sliding velocity of a contact point, (normal, tangent).

        That of the centre of its disc, which rolls on the ground.
        """
        model, center, found = self.model, self.other, self.three
        link, radius = model.contact_link[contact], model.contact_radius[contact]
        normal = contacts.normal[contact]
        for i in range(2):
            center[i] = contacts.position[contact, i] + radius * normal[i]
        point_bias_acceleration(state.kinematics, link, center, found)
        acceleration[0], acceleration[1] = into_frame(normal, (found[0], found[1]))

    @kernel
    def link_pose(self, state: ControlState, link: int, pose: Floats) -> None:
        """Position (x, z) and angle of the frame of a link, (3,)."""
        pose[0] = state.kinematics.origin[link, 0]
        pose[1] = state.kinematics.origin[link, 1]
        pose[2] = state.kinematics.angle[link]

    @kernel
    def foot_pose(self, state: ControlState, foot: int, pose: Floats) -> None:
        """Position (x, z) and angle of the frame of a foot, (3,)."""
        self.link_pose(state, self.foot_link[foot], pose)

    @kernel
    def foot_velocity(self, state: ControlState, foot: int, velocity: Floats) -> None:
        """Velocity of the frame of a foot, (3,): x, z and rotation."""
        link = self.foot_link[foot]
        point_velocity(state.kinematics, link, state.kinematics.origin[link], velocity)

    @kernel
    def foot_bias_acceleration(self, state: ControlState, foot: int, acceleration: Floats) -> None:
        """J̇v, (3,), of the Jacobian of the frame of a foot."""
        link = self.foot_link[foot]
        point_bias_acceleration(state.kinematics, link, state.kinematics.origin[link], acceleration)

    @kernel
    def foot_gap(self, contacts: Contacts, foot: int) -> float:
        """Height (m) of the lowest contact point of a foot above the ground."""
        lowest = np.inf
        for i in range(self.nc):
            if self.contact_foot[i] == foot:
                lowest = min(lowest, contacts.gap[i])
        return lowest

    @kernel
    def foot_wrench(
        self, state: ControlState, contacts: Contacts, foot: int, wrench: Floats
    ) -> None:
        """What the ground exerts on a foot, (3,): force (x, z), and moment +y about its frame.

        Times the transpose of :meth:`foot_jacobian` it is the generalised force.
        """
        x, z, moment = 0.0, 0.0, 0.0
        origin = state.kinematics.origin[self.foot_link[foot]]
        for i in range(self.nc):
            if self.contact_foot[i] == foot:
                pressed = (contacts.force[i, 0], contacts.force[i, 1])
                fx, fz = out_of_frame(contacts.normal[i], pressed)
                x += fx
                z += fz
                moment += (contacts.position[i, 1] - origin[1]) * fx
                moment -= (contacts.position[i, 0] - origin[0]) * fz
        wrench[0], wrench[1], wrench[2] = x, z, moment

    @kernel
    def inverse_kinematics(
        self, state: ControlState, foot: int, local: Floats, target: Floats, q: Floats
    ) -> float:
        """Positions (nq,) with which a point of a foot, in its axes, is at (x, z, angle).

        The search begins at ``state.q`` and moves the joints of the leg within their ranges; an
        angle that is NaN may be any, as may that of a leg with fewer than three joints. Returns
        what is missing of the answer, the larger of metres and radians.
        """
        for j in range(self.nq):
            q[j] = state.q[j]
        link, joints = self.foot_link[foot], self.leg_joint[foot]
        return reach(self.model, joints, link, local, target, self.reaching, q)

    @kernel
    def foot_jacobian(self, state: ControlState, foot: int, jacobian: Floats) -> None:
        """Jacobian (3, nv) of the frame of a foot: x, z and rotation."""
        link = self.foot_link[foot]
        point_jacobian(self.model, state.kinematics, link, state.kinematics.origin[link], jacobian)

    @kernel
    def center_of_mass(self, state: ControlState, position: Floats) -> None:
        """World position (x, z) of the centre of mass."""
        center_of_mass(self.model, state.kinematics, position)

    @kernel
    def center_of_mass_velocity(self, state: ControlState, velocity: Floats) -> None:
        """Velocity (x, z) of the centre of mass."""
        found = self.three
        momentum(self.model, state.kinematics, found)
        mass, _, _ = first_moments(self.model, state.kinematics)
        velocity[0] = found[0] / mass
        velocity[1] = found[1] / mass

    @kernel
    def center_of_mass_jacobian(self, state: ControlState, jacobian: Floats) -> None:
        """Jacobian (2, nv) of the centre of mass."""
        center_of_mass_jacobian(self.model, state.kinematics, jacobian)

    @kernel
    def center_of_mass_bias_acceleration(self, state: ControlState, acceleration: Floats) -> None:
        """J̇v, (2,), of the Jacobian of the centre of mass."""
        center_of_mass_bias_acceleration(self.model, state.kinematics, acceleration)

    @kernel
    def momentum(self, state: ControlState, momentum_now: Floats) -> None:
        """Momentum (x, z) and moment of momentum about the centre of mass and +y, (3,)."""
        momentum(self.model, state.kinematics, momentum_now)

    @kernel
    def momentum_matrix(self, state: ControlState, matrix: Floats) -> None:
        """Centroidal momentum matrix (3, nv): times v it is :meth:`momentum`."""
        momentum_matrix(self.model, state.kinematics, matrix)

    follow_motors = following.follow_motors
    flat_foot_torque = stance.flat_foot_torque
    point_foot_torque = stance.point_foot_torque


def extents_of(robot: Robot | SpatialRobot) -> dict[str, int]:
    """Sizes of a robot by the names under which arrays of controllers are declared."""
    if isinstance(robot, SpatialRobot):
        return {**robot.model.extents, "components": 3}
    # Rows of all that ground and loops can hold; a flat foot and one of a law's own at the least.
    held = max(2 * robot.nc, 4) + count_rows(robot.model)
    return {**robot.model.extents, "components": 2, "held": held}


@takes(ControllerError)
def controlled_robot(robot: Robot) -> ControlledRobot:
    """Make the view that compiled laws have of a robot, for a controller in Python.

    It answers the same queries in the same words::

        self.robot = controlled_robot(robot)
        ...
        at = self.robot.estimate
        at.q[:], at.v[:] = state.q, state.v
        self.robot.update(at)
        self.robot.foot_jacobian(at, foot, jacobian)

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    ControlledRobot
        Its sizes and queries, and a state to ask about. Its ``stop`` raises
        :class:`~heelstrike.EndOfRun`, which is how a controller in Python ends its run.

    Raises
    ------
    ControllerError
        If it is none.
    """
    view = robot_view(robot)
    view.__dict__["stop"] = _end_run  # nobody looks at what a kernel would write here
    return view


def _end_run(ending: int) -> NoReturn:
    raise EndOfRun(f"ending {ending}")


def robot_view(robot: Robot) -> ControlledRobot:
    """Make the view of a robot that a compiled law has."""
    return _mold_of(robot).cast()


def _flat_foot(robot: Robot) -> Integers:
    """Return the addresses of the straight-line code of the torques on each foot."""
    arguments = flat_foot_arguments(robot)
    programs = flat_foot_programs(robot, stance.supply_flat_foot, arguments, ("whole", "force"))
    return np.array(programs, np.int64)


@once_each
def _mold_of(robot: Robot) -> Mold[ControlledRobot]:
    driven = set(robot.model.actuator_joint.tolist())
    legs = leg_joints(robot)
    view = ControlledRobot.allocate(
        {**extents_of(robot), "loop_rows": count_rows(robot.model)}, model=robot.model,
        nf=len(robot.feet), free=robot.nv - len(driven), longest=max(map(len, legs), default=0),
        mass=robot.total_mass, flat_foot=_flat_foot(robot),
    )  # fmt: skip
    view.motor[:] = -1
    view.motor[robot.model.actuator_joint] = np.arange(robot.nu)
    view.ending = NO_ENDING
    view.contact_foot[:] = -1
    view.leg_joint[:] = -1
    for index, foot in enumerate(robot.feet):
        view.foot_link[index] = foot.link
        view.foot_contact[index] = foot.contacts[0] if foot.contacts else -1
        if foot.contacts:
            view.foot_sole[index] = sole(robot, foot).ends
        view.contact_foot[list(foot.contacts)] = index
        view.leg_joint[index, : len(legs[index])] = legs[index]
    view.unactuated[:] = [j for j in range(robot.nv) if j not in driven]
    view.flat_hold[:] = flat_foot_holds(robot)
    return Mold(view)
