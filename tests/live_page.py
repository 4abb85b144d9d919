"""A page of the live view in a browser, as tests see it."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from browsers import wait_until
from PIL import Image

from heelstrike.view.live.viewer import Viewer

# 8-bit red, green, blue of what is drawn.
RIGHT_LEG, LEFT_LEG, TRUNK = (0, 114, 178), (213, 94, 0), (34, 34, 34)
FORCE, CENTER, PRESSURE, PUSH = (0, 120, 90), (230, 159, 0), (169, 68, 127), (176, 0, 32)


class Page:
    """A page in the browser, and all that went wrong on it."""

    def __init__(
        self, chromium: Any, viewer: Viewer, *, first: bool = True, **options: Any
    ) -> None:
        size = {"width": 1280, "height": 800}
        self.page = chromium.new_page(**({"viewport": size} | options))
        self.wrong: list[str] = []
        self.asked: set[str] = set()
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.add(request.url))
        self.page.goto(viewer.url)
        if first:
            wait_until(lambda: self.time > 0.0, "the first picture")

    def _heard(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.wrong.append(message.text)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        self.page.close()
        if kind is None:
            assert self.wrong == []

    def data(self, name: str) -> float:
        told = self.page.evaluate(f"document.getElementById('plane').dataset.{name} || 0")
        return float(told)

    @property
    def time(self) -> float:
        return self.data("time")

    def text(self, name: str) -> str:
        return str(self.page.locator(f"#{name}").inner_text())

    def picture(self) -> np.ndarray:
        """What is drawn, without the words that lie upon it."""
        return pixels(self.page.locator("#plane"))

    def where(self, color: tuple[int, int, int]) -> np.ndarray:
        """Rows and columns of the pixels of a colour, (n, 2)."""
        return np.argwhere(np.abs(self.picture() - color).max(axis=-1) < 16)

    def halt(self) -> float:
        """Pause; return the time at which it stands."""
        self.page.click("#play")
        wait_until(lambda: "play" in self.text("play"), "the pause")
        return self.settled()

    def settled(self) -> float:
        """Wait until the picture shows the same time twice."""
        seen = [self.time]

        def stands() -> bool:
            self.page.wait_for_timeout(60)
            seen.append(self.time)
            return seen[-1] == seen[-2]

        wait_until(stands, "a picture that stands still")
        return seen[-1]


def pixels(canvas: Any) -> np.ndarray:
    """Red, green and blue of a canvas, (height, width, 3)."""
    told = canvas.evaluate("(canvas) => canvas.toDataURL()")
    with Image.open(io.BytesIO(base64.b64decode(told.partition(",")[2]))) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)
