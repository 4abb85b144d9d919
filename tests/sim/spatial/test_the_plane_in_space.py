"""bravo7 from its own file in space, its lateral motion locked, walks the paper's walk."""

from __future__ import annotations

import numpy as np
import walking

import heelstrike as hs
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.spatial.record import SpatialEventKind


class PlanarLaw:
    """Computed torque of the plane, shown the plane's view of contact in space.

    Corners of a foot at the same x become one point, which bears what all of them bear.
    """

    def __init__(self, flat: hs.Robot, space: hs.SpatialRobot, gait: hs.Gait) -> None:
        self.flat = flat
        self.law = hs.ComputedTorque(flat, gait)
        model, own = space.model, flat.model
        self.owner = [
            next(
                point
                for point in range(flat.nc)
                if own.contact_link[point] == link
                and abs(own.contact_position[point, 0] - place[0]) < 1e-9
            )
            for link, place in zip(model.contact_link, model.contact_position, strict=True)
        ]

    def torque(self, t: float, state: hs.State, contacts: Contacts) -> np.ndarray:
        at = contact_kinematics(self.flat, state.q, state.v, hs.Ground())
        force = np.zeros((self.flat.nc, 2))
        for corner, point in enumerate(self.owner):
            force[point] += contacts.force[corner, :2]
        seen = Contacts(
            position=at.position.copy(), normal=at.normal.copy(), gap=at.gap.copy(), force=force
        )
        return self.law.torque(t, state, seen)


def test_bravo7_in_space_walks_as_in_the_plane() -> None:
    """Equal to 1e-9 before the first impact, which is at 0.7 s, and it walks on after it."""
    flat, gait = walking.bravo7(), walking.gait()
    space = hs.load_robot("bravo7", dimension=3)
    assert isinstance(space, hs.SpatialRobot)
    state = gait.initial_state
    method = hs.TimeStepping(step=1e-3)
    duration = 3 * walking.STEP_DURATION
    planar = hs.simulate(
        flat, hs.ComputedTorque(flat, gait), state=state, duration=duration, method=method
    )
    run = hs.simulate(
        space, PlanarLaw(flat, space, gait), state=state, duration=duration, method=method
    )
    assert run.completed
    before = planar.time < walking.STEP_DURATION - 1.5e-3
    assert np.max(np.abs(run.position - planar.position)[before]) <= 1e-9
    assert np.max(np.abs(run.velocity - planar.velocity)[before]) <= 1e-8
    down = {e.time for e in run.events if e.kind is SpatialEventKind.TOUCHDOWN}
    flat_down = {e.time for e in planar.events if e.kind is EventKind.TOUCHDOWN}
    assert np.allclose(sorted(down), sorted(flat_down), atol=2e-3)
    assert run.certificates.uncertified == 0
