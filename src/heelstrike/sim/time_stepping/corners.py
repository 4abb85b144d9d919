"""The second face that a contact point touches in a concave corner of the ground.

A point has one gap and one normal, those of the nearest face. Where the ground turns upwards, it is
held by two: so there the contact problem has a second group of rows for it. What both faces push
with is recorded as one force, in the frame of the nearest face, at the place where the resultant's
line of action leaves the disc.

Convex ground has no such corners.
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel, second_contact
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Model
from heelstrike.sim.contacts.faces import move_to_line
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Surface


class Corner(Bundle):
    """How many second faces there are."""

    near: int = cell(int)
    """How many points have one now."""


@kernel
def locate_corners(
    model: Model, ground: GroundModel, tree: Workspace, first: int, contacts: Contacts,
    surface: Surface, corner: Corner,
) -> None:  # fmt: skip
    """Find the second faces of the contact points, the entries of the table from `first` on."""
    corner.near = 0
    for i in range(model.nc):
        second = first + i
        point, normal, radius = contacts.position[i], contacts.normal[i], model.contact_radius[i]
        point_position(tree, model.contact_link[i], model.contact_position[i], point)
        contacts.gap[i], friction, restitution = second_contact(
            ground, point[0], point[1], radius, normal
        )
        surface.friction[second] = model.friction_scale[i] * friction
        surface.restitution[second] = model.restitution_scale[i] * restitution
        point[0] -= radius * normal[0]
        point[1] -= radius * normal[1]
        corner.near += contacts.gap[i] < np.inf
        contacts.force[i, 0] = 0.0
        contacts.force[i, 1] = 0.0


@kernel
def join_forces(model: Model, second_faces: Contacts, contacts: Contacts) -> None:
    """Put the forces of both faces of every point into one, and that where it acts.

    About the centre of the disc only friction has a moment, r λ_t of either face. The resultant of
    forces that nearly cancel each other, as those of a wedge, may act off the disc.
    """
    for i in range(model.nc):
        other = second_faces.force[i]
        if other[0] == 0.0 and other[1] == 0.0:
            continue
        normal, force, point = contacts.normal[i], contacts.force[i], contacts.position[i]
        radius = model.contact_radius[i]
        own_x, own_z = out_of_frame(normal, (force[0], force[1]))
        x, z = out_of_frame(second_faces.normal[i], (other[0], other[1]))
        x, z = own_x + x, own_z + z
        moment = radius * (force[1] + other[1])
        move_to_line(x, z, moment, radius, normal, point)
        force[0], force[1] = into_frame(normal, (x, z))
