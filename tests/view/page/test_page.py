"""One file that shows a run: whole, harmless, small, and true to the record."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from harness import Pin
from synthetic_runs import box, make_run, pendulum

import heelstrike as hs
from heelstrike.robot import read_mjcf
from heelstrike.sim import Event, EventKind
from heelstrike.view import ViewError
from heelstrike.view.page import rows as rows_of_pages
from heelstrike.view.page import save_html, scene
from heelstrike.view.page.columns import TOLERANCE, packed
from heelstrike.view.page.rows import means, shown_rows

VOID = {"meta", "input", "br", "img", "hr", "link"}
HOSTILE = "</script><img src=x onerror=alert(1)>\"'&"


class Page(HTMLParser):
    """Elements of a page: fails where one is not closed, collects what could ask for something."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            attributes = self.elements[-1][1]
            key = f"{self.open[-1]} {attributes.get('id', '')}".strip()
            self.texts[key] = self.texts.get(key, "") + data


def read(path: Path) -> tuple[Page, dict[str, Any]]:
    """Elements of a page, and what its script is given."""
    page = Page(path.read_text(encoding="utf-8"))
    assert page.open == []
    return page, json.loads(page.texts["script run"])


def unpacked(data: dict[str, Any]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time (n,) and columns (n, width), read as the page's script reads them."""
    time = np.frombuffer(base64.b64decode(data["time"]), dtype="<f8")
    coded, start, columns = base64.b64decode(data["numbers"]), 0, {}
    for each in data["columns"]:
        table = np.full((each["rows"], each["width"]), np.nan)
        for i, (least, step) in enumerate(zip(each["least"], each["step"], strict=True)):
            if not step:
                table[:, i] = np.frombuffer(coded, "<f4", each["rows"], start)
                start += 4 * each["rows"]
                continue
            change = slope = steps = 0
            for row in range(each["rows"]):
                code, shift, byte = 0, 0, 128
                while byte > 127:
                    byte = coded[start]
                    code |= (byte & 127) << shift
                    start, shift = start + 1, shift + 7
                if code:
                    change += -(code // 2) if code % 2 == 0 else code // 2
                    slope += change
                    steps += slope
                    table[row, i] = least + step * steps
        columns[each["name"]] = np.broadcast_to(table, (data["rows"], each["width"]))
    assert start == len(coded)
    return time, columns


def test_page_asks_for_nothing(tmp_path: Path) -> None:
    path = walking.walk(steps=2).save_html(tmp_path / "walk.html", gait=walking.gait())
    page, _ = read(path)
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"https?://|//[a-z]+\.|@import|url\(", text.replace("// ", ""))
    for tag, attributes in page.elements:
        assert tag not in ("iframe", "object", "embed", "base", "form"), tag
        asks = {"src", "href", "action", "srcset"} & attributes.keys()
        assert all((attributes[each] or "").startswith("data:") for each in asks), attributes
        assert not any(name.startswith("on") for name in attributes), (tag, attributes)
    policy = next(a["content"] for t, a in page.elements if "http-equiv" in a)
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy


def test_every_control_has_a_name(tmp_path: Path) -> None:
    page, _ = read(walking.walk(steps=1).save_html(tmp_path / "walk.html"))
    controls = [
        a for t, a in page.elements if t in ("button", "select") or a.get("type") == "range"
    ]
    assert len(controls) >= 8
    assert all(attributes.get("aria-label") for attributes in controls)
    assert [a["lang"] for t, a in page.elements if t == "html"] == ["en"]


def test_size_of_the_usual_walk(tmp_path: Path) -> None:
    """Twenty steps, as ``heelstrike walk`` takes: half a megabyte is promised."""
    path = walking.walk(steps=20).save_html(tmp_path / "walk.html", gait=walking.gait())
    assert path.stat().st_size < 0.5e6


def test_numbers_are_those_of_the_record(tmp_path: Path) -> None:
    run = walking.walk(steps=2)
    _, content = read(run.save_html(tmp_path / "walk.html", gait=walking.gait()))
    time, columns = unpacked(content["data"])
    rows = np.searchsorted(run.time, time)
    np.testing.assert_array_equal(run.time[rows], time)
    np.testing.assert_array_equal(rows, shown_rows(run))
    for name, values in (("point", run.contact_point), ("normal", run.contact_normal)):
        exact = values[rows].reshape(len(rows), -1)
        error = np.abs(columns[name] - exact).max(axis=0)
        assert np.all(error <= 1.001 * TOLERANCE * np.ptp(exact, axis=0))
    drawn = {panel["title"]: i for i, panel in enumerate(content["plots"])}
    joint = run.robot.joint_index("right_knee")
    knee = columns[f"curve {drawn['knee angle']} 0"][:, 0]
    exact = run.position[rows, joint]
    assert np.abs(knee - exact).max() <= 1.001 * TOLERANCE * np.ptp(exact)


def test_columns_of_any_kind_come_back() -> None:
    """What is not known stays so; a number that ran away does not swallow the others."""
    time, rng = np.linspace(0.0, 1.0, 500), np.random.default_rng(1)
    ramp = np.cumsum(rng.normal(size=500))
    holes = np.where(rng.random(500) < 0.3, np.nan, ramp)
    holes[0] = np.nan
    away = np.where(time < 0.99, np.sin(time), 1e12 * time)
    given = {"ramp": ramp, "holes": holes, "away": away, "same": np.ones(500),
             "nothing": np.full(500, np.nan), "pair": np.column_stack((ramp, holes))}  # fmt: skip
    _, columns = unpacked(packed(time, given))
    assert columns["same"].tolist() == np.ones((500, 1)).tolist()
    assert np.isnan(columns["nothing"]).all()
    np.testing.assert_allclose(columns["away"][:, 0], away, rtol=2.0**-24, atol=0.0)
    for name, column in (("ramp", ramp), ("holes", holes)):
        for found in (columns[name][:, 0], columns["pair"][:, list(given).index(name)]):
            error = np.abs(found - column)
            assert np.array_equal(np.isnan(error), np.isnan(column))
            assert np.nanmax(error) <= 1.001 * TOLERANCE * (np.nanmax(column) - np.nanmin(column))


def test_rows_beside_events_are_there() -> None:
    run = walking.walk(steps=2)
    shown = run.time[shown_rows(run)]
    for event in run.events:
        assert np.abs(shown - event.time).min() < 1e-9
        for side in (-1, 1):  # and its neighbours
            if event.time + side * 1e-3 > run.time[-1] + 1e-9:
                continue
            assert np.abs(shown - event.time - side * 1e-3).min() < 1e-9
    assert np.diff(shown).max() < rows_of_pages.INTERVAL + 1.1e-3
    assert len(shown) < 0.2 * len(run.time)


def test_forces_keep_their_impulses() -> None:
    run = walking.walk(steps=2)
    rows = shown_rows(run)
    shown = means(run, run.world_force, rows)[:-1]
    elapsed = np.diff(run.time[rows])[:, None, None]
    whole = (run.world_force[:-1] * np.diff(run.time)[:, None, None]).sum(axis=0)
    np.testing.assert_allclose((shown * elapsed).sum(axis=0), whole, rtol=1e-9, atol=1e-9)


def test_a_long_run_has_no_more_rows_than_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows_of_pages, "MOST_ROWS", 100)
    run = walking.walk(steps=2)
    rows = shown_rows(run)
    assert len(rows) <= 200
    assert rows[0] == 0
    assert rows[-1] == len(run.time) - 1


