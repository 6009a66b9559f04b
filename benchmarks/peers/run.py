# ruff: noqa: E402 - the number of threads is set before numpy is loaded
"""manytouch and its peers, timed in one run.

    OMP_NUM_THREADS=1 python benchmarks/peers/run.py --out DIR [--rounds 300] [--dots 1040] [--size 1440p]

Every method gets a turn of 30 ms in every round (slow ones in some rounds), the order changes from round to
round, and medians are compared. Writes peers.txt, peers.json and peers.png into DIR. See docs/benchmarks.md.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is loaded: one thread for all

import argparse
import json
import platform
import sys
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).parents[1]))

from goals import TRACKED, goals_of
from others import others
from own import own_methods
from plot import plot
from profiled import profile_of, profile_text
from rounds import Footage, Timing, in_a_row, interleaved
from scaling import scaling_of, scaling_text
from sequences import COUNTS, SIZES, Sequence, course_of, jpegs, pictures
from two import two_sensors, two_text


def footage_of(sequence: Sequence) -> Footage:
    """Frames of a sequence and their JPEG pictures."""
    course = course_of(sequence)
    frames = pictures(course)
    return Footage(course=course, frames=frames, jpeg=jpegs(frames))


def table_text(timings: dict[str, Timing], does: dict[str, str]) -> str:
    """One row for each method, fastest first."""
    tracked_ms = timings[TRACKED].median_cpu_ms
    lines = [
        f"{'':39} {'median ms':>9} {'p99 ms':>8} {'cpu ms':>9} {'least':>8} {'first':>8} {'/tracked':>8} "
        f"{'runs':>5} {'found %':>8} {'rms px':>7} {'wrong %':>7}  in the time"
    ]
    for name, timing in sorted(timings.items(), key=lambda item: item[1].median_cpu_ms):
        p99 = "" if timing.p99_ms is None else f"{timing.p99_ms:.2f}"
        found = f"{100 * np.mean(timing.found):.2f}" if timing.found else ""
        rms = "" if timing.rms_px is None else f"{timing.rms_px:.4f}"
        wrong = f"{100 * np.mean(timing.wrong):.2f}" if timing.wrong else ""
        lines.append(
            f"{name:39} {timing.median_ms:9.3f} {p99:>8} {timing.median_cpu_ms:9.3f} "
            f"{timing.least_cpu_ms:8.3f} {timing.median_first_ms:8.3f} "
            f"{timing.median_cpu_ms / tracked_ms:8.2f} {len(timing.spent_ms):5d} "
            f"{found:>8} {rms:>7} {wrong:>7}  {does[name]}"
        )
    return "\n".join(lines)


def plain(timings: dict[str, Timing], does: dict[str, str]) -> dict[str, dict[str, object]]:
    """The table as JSON."""
    return {
        name: {
            "median_ms": timing.median_ms,
            "p99_ms": timing.p99_ms,
            "cpu_ms": timing.median_cpu_ms,
            "least_cpu_ms": timing.least_cpu_ms,
            "first_of_turn_ms": timing.median_first_ms,
            "runs": len(timing.spent_ms),
            "found": float(np.mean(timing.found)) if timing.found else None,
            "rms_px": timing.rms_px,
            "wrong": float(np.mean(timing.wrong)) if timing.wrong else None,
            "does": does[name],
        }
        for name, timing in timings.items()
    }


def machine() -> dict[str, str]:
    """What it ran on."""
    cpu = Path("/proc/cpuinfo")
    lines = cpu.read_text(encoding="utf-8").splitlines() if cpu.exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return {
        "cpu": f"{len(models) or os.cpu_count()} x {models[0] if models else platform.processor()}",
        "load": f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "",
        "python": platform.python_version(),
        "opencv": cv2.__version__,
        "numpy": np.__version__,
    }


def main() -> None:
    """Measure, print, write."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=Path, required=True, help="folder for peers.txt, .json and .png")
    options.add_argument("--rounds", type=int, default=300, help="of all methods")
    options.add_argument("--row", type=int, default=1000, help="tracked frames one after the other, for p99")
    options.add_argument("--dots", type=int, default=1040, choices=list(COUNTS))
    options.add_argument("--size", default="1440p", choices=list(SIZES))
    options.add_argument("--step", type=float, default=0.25, help="fastest motion, pitches per frame")
    options.add_argument("--frames", type=int, default=30, help="of the footage, run to and fro")
    options.add_argument("--only", default="", help="methods whose name holds this word, and manytouch's own")
    options.add_argument("--brief", action="store_true", help="no other sizes, no second process")
    chosen = options.parse_args()
    cv2.setNumThreads(1)
    sequence = Sequence(dots=chosen.dots, size=chosen.size, step_pitches=chosen.step, frames=chosen.frames)
    footage = footage_of(sequence)
    begun_s = time.perf_counter()
    peers, missing = others()
    methods = [
        each
        for each in [*own_methods(footage.course.sensor), *peers]
        if chosen.only in each.name or each.name == TRACKED
    ]
    does = {method.name: method.does for method in methods}
    timings = interleaved(methods, footage, chosen.rounds)
    (own,) = (each for each in methods if each.name == TRACKED)
    row = in_a_row(own, footage, chosen.row)
    jpeg_kB = np.mean([len(each) for each in footage.jpeg]) / 1e3
    texts = [
        f"{chosen.dots} dots, {chosen.size}, {chosen.step:g} pitches per frame, one thread, "
        f"JPEG of {jpeg_kB:.0f} kB; {machine()}",
        table_text(timings, does),
        *missing,
    ]
    result: dict[str, object] = {"machine": machine(), "methods": plain(timings, does), "missing": missing}
    texts.append(
        f"{len(row.spent_ms)} tracked frames one after the other: median {row.median_ms:.3f} ms, "
        f"p99 {row.p99_ms or np.nan:.3f}, worst {max(row.spent_ms):.3f}; of the processor "
        f"{row.median_cpu_ms:.3f}, p99 {np.percentile(row.cpu_ms, 99):.3f}"
    )
    result["row"] = {"median_ms": row.median_ms, "p99_ms": row.p99_ms, "worst_ms": max(row.spent_ms)}
    if not chosen.brief:
        result["two_sensors"] = pair = two_sensors(sequence)
        texts.append(two_text(pair))
        result["scaling"] = scaling = scaling_of()
        texts.append(scaling_text(scaling))
    goals = goals_of(timings, row, result.get("two_sensors"))
    result["goals"] = goals
    texts.append("\n".join(["goals (processor time)", *(f"  {each}" for each in goals)]))
    profiles = {kind: profile_of(footage, kind) for kind in ("tracked", "from nothing")}
    result["profile"] = profiles
    texts += [profile_text(kind, profile) for kind, profile in profiles.items()]
    texts.append(f"{time.perf_counter() - begun_s:.0f} s")
    chosen.out.mkdir(parents=True, exist_ok=True)
    text = "\n\n".join(texts)
    print(text)
    (chosen.out / "peers.txt").write_text(text + "\n", encoding="utf-8")
    (chosen.out / "peers.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    plot(timings, chosen.out / "peers.png", result.get("scaling"), title=texts[0].split(", JPEG")[0])


if __name__ == "__main__":
    main()
