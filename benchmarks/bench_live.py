"""A live session on a camera's stream: dropped frames, and latency from arrival to sink.

    python benchmarks/bench_live.py [--seconds 20] [--method perimeter] [--record] [--cpus 0,1]

Pre-encoded Motion JPEG of 2560 x 1440 px with 600 markers comes over HTTP on loopback at --fps, from another
process. It is decoded, read, sampled at 100 x 60 points and packed as float32 for a client that counts what
it gets. The first two seconds are not counted. The first line states how busy the machine was: figures of a
busy one are upper bounds.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from manytouch.geometry.sampling import sampling_on
from manytouch.pipeline import Sink
from manytouch.session import Live, prepare, run
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources.simulated import simulated_source
from manytouch.values import Reading, Sensor

SURFACE = (100, 60)
SKIP_S = 2.0


class Client:
    """A headless client: takes surfaces as messages and notes when it has unpacked them."""

    def __init__(self, sensor: Sensor) -> None:
        assert sensor.layout is not None
        rest_mm = sensor.layout.rest_mm
        x_mm, y_mm = (
            np.linspace(rest_mm[:, axis].min(), rest_mm[:, axis].max(), count)
            for axis, count in enumerate(SURFACE)
        )
        self._sampling = sampling_on(sensor.layout, x_mm, y_mm)
        self.index: list[int] = []
        self.latency_ms: list[float] = []
        self.reading_ms: list[float] = []
        self.at_s: list[float] = []

    def write(self, reading: Reading) -> None:
        depth_mm = self._sampling(-reading.surface.displacement_mm[:, 2])
        message = depth_mm.astype("<f4").tobytes()
        got = np.frombuffer(message, "<f4").reshape(SURFACE[::-1])
        assert np.isfinite(got).any()
        assert reading.frame.arrived_ns is not None
        self.index.append(reading.frame.index)
        self.at_s.append(time.monotonic())
        self.latency_ms.append((time.monotonic_ns() - reading.frame.arrived_ns) * 1e-6)
        self.reading_ms.append(reading.milliseconds)

    def close(self) -> None:
        """Nothing is open."""


def write_pictures(folder: Path, frames: int, fps: float) -> None:
    """Pictures of fingers on the demo sensor, as a camera would send them; the first ones at rest."""
    simulator = simulated_source(fps=fps, width_px=2560).simulator
    for number in range(frames):
        image = simulator.frame(number).image
        assert image is not None
        cv2.imwrite(str(folder / f"{number:04d}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 90])


def serve(folder: Path, fps: float) -> tuple[subprocess.Popen[str], str]:
    """The camera, in a process of its own, and its address."""
    program = [
        sys.executable,
        str(Path(__file__).with_name("mjpeg_server.py")),
        str(folder),
        "--fps",
        f"{fps}",
    ]
    server = subprocess.Popen(program, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    return server, server.stdout.readline().strip()


def report(client: Client, live: Live, spent_s: float, cpu_s: float) -> Iterator[str]:
    """What came out."""
    later = np.array(client.at_s) > client.at_s[0] + SKIP_S
    latency_ms, index = np.array(client.latency_ms)[later], np.array(client.index)[later]
    if len(index) < 2:
        yield "too few frames: run for more seconds"
        return
    dropped = int(index[-1] - index[0] + 1 - len(index))
    rate = (len(index) - 1) / (np.array(client.at_s)[later][-1] - np.array(client.at_s)[later][0])
    p50, p90, p99 = np.percentile(latency_ms, [50, 90, 99])
    health = live.health()
    points = f"{SURFACE[0]} x {SURFACE[1]}"
    yield f"load of the machine {os.getloadavg()[0]:.1f}, {len(os.sched_getaffinity(0))} processors for this"
    yield f"{len(index)} updates of {points} points, {rate:.1f} per second, {dropped} dropped"
    yield f"latency from arrival to client: p50 {p50:.1f}, p90 {p90:.1f}, p99 {p99:.1f} ms"
    yield f"reading alone: p50 {np.median(client.reading_ms):.1f} ms, {health.markers_seen} markers seen"
    each_ms = 1e3 * cpu_s / len(client.index)
    yield f"processor time: {each_ms:.1f} ms per frame, {cpu_s / spent_s:.2f} processors"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--pictures", type=int, default=90, help="of the stream, then over and over")
    parser.add_argument("--method", default=None)
    parser.add_argument("--record", action="store_true", help="record meanwhile")
    parser.add_argument("--cpus", default=None, help="processors to run on, such as 0,1")
    options = parser.parse_args()
    if options.cpus is not None:
        os.sched_setaffinity(0, {int(number) for number in options.cpus.split(",")})
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_pictures(folder, options.pictures, options.fps)
        server, url = serve(folder, options.fps)
        try:
            measure(options, url, folder)
        finally:
            server.terminate()
            server.wait()


def measure(options: argparse.Namespace, url: str, folder: Path) -> None:
    """The session, and its figures."""
    job = prepare(url, sensor=demo_sensor(2560), method=options.method)
    live = Live(job, record=folder / "bench.mcap" if options.record else None)
    client = Client(job.sensor)
    sinks: list[Sink] = [client]
    begun: list[tuple[float, float]] = []

    def stop() -> bool:
        if not begun:
            begun.append((time.monotonic(), time.process_time()))
        return time.monotonic() - begun[0][0] > options.seconds

    run(live, sinks, stop=stop)
    spent_s, cpu_s = time.monotonic() - begun[0][0], time.process_time() - begun[0][1]
    for line in report(client, live, spent_s, cpu_s):
        print(line)
    for note in live.health().notes:
        print(note)


if __name__ == "__main__":
    main()
