"""Published robots loaded and judged by other engines.

    python -m corpus CLONES --scratch DIR [--only TEXT] [--page corpus/published.md]

in the folder `benchmarks`. CLONES is a folder of clones (``owner/name`` or ``owner+name``); what is
missing there is fetched by git. Needs pinocchio, drake and xacro (`pip install pin drake xacro`).

Every file of `robots.csv` is loaded: planar ones as they are, spatial ones with `projected=True`,
each with the further options of its row. Its mass, mass matrix and bias force at random states are
compared with another engine's reading of the same file. A robot whose axes were turned into the
plane (by less than 1e-3 rad) is compared twice: as `save` writes it, by MuJoCo, and, to what the
turning explains, with the file.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from corpus.clones import Published, extracted, published, row
from corpus.peers import ROOT, MuJoCo, Peer, Refused, peer_of
from heelstrike import dynamics
from heelstrike.errors import HeelstrikeError
from heelstrike.robot import Robot, load_robot

TOLERANCE = 1e-10
STATES = 3
BY_ROUNDING = 1e-9
"""Differences below it are those of axes that leave the plane by less than 1e-6 rad, which counts
as rounding."""

TURNED = "are turned into it"
FORWARD_Y = "so that its y is forward"


@dataclass
class Outcome:
    """What became of one file.

    Attributes
    ----------
    robot : Published
        The file.
    summary : str
        The robot in words, or the reason of its refusal.
    loaded : bool
        Whether it loads.
    engine : str
        Who judged it.
    difference : float
        Largest difference from that engine, as a share of the largest entry; NaN if nobody judged.
    said : str
        What is to be known of the comparison.
    seconds : float
        Processor time to load it.
    """

    robot: Published
    summary: str
    loaded: bool
    engine: str = ""
    difference: float = np.nan
    said: str = ""
    seconds: float = 0.0


def outcome(robot: Published, clones: Path, scratch: Path) -> Outcome:
    """Load a file and have it judged."""
    path = extracted(robot, clones, scratch / "files")
    options: dict[str, Any] = robot.how()
    start = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            loaded = load_robot(path, **options)
        except HeelstrikeError as error:
            words = str(error).replace(str(path), path.name)
            for folder in (path.resolve().parent, scratch.resolve(), scratch):
                words = words.replace(f"{folder}{os.sep}", "")
            return Outcome(robot, words, loaded=False)
    seconds = time.process_time() - start
    remarks = [str(one.message) for one in caught]
    result = Outcome(robot, _words(loaded), loaded=True, seconds=seconds)
    forward = np.array([0.0, 1.0, 0.0] if _any(remarks, FORWARD_Y) else [1.0, 0.0, 0.0])
    try:
        floating = ROOT[0] in loaded.joint_names
        peer = peer_of(path, _text(path, options), forward, floating)
        result.engine, result.difference = peer.name, difference(loaded, peer)
    except (Refused, ElementTree.ParseError) as refused:
        result.said = " ".join(str(refused).split())[:160]
    turned = _any(remarks, TURNED) or TOLERANCE < result.difference < BY_ROUNDING
    if turned or np.isnan(result.difference):
        saved = loaded.save(scratch / "saved.xml")
        if not np.isnan(result.difference):
            result.said = f"turned into the plane; as the file has it {result.difference:.1g}"
        result.engine = "MuJoCo, of the saved file"
        result.difference = difference(loaded, MuJoCo(saved, np.array([1.0, 0.0, 0.0])))
    return result


def difference(robot: Robot, peer: Peer) -> float:
    """Largest difference of mass, mass matrix and bias force, relative to the largest entries."""
    random = np.random.default_rng(7)
    worst = 0.0
    if ROOT[0] in robot.joint_names:  # else what is locked may be fixed to the world
        worst = abs(robot.total_mass - peer.mass) / max(peer.mass, 1e-12)
    for _ in range(STATES):
        q = robot.model.reference + 0.3 * random.normal(size=robot.nq)
        v = random.normal(size=robot.nv)
        names = robot.joint_names
        mass, bias = peer.along(
            dict(zip(names, q.tolist(), strict=True)), dict(zip(names, v.tolist(), strict=True))
        )
        ours = dynamics.mass_matrix(robot, q) - np.diag(robot.model.armature)
        theirs = (mass, bias)
        for mine, other in zip((ours, dynamics.bias_force(robot, q, v)), theirs, strict=True):
            size = max(float(np.abs(other).max()), 1e-12)
            worst = max(worst, float(np.abs(mine - other).max()) / size)
    return worst


def _text(path: Path, options: dict[str, Any]) -> str:
    if "xacro" not in options:
        return path.read_text(encoding="utf-8", errors="replace")
    from heelstrike.robot.files.ros.xacro import expanded  # the same macros, by the package xacro

    given = options["xacro"]
    return expanded(path, given if isinstance(given, dict) else {}, (), str(path))


def _words(robot: Robot) -> str:
    return (
        f"{robot.nv} coordinates, {robot.nu} motors, {robot.nc} contact points, "
        f"{len(robot.feet)} feet, {robot.total_mass:.5g} kg"
        + ("" if robot.mirror is not None else ", no mirror image")
    )


def _any(remarks: list[str], words: str) -> bool:
    return any(words in remark for remark in remarks)


def page(outcomes: list[Outcome]) -> str:
    """Return a page with all outcomes."""
    lines = [
        "# Published robots",
        "",
        "Written by `python -m corpus` in `benchmarks`. Difference: of mass, mass matrix and bias",
        "force at random states from another engine's reading of the same file, as a share of the",
        "largest entry. What one engine alone cannot read is judged as `save` writes it.",
        "",
    ]
    for kind in ("planar", "spatial"):
        these = [each for each in outcomes if each.robot.kind == kind]
        good = [each for each in these if each.loaded]
        judged = [each for each in good if not np.isnan(each.difference)]
        equal = [each for each in judged if each.difference <= TOLERANCE]
        lines += [
            f"## {kind.capitalize()}: {len(good)} of {len(these)} load, {len(equal)} of "
            f"{len(judged)} judged equal to {TOLERANCE:g}",
            "",
            "| file | robot, or why it is refused | judge | difference |",
            "|---|---|---|---|",
        ]
        for each in these:
            words = each.summary if each.loaded else f"**refused**: {each.summary}"
            number = "" if np.isnan(each.difference) else f"{each.difference:.1g}"
            said = f"{each.engine}{'; ' + each.said if each.said else ''}"
            lines.append(row(each.robot.link, words, said, number))
        lines.append("")
    return "\n".join(lines)


def main() -> int:
    """Judge the corpus; return 1 if a robot is not the one of its file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clones", type=Path)
    parser.add_argument("--scratch", type=Path, required=True)
    parser.add_argument("--only", default="")
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    given.scratch.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for robot in published():
        if given.only in f"{robot.repository}/{robot.path}":
            one = outcome(robot, given.clones, given.scratch)
            outcomes.append(one)
            print(
                f"{'ok     ' if one.loaded else 'REFUSED'} {one.difference:8.1g} {one.engine:10} "
                f"{one.seconds:4.1f}s {robot.repository} {robot.path}: {one.summary[:150]} "
                f"{one.said}",
                flush=True,
            )
    if given.page:
        given.page.write_text(page(outcomes), encoding="utf-8")
    return int(any(one.difference > TOLERANCE for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
