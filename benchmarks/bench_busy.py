"""How soon a press with the mouse shows in the demo, alone and with programs that keep processors busy.

    python benchmarks/bench_busy.py [--busy 1] [--presses 6]

The demo runs with its viewer in this process. A client presses the simulated sheet and measures the time
until an update shows the press at that place. With threads of BLAS that wait for each other this took 6.85 s
with one busy processor; alone it took 0.25 s.
"""

import argparse
import json
import os
import subprocess
import sys
import threading
import time

import numpy as np
from websockets.sync.client import ClientConnection, connect

from manytouch.session import Live, prepare, run
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.update_format import unpack
from manytouch.sources.pressed.pressed_process import PressedProcess

DEPTH_MM, SHOWN_MM, GONE_MM = 4.0, 1.0, 0.3
PLACES_MM = ((-20.0, 8.0), (15.0, -10.0), (30.0, 12.0))
GOAL_S = 1.0


def depth_at(
    parts: dict[str, np.ndarray], grid: dict[str, np.ndarray], place_mm: tuple[float, float]
) -> float:
    """Depth that an update shows next to a place, mm."""
    column, row = (
        int(np.abs(grid[axis] - place_mm[number]).argmin()) for number, axis in enumerate(("x_mm", "y_mm"))
    )
    return float(np.nanmax(parts["depth"][max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]))


def wait_for(
    stream: ClientConnection, grid: dict[str, np.ndarray], place_mm: tuple[float, float], is_down: bool
) -> float:
    """Time until the press shows, or no longer does, s."""
    begin_s = time.monotonic()
    while True:
        message = stream.recv(timeout=60)
        if isinstance(message, str):
            content = json.loads(message)
            if content["kind"] == "scene_info":
                grid |= {axis: np.array(content[axis]) for axis in ("x_mm", "y_mm")}
            continue
        head, parts = unpack(message)
        stream.send(json.dumps({"type": "ack", "number": head["number"]}))
        if grid:
            depth_mm = depth_at(parts, grid, place_mm)
            if depth_mm > SHOWN_MM if is_down else depth_mm < GONE_MM:
                return time.monotonic() - begin_s


def measure(viewer: Viewer, presses: int) -> np.ndarray:
    """Times until each press shows, s."""
    assert viewer.token_file is not None
    headers = {"Authorization": f"Bearer {viewer.token_file.read_text()}"}
    grid: dict[str, np.ndarray] = {}
    found = []
    with connect(viewer.access.stream_url, additional_headers=headers, max_size=2**24) as stream:
        for number in range(presses):
            x_mm, y_mm = PLACES_MM[number % len(PLACES_MM)]
            stream.send('{"type": "release", "finger": 1}')
            wait_for(stream, grid, (x_mm, y_mm), is_down=False)
            press = {"type": "press", "finger": 1, "x_mm": x_mm, "y_mm": y_mm, "depth_mm": DEPTH_MM}
            stream.send(json.dumps(press))
            found.append(wait_for(stream, grid, (x_mm, y_mm), is_down=True))
    return np.array(found[1:])  # the first one lifts the bodies of the scene


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--busy", type=int, default=1, help="programs that keep a processor busy")
    parser.add_argument("--presses", type=int, default=7)
    options = parser.parse_args()
    live = Live(prepare(PressedProcess(), method="mechanics"))
    viewer, over = Viewer(live), threading.Event()
    session = threading.Thread(target=run, args=(live, [LatestOnly(viewer)], None, over.is_set))
    session.start()
    try:
        while live.health().frames < 30:
            time.sleep(0.1)
        print(f"load of the machine {os.getloadavg()[0]:.1f}", flush=True)
        for count in (0, options.busy):
            busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
            try:
                shown_s = measure(viewer, options.presses)
            finally:
                for process in busy:
                    process.kill()
                    process.wait()
            is_met = "" if shown_s.max() < GOAL_S else f" (goal: {GOAL_S:g} s)"
            print(
                f"with {count} busy loops: a press shows after {np.median(shown_s):.2f} s, at most "
                f"{shown_s.max():.2f} s{is_met}; {live.health().readings_per_s:.0f} readings per second",
                flush=True,
            )
    finally:
        over.set()
        session.join()


if __name__ == "__main__":
    main()
