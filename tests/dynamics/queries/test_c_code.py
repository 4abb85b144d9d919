"""The equations of motion as C: a compiler of C makes of them what Numba makes of the kernels."""

from __future__ import annotations

import ctypes
import dataclasses
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mechanisms import geared, parallel_ankles
from robot_cases import NAMED, RobotCase

from heelstrike import load_robot
from heelstrike.compiler.recordings.c_text import c_text
from heelstrike.compiler.recordings.recording import Program, Recording
from heelstrike.dynamics import (
    kernels,
    loop_bias_acceleration,
    loop_displacement,
    loop_jacobian,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot import Robot

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")

# Both sides do the same operations in another order; sines come from two libraries. What is
# solved for is as much less certain as the mass matrix is ill-conditioned.
RELATIVE = 1e-14


def compiled(page: str, folder: Path) -> ctypes.CDLL:
    (folder / "page.c").write_text(page, encoding="utf-8")
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        [str(COMPILER), *strict, "-O1", "-shared", "-fPIC", "-o", "page.so", "page.c", "-lm"],
        cwd=folder,
        check=True,
    )
    return ctypes.CDLL(str(folder / "page.so"))


def called(function: Callable[..., Any], *arrays: np.ndarray) -> None:
    function(*(ctypes.c_void_p(array.ctypes.data) for array in arrays))


def by_kernels(robot: Robot, q: Any, v: Any, force: Any) -> dict[str, Any]:
    n = robot.nv
    work = Workspace.allocate(robot.model.extents)
    matrix, factor = np.zeros((n, n)), np.zeros((n, n))
    bias, acceleration = np.zeros(n), np.zeros(n)
    kernels.forward_kinematics(robot.model, q, work)
    kernels.link_velocities(robot.model, v, work)
    kernels.bias_force(robot.model, work, bias)
    kernels.forward_dynamics(robot.model, force, work, matrix, factor, acceleration)
    return {
        "angle": work.angle, "origin": work.origin, "matrix": matrix, "bias": bias,
        "acceleration": acceleration,
    }  # fmt: skip


def by_c(robot: Robot, library: ctypes.CDLL, q: Any, v: Any, force: Any) -> dict[str, Any]:
    n = robot.nv
    found = {
        "angle": np.full(n, np.nan), "origin": np.full((n, 2), np.nan),
        "matrix": np.full((n, n), np.nan), "bias": np.full(n, np.nan),
        "acceleration": np.full(n, np.nan),
    }  # fmt: skip
    called(library.robot_kinematics, q, found["angle"], found["origin"])
    called(library.robot_mass_matrix, q, found["matrix"])
    called(library.robot_bias_force, q, v, found["bias"])
    called(library.robot_solve, q, v, force, found["acceleration"])
    return found


@needs_compiler
@pytest.mark.parametrize("case", NAMED, ids=lambda case: case.name)
def test_c_computes_what_the_kernels_compute(case: RobotCase, tmp_path: Path) -> None:
    robot = case.robot()
    library = compiled(robot.c_code("robot"), tmp_path)
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = robot.model.reference + rng.uniform(-1.0, 1.0, robot.nv)
        v, force = rng.uniform(-3.0, 3.0, robot.nv), rng.uniform(-50.0, 50.0, robot.nv)
        expected, found = by_kernels(robot, q, v, force), by_c(robot, library, q, v, force)
        certain = np.linalg.cond(expected["matrix"])
        for name, value in expected.items():
            size = np.abs(value).max()
            tolerance = RELATIVE * size
            if name == "acceleration":
                tolerance = max(tolerance, np.finfo(float).eps * certain * size)
            np.testing.assert_allclose(found[name], value, rtol=0.0, atol=tolerance, err_msg=name)


@needs_compiler
def test_output_may_take_the_place_of_input(tmp_path: Path) -> None:
    robot = load_robot("bravo7")
    library = compiled(robot.c_code(), tmp_path)
    q, v, force = robot.model.reference, np.ones(robot.nv), np.arange(float(robot.nv))
    expected = by_kernels(robot, q, v, force)["acceleration"]
    called(library.bravo7_solve, q, v, force, force)
    np.testing.assert_allclose(force, expected, rtol=1e-12)


@needs_compiler
def test_names_cannot_break_the_page(tmp_path: Path) -> None:
    """Names come from files that anybody has written."""
    robot = load_robot("bravo7")
    evil = "1*/ int main(void) { return 1; } /* {0} %s"
    named = dataclasses.replace(robot, name=evil, joint_names=(evil,) * robot.nv)
    page = named.c_code()
    library = compiled(page, tmp_path)
    assert not hasattr(library, "main")
    assert page.count("void _1") == 4


@needs_compiler
@pytest.mark.parametrize("make", [parallel_ankles, geared])
def test_equations_of_loops_are_a_function(make: Callable[[], Robot], tmp_path: Path) -> None:
    robot = make()
    library = compiled(robot.c_code("robot"), tmp_path)
    rng = np.random.default_rng(4)
    q, v = rng.uniform(-1.0, 1.0, robot.nv), rng.uniform(-3.0, 3.0, robot.nv)
    expected = [loop_displacement(robot, q), loop_jacobian(robot, q)]
    expected.append(loop_bias_acceleration(robot, q, v))
    found = [np.full(each.shape, np.nan) for each in expected]
    called(library.robot_loops, q, v, *found)
    for mine, its in zip(found, expected, strict=True):
        np.testing.assert_allclose(mine, its, rtol=0, atol=1e-13 * max(1.0, np.abs(its).max()))
    force = rng.uniform(-5.0, 5.0, robot.nv)
    for name, value in by_kernels(robot, q, v, force).items():
        its = by_c(robot, library, q, v, force)[name]
        np.testing.assert_allclose(its, value, rtol=1e-9, atol=1e-9 * np.abs(value).max())


def test_a_kernel_that_reads_what_nobody_wrote_is_refused() -> None:
    def early(model: Any, scratch: np.ndarray, out: np.ndarray) -> None:
        out[0] = scratch[0] + model.mass[0]

    program = Program(
        early,
        {"model": load_robot("bravo7").model, "scratch": np.zeros(1), "out": np.zeros(1)},
        scratch=("scratch",),
    )
    with pytest.raises(ValueError, match="early reads scratch"):
        c_text([Recording(program)], ["words"], prefix="x", head="head")
