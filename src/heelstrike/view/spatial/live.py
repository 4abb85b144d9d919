"""A live view of robots in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.errors import SimulationError
from heelstrike.robot.spatial.model import HINGE, SLIDE
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.push import Push, pushes_on
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import RECORDED, SpatialEvent, SpatialRun
from heelstrike.sim.spatial.simulation import SpatialSimulation
from heelstrike.sim.spatial.space import SPACE
from heelstrike.view.live.dimension import LiveDimension
from heelstrike.view.live.light import certified_light
from heelstrike.view.live.plane import SEEN_TO_STAND
from heelstrike.view.page.events import contact_of
from heelstrike.view.spatial.forces import force_groups
from heelstrike.view.spatial.live_frames import SpatialLayout
from heelstrike.view.spatial.scene import scene_in_space

MOST_LIFTS, ON_GROUND = 40, 1e-10
"""How often a robot is lifted or lowered, and the gap (m) with which it is on the ground."""
LEAST_UP = 0.1
"""Vertical part of the normal of a face with which a robot that is in a wall is lifted."""


class Space(LiveDimension):
    """Robots in space."""

    name = "space"
    kinds = tuple(kind.name.lower() for kind in SpatialEventKind)
    quantities = tuple(RECORDED)

    def layout(self, robot: SpatialRobot) -> SpatialLayout:
        """Lay the frames of a robot out."""
        return SpatialLayout(robot)

    def scene(self, robot: SpatialRobot, ground: SpatialGround) -> dict[str, Any]:
        """Describe a robot and its ground for ``space.js``."""
        return scene_in_space(robot, ground)

    def check(self, push: Push, robot: SpatialRobot) -> None:
        """Refuse a push that cannot act on a robot."""
        pushes_on(robot, (push,))

    def somewhere(self, draw: np.random.Generator) -> tuple[float, ...]:
        """Draw a direction along level ground."""
        turn = draw.uniform(0.0, 2.0 * np.pi)
        return float(np.cos(turn)), float(np.sin(turn)), 0.0

    def moved(self, simulation: SpatialSimulation, joint: str, position: float) -> State:
        """Return the state with a hinge or slide elsewhere."""
        robot = simulation.robot
        moved = robot.joint_index(joint)
        if robot.model.joint_kind[moved] not in (HINGE, SLIDE):
            raise SimulationError(f"joint {joint!r} is no hinge or slide: it has no slider")
        now = simulation.state
        q = now.q.copy()
        q[robot.model.first_position[moved]] = np.clip(
            position, robot.model.lower[moved], robot.model.upper[moved]
        )
        state, ground = State(q, now.v), simulation.ground
        if robot.floating and robot.nc:
            gap, _ = SPACE.gaps(robot, state, ground)
            if stands(simulation) or gap.min() < 0.0:
                _onto_ground(robot, state, ground)
        return state

    def light(self, run: SpatialRun) -> dict[str, str]:
        """Return the light of a run."""
        solver = run.solver
        return certified_light(
            solves=solver.solves, fallbacks=solver.fallbacks, failures=solver.failures,
            residual=run.certificates.residual, failed=run.status is RunStatus.SOLVER_FAILED,
        )  # fmt: skip

    def shown_at(self, event: SpatialEvent, robot: SpatialRobot) -> int:
        """Index of the force that is drawn of the contact point of an event, -1 for none."""
        contact = contact_of(event)
        return next((g for g, group in enumerate(force_groups(robot)) if contact in group), -1)


def stands(simulation: SpatialSimulation) -> bool:
    """Whether a robot stands on the ground now."""
    return float(np.min(simulation.contacts.gap, initial=np.inf)) < SEEN_TO_STAND


def _onto_ground(robot: SpatialRobot, state: State, ground: SpatialGround) -> None:
    """Lift a robot out of the ground, or lower it until it meets it, boxes too."""
    for _ in range(MOST_LIFTS):
        gap, up = SPACE.gaps(robot, state, ground)
        lowest = int(np.argmin(gap))
        if abs(gap[lowest]) < ON_GROUND:
            return
        # Down by no more than the gap: nothing is nearer than that. Out of a face at once.
        along = max(float(up[lowest]), LEAST_UP) if gap[lowest] < 0.0 else 1.0
        state.q[2] -= gap[lowest] / along


LIVE_SPACE = Space()
