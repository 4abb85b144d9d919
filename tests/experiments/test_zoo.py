"""The zoo: cells that are measured, empty for a reason, kept, and taken up again.

Most cells here are of disturbances that cost nothing, on a robot that stands on springs.
"""

from __future__ import annotations

import html
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import walking as walks
from figure_text import check_text

import heelstrike as hs
from heelstrike.experiments.laws import flat_feet, point_feet, two_feet
from heelstrike.experiments.zoo import (
    CONTROLLERS,
    DISTURBANCES,
    Cell,
    Chance,
    Disturbance,
    Effort,
    Entry,
    Progress,
    Results,
    Settings,
    campaign,
    zoo,
)
from heelstrike.experiments.zoo.disturbances import chances
from heelstrike.experiments.zoo.figure import draw_zoo
from heelstrike.experiments.zoo.results import load_results
from heelstrike.experiments.zoo.table import as_csv, as_page, digits, escaped, shown
from heelstrike.experiments.zoo.writing import Targets

QUICK = campaign.QUICK
BY_NAME = {entry.name: entry for entry in CONTROLLERS}
SPRINGS = BY_NAME["JointFeedback"]


def free(_: hs.Trial, chance: Chance, effort: Effort) -> hs.Largest:
    """A disturbance that costs nothing and tells what it was given."""
    return hs.Largest(
        recovered=chance.phase + 10.0 * chance.seed, failed=math.inf, trials=effort.strides, unit=""
    )


FREE = Disturbance("free", "free", "N s", "nothing", free, by_chance=True, standing=True)
COMES = replace(FREE, name="ground", standing=False)


def walking_springs(name: str = "walking") -> Entry:
    """Springs again, as if they walked: by chance, and disturbed by all."""
    return replace(SPRINGS, name=name, stands=False)


