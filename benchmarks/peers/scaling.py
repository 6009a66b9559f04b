"""How manytouch's time grows with the number of dots and with the size of the image."""

import time

import numpy as np
from own import Tracked
from sequences import Sequence, course_of, pictures, to_and_fro

BESIDE = {"480p": (96, 384), "720p": (96, 384, 1040), "1440p": (96, 384, 1040, 4000, 10000)}
COMPLETE_UP_TO = 1040
"""Dots up to which the whole frame is timed; what the estimate works out at its start grows too fast."""

FRAMES, WARM = 6, 3


class _Case:
    """A sheet that is followed: to identities, and completely where that is possible."""

    def __init__(self, sequence: Sequence) -> None:
        course = course_of(sequence)
        self.sequence, self.frames = sequence, pictures(course)
        self.numbering = Tracked(course.sensor, estimate=False)
        self.first = self.numbering.tracking
        begun_s = time.perf_counter()
        self.complete = Tracked(course.sensor) if sequence.dots <= COMPLETE_UP_TO else None
        self.start_s = time.perf_counter() - begun_s
        self.spent_ms: dict[str, list[float]] = {"tracked": [], "nothing": [], "complete": []}

    def turn(self, index: int) -> None:
        frame = self.frames[index]
        kept, self.numbering.tracking = self.numbering.tracking, self.first
        self.spent_ms["nothing"].append(_timed(self.numbering, frame))
        self.numbering.tracking = kept
        self.spent_ms["tracked"].append(_timed(self.numbering, frame))
        if self.complete is not None:
            self.spent_ms["complete"].append(_timed(self.complete, frame))

    def row(self) -> dict[str, float | int | str | None]:
        median = {name: float(np.median(each[WARM:])) for name, each in self.spent_ms.items() if each}
        return {
            "size": self.sequence.size,
            "dots": self.sequence.dots,
            "tracked_ms": median["tracked"],
            "from_nothing_ms": median["nothing"],
            "complete_ms": median.get("complete"),
            "start_s": self.start_s if self.complete is not None else None,
        }


def scaling_of(runs: int = 20) -> list[dict[str, float | int | str | None]]:
    """Median ms of a frame to identities, tracked and from nothing, and complete; all sizes take turns."""
    cases = [
        _Case(Sequence(dots=dots, size=size, frames=FRAMES))
        for size, counts in BESIDE.items()
        for dots in counts
    ]
    for index in to_and_fro(FRAMES, runs + WARM):
        for case in cases:
            case.turn(int(index))
    return [case.row() for case in cases]


def _timed(follow: Tracked, frame: object) -> float:
    begun_s = time.perf_counter()
    follow(frame)
    return 1e3 * (time.perf_counter() - begun_s)


def scaling_text(rows: list[dict[str, float | int | str | None]]) -> str:
    """Table, and how the time grows with the number of dots."""
    lines = ["number of dots and size of the image; ms to identities, and complete with estimate and map"]
    for row in rows:
        complete = (
            "" if row["complete_ms"] is None else f"{row['complete_ms']:8.2f} (start {row['start_s']:.2f} s)"
        )
        lines.append(
            f"  {row['size']:>6} {row['dots']:6d} dots  tracked {row['tracked_ms']:8.2f}  "
            f"from nothing {row['from_nothing_ms']:8.2f}  complete {complete}"
        )
    large = [row for row in rows if row["size"] == "1440p" and row["dots"] >= 1000]
    dots = np.log([row["dots"] for row in large])
    for name in ("tracked_ms", "from_nothing_ms"):
        power = np.polyfit(dots, np.log([row[name] for row in large]), 1)[0]
        lines.append(f"  {name} grows as dots^{power:.2f} from 1040 to 10 000 at 1440p (linear: 1 or less)")
    return "\n".join(lines)
