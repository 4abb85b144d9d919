"""Files that version 0.1.0 saved, as they are read by those that follow."""

from __future__ import annotations

import gzip
from pathlib import Path

SAVED = Path(__file__).parent / "data" / "saved_by_0.1"


def run_file(name: str, folder: Path) -> Path:
    """Unpack a saved run into a folder; return the file."""
    path = folder / f"{name}.nc"
    path.write_bytes(gzip.decompress((SAVED / f"{name}.nc.gz").read_bytes()))
    return path
