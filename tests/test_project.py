"""The project as a whole: its public names, what importing it costs, how its packages depend."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import tomllib
import traceback
from pathlib import Path

import pytest

import heelstrike
from heelstrike import errors

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "heelstrike"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# Absent on at least one of Linux, macOS and Windows.
PLATFORM_MODULES = {
    "_winapi",
    "crypt",
    "fcntl",
    "grp",
    "msvcrt",
    "nis",
    "posix",
    "pty",
    "pwd",
    "resource",
    "spwd",
    "syslog",
    "termios",
    "tty",
    "winreg",
    "winsound",
}
HEAVY = {
    "casadi",
    "h5netcdf",
    "matplotlib",
    "mujoco",
    "numba",
    "pandas",
    "scipy",
    "viser",
    "websockets",
    "xarray",
}


def test_public_names_resolve_and_are_documented() -> None:
    for name, home in heelstrike._HOME.items():
        value = getattr(heelstrike, name)
        assert value is getattr(importlib.import_module(home), name), name
        assert inspect.getdoc(value), name
        assert name in dir(heelstrike)


def test_type_checkers_see_the_same_names_in_the_same_homes() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    seen = {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    assert seen == heelstrike._HOME


def test_every_error_is_public() -> None:
    raised = {
        name
        for name, value in inspect.getmembers(errors, inspect.isclass)
        if issubclass(value, errors.HeelstrikeError)
    }
    assert raised == {name for name, home in heelstrike._HOME.items() if home == errors.__name__}


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("TimeSteping", "TimeStepping"),
        ("load_robots", "load_robot"),
        ("optimise_gait", "optimize_gait"),
        ("event_driven", "EventDriven"),
    ],
)
def test_a_misspelt_name_suggests_the_nearest(wrong: str, right: str) -> None:
    words = f"has no attribute '{wrong}'. Did you mean '{right}'?"
    with pytest.raises(AttributeError, match=re.escape(words)) as caught:
        getattr(heelstrike, wrong)
    shown = "".join(traceback.format_exception(caught.value))
    assert shown.count("Did you mean") == 1  # Python guesses, too


def test_a_name_like_no_other_suggests_nothing() -> None:
    with pytest.raises(AttributeError, match=r"has no attribute 'xyzzy'$"):
        heelstrike.xyzzy  # noqa: B018
    assert not hasattr(heelstrike, "_timestepping")


def test_only_public_names_are_listed() -> None:
    importlib.import_module("heelstrike.sim")  # which becomes an attribute of the package
    listed = {name for name in dir(heelstrike) if not name.startswith("__")}
    assert listed == set(heelstrike._HOME)


def test_importing_heelstrike_loads_nothing_heavy() -> None:
    # A fresh interpreter: this one has loaded everything already.
    script = "import heelstrike, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout.split()
    assert "heelstrike" in loaded
    assert HEAVY.isdisjoint(loaded)


def test_programs_beside_the_package_import_what_there_is() -> None:
    """Most need other engines, or minutes, so that no test runs them."""
    lost = []
    for source in sorted([*(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("heelstrike"):
                lost += [
                    f"{source.relative_to(ROOT)}: {node.module}.{each.name}"
                    for each in node.names
                    if not there(f"{node.module}.{each.name}")
                ]
    assert lost == []


def there(name: str) -> bool:
    """Whether a name, or module, can be imported where the packages that it needs are installed."""
    try:
        pkgutil.resolve_name(name)
    except (ImportError, AttributeError) as error:
        return (getattr(error, "name", None) or "heelstrike").split(".")[0] != "heelstrike"
    except heelstrike.HeelstrikeError:  # which says what to install
        return True
    return True


def test_simulations_begin_without_what_takes_long_to_import() -> None:
    """The stock laws, gaits and the built-in robots among them: at every start."""
    script = (
        "import heelstrike as hs, sys; hs.load_robot('bravo7'); hs.Simulation, hs.ComputedTorque\n"
        "slow = 'scipy.linalg scipy.signal scipy.integrate scipy.interpolate scipy.optimize '\n"
        "slow += 'xml.etree.ElementTree mujoco xarray h5netcdf'\n"
        "print(*(each for each in slow.split() if each in sys.modules))"
    )
    heelstrike.load_robot("bravo7")  # kept from now on: to read it takes all that reads files
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert told.stdout == "\n"


def test_planar_runs_and_their_summaries_do_not_load_space() -> None:
    """But for what tells robots in space from others."""
    script = (
        "import heelstrike as hs, sys; robot = hs.load_robot('compass_gait')\n"
        "run = hs.simulate(robot, state=robot.reference_state(), duration=0.01); run.summary()\n"
        "space = 'heelstrike.sim.spatial', 'heelstrike.analysis.spatial', "
        "'heelstrike.contact.spatial'\n"
        "print(*(each for each in sys.modules if each.startswith(space)))"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert told.stdout == "\n"


def test_no_module_needs_one_operating_system() -> None:
    """But where it does without what is not there."""
    needed = {str(source.relative_to(PACKAGE)): needs(source) for source in SOURCES}
    assert {name: found for name, found in needed.items() if found} == {}


def needs(source: Path) -> set[str]:
    """Return the modules of one operating system that a file imports without trying."""
    imported: set[str] = set()
    nodes = list(ast.walk(ast.parse(source.read_text(encoding="utf-8"))))
    tried = {
        id(statement)
        for node in nodes
        if isinstance(node, ast.Try)
        and any("ImportError" in ast.unparse(each.type) for each in node.handlers if each.type)
        for statement in node.body
    }
    for node in nodes:
        if id(node) in tried:
            continue
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            imported.add(node.module.split(".")[0])
    return imported & PLATFORM_MODULES


def test_every_package_has_its_layer() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers, room = project["tool"]["importlinter"]["contracts"]
    names = [name.strip() for layer in layers["layers"] for name in layer.split("|")]
    names += layers["exhaustive_ignores"]
    assert set(names) == {module.name for module in pkgutil.iter_modules([str(PACKAGE)])}
    above = names[: names.index("compiler")]
    assert room["source_modules"] == [f"heelstrike.{name}" for name in above]


def test_the_source_package_carries_what_readme_and_docs_name() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    carried = project["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\((?!https?:|#|mailto:)([^)#]+)", text):
            named = (page.parent / target).resolve()
            assert named.exists(), f"{page.name}: {target}"
            assert named.relative_to(ROOT).parts[0] in carried, f"{page.name}: {target}"
    if "make " in (ROOT / "README.md").read_text(encoding="utf-8"):
        assert {"Makefile", "constraints.txt"} <= set(carried)
