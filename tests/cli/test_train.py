"""``heelstrike train``: what it writes, how it goes on, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

pytest.importorskip("gymnasium", minversion="1.1")

SHORT = ("hopper", "--lanes", "8", "--decisions", "2000")


def invoke(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["train", *map(str, arguments)], env={"COLUMNS": "80"})


def test_files_and_going_on(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    result = invoke(*SHORT, "--out", first, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["robot"] == "hopper"
    assert found["decisions"] == 2048
    written = {path.name for path in first.iterdir()}
    assert written == {
        "policy.npz", "curve.csv", "curve.svg", "run.mp4", "run.html", "training.npz"
    }  # fmt: skip
    hs.Policy(first / "policy.npz")
    before = (first / "policy.npz").read_bytes()
    again = invoke(*SHORT, "--out", first, "--no-film")  # it is finished
    assert again.exit_code == 0
    assert (first / "policy.npz").read_bytes() == before
    other = invoke(*SHORT, "--out", second, "--seed", 1, "--no-film")
    assert other.exit_code == 0
    assert "return" in other.stdout
    ours, its = (np.load(each / "policy.npz")["weight.0"] for each in (first, second))
    assert not np.array_equal(ours, its)


def test_refusals(tmp_path: Path) -> None:
    assert invoke("compass_gait", "--out", tmp_path / "a").exit_code == 2
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "training.npz").write_text("nothing")
    refused = invoke(*SHORT, "--out", tmp_path / "b")
    assert refused.exit_code == 2
    assert "damaged" in " ".join(refused.output.split())


def test_walkers(tmp_path: Path) -> None:
    walk = ("bravo7", "--task", "walk", "--reference", "posture", "--lanes", "4", "--decisions")
    drawn = ("--speeds", "0:0", "--randomise", "push=0:5", "--randomise", "friction=0.5:0.9")
    result = invoke(*walk, "600", *drawn, "--no-film", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    network = hs.control.load_network(tmp_path / "policy.npz")
    assert network.reference is not None
    task = json.loads(network.about["walk"])
    assert task["randomise"]["push"] == [0.0, 5.0]
    assert task["speeds"] == [0.0, 0.0]
    for wrong, words in (
        ((*walk, "600", "--randomise", "push"), "NAME=LOW:HIGH"),
        ((*walk, "600", "--randomise", "wind=0:1"), "by name"),
        ((*walk, "600", "--speeds", "fast"), "LOW:HIGH"),
        ((*SHORT, "--randomise", "push=0:5"), "--randomise is for the task walk: add --task walk"),
        ((*SHORT, "--speeds", "0:1", "--reference", "gait"), "--speeds, --reference are for"),
    ):  # fmt: skip
        refused = invoke(*wrong, "--out", tmp_path / "other")
        assert refused.exit_code == 2
        assert words in " ".join(refused.output.split())
