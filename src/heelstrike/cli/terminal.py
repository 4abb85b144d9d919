"""What a person sees: stages of work on a terminal, warnings and errors in words.

Everything here goes to standard error, so that standard output holds results only. Away from a
terminal (in a pipe, in a log file) stages say nothing and nothing is coloured.
"""

from __future__ import annotations

import functools
import io
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, ParamSpec, TypeVar

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TimeElapsedColumn,
)
from rich.text import Text

from heelstrike.errors import HeelstrikeError

FAILED = 1
"""Exit status when the work was done but did not come out well: the robot fell, say."""

WRONG_INPUT = 2
"""Exit status when the request could not be carried out as it was made."""

Debug = Annotated[
    bool, typer.Option("--debug", help="Show where in the program an error arose.", hidden=True)
]

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def output() -> Console:
    """Console for results, on standard output."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A pipe may have an encoding without ∫ or −: a question mark is better than no result.
        sys.stdout.reconfigure(errors="replace")
    return Console(highlight=False)


def messages() -> Console:
    """Console for everything else, on standard error."""
    return Console(stderr=True, highlight=False)


def tell(message: str) -> None:
    """Print something worth knowing that is not a result."""
    messages().print(Text(message), soft_wrap=True)


def complain(message: str) -> None:
    """Print an error."""
    _print_labelled("error", "bold red", message)


def warn(message: str) -> None:
    """Print a warning."""
    _print_labelled("warning", "yellow", message)


def _print_labelled(label: str, style: str, message: str) -> None:
    # `soft_wrap` leaves breaking lines to the terminal: a message in a log stays in one piece.
    messages().print(Text.assemble((f"{label}:", style), " ", message), soft_wrap=True)


def spoken(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Make a command tell its errors and warnings in words, without a traceback.

    The command takes ``debug``, which lets errors through as they are.
    """

    @functools.wraps(function)
    def command(*args: _Parameters.args, **options: _Parameters.kwargs) -> _Result:
        with warnings.catch_warnings():
            if not options.get("debug"):
                warnings.showwarning = lambda message, *_, **__: warn(str(message))
            try:
                return function(*args, **options)
            except HeelstrikeError as error:
                if options.get("debug"):
                    raise
                complain(str(error))
                raise typer.Exit(WRONG_INPUT) from None
            except OSError as error:
                if options.get("debug"):
                    raise
                complain(_file_trouble(error))
                raise typer.Exit(WRONG_INPUT) from None

    return command


def _file_trouble(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename else reason


class Stage:
    """A piece of work in progress."""

    def __init__(self, progress: Progress | None = None, task: Any = None) -> None:
        self._progress = progress
        self._task = task
        self.outcome = ""
        """What to say when it is over; nothing by default."""

    def reached(self, fraction: float) -> None:
        """Show how much of the work is done, from 0 to 1."""
        if self._progress is not None:
            self._progress.update(self._task, completed=min(max(fraction, 0.0), 1.0), total=1.0)

    def doing(self, what: str, fraction: float) -> None:
        """Show what is being done now, and how much of that is done."""
        if self._progress is not None:
            self._progress.update(self._task, description=what)
            self.reached(fraction)


@contextmanager
def stage(doing: str, *, when_slow: str = "") -> Iterator[Stage]:
    """Show a piece of work while it lasts, on a terminal; say its outcome when it is over.

    Parameters
    ----------
    doing : str
        What is being done.
    when_slow : str
        Added when the work takes longer than it usually does to get going.
    """
    console = messages()
    if not console.is_terminal:
        yield Stage()
        return
    progress = Progress(
        SpinnerColumn(),
        _Doing(when_slow),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )
    with progress:
        current = Stage(progress, progress.add_task(doing, total=None))
        yield current
    if current.outcome:
        console.print(current.outcome)


class _Doing(ProgressColumn):
    """What is being done, with a word of explanation when it is long in getting going."""

    SLOW = 1.5  # seconds

    def __init__(self, when_slow: str) -> None:
        super().__init__()
        self._when_slow = when_slow

    def render(self, task: Task) -> Text:
        slow = task.total is None and (task.elapsed or 0.0) > self.SLOW
        return Text(f"{task.description} {self._when_slow if slow else ''}".rstrip())
