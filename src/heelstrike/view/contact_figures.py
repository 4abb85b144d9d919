"""What happens between feet and ground (paper Figures 5 and 6)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from heelstrike.analysis.friction import friction_coefficient, friction_use
from heelstrike.analysis.support import foot_sums, pushing_feet
from heelstrike.analysis.zero_moment_point import zero_moment_point, zero_moment_point_limits
from heelstrike.errors import ViewError
from heelstrike.robot.named_tree import Foot
from heelstrike.sim.run import Run
from heelstrike.view.panels import (
    NOTE,
    Curve,
    Excerpt,
    Panel,
    draw_panels,
)
from heelstrike.view.style import BOUND, INK, foot_color, in_words

ROOM_ABOUT_POINTS = 0.05
"""Half the span of the axis of a zero moment point under point feet, in m."""

STROKES = ("solid", (0, (4, 2)), (0, (1, 1.5)), (0, (5, 1, 1, 1)))


def draw_zero_moment_point(excerpt: Excerpt) -> Figure:
    """Zero moment point of each foot within its sole (paper Figure 5), thin in double support."""
    run = excerpt.run
    feet = _feet(run)
    zmp = zero_moment_point(run)
    alone = np.where(zmp.single_support[:, None], zmp.foot, np.nan)
    look = [{"color": foot_color(i), "linewidth": 1.4} for i in range(len(feet))]
    curves = [
        Curve(own, look=look[i] | {"linewidth": 0.9, "linestyle": STROKES[i % len(STROKES)]})
        for i, own in enumerate(zmp.foot.T)
    ]
    curves += [Curve(alone[:, i], in_words(foot.name), look[i]) for i, foot in enumerate(feet)]
    heel, toe = zero_moment_point_limits(run.robot)
    points = not toe > heel
    room = ROOM_ABOUT_POINTS if points else 0.15 * (toe - heel)
    panel = Panel(
        "ahead of the ankle (m)",
        curves,
        remark="the feet are points: it can only be there" if points else "",
        bounds={"heel and toe": (heel, toe)},
        span=(heel - room, toe + room),
    )
    title = "zero moment point of the stance foot, thin in double support"
    return draw_panels(excerpt, title, [panel], height=3.8)


def draw_friction(excerpt: Excerpt) -> Figure:
    """Tangential force of each foot within the friction cone (paper Figure 6)."""
    run = excerpt.run
    feet, pushes = _feet(run), pushing_feet(run)
    allowed = friction_coefficient(run) * run.contact_force[..., 0]
    cones = np.where(pushes, foot_sums(run, allowed), np.nan).T
    forces = np.where(pushes, foot_sums(run, run.contact_force[..., 1]), np.nan).T
    panels = []
    for i, (foot, cone) in enumerate(zip(feet, cones, strict=True)):
        curves = [
            Curve(cone, "cone ±μFₙ", BOUND),
            Curve(-cone, look=BOUND),
            Curve(forces[i], "Fₜ", {"color": foot_color(i)}),
        ]
        panels.append(Panel("force (N)", curves, in_words(foot.name), cone=cone, impacts=False))
    return draw_panels(
        excerpt,
        "tangential force of the ground on the feet",
        panels,
        height=0.9 + 2.3 * len(panels),
        note=lambda cut: _cone_note(excerpt, cut),
    )


def _cone_note(excerpt: Excerpt, cut: bool) -> str:
    """Say how much of the cone is used at most, impacts included."""
    used = friction_use(excerpt.run).foot[excerpt.rows]
    used = used[np.isfinite(used)]
    if not used.size:
        return NOTE if cut else ""
    bound = np.ceil(100.0 * float(used.max()) - 1e-9) / 100.0
    kept = f", {NOTE} but not the cone" if cut and bound <= 1.0 else ""
    return f"|Fₜ| ≤ {bound:.2f} μFₙ{kept}"


def draw_forces(excerpt: Excerpt) -> Figure:
    """Normal and tangential force on each foot."""
    run = excerpt.run
    feet = _feet(run)
    force = foot_sums(run, run.contact_force)
    normal, tangential = (
        [
            Curve(force[:, i, k], in_words(foot.name), {"color": foot_color(i)})
            for i, foot in enumerate(feet)
        ]
        for k in range(2)
    )
    weight = {"weight of the robot": [run.robot.weight]}
    panels = [
        Panel("force (N)", normal, "normal", bounds=weight, impacts=False, height=1.5),
        Panel("force (N)", tangential, "tangential, positive forward", impacts=False),
    ]
    title = "force of the ground on the feet"
    return draw_panels(excerpt, title, panels, height=5.4, legends=False)


def draw_gaps(excerpt: Excerpt) -> Figure:
    """Heights of the contact points above the ground."""
    run = excerpt.run
    panels = []
    for i, foot in enumerate(_feet(run)):
        curves = [
            Curve(
                run.gap[:, contact],
                _within_foot(run.robot.contact_names[contact], foot.name),
                {"color": INK if k else foot_color(i), "linestyle": STROKES[k % len(STROKES)]},
            )
            for k, contact in enumerate(foot.contacts)
        ]
        panels.append(Panel("height (m)", curves, in_words(foot.name)))
    title = "height of the contact points above the ground"
    return draw_panels(excerpt, title, panels, height=0.9 + 2.3 * len(panels))


def _within_foot(contact: str, foot: str) -> str:
    """What a contact point of a foot is called beside the others of it."""
    own = in_words(contact.removeprefix(f"{foot}_"))
    return f"point {own}" if own.isdigit() else own


def _feet(run: Run) -> tuple[Foot, ...]:
    if not run.robot.feet:
        raise ViewError(f"robot {run.robot.name!r} has no feet: there is nothing to show")
    return run.robot.feet
