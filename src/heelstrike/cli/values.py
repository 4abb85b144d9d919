"""Values of options that are more than a number: grounds, pushes and poses in a person's words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heelstrike.errors import HeelstrikeError, RobotError, SimulationError
from heelstrike.wording import meant

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground
    from heelstrike.sim.push import Push

GROUNDS = {
    "flat": "flat",
    "slope": "slope:DEGREES, as slope:-3, which descends along +x",
    "stairs": "stairs:RISExTREAD in m, as stairs:0.02x0.3",
    "rough": "rough:HEIGHT:SEED, as rough:0.01:7, within ±0.01 m",
}
"""Kinds of ground that have a name, and how each is written."""

AHEAD = 0.5
"""Where stairs begin, in m: in front of the feet of the start, as rough ground does."""
STAIRS = 100
"""Number of stairs."""
LARGEST_FILE = 2**20
"""Bytes of the largest file of corners that is read."""

PUSH = "LINK:FORCE:START:DURATION"
DEGREE_SIGNS = ("deg", "°")


def ground_called(words: str, *, friction: float = 0.75, restitution: float = 0.0) -> Ground:
    """Make the ground of an option.

    Parameters
    ----------
    words : str
        One of `GROUNDS`, or the path of a text file with a corner (x, z) a line, in m.
    friction, restitution : float
        Of all of it.

    Raises
    ------
    SimulationError
        If there is no such ground or file, or a number is none or impossible.
    """
    from heelstrike.contact.ground import Ground

    given: dict[str, Any] = {"friction": friction, "restitution": restitution}
    flat = Ground(**given)
    where = f"--ground {words}"

    def number(word: str) -> float:
        return _number(word, where, SimulationError)

    shaped: Callable[..., Ground]
    kind, *shape = words.split(":")
    if kind not in GROUNDS:
        shaped = partial(Ground, profile=_corners(words))
    else:
        match kind, *shape:
            case ["flat"]:
                return flat
            case ["slope", degrees]:
                slope = number(degrees)
                if not abs(slope) < 90.0:
                    raise SimulationError(f"{where}: a slope lies between -90 and 90 degrees.")
                shaped = partial(Ground, slope=math.radians(slope))
            case ["stairs", size] if size.count("x") == 1:
                rise, tread = map(number, size.split("x"))
                shaped = partial(Ground.stairs, rise=rise, tread=tread, count=STAIRS, start=AHEAD)
            case ["rough", height, seed]:
                if not seed.isdecimal():
                    raise SimulationError(f"{where}: the seed is a whole number, not {seed!r}.")
                shaped = partial(Ground.rough, amplitude=number(height), seed=int(seed))
            case _:
                raise SimulationError(f"{where}: write {GROUNDS[kind]}.")
    try:
        return shaped(**given)
    except SimulationError as error:
        raise SimulationError(f"{where}: {error}") from None


def pushes_called(several: Sequence[str] | None) -> tuple[Push, ...]:
    """Make pushes of ``LINK:FORCE:START:DURATION``, in N and s; FORCE is FX or FX,FZ.

    Raises
    ------
    SimulationError
        If one is written otherwise, or a number is none.
    """
    said = (
        f"{PUSH}, as trunk:60:1:0.1 for 60 N along x on the trunk, from 1 s on for 0.1 s; "
        "trunk:60,-20:1:0.1 also has a force along z"
    )
    return tuple(_push_called(words, 2, said) for words in several or ())


def spatial_pushes_called(several: Sequence[str] | None) -> tuple[Push, ...]:
    """Make pushes in space of ``LINK:X,Y,Z:START:DURATION``, in N and s.

    Raises
    ------
    SimulationError
        If one is written otherwise, or a number is none.
    """
    said = (
        "LINK:X,Y,Z:START:DURATION, as trunk:0,60,0:1:0.1 for 60 N to the left on the trunk, from "
        "1 s on for 0.1 s"
    )
    return tuple(_push_called(words, 3, said) for words in several or ())


def _push_called(words: str, dimension: int, said: str) -> Push:
    """Make a push of what is written; in the plane the force along z may be left out."""
    from heelstrike.sim.push import Push

    link, *rest = words.rsplit(":", 3)
    force = rest[0].split(",") if len(rest) == 3 else []
    if not link or len(force) not in ((1, 2) if dimension == 2 else (dimension,)):
        raise SimulationError(f"--push {words}: write {said}.")
    *along, start, duration = (
        _number(word, f"--push {words}", SimulationError) for word in (*force, *rest[1:])
    )
    missing = [0.0] * (dimension - len(along))
    return Push(link, force=(*along, *missing), start=start, duration=duration)


def range_called(words: str, where: str) -> tuple[float, float]:
    """Make a range of ``LOW:HIGH``.

    Raises
    ------
    SimulationError
        If it is written otherwise, or a number is none.
    """
    low, colon, high = words.partition(":")
    if not colon:
        raise SimulationError(f"{where}: write LOW:HIGH, as 0.2:0.6, not {words!r}.")
    return _number(low, where, SimulationError), _number(high, where, SimulationError)


def numbers_called(words: str, where: str) -> list[float]:
    """Make numbers of ``A,B,...``.

    Raises
    ------
    SimulationError
        If one of them is none.
    """
    return [_number(word, where, SimulationError) for word in words.split(",")]


def ranges_called(several: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """Make named ranges of ``NAME=LOW:HIGH``.

    Raises
    ------
    SimulationError
        If one is written otherwise, or is there twice.
    """
    found: dict[str, tuple[float, float]] = {}
    for words in several or ():
        name, equals, values = words.partition("=")
        where = f"--randomise {words}"
        if not (name and equals):
            raise SimulationError(f"{where}: write NAME=LOW:HIGH, as push=0:20.")
        if name in found:
            raise SimulationError(f"--randomise: {name!r} is there twice.")
        found[name] = range_called(values, where)
    return found


def pose_called(several: Sequence[str] | None) -> dict[str, float]:
    """Make a pose of ``joint=value,...``: rad, m, or degrees where a value ends in ``deg``.

    Raises
    ------
    RobotError
        If it is written otherwise, a number is none, or a joint is there twice.
    """
    pose: dict[str, float] = {}
    for item in ",".join(several or ()).split(",") if several else ():
        joint, equals, value = (part.strip() for part in item.rpartition("="))
        if not (joint and equals and value):
            raise RobotError(
                f"--pose {item}: write joint=value, as left_knee=0.4 (rad, or m for a slide) or "
                "left_knee=23deg, with commas between several."
            )
        if joint in pose:
            raise RobotError(f"--pose: joint {joint!r} is there twice.")
        sign = next((sign for sign in DEGREE_SIGNS if value.endswith(sign)), "")
        number = _number(value.removesuffix(sign), f"--pose {item}", RobotError)
        pose[joint] = math.radians(number) if sign else number
    return pose


def xacro_arguments(several: Sequence[str] | None) -> dict[str, str]:
    """Make arguments of a xacro file of ``name:=value``, as xacro itself writes them.

    Raises
    ------
    RobotError
        If one is written otherwise, or is there twice.
    """
    arguments: dict[str, str] = {}
    for words in several or ():
        name, assigned, value = words.partition(":=")
        if not (name.strip() and assigned):
            raise RobotError(f"--xacro-arg {words}: write NAME:=VALUE, as legs:=2.")
        if name.strip() in arguments:
            raise RobotError(f"--xacro-arg: {name.strip()!r} is there twice.")
        arguments[name.strip()] = value
    return arguments


def _number(word: str, where: str, error: type[HeelstrikeError]) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise error(f"{where}: {word!r} is not a finite number; write it without a unit.")
    return number


def _corners(name: str) -> list[tuple[float, float]]:
    """Read the corners (x, z) of a file."""
    path = Path(name)
    if not path.is_file():
        there = "is no file" if path.exists() else "there is no such file"
        guess = meant(name.partition(":")[0].lower(), GROUNDS)
        raise SimulationError(
            f"--ground {name}: {there}.{guess} A ground is {'; '.join(GROUNDS.values())}; or a "
            "text file with a corner x z a line, in m."
        )
    if path.stat().st_size > LARGEST_FILE:
        raise SimulationError(f"{name}: larger than {LARGEST_FILE // 2**20} MB; is it a ground?")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise SimulationError(
            f"{name}: not a text file; a ground is a corner x z a line, in m."
        ) from None
    found = []
    for place, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        where = f"{name}, line {place}"
        if len(words) != 2:
            raise SimulationError(f"{where}: a corner is two numbers, x z in m, not {line!r}.")
        x, z = (_number(word, where, SimulationError) for word in words)
        found.append((x, z))
    return found