@pytest.mark.parametrize("kind", ["pendulum", "one row", "nothing known", "box", "event-driven"])
def test_unusual_runs(kind: str, tmp_path: Path) -> None:
    if kind == "pendulum":
        run = hs.simulate(pendulum(), state=hs.State([1.0], [0.0]), duration=0.1)
    elif kind == "one row":
        run = make_run(walking.bravo7(), [0.0])
    elif kind == "nothing known":
        event = Event(0.1, EventKind.TOUCHDOWN, 0, (np.nan, np.inf))
        unknown = np.full((2, 3), np.nan)
        run = make_run(box(), [0.0, 0.1], position=unknown, velocity=unknown, events=[event])
    elif kind == "box":
        push = hs.Push("box", force=(30.0, 0.0), start=0.0, duration=0.05)
        run = hs.simulate(box(), state=hs.State([0, 0.1, 0.2], [1.0, 0, 0]), duration=0.3,
                          pushes=push)  # fmt: skip
    else:
        run = hs.simulate(
            box(), state=hs.State([0, 0.1, 0.2], [1.0, 0, 0]), duration=0.3,
            method=hs.EventDriven(),
        )  # fmt: skip
    _, content = read(save_html(run, tmp_path / "run.html"))
    _, columns = unpacked(content["data"])
    assert columns["pose"].shape == (content["data"]["rows"], 3 * run.robot.nl)
    if kind == "box":
        assert columns["push"][0, 2] == 30.0
        assert columns["push"][-1, 2] == 0.0


