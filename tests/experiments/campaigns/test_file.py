"""Campaigns in files, and the command that runs them."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import campaign_cases as cases
import numpy as np
import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.cli.options import method_called
from heelstrike.experiments.campaigns import Draw
from heelstrike.experiments.campaigns.file import kept_campaign, load_campaign

STANDS = """
controller = "JointFeedback"
duration = 0.02
trials = 5
seed = 4
time_limit = 30
friction = 0.5

[[shares]]
weight = 2
[shares.parameters]
"ground.friction" = { uniform = [0.2, 0.6] }
"robot.mass *" = { normal = [1, 0.05] }
[[shares]]
parameters = { "push.impulse" = [1.0, 2.0], "push.start" = 0.0 }
"""


def load(text: str, folder: Path) -> tuple[hs.Campaign, float | None]:
    file = folder / "campaign.toml"
    file.write_text(text, encoding="utf-8")
    return load_campaign(file, folder / "out", method_called)


def test_what_a_file_says(tmp_path: Path) -> None:
    campaign, limit = load(STANDS, tmp_path)
    assert (len(campaign), campaign.seed, campaign.duration, limit) == (5, 4, 0.02, 30)
    (trial,) = campaign.trials.values()
    assert trial.robot.name == "bravo7"
    assert trial.method == hs.TimeStepping(step=1e-3)
    assert trial.ground.friction == 0.5
    assert campaign.plan.names == (
        "ground.friction", "robot.mass *", "push.impulse", "push.start"
    )  # fmt: skip
    friction = campaign.plan.values[:, 0]
    assert ((friction >= 0.2) & (friction <= 0.6))[np.isfinite(friction)].all()


def test_several_walks_and_a_gait(tmp_path: Path) -> None:
    cases.walks().controller.gait.save(tmp_path / "own.json")
    text = """
        gait = "own.json"
        draw = "grid"
        [walks.exact]
        method = "event-driven"
        [walks.sure]
        controller = "ComputedTorque"
        [parameters]
        trial = ["exact", "sure"]
        "ground.friction" = [0.4, 0.6, 0.8]
    """
    campaign, limit = load(text, tmp_path)
    assert (len(campaign), campaign.draw, limit) == (6, Draw.GRID, None)
    assert isinstance(campaign.trials["exact"].method, hs.EventDriven)
    assert isinstance(campaign.trials["sure"].controller, hs.ComputedTorque)
    assert isinstance(campaign.trials["exact"].controller, hs.FootstepFeedback)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trials = ", "not valid TOML"),
        ("trails = 5", "Did you mean 'trials'"),
        ('trials = "5"', "trials is a whole number"),
        ('draw = "sobel"', "draw is one of random, sobol"),
        ('controller = "Footstep"', "no controller 'Footstep'"),
        ('controller = "JointFeedback"\nmethod = "timestepping"', "timestepping"),
        ('controller = "JointFeedback"\ntrials = 2', "say what differs"),
        ('controller = "JointFeedback"\n[parameters]\n"ground.friction" = { unifrom = [0, 1] }',
         "Did you mean 'uniform'"),
        ('controller = "JointFeedback"\n[parameters]\n"ground.friction" = { uniform = [0] }',
         "uniform: not enough values"),
        ('controller = "JointFeedback"\n[parameters]\n"ground.friction" = { norm = [0, -1] }',
         "no numbers that it can have"),
        ('controller = "JointFeedback"\n[parameters]\n"ground.friction" = { a = 1, b = 2 }',
         "one distribution by its name"),
        ('controller = "JointFeedback"\n[[shares]]\nwieght = 1', "Did you mean 'weight'"),
        ('controller = "JointFeedback"\n[parameters]\nground.friction = 0.5',
         'in quotes, as in "ground.friction" = 1.0'),
        ("walks = 3", "walks are tables"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_with_its_place(
    text: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(hs.HeelstrikeError, match=words):
        load(text, tmp_path)
    with pytest.raises(hs.SimulationError, match="cannot be read"):
        load_campaign(tmp_path / "none.toml", tmp_path, method_called)


def test_the_command(tmp_path: Path) -> None:
    """Run, judged and replayed; quiet where there is no terminal."""
    file, out = tmp_path / "stands.toml", tmp_path / "out"
    file.write_text(STANDS, encoding="utf-8")
    ran = CliRunner().invoke(app, ["campaign", str(file), "--out", str(out), "--json"])
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout)["trials"] == 5
    assert "simulating" not in ran.stderr
    again = CliRunner().invoke(app, ["campaign", "verdict", str(out), "--json"])
    assert json.loads(again.stdout) == json.loads(ran.stdout)
    campaign, _ = kept_campaign(out, method_called)
    outcome = campaign.load(out).outcomes[3]
    shown = CliRunner().invoke(
        app, ["campaign", "replay", str(out), "3", "--no-film", "--json"]
    )  # fmt: skip
    assert shown.exit_code == 0, shown.output
    assert json.loads(shown.stdout)["values"] == campaign.plan.of(3)
    assert json.loads(shown.stdout)["summary"]["status"] == outcome.status
    with sqlite3.connect(out / "campaign.sqlite") as kept:  # as if its robot had changed since
        kept.execute("UPDATE about SET text = 'another' WHERE name = 'trial'")
        assert kept.execute("SELECT changes()").fetchone() == (1,)
    other = CliRunner().invoke(app, ["campaign", "replay", str(out), "3", "--no-film"])
    assert other.exit_code == 2
    assert "has another campaign: its trial was other" in other.output


def test_what_the_command_refuses(tmp_path: Path) -> None:
    for words, told in (
        (["replay", str(tmp_path)], "FILE.toml"),
        (["replay", str(tmp_path), "1"], "has no campaign"),
        (["verdict", str(tmp_path)], "has no campaign"),
        ([str(tmp_path / "none.toml")], "cannot be read"),
    ):
        done = CliRunner().invoke(app, ["campaign", *words])
        assert done.exit_code == 2
        assert told in done.stderr.replace("\n", " ")
    python = hs.Campaign(cases.limp(), {"ground.friction": 0.5}, 1)
    python.run(tmp_path / "own")
    done = CliRunner().invoke(app, ["campaign", "replay", str(tmp_path / "own"), "0"])
    assert done.exit_code == 2
    assert "made in Python" in done.stderr.replace("\n", " ")
