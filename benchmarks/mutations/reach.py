"""Which tests reach which lines, and a limit on what a test may take: a pytest plugin.

With ``REACH`` set to a file, one line of JSON is appended to it for every test: its name, whether
it passed, its seconds of processor time, and the lines and functions of the package that ran in it.
Lines of a function are looked at during its first calls only, functions always. With ``DEADLINE``
set, a test that takes more seconds of processor time fails. With ``ORDER`` set to a file of names,
tests run in that order. With ``VERDICT`` set, the first failure and its words are written there.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

import heelstrike

HOME = str(Path(heelstrike.__file__).parent)
FIRST_CALLS = 40
DEADLINE = float(os.environ.get("DEADLINE", "0"))


class _Deadline(BaseException):
    """The test took too long. No exception of the common kind, for the tested may catch those."""


def _too_long(*_: Any) -> None:
    raise _Deadline(f"more than {DEADLINE} s of processor time")


class _Tracer:
    def __init__(self) -> None:
        self.calls: dict[CodeType, int] = {}
        self.lines: set[tuple[str, int]] = set()
        self.foreign: set[CodeType] = set()

    def start(self, frame: FrameType, *_: Any) -> Any:
        code = frame.f_code
        if code in self.foreign:
            return None
        calls = self.calls.get(code, 0)
        if calls == 0 and not code.co_filename.startswith(HOME):
            self.foreign.add(code)
            return None
        self.calls[code] = calls + 1
        return self.line if calls < FIRST_CALLS else None

    def line(self, frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            self.lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self.line

    def found(self) -> dict[str, Any]:
        lines: dict[str, list[int]] = {}
        for file, line in sorted(self.lines):
            lines.setdefault(str(Path(file).relative_to(HOME)), []).append(line)
        functions: dict[str, list[int]] = {}
        for code in self.calls:
            file = str(Path(code.co_filename).relative_to(HOME))
            functions.setdefault(file, []).append(code.co_firstlineno)
        return {"lines": lines, "functions": {f: sorted(set(n)) for f, n in functions.items()}}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests that are asked for in their order."""
    if "ORDER" in os.environ:
        names = Path(os.environ["ORDER"]).read_text().splitlines()
        place = {name: i for i, name in enumerate(names)}
        items[:] = sorted((i for i in items if i.nodeid in place), key=lambda i: place[i.nodeid])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Any:
    """Set-up counts, too: fixtures made once are paid by the first who asks."""
    tracer = _Tracer()
    begin = time.process_time()
    if DEADLINE:
        signal.signal(signal.SIGVTALRM, _too_long)
        # Again and again, as a test may swallow the first.
        signal.setitimer(signal.ITIMER_VIRTUAL, DEADLINE, DEADLINE)
    if "REACH" in os.environ:
        sys.settrace(tracer.start)
    try:
        return (yield)
    except _Deadline:
        return True
    finally:
        sys.settrace(None)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        if "REACH" in os.environ:
            report = {"test": item.nodeid, "passed": item.stash.get(_passed, False)}
            report |= {"seconds": round(time.process_time() - begin, 3), **tracer.found()}
            with Path(os.environ["REACH"]).open("a") as file:
                file.write(json.dumps(report) + "\n")


_passed = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Any:
    """Note whether a test passed."""
    report: Any = yield
    item.stash[_passed] = item.stash.get(_passed, True) and report.passed
    if report.failed and "VERDICT" in os.environ:
        crash = getattr(report.longrepr, "reprcrash", None)
        words = str(getattr(crash, "message", "")).splitlines()[:1]
        verdict = {"by": item.nodeid, "how": "".join(words)[:200]}
        Path(os.environ["VERDICT"]).write_text(json.dumps(verdict))
    return report
