"""What a controller raised, told so that its author finds the line."""

from __future__ import annotations

import traceback
from pathlib import Path

from heelstrike.robot.warning import is_of_package, warn
from heelstrike.sim.closed_sets import OnError


class ControllerWarning(UserWarning):
    """A controller raised an error, which ended its run; or it did what it may not."""


class EndOfRun(Exception):  # noqa: N818 - no error
    """Raised by a controller in Python to end its run, for the reason that is its message.

    The run has the status ``stopped``, and the reason in its message. The last instant is recorded
    with the torques of the call before. A compiled law calls ``robot.stop`` instead, see
    :func:`~heelstrike.controller`.

    Examples
    --------
    >>> import numpy as np
    >>> import heelstrike as hs
    >>> class Patient:
    ...     def torque(self, t, state, contacts):
    ...         if t > 0.0095:
    ...             raise hs.EndOfRun("stood long enough")
    ...         return np.zeros(6)
    >>> robot = hs.load_robot("bravo7")
    >>> run = hs.simulate(robot, Patient(), state=robot.reference_state(), duration=1.0)
    >>> run.message
    'the controller ended the run at t = 0.01 s: stood long enough'
    """


_CALLER = str(Path(__file__).parents[1] / "simulation.py")


def tell(message: str, error: BaseException, on_error: OnError) -> None:
    """Warn of what a controller raised, with its traceback, or raise it, or leave it at that.

    The warning points at the caller's line, and comes as often as the error does: who runs a cell
    of a notebook again wants to be told again.
    """
    if on_error is OnError.RAISE:
        error.add_note(message)
        raise error
    if on_error is OnError.STOP:
        return
    trace = _traceback_of(error)
    warn(f"{message}\n{trace}" if trace else message, ControllerWarning, again=True)


def _traceback_of(error: BaseException) -> str:
    """Return the traceback of an error from where this package called the controller.

    Nothing for errors that have none of their own: of what is noticed afterwards, and of compiled
    code, where Numba knows no line.
    """
    whole = traceback.TracebackException.from_exception(error)
    called = [i for i, each in enumerate(whole.stack) if each.filename == _CALLER]
    frames = list(whole.stack)[called[-1] + 1 if called else 0 :]
    outside = [i for i, each in enumerate(frames) if not is_of_package(each.filename)]
    whole.stack = traceback.StackSummary.from_list(frames[outside[0] if outside else 0 :])
    return "".join(whole.format()).rstrip() if frames else ""
