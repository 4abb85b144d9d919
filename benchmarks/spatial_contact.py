"""Random contact problems in space, before a judge with sixty digits.

The problems are described in tests/contact/spatial/spatial_problems.py: all of them have a
solution. A certified answer is false if its natural map, computed from the original data by other
code, exceeds the tolerance. With ``--siconos FOLDER`` the files of Siconos'
``numerics/src/FrictionContact/test/data`` that have three dimensions and at most ``--contacts``
contacts are solved as well; with ``--peers PYTHON`` a Python that has Siconos' package solves the
same random problems by its NSN_AC and NSGS, before the same judge.

Run: python benchmarks/spatial_contact.py [--number 10000] [--seed 0] [--json]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.contact import solve_contact

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "contact" / "spatial"))

from spatial_oracle import natural_map
from spatial_problems import random_spatial_problem

TOLERANCE = 1e-9


def campaign(number: int, seed: int) -> dict[str, Any]:
    """Solve random problems, judge each answer, and count."""
    ways: Counter[str] = Counter()
    unsolved: list[int] = []
    false = judged_worst = 0
    times = []
    first = random_spatial_problem(np.random.default_rng([seed, 0]))
    solve_contact(first.delassus, first.free, first.friction, dimension=3)
    for place in range(number):
        problem = random_spatial_problem(np.random.default_rng([seed, place]))
        begin = time.perf_counter()
        solution = solve_contact(problem.delassus, problem.free, problem.friction, dimension=3)
        times.append(time.perf_counter() - begin)
        if not solution.certificate.valid:
            unsolved.append(place)
            continue
        ways[solution.certificate.solver.value] += 1
        judged = natural_map(
            problem.delassus, problem.free, problem.friction, solution.impulse.ravel()
        )
        judged_worst = max(judged_worst, judged)
        false += judged > TOLERANCE
    spent = np.array(times)
    return {
        "problems": number,
        "certified": number - len(unsolved),
        "false": false,
        "worst natural map by the judge": judged_worst,
        "ways": dict(ways),
        "unsolved": unsolved[:50],
        "microseconds: median, 99 %, mean, most": [
            round(1e6 * float(each), 1)
            for each in (np.median(spent), np.quantile(spent, 0.99), spent.mean(), spent.max())
        ],
    }


def read_siconos(path: Path) -> tuple[int, Any, Any, Any]:
    """Return dimension, matrix, free term and friction of a file of Siconos' collection."""
    words = path.read_text(encoding="utf-8").split()
    dimension, contacts, storage, rows, columns = (int(word) for word in words[:5])
    size = dimension * contacts
    if (rows, columns) != (size, size):
        raise ValueError("another kind of problem: its matrix is not one of contacts")
    if storage == 0:
        values = np.array(words[7 : 7 + size * size], dtype=float)  # the size is told twice
        matrix = values.reshape(size, size).T
        rest = words[7 + size * size :]
    elif storage == 1:
        matrix, rest = read_blocks(words[5:], size)
    else:
        raise ValueError(f"stored in another way ({storage})")
    free = np.array(rest[:size], dtype=float)
    friction = np.array(rest[size : size + contacts], dtype=float)
    return dimension, 0.5 * (matrix + matrix.T), free, friction


def read_blocks(words: list[str], size: int) -> tuple[Any, list[str]]:
    """Return a matrix that is stored block by block, and the words after it."""
    _, high, wide = (int(word) for word in words[:3])
    place = 3
    ends, words_of = [], [high, wide]
    for number in words_of:
        ends.append([0, *(int(word) for word in words[place : place + number])])
        place += number
    begins, filled = int(words[place]), int(words[place + 1])
    place += 2
    first = [int(word) for word in words[place : place + begins]]
    place += begins
    column = [int(word) for word in words[place : place + filled]]
    place += filled
    matrix = np.zeros((size, size))
    for row in range(begins - 1):
        for block in range(first[row], first[row + 1]):
            rows = slice(ends[0][row], ends[0][row + 1])
            columns = slice(ends[1][column[block]], ends[1][column[block] + 1])
            shape = (columns.stop - columns.start, rows.stop - rows.start)
            count = shape[0] * shape[1]
            values = np.array(words[place + 1 : place + 1 + count], dtype=float)
            matrix[rows, columns] = values.reshape(shape).T
            place += 1 + count  # each is numbered
    return matrix, words[place:]


