"""What all viewers see: whoever comes later is told all of it, whoever is there what is new."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from heelstrike.robot.model import Floats

Message = str | bytes
Listener = Callable[[Message], None]

KEPT, GLANCE = 0.0, 1.0
"""First number of a message of frames: whether they belong to the course, or are looked at only."""
MOST_FRAMES = 20_000


class Board:
    """Scene, frames, events and state of a session, for as many viewers as there are.

    Its methods may be called from any thread. Listeners are called in that of whoever puts
    something up, one message after the other, and must be quick.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: list[Listener] = []
        self._scene: Mapping[str, Any] | None = None
        self._frames: list[Floats] = []
        self._glance: Floats | None = None
        self._events: list[Any] = []
        self._state: dict[str, Any] = {}

    @property
    def watched(self) -> bool:
        """Whether anybody is there."""
        return bool(self._listeners)

    def join(self, listener: Listener) -> None:
        """Tell a listener everything so far, and from now on what is new."""
        with self._lock:
            if self._scene is not None:
                listener(_text("scene", self._scene))
                if self._frames:
                    listener(_numbers(KEPT, self._frames))
                if self._glance is not None:
                    listener(_numbers(GLANCE, [self._glance]))
                listener(_text("events", {"events": self._events}))
            if self._state:
                listener(_text("state", self._state))
            self._listeners.append(listener)

    def leave(self, listener: Listener) -> None:
        """Tell a listener nothing more."""
        with self._lock:
            if listener in self._listeners:
                self._listeners.remove(listener)

    def begin(self, scene: Mapping[str, Any]) -> None:
        """Begin with a scene, before which there was nothing."""
        with self._lock:
            self._scene = scene
            self._frames, self._glance, self._events = [], None, []
            self._tell(_text("scene", scene))

    def add(self, frames: Floats, events: Sequence[Any] = ()) -> None:
        """Go on by some frames (n, width) and events; the last frame is shown."""
        with self._lock:
            self._glance = None
            if len(frames):
                self._frames += list(frames)
                del self._frames[: max(len(self._frames) - MOST_FRAMES, 0)]
                self._tell(_numbers(KEPT, frames))
            if events:
                self._events += events
                del self._events[: max(len(self._events) - MOST_FRAMES, 0)]
                self._tell(_text("events", {"events": list(events)}))

    def look(self, frame: Floats) -> None:
        """Show another frame than the last one."""
        with self._lock:
            self._glance = frame
            self._tell(_numbers(GLANCE, [frame]))

    def cut(self, time: float) -> None:
        """Forget frames and events later than a time (s)."""
        with self._lock:
            self._glance = None
            self._frames = [frame for frame in self._frames if frame[0] <= time]
            self._events = [event for event in self._events if event[0] <= time]
            self._tell(_text("cut", {"time": time}))

    def state(self, state: Mapping[str, Any]) -> None:
        """Tell what has changed of the state."""
        with self._lock:
            changed = {
                name: value
                for name, value in state.items()
                if name not in self._state or self._state[name] != value
            }
            if changed:
                self._state |= changed
                self._tell(_text("state", changed))

    def _tell(self, message: Message) -> None:
        for listener in self._listeners:
            listener(message)


def _text(kind: str, content: Mapping[str, Any]) -> str:
    return json.dumps({"kind": kind, **content}, allow_nan=False)


def _numbers(kind: float, frames: Sequence[Floats] | Floats) -> bytes:
    table = np.asarray(frames, dtype="<f8")
    return np.concatenate(([kind], table.ravel())).astype("<f8", copy=False).tobytes()
