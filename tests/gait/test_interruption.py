"""Ctrl-C while a gait is optimised: IPOPT stops after the iteration under way, and nothing goes on.

The signal comes from inside the iteration, so that what happens after it can be counted.
"""

from __future__ import annotations

import signal
import threading
from typing import Any

import pytest
import walking

import heelstrike as hs
from heelstrike.gait.program import _Watch

REQUESTS: dict[str, dict[str, Any]] = {
    "bravo7": {"step_length": 0.30, "step_duration": 0.70},
    "rabbit": {"step_length": 0.25, "step_duration": 0.50},
    # Impossible: the search for what comes nearest to a gait is interrupted.
    "bravo7 in haste": {"step_length": 0.90, "step_duration": 0.30},
}


pytestmark = pytest.mark.usefixtures("python_handles_ctrl_c")


@pytest.mark.parametrize("last", [1, 30])
@pytest.mark.parametrize("name", REQUESTS)
def test_no_iteration_begins_after_ctrl_c(
    name: str, last: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    iterations = 0

    def count(watch: _Watch, _: Any) -> list[int]:
        nonlocal iterations
        iterations += 1
        if iterations == last:
            signal.raise_signal(signal.SIGINT)
        return [int(watch.stop())]

    monkeypatch.setattr(_Watch, "eval", count)
    with pytest.raises(KeyboardInterrupt):
        hs.optimize_gait(hs.load_robot(name.split()[0]), **REQUESTS[name])
    assert iterations == last


def test_ctrl_c_is_not_taken_for_a_failure_that_it_prints(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """CasADi looks for signals in the functions it evaluates: one that waits there is kept, too."""
    solve = _Watch.eval

    def interrupt(watch: _Watch, _: Any) -> list[int]:
        # Another thread, so that Python does not see to it before CasADi does.
        sender = threading.Thread(target=signal.raise_signal, args=(signal.SIGINT,))
        sender.start()
        sender.join()
        return solve(watch, _)

    monkeypatch.setattr(_Watch, "eval", interrupt)
    with pytest.raises(KeyboardInterrupt):
        hs.optimize_gait(walking.bravo7(), **REQUESTS["bravo7"])
    assert capfd.readouterr().err == ""
