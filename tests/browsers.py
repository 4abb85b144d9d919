"""A browser for the tests of pages, where there is one."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

PATIENCE = 300.0
"""Seconds that a page may take for anything, on a machine under load."""
NAMES = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str:
    """Path of a Chromium; skips the test where there is none."""
    pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")
    found = next(filter(None, map(shutil.which, (os.environ.get("CHROMIUM", ""), *NAMES))), None)
    if found is None:
        pytest.skip("there is no Chromium: apt install chromium, or set CHROMIUM to its path")
    return found


@contextmanager
def browser() -> Iterator[Any]:
    """A headless browser that draws without a graphics card, and reaches this machine only."""
    path = chromium()
    from playwright.sync_api import Error, sync_playwright

    nowhere = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost"
    # Root, as which continuous integration runs, may use Chromium without its sandbox only.
    root = hasattr(os, "getuid") and os.getuid() == 0
    options = [nowhere, "--disable-gpu", *(["--no-sandbox"] if root else [])]
    with sync_playwright() as driver:
        try:
            started = driver.chromium.launch(executable_path=path, args=options)
        except Error as error:
            if os.environ.get("CI"):
                raise
            pytest.skip(f"{path} does not start here: {str(error).splitlines()[0]}")
        try:
            yield started
        finally:
            started.close()


def wait_until(holds: Callable[[], Any], what: str) -> None:
    """Wait until something holds; fail with what was waited for."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.02)
