"""Whether another Python has a module. It imports nothing of this package."""

from __future__ import annotations

import importlib
import subprocess
from contextlib import suppress
from importlib import metadata
from importlib.util import find_spec

SLOW = {"genesis": "genesis-world"}
"""Modules that take ten seconds or more to be imported, and the distributions they come in. They
are only looked up."""

DEBIAN = {"ode": "python3-pyode", "siconos": "python3-siconos"}
"""Modules that do not know their version, and the packages of Debian they come in."""


def version(order: bytes) -> bytes:
    """Return the version of a module that can be imported; nothing if it cannot.

    Parameters
    ----------
    order : bytes
        Name of the module.
    """
    name = order.decode()
    if name in SLOW:
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(SLOW[name]).encode() if find_spec(name) else b""
        return b""
    try:
        module = importlib.import_module(name)
    except ImportError:
        return b""
    found = getattr(module, "__version__", None)
    if name in DEBIAN:
        asked = ["dpkg-query", "-W", "-f", "${Version}", DEBIAN[name]]
        with suppress(OSError, subprocess.CalledProcessError):  # it is not Debian's
            found = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    return str(found or "unknown version").encode()