def collection(folder: Path, contacts: int) -> list[dict[str, Any]]:
    """Solve the files of a folder that have three dimensions."""
    found = []
    for path in sorted(folder.glob("*.dat")):
        try:
            dimension, matrix, free, friction = read_siconos(path)
        except (ValueError, IndexError, UnicodeDecodeError) as error:
            found.append({"file": path.name, "left out": str(error)[:80]})
            continue
        if dimension != 3 or friction.size > contacts:
            continue
        begin = time.perf_counter()
        solution = solve_contact(matrix, free, friction, dimension=3)
        spent = time.perf_counter() - begin
        judged = natural_map(matrix, free, friction, solution.impulse.ravel())
        found.append(
            {
                "file": path.name,
                "contacts": friction.size,
                "certified": solution.certificate.valid,
                "way": solution.certificate.solver.value,
                "status": solution.certificate.status.name,
                "judge": judged,
                "seconds": round(spent, 5),
            }
        )
    return found


def beside(python: str, number: int, seed: int) -> dict[str, Any]:
    """Send random problems through Siconos, in a Python that has it; judge its answers and ours."""
    problems = [random_spatial_problem(np.random.default_rng([seed, k])) for k in range(number)]
    script = Path(__file__).with_name("spatial_contact_siconos.py")
    with tempfile.TemporaryDirectory() as folder:
        given, answers = Path(folder) / "problems.npz", Path(folder) / "answers.npz"
        np.savez(
            given,
            count=np.array([p.count for p in problems]),
            delassus=np.concatenate([p.delassus.ravel() for p in problems]),
            free=np.concatenate([p.free for p in problems]),
            friction=np.concatenate([p.friction for p in problems]),
        )
        subprocess.run([python, str(script), str(given), str(answers)], check=True)
        found = dict(np.load(answers))
    ours, spent = [], []
    for p in problems:
        begin = time.perf_counter()
        ours.append(solve_contact(p.delassus, p.free, p.friction, dimension=3).impulse.ravel())
        spent.append(time.perf_counter() - begin)
    found["heelstrike impulse"] = np.concatenate(ours)
    found["heelstrike seconds"] = np.array(spent)
    result = {}
    for name in ("heelstrike", "NSN_AC", "NSGS"):
        ends = np.cumsum([3 * p.count for p in problems])
        parts = np.split(found[f"{name} impulse"], ends[:-1])
        judged = np.array(
            [
                natural_map(p.delassus, p.free, p.friction, impulse)
                for p, impulse in zip(problems, parts, strict=True)
            ]
        )
        seconds = found[f"{name} seconds"]
        result[name] = {
            f"share at {limit:g}": float(np.mean(judged <= limit)) for limit in (1e-10, 1e-9, 1e-6)
        } | {
            "median us": round(1e6 * float(np.median(seconds))),
            "mean us": round(1e6 * float(seconds.mean())),
        }
    return result


def main() -> None:
    """Print what came out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--number", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--siconos", type=Path)
    parser.add_argument("--contacts", type=int, default=110)
    parser.add_argument("--peers", help="a Python with the package of Siconos")
    parser.add_argument("--peer-number", type=int, default=500)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    result: dict[str, Any] = {}
    if options.number:
        result["random"] = campaign(options.number, options.seed)
    if options.siconos:
        result["siconos"] = collection(options.siconos, options.contacts)
    if options.peers:
        result["beside Siconos"] = beside(options.peers, options.peer_number, options.seed)
    if options.json:
        print(json.dumps(result, indent=1))
        return
    for name, value in result.get("random", {}).items():
        print(f"{name}: {value}")
    for each in result.get("siconos", []):
        print(each)
    for name, value in result.get("beside Siconos", {}).items():
        print(f"{name}: {value}")


if __name__ == "__main__":
    main()
