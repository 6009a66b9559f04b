"""What outputs to other programs cost a session: rate and latency without any, and with all of them.

    python benchmarks/outputs.py [--seconds 8] [--method mechanics] [--fps 60] [--rounds 3]

Drawn frames of 600 dots are kept in memory and read by a live session, as fast as it can and at --fps. The
outputs are TUIO 1.1 and 2.0, OSC, a MIDI file, ROS 2 on loopback and Foxglove. A process of its own reads all
topics of ROS 2 and of Foxglove, so that all messages are made and sent. Sessions without and with them take
turns. Rates and latencies of a busy machine differ from round to round; processor times do so less: of each
output per reading, which is printed first, and of a session per reading, of all its threads and of the thread
that estimates contacts.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.session import Live, prepare, run
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.registry import SCHEMES, open_outputs
from manytouch.sources.simulated import simulated_source
from manytouch.sources.source import Capabilities
from manytouch.values import Frame, Reading

FRAMES = 240
FORTH = FRAMES // 2 + 1
SIMULATED_FPS = 30.0
FASTEST_FPS = 10_000.0
PORTS = {"tuio": 43333, "tuio2": 43334, "osc": 43335, "foxglove": 43336}
DOMAIN = 89
LOOPBACK = Path(__file__).parents[1] / "tests" / "peers" / "loopback.xml"

READER = """
import json, sys, threading, time
from websockets.sync.client import connect
from manytouch.sinks.publishers.dds import DdsParticipant
from manytouch.sinks.publishers.ros2 import TOPICS
peer = DdsParticipant(int(sys.argv[1]))
readers = [peer.reader(f"/bench/{topic}", kind, is_reliable=False) for topic, kind in TOPICS.items()]
print("ready", flush=True)
sys.stdin.readline()
with connect(f"ws://127.0.0.1:{sys.argv[2]}", subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
    channels = []
    while len(channels) < 6:
        message = socket.recv()
        if isinstance(message, str):
            channels += json.loads(message).get("channels", [])
    wanted = [{"id": each["id"], "channelId": each["id"]} for each in channels]
    socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    try:
        while True:
            socket.recv()
    except Exception:
        pass
"""


@dataclass(frozen=True, kw_only=True)
class KeptFrames:
    """Frames in memory, forth and back (`FRAMES`) again and again for some seconds."""

    images: list[np.ndarray]
    fps: float
    seconds: float
    name: str = "kept"
    is_live: bool = False

    @property
    def frame_count(self) -> int | None:
        return None

    @property
    def width_px(self) -> int:
        return int(self.images[0].shape[1])

    @property
    def height_px(self) -> int:
        return int(self.images[0].shape[0])

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities()

    def __iter__(self) -> Iterator[Frame]:
        end_s: float | None = None
        index = 0
        while end_s is None or time.monotonic() < end_s:
            if index == FRAMES:
                end_s = time.monotonic() + self.seconds
            turn = index % FRAMES
            image = self.images[min(turn, FRAMES - turn)]
            yield Frame(index=index, timestamp_ns=round(index * 1e9 / self.fps), camera="kept", image=image)
            index += 1


class Counter:
    """Counts the readings after the first round of frames, and their latency."""

    def __init__(self) -> None:
        self.at_s: list[float] = []
        self.latency_ms: list[float] = []
        self.spent_s: list[tuple[float, float]] = []

    def write(self, reading: Reading) -> None:
        if reading.frame.index < FRAMES or reading.frame.arrived_ns is None:
            return
        self.at_s.append(time.monotonic())
        self.spent_s.append((time.process_time(), time.thread_time()))
        self.latency_ms.append((time.monotonic_ns() - reading.frame.arrived_ns) * 1e-6)

    def close(self) -> None:
        """Nothing is open."""


def urls_of(folder: str) -> list[str]:
    return [
        f"tuio://127.0.0.1:{PORTS['tuio']}",
        f"tuio://127.0.0.1:{PORTS['tuio2']}?version=2.0",
        f"osc://127.0.0.1:{PORTS['osc']}",
        f"midi://{folder}/take.mid",
        f"ros2://bench?domain={DOMAIN}",
        f"foxglove://127.0.0.1:{PORTS['foxglove']}",
    ]


def started_reader() -> subprocess.Popen[str]:
    command = [sys.executable, "-c", READER, str(DOMAIN), str(PORTS["foxglove"])]
    reader = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert reader.stdout is not None
    reader.stdout.readline()
    return reader


def released(reader: subprocess.Popen[str]) -> None:
    """Let the reader connect to Foxglove, which is served now."""
    assert reader.stdin is not None
    reader.stdin.write("\n")
    reader.stdin.flush()


def print_processor_times(images: list[np.ndarray], options: argparse.Namespace) -> None:
    """Processor time of a reading, and of publishing it, one after the other.

    Each output that sends images encodes them here; in a session it is done once for all outputs.
    """
    source = KeptFrames(images=images, fps=options.fps, seconds=0.0)
    job = prepare(source, sensor=simulated_source().capabilities.sensor, method=options.method)
    live, readings, spent_ms = Live(job), [], []
    job.warm_up()
    begin_s = time.thread_time()
    for reading in job.readings():
        readings.append(reading)
        spent_ms.append(1e3 * (time.thread_time() - begin_s))
        begin_s = time.thread_time()
    touching = np.mean([len(reading.contacts.touching) for reading in readings])
    print(f"{touching:.1f} contacts per reading")
    print(f"processor time of a reading: {np.median(spent_ms):.2f} ms, and of publishing it:")
    reader = started_reader()
    with tempfile.TemporaryDirectory() as folder:
        for url in urls_of(folder):
            address = parse_address(url)
            publisher = SCHEMES[address.scheme].open_publisher(address, live)
            if address.scheme == "foxglove":
                released(reader)
            time.sleep(3.0 if address.scheme in ("ros2", "foxglove") else 0.0)
            spent_ms, begin_s = [], time.process_time()
            for reading in readings:
                own_s = time.thread_time()
                publisher.publish(reading)
                spent_ms.append(1e3 * (time.thread_time() - own_s))
            all_ms = 1e3 * (time.process_time() - begin_s) / len(spent_ms)
            publisher.close()
            print(
                f"  {address.scheme:9} {np.median(spent_ms):.3f} ms (median), {np.mean(spent_ms):.3f} ms "
                f"(mean), with the threads of its library {all_ms:.3f} ms (mean)"
            )
    reader.terminate()
    reader.wait()


def measured(
    images: list[np.ndarray], fps: float, options: argparse.Namespace, *, with_outputs: bool
) -> dict:
    """Rate and latency of one session, and what its outputs dropped."""
    source = KeptFrames(images=images, fps=fps, seconds=options.seconds)
    job = prepare(source, sensor=simulated_source().capabilities.sensor, method=options.method)
    live, counter, reader = Live(job), Counter(), None
    with tempfile.TemporaryDirectory() as folder:
        if with_outputs:
            reader = started_reader()
            live.attach(open_outputs(urls_of(folder), live))
            released(reader)
        run(live, [counter])
        if reader is not None:
            reader.terminate()
            reader.wait()
    span_s = counter.at_s[-1] - counter.at_s[0]
    all_ms, own_ms = 1e3 * (np.array(counter.spent_s[-1]) - counter.spent_s[0]) / (len(counter.at_s) - 1)
    outputs = {each.name: (each.sent, each.dropped) for each in live.health().outputs}
    return {
        "fps": (len(counter.at_s) - 1) / span_s,
        "p50_ms": float(np.percentile(counter.latency_ms, 50)),
        "p99_ms": float(np.percentile(counter.latency_ms, 99)),
        "all_ms": float(all_ms),
        "own_ms": float(own_ms),
        "outputs": outputs,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--method", default="mechanics")
    parser.add_argument("--fps", type=float, default=60.0)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    os.environ["CYCLONEDDS_URI"] = LOOPBACK.as_uri()
    simulator = simulated_source(fps=SIMULATED_FPS).simulator
    images = [np.asarray(simulator.frame(number).image) for number in range(FORTH)]
    print(f"{os.getloadavg()[0]:.1f} processes were running; {images[0].shape[1]} x {images[0].shape[0]} px")
    print_processor_times(images, options)
    for fps in (options.fps, FASTEST_FPS):
        rounds = [
            {
                name: measured(images, fps, options, with_outputs=is_on)
                for name, is_on in (("without", False), ("with", True))
            }
            for _ in range(options.rounds)
        ]
        print(f"frames at {fps:g} per second, medians of {options.rounds} sessions")
        for name in ("without", "with"):
            figures = {
                key: np.median([each[name][key] for each in rounds])
                for key in ("fps", "p50_ms", "p99_ms", "all_ms", "own_ms")
            }
            print(
                f"  {name:8} {figures['fps']:7.1f} readings/s, "
                f"latency {figures['p50_ms']:.2f} ms, {figures['p99_ms']:.2f} ms (99th percentile), "
                f"processor {figures['all_ms']:.2f} ms, estimation {figures['own_ms']:.2f} ms"
            )
        print(f"  sent, dropped: {json.dumps(rounds[-1]['with']['outputs'])}")


if __name__ == "__main__":
    main()
