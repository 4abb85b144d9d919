"""What a robot in space is: the kernels' arrays with the names and feet a person needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.coordinates import checked, index_of
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import Foot, NamedTree
from heelstrike.robot.spatial.model import BALL, FREE, JointKind, SpatialModel
from heelstrike.robot.spatial.solids import Solid
from heelstrike.robot.state import State

UNIT = 1e-6
"""How far the length of a quaternion that a user gives may be from one: files give six digits."""

PLACE, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
LINEAR, ANGULAR = ("vx", "vy", "vz"), ("wx", "wy", "wz")


SpatialFoot = Foot
"""Its earlier name for feet in space, which are described as those of the plane are."""


@dataclass(frozen=True, eq=False)
class SpatialRobot(NamedTree):
    """A robot in three dimensions.

    Positions and velocities are those of MuJoCo for the same file: of a free joint the place of its
    body and a unit quaternion, real part first; the linear velocity in world axes, the angular one
    in body axes. A ball joint has a quaternion and an angular velocity in the axes of its body.
    """

    model: SpatialModel
    """The arrays that the kernels use."""
    contact_friction: tuple[float, ...] = ()
    """Friction of the nc contact points according to the robot's file. A simulation takes friction
    from its `Ground`."""
    source: str = field(default="", repr=False)
    """File the robot came from, for error messages."""
    solids: tuple[Solid, ...] = field(default=(), repr=False)
    """What its links look like, by the shapes of its file."""

    @property
    def floating(self) -> bool:
        """Whether the first joint is free."""
        return int(self.model.joint_kind[0]) == FREE

    @property
    def position_names(self) -> tuple[str, ...]:
        """Names of the nq positions: those of joints, or of what a joint has several of."""
        return self._names((*PLACE, *QUATERNION), QUATERNION)

    @property
    def velocity_names(self) -> tuple[str, ...]:
        """Names of the nv velocities: those of joints, or of what a joint has several of."""
        return self._names((*LINEAR, *ANGULAR), ANGULAR)

    def _names(self, free: tuple[str, ...], ball: tuple[str, ...]) -> tuple[str, ...]:
        endings = {FREE: free, BALL: ball}
        return tuple(
            f"{name}_{ending}" if ending else name
            for name, kind in zip(self.joint_names, self.model.joint_kind.tolist(), strict=True)
            for ending in endings.get(kind, ("",))
        )

    @property
    def weight(self) -> float:
        """Total mass times gravity, in N."""
        return self.total_mass * float(np.linalg.norm(self.model.gravity))

    @property
    def driven(self) -> Integers:
        """Index of the velocity that each actuator drives, (nu,)."""
        return self.model.actuator_velocity

    def _checked(self, state: State) -> State:
        return checked_state(self, state)

    @takes(RobotError)
    def state(
        self,
        position: Mapping[str, float] | None = None,
        velocity: Mapping[str, float] | None = None,
        *,
        start: State | None = None,
    ) -> State:
        """Make a state with some positions and velocities set by their names.

        Parameters
        ----------
        position : mapping, optional
            Positions (rad, m, entries of quaternions) by `position_names`: a hinge or slide by the
            name of its joint. Quaternions are made unit again.
        velocity : mapping, optional
            Velocities (rad/s, m/s) by `velocity_names`.
        start : State, optional
            Where all others are, by default at rest in the reference configuration.

        Returns
        -------
        State
            The state.

        Raises
        ------
        RobotError
            If a name is unknown, or a number is not finite.
        """
        before = start or self.reference_state()
        q, v = before.q.copy(), before.v.copy()
        for vector, names, values, what in (
            (q, self.position_names, position or {}, "position"),
            (v, self.velocity_names, velocity or {}, "velocity"),
        ):
            for name, value in values.items():
                vector[index_of(self, what, names, name)] = float(value)
        for first in quaternion_places(self.model):
            q[first : first + 4] /= np.linalg.norm(q[first : first + 4])
        return checked_state(self, State(q, v))

    def __repr__(self) -> str:
        kinds = [JointKind(kind) for kind in self.model.joint_kind.tolist()]
        several = {kind.name.lower(): kinds.count(kind) for kind in JointKind if kind in kinds}
        joints = ", ".join(f"{count} {name}" for name, count in several.items())
        return (
            f"SpatialRobot({self.name!r}: {self.nv} velocities ({joints}), {self.nu} actuators, "
            f"{self.nc} contact points, {self.total_mass:g} kg)"
        )


def quaternion_places(model: SpatialModel) -> list[int]:
    """Where in q the quaternions begin."""
    first, kinds = model.first_position.tolist(), model.joint_kind.tolist()
    inside = {FREE: 3, BALL: 0}
    return [
        place + inside[kind] for place, kind in zip(first, kinds, strict=True) if kind in inside
    ]


def checked_position(robot: SpatialRobot, q: Floats) -> Floats:
    """Return a position whose quaternions are of length one, to rounding.

    Raises
    ------
    RobotError
        If it has not nq finite numbers, or a quaternion is far from length one.
    """
    if q.shape != (robot.nq,) or not np.all(np.isfinite(q)):
        raise RobotError(
            f"q of robot {robot.name!r} must be {robot.nq} finite numbers "
            f"({', '.join(robot.position_names)}), got {q!r}."
        )
    unit = q.copy()
    for first in quaternion_places(robot.model):
        length = float(np.linalg.norm(q[first : first + 4]))
        if abs(length - 1.0) > UNIT:
            joint = int(np.searchsorted(robot.model.first_position, first, side="right")) - 1
            raise RobotError(
                f"the quaternion of joint {robot.joint_names[joint]!r} of robot {robot.name!r} "
                f"(q[{first}] to q[{first + 3}], real part first) has length {length:.6g}; it must "
                "be one."
            )
        unit[first : first + 4] /= length
    return unit


def checked_state(robot: SpatialRobot, state: State) -> State:
    """Return a copy of a state that fits a robot.

    Raises
    ------
    RobotError
        If it is none, has not nq positions and nv velocities, all finite, or a quaternion is far
        from length one.
    """
    sound = checked(robot, state)
    return State(checked_position(robot, sound.q), sound.v)
