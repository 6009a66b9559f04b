"""What reaches somebody who looks: updates per second and latency through the viewer's own server.

    python benchmarks/viewer_rate.py [--seconds 20] [--method perimeter]

Motion JPEG of 2560 x 1440 px comes over HTTP on loopback at 30 pictures per second, from another process, and
is read live. A client in a third process connects to the viewer as a browser does, unpacks every update of
100 x 60 points with its picture, and measures from the frame's arrival to the unpacked arrays.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from bench_live import serve, write_pictures
from websockets.sync.client import connect

from manytouch.session import Live, prepare
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.messages import unpack

SKIP_S = 3.0


def listen(url: str, seconds: float) -> None:
    """Take in updates as a browser does, and print what came."""
    at_s: list[float] = []
    latency_ms: list[float] = []
    frames: list[int] = []
    sizes: list[int] = []
    with connect(url.replace("http", "ws", 1) + "stream", max_size=2**24, compression=None) as stream:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            message = stream.recv(timeout=60)
            if isinstance(message, str):
                continue
            head, parts = unpack(message)
            now_ns = time.monotonic_ns()
            stream.send(json.dumps({"type": "ack", "number": head["number"]}))
            depth = parts["depth"]
            assert isinstance(depth, np.ndarray)
            assert depth.shape == (60, 100)
            assert np.isfinite(depth).any()
            at_s.append(time.monotonic())
            latency_ms.append((now_ns - head["arrived_ns"]) * 1e-6)
            frames.append(head["frame"])
            sizes.append(len(message))
    later = np.array(at_s) > at_s[0] + SKIP_S
    times, frame = np.array(at_s)[later], np.array(frames)[later]
    p50, p99 = np.percentile(np.array(latency_ms)[later], (50, 99))
    rate = (len(times) - 1) / (times[-1] - times[0])
    print(f"{len(times)} updates of 100 x 60 points with picture, {np.mean(sizes) / 1e3:.0f} kB each")
    print(f"{rate:.1f} per second; {int(frame[-1] - frame[0] + 1 - len(frame))} frames not shown")
    print(f"latency from arrival to unpacked arrays: p50 {p50:.1f} ms, p99 {p99:.1f} ms", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--method", default="perimeter")
    parser.add_argument("--listen", default=None, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.listen is not None:
        listen(asked.listen, asked.seconds)
        return
    with tempfile.TemporaryDirectory() as folder:
        write_pictures(Path(folder), 90, asked.fps)
        camera, address = serve(Path(folder), asked.fps)
        try:
            measure(address, asked)
        finally:
            camera.terminate()
            camera.wait()


def measure(address: str, asked: argparse.Namespace) -> None:
    """Run a session until the client has heard enough."""
    live = Live(prepare(address, sensor=demo_sensor(2560), method=asked.method))
    viewer, over = Viewer(live), threading.Event()
    session = threading.Thread(target=lambda: live.run([LatestOnly(viewer)], stop=over.is_set))
    session.start()
    while live.health().frames < 30:
        time.sleep(0.1)
    dropped = live.health().dropped
    words = [sys.executable, __file__, "--listen", viewer.url, "--seconds", str(asked.seconds)]
    print(f"load of the machine {os.getloadavg()[0]:.1f}", flush=True)
    subprocess.run(words, check=True)
    print(f"{live.health().dropped - dropped} frames dropped by the pipeline meanwhile")
    over.set()
    session.join()


if __name__ == "__main__":
    main()
