"""Campaigns in files: TOML that names robot, law, gait and method, and what differs."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from heelstrike.analysis.stability.trial import Trial
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.experiments.campaigns.campaign import Campaign
from heelstrike.experiments.campaigns.parameters import Draw, Share
from heelstrike.experiments.campaigns.store import about_in, reading, refuse_another
from heelstrike.experiments.campaigns.targets import GROUPS
from heelstrike.experiments.laws import check_law, gait_for, law_called
from heelstrike.gait import Gait, load_gait
from heelstrike.robot import Robot, builtin_robots
from heelstrike.robot.library import load_planar_robot
from heelstrike.sim.method import Method
from heelstrike.wording import meant

WALK: dict[str, Any] = {
    "robot": "bravo7", "controller": "FootstepFeedback", "gait": "", "method": "time-stepping",
    "step": 1e-3, "control_period": 0.0, "friction": 0.75, "restitution": 0.0,
}  # fmt: skip
"""What says how a robot walks, and what it is if nobody says; no gait and no control period are
those that suit the robot and the law."""
WHOLE: dict[str, Any] = {
    "trials": 0, "seed": 0, "draw": Draw.RANDOM.value, "duration": 0.0, "time_limit": 0.0,
}  # fmt: skip
"""What says how the campaign goes; zero is what :class:`~heelstrike.Campaign` has by default."""
TABLES = ("walks", "parameters", "shares")
LARGEST_FILE = 2**20
"""Bytes from which on a file is refused."""

MethodCalled = Callable[[str, float], Method]
"""Takes the name of a method and its step (s)."""


def load_campaign(
    path: str | os.PathLike[str], folder: Path, method_called: MethodCalled
) -> tuple[Campaign, float | None]:
    """Read a campaign.

    Parameters
    ----------
    path : path
        TOML file. Robots and gaits that it names are looked for beside it.
    folder : Path
        Where outcomes will be kept: gaits that are designed are kept there, too.
    method_called : callable
        Makes a method of its name and step.

    Returns
    -------
    campaign : Campaign
    time_limit : float or None
        Seconds of a processor that a trial may take.

    Raises
    ------
    HeelstrikeError
        If there is no such file, or what it says makes no sense; the message has the place.
    """
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise SimulationError(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it TOML?")
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise SimulationError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise SimulationError(f"{path}: not a text file; a campaign is TOML") from error
    return _campaign(text, str(path), file.resolve().parent, folder, method_called)


def kept_campaign(folder: Path, method_called: MethodCalled) -> tuple[Campaign, float | None]:
    """Return the campaign of a folder that was made from a file.

    Raises
    ------
    HeelstrikeError
        If there is none, or it was made in Python.
    """
    with reading(folder) as connection:
        about = about_in(connection)
    if "file" not in about:
        raise SimulationError(
            f"the campaign in {folder} was made in Python, which alone can make it again: "
            "call replay(number) or load(folder) of it there"
        )
    made, limit = _campaign(about["file"], str(folder), Path(about["home"]), folder, method_called)
    with reading(folder) as connection:  # files beside it may have changed since
        refuse_another(connection, made.about, folder)
    return made, limit


def _campaign(
    text: str, where: str, home: Path, folder: Path, method_called: MethodCalled
) -> tuple[Campaign, float | None]:
    try:
        given = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SimulationError(f"{where}: not valid TOML: {error}") from error
    _check_names(given, {*WALK, *WHOLE, *TABLES}, where)
    whole = {name: _kind(given, name, usual, where) for name, usual in WHOLE.items()}
    common = {name: given[name] for name in WALK if name in given}
    walks = given.get("walks", {"": {}})
    if not (isinstance(walks, dict) and all(isinstance(one, dict) for one in walks.values())):
        raise SimulationError(f"{where}: walks are tables, as in [walks.slow]")
    trials = {
        name: _trial(common | one, f"{where}, walk {name!r}" if name else where, home, folder,
                     method_called)
        for name, one in walks.items()
    }  # fmt: skip
    try:
        draw = Draw(whole["draw"])
    except ValueError:
        names = ", ".join(each.value for each in Draw)
        raise SimulationError(f"{where}: draw is one of {names}, not {whole['draw']!r}") from None
    campaign = Campaign(
        trials, _parameters(given, where), whole["trials"] or None, whole["seed"], draw=draw,
        duration=whole["duration"] or None, description={"file": text, "home": str(home)},
    )  # fmt: skip
    return campaign, whole["time_limit"] or None


def _trial(
    given: Mapping[str, Any], where: str, home: Path, folder: Path, method_called: MethodCalled
) -> Trial:
    _check_names(given, set(WALK), where)
    asked = {name: _kind(given, name, usual, where) for name, usual in WALK.items()}
    name = asked["robot"]
    robot = load_planar_robot(name if name in builtin_robots() else home / name)
    law = law_called(asked["controller"])
    check_law(law, robot)
    gait = None if law.stands else _gait(robot, asked["gait"], home, folder)
    try:
        method = method_called(asked["method"], asked["step"])
    except ValueError as error:
        raise SimulationError(f"{where}: {error}") from None
    return replace(
        law.trial(robot, gait), method=method, control_period=asked["control_period"] or None,
        ground=Ground(friction=asked["friction"], restitution=asked["restitution"]),
    )  # fmt: skip


def _gait(robot: Robot, named: str, home: Path, folder: Path) -> Gait:
    """Load the gait that a file names, or the one that was designed before, or design it."""
    if named:
        return load_gait(home / named, robot)
    kept = folder / f"gait-{robot.name}.json"
    if kept.exists():
        return load_gait(kept, robot)
    gait = gait_for(robot)
    folder.mkdir(parents=True, exist_ok=True)
    gait.save(kept)
    return gait


def _parameters(given: Mapping[str, Any], where: str) -> Mapping[str, Any] | list[Share]:
    shares = given.get("shares", [])
    if ("parameters" in given) == bool(shares):
        raise SimulationError(
            f"{where}: say what differs, either in [parameters], or in [[shares]] of weight and "
            "parameters"
        )
    if not shares:
        return _distributions(given["parameters"], f"{where}, parameters")
    if not isinstance(shares, list):
        raise SimulationError(f"{where}: shares are several tables, as in [[shares]]")
    found = []
    for number, share in enumerate(shares, start=1):
        place = f"{where}, share {number}"
        _check_names(share, {"weight", "parameters"}, place)
        if "parameters" not in share:
            raise SimulationError(f"{place}: its parameters are missing")
        weight = _kind(share, "weight", 1.0, place)
        found.append(Share(weight, _distributions(share["parameters"], place)))
    return found


def _distributions(given: Any, where: str) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise SimulationError(f"{where}: parameters are a table of names")
    for group in GROUPS:
        if isinstance(given.get(group), dict):
            number = next(iter(given[group]), "NUMBER")
            raise SimulationError(
                f'{where}: write names of parameters in quotes, as in "{group}.{number}" = 1.0; '
                "without quotes TOML makes a table of a name with a dot"
            )
    return {name: _distribution(each, f"{where}, {name!r}") for name, each in given.items()}


def _distribution(given: Any, where: str) -> Any:
    """Return a number, a list of values, or a distribution of scipy.stats by its name."""
    if not isinstance(given, dict):
        return given
    if len(given) != 1:
        raise SimulationError(
            f"{where}: one distribution by its name, as in {{ uniform = [0.4, 0.9] }}"
        )
    from scipy import stats

    ((name, numbers),) = given.items()
    listed = numbers if isinstance(numbers, list) else []
    named = numbers if isinstance(numbers, dict) else {}
    if not (listed or named):
        raise SimulationError(
            f"{where}: {name} needs its numbers as a list, such as [low, high] of uniform, or as a "
            "table with the names that scipy.stats gives them, such as { loc = 0.4, scale = 0.2 }"
        )
    try:
        if name == "uniform" and listed:
            low, high = listed
            return stats.uniform(low, high - low)
        known = getattr(stats, "norm" if name == "normal" else str(name), None)
        if not isinstance(known, stats.rv_continuous | stats.rv_discrete):
            guess = meant(name, {each: repr(each) for each in ("uniform", "normal", "truncnorm")})
            raise SimulationError(f"{where}: scipy.stats has no distribution {name!r}.{guess}")
        made = known(*listed, **named)
        if not made.ppf(0.5) == made.ppf(0.5):
            raise ValueError(f"{numbers} are no numbers that it can have")
    except SimulationError:
        raise
    except (TypeError, ValueError) as error:
        raise SimulationError(f"{where}: {name}: {error}") from None
    return made


def _check_names(given: Any, known: set[str], where: str) -> None:
    if not isinstance(given, dict):
        raise SimulationError(f"{where}: must be a table, got {given!r}")
    for name in given:
        if name not in known:
            guess = meant(name, {each: repr(each) for each in known})
            raise SimulationError(
                f"{where}: there is no {name!r}.{guess} There are {', '.join(sorted(known))}"
            )


def _kind(given: Mapping[str, Any], name: str, usual: Any, where: str) -> Any:
    value = given.get(name, usual)
    wanted = (int, float) if isinstance(usual, float) else type(usual)
    if not isinstance(value, wanted) or isinstance(value, bool):
        words = {str: "a text", int: "a whole number", float: "a number"}[type(usual)]
        raise SimulationError(f"{where}: {name} is {words}, got {value!r}")
    return value
