"""Reports: the verdict first, nothing from elsewhere, names as text, several runs side by side."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import built_falls as falls
import pytest
import walking
from synthetic_runs import box, make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import first_cause
from heelstrike.view import ViewError
from heelstrike.view.report.account import BEFORE
from heelstrike.view.report.plane import InPlane
from heelstrike.view.report.writing import report_page

HOSTILE = "</script><img src=x onerror=alert(1)>\"'&"


@pytest.fixture
def one_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw one figure of a report only: drawing takes most of its time."""
    monkeypatch.setattr(InPlane, "captions", {"energy": InPlane.captions["energy"]})


def pictures(text: str) -> list[str]:
    """Text of the figures of a page, which are images that it holds."""
    found = re.findall(r'<img alt="[^"]+" src="data:image/svg\+xml;base64,([^"]+)">', text)
    assert len(found) == text.count("<img ")
    return [base64.b64decode(each).decode("utf-8") for each in found]


def test_report_of_a_walk(tmp_path: Path) -> None:
    run = walking.walk(steps=2)
    path = run.save_report(tmp_path / "report.html", gait=walking.gait(), command="make it again")
    text = path.read_text(encoding="utf-8")
    first = re.search(r'<p class="verdict">(.*?)</p>', text)
    assert first is not None
    assert "bravo7 walks: 2 steps" in first[1]
    assert text.index("<p ") == first.start()  # nothing is said before it
    for part in ("make it again", "heelstrike", "residual of complementarity", "friction 0.75",
                 "impact_resolved", "initial velocities", "joint tracking error"):  # fmt: skip
        assert part in text, part
    assert len(pictures(text)) == 9
    outside = [text, *pictures(text)]
    for each in outside:
        bare = re.sub(r'(xmlns(:\w+)?|rdf:resource)="[^"]*"', "", each)
        bare = re.sub(r"<!DOCTYPE[^>]*>|<metadata>.*?</metadata>", "", bare, flags=re.DOTALL)
        assert not re.search(r"https?://", bare)


@pytest.mark.usefixtures("one_figure")
def test_two_runs_side_by_side(tmp_path: Path) -> None:
    short, long = walking.walk(steps=1), walking.walk(steps=2)
    path = hs.report({"short": short, "long": long}, tmp_path / "both.html")
    text = path.read_text(encoding="utf-8")
    assert text.count('<p class="verdict">') == 2
    assert text.count("<canvas") == 2
    assert len(pictures(text)) == 2
    runs = re.search(r'<script type="application/json" id="runs">(.*?)</script>', text, re.DOTALL)
    assert runs is not None
    assert len(json.loads(runs[1])) == 2
    table = text[text.index("Differences from short") :]
    assert re.search(r"<thead>.*?<th[^>]*>short</th><th[^>]*>long</th>", table)
    rows = re.findall(r'<tr><th scope="row">[^<]+</th><td>([^<]+)</td><td>([^<]+)</td></tr>', table)
    # The same walk as far as it goes.
    assert rows[:5] == [("1", "2"), ("0.7", "0.7"), ("0", "0"), ("0", "0"), ("0", "0")]


@pytest.mark.usefixtures("one_figure")
def test_runs_of_a_list_are_told_apart(tmp_path: Path) -> None:
    run = make_run(pendulum(), [0.0, 0.1])
    text = hs.report([run, run], tmp_path / "two.html").read_text(encoding="utf-8")
    assert "TimeStepping 2" in text


@pytest.mark.usefixtures("one_figure")
def test_hostile_names_are_text(tmp_path: Path) -> None:
    run = make_run(box(), [0.0, 0.1], message=HOSTILE)
    path = hs.report({HOSTILE: run, "b": run}, tmp_path / "report.html", command=HOSTILE)
    text = path.read_text(encoding="utf-8")
    assert "<img src=x" not in text
    assert text.count("<script") == text.count("</script") == 2
    assert "&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;" in text


@pytest.mark.usefixtures("one_figure")
def test_a_fall_is_shown_from_before_its_cause() -> None:
    """And a walk that goes well in the middle of a step, both in figures that can be signed."""
    fallen = falls.run_of("pushed forwards")
    text = report_page({"bravo7": fallen}, walking.gait())
    fall = first_cause(fallen, walking.gait())
    assert fall is not None
    assert shown(text) == pytest.approx(fall.time - BEFORE)
    times = [float(each) for each in re.findall(r'data-time="([^"]+)"', text)]
    assert times == sorted(times)
    assert times[0] == 1.0  # the push
    assert times[1] == pytest.approx(fall.time)
    assert times[-1] == pytest.approx(fallen.time[-1])
    assert "How close to each limit before the first cause" in text
    good = report_page({"bravo7": walking.walk(steps=2)}, walking.gait())
    assert shown(good) == pytest.approx(1.05)  # of the second step
    assert "data-time=" not in good
    for part in ("clearance of the swing foot", "touchdown impulse", "touchdown velocity",
                 "walking speed", "cost of transport", "tracking error", "mean power (W)",
                 "peak power (W)", "Tried beside this run: nothing."):  # fmt: skip
        assert part in good, part


def shown(text: str) -> float:
    """Time of the first picture of a report's film."""
    found = re.search(r'<script type="application/json" id="runs">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    (run,) = json.loads(found[1])
    return float(run["shown"])


def test_bad_requests(tmp_path: Path) -> None:
    run = make_run(box(), [0.0, 0.1])
    with pytest.raises(ViewError, match="prints it to PDF"):
        hs.report(run, tmp_path / "report.pdf")
    for wrong in ("run.nc", ["run.nc"], {"a": 3}):
        with pytest.raises(ViewError, match="load_run"):
            hs.report(wrong, tmp_path / "report.html")  # type: ignore[arg-type]
    with pytest.raises(hs.ViewError, match="load_gait"):
        hs.report(run, tmp_path / "report.html", gait="gait.json")  # type: ignore[arg-type]
    with pytest.raises(ViewError, match="no run"):
        hs.report([], tmp_path / "report.html")
    with pytest.raises(ViewError, match="nothing to report of empty"):
        hs.report({"empty": make_run(box(), [])}, tmp_path / "report.html")
