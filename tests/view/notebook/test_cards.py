"""What notebooks show: whole markup without scripts, names as text, pictures that are there."""

from __future__ import annotations

import base64
import dataclasses
import html
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import walking
from synthetic_runs import box, make_run, pendulum

import heelstrike as hs

HOSTILE = "</td><script>alert(1)</script><img src=x onerror=alert(1)>\"'&"


def cycle(*multipliers: complex) -> hs.LimitCycle:
    return hs.LimitCycle(
        state=hs.State([0.0], [0.0]), period=0.7, step_length=0.3,
        multipliers=np.array(multipliers, dtype=complex), residual=1e-12, iterations=3,
    )  # fmt: skip


def walk() -> hs.Run:
    return walking.walk(steps=1)


# One of each kind that notebooks show, made when it is looked at.
SHOWN: dict[str, Callable[[], Any]] = {
    "robot": walking.bravo7,
    "fixed robot": pendulum,
    "block": box,
    "gait": walking.gait,
    "run": walk,
    "run without rows": lambda: make_run(box(), []),
    "summary": lambda: walk().summary(gait=walking.gait()),
    "flat ground": hs.Ground,
    "slope": lambda: hs.Ground(slope=0.1),
    "rough ground": lambda: hs.Ground.rough(amplitude=0.02, spacing=0.1, length=50.0, seed=3),
    "stable cycle": lambda: cycle(0.5 + 0.3j, 0.5 - 0.3j, -0.1),
    "unstable cycle": lambda: cycle(7.8),
}


class Markup(HTMLParser):
    """Collects elements; fails where one is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("name", SHOWN)
def test_markup_is_whole_and_harmless(name: str) -> None:
    text = SHOWN[name]()._repr_html_()
    markup = Markup(text)
    allowed = {"div", "p", "b", "table", "caption", "tbody", "tr", "th", "td", "img"}
    assert {tag for tag, _ in markup.tags} <= allowed
    for tag, attributes in markup.tags:
        assert not any(key.startswith("on") for key in attributes)
        if tag == "img":
            assert attributes["alt"]
            head, _, data = (attributes["src"] or "").partition(",")
            assert head == "data:image/svg+xml;base64"
            drawing = ElementTree.fromstring(base64.b64decode(data))
            assert len(list(drawing.iter())) > 2  # more than an empty sheet
            numbers = re.findall(r"nan|inf", base64.b64decode(data).decode())
            assert not numbers
    assert len(text) < 60_000


def test_names_are_text() -> None:
    robot = dataclasses.replace(
        box(), name=HOSTILE, joint_names=(HOSTILE, "b", "c"), contact_names=(HOSTILE, "e")
    )
    run = make_run(robot, [0.0, 0.1], message=HOSTILE)
    gait = dataclasses.replace(
        walking.gait(), robot=HOSTILE, joint_names=(HOSTILE, *walking.gait().joint_names[1:])
    )
    for each in (robot, run, run.summary(), gait, run.show()):
        text = each._repr_html_()
        Markup(text)
        assert "<script>alert" not in text
        assert "<img src=x" not in text


def test_the_unstable_multiplier_lies_outside_the_circle() -> None:
    def circles(of: hs.LimitCycle) -> list[tuple[float, float]]:
        data = re.search(r"base64,([^\"]+)", of._repr_html_())
        assert data is not None
        drawing = ElementTree.fromstring(base64.b64decode(data[1]))
        found = [each for each in drawing.iter() if each.tag.endswith("circle")]
        return [(float(each.attrib["cx"]), float(each.attrib["r"])) for each in found]

    (middle, radius), (place, _) = circles(cycle(7.8))
    assert place - middle == pytest.approx(7.8 * radius, rel=1e-2)


def test_a_ground_that_is_nearly_flat_is_drawn_higher_and_says_so() -> None:
    """Heights of ±1 m over 100 m: drawn as a tenth of the length, five times as large."""
    wavy = hs.Ground(profile=[[0.0, 0.0], [25.0, 1.0], [75.0, -1.0], [100.0, 0.0]])
    assert "drawn 5 times as large" in wavy._repr_html_()
    assert "times as large" not in hs.Ground(slope=0.5)._repr_html_()


def test_a_run_is_shown_as_its_page() -> None:
    film = walking.walk(steps=1).show(height=500)
    text = film._repr_html_()
    (tag, attributes), *others = Markup(text).tags
    assert tag == "iframe"
    assert not others
    assert attributes["sandbox"] == "allow-scripts"
    assert html.unescape(attributes["srcdoc"] or "").startswith("<!DOCTYPE html>")
    assert "height:500px" in (attributes["style"] or "")
    assert len(repr(film)) < 100  # in a terminal


def test_a_run_without_rows_cannot_be_shown() -> None:
    with pytest.raises(hs.ViewError, match="no rows"):
        make_run(box(), []).show()
