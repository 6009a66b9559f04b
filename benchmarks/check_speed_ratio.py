"""Check that a tracked frame is several times faster than a tuned OpenCV chain that does less.

    OMP_NUM_THREADS=1 python benchmarks/check_speed_ratio.py

1040 dots at 1440p. Compares the least processor times of thresholds and connected components, of a tracked
frame (must be less than half of it) and of a frame that is searched as a whole (must be less). The exit
status is 1 when one of them is too slow, or when markers are missing.
"""

import math
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).parent / "peers"))

from others import components
from own import SURFACE, from_nothing, tracked
from rounds import Footage, Method, interleaved
from sequences import Sequence, course_of, pictures

ROUNDS = 40
REPEATS = 4  # at most: other programs can only add to a time
SHARES = {"tracked": 0.5, "searched as a whole": 1.0}
LEAST_FOUND = 0.99


def main() -> int:
    """Measure, print, and return the exit status."""
    cv2.setNumThreads(1)
    course = course_of(Sequence(dots=1040, size="1440p", step_pitches=0.25, frames=4))
    footage = Footage(course=course, frames=pictures(course), jpeg=[])
    methods = [
        Method(name="tracked", does="", prepare=tracked(SURFACE)),
        Method(name="searched as a whole", does="", prepare=from_nothing(SURFACE)),
        Method(name="OpenCV", does="", prepare=components),
    ]
    least_ms: dict[str, float] = {}
    for _ in range(REPEATS):
        timings = interleaved(methods, footage, ROUNDS)
        for name, timing in timings.items():
            least_ms[name] = min(least_ms.get(name, math.inf), timing.least_cpu_ms)
        shares = {name: least_ms[name] / least_ms["OpenCV"] for name in SHARES}
        if all(shares[name] < SHARES[name] for name in SHARES):
            break
    found = float(np.min(timings["tracked"].found))
    for name, most in SHARES.items():
        print(f"{name}: {least_ms[name]:.2f} ms, {shares[name]:.2f} of OpenCV (must be below {most:g})")
    print(f"OpenCV: {least_ms['OpenCV']:.2f} ms; dots found when tracked: {100 * found:.2f} %")
    return int(any(shares[name] >= SHARES[name] for name in SHARES) or found < LEAST_FOUND)


if __name__ == "__main__":
    sys.exit(main())
