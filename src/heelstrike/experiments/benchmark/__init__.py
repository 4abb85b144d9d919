"""How fast heelstrike is, beside other engines in the same run; ``heelstrike bench``."""

from heelstrike.experiments.benchmark.suite import PARTS, Benchmark, run_benchmark

__all__ = ["PARTS", "Benchmark", "run_benchmark"]
