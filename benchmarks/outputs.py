"""What outputs to other programs cost a session: rate and latency without any, and with all of them.

    python benchmarks/outputs.py [--seconds 8] [--method mechanics] [--fps 60] [--rounds 3]

Drawn frames of 600 dots are kept in memory and read by a live session, as fast as it can and at --fps. The
outputs are TUIO 1.1 and 2.0, OSC, a MIDI file, ROS 2 on loopback and Foxglove. A process of its own reads all
topics of ROS 2 and of Foxglove, so that all messages are made and sent, and notes when OSC arrives. Sessions
without and with outputs take turns. Rates and latencies of a busy machine differ from round to round;
processor times do so less, and are per reading: of publishing by each output and of passing a reading to
their process, which are printed first; of a session, of all its threads and of the thread that estimates
contacts; of the process of the outputs, and of the process that reads. "Waits" are how often the thread that
estimates contacts has to wait, mostly for the interpreter.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.child_process import send
from manytouch.session import Live, prepare, run
from manytouch.sinks.output_process.messages import packed
from manytouch.sinks.output_process.process import OutputProcess
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.registry import SCHEMES
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
import json, signal, socket, struct, sys, threading, time
from websockets.sync.client import connect
from manytouch.sinks.publishers.dds import DdsParticipant
from manytouch.sinks.publishers.ros2 import TOPICS
peer = DdsParticipant(int(sys.argv[1]))
readers = [peer.reader(f"/bench/{topic}", kind, is_reliable=False) for topic, kind in TOPICS.items()]
osc = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
osc.bind(("127.0.0.1", int(sys.argv[3])))
arrived_ns = {}

def note():
    while True:
        bundle = osc.recv(65536)  # 16 bytes, length, then /manytouch/frame, its type tags and the frame
        arrived_ns[struct.unpack_from(">i", bundle, 20 + 20 + 8)[0]] = time.monotonic_ns()

def end(*_):
    print(json.dumps(arrived_ns), flush=True)
    sys.exit()

signal.signal(signal.SIGTERM, end)
threading.Thread(target=note, daemon=True).start()
print("ready", flush=True)
sys.stdin.readline()
with connect(f"ws://127.0.0.1:{sys.argv[2]}", subprotocols=["foxglove.sdk.v1"], max_size=None) as client:
    channels = []
    while len(channels) < 6:
        message = client.recv()
        if isinstance(message, str):
            channels += json.loads(message).get("channels", [])
    wanted = [{"id": each["id"], "channelId": each["id"]} for each in channels]
    client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    try:
        while True:
            client.recv()
    except Exception:
        signal.pause()
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

    def __init__(self, pids: list[int]) -> None:
        self._pids, self._others_ms = pids, np.zeros(0)
        self.at_ns: dict[int, int] = {}
        self.latency_ms: list[float] = []
        self.spent: list[tuple[float, ...]] = []

    def write(self, reading: Reading) -> None:
        if reading.frame.index < FRAMES or reading.frame.arrived_ns is None:
            return
        now_ns = time.monotonic_ns()
        self.at_ns[reading.frame.index] = now_ns
        waits = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        self.spent.append((1e3 * time.process_time(), 1e3 * time.thread_time(), waits))
        if len(self.spent) == 1:
            self._others_ms = np.array([processor_ms(pid) for pid in self._pids])
        self.latency_ms.append((now_ns - reading.frame.arrived_ns) * 1e-6)

    def close(self) -> None:
        """Note the processor times of the other processes."""
        self._others_ms = np.array([processor_ms(pid) for pid in self._pids]) - self._others_ms

    @property
    def per_reading(self) -> np.ndarray:
        """Of all threads, of the own one (ms); its waits; of the other processes (ms)."""
        own = np.array(self.spent[-1]) - self.spent[0]
        return np.append(own, self._others_ms) / (len(self.spent) - 1)

    @property
    def fps(self) -> float:
        times_ns = list(self.at_ns.values())
        return 1e9 * (len(times_ns) - 1) / (times_ns[-1] - times_ns[0])


def processor_ms(pid: int) -> float:
    """Processor time of another process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


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
    command = [sys.executable, "-c", READER, str(DOMAIN), str(PORTS["foxglove"]), str(PORTS["osc"])]
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
    print_time_of_passing(readings, live)
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


def print_time_of_passing(readings: list[Reading], live: Live) -> None:
    """Processor time of a session for passing a reading without an image to the process of the outputs."""
    spent_ms = []
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, bufsize=0) as receiver:
        for reading in readings:
            begin_s = time.thread_time()
            message = packed(reading, [], live.sensor, is_sensor_new=False, health=None)
            send(receiver.stdin, message)  # type: ignore[arg-type]
            spent_ms.append(1e3 * (time.thread_time() - begin_s))
    print(f"  passing it to the process of the outputs: {np.median(spent_ms):.3f} ms (median)")


def measured(
    images: list[np.ndarray], fps: float, options: argparse.Namespace, *, with_outputs: bool
) -> dict:
    """Rate and latency of one session, and what its outputs dropped."""
    source = KeptFrames(images=images, fps=fps, seconds=options.seconds)
    job = prepare(source, sensor=simulated_source().capabilities.sensor, method=options.method)
    live, pids = Live(job), []
    counter = Counter(pids)
    with tempfile.TemporaryDirectory() as folder:
        if with_outputs:
            reader = started_reader()
            output = OutputProcess(urls_of(folder), live)
            live.attach([output])
            pids += [output.pid, reader.pid]
            released(reader)
        run(live, [counter])
    found = dict(
        zip(("all_ms", "own_ms", "waits", "outputs_ms", "reader_ms"), counter.per_reading, strict=False)
    )
    if with_outputs:
        reader.terminate()
        arrived_ns = {int(index): at for index, at in json.loads(reader.communicate()[0]).items()}
        delays_ms = [
            1e-6 * (arrived_ns[index] - at) for index, at in counter.at_ns.items() if index in arrived_ns
        ]
        found["osc_p50_ms"], found["osc_p99_ms"] = np.percentile(delays_ms, [50, 99])
    return {
        **found,
        "fps": counter.fps,
        "p50_ms": float(np.percentile(counter.latency_ms, 50)),
        "p99_ms": float(np.percentile(counter.latency_ms, 99)),
        "outputs": {each.name: (each.sent, each.dropped) for each in live.health().outputs},
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
            print(f"  {name:8} " + described([each[name] for each in rounds]))
        print(f"  sent, dropped: {json.dumps(rounds[-1]['with']['outputs'])}")


def described(rounds: list[dict]) -> str:
    """Medians of sessions, in words."""
    found = {key: np.median([each[key] for each in rounds]) for key in rounds[0] if key != "outputs"}
    text = (
        f"{found['fps']:7.1f} readings/s, latency {found['p50_ms']:.2f} ms, {found['p99_ms']:.2f} ms (99th "
        f"percentile), processor {found['all_ms']:.2f} ms, estimation {found['own_ms']:.2f} ms, "
        f"{found['waits']:.1f} waits"
    )
    if "outputs_ms" not in found:
        return text
    return (
        f"{text}; outputs {found['outputs_ms']:.2f} ms, reader {found['reader_ms']:.2f} ms; OSC arrives "
        f"{found['osc_p50_ms']:.2f} ms after the reading, {found['osc_p99_ms']:.2f} ms (99th percentile)"
    )


if __name__ == "__main__":
    main()
