"""How much of the energy of event-driven runs work explains.

The energy at each row is that of :mod:`scenes.mechanics`. It changes by the work of motors,
dampers, pushes, dry joints, stops and sliding friction, which is the integral of their power at
the rows (:mod:`scenes.checks.quadrature`), and at jumps by the work of the impulses in the events:
½ p·(v⁻ + v⁺). What is left is summed up from the start; its greatest size, relative to the energy
in play (the greatest kinetic energy or the range of the potential one), is `missing`.

Where energy seems to be missing, the integral may be too coarse: rows come from the dense output,
and the run is the same however many there are. So a scene is looked at again with more rows, and
then the intervals in which most is missing are simulated once more from the rows before them, with
rows at steps that are shorter than they would have to be: forces that jam grow a thousandfold in a
microsecond. Only the work is taken from there, the energies are those of the run. Intervals that
end in a jump out of a jam, before which forces grow without bound, have no integral; of these it is
asked that they make no energy.

Newton's restitution with friction may make energy. The run has to say so, and how much it was is
`gained`; what an impact makes without a word is `unsaid`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from scenes.checks.work import Work, work_of
from scenes.event_judge import GAIN, ROW
from scenes.methods import STEP, Setting
from scenes.scene import random_scene

Array = NDArray[Any]

RTOL = 1e-9
"""Relative error that a step may make."""
EXPLAINED = 1e-6
"""Energy that may be missing, relative to the energy in play."""
FINER = (STEP, 1e-4)
"""Times between rows (s), of one look after the other."""
SHORTER_STEPS = 1e-13
"""Tolerance that makes the steps short in intervals that are simulated once more."""
STEPS = 16
"""Steps at least that are made of them."""
SHORT_OF_IT = 1e-8
"""Part of them before an event that is not simulated."""
LOOKS, WORTH_A_LOOK = 40, 1e-8
"""How many of them at most, and how much (relative) is missing in them at least."""
SAME_END = 1e-2
"""How near (relative) such an interval has to come to the state in which it ended before."""
MOST = 3
"""Places at which most is missing that are told."""


@dataclass(frozen=True)
class Balance:
    """Energy of a run that work does not explain.

    Attributes
    ----------
    before : (n,) int
        Instant before which energy is missing, or -1 for a jump at one.
    time : (n,) float
        That instant, s.
    left : (n,) float
        Energy (J) that nothing explains, gained from the instant before, or in the jump.
    doubt : (n,) float
        How far (J) the integrals may be wrong.
    what : tuple of str
        What lies before each instant, or at it.
    in_play : float
        Energy in play, J.
    gained, unsaid : float
        Energy (J) that impacts made and said so, or did not, the most of one.
    gains, jams, left_out : int
        How often energy was made and said so; jams; pieces without a row to integrate over.
    jam_made : float
        Most energy (J) that a jam made beyond the work of the known forces.
    """

    before: Array
    time: Array
    left: Array
    doubt: Array
    what: tuple[str, ...]
    in_play: float
    gained: float
    unsaid: float
    gains: int
    jams: int
    left_out: int
    jam_made: float

    @property
    def missing(self) -> float:
        """Greatest energy that is missing since the start, relative to the energy in play."""
        return float(np.max(np.abs(np.cumsum(self.left)), initial=0.0)) / self.in_play

    @property
    def missing_off_bridges(self) -> float:
        """The same without bridges, whose error is of their own.

        In a corner the impulses that begin one have no frame that a row would show.
        """
        smooth = [0.0 if "bridge" in word else 1.0 for word in self.what]
        return float(np.max(np.abs(np.cumsum(self.left * smooth)), initial=0.0)) / self.in_play

    def places(self) -> list[dict[str, Any]]:
        """Return where most is missing."""
        most = np.argsort(-np.abs(self.left))[:MOST]
        return [
            {
                "time": float(self.time[i]),
                "missing": float(self.left[i] / self.in_play),
                "doubt": float(self.doubt[i] / self.in_play),
                "what": self.what[i],
            }
            for i in most
        ]


def balance(work: Work) -> Balance:
    """Explain the energy of an event-driven run by work."""
    rows = work.rows
    kinetic, potential = rows.rows.energy()
    energy = kinetic + potential
    done, doubt, out = work.between()
    found: list[tuple[int, float, float, float, str]] = []
    gained = unsaid = jam_made = 0.0
    for k, at in enumerate(rows.instant.tolist()):
        a, b = rows.first[k], rows.last[k]
        if k > 0 and k in rows.poles:
            jam_made = max(jam_made, _made_by_jam(work, k, energy))
        elif k > 0:
            left = energy[a] - energy[rows.last[k - 1]] - done[k - 1]
            left -= work.of_kick(k) if a == b else 0.0
            words = "bridge" if k - 1 in rows.bridges else "interval"
            words += " before an event" if work.eventful[k] else ""
            found.append((k, at, left, doubt[k - 1], words))
        if a != b:
            words = "jump at a bridge" if k in rows.bridges else "jump"
            found.append((-1, at, energy[b] - energy[a] - work.of_kick(k), 0.0, words))
            made = kinetic[b] - kinetic[a]
            if k in work.gains:
                gained += max(made, 0.0)
            elif k not in rows.bridges and made > GAIN * _size_squared(work, a, b):
                unsaid = max(unsaid, made)
    before, times, lefts, doubts, what = zip(*found, strict=True) if found else ((),) * 5
    # Of a robot that stands still nothing is in play but what so many sums are rounded by.
    rounding = len(energy) * float(np.finfo(float).eps * np.abs(energy).max()) / EXPLAINED
    in_play = max(float(kinetic.max()), float(np.ptp(potential)), rounding, 1e-9)
    return Balance(
        np.array(before, dtype=int), np.array(times), np.array(lefts), np.array(doubts), what,
        in_play, gained, unsaid, len(work.gains), len(rows.jams), out, jam_made,
    )  # fmt: skip


def _made_by_jam(work: Work, k: int, energy: Array) -> float:
    """Energy made up to behind the jump that ends a jam, beyond what known forces may have."""
    rows = work.rows
    before, after = rows.last[k - 1], rows.last[k]
    span = rows.instant[k] - rows.instant[k - 1]
    known = span * (abs(rows.free_power[before]) + abs(rows.free_power[after]))
    return float(energy[after] - energy[before] - known)


def _size_squared(work: Work, a: int, b: int) -> float:
    """Twice the greatest kinetic energy that a jump could have anything to do with."""
    rows = work.rows
    matrix, v = rows.rows.matrix[a], rows.rows.v
    size = sum(np.sqrt(max(one @ matrix @ one, 0.0)) for one in (v[a], v[b]))
    return float((size + ROW * rows.force_size[a]) ** 2)


def look_closer(setting: Setting, run: Any, work: Work, found: Balance) -> tuple[Balance, int]:
    """Integrate again where most is missing, over shorter steps; also tell over how many."""
    left, doubt, looks = found.left.copy(), found.doubt.copy(), 0
    for i in np.argsort(-np.abs(found.left))[:LOOKS]:
        k = int(found.before[i])
        if k < 0 or "bridge" in found.what[i]:
            continue
        if np.abs(left[i]) < WORTH_A_LOOK * found.in_play:
            break
        looks += 1
        again = _again(setting, run, work, k)
        if again is not None:
            done, wrong = again
            left[i] += float(work.between()[0][k - 1]) - done
            doubt[i] = wrong
    return replace(found, left=left, doubt=doubt), looks


def _again(setting: Setting, run: Any, work: Work, k: int) -> tuple[float, float] | None:
    """Work from an instant to the k-th if it is simulated once more, and how wrong it may be."""
    rows = work.rows
    row, end = rows.last[k - 1], rows.first[k]
    state = hs.State(run.position[row], run.velocity[row])
    begin = float(run.time[row])
    span = float(run.time[end]) - begin
    # Forces at an event are those behind it: the last row is to be just before it.
    short = SHORT_OF_IT * span if work.eventful[k] else 0.0
    try:
        other = setting.run(
            "event_driven", state=state, begin=begin, duration=span - short, rows=None,
            rtol=SHORTER_STEPS, max_step=span / STEPS,
        )  # fmt: skip
    except HeelstrikeError:
        return None
    if not other.completed or len(other.time) < 2:
        return None
    mine = work_of(other)
    ends = np.concatenate((other.position[-1], other.velocity[-1]))
    ended = np.concatenate((run.position[end], run.velocity[end]))
    if not np.all(np.abs(ends - ended) <= SAME_END * (1.0 + np.abs(ended))):
        return None
    done, wrong, _ = mine.between()
    return float(done.sum() + short * mine.power[-1]), float(wrong.sum())


def _cause(run: Any, found: Balance) -> str:
    """Why energy is not explained, empty if it is."""
    if not run.completed:
        return run.status.value
    if max(found.jam_made, found.unsaid) > EXPLAINED * found.in_play:
        return "energy made without a word"
    if found.missing <= EXPLAINED:
        return ""
    return "bridges" if found.missing_off_bridges <= EXPLAINED else "not explained"


def energy_of_scene(check: str, seed: int, *, twins: bool = True) -> dict[str, Any]:
    """Run one scene at a fine tolerance and explain its energy; `twins` says nothing here."""
    del twins
    began = time.process_time()
    setting = Setting.of(random_scene(seed))
    result: dict[str, Any] = {"method": check, "seed": seed, "kind": setting.scene.kind}
    start = setting.scene.state(setting.robot)
    looks = 0
    for rows in FINER:
        try:
            run = setting.run("event_driven", rows=rows, rtol=RTOL)
        except HeelstrikeError as error:
            return result | {"status": "refused", "passes": False, "message": str(error)}
        work = work_of(run, start)
        found = balance(work)
        if found.missing <= EXPLAINED:
            break
    else:
        found, looks = look_closer(setting, run, work, found)
    return result | {
        "status": run.status.value,
        "message": run.message,
        "passes": not _cause(run, found),
        "size": found.missing,
        "cause": _cause(run, found),
        "doubt": float(found.doubt.sum()) / found.in_play,
        "in_play": found.in_play,
        "off_bridges": found.missing_off_bridges,
        "gains_named": found.gains,
        "gained": found.gained / found.in_play,
        "unsaid": found.unsaid / found.in_play,
        "jams": found.jams,
        "jam_made": found.jam_made / found.in_play,
        "left_out": found.left_out,
        "bridges": len(work.rows.bridges),
        "rows_every": rows,
        "looks": looks,
        "places": found.places(),
        "seconds": time.process_time() - began,
    }
