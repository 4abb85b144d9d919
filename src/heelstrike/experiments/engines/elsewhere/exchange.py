"""What the scripts for other Pythons share: orders, answers, and where links are in the plane.

It is read by its path, and imports nothing of this package. A script has a class with

- ``__init__(asked)``: make what ``asked["links"]`` tells, with ``asked["step"]``, ``["friction"]``,
  ``["restitution"]`` and ``["settings"]``;
- ``place(q, v)``: put the robot somewhere;
- ``step(torque)``: simulate a step under torques of the actuators;
- ``state()``: position and velocity, two lists;
- ``forces()``: of the last step on each contact point, a list of pairs, upwards and forward;
- ``close()``: before another is made.
"""

from __future__ import annotations

import json
import math
from array import array
from time import perf_counter
from typing import Any


class Server:
    """Answers orders about one engine.

    Parameters
    ----------
    engine : type
        The class of its script.
    """

    def __init__(self, engine: Any) -> None:
        self._engine = engine
        self._made: Any = None

    def answer(self, order: bytes) -> bytes:
        """Follow an order; return a line of JSON and numbers.

        Parameters
        ----------
        order : bytes
            JSON.
        """
        asked = json.loads(order)
        head: dict[str, Any] = {}
        numbers = array("d")
        if asked["do"] == "make":
            if self._made is not None:
                self._made.close()
            self._made = self._engine(asked)
        elif asked["do"] == "place":
            self._made.place(asked["q"], asked["v"])
        elif asked["do"] == "go":
            head["seconds"] = self._go(asked["torque"], asked["steps"], numbers)
        else:
            head["contacts"] = [[up, 0.0] for up, along in self._made.forces() if up or along]
        return json.dumps(head).encode() + b"\n" + numbers.tobytes()

    def _go(self, torque: list[float], steps: int, numbers: Any) -> float:
        made, seconds = self._made, 0.0
        for _ in range(steps):
            begin = perf_counter()
            made.step(torque)
            seconds += perf_counter() - begin
            q, v = made.state()
            numbers.extend(q)
            numbers.extend(v)
            for pair in made.forces():
                numbers.extend(pair)
        return seconds


def settings_of(asked: dict[str, Any], known: dict[str, Any]) -> dict[str, Any]:
    """Return the settings that are asked for, and the defaults of the others.

    Parameters
    ----------
    asked : dict
        What is to be made.
    known : dict
        All settings, with their defaults.

    Raises
    ------
    ValueError
        If one is asked for that is not known.
    """
    given = asked["settings"]
    unknown = ", ".join(sorted(set(given) - set(known)))
    if unknown:
        raise ValueError(f"there is no setting {unknown}; there are {', '.join(known)}")
    return {**known, **given}


class Tree:
    """A floating robot as links in the plane, each a body with its place and its joint.

    The first two links, which only slide, have no mass; the third is the trunk.

    Parameters
    ----------
    told : dict
        What ``told_links`` of this package returned.

    Raises
    ------
    ValueError
        If the robot is no tree of hinges on a trunk that floats.
    """

    def __init__(self, told: dict[str, Any]) -> None:
        self.links = told["links"]
        self.actuators = told["actuators"]
        self.gravity = told["gravity"]
        self.contacts = told["contacts"]
        self.count = len(self.links)
        first = self.links[:3]
        floats = (
            not first[0]["hinge"]
            and not first[1]["hinge"]
            and first[2]["hinge"]
            and all(link["hinge"] for link in self.links[3:])
            and all(link["mass"] == 0.0 for link in first[:2])
        )
        if not floats:
            raise ValueError("this engine is given a floating trunk with hinges only")
        self.bodies = list(range(2, self.count))
        self.turns = [link["axis"][0] if link["hinge"] else 0.0 for link in self.links]

    def poses(self, q: Any) -> list[tuple[float, float, float]]:
        """Return x, z and angle about +y of each link, whose origin is its joint.

        Parameters
        ----------
        q : list of float
            Coordinates, zero in the reference position.
        """
        found: list[tuple[float, float, float]] = []
        for i, link in enumerate(self.links):
            x, z, angle = found[link["parent"]] if link["parent"] >= 0 else (0.0, 0.0, 0.0)
            c, s = math.cos(angle), math.sin(angle)
            px, pz = link["place"]
            x, z = x + c * px + s * pz, z + c * pz - s * px
            if link["hinge"]:
                angle += self.turns[i] * q[i]
            else:
                ax, az = link["axis"]
                x, z = x + q[i] * (c * ax + s * az), z + q[i] * (c * az - s * ax)
            found.append((x, z, angle))
        return found

    def motions(self, q: Any, v: Any) -> list[tuple[float, float, float]]:
        """Return velocities of the links' origins and their rates of turning.

        Parameters
        ----------
        q, v : list of float
            Coordinates and their rates.
        """
        places = self.poses(q)
        found: list[tuple[float, float, float]] = []
        for i, link in enumerate(self.links):
            parent = link["parent"]
            vx, vz, rate = found[parent] if parent >= 0 else (0.0, 0.0, 0.0)
            x, z, angle = places[parent] if parent >= 0 else (0.0, 0.0, 0.0)
            if link["hinge"]:
                dx, dz = places[i][0] - x, places[i][1] - z
                vx, vz = vx + rate * dz, vz - rate * dx
                rate += self.turns[i] * v[i]
            else:
                c, s = math.cos(angle), math.sin(angle)
                ax, az = link["axis"]
                vx, vz = vx + v[i] * (c * ax + s * az), vz + v[i] * (c * az - s * ax)
            found.append((vx, vz, rate))
        return found

    def coordinates(
        self, poses: Any, motions: Any, near: list[float]
    ) -> tuple[list[float], list[float]]:
        """Return coordinates and their rates of bodies whose poses and motions are given.

        Parameters
        ----------
        poses, motions : dict of int to (float, float, float)
            Of the origins of the bodies, as of :meth:`poses` and :meth:`motions`.
        near : list of float
            Coordinates before, from which none is half a turn away.
        """
        q, v = [0.0] * self.count, [0.0] * self.count
        x, z, _ = poses[2]
        vx, vz, _ = motions[2]
        rest = self.poses([0.0] * self.count)[2]
        ax, az = self.links[0]["axis"], self.links[1]["axis"]
        turn = ax[0] * az[1] - ax[1] * az[0]
        for into, (dx, dz) in ((q, (x - rest[0], z - rest[1])), (v, (vx, vz))):
            into[0] = (dx * az[1] - dz * az[0]) / turn
            into[1] = (ax[0] * dz - ax[1] * dx) / turn
        for i in self.bodies:
            parent = self.links[i]["parent"]
            angle, rate = poses[i][2], motions[i][2]
            if parent >= 2:
                angle, rate = angle - poses[parent][2], rate - motions[parent][2]
            value = self.turns[i] * angle
            q[i] = near[i] + math.remainder(value - near[i], 2.0 * math.pi)
            v[i] = self.turns[i] * rate
        return q, v

    def points(self, pose: Any, link: int) -> list[tuple[int, float, float]]:
        """Return index, x and z of the lowest points of the contact discs of a link.

        Parameters
        ----------
        pose : (float, float, float)
            Of its origin.
        link : int
            Which.
        """
        x, z, angle = pose
        c, s = math.cos(angle), math.sin(angle)
        return [
            (contact, x + c * px + s * pz, z + c * pz - s * px - radius)
            for contact, px, pz, radius in self.links[link]["points"]
        ]