def test_hostile_names_are_text(tmp_path: Path) -> None:
    """Names come from robot files; none of them becomes markup, in any place."""
    xml = """
    <mujoco model="{name}"><worldbody><geom type="plane" size="1 1 .1"/>
    <body name="{name}"><joint name="{name}" type="slide" axis="0 0 1"/>
    <geom name="{name}" type="sphere" size="0.1" mass="1"/></body></worldbody>
    <actuator><motor name="{name}" joint="{name}"/></actuator></mujoco>"""
    escaped = HOSTILE.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    robot = read_mjcf(xml.format(name=escaped), name=HOSTILE)
    assert HOSTILE in robot.actuator_names
    event = Event(0.0, EventKind.TOUCHDOWN, 0, (1.0, 0.0))
    run = make_run(robot, [0.0, 0.1], events=[event], message=HOSTILE)
    path = save_html(run, tmp_path / "run.html", command=HOSTILE)
    text = path.read_text(encoding="utf-8")
    page, content = read(path)
    assert "img" not in {tag for tag, _ in page.elements}
    assert "onerror=alert" in text  # it is there, as text
    assert content["scene"]["robot"] == HOSTILE
    assert text.count("<script") == text.count("</script") == 2


def test_scene_is_what_a_live_viewer_needs() -> None:
    robot = walking.bravo7()
    found = scene(robot, hs.Ground.stairs(rise=0.1, tread=0.3, count=2))
    assert found == json.loads(json.dumps(found))
    assert {shape["foot"] for shape in found["shapes"]} == {-1, 0, 1}
    assert len(found["ground"]) == 2 * 6
    assert found["weight"] == pytest.approx(75.0 * 9.81)


def test_a_bone_between_links_knows_both() -> None:
    """Robots without shapes are drawn by bones, whose other end may be a child's frame."""
    found = scene(pendulum(), hs.Ground())
    assert all(len(shape["corners"]) == 4 for shape in found["shapes"])


def test_brakes_are_shown_with_what_they_hold_at_most(tmp_path: Path) -> None:
    build = hs.RobotBuilder("crane")
    build.hinge("boom", None, mass=2.0, inertia=0.05, center_of_mass=(0, -0.8))
    build.brake("boom", limit=20.0)
    crane = build.build()
    start = crane.state({"boom": 0.5}, {"boom": 1.0})
    run = hs.simulate(crane, state=start, duration=0.01, braked="boom")
    _, data = read(save_html(run, tmp_path / "crane.html"))
    (panel,) = (each for each in data["plots"] if each["title"] == "boom brake")
    assert panel["unit"] == "N m"
    assert [limit["level"] for limit in panel["limits"]] == [-20.0, 20.0]


def test_bad_requests(tmp_path: Path) -> None:
    run = make_run(box(), [0.0, 0.1])
    with pytest.raises(ViewError, match=r"ends in \.html"):
        save_html(run, tmp_path / "run.txt")
    with pytest.raises(hs.ViewError, match="load_gait"):
        save_html(run, tmp_path / "run.html", gait="gait.json")  # type: ignore[arg-type]
    with pytest.raises(ViewError, match="there is no folder"):
        save_html(run, tmp_path / "none" / "run.html")
    with pytest.raises(ViewError, match="has no rows"):
        save_html(make_run(box(), []), tmp_path / "run.html")


@pytest.mark.parametrize("kind", EventKind)
def test_events_say_where_they_were_and_in_which_unit(kind: EventKind, tmp_path: Path) -> None:
    """Indices of joints are none of contact points, and a bridge has neither, nor an impulse."""
    robot = box()
    if kind.of_constraint:
        robot = hs.constrained(robot, Pin(), Pin())
    turns = robot.model.axis[:, 0] != 0.0
    at = (int(turns.argmax()), int(turns.argmin())) if kind.of_joint else (0, 1)
    events = [Event(0.05, kind, index, (0.5, 0.1)) for index in at]
    run = make_run(robot, [0.0, 0.1], events=events)
    _, content = read(save_html(run, tmp_path / "run.html"))
    told = [
        (each["contact"], each["where"], each["impulse"], each["unit"])
        for each in content["events"]
    ]
    if kind is EventKind.BRIDGE:
        assert told == [(-1, "", 0.0, "")] * 2
    elif kind.of_constraint:
        assert told == [(-1, name, 0.5, "N s") for name in ("Pin 1", "Pin 2")]
    elif kind.of_joint:
        names = [robot.joint_names[i].replace("_", " ") for i in at]
        assert told == [(-1, names[0], 0.5, "N m s"), (-1, names[1], 0.5, "N s")]
    else:
        names = [name.replace("_", " ") for name in robot.contact_names]
        assert told == [(i, names[i], 0.5, "N s") for i in at]
