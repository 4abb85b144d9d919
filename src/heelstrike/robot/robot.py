"""What a robot is: the kernels' arrays with the names, feet and symmetry a person needs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.coordinates import Spread, checked, finite, spread_of
from heelstrike.robot.model import Integers, Model
from heelstrike.robot.named_tree import Foot as Foot  # where pickles of 0.1 look for it
from heelstrike.robot.named_tree import NamedTree
from heelstrike.robot.shapes.outlines import Outline
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground


@dataclass(frozen=True)
class LockedJoint:
    """A joint of a robot's file that the planar robot does not have."""

    name: str
    link: str
    """name, link: Name of the joint and of the body that it moves in the file."""
    kind: str
    """``hinge``, ``slide``, ``ball`` or ``free``."""
    axis: tuple[float, float, float]
    """Its axis in the world (x forward, y to the left, z up); zero where it has no single one."""
    position: float
    """Where it is locked (rad, m)."""
    reason: str
    """Why it does not move."""


@dataclass(frozen=True, eq=False)
class Robot(NamedTree, ShownInNotebooks):
    """A planar robot."""

    model: Model
    """The arrays that the kernels use."""
    mirror: Mirror | None
    """Exchange of left and right, or None for a robot that is not symmetric."""
    floating: bool
    """Whether the first three coordinates are the trunk's x, z and pitch."""
    contact_friction: tuple[float, ...] = ()
    """Friction of the nc contact points according to the robot's file, empty if unknown. A
    simulation takes friction from its `Ground`."""
    source: str = field(default="", repr=False)
    """File or builder the robot came from, for error messages."""
    locked: tuple[LockedJoint, ...] = field(default=(), repr=False)
    """Joints of its file that do not move here, as ``projected=True`` makes them."""
    outlines: tuple[Outline, ...] = field(default=(), repr=False)
    """What its links look like, for pictures; nothing if its file has no shapes."""
    constraints: tuple[Any, ...] = field(default=(), repr=False)
    """What else holds it in simulations, by :func:`~heelstrike.sim.constrained`."""

    def __post_init__(self) -> None:
        if self.mirror is not None:
            mirror = replace(self.mirror, reference=self.model.reference)
            object.__setattr__(self, "mirror", mirror)

    @property
    def loop_names(self) -> tuple[str, ...]:
        """Names of the closed loops: those of the two links that each joins."""
        names = [*self.link_names, "world"]  # which is link -1
        return tuple(f"{names[a]}-{names[b]}" for a, b in self.model.loop_link.tolist())

    @property
    def coupling_names(self) -> tuple[str, ...]:
        """Names of the joints that follow others."""
        return tuple(self.joint_names[joint] for joint in self.model.coupling_joint[:, 0])

    @property
    def latch_names(self) -> tuple[str, ...]:
        """Names of the joints that latches hold."""
        return tuple(self.joint_names[joint] for joint in self.model.latch_joint)

    @property
    def brake_names(self) -> tuple[str, ...]:
        """Names of the joints that have a brake."""
        return tuple(self.joint_names[joint] for joint in self.model.brake_joint)

    @property
    def weight(self) -> float:
        """Total mass times gravity, in N."""
        return self.total_mass * float(np.hypot(*self.model.gravity))

    @property
    def driven(self) -> Integers:
        """Index of the velocity that each actuator drives, (nu,)."""
        return self.model.actuator_joint

    @takes(RobotError)
    def state(
        self,
        position: Mapping[str | int, float] | None = None,
        velocity: Mapping[str | int, float] | None = None,
        *,
        start: State | None = None,
    ) -> State:
        """Make a state with some joints set by their names.

        Parameters
        ----------
        position : mapping, optional
            Positions (rad, m) of joints by name or index.
        velocity : mapping, optional
            Velocities (rad/s, m/s) likewise.
        start : State, optional
            Where all others are, by default at rest in the reference configuration. It is left as
            it is.

        Returns
        -------
        State
            The state.

        Raises
        ------
        RobotError
            If a joint is unknown, or a number is not finite.

        Examples
        --------
        >>> import heelstrike as hs
        >>> robot = hs.load_robot("bravo7")
        >>> state = robot.state({"left_knee": 0.4}, {"root_x": 0.8})
        >>> robot.positions(state)["left_knee"], robot.velocities(state)["root_x"]
        (0.4, 0.8)
        """
        state = checked(self, start or self.reference_state())
        for vector, values, what in (
            (state.q, position or {}, "position"),
            (state.v, velocity or {}, "velocity"),
        ):
            for joint, value in values.items():
                index = self.joint_index(joint)
                vector[index] = finite(self, what, self.joint_names[index], value)
        return state

    def mirrored(self, state: State) -> State:
        """Return a state with left and right exchanged.

        Parameters
        ----------
        state : State
            The state.

        Returns
        -------
        State
            Its mirror image.

        Raises
        ------
        RobotError
            If the robot has no mirror image.
        """
        state = checked(self, state)
        if self.mirror is None:
            raise RobotError(
                f"robot {self.name!r} has no mirror image: its left and right differ, or its names "
                "do not tell them apart. heelstrike inspect says which."
            )
        return self.mirror.state(state)

    @takes(RobotError)
    def perturbed(
        self,
        state: State,
        *,
        seed: int,
        position: Spread = 0.0,
        velocity: Spread = 0.0,
        joints: Iterable[str | int] | None = None,
    ) -> State:
        """Return a state to which independent Gaussian numbers are added.

        Parameters
        ----------
        state : State
            State to start from, left as it is.
        seed : int
            The same seed gives the same numbers, and a joint's number does not depend on which
            others are perturbed.
        position, velocity : float or mapping
            Standard deviations, in rad and m, rad/s and m/s: one for all coordinates, or a mapping
            from the joints (by name or index) that are perturbed to theirs.
        joints : iterable of str or int, optional
            Joints that are perturbed, by default all, trunk included.

        Returns
        -------
        State
            Its positions stay inside the joints' ranges; its feet may be in the ground or above it,
            and its loops open (see :meth:`closed`).

        Raises
        ------
        RobotError
            If a joint is unknown, or a standard deviation negative or not finite.
        """
        state = checked(self, state)
        chosen = np.ones(self.nv, dtype=bool)
        if joints is not None:
            chosen[:] = False
            given = (joints,) if isinstance(joints, str | int) else joints
            chosen[[self.joint_index(joint) for joint in given]] = True
        # All coordinates draw: the number of one does not depend on which others are chosen.
        draw = np.random.default_rng(seed).standard_normal((2, self.nv))
        q = state.q + np.where(chosen, draw[0] * spread_of(self, "position", position), 0.0)
        v = state.v + np.where(chosen, draw[1] * spread_of(self, "velocity", velocity), 0.0)
        low = np.minimum(self.model.lower, state.q)
        high = np.maximum(self.model.upper, state.q)
        return State(np.clip(q, low, high), v)

    def placed(self, state: State, ground: Ground) -> State:
        """Return a state moved up or down, until the robot touches the ground and is nowhere in it.

        Parameters
        ----------
        state : State
            The state, left as it is: its posture, place along x and velocities stay.
        ground : Ground
            Any ground: level, a slope, stairs, rough.

        Returns
        -------
        State
            The state, with another height of the trunk.

        Raises
        ------
        RobotError
            If nothing lifts the robot, as a floating trunk does, or it has no contact points.

        Examples
        --------
        >>> import heelstrike as hs
        >>> robot, hill = hs.load_robot("compass_gait"), hs.Ground(slope=0.05)
        >>> state = robot.placed(robot.reference_state(), hill)
        >>> float(hs.contact_kinematics(robot, state.q, state.v, hill).gap.min().round(12))
        0.0
        """
        from heelstrike.contact.queries.placing import placed

        return placed(self, state, ground)

    @takes(RobotError)
    def standing(self, ground: Ground) -> State:
        """Return a state at rest in which the robot stands on the ground, its soles on it.

        The trunk is upright as in the reference configuration; the legs change as little as they
        can for all soles to touch with both ends. Where a foot would have to be tilted far, as on
        the edge of a stair, the posture stays, and the lowest point touches.

        Parameters
        ----------
        ground : Ground
            Any ground: level, a slope, stairs, rough.

        Returns
        -------
        State
            The state.

        Raises
        ------
        RobotError
            If nothing lifts the robot, as a floating trunk does, or it has no contact points.

        Examples
        --------
        >>> import heelstrike as hs
        >>> robot, hill = hs.load_robot("bravo7"), hs.Ground(slope=0.05)
        >>> state = robot.standing(hill)
        >>> hs.contact_kinematics(robot, state.q, state.v, hill).gap.round(9) + 0.0
        array([0., 0., 0., 0.])
        """
        from heelstrike.contact.queries.placing import standing

        return standing(self, ground)

    def closed(self, state: State, *, keep: Iterable[str | int] = ()) -> State:
        """Return the nearest state in which all loops are closed and all couplings hold.

        Positions move the shortest way by the masses, but not out of the joints' ranges, and so do
        velocities, as an impact would change them.

        Parameters
        ----------
        state : State
            The state, left as it is.
        keep : iterable of str or int, optional
            Joints that stay as they are, in position and velocity: the crank of a four-bar.

        Returns
        -------
        State
            The state; the same if the robot has neither loops nor couplings.

        Raises
        ------
        RobotError
            If a joint is unknown, or no such state is found.

        Examples
        --------
        >>> import heelstrike as hs
        >>> build = hs.RobotBuilder("pair")
        >>> for name in ("front", "rear"):
        ...     wheel = build.hinge(name, None, mass=1.0, inertia=0.1)
        >>> build.couple("rear", "front", [0.0, 2.0])
        >>> pair = build.build()
        >>> pair.closed(pair.state({"front": 0.3}), keep=["front"]).q
        array([0.3, 0.6])
        """
        from heelstrike.contact.queries.placing import closed

        return closed(self, state, keep)

    @takes(RobotError)
    def save_state(self, state: State, path: str | os.PathLike[str]) -> Path:
        """Write a state to a JSON file, with the names of the joints; return its path.

        Parameters
        ----------
        state : State
            The state.
        path : str or path
            File to write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RobotError
            If the state is not one of this robot, or the file cannot be written.
        """
        from heelstrike.robot.state_file import save_state

        return save_state(self, state, path)

    @takes(RobotError)
    def load_state(self, path: str | os.PathLike[str]) -> State:
        """Read a state from a file of :meth:`save_state`, bit by bit the one that was saved.

        Joints are matched by name, so that their order in the robot may have changed since.

        Parameters
        ----------
        path : str or path
            File to read.

        Returns
        -------
        State
            The state, in the order of this robot's joints.

        Raises
        ------
        RobotError
            If the file is none of a state, or of a robot with other joints.
        """
        from heelstrike.robot.state_file import load_state

        return load_state(self, path)

    @takes(RobotError)
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the robot to a file: MJCF (``.xml``) holds all of it, URDF and SDF most.

        What is read back has the same dynamics, on the same coordinates. URDF (``.urdf``) and SDF
        (``.sdf``) cannot hold speed-torque lines, and keep the larger of two torque limits that
        differ between the two senses; URDF cannot hold springs and armature of joints without a
        motor either. The zero configuration of either becomes the robot's reference.

        Parameters
        ----------
        path : str or path
            File to write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RobotError
            If the ending is another one, or the file cannot be written.

        Warns
        -----
        RobotWarning
            With everything that the format cannot hold, joint by joint.
        """
        from heelstrike.robot.files.saving.saving import save_robot

        return save_robot(self, path)

    def c_code(self, name: str | None = None) -> str:
        """Return its equations of motion as a page of C99, for other programs.

        Functions of plain arrays of doubles, without branches; the robot's numbers stand in
        tables at the head. Nothing is included but ``math.h``.

        - ``NAME_kinematics(q, angle, origin)``: poses of the links, (nv,) and (nv, 2);
        - ``NAME_mass_matrix(q, matrix)``: the mass matrix A, (nv, nv);
        - ``NAME_bias_force(q, v, bias)``: centrifugal, Coriolis and gravitational forces H, (nv,);
        - ``NAME_solve(q, v, force, acceleration)``: A⁻¹ (force − H), (nv,);
        - ``NAME_loops(q, v, open_by, jacobian, bias)``, of a robot with closed loops or coupled
          joints: φ, J and J̇ v of their equations, (m,), (m, nv) and (m,). Their forces λ act as
          Jᵀ λ, a part of `force`, and keep J a + J̇ v = 0.

        Parameters
        ----------
        name : str, optional
            What the functions' names begin with; the robot's own name if none is given.

        Returns
        -------
        str
            The page, to be written to a file.

        Examples
        --------
        >>> import heelstrike as hs
        >>> "void bravo7_mass_matrix(" in hs.load_robot("bravo7").c_code()
        True
        """
        from heelstrike.dynamics.queries.c_code import c_code

        return c_code(self.model, name or self.name, self.joint_names)

    def __repr__(self) -> str:
        return (
            f"Robot({self.name!r}: {self.nv} coordinates, {self.nu} actuators, "
            f"{self.nc} contact points, {self.total_mass:g} kg)"
        )
