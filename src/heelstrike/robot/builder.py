"""A robot built in Python, without a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.robot.assembly import assembled
from heelstrike.robot.contact_points import ContactPoint, in_order, of_model
from heelstrike.robot.model import (
    AXES,
    NUMBERS,
    POWERS,
    PROPERTIES,
    JointProperties,
    Limits,
    Model,
    Pair,
    bounds,
)
from heelstrike.robot.robot import Robot

UNLIMITED = (-math.inf, math.inf)


@dataclass(frozen=True)
class _Link:
    """One link with its joint, checked."""

    joint: str
    name: str
    numbers: dict[str, Any]
    torque: tuple[float, float] | None


class RobotBuilder:
    """Builds a planar robot link by link.

    Describe the robot in one configuration, its reference. There all link frames are parallel to
    the world frame (x forward, z up), and each has its origin at the joint that moves the link. The
    robot is the one that an MJCF file with the same numbers gives.

    Parameters
    ----------
    name : str
        Name of the robot.
    gravity : float
        Acceleration of free fall (m/s²), downwards.

    Examples
    --------
    >>> import heelstrike as hs
    >>> biped = hs.RobotBuilder("biped")
    >>> trunk = biped.floating_base("trunk", (0, 0.8), mass=20, inertia=1, center_of_mass=(0, 0.2))
    >>> for side in ("right", "left"):
    ...     leg = biped.slide(f"{side}_leg", trunk, direction=(0, -1), mass=2, torque=400)
    ...     foot = biped.hinge(f"{side}_ankle", leg, at=(0, -0.75), mass=1, inertia=0.01, torque=50)
    ...     biped.sole(foot, heel=(-0.05, -0.05), toe=(0.12, -0.05))
    >>> biped.build()
    Robot('biped': 7 coordinates, 4 actuators, 4 contact points, 26 kg)
    """

    @takes(RobotError)
    def __init__(self, name: str, *, gravity: float = 9.81) -> None:
        self.name = name
        self._gravity = _number("gravity", gravity)
        self._links: list[_Link] = []
        self._points: list[ContactPoint] = []
        self._loops: list[tuple[tuple[int, int], tuple[Pair, Pair]]] = []
        self._couplings: list[tuple[tuple[int, int], tuple[float, ...]]] = []
        self._latches: list[tuple[int, int, int]] = []
        self._brakes: dict[int, float] = {}

    def floating_base(
        self, link: str, at: Pair = (0.0, 0.0), **properties: Unpack[JointProperties]
    ) -> str:
        """Add the trunk of a robot that moves freely: its coordinates are x, z and pitch.

        Parameters
        ----------
        link : str
            Name of the trunk. Its joints are ``root_x``, ``root_z`` and ``root_pitch``.
        at : (2,) float
            Where the origin of its frame is when the robot stands as described (m).
        **properties : JointProperties
            Mass, inertia, centre of mass.

        Returns
        -------
        str
            `link`, to hang other links on.
        """
        if self._links:
            raise self._error(f"the floating base {link!r} must be the first link.")
        x, z = _pair("at", at)
        self._add("root_x", link, None, (0.0, 1.0, 0.0), (0.0, 0.0), {"reference": x})
        self._add("root_z", link, link, (0.0, 0.0, 1.0), (0.0, 0.0), {"reference": z})
        return self._add("root_pitch", link, link, (1.0, 0.0, 0.0), (x, z), properties)

    def hinge(
        self,
        name: str,
        parent: str | None,
        *,
        at: Pair = (0.0, 0.0),
        link: str = "",
        sense: int = 1,
        **properties: Unpack[JointProperties],
    ) -> str:
        """Add a link that turns on another.

        Parameters
        ----------
        name : str
            Name of the joint.
        parent : str or None
            Link that carries it; None for the world.
        at : (2,) float
            Place of the joint in the frame of that link (m).
        link : str, optional
            Name of the new link, by default that of the joint.
        sense : {1, -1}
            Whether a positive coordinate turns about +y (clockwise, seen with x to the right) or
            about -y.
        **properties : JointProperties
            Everything that link and joint have.

        Returns
        -------
        str
            Name of the new link.

        Raises
        ------
        RobotError
            If a name is taken or unknown, or a number is impossible.
        """
        if sense not in (1, -1):
            raise self._error(f"joint {name!r}: sense is 1 or -1, got {sense!r}.")
        axis = (float(sense), 0.0, 0.0)
        return self._add(name, link or name, parent, axis, _pair("at", at), properties)

    def slide(
        self,
        name: str,
        parent: str | None,
        *,
        direction: Pair,
        at: Pair = (0.0, 0.0),
        link: str = "",
        **properties: Unpack[JointProperties],
    ) -> str:
        """Add a link that slides on another.

        Parameters
        ----------
        name : str
            Name of the joint.
        parent : str or None
            Link that carries it; None for the world.
        direction : (2,) float
            Way of a positive coordinate in the frame of that link, of any length.
        at : (2,) float
            Place of the joint in the frame of that link (m).
        link : str, optional
            Name of the new link, by default that of the joint.
        **properties : JointProperties
            Everything that link and joint have.

        Returns
        -------
        str
            Name of the new link.

        Raises
        ------
        RobotError
            If a name is taken or unknown, or a number is impossible.
        """
        x, z = _pair("direction", direction)
        length = math.hypot(x, z)
        if not length > 0.0:
            raise self._error(f"joint {name!r} slides along (0, 0), which is no direction.")
        axis = (0.0, x / length, z / length)
        return self._add(name, link or name, parent, axis, _pair("at", at), properties)

    def contact(
        self,
        link: str,
        at: Pair,
        *,
        radius: float = 0.0,
        friction: float = 1.0,
        friction_scale: float = 1.0,
        restitution_scale: float = 1.0,
    ) -> None:
        """Add a contact point: a disc fixed to a link, a point if its radius is zero.

        Parameters
        ----------
        link : str
            Link that carries it.
        at : (2,) float
            Its centre in the frame of that link (m).
        radius : float
            Radius (m).
        friction : float
            Friction of its surface, as files give it. A simulation takes friction from the ground;
            left and right are compared by it.
        friction_scale, restitution_scale : float
            What friction and restitution of the ground are multiplied by under it: 0.5 for a point
            that is half as rough as those that the ground was measured with. Restitution cannot be
            more than the ground's.
        """
        x, z = _pair("at", at)
        size, roughness = _number("radius", radius, 0.0), _number("friction", friction, 0.0)
        scales = {"friction_scale": friction_scale, "restitution_scale": restitution_scale}
        for name, scale in scales.items():
            number = NUMBERS[name]
            if not _number(name, scale, number.least) <= number.most:
                raise self._error(f"{name} of a contact point must be {bounds(name)}, got {scale}.")
        its = {name: float(scale) for name, scale in scales.items()}
        self._points.append(ContactPoint(self._index(link), x, z, size, roughness, **its))

    def sole(
        self,
        link: str,
        *,
        heel: Pair,
        toe: Pair,
        friction: float = 1.0,
        friction_scale: float = 1.0,
        restitution_scale: float = 1.0,
    ) -> None:
        """Add the two ends of a flat sole; see :meth:`contact`.

        Parameters
        ----------
        link : str
            Link that carries it.
        heel, toe : (2,) float
            Its ends in the frame of that link (m).
        friction, friction_scale, restitution_scale : float
            As for :meth:`contact`, alike for both.
        """
        for end in (heel, toe):
            self.contact(
                link,
                end,
                friction=friction,
                friction_scale=friction_scale,
                restitution_scale=restitution_scale,
            )

    def loop(self, link: str, other: str | None, *, at: Pair, other_at: Pair | None = None) -> None:
        """Close a loop: join two links, which depend on others already, by one more hinge.

        It holds exactly, whatever it takes; what it takes is recorded as ``Run.loop_force``.

        Parameters
        ----------
        link, other : str
            The two links; None for the world as the other.
        at : (2,) float
            Place of the hinge in the frame of the first link (m).
        other_at : (2,) float, optional
            Its place in the frame of the other (m). By default where it is as the robot stands in
            its reference; if it is elsewhere, the loop is open there, and :meth:`Robot.closed`
            finds states in which it is not.

        Raises
        ------
        RobotError
            If a link is unknown, or both are one.
        """
        first = self._index(link, "a loop joins")
        second = -1 if other is None else self._index(other, "a loop joins")
        if first == second:
            raise self._error(f"a loop joins link {link!r} to itself: name two links.")
        try:
            x, z = _pair("at", at)
            if other_at is None:
                (x1, z1), (x2, z2) = self._origin(first), self._origin(second)
                other_at = x + x1 - x2, z + z1 - z2
            places = (x, z), _pair("other_at", other_at)
        except RobotError as error:
            raise self._error(f"loop of {link!r} and {other!r}: {error}") from None
        self._loops.append(((first, second), places))

    def couple(
        self, joint: str, leader: str | None, polynomial: Sequence[float] = (0.0, 1.0)
    ) -> None:
        """Let a joint follow another, as gears or belts make it.

        Parameters
        ----------
        joint : str
            The joint that follows.
        leader : str or None
            The joint that it follows; None holds it where the first coefficient says.
        polynomial : sequence of float
            How far from its reference the joint is (rad, m): up to five coefficients of the powers
            0, 1 … of how far the leader is from its own. By default as far as the leader.

        Raises
        ------
        RobotError
            If a joint is unknown or follows itself or two others, or the coefficients are none.
        """
        places = self._joint(joint), -1 if leader is None else self._joint(leader)
        if places[0] == places[1]:
            raise self._error(f"joint {joint!r} cannot follow itself.")
        if any(places[0] == follower for (follower, _), _ in self._couplings):
            raise self._error(f"joint {joint!r} follows another already.")
        if not 1 <= len(polynomial) <= POWERS:
            raise self._error(
                f"joint {joint!r} follows by a polynomial of one to {POWERS} coefficients, got "
                f"{polynomial!r}."
            )
        try:
            factors = [_number("a coefficient of its polynomial", each) for each in polynomial]
        except RobotError as error:
            raise self._error(f"coupling of joint {joint!r}: {error}") from None
        self._couplings.append((places, (*factors, *[0.0] * (POWERS - len(factors)))))

    def latch(self, joint: str, end: str, *, release: str | None = None) -> None:
        """Let an end of a joint's range hold the joint once it is there, as locks of knees do.

        Parameters
        ----------
        joint : str
            The joint, which has a limit at that end.
        end : {"lower", "upper"}
            The end that holds it.
        release : str, optional
            Link that makes it let go when it touches down, by any of its contact points. Else the
            latch holds until :attr:`Simulation.latched` says otherwise.

        Raises
        ------
        RobotError
            If joint or link are unknown, or the joint has no limit there or a latch already.
        """
        place = self._joint(joint, "latch")
        if end not in ("lower", "upper"):
            raise self._error(
                f"the latch of joint {joint!r} is at an end, 'lower' or 'upper', not {end!r}."
            )
        if not math.isfinite(self._links[place].numbers[end]):
            raise self._error(
                f"the latch of joint {joint!r} holds it at its {end} limit: give the joint limits."
            )
        if any(place == known for known, _, _ in self._latches):
            raise self._error(f"joint {joint!r} has a latch already.")
        by = -1 if release is None else self._index(release, f"the latch of {joint!r} lets go by")
        self._latches.append((place, 1 if end == "upper" else -1, by))

    def brake(self, joint: str, *, limit: float = math.inf) -> None:
        """Give a joint a brake, which holds it wherever it is while it is on.

        It is off until :attr:`Simulation.braked` says otherwise. What it does to the joint is
        recorded as ``Run.brake_torque``.

        Parameters
        ----------
        joint : str
            The joint.
        limit : float
            The most that it holds (N m, N): beyond that it slips, and a joint that moves is slowed
            down by as much. By default it holds whatever comes, and stops the joint at once.

        Raises
        ------
        RobotError
            If there is no such joint, it has a brake already, or the limit is not positive.
        """
        place = self._joint(joint, "brake")
        if place in self._brakes:
            raise self._error(f"joint {joint!r} has a brake already.")
        if not limit > 0.0:
            raise self._error(
                f"the limit of the brake of joint {joint!r} must be positive, got {limit!r}."
            )
        self._brakes[place] = float(limit)

    def build(self) -> Robot:
        """Return the robot. The builder may go on and build others.

        Raises
        ------
        RobotError
            If there are no links, or a joint moves no mass.

        Warns
        -----
        RobotWarning
            If names speak of left and right, but the two differ.
        """
        links = self._links
        if not links:
            raise self._error("the robot has no links.")
        points = in_order(self._points)
        driven = [i for i, link in enumerate(links) if link.torque is not None]
        torques = np.reshape([links[i].torque for i in driven], (-1, 2)).T
        numbers = {name: [link.numbers[name] for link in links] for name in links[0].numbers}
        model = Model.made(
            **numbers,
            gravity=(0.0, -self._gravity),
            **of_model(points),
            actuator_joint=driven,
            torque_lower=torques[0],
            torque_upper=torques[1],
            loop_link=[links for links, _ in self._loops],
            loop_position=[places for _, places in self._loops],
            coupling_joint=[joints for joints, _ in self._couplings],
            coupling_polynomial=[factors for _, factors in self._couplings],
            latch_joint=[joint for joint, _, _ in self._latches],
            latch_side=[side for _, side, _ in self._latches],
            latch_release=[link for _, _, link in self._latches],
            brake_joint=list(self._brakes),
            brake_limit=list(self._brakes.values()),
            pivot=next((i for i, link in enumerate(links) if link.numbers["axis"][0]), 0),
        )
        return assembled(
            self.name,
            model,
            joint_names=tuple(link.joint for link in links),
            link_names=tuple(link.name for link in links),
            actuator_names=tuple(links[i].joint for i in driven),
            points=points,
            source=self.name,
        )

    def _add(
        self,
        joint: str,
        name: str,
        parent: str | None,
        axis: tuple[float, float, float],
        at: tuple[float, float],
        properties: JointProperties,
    ) -> str:
        unknown = set(properties) - set(JointProperties.__annotations__)
        if unknown:
            raise TypeError(
                f"joint {joint!r} got {', '.join(sorted(unknown))}; it may have "
                f"{', '.join(JointProperties.__annotations__)}"
            )
        if any(link.joint == joint for link in self._links):
            raise self._error(f"there is a joint {joint!r} already.")
        # The massless links of one base share its name; nothing else does.
        if any(link.name == name for link in self._links) and not joint.startswith("root_"):
            raise self._error(f"there is a link {name!r} already.")
        place = -1 if parent is None else self._index(parent, f"joint {joint!r} is attached to")
        try:
            numbers, torque = _numbers(properties), _torque(properties.get("torque"))
        except RobotError as error:
            raise self._error(f"joint {joint!r}: {error}") from None
        numbers |= {"parent": place, "axis": axis, "offset": at}
        self._links.append(_Link(joint, name, numbers, torque))
        return name

    def _joint(self, joint: str, what: str = "couple") -> int:
        names = [link.joint for link in self._links]
        if joint not in names:
            known = ", ".join(names) or "none yet"
            raise self._error(f"there is no joint {joint!r} to {what}. Joints are: {known}.")
        return names.index(joint)

    def _origin(self, link: int) -> tuple[float, float]:
        """World position of the frame of a link in the reference configuration."""
        x = z = 0.0
        while link >= 0:
            numbers = self._links[link].numbers
            x, z = x + numbers["offset"][0], z + numbers["offset"][1]
            link = numbers["parent"]
        return x, z

    def _index(self, link: str, why: str = "a contact point is on") -> int:
        for i in reversed(range(len(self._links))):
            if self._links[i].name == link:
                return i
        known = ", ".join(dict.fromkeys(one.name for one in self._links)) or "none yet"
        raise self._error(f"{why} link {link!r}, which there is not. Links are: {known}.")

    def _error(self, message: str) -> RobotError:
        return RobotError(f"{self.name}: {message}")


def _numbers(given: JointProperties) -> dict[str, Any]:
    """Check what is given of each number; a joint has defaults of which nobody said them."""
    values: Any = given  # a key out of a list is not a literal to type checkers
    numbers: dict[str, Any] = {}
    for name, number in PROPERTIES.items():
        key = number.called or name
        if "axes" in number.shape:
            numbers[name] = _pair(key, values.get(key, (number.default,) * AXES))
        else:
            value = values.get(key, number.default)
            numbers[name] = _number(key, value, number.least, infinite=number.infinite)
    numbers["lower"], numbers["upper"] = _ordered("limits", given.get("limits", UNLIMITED))
    gear = _number("gear", given.get("gear", 1.0))
    numbers["armature"] += gear**2 * _number("motor_inertia", given.get("motor_inertia", 0.0), 0.0)
    return numbers


def _torque(given: Limits | None) -> tuple[float, float] | None:
    if given is None:
        return None
    if isinstance(given, Sequence | np.ndarray):
        return _ordered("torque", given)
    size = _number("torque", given, 0.0, infinite=True)
    return _ordered("torque", (-size, size))


def _ordered(what: str, given: Pair) -> tuple[float, float]:
    low, high = _pair(what, given, infinite=True)
    if not low < high:
        raise RobotError(f"{what} must go from low to high, got {low:g} to {high:g}.")
    return low, high


def _pair(what: str, given: Pair, *, infinite: bool = False) -> tuple[float, float]:
    try:
        first, second = given
    except (TypeError, ValueError):
        raise RobotError(f"{what} must be a pair of numbers, got {given!r}.") from None
    return _number(what, first, infinite=infinite), _number(what, second, infinite=infinite)


def _number(what: str, given: float, least: float = -math.inf, *, infinite: bool = False) -> float:
    try:
        number = float(given)
    except (TypeError, ValueError):
        raise RobotError(f"{what} must be a number, got {given!r}.") from None
    if math.isnan(number) or (math.isinf(number) and not infinite):
        raise RobotError(f"{what} must be finite, got {number:g}.")
    if number < least:
        raise RobotError(f"{what} must not be negative, got {number:g}.")
    return number
