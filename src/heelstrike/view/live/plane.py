"""A live view of robots in the plane."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.push import Push
from heelstrike.sim.run import QUANTITIES, Event, Run
from heelstrike.sim.simulation import Simulation
from heelstrike.view.live.dimension import LiveDimension
from heelstrike.view.live.frames import Layout
from heelstrike.view.live.light import light_of
from heelstrike.view.page.events import contact_of
from heelstrike.view.page.scene import scene

SEEN_TO_STAND = 1e-3
"""Metres above the ground up to which a robot stands on it."""


class Plane(LiveDimension):
    """Robots in the plane."""

    name = "plane"
    kinds = tuple(kind.name.lower() for kind in EventKind)
    quantities = tuple(QUANTITIES)

    def layout(self, robot: Robot) -> Layout:
        """Lay the frames of a robot out."""
        return Layout(robot)

    def scene(self, robot: Robot, ground: Ground) -> dict[str, Any]:
        """Describe a robot and its ground for ``drawing.js``."""
        return scene(robot, ground)

    def check(self, push: Push, robot: Robot) -> None:
        """Refuse a push that cannot act on a robot."""
        push.place(robot)

    def somewhere(self, draw: np.random.Generator) -> tuple[float, ...]:
        """Draw a direction forwards or backwards, a little up or down."""
        turn = draw.choice([0.0, np.pi]) + draw.uniform(-0.5, 0.5)
        return float(np.cos(turn)), float(np.sin(turn))

    def moved(self, simulation: Simulation, joint: str, position: float) -> State:
        """Return the state with a joint elsewhere; loops are closed again."""
        robot = simulation.robot
        moved = robot.joint_index(joint)
        now = simulation.state
        q = now.q.copy()
        q[moved] = np.clip(position, robot.model.lower[moved], robot.model.upper[moved])
        state = robot.closed(State(q, now.v), keep=[moved])
        if robot.nc:
            stood = float(simulation.contacts.gap.min()) < SEEN_TO_STAND
            gap = contact_kinematics(robot, state.q, state.v, simulation.ground).gap
            if stood or gap.min() < 0.0:
                with suppress(RobotError):  # nothing lifts it
                    state = robot.placed(state, simulation.ground)
        return state

    def light(self, run: Run) -> dict[str, str]:
        """Return the light of a run."""
        return light_of(run)

    def shown_at(self, event: Event, robot: Robot) -> int:  # noqa: ARG002 - each point is drawn
        """Index of the contact point at which an event happened."""
        return contact_of(event)


LIVE_PLANE = Plane()
