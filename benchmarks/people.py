"""People: how near the nearest gaits are, and what the second recording tells.

Run, from the top folder::

    python benchmarks/people.py                    # Winter's recording, for its person and bravo7
    python benchmarks/people.py FOLDER             # and Gait10dof18musc's, which is not shipped

FOLDER holds ``subject01_walk_IK.mot`` of opensim-org/opensim-models,
``Pipelines/Gait10dof18musc/OutputReference/IK``. The recording has no licence: it is fetched by who
wants it, and lies outside this folder. Nothing is fetched here.

For each it prints the distance of the gait from the person, what its equations lack, how many of 20
steps it is walked, and the processor time of all that.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import heelstrike as hs

SECOND = "subject01_walk_IK.mot"
MASS, SPEED = 72.6, 1.2
"""Mass (kg) of the person of the second recording, and the speed (m/s) of the treadmill."""


def row(what: str, path: str | Path, **asked: object) -> str:
    """Mimic a recording; return its row of the table."""
    begin = time.process_time()
    try:
        found = hs.mimic(path, **asked)  # type: ignore[arg-type]
    except hs.GaitError as error:
        return f"| {what} | {error} | | | |"
    spent = time.process_time() - begin
    nearest, walk = found.nearest, found.walk
    return (
        f"| {what} | {nearest.distance:.2f} | {nearest.residual:.1e} | {walk.steps} of "
        f"{walk.asked} | {spent:.0f} |"
    )


def main() -> None:
    """Print the table."""
    print("| recording, robot | distance (deg rms) | residual (N) | steps | time (s) |")
    print("|---|---|---|---|---|")
    print(row("Winter, the person", "winter"), flush=True)
    print(row("Winter, bravo7", "winter", robot=hs.load_robot("bravo7")), flush=True)
    for folder in sys.argv[1:2]:
        path = Path(folder) / SECOND
        if not path.is_file():
            sys.exit(f"{path}: no such file; the beginning of this program says where it is from")
        print(row("subject01, the person", path, mass=MASS, speed=SPEED), flush=True)


if __name__ == "__main__":
    main()
