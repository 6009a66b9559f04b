"""Two sensors in two processes: how far they slow each other down.

    python benchmarks/peers/two.py SECONDS '{"dots": 1040, ...}'

is one of the processes: it prints "ready", waits for a line, tracks for so many seconds, and prints the
frames per second.
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from sequences import Sequence, course_of, pictures

SECONDS, TURNS = 2.0, 3


def two_sensors(sequence: Sequence) -> dict[str, float]:
    """Frames per second of one process, and of two together; one and two take turns."""
    alone, together = [], []
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    for _ in range(TURNS):
        alone += _rates(1, sequence)
        together.append(sum(_rates(2, sequence)))
    # the best turns: whatever else runs on the machine can only slow both down
    return {
        "one_per_s": max(alone),
        "two_per_s": max(together),
        "ratio": max(together) / max(alone),
        "load": load,
    }


def two_text(pair: dict[str, float]) -> str:
    """One sentence."""
    return (
        f"two sensors in two processes: {pair['two_per_s']:.0f} frames/s together, one alone "
        f"{pair['one_per_s']:.0f}: {pair['ratio']:.2f} times "
        f"(load of the machine before: {pair['load']:.1f}; above 1 the ratio is not reliable)"
    )


def _rates(count: int, sequence: Sequence) -> list[float]:
    command = [sys.executable, __file__, str(SECONDS), json.dumps(asdict(sequence))]
    processes = [
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(count)
    ]
    try:
        for process in processes:
            process.stdout.readline()
        for process in processes:
            process.stdin.write("go\n")
            process.stdin.flush()
        return [float(process.communicate()[0]) for process in processes]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _follow(seconds: float, sequence: Sequence) -> None:
    import cv2
    from own import Tracked

    cv2.setNumThreads(1)
    course = course_of(sequence)
    frames = pictures(course)
    follow = Tracked(course.sensor)
    turn = [*range(len(frames)), *range(len(frames) - 2, 0, -1)]
    for index in turn[:4]:
        follow(frames[index])
    print("ready", flush=True)
    sys.stdin.readline()
    begun_s, done = time.perf_counter(), 0
    while time.perf_counter() - begun_s < seconds:
        follow(frames[turn[(done + 4) % len(turn)]])
        done += 1
    print(done / (time.perf_counter() - begun_s), flush=True)


if __name__ == "__main__":
    _follow(float(sys.argv[1]), Sequence(**json.loads(sys.argv[2])))
