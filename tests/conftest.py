"""Settings that hold for every test."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def _numba_cache() -> Path:
    """Directory for compiled kernels that belongs to exactly these sources.

    Numba recompiles a function when its own file changes, but not when a function that it calls
    changes in another file: a shared cache would silently test yesterday's kernels.
    """
    digest = hashlib.sha256(version("numba").encode())
    for source in sorted((ROOT / "src").rglob("*.py")):
        digest.update(str(source.relative_to(ROOT)).encode())
        digest.update(source.read_bytes())
    return ROOT / ".numba_cache" / digest.hexdigest()[:16]


# Numba and matplotlib read these when they are imported, that is after this file and before any
# test; processes that tests start inherit them.
if "NUMBA_CACHE_DIR" not in os.environ:
    cache = _numba_cache()
    cache.mkdir(parents=True, exist_ok=True)
    os.utime(cache)
    for other in cache.parent.iterdir():
        # A younger one may be in use by a test run that started before the last edit.
        if time.time() - other.stat().st_mtime > 24 * 3600.0:
            shutil.rmtree(other, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = str(cache)
os.environ["MPLBACKEND"] = "Agg"

from hypothesis import HealthCheck, settings  # noqa: E402

# The first example of a property pays for compilation, so time limits mean nothing here.
settings.register_profile(
    "local", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
# Continuous integration asks the same questions each time: a failure is the change's doing.
settings.register_profile("ci", settings.get_profile("local"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")
