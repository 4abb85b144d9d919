"""One HTML file that shows a run: animation, timeline, curves, figures, where it comes from."""

from heelstrike.view.page.page import save_html
from heelstrike.view.page.scene import scene
from heelstrike.view.page.verdict import Verdict, judge

__all__ = ["Verdict", "judge", "save_html", "scene"]
