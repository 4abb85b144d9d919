"""Where the energy of a run comes from and goes to."""

from __future__ import annotations

from matplotlib.figure import Figure

from heelstrike.analysis.energy import energy_balance
from heelstrike.view.panels import Curve, Excerpt, Panel, draw_panels
from heelstrike.view.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILION

CHANGES = {
    "kinetic": ("kinetic", BLUE),
    "potential": ("potential", ORANGE),
    "total": ("mechanical energy", INK),
}
WORKS = {
    "actuators": ("actuators", GREEN),
    "contacts": ("ground", VERMILION),
    "dampers": ("dampers", PURPLE),
    "stops": ("joint stops", SKY),
    "dry_friction": ("dry friction", ORANGE),
    "brakes": ("brakes", GREY),
    "pushes": ("pushes", BLUE),
    "residual": ("residual", INK),
}
"""Label and colour of each part of the balance, those over which others are drawn first."""
ALWAYS = ("contacts", "residual")


def draw_energy(excerpt: Excerpt) -> Figure:
    """Mechanical energy, the work that changed it, and what no work explains."""
    balance = energy_balance(excerpt.run)
    changes = [
        Curve(getattr(balance, name) - getattr(balance, name)[0], label, {"color": color})
        for name, (label, color) in CHANGES.items()
    ]
    works = [
        Curve(getattr(balance, name), label, {"color": color})
        for name, (label, color) in WORKS.items()
        if name in ALWAYS or getattr(balance, name).any()
    ]
    panels = [
        Panel("energy (J)", changes, "change since the start"),
        Panel("energy (J)", works, "work since the start"),
    ]
    return draw_panels(excerpt, "energy", panels, height=5.6)
