"""One HTML file that shows a run: animation, timeline, curves, figures, where it comes from."""

from heelstrike.view.page.page import save_html
from heelstrike.view.page.scene import scene

__all__ = ["save_html", "scene"]
