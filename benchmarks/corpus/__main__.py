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

import sys
import time
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from corpus.clones import Published, extracted
from corpus.judging import HEAD, Outcome, counts, judge_all, refused, share, shortened, text_of
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
            return refused(robot, error, path, scratch)
    seconds = time.process_time() - start
    remarks = [str(one.message) for one in caught]
    result = Outcome(robot, _words(loaded), loaded=True, seconds=seconds)
    forward = np.array([0.0, 1.0, 0.0] if _any(remarks, FORWARD_Y) else [1.0, 0.0, 0.0])
    try:
        floating = ROOT[0] in loaded.joint_names
        peer = peer_of(path, text_of(path, options), forward, floating)
        result.engine, result.difference = peer.name, difference(loaded, peer)
    except (Refused, ElementTree.ParseError) as reason:
        result.said = shortened(reason)
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
        worst = share(robot.total_mass, peer.mass)
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
            worst = max(worst, share(mine, other))
    return worst


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
        loaded, judged, equal = counts(these, TOLERANCE)
        lines += [
            f"## {kind.capitalize()}: {loaded} of {len(these)} load, {equal} of {judged} judged "
            f"equal to {TOLERANCE:g}",
            "",
            *HEAD,
        ]
        for each in these:
            lines.append(each.line(f"{each.engine}{'; ' + each.said if each.said else ''}"))
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(judge_all(__doc__, outcome, page, TOLERANCE))
