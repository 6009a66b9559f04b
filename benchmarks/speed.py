# ruff: noqa: E402 - the number of threads is set before numpy is loaded
"""The table of speed: from pixels to newtons, and from nothing compiled to the first reading.

    python benchmarks/speed.py --out DIR [--only pixels,contacts,stream,live,press,start]

Each line states what was measured, what must be and what is aimed for. Times are processor time, which other
programs disturb least; lines of "wall" are not meaningful on a busy machine, and the load is printed with
each part. Ratios are of methods that took turns in this run. Ten minutes on a quiet machine, of which
`start` takes four.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is loaded: one thread for all

import argparse
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).parent
sys.path.append(str(HERE / "peers"))

from others import others
from own import own_methods
from rounds import Footage, interleaved
from scaling import scaling_of, scaling_text
from sequences import Sequence, course_of, jpegs, pictures
from speed_of_contacts import (
    SCENES,
    merged,
    plot,
    pressed_grids,
    scene_grids,
    table,
    times_ms,
)

from manytouch.session import pipeline_for
from manytouch.session.background_iterator import BackgroundIterator
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame

ROUNDS = 60
STREAM_FRAMES = 400
STREAM_PICTURES = 60
LIVE_SECONDS = 15
BLOBS = "SimpleBlobDetector, tuned"
Lines = Iterator[str]


def goal(what: str, measured: float, must: float | None, aim: float | None, *, most: bool = True) -> str:
    """One line of the table; `most`: the measured value must not be larger."""
    if must is None:
        return f"{what:66} {measured:9.2f}"
    sign = 1.0 if most else -1.0
    is_aim = aim is not None and sign * measured <= sign * aim
    word = "aim reached" if is_aim else "reached" if sign * measured <= sign * must else "NOT reached"
    aimed = "" if aim is None else f", aim {aim:g}"
    return f"{what:66} {measured:9.2f}   must {must:g}{aimed}: {word}"


def pixels() -> Lines:
    """A tracked frame of 1040 dots, and the growth to 10 000."""
    sequence = Sequence(dots=1040, size="1440p", step_pitches=0.25, frames=30)
    course = course_of(sequence)
    frames = pictures(course)
    footage = Footage(course=course, frames=frames, jpeg=jpegs(frames))
    peers, _ = others()
    wanted = (
        "manytouch: tracked, identities",
        "manytouch: tracked frame",
        "manytouch: frame from nothing",
    )
    names = (*wanted, "copy of the frame", "JPEG to grey", BLOBS)
    methods = [each for each in [*own_methods(course.sensor), *peers] if each.name in names]
    timings = interleaved(methods, footage, ROUNDS)
    identities, whole, nothing = (timings[name] for name in wanted)
    copy, blobs = timings["copy of the frame"], timings[BLOBS]
    yield goal("tracked frame, 1040 dots, to identities, ms", identities.median_cpu_ms, 0.5, 0.4)
    yield goal("tracked frame with surface and map, ms", whole.median_cpu_ms, 0.7, 0.55)
    yield goal("tracked frame in copies of the frame", whole.median_cpu_ms / copy.median_cpu_ms, 4.5, None)
    yield goal(
        "times faster than the tuned blob detector", blobs.median_cpu_ms / whole.median_cpu_ms, None, None
    )
    yield goal("frame from nothing, ms", nothing.median_cpu_ms, 1.4, 1.0)
    rows = scaling_of(runs=12)
    yield scaling_text(rows)
    large = {row["dots"]: float(row["tracked_ms"]) for row in rows if row["size"] == "1440p"}
    power = np.log(large[10000] / large[1040]) / np.log(10000 / 1040)
    yield goal("growth of a tracked frame from 1040 to 10 000 dots: power of their number", power, 1.0, None)


def contacts(out: Path) -> Lines:
    """Inversion and contacts over the built-in scenes and 1 to 8 fingers, and the bonded pad."""
    scenes = [times_ms(*scene_grids(name)) for name in SCENES]
    fingers = times_ms(*pressed_grids())
    every = np.concatenate([each for part in (*scenes, fingers) for each in part.values()])
    for percent, must, aim in ((50, 5.0, 3.0), (90, 8.0, 5.0), (99, 12.0, 8.0)):
        yield goal(
            f"inversion and contacts, 600 dots, p{percent}, ms", np.percentile(every, percent), must, aim
        )
    by_number = merged(*scenes, fingers)
    yield table(by_number)
    plot(by_number, out / "contacts.png")
    yield f"plotted in {out / 'contacts.png'}"
    many = {contacts: float(np.median(each)) for contacts, each in by_number.items() if contacts}
    low, high = min(many), max(many)
    growth = (many[high] - many[low]) / max(high - low, 1)
    yield goal(f"each further contact, {low} to {high}, p50, ms", growth, None, None)
    pad = times_ms(*scene_grids("pad"))
    spent_ms = np.concatenate(list(pad.values()))
    for percent, must, aim in ((50, 3.0, 1.0), (99, 6.0, 3.0)):
        yield goal(f"bonded pad, after tracking, p{percent}, ms", np.percentile(spent_ms, percent), must, aim)


def stream() -> Lines:
    """Motion JPEG of 1440p to contacts and forces: one thread decodes and tracks, another estimates."""
    simulator = simulated_source(width_px=2560).simulator
    first, encoded = simulator.frame(0), []
    for index in range(STREAM_PICTURES):
        image = simulator.frame(index).image
        assert image is not None
        encoded.append(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1])
    order = [*range(STREAM_PICTURES), *range(STREAM_PICTURES - 2, 0, -1)]

    def decoded() -> Iterator[Frame]:
        for index in range(STREAM_FRAMES):
            image = cv2.imdecode(encoded[order[index % len(order)]], cv2.IMREAD_GRAYSCALE)
            yield replace(first, image=image, index=index, timestamp_ns=index * 33_333_333)

    begun_s = time.perf_counter()
    for _ in decoded():
        pass
    decoding = STREAM_FRAMES / (time.perf_counter() - begun_s)
    pipeline, at_s = pipeline_for("mechanics"), []
    with BackgroundIterator(pipeline.track_frames(decoded(), simulator.sensor), ahead=1) as tracked:
        for _ in pipeline.estimate_readings(tracked, simulator.sensor):
            at_s.append(time.perf_counter())
    spent_s = np.diff(at_s)[20:]
    yield goal(
        "Motion JPEG 1440p to forces, readings per second (wall)", 1.0 / spent_s.mean(), 100, 150, most=False
    )
    yield goal(
        "   the same, p99 between two readings, ms (wall)", 1e3 * np.percentile(spent_s, 99), None, None
    )
    yield goal("   decoding alone, images per second (wall)", decoding, None, None)


def live() -> Lines:
    """A camera stream of 30 frames per second with a client of the viewer."""
    text = program("viewer_rate.py", "--method", "mechanics", "--seconds", f"{LIVE_SECONDS}")
    found = re.search(r"decoded arrays: p50 ([\d.]+) ms, p99 ([\d.]+) ms", text)
    if found is None:
        yield f"live: no result\n{text}"
        return
    yield goal("live stream with a client of the viewer, latency p50, ms (wall)", float(found[1]), 25, 18)
    yield goal("   the same, p99, ms (wall)", float(found[2]), 45, 30)


def press() -> Lines:
    """The demo, pressed by a client, alone and with a program that keeps a processor busy."""
    text = program("bench_busy.py", "--presses", "6")
    for count, must in ((0, 0.1), (1, 0.15)):
        found = re.search(rf"with {count} busy loops: a press shows after ([\d.]+) s", text)
        if found is None:
            yield f"press: no result\n{text}"
            return
        yield goal(f"demo: a press shows, {count} busy loops, p50, s (wall)", float(found[1]), must, None)


def start() -> Lines:
    """`process` with nothing compiled, and the same again."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        video = square_video(folder / "square.mp4")
        own = {"NUMBA_CACHE_DIR": str(folder / "kernels"), "XDG_CACHE_HOME": str(folder / "cache")}
        cold = process(video, folder / "cold", own)
        again = process(video, folder / "warm", own)
        entries = len(list((folder / "kernels").rglob("*.nbc")))
    yield goal("cold start: processor time for compiling, s", cold["cpu_s"] - again["cpu_s"], 30, 15)
    yield goal("   time until the layout is found, nothing compiled, s (wall)", cold["found_s"], None, None)
    yield goal("   functions with machine code", entries, None, None)
    yield goal("warm start: `process` until the layout is found, s (wall)", again["found_s"], 1.5, 0.8)
    yield goal("memory of `process`, 640 x 640 px, compiled before, MB", again["memory_MB"], 250, None)
    yield goal("   the same, nothing compiled, MB", cold["memory_MB"], 400, None)


