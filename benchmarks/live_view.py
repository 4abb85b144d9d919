"""What a live view costs, and how long a push takes: ``python benchmarks/live_view.py``.

Serves bravo7 at 1 ms and real time in a process of its own, watches it over its socket as a page
does, and prints updates a second, the processor time of the serving process as a share of one core,
and the time from sending a push to receiving the frame in which its force acts.

With `--first` it tells instead how long after opening the page of ``heelstrike watch bravo7`` in
chromium there is a picture, and how long until the robot walks.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from websockets.sync.client import ClientConnection, connect

import heelstrike as hs
from heelstrike.view.live.viewer import view

PUSHES = 20


def serve() -> None:
    """Serve a walk; answer a line on standard input with the processor time used so far (s)."""
    from heelstrike.view.live.stage import GivenStage

    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    simulation = hs.Simulation(
        robot,
        hs.ComputedTorque(robot, gait),
        state=gait.initial_state,
        method=hs.TimeStepping(step=1e-3),
    )
    with view(stage=GivenStage(simulation)) as viewer:
        print(viewer.url, flush=True)
        for _ in sys.stdin:
            print(time.process_time(), flush=True)


def frames(connection: ClientConnection, width: int) -> np.ndarray:
    """Wait for the next frames."""
    while True:
        message = connection.recv()
        if isinstance(message, bytes):
            return np.frombuffer(message)[1:].reshape(-1, width)


def first_picture(times: int) -> None:
    """Open the page of a command that has just begun, several times."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from browsers import browser

    clock = "() => Number(document.getElementById('plane')?.dataset.time ?? -1)"
    with browser() as chromium:
        for _ in range(times):
            command = [sys.executable, "-m", "heelstrike", "watch", "bravo7", "--no-browser"]
            started = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
            assert started.stderr is not None
            url = started.stderr.readline().removeprefix("watch at ").strip()
            page = chromium.new_page()
            begin = time.perf_counter()
            page.goto(url)
            while not page.evaluate(clock) >= 0.0:
                time.sleep(0.01)
            seen = time.perf_counter() - begin
            while not page.evaluate(clock) > 0.0:
                time.sleep(0.01)
            print(f"first picture {seen:.2f} s, walks {time.perf_counter() - begin:.2f} s")
            page.close()
            started.terminate()
            started.wait()


def main() -> None:
    """Serve, watch, and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="how long to watch")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--first", action="store_true", help="time of the first picture")
    options = parser.parse_args()
    if options.first:
        first_picture(3)
        return
    if options.serve:
        serve()
        return
    server = subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert server.stdin is not None
    assert server.stdout is not None

    def used() -> float:
        server.stdin.write("\n")
        server.stdin.flush()
        return float(server.stdout.readline())

    url = urlsplit(server.stdout.readline().strip())
    socket = f"ws://{url.netloc}/live?{url.query}"
    with connect(socket, origin=f"http://{url.netloc}", max_size=None) as connection:
        layout = None
        while layout is None:
            message = connection.recv()
            if isinstance(message, str) and json.loads(message)["kind"] == "scene":
                layout = json.loads(message)["layout"]
        for _ in range(120):  # what is done once is done
            frames(connection, layout["width"])
        begin, cpu, updates = time.perf_counter(), used(), 0
        simulated = frames(connection, layout["width"])[-1, 0]
        while time.perf_counter() < begin + options.seconds:
            last = frames(connection, layout["width"])
            updates += 1
        elapsed, cpu = time.perf_counter() - begin, used() - cpu
        simulated = last[-1, 0] - simulated
        push, _ = layout["fields"]["push"]
        delays = []
        for _ in range(PUSHES):
            sent = time.perf_counter()
            hold = {"do": "hold", "link": 2, "point": [0.0, 0.3], "force": [3.0, 0.0]}
            connection.send(json.dumps(hold))
            while not np.isfinite(frames(connection, layout["width"])[-1, push]):
                pass
            delays.append(time.perf_counter() - sent)
            connection.send(json.dumps({"do": "release"}))
            while np.isfinite(frames(connection, layout["width"])[-1, push]):
                pass
    server.stdin.close()
    server.wait()
    delays.sort()
    print(f"{updates / elapsed:.1f} updates a second, × {simulated / elapsed:.3f} of real time")
    print(f"{100.0 * cpu / elapsed:.1f} % of one core")
    print(
        f"push to force: median {1e3 * delays[len(delays) // 2]:.0f} ms, "
        f"longest of {PUSHES} {1e3 * delays[-1]:.0f} ms"
    )


if __name__ == "__main__":
    main()
