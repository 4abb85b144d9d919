"""The page of a live view: one document with its scripts and style sheet in it."""

from __future__ import annotations

from importlib.resources import files

from heelstrike.view.page.markup import document, shipped

SCRIPTS = ("course", "picture", "curves", "strip", "settings", "sharing", "live")
"""Each stands on those before it."""


def live_page() -> str:
    """Return the page; it asks for nothing but the socket of the server that it came from."""
    here = files(__package__).joinpath("browser")
    body, style, *scripts = (
        here.joinpath(name).read_text(encoding="utf-8")
        for name in ("live.html", "live.css", *(f"{script}.js" for script in SCRIPTS))
    )
    script = shipped("drawing.js") + "".join(scripts)
    return document("heelstrike", body, style=style, script=script, connect="'self'")
