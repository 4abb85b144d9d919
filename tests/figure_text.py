"""What a reader reads on a figure: no leftovers of formulas, nothing cut off or overprinted."""

from __future__ import annotations

import re
from itertools import combinations

from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

LEFTOVERS = re.compile(r"\\|mathdefault|\$|\b(nan|inf|none|nolegend)\b|_", re.IGNORECASE)
HAIR = 1.0
"""Pixels by which two words may reach into each other: boxes hold the room of letters like g."""


def check_text(figure: Figure, *, names: bool = False) -> list[str]:
    """Assert that all words of a figure can be read; return them.

    Parameters
    ----------
    figure : Figure
        The figure.
    names : bool
        Whether names from files may be among the words, as they are written there.
    """
    figure.canvas.draw()
    words = _words(figure)
    assert words
    for text in words:
        said = text.get_text()
        if not names:
            assert not LEFTOVERS.search(said), said
    page = figure.bbox.padded(HAIR)
    boxes = [(text.get_text(), text.get_window_extent()) for text in words]
    for said, box in boxes:
        assert page.x0 <= box.x0 <= box.x1 <= page.x1, f"{said!r} leaves the page"
        assert page.y0 <= box.y0 <= box.y1 <= page.y1, f"{said!r} leaves the page"
    for (said, box), (other, over) in combinations(boxes, 2):
        assert not _overlap(box, over), f"{said!r} and {other!r} lie upon each other"
    for axes in figure.axes:
        if axes.axison and axes.get_visible():
            named = any(re.search("[a-z]{3}", text.get_text()) for text in _tick_labels(axes.yaxis))
            told = axes.get_ylabel() or axes.get_title(loc="left") or named
            assert told, "an axis without a label"
            for axis in (axes.xaxis, axes.yaxis):
                ticks = [text.get_text() for text in _tick_labels(axis)]
                assert all(ticks) or not any(ticks), ticks
    return [text.get_text() for text in words]


def _words(figure: Figure) -> list[Text]:
    """Texts that are drawn: ticks out of view are not."""
    axes = [each for each in figure.axes if each.get_visible()]
    hidden = [each for each in figure.axes if not each.get_visible()]
    axes_of_ticks = [axis for each in figure.axes for axis in (each.xaxis, each.yaxis)]
    of_ticks = {id(text) for axis in axes_of_ticks for text in axis.findobj(Text)}
    of_hidden = {id(text) for each in hidden for text in each.findobj(Text)}
    shown = [
        text
        for text in figure.findobj(Text)
        if id(text) not in of_ticks | of_hidden and text.get_visible() and text.get_text()
    ]
    for each in axes:
        if each.axison:
            for axis in (each.xaxis, each.yaxis):
                shown += _tick_labels(axis)
                shown += [text for text in (axis.label, axis.offsetText) if text.get_text()]
    return shown


def _tick_labels(axis: Axis) -> list[Text]:
    """Labels of the major ticks in view, and those of minor ones that have any."""
    low, high = sorted(axis.get_view_interval())
    room = 1e-9 * (high - low)
    shown = []
    for tick in axis.get_major_ticks() + axis.get_minor_ticks():
        for text in (tick.label1, tick.label2):
            inside = low - room <= tick.get_loc() <= high + room
            wanted = text.get_text() or tick in axis.get_major_ticks()
            if inside and text.get_visible() and wanted and tick.get_visible():
                shown.append(text)
    return shown


def _overlap(a: Bbox, b: Bbox) -> bool:
    wide = min(a.x1, b.x1) - max(a.x0, b.x0)
    high = min(a.y1, b.y1) - max(a.y0, b.y0)
    return wide > HAIR and high > HAIR
