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
from pathlib import Path
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

from heelstrike.cli import INTERRUPTED
from heelstrike.errors import HeelstrikeError
from heelstrike.interruption import insistent_interrupts

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

    After Ctrl-C it tells what was going on and which files there are (:func:`wrote`). The command
    takes ``debug``, which lets errors through as they are.
    """

    @functools.wraps(function)
    def command(*args: _Parameters.args, **options: _Parameters.kwargs) -> _Result:
        _written.clear()
        with insistent_interrupts() as interrupts, warnings.catch_warnings():
            if options.get("debug"):
                return function(*args, **options)
            warnings.showwarning = lambda message, *_, **__: warn(str(message))
            try:
                return function(*args, **options)
            except KeyboardInterrupt as error:
                interrupts.acknowledge()
                tell_interruption(getattr(error, "doing", ""))
                raise typer.Exit(INTERRUPTED) from None
            except typer.Exit:
                raise
            except Exception as error:
                if interrupts.came:  # an import that Ctrl-C breaks off can say that it failed
                    tell_interruption()
                    raise typer.Exit(INTERRUPTED) from None
                if isinstance(error, HeelstrikeError):
                    complain(str(error))
                elif isinstance(error, OSError):
                    complain(_file_trouble(error))
                else:
                    raise
                raise typer.Exit(WRONG_INPUT) from None

    return command


_written: list[Path] = []


def wrote(*files: Path) -> None:
    """Remember files that a command has written, for the case of Ctrl-C."""
    _written.extend(files)


def tell_interruption(doing: str = "") -> None:
    """Say what Ctrl-C ended and what is kept."""
    names = ", ".join(str(path) for path in _written)
    messages().print(
        Text.assemble(
            ("interrupted", "yellow"),
            f" while {doing}" if doing else "",
            f"; kept: {names}" if names else "; nothing was written",
        ),
        soft_wrap=True,
    )


def _file_trouble(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename else reason


class Stage:
    """A piece of work in progress."""

    def __init__(self, what: str, progress: Progress | None = None, task: Any = None) -> None:
        self.what = what
        """What is being done."""
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
        self.what = what
        if self._progress is not None:
            self._progress.update(self._task, description=what)
            self.reached(fraction)


@contextmanager
def stage(doing: str, *, when_slow: str = "") -> Iterator[Stage]:
    """Show a piece of work while it lasts, on a terminal; say its outcome when it is over.

    A KeyboardInterrupt that ends it learns what was being done: its ``doing``.

    Parameters
    ----------
    doing : str
        What is being done.
    when_slow : str
        Added when the work takes longer than it usually does to get going.
    """
    console = messages()
    if not console.is_terminal:
        with _named_interrupt(Stage(doing)) as current:
            yield current
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
        current = Stage(doing, progress, progress.add_task(doing, total=None))
        with _named_interrupt(current):
            yield current
    if current.outcome:
        console.print(current.outcome)


@contextmanager
def _named_interrupt(current: Stage) -> Iterator[Stage]:
    try:
        yield current
    except KeyboardInterrupt as error:
        error.doing = current.what  # type: ignore[attr-defined]
        raise


class _Doing(ProgressColumn):
    """What is being done, with a word of explanation when it is long in getting going."""

    SLOW = 1.5  # seconds

    def __init__(self, when_slow: str) -> None:
        super().__init__()
        self._when_slow = when_slow

    def render(self, task: Task) -> Text:
        slow = task.total is None and (task.elapsed or 0.0) > self.SLOW
        return Text(f"{task.description} {self._when_slow if slow else ''}".rstrip())
