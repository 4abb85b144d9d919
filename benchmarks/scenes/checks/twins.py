"""Whether twins agree that begin 1 ms before events and end 49 ms behind them.

From the last row that lies at least 1 ms before an event the scene is simulated for 50 ms as
itself, mirrored, and with links and contacts in another order. All three begin in the same state
with nothing remembered, so that they differ by rounding alone. `size` is the greatest difference
of a coordinate or velocity at the end, over 1 + its size.

Where that exceeds AGREE, it is asked whether the robot itself is as sensitive: it is begun again
from states that differ from this one in the last digits (NUDGES, relative). If its own ends are as
far from each other, but for a factor of CONTROL, the difference is the motion's (*amplified*): no
arithmetic can tell these ends apart. If they are not, both the twin and the scene itself are
judged; where neither breaks a law, the ends are two solutions (*another solution*, Coulomb's law
may have several), and if one does, or there is none, the difference is *not explained*. Where the
scene does not come to its end there is nothing to compare (*no end*), even if no twin does.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from scenes.event_judge import judge_events
from scenes.methods import Setting
from scenes.scene import random_scene
from scenes.twins import Twin, twins_of

Array = NDArray[Any]

BEFORE, LASTS = 1e-3, 0.05
"""How long (s) before an event twins begin, and how long they go on."""
AGREE = 1e-8
"""Difference that they may have."""
EVENTS = 6
"""Windows a scene; there are as many events between one and the next."""
NUDGES = 8e-16, -8e-16, 4e-15, -4e-15, 2e-14, -2e-14
"""Last digits by which the robot itself is begun again."""
CONTROL = 4.0
"""Twins may differ so much more: rounding acts at each of hundreds of steps, a nudge but once."""
DISCRETE = 0.1
"""Ends as far apart as this are no matter of degree: a factor says nothing about them."""

Words = dict[str, Any]


def ends(setting: Setting, state: hs.State, begin: float) -> Any:
    """Run of a window, None if it does not come to its end."""
    try:
        run = setting.run("event_driven", state=state, begin=begin, duration=LASTS)
    except HeelstrikeError:
        return None
    return run if run.completed else None


def apart(one: Any, other: Any, back: Twin | None = None) -> float:
    """Difference of the last states of two runs, the other told in the words of the one."""
    if one is None or other is None:
        return float("inf")
    q, v = other.position[-1], other.velocity[-1]
    if back is not None:
        state = back.back(q, v)
        q, v = state.q, state.v
    here = np.concatenate((one.position[-1], one.velocity[-1]))
    return float(np.max(np.abs(np.concatenate((q, v)) - here) / (1.0 + np.abs(here))))


def windows(run: Any) -> list[int]:
    """Rows from which twins begin: the last ones 1 ms before events, evenly chosen among these."""
    moments = sorted({event.time for event in run.events if event.time > BEFORE})
    rows = np.searchsorted(run.time, np.array(moments) - BEFORE, side="right") - 1
    # Of an instant with two rows that one which shows what follows.
    rows = np.unique(rows)
    if len(rows) > EVENTS:
        rows = rows[np.linspace(0, len(rows) - 1, EVENTS).round().astype(int)]
    return [int(row) for row in rows]


def nudged(state: hs.State, by: float) -> hs.State:
    """Return a state with other last digits, up and down in turn."""
    sign = np.where(np.arange(len(state.q)) % 2 == 0, by, -by)
    return replace(state, q=state.q * (1.0 + sign), v=state.v * (1.0 - sign))


def own_spread(setting: Setting, state: hs.State, begin: float, run: Any) -> float:
    """How far the ends of the robot itself are apart for other last digits of its beginning."""
    others = (ends(setting, nudged(state, by), begin) for by in NUDGES)
    return max(apart(run, other) for other in others)


def compare(setting: Setting, twins: tuple[Twin, ...], state: hs.State, begin: float) -> Words:
    """Compare one window; explain the difference if there is one."""
    run = ends(setting, state, begin)
    if run is None:
        return {"begin": begin, "size": float("inf"), "twin": "", "cause": "no end"}
    compared = []
    for twin in twins:
        end = ends(twin.setting, twin.there(state.q, state.v), begin)
        compared.append((apart(run, end, twin), twin, end))
    size, twin, end = max(compared, key=lambda one: one[0])
    found: Words = {"begin": begin, "size": size, "twin": twin.name, "cause": ""}
    if size <= AGREE:
        return found
    found["spread"] = spread = own_spread(setting, state, begin, run)
    if CONTROL * spread >= size or min(spread, size) > DISCRETE:
        return found | {"cause": "amplified"}
    lawful = all(one is not None and not judge_events(one).broken() for one in (run, end))
    return found | {"cause": "another solution" if lawful else "not explained"}


def twins_of_scene(check: str, seed: int, *, twins: bool = True) -> Words:
    """Compare a scene with its twins from before its events; `twins` says nothing here."""
    del twins
    began = time.process_time()
    setting = Setting.of(random_scene(seed))
    result: Words = {"method": check, "seed": seed, "kind": setting.scene.kind}
    try:
        run = setting.run("event_driven")
    except HeelstrikeError as error:
        return result | {"status": "refused", "passes": False, "message": str(error)}
    others = twins_of(setting)[:2]
    found = []
    for row in windows(run):
        state = hs.State(run.position[row], run.velocity[row])
        found.append(compare(setting, others, state, float(run.time[row])))
    causes = sorted({one["cause"] for one in found if one["cause"]})
    if not run.completed:
        causes.append(run.status.value)
    return result | {
        "status": run.status.value,
        "message": run.message,
        "passes": not causes,
        "size": max((one["size"] for one in found), default=0.0),
        "cause": ", ".join(causes),
        "windows": len(found),
        "agree": sum(not one["cause"] for one in found),
        "others": [one for one in found if one["cause"]],
        "seconds": time.process_time() - began,
    }
