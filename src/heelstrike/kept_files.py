"""Results that follow from what is asked alone, on disk: who asks the same gets the same.

A result is kept under a digest of all that it follows from: what is asked, and the text of the
program that answers.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from heelstrike.cache_folder import cache_folder

MOST = 1000
"""Files of a kind that are kept; the older half goes when there are more."""


def kept_file(kind: str, digest: str) -> Path | None:
    """Return where a result is kept, None if none of its kind is.

    The environment variable ``HEELSTRIKE_KEEP_KIND`` tells: 0 keeps none, a folder keeps them
    there, 1 is as usual.

    Parameters
    ----------
    kind : str
        Kind of result, in the plural: the name of the folder.
    digest : str
        What the result follows from.
    """
    named = os.environ.get(f"HEELSTRIKE_KEEP_{kind.upper()}", "")
    if named == "0":
        return None
    folder = cache_folder() / kind if named in ("", "1") else Path(named)
    return folder / f"{digest}.json"


def make_room(file: Path) -> None:
    """Make the folder of a file that is to be kept, and room in it.

    Raises
    ------
    OSError
        If that cannot be.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    files = sorted(file.parent.glob("*.json"), key=lambda each: each.stat().st_mtime)
    if len(files) >= MOST:
        for each in files[: MOST // 2]:
            each.unlink(missing_ok=True)


@cache
def program_digest(rooms: Sequence[str], package: str) -> bytes:
    """Digest of a program: the text of parts of heelstrike, and what works for them.

    Parameters
    ----------
    rooms : tuple of str
        Names of packages, and of modules beside them.
    package : str
        Package from elsewhere, which is not imported for it: that takes longer than the rest.
    """
    try:
        other = version(package)
    except PackageNotFoundError:  # installed without a word about itself
        other = "of unknown version"
    digest = hashlib.sha256(f"{other} {np.__version__}".encode())
    for room in rooms:
        place = Path(__file__).parent / room
        for file in sorted(place.rglob("*.py")) or [place.with_suffix(".py")]:
            digest.update(file.read_bytes())
    return digest.digest()
