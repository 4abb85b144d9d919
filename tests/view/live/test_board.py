"""What all viewers see."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from heelstrike.view.live import board
from heelstrike.view.live.board import GLANCE, KEPT, Board

WIDTH = 3


class Viewer:
    """Somebody who keeps what the board says, as the page does."""

    def __init__(self) -> None:
        self.scene: Any = None
        self.frames = np.zeros((0, WIDTH))
        self.glance: Any = None
        self.events: list[Any] = []
        self.state: dict[str, Any] = {}

    def __call__(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            numbers = np.frombuffer(message, dtype="<f8")
            frames = numbers[1:].reshape(-1, WIDTH)
            if numbers[0] == KEPT:
                self.frames, self.glance = np.concatenate((self.frames, frames)), None
            else:
                assert numbers[0] == GLANCE
                self.glance = frames[0]
            return
        content = json.loads(message)
        kind = content.pop("kind")
        if kind == "scene":
            self.__init__()  # type: ignore[misc]
            self.scene = content
        elif kind == "cut":
            self.frames = self.frames[self.frames[:, 0] <= content["time"]]
            self.glance = None
            self.events = [each for each in self.events if each[0] <= content["time"]]
        elif kind == "events":
            self.events += content["events"]
        else:
            self.state |= content

    def sees(self) -> Any:
        glance = None if self.glance is None else self.glance.tolist()
        return self.scene, self.frames.tolist(), glance, self.events, self.state


def frames(*times: float) -> np.ndarray:
    return np.array([[time, 2.0 * time, np.nan_to_num(-time)] for time in times])


def test_whoever_comes_later_sees_the_same() -> None:
    shown, early = Board(), Viewer()
    shown.join(early)
    shown.begin({"robot": "a"})
    shown.add(frames(0.0, 0.1))
    shown.begin({"robot": "b"})
    shown.state({"playing": True, "rate": 1.0})
    shown.add(frames(0.0, 0.1, 0.2), [[0.1, 0, "heel", 0], [0.2, 1, "toe", 1]])
    shown.look(frames(0.1)[0])
    for change in (
        lambda: None,
        lambda: shown.cut(0.15),
        lambda: shown.add(frames(0.16), [[0.16, 2, "toe", 1]]),
        lambda: shown.state({"playing": False, "rate": 1.0}),
        lambda: shown.look(frames(0.0)[0]),
    ):
        change()
        late = Viewer()
        shown.join(late)
        shown.leave(late)
        assert late.sees() == early.sees()
    assert early.frames[:, 0].tolist() == [0.0, 0.1, 0.16]
    assert early.events == [[0.1, 0, "heel", 0], [0.16, 2, "toe", 1]]
    assert early.state == {"playing": False, "rate": 1.0}


def test_only_what_has_changed_is_told() -> None:
    shown, told = Board(), []
    shown.state({"playing": True, "rate": 1.0})
    shown.join(told.append)
    told.clear()
    shown.state({"playing": True, "rate": 1.0})
    assert told == []
    shown.state({"playing": True, "rate": 2.0})
    assert [json.loads(each) for each in told] == [{"kind": "state", "rate": 2.0}]


def test_whoever_left_is_told_nothing() -> None:
    shown, told = Board(), []
    assert not shown.watched
    shown.join(told.append)
    assert shown.watched
    shown.leave(told.append)
    shown.begin({})
    assert not shown.watched
    assert told == []


def test_the_oldest_frames_go(monkeypatch) -> None:
    monkeypatch.setattr(board, "MOST_FRAMES", 5)
    shown, late = Board(), Viewer()
    shown.begin({})
    for time in range(9):
        shown.add(frames(float(time)), [[float(time), 0, "", 0]])
    shown.join(late)
    assert late.frames[:, 0].tolist() == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert len(late.events) == 5
