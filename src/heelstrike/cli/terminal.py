"""What a person sees: stages of work on a terminal, warnings and errors in words.

Everything here goes to standard error, so that standard output holds results only. Away from a
terminal (in a pipe, in a log file) stages say nothing and nothing is coloured.
"""

from __future__ import annotations

import functools
import inspect
import io
import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TimeElapsedColumn,
)
from rich.text import Text

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.declared import declared, grouped
from heelstrike.errors import HeelstrikeError
from heelstrike.interruption import insistent_interrupts
from heelstrike.whole_file import write_whole

FAILED = 1
"""Exit status when the work was done but did not come out well: the robot fell, say."""

WRONG_INPUT = 2
"""Exit status when the request could not be carried out as it was made."""

_Result = TypeVar("_Result")


def output() -> Console:
    """Console for results, on standard output."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A pipe may have an encoding without ∫ or −: a question mark is better than no result.
        sys.stdout.reconfigure(errors="replace")
    return Console(highlight=False)


def print_found(found: Any, entries: Any, *, as_json: bool) -> None:
    """Print what a command found: as JSON has it, or as people read it."""
    if as_json:
        typer.echo(json.dumps(entries, indent=2))
    else:
        output().print(found, markup=False)


def messages() -> Console:
    """Console for everything else, on standard error."""
    return Console(stderr=True, highlight=False)


def tell(message: str, label: tuple[str, str] = ("", "")) -> None:
    """Print something worth knowing that is not a result, after a label and its style."""
    # `soft_wrap` leaves breaking lines to the terminal: a message in a log stays in one piece.
    messages().print(Text.assemble(label, message), soft_wrap=True)


_OPTIONS = {
    "floating=True": "--floating",
    "projected=True": "--projected",
    "xacro=True": "--xacro",
    'mirror="average"': "--mirror",
    "leave out mirror, or use dimension=2": "leave out --mirror",
    'forward="y"': "--forward y",
    "package_path=…": "--package-path",
    "leave out package_path": "leave out --package-path",
}


def in_options(message: str) -> str:
    """Return a message with the options of this command in the place of Python's keywords."""
    for keyword, option in _OPTIONS.items():
        message = message.replace(keyword, option)
    return message


def complain(message: str) -> None:
    """Print an error."""
    tell(message, ("error: ", "bold red"))


def spoken(function: Callable[..., _Result]) -> Callable[..., _Result]:
    """Make a command tell its errors and warnings in words, without a traceback.

    After Ctrl-C it tells what was going on and which files there are (:func:`wrote`). It gets the
    option --debug, which lets errors through as they are, and those of :func:`grouped`.
    """
    called = grouped(function)

    @functools.wraps(called)
    def command(*, debug: bool = False, **options: Any) -> _Result:
        _written.clear()
        with insistent_interrupts() as interrupts, warnings.catch_warnings():
            if debug:
                return called(**options)
            warnings.showwarning = lambda message, *_, **__: tell(
                in_options(str(message)), ("warning: ", "yellow")
            )
            try:
                return called(**options)
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
                    complain(in_options(str(error)))
                elif isinstance(error, OSError):
                    complain(_file_trouble(error))
                else:
                    raise
                raise typer.Exit(WRONG_INPUT) from None

    own = inspect.signature(called).parameters.values()
    return declared(command, [*own, DEBUG])


DEBUG = inspect.Parameter(
    "debug", inspect.Parameter.KEYWORD_ONLY, default=False,
    annotation=Annotated[
        bool,
        typer.Option("--debug", help="Show where in the program an error arose.", hidden=True),
    ],
)  # fmt: skip


_written: list[Path] = []


def wrote(*files: Path) -> None:
    """Remember files that a command has written, for the case of Ctrl-C."""
    _written.extend(files)


def save_json(file: Path, entries: Any) -> None:
    """Write what a command found as JSON, into a folder that is made if need be."""
    file.parent.mkdir(parents=True, exist_ok=True)
    wrote(write_whole(file, json.dumps(entries, indent=2, ensure_ascii=False) + "\n"))


def this_command() -> str:
    """Return the command that is being carried out, as the shell takes it."""
    from heelstrike.view.page.provenance import command_line

    return command_line(["heelstrike", *sys.argv[1:]])


def tell_interruption(doing: str = "") -> None:
    """Say what Ctrl-C ended and what is kept."""
    names = ", ".join(str(path) for path in _written)
    kept = f"kept: {names}" if names else "nothing was written"
    tell(f"{f' while {doing}' if doing else ''}; {kept}", ("interrupted", "yellow"))


def _file_trouble(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename else reason


@dataclass
class Stage:
    """A piece of work in progress."""

    what: str
    """What is being done."""
    outcome: str = ""
    """What to say when it is over; nothing by default."""
    progress: Progress | None = None
    """Where it is shown, on a terminal."""

    def reached(self, fraction: float) -> None:
        """Show how much of the work is done, from 0 to 1."""
        if self.progress is not None:
            share = min(max(fraction, 0.0), 1.0)
            self.progress.update(TaskID(0), description=self.what, completed=share, total=1.0)

    def doing(self, what: str, fraction: float) -> None:
        """Show what is being done now, and how much of that is done."""
        self.what = what
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
    current, console = Stage(doing), messages()
    with ExitStack() as shown:
        if console.is_terminal:
            columns = (_Doing(when_slow), BarColumn(bar_width=24), TimeElapsedColumn())
            current.progress = Progress(SpinnerColumn(), *columns, console=console, transient=True)
            shown.enter_context(current.progress).add_task(doing, total=None)
        try:
            yield current
        except KeyboardInterrupt as error:
            error.doing = current.what  # type: ignore[attr-defined]
            raise
    if current.outcome and console.is_terminal:
        console.print(current.outcome)


@contextmanager
def many(doing: str) -> Iterator[Callable[[int, int, Mapping[str, float]], None]]:
    """Show many pieces of work while they last, on a terminal: all of them, and each under way.

    A KeyboardInterrupt that ends them learns how many were finished: its ``doing``.

    Parameters
    ----------
    doing : str
        What is being done.

    Yields
    ------
    callable
        Takes how many are finished, of how many, and the share that is done of each under way.
    """
    console, counted = messages(), [0, 0]
    with ExitStack() as shown:
        columns = (SpinnerColumn(), _Doing(""), BarColumn(bar_width=24), TimeElapsedColumn())
        bars = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        shown.enter_context(bars)
        whole = bars.add_task(doing, total=None)
        under_way: dict[str, TaskID] = {}

        def show(finished: int, all_of_them: int, shares: Mapping[str, float]) -> None:
            counted[:] = finished, all_of_them
            told = f"{doing}, {finished} of {all_of_them}"
            bars.update(whole, description=told, completed=finished, total=all_of_them)
            for what in [what for what in under_way if what not in shares]:
                bars.remove_task(under_way.pop(what))
            for what, share in shares.items():
                if what not in under_way:
                    under_way[what] = bars.add_task(what, total=1.0)
                bars.update(under_way[what], completed=share)

        try:
            yield show
        except KeyboardInterrupt as error:
            error.doing = f"{doing}, {counted[0]} of {counted[1]} finished"  # type: ignore[attr-defined]
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
