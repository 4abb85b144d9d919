"""The page of a live view: one document with its scripts and style sheet in it."""

from __future__ import annotations

from importlib.resources import files

from heelstrike.view.page.markup import document

PICTURES = {
    "plane": ("live/browser/picture.js",),
    "space": ("spatial/space.js", "spatial/picture.js"),
}
"""What draws the robots of a dimension, and hears the mouse."""
BEFORE = ("page/drawing.js", "live/browser/course.js")
AFTER = ("curves", "strip", "settings", "sharing", "live")
"""BEFORE, AFTER: Scripts that pictures stand on, and those that follow; each stands on those before
it."""


def live_page(dimension: str = "plane") -> str:
    """Return the page; it asks for nothing but the socket of the server that it came from.

    Parameters
    ----------
    dimension : str
        Of the robots that it shows, as `PICTURES` calls it.

    Returns
    -------
    str
        The document.
    """
    room = files("heelstrike.view")
    names = (*BEFORE, *PICTURES[dimension], *(f"live/browser/{name}.js" for name in AFTER))
    body, style, *scripts = (
        room.joinpath(name).read_text(encoding="utf-8")
        for name in ("live/browser/live.html", "live/browser/live.css", *names)
    )
    return document("heelstrike", body, style=style, script="".join(scripts), connect="'self'")
