"""Updates per second and latency of the viewer, measured by a client.

    python benchmarks/viewer_rate.py [--seconds 20] [--method perimeter] [--change PARAMETER]

Motion JPEG of 2560 x 1440 px arrives over HTTP on loopback at 30 images per second from another process and
is processed live. A client in a third process connects to the viewer, decodes every update of 100 x 60 points
with its image, and measures the time from the arrival of the frame to the decoded arrays. With --change that
parameter, a number such as interpolation.search_radius_pitch, is changed each second.
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

from manytouch.session import Live, prepare, run
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.update_format import unpack
from manytouch.values import Tune

SKIP_S = 3.0
FACTORS = (1.0, 1.2, 1.4, 1.2)
"""Of a parameter that is changed, relative to its value."""


def listen(url: str, token: str, seconds: float) -> None:
    """Receive updates as a browser does, and print their rate and latency."""
    at_s: list[float] = []
    latency_ms: list[float] = []
    frames: list[int] = []
    sizes: list[int] = []
    headers = {"Authorization": f"Bearer {token}"}
    with connect(url, additional_headers=headers, max_size=2**24, compression=None) as stream:
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
    print(f"{len(times)} updates of 100 x 60 points with image, {np.mean(sizes) / 1e3:.0f} kB each")
    print(f"{rate:.1f} per second; {int(frame[-1] - frame[0] + 1 - len(frame))} frames skipped")
    print(f"latency from arrival to decoded arrays: p50 {p50:.1f} ms, p99 {p99:.1f} ms", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--method", default="perimeter")
    parser.add_argument("--change", default=None, help="parameter to change each second")
    parser.add_argument("--listen", default=None, help=argparse.SUPPRESS)
    parser.add_argument("--token-file", default=None, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.listen is not None:
        listen(options.listen, Path(options.token_file).read_text(), options.seconds)
        return
    with tempfile.TemporaryDirectory() as folder:
        write_pictures(Path(folder), 90, options.fps)
        camera, address = serve(Path(folder), options.fps)
        try:
            measure(address, options)
        finally:
            camera.terminate()
            camera.wait()


def measure(address: str, options: argparse.Namespace) -> None:
    """Run a session until the client has finished."""
    live = Live(prepare(address, sensor=demo_sensor(2560), method=options.method))
    viewer, over = Viewer(live), threading.Event()
    session = threading.Thread(target=lambda: run(live, [LatestOnly(viewer)], stop=over.is_set))
    session.start()
    while live.health().frames < 30:
        time.sleep(0.1)
    dropped = live.health().dropped
    command = [sys.executable, __file__, "--listen", viewer.access.stream_url]
    command += ["--token-file", str(viewer.token_file), "--seconds", str(options.seconds)]
    print(f"load of the machine {os.getloadavg()[0]:.1f}", flush=True)
    client = subprocess.Popen(command)
    value, count = None if options.change is None else live.health().parameters[options.change], 0
    while client.poll() is None:
        if isinstance(value, int | float):
            live.send(Tune(parameter=options.change, value=round(value * FACTORS[count % len(FACTORS)], 3)))
            count += 1
        time.sleep(1.0)
    assert client.returncode == 0
    if count:
        print(f"{options.change} was changed {count} times")
    print(f"{live.health().dropped - dropped} frames dropped by the pipeline meanwhile")
    over.set()
    session.join()


if __name__ == "__main__":
    main()