def square_video(path: Path) -> Path:
    """Fingers on the demo sheet in the middle of 640 x 640 px."""
    source = simulated_source(width_px=640)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (640, 640))
    for frame in source:
        assert frame.image is not None
        image = cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR) if frame.image.ndim == 2 else frame.image
        border = (640 - image.shape[0]) // 2
        writer.write(cv2.copyMakeBorder(image, border, border, 0, 0, cv2.BORDER_REPLICATE))
    writer.release()
    return path


def process(video: Path, out: Path, surroundings: dict[str, str]) -> dict[str, float]:
    """What `manytouch process` takes; memory of the process itself, time of those that it starts too.

    Modules of Python are compiled once, as they are where the package is installed.
    """
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-m", "manytouch", "process", str(video), "--pitch-mm", "4", "--method"]
    before, begun_s, found_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic(), np.nan
    running = subprocess.Popen(
        [*command, "mechanics", "--out", str(out)],
        env=inherited | surroundings,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert running.stdout is not None
    memory_MB, printed = 0.0, []
    for line in running.stdout:
        printed.append(line)
        if line.strip().startswith("found"):
            found_s = time.monotonic() - begun_s
        memory_MB = max(memory_MB, peak_MB(running.pid))
    if running.wait():
        raise RuntimeError("".join(printed))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_s": cpu_s, "found_s": found_s, "memory_MB": memory_MB}


def peak_MB(pid: int) -> float:
    """Greatest resident memory of a process so far; 0 where the system does not state it."""
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    return 0.0 if found is None else int(found[1]) / 1024


def program(name: str, *arguments: str) -> str:
    """Output of another benchmark."""
    done = subprocess.run(
        [sys.executable, str(HERE / name), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    return done.stdout + done.stderr


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for speed.txt and contacts.png")
    parser.add_argument("--only", default="", help="parts, separated by commas")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cv2.setNumThreads(1)
    parts: dict[str, Callable[[], Lines]] = {
        "pixels": pixels,
        "contacts": lambda: contacts(options.out),
        "stream": stream,
        "live": live,
        "press": press,
        "start": start,
    }
    chosen = [name for name in options.only.split(",") if name] or list(parts)
    if unknown := set(chosen) - set(parts):
        parser.error(f"there is no part {', '.join(sorted(unknown))}; there are: {', '.join(parts)}")
    with (options.out / "speed.txt").open("w", encoding="utf-8") as file:
        for name in chosen:
            begun_s = time.monotonic()
            for line in (f"--- {name}, load of the machine {os.getloadavg()[0]:.1f}", *parts[name]()):
                print(line, flush=True)
                file.write(f"{line}\n")
            print(f"    ({time.monotonic() - begun_s:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
