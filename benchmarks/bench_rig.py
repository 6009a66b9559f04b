"""How rigs scale: readings per second of one and two sensors, and frames that several live ones drop.

    python benchmarks/bench_rig.py [--seconds 30] [--rounds 2] [--sensors 8] [--fps 10] [--live-seconds 600]

Sensors show a simulated recording of 640 x 480 px, method `perimeter`. For the readings per second it is a
file without pace; for dropped frames it comes as Motion JPEG over HTTP, from another process on this machine,
which takes time too. Times begin when every sensor has made `WARM` frames. The first line states how busy the
machine was: on a busy one the figures are lower bounds.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from manytouch.rigs.rig_file import load_rig
from manytouch.rigs.run_rig import SensorState, run_rig
from manytouch.sources.simulated import simulated_source

WARM = 30
FPS = 25.0
SIZE = (640, 480)


class Quiet:
    """An observer that prints notes about failures only."""

    def on_note(self, sensor: str, sentence: str) -> None:
        if "ended" in sentence or "given up" in sentence:
            print(f"{sensor}: {sentence}")

    def on_contacts(self, sensor: str, time_s: float, contacts: Sequence[object]) -> None:
        pass


class Counts:
    """Frames and dropped frames of all sensors in a span of time; stops the rig at its end."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._states: Mapping[str, SensorState] = {}
        self._begun: tuple[float, list[int], list[int]] | None = None
        self.elapsed_s = 0.0
        self.frames: list[int] = []
        self.dropped: list[int] = []
        self.restarts = 0

    def take(self, states: Mapping[str, SensorState]) -> None:
        self._states = states

    def is_over(self) -> bool:
        now_s = time.monotonic()
        frames = [state.frames + state.health.frames for state in self._states.values()]
        dropped = [state.dropped + state.health.dropped for state in self._states.values()]
        if self._begun is None:
            if min(frames) >= WARM:
                self._begun = now_s, frames, dropped
            return False
        begun_s, frames_before, dropped_before = self._begun
        if now_s - begun_s < self._seconds:
            return False
        self.elapsed_s = now_s - begun_s
        self.frames = [now - before for now, before in zip(frames, frames_before, strict=True)]
        self.dropped = [now - before for now, before in zip(dropped, dropped_before, strict=True)]
        self.restarts = sum(state.restarts for state in self._states.values())
        return True


def measured(folder: Path, sources: Sequence[str], seconds: float, fps: float | None = None) -> Counts:
    """Run a rig with these sources for a time."""
    rate = "" if fps is None else f"fps = {fps}\n"
    sections = [
        f'[[sensors]]\nname = "s{number}"\nsource = "{source}"\nmethod = "perimeter"\n{rate}'
        for number, source in enumerate(sources)
    ]
    path = folder / "rig.toml"
    path.write_text('schema = 1\nname = "bench"\n' + "".join(sections))
    counts = Counts(seconds)
    run_rig(load_rig(path), Quiet(), counts.is_over, on_states=counts.take)
    return counts


def pictures(seconds: float) -> list[np.ndarray]:
    """Several fingers on a simulated sheet, 640 x 480 px."""
    shown = []
    for frame in simulated_source("", width_px=SIZE[0], fps=FPS).lasting(seconds):
        assert frame.image is not None
        image = np.full(SIZE[::-1], int(np.median(frame.image)), np.uint8)
        image[: frame.image.shape[0]] = frame.image[: SIZE[1]]
        shown.append(image)
    return shown


def measure_readings(folder: Path, images: Sequence[np.ndarray], options: argparse.Namespace) -> None:
    path = folder / "long.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), FPS, SIZE)
    for _ in range(options.repeats):
        for image in images:
            writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()
    rates: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(options.rounds):
        for count, found in rates.items():
            counts = measured(folder, [str(path)] * count, options.seconds, fps=10_000.0)
            found.append(sum(counts.frames) / counts.elapsed_s)
            print(f"{count} sensors: {found[-1]:.1f} readings per second", flush=True)
    one, two = (float(np.median(found)) for found in rates.values())
    print(f"two sensors make {two / one:.2f} times the readings of one (medians of {options.rounds})")


def measure_dropped(folder: Path, images: Sequence[np.ndarray], options: argparse.Namespace) -> None:
    (folder / "jpeg").mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / "jpeg" / f"{number:04d}.jpg"), image)
    server = Path(__file__).with_name("mjpeg_server.py")
    words = [sys.executable, str(server), str(folder / "jpeg"), "--fps", str(options.fps)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().split()[-1]
        try:
            counts = measured(folder, [address] * options.sensors, options.live_seconds)
        finally:
            process.terminate()
    frames, dropped = sum(counts.frames), sum(counts.dropped)
    print(
        f"{options.sensors} sensors at {options.fps:g} frames per second for {counts.elapsed_s:.0f} s: "
        f"{frames} frames processed, {dropped} dropped "
        f"({100 * dropped / max(frames + dropped, 1):.2f} %), of one sensor at most {max(counts.dropped)}; "
        f"{counts.restarts} restarts"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=30.0, help="of each run of files; 0: none")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=60, help="of ten seconds, the length of the file")
    parser.add_argument("--sensors", type=int, default=8)
    parser.add_argument("--fps", type=float, default=10.0)
    parser.add_argument("--live-seconds", type=float, default=600.0, help="of the live run; 0: none")
    options = parser.parse_args()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(f"{os.cpu_count()} processors, load {load:.1f} before", flush=True)
    images = pictures(10.0)
    with tempfile.TemporaryDirectory() as folder:
        if options.seconds:
            measure_readings(Path(folder), images, options)
        if options.live_seconds:
            measure_dropped(Path(folder), images, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