@pytest.fixture(autouse=True)
def gait(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Nobody designs a gait here; whose was asked for."""
    asked: list[str] = []

    def known(robot: hs.Robot) -> hs.Gait:
        asked.append(robot.name)
        return walks.gait()

    monkeypatch.setattr(campaign, "gait_for", known)
    return asked


def small(folder: Path | None = None, **options: object) -> Results:
    given: dict[str, object] = {
        "controllers": (walking_springs(), SPRINGS), "disturbances": (FREE, COMES),
        "settings": replace(QUICK, trials=3),
    }  # fmt: skip
    return zoo({"bravo7": walks.bravo7()}, folder=folder, **(given | options))  # type: ignore[arg-type]


# What is in the cells


def test_cells_by_chance_have_a_trial_each_and_others_one() -> None:
    found = small()
    assert list(found.cells) == [
        ("bravo7", controller, disturbance)
        for controller in ("walking", "JointFeedback")
        for disturbance in ("free", "ground")
    ]
    drawn = tuple(draw.phase + 10.0 * draw.seed for draw in chances(0, 3))
    walked, stood = (found.cells["bravo7", name, "free"] for name in ("walking", "JointFeedback"))
    assert walked.withstood == drawn
    assert walked.walks == 3 * QUICK.strides
    assert stood.withstood == drawn[:1]  # which phase it is says nothing of a robot that stands
    unfit = found.cells["bravo7", "JointFeedback", "ground"]
    assert (unfit.word, unfit.withstood) == ("stands", ())


def test_phases_lie_one_in_each_part_of_a_step() -> None:
    for seed in range(5):
        drawn = chances(seed, 8)
        assert [int(8 * draw.phase) for draw in drawn] == list(range(8))
        assert [draw.seed for draw in drawn] == [seed + i for i in range(8)]
    assert chances(0, 4) != chances(1, 4)


@pytest.mark.parametrize("workers", [1, 3])
def test_the_same_seed_gives_the_same_table(workers: int) -> None:
    first, again = small(), small(workers=workers)
    assert again.to_dict() == first.to_dict()
    assert as_csv(again) == as_csv(first)
    other = small(settings=replace(QUICK, trials=3, seed=1), workers=workers)
    assert other.cells["bravo7", "walking", "free"] != first.cells["bravo7", "walking", "free"]


def test_what_a_controller_needs() -> None:
    bravo7, rabbit, wheel = map(hs.load_robot, ("bravo7", "rabbit", "rimless_wheel"))
    assert [needs(bravo7) for needs in (two_feet, flat_feet, point_feet)] == [
        "", "", "needs point feet"
    ]  # fmt: skip
    assert [needs(rabbit) for needs in (two_feet, flat_feet, point_feet)] == [
        "", "needs flat feet", ""
    ]  # fmt: skip
    assert {needs(wheel) for needs in (two_feet, flat_feet, point_feet)} == {"no motors"}


def _fails(*_: object) -> hs.Trial:
    raise hs.ControllerError("gains of the wrong sign")


def test_empty_cells_say_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_gait(_: hs.Robot) -> hs.Gait:
        raise hs.GaitError("too heavy")

    def limp(robot: hs.Robot, _: hs.Gait | None) -> hs.Trial:
        return hs.Trial(
            robot=robot, controller=None, state=robot.reference_state(), step_length=0.0,
            step_duration=0.7, settling=1.0,
        )  # fmt: skip

    monkeypatch.setattr(campaign, "gait_for", no_gait)
    entries = (
        Entry("points", _fails, point_feet),
        Entry("gaits", _fails, flat_feet),
        Entry("refuses", _fails, flat_feet, stands=True),
        Entry("limp", limp, flat_feet, stands=True),
    )
    found = small(controllers=entries, disturbances=(FREE,))
    words = [(cell.word, cell.reason) for cell in found.cells.values()]
    assert words[:3] == [
        ("needs point feet", ""), ("no gait", "too heavy"), ("refused", "gains of the wrong sign")
    ]  # fmt: skip
    assert words[3][0] in ("falls", "leans", "strays")
    assert words[3][1].startswith("undisturbed, ")
    assert not any(cell.withstood for cell in found.cells.values())


def test_a_disturbance_that_cannot_be_laid_is_told() -> None:
    def refuse(*_: object) -> hs.Largest:
        raise hs.SimulationError("no such ground")

    found = small(disturbances=(replace(FREE, measure=refuse), COMES))
    assert found.cells["bravo7", "walking", "free"].reason == "no such ground"
    assert found.cells["bravo7", "walking", "ground"].withstood


# What is kept


def test_a_second_call_measures_what_is_missing(tmp_path: Path, gait: list[str]) -> None:
    first = small(tmp_path, disturbances=(FREE,))
    assert gait == ["bravo7"]
    measured: list[str] = []

    def noted(trial: hs.Trial, chance: Chance, effort: Effort) -> hs.Largest:
        measured.append("ground")
        return free(trial, chance, effort)

    second = small(
        tmp_path, disturbances=(replace(FREE, measure=_fails), replace(COMES, measure=noted))
    )
    assert gait == ["bravo7"]  # whose gait is kept, too
    assert measured == ["ground"] * 3
    assert {key: second.cells[key] for key in first.cells} == first.cells
    assert load_results(tmp_path / "zoo.json").cells == second.cells
    fewer = small(tmp_path, disturbances=(replace(COMES, measure=_fails),))
    assert len(fewer.cells) == 2
    assert load_results(tmp_path / "zoo.json").cells == second.cells  # nothing is lost
    afresh = small(tmp_path, disturbances=(FREE,), afresh=True)
    assert load_results(tmp_path / "zoo.json").cells == afresh.cells == first.cells


def test_cells_of_another_robot_of_that_name_are_measured_anew(tmp_path: Path) -> None:
    small(tmp_path, controllers=(SPRINGS,))
    robot = walks.bravo7()
    heavier = replace(robot, model=robot.model.replaced(mass=1.1 * robot.model.mass))
    found = zoo(
        {"bravo7": heavier}, controllers=(SPRINGS,), settings=replace(QUICK, trials=3),
        disturbances=(replace(FREE, measure=partial(_seven)),), folder=tmp_path,
    )  # fmt: skip
    assert found.cells["bravo7", "JointFeedback", "free"].withstood == (7.0,)
    assert found.animals["bravo7"].mass == pytest.approx(1.1 * 75.0)
    assert list(load_results(tmp_path / "zoo.json").cells) == [("bravo7", "JointFeedback", "free")]


def _seven(*_: object) -> hs.Largest:
    return hs.Largest(recovered=7.0, failed=8.0, trials=1, unit="")


def test_results_of_other_settings_are_not_mixed(tmp_path: Path) -> None:
    small(tmp_path)
    before = (tmp_path / "zoo.json").read_bytes()
    with pytest.raises(
        hs.SimulationError, match=r"zoo\.json was made with seed 0, not 1; trials 3, not 2"
    ):
        small(tmp_path, settings=replace(QUICK, trials=2, seed=1))
    with pytest.raises(
        hs.SimulationError, match=r"TimeStepping\(step=0.001\), not EventDriven\(\)"
    ):
        small(tmp_path, method=hs.EventDriven())
    assert (tmp_path / "zoo.json").read_bytes() == before


def test_a_results_file_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "zoo.json"
    cells = (
        Cell(robot="r", controller="c", disturbance="d", withstood=(1.5, 2.0),
             failed=(2.0, math.inf), walks=7),
        Cell(robot="r", controller="é", disturbance="d", word="falls", reason='"so"'),
    )  # fmt: skip
    results = Results(Settings(seed=3, method="M()"))
    results.meet(campaign.Animal(robot="r", fingerprint="f", mass=2.0))
    results.put(*cells)
    results.save(path)
    back = load_results(path)
    assert (back.settings, back.animals, back.cells) == (
        results.settings, results.animals, results.cells
    )  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"walks": 15', '"walks": 16', "damaged"),
        ('"version": 1', '"version": 9', "newer heelstrike"),
        ('"cells": [', '"cells": 3, "was": [', '"cells" must be a list'),
        ('"withstood": [', '"withstood": 3, "was": [', '"withstood" must be a list'),
        ("{", "", "not valid JSON"),
    ],
)
def test_a_damaged_results_file_is_told(tmp_path: Path, old: str, new: str, words: str) -> None:
    small(tmp_path)
    path = tmp_path / "zoo.json"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(hs.SimulationError, match=words):
        small(tmp_path)


def _interrupt_when(wanted: str, went_on: threading.Event) -> Callable[[Progress], None]:
    def look(progress: Progress) -> None:
        if any(wanted in what for what in progress.doing):
            went_on.set()
            raise KeyboardInterrupt

    return look


def test_an_interruption_keeps_what_is_finished_and_ends_walks(tmp_path: Path) -> None:
    """The second cell walks on until it is stopped, which nothing but the interruption does."""
    begun = threading.Event()
    ended: list[str] = []

    def endless(trial: hs.Trial, *_: object) -> hs.Largest:
        begun.wait(60.0)
        try:
            while True:
                trial.run(trial.begins)
        except KeyboardInterrupt:
            ended.append("stopped")
            raise

    slow = replace(COMES, name="slow", measure=endless)
    with pytest.raises(KeyboardInterrupt):
        small(
            tmp_path, controllers=(walking_springs(),), disturbances=(FREE, slow), workers=1,
            progress=_interrupt_when("slow", begun),
        )  # fmt: skip
    assert ended == ["stopped"]
    kept = load_results(tmp_path / "zoo.json").cells
    assert list(kept) == [("bravo7", "walking", "free")]
    whole = small(tmp_path, controllers=(walking_springs(),), disturbances=(FREE, COMES))
    assert whole.cells["bravo7", "walking", "free"] == kept["bravo7", "walking", "free"]
    assert whole.to_dict()["cells"] == small(controllers=(walking_springs(),)).to_dict()["cells"]


def test_progress_comes_to_its_end(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    small(tmp_path, progress=lambda progress: seen.append((progress.finished, progress.cells)))
    assert seen[0] == (0, 4)
    assert seen[-1] == (4, 4)
    assert sorted(seen) == seen
    again: list[int] = []
    small(tmp_path, progress=lambda progress: again.append(progress.finished))
    assert again[-1] == 4


def test_wrong_questions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(hs.SimulationError, match="nothing to do"):
        small(controllers=())
    for name in ("trials", "strides"):
        with pytest.raises(hs.SimulationError, match=f"{name} must be at least 1, got 0"):
            small(settings=replace(QUICK, **{name: 0}))
    with pytest.raises(hs.SimulationError, match="workers must be at least 1, got 0"):
        small(workers=0)
    with pytest.raises(
        hs.ControllerError, match=r"no controller 'wholebdy'\. Did you mean 'WholeBody'"
    ):
        campaign.chosen_controllers("wholebdy")
    with pytest.raises(hs.SimulationError, match=r"no disturbance 'slope'\. Did you mean"):
        campaign.chosen_disturbances("slope")
    with pytest.raises(hs.RobotError, match="Did you mean 'rabbit'"):
        campaign.loaded("bravo7, rabit", {})
    with pytest.raises(hs.RobotError, match="two robots are called 'bravo7'"):
        campaign.loaded("bravo7,bravo7", {})
    with pytest.raises(hs.RobotError, match="rabbit are built in: leave out mirror"):
        campaign.loaded("bravo7, rabbit", {"mirror": "average", "pose": {}})
    assert campaign.chosen_controllers(" wholebody,") == (BY_NAME["WholeBody"],)
    assert campaign.chosen_disturbances(None) == DISTURBANCES
    walks.bravo7().save(tmp_path / "mine.xml")
    loaded = campaign.loaded(f"rabbit,{tmp_path / 'mine.xml'}", {})
    assert list(loaded) == ["rabbit", "mine.xml"]
    walks.bravo7().save(tmp_path / "mine, too.xml")
    loaded = campaign.loaded(f'rabbit, "{tmp_path / "mine, too.xml"}"', {})
    assert list(loaded) == ["rabbit", "mine, too.xml"]
    assert campaign.chosen_controllers("wholebody,\n  jointpd") == (  # a shell's lines
        BY_NAME["WholeBody"], BY_NAME["JointPD"],
    )  # fmt: skip


# How it is shown


def _cell(*withstood: float, failed: float = math.inf, word: str = "", name: str = "free") -> Cell:
    return Cell(
        robot="bravo7", controller="c", disturbance=name, withstood=withstood,
        failed=(failed,) * len(withstood), word=word,
    )  # fmt: skip


def test_cells_as_people_read_them() -> None:
    less = replace(FREE, less=True)
    assert shown(_cell(20.0, 12.345, failed=25.0), FREE) == "12"
    assert shown(_cell(0.5, 0.25, failed=0.1), less) == "0.5"
    assert shown(_cell(150.0, 150.0), FREE) == "≥\u2009150"
    assert shown(_cell(0.05), less) == "≤\u20090.05"
    assert shown(_cell(0.0, 5.0, failed=1.875), FREE) == "<\u20091.9"
    assert shown(_cell(word="falls"), FREE) == "–"
    assert shown(None, FREE) == "–"
    assert [digits(value) for value in (1e-25, 0.0512, 9.96, 99.6, 1029.0)] == [
        "0", "0.051", "10", "100", "1029"
    ]  # fmt: skip


def some(tmp_path: Path) -> Results:
    """Every kind of cell: measured, beyond, empty in part and as a whole."""
    results = Results(replace(QUICK, trials=2, method="TimeStepping(step=0.001)"))
    for robot in ("bravo7", "rabbit"):
        results.meet(
            campaign.Animal(
                robot=robot, fingerprint="f", mass=75.0, step_length=0.3, step_duration=0.7
            )
        )
    for entry in CONTROLLERS:
        for each in DISTURBANCES:
            cell = Cell(
                robot="bravo7", controller=entry.name, disturbance=each.name, withstood=(1.0, 3.0),
                failed=(2.0, math.inf), walks=4,
            )  # fmt: skip
            fallen = replace(cell, withstood=(), failed=(), word="falls", reason="at 3 s")
            unfit = replace(fallen, word="needs flat feet", reason="")
            results.put(replace(unfit if entry is SPRINGS else cell))
            results.put(replace(fallen if entry is not SPRINGS else unfit, robot="rabbit"))
    return results


def test_a_page_tells_what_made_it_and_why_cells_are_empty(tmp_path: Path) -> None:
    results = some(tmp_path)
    page, figure = tmp_path / "docs" / "zoo.md", tmp_path / "docs" / "images" / "zoo.png"
    text = as_page(results, page=page, figure=figure, command="heelstrike zoo --seed 0")
    assert "```sh\nheelstrike zoo --seed 0\n```" in text
    assert f"heelstrike {hs.__version__}, TimeStepping(step=0.001), seed 0" in text
    assert "](images/zoo.png)" in text
    assert "| FootstepFeedback | 1 | 1 | 1 | 1 | 1 | 1 | 1 | 3 | 1 | 3 |" in text
    assert "- JointFeedback: needs flat feet\n" in text
    assert "WholeBody, FootstepFeedback, VirtualConstraints, SteppingConstraints" in text
    assert "StandingLQR: falls (at 3 s)" in text
    assert "with 95% confidence" in text
    assert "at least 22% of all phases" in text  # 0.05^(1/2)
    rows = as_csv(results).splitlines()
    assert len(rows) == 1 + len(results.cells)
    assert rows[1] == "bravo7,ComputedTorque,push-forwards,N s,1,2,2,2,4,,"


def test_names_of_files_stand_in_the_page_as_they_are(tmp_path: Path) -> None:
    """Whatever Markdown makes of their characters; a name of the zoo's own is not changed."""
    odd = "$\\frac$ a*b*_c_ | `d` <em> [e](f) & #g_h.xml"
    results = Results(replace(QUICK, trials=1, method="m"))
    results.meet(campaign.Animal(robot=odd, fingerprint="f", mass=75.0))
    cell = Cell(robot=odd, controller="c|c", disturbance="free", withstood=(1.0,), failed=(2.0,))
    results.put(replace(cell, disturbance="slope-up"))
    text = as_page(
        results, page=tmp_path / "zoo.md", figure=tmp_path / "my zoo (1).png", command="c"
    )
    assert (
        "## $\\\\frac$ a\\*b\\*\\_c\\_ &#124; \\`d\\` &#60;em&#62; \\[e\\](f) &amp; \\#g_h.xml\n"
        in text
    )
    assert "| c&#124;c | 1 |" in text
    assert "](my%20zoo%20%281%29.png)" in text
    draw_zoo(results).savefig(tmp_path / "drawn.svg")  # $ is no formula either
    assert escaped("spring_flamingo: no gait (it's 5 m)") == "spring_flamingo: no gait (it's 5 m)"
    markdown = pytest.importorskip("markdown")
    assert html.unescape(markdown.markdown(escaped("<b>*_`x`|a&b"))) == "<p><b>*_`x`|a&b</p>"


def test_the_figure_has_a_panel_a_disturbance_and_a_mark_a_cell(tmp_path: Path) -> None:
    figure = draw_zoo(some(tmp_path))
    check_text(figure)
    panels = figure.axes
    assert [axes.get_title(loc="left") for axes in panels][:2] == [
        "push forwards (N s)", "push backwards (N s)"
    ]  # fmt: skip
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    assert names == ["bravo7", "rabbit"]
    (arrow,) = [
        each for each in figure.legends[0].legend_handles
        if each is not None and each.get_label() == "more was not tried"
    ]  # fmt: skip
    assert "$" not in str(arrow.get_marker())  # type: ignore[attr-defined]
    drawn = len(CONTROLLERS) - 1  # springs cannot drive them: no row at all
    for axes, disturbance in zip(panels, DISTURBANCES, strict=True):
        crosses = [line for line in axes.lines if line.get_marker() == "x"]
        marks = [line for line in axes.lines if line.get_marker() not in ("x", "None")]
        assert (len(crosses), len(marks)) == (drawn, drawn)
        assert axes.xaxis_inverted() == disturbance.less
        at = [np.ravel(line.get_xdata())[0] for line in marks]
        assert at == [3.0 if disturbance.less else 1.0] * drawn
        assert len({line.get_marker() for line in marks}) == drawn


def test_files_are_written_whole_and_asked_for_first(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    targets = Targets(out, out / "zoo.md", out / "zoo.svg")
    written = targets.write(some(tmp_path), "heelstrike zoo")
    assert {path.name for path in written} == {path.name for path in out.iterdir()} == {
        "zoo.csv", "zoo.md", "zoo.svg"
    }  # fmt: skip
    with pytest.raises(hs.ViewError, match=r"ends in \.svg, \.png or \.pdf"):
        Targets(out, out / "zoo.md", out / "zoo.jpg")
    with pytest.raises(hs.WriteError, match="there is no folder"):
        Targets(out, tmp_path / "nowhere" / "zoo.md", out / "zoo.svg")
    with pytest.raises(hs.WriteError, match="it is a folder"):
        Targets(out, out, out / "zoo.svg")


# The disturbances themselves, on springs that stand and on a gait that walks


def test_pushes_find_what_springs_withstand() -> None:
    """To where the capture point leaves the foot: Δv = ω · half a sole, were it stiff."""
    robot = walks.bravo7()
    trial = SPRINGS.trial(robot, None)
    forwards, backwards = (each.measure for each in DISTURBANCES[:2])
    effort = Effort(strides=5, halvings=2)
    for measure in (forwards, backwards):
        found = measure(trial, Chance(0.3, 0), effort)
        assert 5.0 < found.recovered < 75.0 * math.sqrt(9.81 / 1.044) * 0.1 < found.failed + 7.5


def test_model_error_of_standing() -> None:
    trial = SPRINGS.trial(walks.bravo7(), None)
    known = {each.name: each for each in DISTURBANCES}
    chance, effort = Chance(0.0, 0), Effort(strides=1, halvings=0)
    assert known["trunk-mass"].measure(trial, chance, effort).recovered == 50.0
