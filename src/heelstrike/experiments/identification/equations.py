"""The equations of motion along a motion: linear in what is unknown, with their derivatives.

Joints θ are what is measured. Of a robot whose sole lies flat on level ground the trunk's pitch
follows from them, a sum of angles, and where it is does not matter, nor how fast it goes: only how
it accelerates, so that the sole does not. With r(q, v, a) the generalised force that a motion
needs, N = ∂v/∂θ̇ and λ the forces of the ground, the motors supply

    Γ = Nᵀ r,        and the ground   J_bᵀ λ = r_b

of which the first has no λ in it. r is linear in masses, first moments and moments of inertia about
the frames of the links (C. G. Atkeson et al. 1986, *Estimation of inertial parameters of
manipulator loads and links*), in inertias of rotors and friction of joints. Its columns are exact:
derivatives of r where links are units.
"""

from __future__ import annotations

import numpy as np

from heelstrike.contact.linearized.partials import (
    Differentiated,
    allocate_along,
    columns_of,
)
from heelstrike.dynamics.loops import count_rows
from heelstrike.errors import RobotError
from heelstrike.experiments.identification.unknowns import (
    OF_A_JOINT,
    Unknowns,
    unknowns_of,
)
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import root_size
from heelstrike.gait.sole import leg, sole
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

