# Every target sets up what it needs: a fresh machine with Python 3.11 or newer and make is enough.
#
#   make walk    bravo7 designs a gait and walks it; results in walk/
#   make test    all tests
#   make bench   speed beside other engines; table, JSON and figures in bench/
#   make check   formatting, lint, types, layers
#   make docs    the documentation site, in site/
#   make clean   forget everything that was built or installed

PYTHON ?= python3
WORKERS ?= 2
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.DEFAULT_GOAL := help
.PHONY: help walk test bench check docs clean

help:
	@sed -n 's/^#   //p' Makefile

walk: $(VENV)/installed
	$(BIN)/heelstrike walk --out walk

test: $(VENV)/installed-dev
	$(BIN)/pytest -n $(WORKERS) --dist loadfile

bench: $(VENV)/installed
	$(BIN)/heelstrike bench --out bench

check: $(VENV)/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/installed-docs
	$(BIN)/mkdocs build --strict

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
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
