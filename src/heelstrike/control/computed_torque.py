"""Computed-torque control in single support (paper section 4.1, eq. 27-39).

With the stance foot held flat on the ground, J_u v̇_u + J_a v̇_a + J̇ v = 0 gives the accelerations of
the unactuated coordinates from those of the actuated ones (eq. 32-34). The generalised force
f = A v̇ + H then fixes the foot's wrench, J_uᵀ F = f_u, and the torques Γ = f_a − J_aᵀ F. This is
eq. 37 with the products MᵀA M and MᵀH carried out by recursion instead of as matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import separate_kernel
from heelstrike.dynamics.kernels import (
    forward_kinematics,
    inverse_dynamics,
    link_velocities,
    passive_force,
)
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import CONTROLLER_SIGNATURE, CompiledController, Contacts

# Places in the parameters: a header, then blocks of nu numbers, then the feet.
EARLIEST = 0  # a touchdown counts only after this time in a step, s
LATEST = 1  # the reference goes on along its polynomials until this time in a step, s
ENCODER_PERIOD = 2  # time between encoder samples, s; negative: exact measurement
ENCODER_RESOLUTION = 3  # smallest difference of an encoder's angles, rad; zero: exact
LANDING = 4  # a foot that touches without coming flat counts as landed after this time, s
PITCH = 5  # coordinate and axis sign of the trunk's pitch
PITCH_SIGN = 6
HEADER = 7

# A point of the swing foot that comes down more slowly than this (m/s) has landed.
LANDED_SPEED = 1e-3

# Places in the memory: a header, then encoder samples and scratch vectors.
STANCE = 0
START = 1
SAMPLES = 2
SAMPLED = 3
LANDED = 4
MEMORY_HEADER = 5
SAMPLES_KEPT = 4


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """Joint encoders from which velocities must be estimated, as on the real robot (section 5).

    Joint positions are sampled and rounded; the velocity is the derivative, at the newest sample,
    of the cubic through the last four. A touchdown makes velocities jump: samples before it are
    forgotten, and the reference velocity stands in until there are two again. The trunk follows
    from the stance foot, taken to be flat and at rest (eq. 28, 29).

    Parameters
    ----------
    period : float
        Time between samples in seconds; choose a whole number of control periods.
    resolution : float
        Smallest difference between two readings in rad; zero for exact readings. The default is
        that of 4096 counts a turn on a motor behind a gear of 1024. Coarser readings make noisy
        velocities, and gains that suit exact ones then tip the stance foot.
    """

    period: float = 1e-3
    resolution: float = 2.0 * np.pi / 2**22

    def __post_init__(self) -> None:
        if not 0.0 < self.period < np.inf:
            raise ControllerError(f"the encoder period must be positive, got {self.period}")
        if not 0.0 <= self.resolution < np.inf:
            raise ControllerError(f"the encoder resolution must be ≥ 0, got {self.resolution}")


@kernel
def solve_three(
    columns: Floats, a: int, b: int, c: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Solve [columns a, b, c] s = (x, y, z) for a 3 by 3 system whose columns are rows here."""
    a0, a1, a2 = columns[a, 0], columns[a, 1], columns[a, 2]
    b0, b1, b2 = columns[b, 0], columns[b, 1], columns[b, 2]
    c0, c1, c2 = columns[c, 0], columns[c, 1], columns[c, 2]
    bc0, bc1, bc2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    determinant = a0 * bc0 + a1 * bc1 + a2 * bc2
    first = (x * bc0 + y * bc1 + z * bc2) / determinant
    ca0, ca1, ca2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    second = (x * ca0 + y * ca1 + z * ca2) / determinant
    ab0, ab1, ab2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    third = (x * ab0 + y * ab1 + z * ab2) / determinant
    return first, second, third