NUMBERS = ("mass", "center_of_mass", "inertia", "armature", "damping")
"""Numbers of the robot by which r is differentiated."""
GENERIC = 2.1, 2.9
"""Numbers between which no number, nor quotient of two, is zero or one."""
UP = np.array([0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Columns:
    """What motors and ground have to do in a motion, for each unknown being one; k joints."""

    motors: Floats
    """(n, k, unknowns) Nᵀ r."""
    ground: Floats
    """(n, b, unknowns) r_b: on the trunk's x, z and pitch; b is zero of a robot that stands
    fixed."""
    known: Floats
    """(n, k) Of springs, which are as the robot's file has them."""
    q: Floats
    v: Floats
    acceleration: Floats
    """(n, nv) each. The motion, without where the trunk is and how fast it goes along."""
    rows: Floats
    """(n, 2 nc, nv) Jacobian of the contact points, normal and tangent."""
    going_by_q: Floats
    going_by_v: Floats
    """going_by_q, going_by_v: (n, 2 nc, nv) Derivatives of the accelerations of the contact points
    by positions and velocities."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of what motors and ground do by θ, θ̇ and θ̈."""

    motors: tuple[Floats, Floats, Floats]
    """(n, k, k) each."""
    ground: tuple[Floats, Floats, Floats]
    """(n, b, k) each."""


class Equations:
    """The equations of motion of a robot, along motions of its joints.

    Parameters
    ----------
    robot : Robot
        A robot that stands fixed, or floats and has flat feet.

    Raises
    ------
    RobotError
        If it is another one.
    """

    def __init__(self, robot: Robot) -> None:
        if count_rows(robot.model):
            raise RobotError(
                f"robot {robot.name!r} has closed loops or coupled joints; identification knows "
                "trees only"
            )
        self.robot, self.first = robot, root_size(robot)
        self.unknowns: Unknowns = unknowns_of(robot)
        self.soles = [sole(robot, foot) for foot in range(len(robot.feet))] if self.first else []
        if robot.feet and not robot.floating:
            raise RobotError(
                f"robot {robot.name!r} has feet, and no trunk that floats as x, z and pitch; "
                "identification knows robots that float, and arms that stand fixed"
            )
        if self.first and not (self.soles and all(each.flat for each in self.soles)):
            raise RobotError(
                f"robot {robot.name!r}: its feet must be flat, which hold the trunk where the "
                "joints say; on points nothing tells how the trunk is turned"
            )
        model = robot.model
        unit = model.replaced(
            mass=np.ones(model.nl), center_of_mass=np.zeros((model.nl, 2)),
            inertia=np.ones(model.nl), armature=np.zeros(model.nv), damping=np.zeros(model.nv),
            stiffness=np.zeros(model.nv),
        )  # fmt: skip
        self._unit = unit  # which is referred to weakly
        self._linear = Differentiated(unit, NUMBERS)
        # Code is made for what is zero or one in a model, and here nothing stays so.
        generic = np.linspace(*GENERIC, len(self.unknowns))
        given = self.unknowns.laid_on(robot, generic)
        self._assumed = model.replaced(**given)
        self._differentiated = Differentiated(self._assumed)
        self._places = self._chosen()

    def _chosen(self) -> list[int]:
        """Columns of the derivatives that are those of the unknowns, in their order."""
        where = columns_of(self.robot.model, NUMBERS)
        begin = {name: where[name].start for name in NUMBERS}
        found = []
        for i in self.unknowns.links.tolist():
            center = begin["center_of_mass"] + 2 * i
            found += [begin["mass"] + i, center, center + 1, begin["inertia"] + i]
        for j in self.unknowns.joints.tolist():
            found += [begin["armature"] + j, begin["damping"] + j]
        return found

    def turned(self, foot: int | None) -> tuple[Floats, Floats]:
        """Return how all coordinates follow from the joints: a constant (nq,), a matrix (nq, k).

        Those of where the trunk is are zero.

        Parameters
        ----------
        foot : int or None
            The foot that stands flat; None of a robot that stands fixed.
        """
        model, first = self.robot.model, self.first
        constant, matrix = np.zeros(model.nq), np.zeros((model.nq, model.nq - first))
        matrix[first:] = np.eye(model.nq - first)
        if foot is not None:
            own = self.soles[foot]
            constant[2] = own.angle
            for j in leg(self.robot, own):
                constant[2] += model.axis[j, 0] * model.reference[j]
                matrix[2, j - first] = -model.axis[j, 0]
            constant[2] /= model.axis[2, 0]
            constant[2] += model.reference[2]
            matrix[2] /= model.axis[2, 0]
        return constant, matrix

    def columns(self, theta: tuple[Floats, Floats, Floats], foot: int | None) -> Columns:
        """Return the columns along a motion.

        Parameters
        ----------
        theta : tuple of three (n, k) arrays
            Positions, velocities and accelerations of the joints.
        foot : int or None
            The foot that stands flat.
        """
        model = self.robot.model
        constant, matrix = self.turned(foot)
        q, v, a = constant + theta[0] @ matrix.T, theta[1] @ matrix.T, theta[2] @ matrix.T
        found = allocate_along(model, len(q), NUMBERS)
        found.q[:], found.v[:], found.acceleration[:] = q, v, a
        self._linear.look_along(found, UP)
        if foot is not None:
            at = 2 * self.soles[foot].contacts[0]
            a[:, 0], a[:, 1] = -found.along[:, at + 1], -found.along[:, at]
            found.acceleration[:] = a
            self._linear.look_along(found, UP)
        whole = np.zeros((len(q), model.nv, len(self.unknowns)))
        smooth, rubs = self._split()
        whole[:, :, smooth] = found.lacking_by_numbers[:, :, self._places]
        for place, j in zip(rubs, self.unknowns.joints.tolist(), strict=True):
            whole[:, j, place] = np.sign(v[:, j])
        spring = model.stiffness * (q - model.rest)
        spring[:, : self.first] = 0.0
        along = self._along(found.rows, matrix, foot)
        return Columns(
            motors=np.swapaxes(along, 1, 2) @ whole, ground=whole[:, : self.first],
            known=spring[:, self.first :], q=q, v=v, acceleration=a, rows=found.rows,
            going_by_q=found.along_by_q, going_by_v=found.along_by_v,
        )  # fmt: skip

    def jacobians(self, q: Floats) -> Floats:
        """Return Jacobians of the contact points, (n, 2 nc, nv), normal and tangent.

        Parameters
        ----------
        q : (n, nq) array
            Positions.
        """
        found = allocate_along(self.robot.model, len(q), NUMBERS)
        found.q[:], found.v[:], found.acceleration[:] = q, 0.0, 0.0
        self._linear.look_along(found, UP)
        return found.rows

    def slopes(self, at: Columns, values: Floats, foot: int | None) -> Slopes:
        """Return derivatives by the motion.

        Parameters
        ----------
        at : Columns
            The columns along it.
        values : (unknowns,) array
            What is unknown, as it is assumed.
        foot : int or None
            The foot that stands flat.
        """
        for name, value in self.unknowns.laid_on(self.robot, values).items():
            getattr(self._assumed, name)[:] = value
        first, count = self.first, len(at.q)
        _, matrix = self.turned(foot)
        found = allocate_along(self._assumed, count)
        found.q[:], found.v[:], found.acceleration[:] = at.q, at.v, at.acceleration
        found.push[:] = 0.0
        if foot is not None:
            held = self.held_rows(foot)
            exerted = np.linalg.pinv(np.swapaxes(at.rows[:, held, :first], 1, 2))
            forces = exerted @ (at.ground @ values)[:, :, None]
            found.push[:, list(self.soles[foot].contacts)] = forces.reshape(count, -1, 2)
        self._differentiated.look_along(found, UP)
        along, inertia = self._along(at.rows, matrix, foot), found.matrix
        changes = [found.lacking_by_q @ matrix, found.lacking_by_v @ matrix, inertia @ along]
        if foot is not None:  # the trunk accelerates so that the sole does not
            point = 2 * self.soles[foot].contacts[0]
            for change, going in zip(changes, (at.going_by_q, at.going_by_v), strict=False):
                for axis, row in ((0, point + 1), (1, point)):
                    change -= inertia[:, :, axis, None] * (going[:, row] @ matrix)[:, None, :]
        back = np.swapaxes(along, 1, 2)
        zero, one, two = changes
        return Slopes(
            motors=(back @ zero, back @ one, back @ two),
            ground=(zero[:, :first], one[:, :first], two[:, :first]),
        )

    def held_rows(self, foot: int) -> list[int]:
        """Rows of the Jacobian that are those of a foot's contact points."""
        return [2 * i + k for i in self.soles[foot].contacts for k in range(2)]

    def _along(self, rows: Floats, matrix: Floats, foot: int | None) -> Floats:
        """Return N, (n, nv, k): how all velocities follow from those of the joints."""
        found = np.tile(matrix, (len(rows), 1, 1))
        if foot is not None:
            point = 2 * self.soles[foot].contacts[0]
            found[:, 0], found[:, 1] = -rows[:, point + 1] @ matrix, -rows[:, point] @ matrix
        return found

    def _split(self) -> tuple[list[int], list[int]]:
        """Places of the unknowns that act smoothly, and of dry friction."""
        dry = [k for k, kind in enumerate(self.unknowns.kinds) if kind == OF_A_JOINT[-1]]
        return [k for k in range(len(self.unknowns)) if k not in dry], dry
