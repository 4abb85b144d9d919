"""The robot as a compiled controller sees it: its state, and questions about its dynamics.

All positions, velocities and Jacobians are in world axes: x forward, z up, rotations about +y.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import (
    bias_force,
    center_of_mass,
    composite_inertias,
    first_moments,
    forward_kinematics,
    inverse_dynamics,
    link_velocities,
    mass_matrix,
    momentum,
    passive_force,
    point_jacobian,
    point_position,
)
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.spatial import momentum_of, power, spatial
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller import stance
from heelstrike.sim.controller.interface import Contacts


class ControlState(Bundle):
    """Where the robot is and how it moves, copied for its controller.

    Attributes
    ----------
    q, v : (nq,), (nv,) float
        Position and velocity of the coordinates (m, rad; m/s, rad/s).
    joint_position, joint_velocity : (nu,) float
        Those of the actuated joints, in the order of the actuators.
    kinematics : Workspace
        What follows from them, ready for the queries of :class:`ControlledRobot`.
    """

    q: Floats = array("nq")
    v: Floats = array("nv")
    joint_position: Floats = array("nu")
    joint_velocity: Floats = array("nu")
    kinematics: Workspace = part(Workspace)


class ControlledRobot(Bundle):
    """A robot and its dynamics, for use within a controller.

    Every query writes its answer into the array that it is given last.

    Attributes
    ----------
    model : Model
        Its numbers; ``robot.model.actuator_joint[i]`` is the coordinate that actuator i drives.
    nq, nv, nu, nc, nl : int
        Positions, velocities, actuators, contact points and links.
    foot_link, foot_contact : (nf,) int
        Link of each foot, and the first of its contact points.
    contact_foot : (nc,) int
        Foot that each contact point belongs to, -1 for none.
    unactuated : (n,) int
        Coordinates without an actuator.
    estimate : ControlState
        A second state for controllers that estimate the first, to be filled at each call; see
        :meth:`update`.
    acceleration, force, passive, other, columns : float
        Scratch of the queries.
    """

    model: Model = part(Model, address=True)
    nq: int = number(int)
    nv: int = number(int)
    nu: int = number(int)
    nc: int = number(int)
    nl: int = number(int)
    foot_link: Integers = array("nf", of=int)
    foot_contact: Integers = array("nf", of=int)
    contact_foot: Integers = array("nc", of=int)
    unactuated: Integers = array("free", of=int)
    estimate: ControlState = part(ControlState)
    acceleration: Floats = array("nv")
    force: Floats = array("nv")
    passive: Floats = array("nv")
    other: Floats = array("nv")
    columns: Floats = array("nv", 3)

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
    def contact_jacobian(
        self, state: ControlState, contacts: Contacts, contact: int, jacobian: Floats
    ) -> None:
        """Jacobian (2, nv) of a contact point: along the ground's normal, then its tangent."""
        link, normal = self.model.contact_link[contact], contacts.normal[contact]
        write_point_rows(
            self.model, state.kinematics, link, contacts.position[contact], normal, 0, jacobian
        )

    @kernel
    def foot_pose(self, state: ControlState, foot: int, pose: Floats) -> None:
        """Position (x, z) and angle of the frame of a foot, (3,)."""
        link = self.foot_link[foot]
        pose[0] = state.kinematics.origin[link, 0]
        pose[1] = state.kinematics.origin[link, 1]
        pose[2] = state.kinematics.angle[link]

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
        found = self.columns[0]  # three numbers
        momentum(self.model, state.kinematics, found)
        mass, _, _ = first_moments(self.model, state.kinematics)
        velocity[0] = found[0] / mass
        velocity[1] = found[1] / mass

    flat_foot_torque = stance.flat_foot_torque
    point_foot_torque = stance.point_foot_torque


def extents_of(robot: Robot) -> dict[str, int]:
    """Sizes of a robot by the names under which arrays of controllers are declared."""
    return {**robot.model.extents, "components": 2}


def controlled_robot(robot: Robot) -> ControlledRobot:
    """Make the view that a controller has of a robot."""
    driven = set(robot.model.actuator_joint.tolist())
    view = ControlledRobot.allocate(
        extents_of(robot), model=robot.model, nf=len(robot.feet), free=robot.nv - len(driven)
    )  # fmt: skip
    view.contact_foot[:] = -1
    for index, foot in enumerate(robot.feet):
        view.foot_link[index] = foot.link
        view.foot_contact[index] = foot.contacts[0] if foot.contacts else -1
        view.contact_foot[list(foot.contacts)] = index
    view.unactuated[:] = [j for j in range(robot.nv) if j not in driven]
    return view
