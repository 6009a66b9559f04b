"""How manytouch's time grows with the number of dots and with the size of the image."""

import time

import numpy as np
from own import IDENTITIES, Tracked
from sequences import Sequence, course_of, pictures, to_and_fro

DOTS_BY_SIZE = {"480p": (96, 384), "720p": (96, 384, 1040), "1440p": (96, 384, 1040, 4000, 10000)}
FRAMES, WARM = 6, 3


class _Case:
    """A sheet that is followed, to identities and to the surface and its map."""

    def __init__(self, sequence: Sequence) -> None:
        course = course_of(sequence)
        self.sequence, self.frames = sequence, pictures(course)
        self.numbering = Tracked(course.sensor, IDENTITIES)
        begun_s = time.perf_counter()
        self.tracked = Tracked(course.sensor)
        self.start_s = time.perf_counter() - begun_s
        self.first = self.tracked.tracking
        self.spent_ms: dict[str, list[float]] = {"identities_ms": [], "tracked_ms": [], "from_nothing_ms": []}

    def turn(self, index: int) -> None:
        frame = self.frames[index]
        self.spent_ms["identities_ms"].append(_timed(self.numbering, frame))
        kept, self.tracked.tracking = self.tracked.tracking, self.first
        self.spent_ms["from_nothing_ms"].append(_timed(self.tracked, frame))
        self.tracked.tracking = kept
        self.spent_ms["tracked_ms"].append(_timed(self.tracked, frame))

    def row(self) -> dict[str, float | int | str]:
        median = {name: float(np.median(each[WARM:])) for name, each in self.spent_ms.items()}
        return {"size": self.sequence.size, "dots": self.sequence.dots, **median, "start_s": self.start_s}


def scaling_of(runs: int = 40) -> list[dict[str, float | int | str]]:
    """Median ms of a frame to identities, tracked, and from nothing; all sizes take turns."""
    cases = [
        _Case(Sequence(dots=dots, size=size, frames=FRAMES))
        for size, counts in DOTS_BY_SIZE.items()
        for dots in counts
    ]
    for index in to_and_fro(FRAMES, runs + WARM):
        for case in cases:
            case.turn(int(index))
    return [case.row() for case in cases]


def _timed(follow: Tracked, frame: object) -> float:
    begun_s = time.thread_time()
    follow(frame)
    return 1e3 * (time.thread_time() - begun_s)


def scaling_text(rows: list[dict[str, float | int | str]]) -> str:
    """Table, and how the time grows with the number of dots."""
    lines = ["number of dots and size of the image; ms of processor time, median"]
    for row in rows:
        lines.append(
            f"  {row['size']:>6} {row['dots']:6d} dots  to identities {row['identities_ms']:7.2f}  "
            f"tracked {row['tracked_ms']:7.2f}  from nothing {row['from_nothing_ms']:7.2f}  "
            f"(start {row['start_s']:.2f} s)"
        )
    large = [row for row in rows if row["size"] == "1440p" and row["dots"] >= 1000]
    dots = np.log([row["dots"] for row in large])
    for name in ("identities_ms", "tracked_ms", "from_nothing_ms"):
        power = np.polyfit(dots, np.log([row[name] for row in large]), 1)[0]
        lines.append(f"  {name} grows as dots^{power:.2f} from 1040 to 10 000 at 1440p (linear: 1 or less)")
    return "\n".join(lines)
