"""The checksum of a JSON file sees every change of what it says, and none of how it says it."""

from __future__ import annotations

import json

from heelstrike.json_checksum import KEY, is_changed, with_checksum

DATA = {"a": [1.5, -0.0, 5e-324], "b": {"c": None, "d": "ä\ud800"}, "e": True}


def test_what_is_said_counts_and_not_how() -> None:
    data = with_checksum(DATA)
    assert set(data) == {*DATA, KEY}
    assert not is_changed(data)
    assert not is_changed(DATA)
    again = json.loads(json.dumps(dict(reversed(data.items())), indent=3))
    assert not is_changed(again)
    assert with_checksum(data) == data


def test_every_change_is_seen() -> None:
    for change in (
        {"a": [1.5, 0.0, 5e-324]},
        {"e": 1},
        {"f": 0},
        {"b": {}},
        {KEY: ""},
        {KEY: None},
    ):
        assert is_changed(with_checksum(DATA) | change), change
    nested: list[object] = []
    for _ in range(100_000):
        nested = [nested]
    assert is_changed(with_checksum(DATA) | {"deep": nested})
