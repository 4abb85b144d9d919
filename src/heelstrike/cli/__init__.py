"""The command line: it reads options, calls the library and shows what comes back."""

from __future__ import annotations

import os
import sys

INTERRUPTED = 130
"""Exit status after Ctrl-C, as a shell has it."""


def run() -> None:
    """Run the ``heelstrike`` command; Ctrl-C ends it in one line even before it has begun."""
    try:
        from heelstrike.cli.main import app

        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _leave()
        raise
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        _leave()


def _leave() -> None:
    """End the process at once: to take apart all that is loaded takes half a second."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(INTERRUPTED)
