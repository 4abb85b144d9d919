"""The page of a live view: one document with its script and style sheet in it."""

from __future__ import annotations

from importlib.resources import files

from heelstrike.view.page.markup import document, shipped


def live_page() -> str:
    """Return the page; it asks for nothing but the socket of the server that it came from."""
    here = files(__package__)
    body, style, script = (
        here.joinpath(f"live.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js")
    )
    return document(
        "heelstrike", body, style=style, script=shipped("drawing.js") + script, connect="'self'"
    )
