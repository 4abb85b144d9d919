# Every target sets up what it needs: a fresh machine with Python 3.11 or newer and make is enough.
#
#   make walk    bravo7 designs a gait and walks it; results in walk/
#   make test    all tests; those in a browser if there is a chromium
#   make bench   speed beside other engines; table, JSON and figures in bench/
#   make check   formatting, lint, types, layers
#   make peers   install the other engines, beside which `make test` then runs its tests, too
#   make check-all   all checks and tests, on every kind of machine that this one can play; long
#   make docs    the documentation site, in site/, and a look at each page of it
#   make clean   forget everything that was built or installed

PYTHON ?= python3
WORKERS ?= 2
VENV := .venv
BIN := $(VENV)/bin
# Continuous integration compiles what it imports, which is a small part of the packages.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt $(if $(CI),--no-compile)

OLDEST_NUMBA := $(shell sed -n 's/.*"numba>=\([0-9.]*\)".*/\1/p' pyproject.toml)
NUMBA_SAMPLE := tests/compiler tests/dynamics/queries/test_c_code.py tests/contact/solvers tests/sim/test_walking.py

CHOSEN ?=
PYTEST := $(BIN)/pytest -n $(WORKERS) --dist loadfile $(CHOSEN)
BLAS_KERNELS ?= $(if $(filter x86_64 amd64 AMD64,$(shell uname -m)),Nehalem Haswell,ARMV8 CORTEXA57)
SAMPLE := tests/compiler/test_plain_code.py::test_this_suite_runs_on_plain_code tests/contact/solvers

# Tests start Python some hundred times: what it makes of the sources is kept, whatever is said elsewhere.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help walk peers pinocchio test test-plain test-blas test-perturbed test-sample test-numba test-documented bench check check-all docs clean

help:
	@sed -n 's/^#   //p' Makefile

walk: $(VENV)/installed
	$(BIN)/heelstrike walk --out walk

test: $(VENV)/installed-dev
	$(PYTEST)

# Engines to compare with: all that have wheels, or the one that installs in half a minute.
peers: $(VENV)/installed-peers

pinocchio: $(VENV)/installed-pinocchio

# The same tests where numbers are rounded differently: without the instructions that only some
# processors have, with other kernels of OpenBLAS than it chooses, with other last digits of gaits.
test-plain: export HEELSTRIKE_PLAIN_CODE = 1
test-plain: $(VENV)/installed-dev
	$(PYTEST)

test-blas: $(BLAS_KERNELS:%=test-blas-%)

test-blas-%: $(VENV)/installed-dev
	OPENBLAS_CORETYPE=$* $(PYTEST)

test-perturbed: $(VENV)/installed-dev
	$(PYTEST) --perturb-gaits 1e-12

# What depends on rounding most, in a few minutes; by one process, beside which others may test.
test-sample: export HEELSTRIKE_PLAIN_CODE = 1
test-sample: $(VENV)/installed-dev
	$(PYTEST) -n 1 --perturb-gaits 1e-12 $(SAMPLE)

# The same with the oldest Numba that is allowed, and with what Numba documents only.
test-numba: $(VENV)-numba/installed-$(OLDEST_NUMBA)
	$(VENV)-numba/bin/python -m pytest -n $(WORKERS) --dist loadfile $(NUMBA_SAMPLE)

test-documented: export HEELSTRIKE_DOCUMENTED_NUMBA = 1
test-documented: $(VENV)/installed-dev
	$(PYTEST)

bench: $(VENV)/installed
	$(BIN)/python benchmarks/speed run --out bench

check: $(VENV)/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check-all: check peers test test-plain test-blas test-perturbed

docs: export HEELSTRIKE_SITE = site
docs: $(VENV)/installed-docs $(VENV)/installed-dev
	$(BIN)/mkdocs build --strict
	$(BIN)/pytest -q tests/test_site.py

clean:
	rm -rf $(VENV) $(VENV)-numba .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	rm -rf build dist site walk paper bench
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# One environment for all targets. Each stamp says what has been installed into it; a later
# `make` installs again only when the requirements have changed.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "heelstrike needs Python 3.11 or newer; name one with: make PYTHON=/path/to/python")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing heelstrike into $(VENV) (minutes the first time)"
	$(INSTALL) -e .
	@touch $@

$(VENV)/installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing heelstrike and the tools that check it into $(VENV) (minutes the first time)"
	$(INSTALL) -e '.[dev]'
	@touch $(VENV)/installed $@

$(VENV)/installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing heelstrike and its documentation tools into $(VENV)"
	$(INSTALL) -e '.[docs]'
	@touch $(VENV)/installed $@

$(VENV)/installed-peers $(VENV)/installed-pinocchio: $(VENV)/installed-%: $(VENV)/installed-dev
	@echo "Installing other engines into $(VENV) ($*)"
	$(INSTALL) -e '.[dev,$*]'
	@touch $@

# Without constraints.txt, whose NumPy an old Numba refuses.
$(VENV)-numba/installed-$(OLDEST_NUMBA): pyproject.toml
	$(PYTHON) -m venv $(VENV)-numba
	$(VENV)-numba/bin/python -m pip install --quiet --disable-pip-version-check 'numba==$(OLDEST_NUMBA)' -e '.[dev]'
	@touch $@
