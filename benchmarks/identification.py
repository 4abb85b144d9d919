"""How often the intervals of identified numbers hold, and how near friction comes.

    python benchmarks/identification.py cover --seeds 100 --first 60000

bravo7 walks its reference gait under computed torque, event-driven, and its encoders, torques and
forces are measured with noise of 1e-4 rad, 0.2 N m and 2 N (standard deviations), again in each
seed. The robot that is identified starts from a file whose masses, centres and inertias are wrong
by up to 20 %. Prints of each base parameter how often its interval held.

    python benchmarks/identification.py slip --seeds 50

lets it walk on ground on which it slips, and on ground on which it does not.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import walking

import heelstrike as hs
from heelstrike.experiments.identification import identify
from heelstrike.gait.recordings.robot_log import RobotLog

ENCODER, TORQUE, FORCE = 1e-4, 0.2, 2.0
"""Noise: rad, N m, N."""
WRONG = 0.2
"""By how much the file is wrong."""


def walk(steps: int, rate: float, friction: float = walking.FRICTION) -> hs.Run:
    """Walk the reference gait."""
    return hs.simulate(
        walking.bravo7(), hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state, duration=steps * walking.STEP_DURATION,
        method=hs.EventDriven(output_period=1.0 / rate), ground=hs.Ground(friction=friction),
    )  # fmt: skip


def evenly(run: hs.Run, rate: float) -> RobotLog:
    """Return the rows at whole samples: those of events are left out."""
    log = RobotLog.of(run)
    rows = np.abs(log.time * rate - np.round(log.time * rate)) < 1e-6
    assert log.force is not None
    assert log.trunk is not None
    return RobotLog(log.time[rows], log.joints[rows], log.torque[rows], log.force[rows],
                    log.trunk[rows])  # fmt: skip


def noisy(log: RobotLog, seed: int, *, forces: bool = True) -> RobotLog:
    """Measure with noise."""
    rng = np.random.default_rng(seed)
    assert log.force is not None
    assert log.trunk is not None
    return RobotLog(
        log.time,
        log.joints + ENCODER * rng.standard_normal(log.joints.shape),
        log.torque + TORQUE * rng.standard_normal(log.torque.shape),
        log.force + FORCE * rng.standard_normal(log.force.shape) if forces else None,
        log.trunk + ENCODER * rng.standard_normal(log.trunk.shape),
    )


def wrong_file(seed: int = 0) -> hs.Robot:
    """Return bravo7 as a file has it that nobody has measured."""
    robot, rng = walking.bravo7(), np.random.default_rng(seed)
    model = robot.model
    numbers = {
        name: each * rng.uniform(1.0 - WRONG, 1.0 + WRONG, each.shape)
        for name, each in model.members().items()
        if name in ("mass", "center_of_mass", "inertia")
    }
    return replace(robot, model=model.replaced(**numbers))


def cover(seeds: int, first: int, steps: int, rate: float, *, forces: bool) -> None:
    """Print how often intervals held."""
    log, robot = evenly(walk(steps, rate), rate), wrong_file()
    truth = identify(walking.bravo7(), noisy(log, first, forces=forces), encoder_noise=ENCODER,
                     torque_noise=TORQUE, force_noise=FORCE)  # fmt: skip
    true = np.array([each.assumed for each in truth.numbers])
    errors, misfits, told, begin = [], [], np.zeros(len(true)), time.perf_counter()
    for seed in range(first, first + seeds):
        found = identify(robot, noisy(log, seed, forces=forces), encoder_noise=ENCODER,
                         torque_noise=TORQUE, force_noise=FORCE)  # fmt: skip
        assert [each.name for each in found.numbers] == [each.name for each in truth.numbers]
        errors.append([(each.value - t) / each.deviation
                       for each, t in zip(found.numbers, true, strict=True)])  # fmt: skip
        misfits.append(found.misfit)
        told += [each.told for each in found.numbers]
    z = np.array(errors)
    held = 100.0 * np.mean(np.abs(z) < 1.959964, axis=0)
    for k, each in enumerate(found.numbers):
        print(
            f"{held[k]:6.2f} %  mean {z[:, k].mean():+.2f} spread {z[:, k].std():.3f}  "
            f"{each.value:.4g} ± {1.96 * each.deviation:.2g} {each.unit}  {each.name}"
            + ("" if told[k] > 0.5 * seeds else ", hardly told")
        )
    held = held[told > 0.5 * seeds]
    print(
        f"{held.min():.2f} to {held.max():.2f} % of {seeds} seeds, of numbers that are told; mean "
        f"square of errors {np.mean(misfits):.4f} of what the noise explains; "
        f"{(time.perf_counter() - begin) / seeds:.2f} s a seed"
    )


def slip(seeds: int, first: int, steps: int, rate: float, slippery: float) -> None:
    """Print what is told of the ground."""
    for friction in (slippery, walking.FRICTION):
        run = walk(steps, rate, friction)
        log = evenly(run, rate)
        told = [
            identify(walking.bravo7(), noisy(log, seed), encoder_noise=ENCODER,
                     torque_noise=TORQUE, force_noise=FORCE).friction
            for seed in range(first, first + seeds)
        ]  # fmt: skip
        values = np.array([each.value for each in told])
        print(f"friction {friction}: {run.status.value}, {told[0]}")
        if told[0].samples:
            worst = 100.0 * np.abs(values / friction - 1.0).max()
            half = 1.96 * np.array([each.deviation for each in told])
            held = np.mean(np.abs(values - friction) < half)
            print(f"    {seeds} seeds: off by {worst:.2f} % at most, intervals held in {held:.0%}")


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("cover", "slip"))
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steps", type=int, default=4)
    parser.add_argument("--rate", type=float, default=125.0)
    parser.add_argument("--no-forces", action="store_true", help="forces are not measured")
    parser.add_argument("--slippery", type=float, default=0.2, help="friction of poor ground")
    options = parser.parse_args()
    if options.what == "cover":
        cover(options.seeds, options.first, options.steps, options.rate,
              forces=not options.no_forces)  # fmt: skip
    else:
        slip(options.seeds, options.first, options.steps, options.rate, options.slippery)


if __name__ == "__main__":
    main()
