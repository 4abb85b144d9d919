"""What answers in the process of an engine: the other half of :mod:`.served`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from heelstrike.experiments.engines.packages import simulators
from heelstrike.experiments.engines.peer import Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot import Robot, State
from heelstrike.robot.files.robot_json import robot_of_entries

_made: list[Peer] = []
"""The peer of this process, when it has been made."""


def answer(order: bytes) -> bytes:
    """Follow an order about an engine.

    Parameters
    ----------
    order : bytes
        JSON: ``make`` with what is simulated, ``place`` with a state, ``go`` with torques and a
        number of steps, or ``contacts``.

    Returns
    -------
    bytes
        A line of JSON, and the rows of what was simulated.
    """
    asked = json.loads(order)
    does: dict[str, Any] = {"make": _make, "place": _place, "go": _go, "contacts": _contacts}
    head, rows = does[asked["do"]](asked)
    return json.dumps(head).encode() + b"\n" + rows.tobytes()


NOTHING = np.zeros(0)


def _make(asked: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    robot = robot_of_entries(asked["robot"])
    assert isinstance(robot, Robot)  # engines walk in the plane
    state = State(robot.model.reference, np.zeros(robot.nv))
    scenario = Scenario(
        "served", robot, state, asked["step"], friction=asked["friction"],
        restitution=asked["restitution"],
    )  # fmt: skip
    engine = simulators([asked["engine"]])[asked["engine"]]
    peer = engine.peer(scenario, asked["step"], **asked["settings"])
    _made[:] = [peer]
    return {
        "tells_friction": peer.tells_friction,
        "tells_means": peer.tells_means,
        "float32": peer.float32,
        "settling": peer.settling,
        "lacks": list(peer.lacks),
    }, NOTHING


def _place(asked: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    peer = _made[0]
    peer.done = 0
    reference = peer.scenario.robot.model.reference
    peer.place(np.array(asked["q"]) + reference - peer.zero, np.array(asked["v"]))
    return {}, NOTHING


def _go(asked: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    peer = _made[0]
    if peer.scenario.robot.nu:
        peer.hold(np.array(asked["torque"]))
    before = peer.seconds
    rows = peer.record(asked["steps"])
    rows[:, : peer.scenario.robot.nq] -= peer.scenario.robot.model.reference
    return {"seconds": peer.seconds - before}, rows


def _contacts(_: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    return {"contacts": [[float(f), float(d)] for f, d in _made[0].contacts()]}, NOTHING
