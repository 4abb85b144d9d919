"""Gaits as files: what is saved comes back, and nothing else gets in."""

from __future__ import annotations

import dataclasses
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damage import damaged_bytes, damaged_json
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_files import SAVED

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait import Footing


@pytest.fixture
def saved(gait: hs.Gait, tmp_path: Path) -> Path:
    path = tmp_path / "gait.json"
    gait.save(path)
    return path


def test_round_trip_keeps_every_digit(gait: hs.Gait, bravo7: hs.Robot, saved: Path) -> None:
    loaded = hs.load_gait(saved, bravo7)
    for field in dataclasses.fields(gait):
        there, here = getattr(gait, field.name), getattr(loaded, field.name)
        if isinstance(there, hs.State):
            np.testing.assert_array_equal(there.q, here.q)
            np.testing.assert_array_equal(there.v, here.v)
        elif field.name == "phases":
            assert [phase.contacts for phase in there] == [phase.contacts for phase in here]
        elif isinstance(there, np.ndarray):
            assert there.dtype == here.dtype
            np.testing.assert_array_equal(there, here)
        else:
            assert there == here
    np.testing.assert_array_equal(loaded.coefficients, gait.coefficients)
    np.testing.assert_array_equal(loaded.breakpoints, gait.breakpoints)


