"""The built site: every page opens at its top, whole and silent, with all its pictures.

``make docs`` builds it and runs these; alone: ``HEELSTRIKE_SITE=site pytest tests/test_site.py``.
"""

from __future__ import annotations

import functools
import http.server
import json
import os
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import browsers
import pytest

DOCS = Path(__file__).resolve().parent.parent / "docs"
SITE = Path(os.environ.get("HEELSTRIKE_SITE", "")).resolve()
BUILT = "HEELSTRIKE_SITE" in os.environ
WIDTHS = {390: 844, 1920: 1080}
"""Of windows in pixels, with their heights: a phone and a desk."""
SETTLED = 20.0
"""Seconds within which a page fits a window of another width."""
BETWEEN = (600, 768, 1024, 1280, 1440)

pytestmark = pytest.mark.skipif(not BUILT, reason="the site is not built: make docs")

PAGES = sorted(SITE.rglob("*.html")) if BUILT else []
NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))


def name(path: Path) -> str:
    """A page as a reader asks for it."""
    return path.relative_to(SITE).as_posix().removesuffix("index.html") or "/"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The site, served on this machine."""

    class Silent(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None:
            pass

    handler = functools.partial(Silent, directory=str(SITE))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browsers.browser() as started:
        yield started


@pytest.fixture(scope="module", params=["light", "dark"])
def scheme(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module", params=WIDTHS)
def window(request: pytest.FixtureRequest, chromium: Any, scheme: str) -> Iterator[Any]:
    """A window of a width, for readers who like it light or dark."""
    size = {"width": request.param, "height": WIDTHS[request.param]}
    context = chromium.new_context(viewport=size, color_scheme=scheme)
    yield context
    context.close()


def opened(window: Any, url: str) -> tuple[Any, list[str]]:
    """Open a page and wait for all of it, its frames too; return what it complained of."""
    page = window.new_page()
    wrong: list[str] = []
    page.on("console", lambda said: wrong.append(f"{said.type}: {said.text}"))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("requestfailed", lambda request: wrong.append(f"no {request.url}"))
    page.set_default_timeout(1000.0 * browsers.PATIENCE)
    page.goto(url)
    for frame in page.frames[1:]:
        frame.locator("html[data-ready=yes]").wait_for(state="attached")
    return page, wrong


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_a_page_opens_at_its_top_whole_and_silent(
    window: Any, scheme: str, address: str, path: Path
) -> None:
    page, wrong = opened(window, f"{address}/{path.relative_to(SITE).as_posix()}")
    try:
        assert page.evaluate("[scrollX, scrollY]") == [0, 0]
        pale = page.locator("body").evaluate(
            "each => getComputedStyle(each).backgroundColor.match(/[0-9.]+/g)[0]"
        )
        assert (float(pale) > 128.0) == (scheme == "light")
        broken = page.eval_on_selector_all(
            "img",
            """all => all.filter((each) => !(each.naturalWidth > 0 && each.width > 0)
                 || Math.abs(each.width * each.naturalHeight / each.naturalWidth - each.height) > 2
               ).map((each) => `${each.alt} ${each.width} x ${each.height}`)""",
        )
        assert not broken  # missing or out of shape
        assert not wrong
        for width in (page.viewport_size["width"], *BETWEEN):
            page.set_viewport_size({"width": width, "height": 900})
            # Parts of the theme take a moment to move to their places.
            page.wait_for_function(
                "document.documentElement.scrollWidth <= innerWidth", timeout=1e3 * SETTLED
            )
    finally:
        page.close()


def test_the_front_page_shows_the_robot_at_once(window: Any, address: str) -> None:
    page, _ = opened(window, address)
    try:
        frame = page.frame_locator("iframe")
        box = frame.locator("#plane").bounding_box()
        height = page.viewport_size["height"]
        assert box is not None
        assert box["y"] >= 0.0
        assert box["y"] + box["height"] <= height  # the picture is in sight, not its controls
        frame.locator("#play[aria-pressed=true]").wait_for()
        assert page.evaluate("scrollY") == 0
    finally:
        page.close()


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_no_page_says_what_python_calls_a_figure(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"(&lt;|<)(Figure size|Picture size|Axes:|matplotlib\.)", text)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_that_draws_has_its_picture(notebook: Path) -> None:
    page = SITE / notebook.relative_to(DOCS).with_suffix("") / "index.html"
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    drawing = sum(bool(re.search(r"plt\.show\(\)|\.plot\(\"", source)) for source in sources)
    outputs = page.read_text(encoding="utf-8").split("jp-OutputArea-output")[1:]
    assert sum("data:image/png;base64," in each for each in outputs) == drawing


@pytest.mark.parametrize(
    ("page", "text"),
    [
        ("robots", "Coordinates at which all link frames are parallel"),
        ("simulation", "Name of the body, or index of the link."),
    ],
    ids=["bundle", "dataclass"],
)
def test_the_reference_tells_what_fields_are(page: str, text: str) -> None:
    """Once, from what stands beneath them: griffe would show them apart from their class."""
    html = (SITE / "reference" / page / "index.html").read_text(encoding="utf-8")
    assert html.count(text) == 1
