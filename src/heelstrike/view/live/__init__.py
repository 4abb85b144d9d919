"""A simulation live viewer while it runs: a page in the browser, and its server."""

from heelstrike.view.live.viewer import Viewer, watch

__all__ = ["Viewer", "watch"]