def test_saving_again_gives_the_same_file(saved: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.json"
    hs.load_gait(str(saved)).save(str(again))
    assert again.read_bytes() == saved.read_bytes()


def test_the_file_is_for_reading(gait: hs.Gait, saved: Path) -> None:
    data = json.loads(saved.read_text(encoding="utf-8"))
    assert data["format"] == "heelstrike gait"
    assert data["version"] == 2
    assert data["step_length_m"] == 0.3
    assert data["joints"] == list(gait.joint_names)
    assert len(data["initial_position"]) == 9
    assert data["phases"][0]["contacts"] == {"0": "flat"}
    assert saved.stat().st_size < 5000


def test_a_robot_without_limits_has_no_margin_to_them(gait: hs.Gait, tmp_path: Path) -> None:
    unlimited = dataclasses.replace(gait.margins, torque=np.inf, joint_range=np.inf)
    path = tmp_path / "gait.json"
    dataclasses.replace(gait, margins=unlimited).save(path)
    assert "Infinity" not in path.read_text(encoding="utf-8")
    assert hs.load_gait(path).margins == unlimited


def test_the_wrong_robot_is_refused(
    saved: Path, bravo7: hs.Robot, spring_flamingo: hs.Robot
) -> None:
    with pytest.raises(GaitError, match=r"gait\.json: is a gait of robot 'bravo7'"):
        hs.load_gait(saved, spring_flamingo)
    heavier = bravo7.model.replaced(mass=1.1 * bravo7.model.mass)
    with pytest.raises(GaitError, match="another version of robot 'bravo7'"):
        hs.load_gait(saved, dataclasses.replace(bravo7, model=heavier))
    reordered = bravo7.model.replaced(actuator_joint=bravo7.model.actuator_joint[::-1].copy())
    with pytest.raises(GaitError, match="has actuators at"):
        hs.load_gait(saved, dataclasses.replace(bravo7, model=reordered))


def delete(key: str) -> Callable[[dict[str, Any]], object]:
    return lambda data: data.pop(key)


def in_phase(
    spoil: Callable[[dict[str, Any]], object],
) -> Callable[[dict[str, Any]], object]:
    return lambda data: spoil(data["phases"][0])


def put(key: str, value: Any) -> Callable[[dict[str, Any]], object]:
    return lambda data: data.update({key: value})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (delete("format"), "not a gait file"),
        (put("format", "heelstrike run"), "not a gait file"),
        (put("version", 3), "newer heelstrike"),
        (put("version", [2]), "newer heelstrike"),
        (put("version", True), "newer heelstrike"),
        (delete("cost_N2m2s"), '"cost_N2m2s" is missing'),
        (delete("phases"), '"phases" is missing'),
        (put("phases", {}), '"phases" must be a list'),
        (put("phases", []), "one phase or more"),
        (put("phases", [0.0]), "must stand where 0.0 does"),
        (in_phase(delete("breakpoints_s")), '"breakpoints_s" is missing'),
        (in_phase(put("contacts", [0])), '"contacts" must be an object'),
        (in_phase(put("contacts", {"7": "flat"})), '"contacts" must name feet'),
        (in_phase(put("contacts", {})), '"contacts" must name feet'),
        (in_phase(put("contacts", {"0": "toe"})), '"0" must be one of "flat", "point"'),
        (in_phase(put("breakpoints_s", [0.0, 1e300])), "which no gait has"),
        (in_phase(put("breakpoints_s", [0.0, 0.0])), "must rise from 0"),
        (
            in_phase(put("joint_pieces", [[[0.0] * 5] * 4])),
            '"joint_pieces" must hold lists of 6 numbers',
        ),
        (in_phase(put("joint_pieces", [[["0"] * 6] * 4])), "must be a number"),
        (delete("margins"), '"margins" is missing'),
        (put("margins", []), '"margins" must be an object'),
        (put("margins", {}), "is missing"),
        (put("mirror_offset_rad", [0.0] * 5), "a list of 6 numbers"),
        (put("mirror_offset_rad", [[0.0] * 6]), "must be a list of 6 numbers"),
        (put("mirror_offset_rad", ["0"] * 6), "must be a number"),
        (put("mirror_offset_rad", [True] * 6), "must be a number"),
        (put("mirror_offset_rad", 0.0), "a list of 6 numbers"),
        (put("step_length_m", None), "must be a number"),
        (put("step_length_m", -0.3), "not negative"),
        (put("step_length_m", 1e300), "which no gait has"),
        (put("step_length_m", 10**400), "which no gait has"),
        (put("joints", []), "different names"),
        (put("joints", ["a", "a"]), "different names"),
        (put("joints", ["a", 1]), "different names"),
        (put("robot", 3), "must be a text"),
        (put("mirror_joint", [0] * 6), "permutation"),
        (put("mirror_sign", [0.5] * 6), "mirror_sign"),
        (put("clearance_profile", "triangle"), '"parabola", "smooth"'),
        (put("initial_position", [0.0] * 6), "a list of 9 numbers"),
    ],
)
def test_spoilt_entries_are_named(
    saved: Path, spoil: Callable[[dict[str, Any]], object], message: str
) -> None:
    data = json.loads(saved.read_text(encoding="utf-8"))
    spoil(data)
    saved.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(GaitError) as caught:
        hs.load_gait(saved)
    assert str(saved) in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not valid JSON"),
        (b"{", "line 1"),
        (b"step_length: 0.3", "not valid JSON"),
        (b"[]", "not a gait file"),
        (b"null", "not a gait file"),
        (b'"heelstrike gait"', "not a gait file"),
        (b'{"step_length_m": NaN}', "contains NaN"),
        (b'{"step_length_m": -Infinity}', "contains -Infinity"),
        (b"\x80\x04\x95\x00\xff\xfe", "not a text file"),
        (b"\x89HDF\r\n\x1a\n", "not a text file"),
        (b"[" * 200_000, "not a gait file"),
        (b'{"format": ' + b"9" * 10_000 + b"}", "not a gait file"),
        (b" " * (2**20 + 1), "larger than 1 MB"),
    ],
    ids=lambda value: repr(value[:20]),
)
def test_other_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "other.json"
    path.write_bytes(content)
    with pytest.raises(GaitError) as caught:
        hs.load_gait(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)


def test_a_place_that_cannot_be_written_is_named(gait: hs.Gait, tmp_path: Path) -> None:
    for path in (tmp_path / "missing" / "gait.json", tmp_path):
        with pytest.raises(GaitError, match="cannot write "):
            gait.save(path)


def test_paths_that_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(GaitError, match="is a directory"):
        hs.load_gait(tmp_path)
    with pytest.raises(GaitError, match="no such file"):
        hs.load_gait(tmp_path / "nothing.json")
    with pytest.raises(GaitError, match=r"not a path to a file|no such file"):
        hs.load_gait("gait\0.json")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(st.data())
def test_mutated_files_load_or_are_refused_in_words(saved: Path, data: st.DataObject) -> None:
    text = saved.read_text(encoding="utf-8")
    place = data.draw(st.integers(0, len(text) - 1))
    length = data.draw(st.integers(0, 30))
    mutated = text[:place] + data.draw(st.text(max_size=8)) + text[place + length :]
    path = saved.with_name("mutated.json")
    path.write_text(mutated, encoding="utf-8", errors="replace")
    try:
        loaded = hs.load_gait(path)
    except GaitError as error:
        message = str(error)
    else:
        message = str(path)
        assert np.all(np.isfinite(loaded.coefficients))
    assert str(path) in message


