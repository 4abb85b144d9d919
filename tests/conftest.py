"""Settings that hold for every test."""

from __future__ import annotations

import hashlib
import os
import platform
import signal
import tempfile
from collections.abc import Generator, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

# Matplotlib reads this when it is imported; processes that tests start inherit it.
os.environ["MPLBACKEND"] = "Agg"

import pytest
from hypothesis import HealthCheck, settings

import heelstrike  # before NumPy: it may be asked for plain code

PACKAGE = Path(heelstrike.__file__).parent

# The first example of a property pays for compilation, so time limits mean nothing here.
settings.register_profile(
    "local", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
# Continuous integration asks the same questions each time: a failure is the change's doing.
settings.register_profile("ci", settings.get_profile("local"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")


@pytest.fixture
def python_handles_ctrl_c() -> Iterator[None]:
    """Python's own way with Ctrl-C, whatever runs the tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


class _Doctests:
    """Looks for doctests where the package has some alone: looking takes long, and imports."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self, file_path: Path) -> Generator[None, list[Any], list[Any]]:
        found = yield
        if PACKAGE in file_path.parents and b">>>" in file_path.read_bytes():
            return found
        return [each for each in found if type(each) is pytest.Module]


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, Any, Any]:
    """Where no file is compiled yet, what one process compiles is there for the next."""
    run = getattr(session.config, "workerinput", {}).get("testrunuid")
    if run is None or not os.environ.get("CI"):
        return (yield)
    from heelstrike.compiler.kept_code import alone

    with alone([Path(tempfile.gettempdir())], run):
        return (yield)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--perturb-gaits",
        type=float,
        default=0.0,
        metavar="SIZE",
        help="change the numbers of designed gaits at random, relative to their size (1e-12)",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_Doctests())
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as of what a shell starts behind it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    size = config.getoption("perturb_gaits")
    if size:
        from perturbed_gaits import perturb_gaits

        perturb_gaits(size)
    if not hasattr(config, "workerinput"):  # processes that are started from here share the folder
        os.environ["HEELSTRIKE_KEEP_GAITS"] = "0" if size else str(_gaits(config))
        robots = tempfile.TemporaryDirectory(prefix="robots-", ignore_cleanup_errors=True)
        config.add_cleanup(robots.cleanup)
        os.environ["HEELSTRIKE_KEEP_ROBOTS"] = robots.name


def _gaits(config: pytest.Config) -> Path:
    """Where gaits are kept from one run of the tests to the next (`make clean` forgets them).

    A gait is found there by all that it follows from, the text of the program that designs it
    among it. What rounds otherwise is not part of that, and has a folder of its own.
    """
    rounding = [platform.machine(), platform.python_version()]
    rounding += [version(package) for package in ("numpy", "scipy", "casadi", "numba")]
    rounding += [
        os.environ.get(name, "") for name in ("HEELSTRIKE_PLAIN_CODE", "OPENBLAS_CORETYPE")
    ]
    name = "gaits-" + hashlib.sha256(" ".join(rounding).encode()).hexdigest()[:8]
    if config.pluginmanager.has_plugin("cacheprovider"):
        return Path(config.cache.mkdir(name))
    folder = tempfile.TemporaryDirectory(prefix=name, ignore_cleanup_errors=True)
    config.add_cleanup(folder.cleanup)
    return Path(folder.name)