@kernel
def solve_three_transposed(
    columns: Floats, a: int, b: int, c: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Solve [columns a, b, c]ᵀ s = (x, y, z)."""
    a0, a1, a2 = columns[a, 0], columns[a, 1], columns[a, 2]
    b0, b1, b2 = columns[b, 0], columns[b, 1], columns[b, 2]
    c0, c1, c2 = columns[c, 0], columns[c, 1], columns[c, 2]
    bc0, bc1, bc2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    ca0, ca1, ca2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    ab0, ab1, ab2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    determinant = a0 * bc0 + a1 * bc1 + a2 * bc2
    first = (x * bc0 + y * ca0 + z * ab0) / determinant
    second = (x * bc1 + y * ca1 + z * ab1) / determinant
    third = (x * bc2 + y * ca2 + z * ab2) / determinant
    return first, second, third


@kernel
def foot_columns(model: Model, work: Workspace, link: int, columns: Floats) -> None:
    """Jacobian of a foot (x, z, rotation) at its link origin, one row a coordinate."""
    x = work.origin[link, 0] - work.pivot[0]
    z = work.origin[link, 1] - work.pivot[1]
    for j in range(model.parent.shape[0]):
        for k in range(3):
            columns[j, k] = 0.0
    j = link
    while j >= 0:
        columns[j, 0] = work.motion[j, 1] + work.motion[j, 0] * z
        columns[j, 1] = work.motion[j, 2] - work.motion[j, 0] * x
        columns[j, 2] = work.motion[j, 0]
        j = model.parent[j]


@kernel
def foot_bias(work: Workspace, link: int) -> tuple[float, float, float]:
    """J̇v of :func:`foot_columns`."""
    x = work.origin[link, 0] - work.pivot[0]
    z = work.origin[link, 1] - work.pivot[1]
    w = work.velocity[link, 0]
    rotation = work.bias_acceleration[link, 0]
    ax = work.bias_acceleration[link, 1] + rotation * z + w * (work.velocity[link, 2] - w * x)
    az = work.bias_acceleration[link, 2] - rotation * x - w * (work.velocity[link, 1] + w * z)
    return ax, az, rotation


@kernel
def approaching_speed(work: Workspace, contacts: Contacts, link: int, contact: int) -> float:
    """Speed at which a contact point of a link comes down on the ground."""
    x = contacts.position[contact, 0] - work.pivot[0]
    z = contacts.position[contact, 1] - work.pivot[1]
    w = work.velocity[link, 0]
    vx = work.velocity[link, 1] + w * z
    vz = work.velocity[link, 2] - w * x
    return -(vx * contacts.normal[contact, 0] + vz * contacts.normal[contact, 1])


@kernel
def restart_at_touchdown(
    t: float, contacts: Contacts, parameters: Floats, memory: Floats, side: Floats
) -> None:
    """Exchange stance and swing when the swing foot has met the ground."""
    if t - memory[START] < parameters[EARLIEST]:
        return
    swing = 1.0 - memory[STANCE]
    for i in range(side.shape[0]):
        if side[i] == swing and contacts.force[i, 0] > 0.0:
            memory[STANCE] = swing
            memory[START] = t
            memory[LANDED] = 0.0
            # Velocities jump at the impact: no polynomial may reach across it.
            memory[SAMPLES] = 0.0
            return


@kernel
def has_landed(
    t: float,
    contacts: Contacts,
    work: Workspace,
    link: int,
    parameters: Floats,
    memory: Floats,
    side: Floats,
) -> bool:
    """Whether the stance foot, on `link`, is past the impact that made it the stance foot.

    Heel and toe rarely meet the ground at the same instant, and time stepping spreads an impact
    over two steps. In between, velocities are neither those before the impact nor those after, and
    differ from the reference by as much as the impact itself. A foot that has touched without
    coming flat counts as landed after a while.
    """
    if memory[LANDED] == 0.0:
        landed = t - memory[START] > parameters[LANDING]
        if not landed:
            landed = True
            for i in range(side.shape[0]):
                if side[i] == memory[STANCE]:
                    speed = approaching_speed(work, contacts, link, i)
                    landed = landed and speed < LANDED_SPEED
        memory[LANDED] = 1.0 if landed else 0.0
    return memory[LANDED] == 1.0


@kernel
def read_encoders(
    t: float, q: Floats, model: Model, parameters: Floats, memory: Floats, samples: Floats
) -> None:
    """Take a sample of the rounded joint positions when one is due.

    Samples of all joints follow each other, the newest first.
    """
    due = memory[SAMPLED] + parameters[ENCODER_PERIOD]
    if memory[SAMPLES] > 0.0 and t < due - 1e-6 * parameters[ENCODER_PERIOD]:
        return
    resolution = parameters[ENCODER_RESOLUTION]
    nu = model.actuator_joint.shape[0]
    for i in range(nu):
        for k in range(SAMPLES_KEPT - 1, 0, -1):
            samples[k * nu + i] = samples[(k - 1) * nu + i]
        reading = q[model.actuator_joint[i]]
        if resolution > 0.0:
            reading = resolution * np.round(reading / resolution)
        samples[i] = reading
    memory[SAMPLED] = t
    memory[SAMPLES] = min(memory[SAMPLES] + 1.0, float(SAMPLES_KEPT))


@kernel
def estimated_velocity(samples: Floats, count: int, period: float, i: int) -> float:
    """Slope at the newest sample of the polynomial through all of them, at most a cubic."""
    nu = samples.shape[0] // SAMPLES_KEPT
    newest, second = samples[i], samples[nu + i]
    third, oldest = samples[2 * nu + i], samples[3 * nu + i]
    if count >= 4:
        return (11.0 * newest - 18.0 * second + 9.0 * third - 2.0 * oldest) / (6.0 * period)
    if count == 3:
        return (3.0 * newest - 4.0 * second + third) / (2.0 * period)
    return (newest - second) / period


@separate_kernel(lambda: CONTROLLER_SIGNATURE)
def computed_torque(
    t: float,
    q: Floats,
    v: Floats,
    contacts: Contacts,
    model: Model,
    tree: Workspace,
    scratch: Workspace,
    parameters: Floats,
    memory: Floats,
    torque: Floats,
) -> None:
    """Joint torques that make the joints follow the gait with the stance foot flat (eq. 39)."""
    nv = model.parent.shape[0]
    nu = model.actuator_joint.shape[0]
    # The blocks of the parameters.
    stiffness = parameters[HEADER : HEADER + nu]
    damping = parameters[HEADER + nu : HEADER + 2 * nu]
    place = HEADER + 2 * nu
    cubics = place  # for either stance foot four coefficients a joint
    place += 8 * nu
    a = int(parameters[place])
    b = int(parameters[place + 1])
    c = int(parameters[place + 2])
    links = parameters[place + 3 : place + 5]
    side = parameters[place + 5 : place + 5 + contacts.gap.shape[0]]
    # The blocks of the memory.
    place = MEMORY_HEADER
    samples = memory[place : place + SAMPLES_KEPT * nu]
    place += SAMPLES_KEPT * nu
    acceleration = memory[place : place + nv]
    force = memory[place + nv : place + 2 * nv]
    passive = memory[place + 2 * nv : place + 3 * nv]
    measured_q = memory[place + 3 * nv : place + 4 * nv]
    measured_v = memory[place + 4 * nv : place + 5 * nv]

    restart_at_touchdown(t, contacts, parameters, memory, side)
    stance = int(memory[STANCE])
    link = int(links[stance])
    landed = has_landed(t, contacts, tree, link, parameters, memory, side)
    work, other = tree, scratch
    for j in range(nv):
        measured_q[j] = q[j]
        measured_v[j] = v[j]
    exact = parameters[ENCODER_PERIOD] < 0.0
    if not exact:
        read_encoders(t, q, model, parameters, memory, samples)
        for i in range(nu):
            measured_q[model.actuator_joint[i]] = samples[i]
        work, other = scratch, tree
        forward_kinematics(model, measured_q, scratch)
        pitch = int(parameters[PITCH])
        measured_q[pitch] -= parameters[PITCH_SIGN] * scratch.angle[link]
        forward_kinematics(model, measured_q, scratch)

    # Reference of this instant (eq. 41); past the end of a late step it goes on, then rests.
    phase = t - memory[START]
    late = phase > parameters[LATEST]
    if late:
        phase = parameters[LATEST]
    for i in range(nu):
        joint = model.actuator_joint[i]
        cubic = cubics + 4 * nu * stance + i
        a0 = parameters[cubic]
        a1 = parameters[cubic + nu]
        a2 = parameters[cubic + 2 * nu]
        a3 = parameters[cubic + 3 * nu]
        position = a0 + phase * (a1 + phase * (a2 + phase * a3))
        velocity = a1 + phase * (2.0 * a2 + phase * 3.0 * a3)
        feedforward = 2.0 * a2 + 6.0 * a3 * phase
        if late:
            velocity = 0.0
            feedforward = 0.0
        if not exact:
            if memory[SAMPLES] >= 2.0:
                measured_v[joint] = estimated_velocity(
                    samples, int(memory[SAMPLES]), parameters[ENCODER_PERIOD], i
                )
            else:
                measured_v[joint] = velocity
        acceleration[joint] = feedforward + stiffness[i] * (position - measured_q[joint])
        if landed:
            acceleration[joint] += damping[i] * (velocity - measured_v[joint])

    # Unactuated coordinates of the robot on its stance foot (eq. 29, 34).
    columns = other.force  # scratch of the workspace that is not in use
    foot_columns(model, work, link, columns)
    if not exact:
        x = 0.0
        z = 0.0
        rotation = 0.0
        for i in range(nu):
            joint = model.actuator_joint[i]
            x -= columns[joint, 0] * measured_v[joint]
            z -= columns[joint, 1] * measured_v[joint]
            rotation -= columns[joint, 2] * measured_v[joint]
        measured_v[a], measured_v[b], measured_v[c] = solve_three(columns, a, b, c, x, z, rotation)
        link_velocities(model, measured_v, work)
    x, z, rotation = foot_bias(work, link)
    x = -x
    z = -z
    rotation = -rotation
    for i in range(nu):
        joint = model.actuator_joint[i]
        x -= columns[joint, 0] * acceleration[joint]
        z -= columns[joint, 1] * acceleration[joint]
        rotation -= columns[joint, 2] * acceleration[joint]
    acceleration[a], acceleration[b], acceleration[c] = solve_three(
        columns, a, b, c, x, z, rotation
    )

    # Foot wrench from the unactuated rows, torques from the actuated ones (eq. 36, 37).
    inverse_dynamics(model, acceleration, work, force)
    passive_force(model, measured_q, measured_v, passive)
    for j in range(nv):
        force[j] -= passive[j]
    x, z, rotation = solve_three_transposed(columns, a, b, c, force[a], force[b], force[c])
    for i in range(nu):
        joint = model.actuator_joint[i]
        torque[i] = force[joint] - (
            columns[joint, 0] * x + columns[joint, 1] * z + columns[joint, 2] * rotation
        )


class ComputedTorque:
    """Follow a gait by computed torque, on either foot, step after step.

    On point feet the joints follow the gait and the trunk's pitch, which no
    motor reaches, follows from them. Nothing then brings the pitch back to the gait: a disturbance
    of it lasts, and most gaits are unstable under this law.

    The phase of the gait restarts, and left and right change places, when the swing foot meets the
    ground in the second half of a step; until that foot has stopped, velocities are not fed back. A
    step that lasts longer than planned goes on along its
    polynomials for a tenth of its duration and then holds still.

    Parameters
    ----------
    robot : Robot
        A floating robot with two feet, mirror symmetric, all joints but the trunk's actuated.
    gait : Gait
        The gait to follow.
    kp, kd : float or (nu,) array
        Gains of eq. 38, in 1/s² and 1/s.
    encoder : Encoder, optional
        Estimate velocities from sampled, rounded joint positions instead of taking the exact ones.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or gait or gains do not fit it.
    """

    def __init__(
        self,
        robot: Robot,
        gait: Gait,
        *,
        kp: ArrayLike = 400.0,
        kd: ArrayLike = 40.0,
        encoder: Encoder | None = None,
    ) -> None:
        self.robot = robot
        self.gait = gait
        self.encoder = encoder
        self.kp = _gains("kp", kp, robot)
        self.kd = _gains("kd", kd, robot)
        self._kernel = computed_torque
        self._parameters = self._packed_parameters()
        self._kernel.begin()
        self.reset()

    def reset(self) -> None:
        """Go back to the beginning of the gait; runs do this by themselves."""
        self._memory = self._initial_memory()
        self._tree = workspace(self.robot.nv)
        self._scratch = workspace(self.robot.nv)

    def compiled(self) -> CompiledController:
        """Return the controller in the form that runs inside the compiled loop."""
        kernel = self._kernel.finish()
        return CompiledController(kernel, self._parameters, self._initial_memory())

    def torque(self, t: float, state: State, contacts: Contacts) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m.

        Parameters
        ----------
        t : float
            Time (s).
        state : State
            Where the robot is.
        contacts : Contacts
            How it touches the ground.

        Returns
        -------
        (nu,) float
            Torques, in the order of the actuators.
        """
        if t <= 0.0:
            self.reset()
        forward_kinematics(self.robot.model, state.q, self._tree)
        link_velocities(self.robot.model, state.v, self._tree)
        torque = np.zeros(self.robot.nu)
        kernel = self._kernel.finish()
        kernel(
            t,
            state.q,
            state.v,
            contacts,
            self.robot.model,
            self._tree,
            self._scratch,
            self._parameters,
            self._memory,
            torque,
        )
        return torque

    def _initial_memory(self) -> NDArray[np.float64]:
        nv, nu = self.robot.nv, self.robot.nu
        size = MEMORY_HEADER + SAMPLES_KEPT * nu + 5 * nv
        if self.gait.point_feet:
            from heelstrike.control.point_feet import memory_size

            size = memory_size(self.robot)
        memory = np.zeros(size)
        memory[STANCE] = self.gait.stance_foot
        memory[LANDED] = 1.0
        return memory

    def _packed_parameters(self) -> NDArray[np.float64]:
        robot, gait = self.robot, self.gait
        model = robot.model
        mirror = robot.mirror
        actuated = set(model.actuator_joint.tolist())
        unactuated = np.array([j for j in range(robot.nv) if j not in actuated], dtype=np.int64)
        if not robot.floating or mirror is None or len(robot.feet) != 2:
            raise ControllerError(
                f"computed torque needs a floating robot with two mirrored feet; "
                f"robot {robot.name!r} is not one"
            )
        if len(unactuated) != 3:
            names = ", ".join(robot.joint_names[j] for j in unactuated)
            raise ControllerError(
                f"computed torque on a flat foot needs every joint but the trunk's x, z and pitch "
                f"actuated; robot {robot.name!r} leaves {names} without a motor"
            )
        if len(gait.joint_names) != robot.nu:
            raise ControllerError(
                f"the gait has {len(gait.joint_names)} joints, robot {robot.name!r} has "
                f"{robot.nu} actuators"
            )
        pitch = int(unactuated[np.flatnonzero(model.axis[unactuated, 0])[0]])
        header = np.zeros(HEADER)
        header[EARLIEST] = 0.5 * gait.step_duration
        header[LATEST] = 1.1 * gait.step_duration
        header[ENCODER_PERIOD] = -1.0 if self.encoder is None else self.encoder.period
        header[ENCODER_RESOLUTION] = 0.0 if self.encoder is None else self.encoder.resolution
        header[LANDING] = 0.02 * gait.step_duration
        header[PITCH] = pitch
        header[PITCH_SIGN] = model.axis[pitch, 0]
        if gait.point_feet:
            blocks = self._point_foot_blocks(gait, unactuated)
            return np.concatenate([header, self.kp, self.kd, blocks])
        both = np.zeros((2, 4, robot.nu))
        both[gait.stance_foot] = gait.coefficients
        both[1 - gait.stance_foot] = gait.mirrored_coefficients(robot)
        side = np.full(robot.nc, -1.0)
        for index, foot in enumerate(robot.feet):
            side[list(foot.contacts)] = index
        return np.concatenate(
            [
                header,
                self.kp,
                self.kd,
                both.ravel(),
                unactuated.astype(np.float64),
                [float(foot.link) for foot in robot.feet],
                side,
            ]
        )

    def _point_foot_blocks(self, gait: Gait, unactuated: NDArray[np.int64]) -> NDArray[np.float64]:
        # Compiled only by those who walk on points.
        from heelstrike.control.point_feet import packed_blocks, point_foot_torque

        robot = self.robot
        gait.check_joints(robot)
        if any(len(foot.contacts) != 1 for foot in robot.feet):
            raise ControllerError(
                f"the gait is one on point feet; the feet of robot {robot.name!r} have several "
                "contact points"
            )
        if self.encoder is not None:
            raise ControllerError(
                "on point feet the trunk's pitch does not follow from the joints, so joint "
                "encoders alone cannot measure the state; leave encoder out"
            )
        self._kernel = point_foot_torque
        return packed_blocks(robot, gait, unactuated)


def _gains(name: str, value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    gains = np.asarray(value, dtype=np.float64)
    if gains.ndim > 1 or gains.size not in (1, robot.nu):
        raise ControllerError(
            f"{name} must be one number or {robot.nu} (one an actuator), got shape {gains.shape}"
        )
    if not np.all(np.isfinite(gains)) or np.any(gains < 0.0):
        raise ControllerError(f"{name} must be finite and not negative, got {value!r}")
    return np.broadcast_to(gains, (robot.nu,)).copy()