@pytest.mark.parametrize("damage", [damaged_bytes, damaged_json])
def test_damaged_files_are_refused_in_words_or_still_gaits(
    damage: Callable[[bytes, random.Random], bytes], bravo7: hs.Robot, tmp_path: Path
) -> None:
    content = (SAVED / "gait.json").read_bytes()
    path = tmp_path / "gait.json"
    refused = []
    for seed in range(150):
        path.write_bytes(damage(content, random.Random(seed)))
        for robot in (None, bravo7):
            try:
                gait = hs.load_gait(path, robot)
            except GaitError as error:
                refused.append(str(error))
            else:
                assert np.all(np.isfinite(gait.coefficients)), seed
    assert len(refused) > 100
    assert all(str(path) in words and len(words) < 2000 for words in refused)


def test_files_of_version_0_1_still_load(bravo7: hs.Robot, tmp_path: Path) -> None:
    gait = hs.load_gait(SAVED / "gait.json", bravo7)
    assert (gait.step_length, gait.step_duration) == (0.3, 0.7)
    before = json.loads((SAVED / "gait.json").read_text(encoding="utf-8"))
    for name, unit in (("position", "rad"), ("velocity", "rad_per_s")):
        for end in ("start", "end"):
            found = getattr(gait, f"{end}_{name}")
            np.testing.assert_allclose(found, before[f"{end}_{name}_{unit}"], atol=1e-14)
    assert gait.phases[0].contacts == {before["stance_foot"]: Footing.FLAT}
    gait.save(tmp_path / "again.json")
    again = json.loads((tmp_path / "again.json").read_text(encoding="utf-8"))
    same = before.keys() & again.keys() - {"version"}
    assert len(same) == 16
    assert {key: again[key] for key in same} == {key: before[key] for key in same}


def test_files_of_version_1_with_pieces_still_load(saved: Path) -> None:
    """What point feet had: pieces beside the cubics' ends, which say the same once more."""
    data = json.loads((SAVED / "gait.json").read_text(encoding="utf-8"))
    draw = np.random.default_rng(2)
    pieces, pitch = draw.normal(size=(3, 6, 6)), draw.normal(size=(3, 6))
    data |= {"breakpoints_s": [0.0, 0.2, 0.5, 0.7], "joint_pieces": pieces.tolist()}
    saved.write_text(json.dumps(data | {"pitch_pieces": pitch.tolist()}), encoding="utf-8")
    gait = hs.load_gait(saved)
    assert gait.phases[0].contacts == {0: Footing.POINT}
    np.testing.assert_array_equal(gait.pieces, pieces)
    np.testing.assert_array_equal(gait.breakpoints, [0.0, 0.2, 0.5, 0.7])
    np.testing.assert_array_equal(gait.pitch([0.0, 0.2, 0.5]), pitch[:, 0])
    saved.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(GaitError, match='"pitch_pieces" is missing'):
        hs.load_gait(saved)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (delete("start_position_rad"), '"start_position_rad" is missing'),
        (put("end_velocity_rad_per_s", [0.0] * 5), "a list of 6 numbers"),
        (put("step_duration_s", 0), "must be positive"),
        (put("step_duration_s", 1e300), "which no gait has"),
        (put("stance_foot", 0.5), "stance_foot must be 0 or 1"),
        (put("stance_foot", 7), "stance_foot must be 0 or 1"),
    ],
)
def test_spoilt_entries_of_version_1_are_named(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], object], message: str
) -> None:
    data = json.loads((SAVED / "gait.json").read_text(encoding="utf-8"))
    spoil(data)
    path = tmp_path / "gait.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(GaitError) as caught:
        hs.load_gait(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)


def test_one_digit_that_is_another(saved: Path) -> None:
    text = saved.read_text(encoding="utf-8")
    place = text.index("joint_pieces") + 30
    digit = next(i for i in range(place, len(text)) if text[i] in "12345678")
    saved.write_text(f"{text[:digit]}9{text[digit + 1 :]}", encoding="utf-8")
    with pytest.raises(GaitError, match=r"gait\.json: damaged: .* remove the entry \"sha256\""):
        hs.load_gait(saved)
    data = json.loads(saved.read_text(encoding="utf-8"))
    del data["sha256"]
    saved.write_text(json.dumps(data), encoding="utf-8")
    hs.load_gait(saved)
