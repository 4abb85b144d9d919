"""The folder of the user's own where things are kept that can be made again."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder() -> Path:
    """Return the folder, which need not exist: the one that the operating system has for caches."""
    if sys.platform == "win32":
        named, usual = "LOCALAPPDATA", "~/AppData/Local"
    elif sys.platform == "darwin":
        named, usual = "", "~/Library/Caches"
    else:
        named, usual = "XDG_CACHE_HOME", "~/.cache"
    return Path(os.environ.get(named) or os.path.expanduser(usual)) / "heelstrike"  # noqa: PTH111, needs no home
