"""The mutants of ``benchmarks/mutations`` that are in every draw are of the code as it is."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

import heelstrike

MUTATIONS = Path(__file__).resolve().parents[2] / "benchmarks" / "mutations"


def test_known_mutants_are_of_today_s_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """A text that has moved or changed is an error there: the whole campaign would not begin."""
    monkeypatch.syspath_prepend(str(MUTATIONS))
    known = importlib.import_module("known")
    package = Path(heelstrike.__file__).parent
    mutants = known.known_mutants(package)
    assert len(mutants) == len(known.KNOWN)
    for mutant in mutants:
        compile(mutant.apply((package / mutant.file).read_text()), mutant.file, "exec")
