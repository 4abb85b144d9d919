"""Measured tosses of a cube, foretold by heelstrike and other engines.

    git clone https://github.com/DAIRLab/contact-nets
    python benchmarks/tosses contact-nets/data/tosses_processed
    python benchmarks/tosses FOLDER --engines heelstrike mujoco drake bullet --draws 1

FOLDER holds the 570 tosses that S. Pfrommer, M. Halm and M. Posa measured (*ContactNets: Learning
Discontinuous Contact Dynamics with Smooth, Implicit Representations*, CoRL 2020; BSD-3). They are
not part of this project. Their files are read without PyTorch, and nothing in them is run.

Each engine's friction and bounce are fitted to 48 tosses that are drawn, from a common grid on by
the same search. It then rolls the other 522 out freely, from their first sample to their last.
What counts is the distance of the cube's centre from where it was measured, over its width of
104.8 mm: the mean over the samples of a toss, then over the tosses. The velocities of the files
are differences of positions, half a sample old; they are taken as they are, by every engine.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

# Run as a folder, its modules would be on the path and not the package.
sys.path[0] = str(Path(__file__).resolve().parent.parent)

from tosses.engines import ENGINES, SUBSTEPS, Heelstrike  # noqa: E402
from tosses.fitting import drawn, errors, fitted  # noqa: E402
from tosses.reading import RefusedError, read_tosses  # noqa: E402


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=["heelstrike", "mujoco"])
    parser.add_argument("--fit", type=int, default=48, help="how many tosses are fitted")
    parser.add_argument("--draws", type=int, default=3, help="how often they are drawn")
    parser.add_argument("--evaluations", type=int, default=40)
    options = parser.parse_args()
    try:
        tosses = read_tosses(options.folder)
    except RefusedError as error:
        sys.exit(str(error))
    print(f"{len(tosses)} tosses, {np.mean([len(each.position) for each in tosses]):.0f} samples "
          f"each on average, {SUBSTEPS} steps a sample")  # fmt: skip
    for name in options.engines:
        engine = ENGINES[name]()
        for seed in range(options.draws):
            begin = time.process_time()
            chosen, rest = drawn(len(tosses), options.fit, seed)
            numbers = fitted(engine, [tosses[i] for i in chosen], options.evaluations)
            others = [tosses[i] for i in rest]
            found = 100.0 * errors(others, engine.thrown(others, numbers))
            low, middle, high = np.quantile(found, [0.1, 0.5, 0.9])
            by = ", ".join(
                f"{what} {value:.4g}" for what, value in zip(engine.names, numbers, strict=True)
            )
            print(
                f"{name}, draw {seed}: {found.mean():.2f} % of the width "
                f"(standard error {found.std() / np.sqrt(len(found)):.2f}; median {middle:.1f}, "
                f"10 to 90 % of the {len(found)} tosses {low:.1f} to {high:.1f}); {by}; "
                f"{time.process_time() - begin:.0f} s of processor",
                flush=True,
            )
        if isinstance(engine, Heelstrike):
            print(f"  {engine.steps} steps, {engine.uncertified} not certified to 1e-9")


if __name__ == "__main__":
    main()
