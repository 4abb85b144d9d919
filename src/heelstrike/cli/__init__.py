"""The command line: it reads options, calls the library and shows what comes back."""

from __future__ import annotations

import sys


def run() -> None:
    """Run the ``heelstrike`` command; Ctrl-C ends it in one line even before it has begun."""
    try:
        from heelstrike.cli.main import app

        app()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
