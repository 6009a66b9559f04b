"""How manytouch's time grows with the number of dots and with the size of the image."""

import time

import numpy as np
from own import Tracked
from sequences import LEAST_PITCH_PX, SIZES, Sequence, course_of, pictures, to_and_fro

BESIDE = {"480p": (96, 384), "720p": (96, 384, 1040), "1440p": (96, 384, 1040, 4000, 10000)}


def scaling_of(runs: int = 24) -> list[dict[str, float | int | str]]:
    """Median ms of a tracked frame and of one from nothing; all sizes take turns."""
    cases = [Sequence(dots=dots, size=size, frames=6) for size, counts in BESIDE.items() for dots in counts]
    played = []
    for sequence in cases:
        course = course_of(sequence)
        follow = Tracked(course.sensor)
        played.append((sequence, pictures(course), follow, follow.tracking, {"tracked": [], "nothing": []}))
    for turn, index in enumerate(to_and_fro(6, runs + 3)):
        for _, frames, follow, first, spent_ms in played:
            kept = follow.tracking
            follow.tracking = first
            nothing_ms = _timed(follow, frames[index])
            follow.tracking = kept
            tracked_ms = _timed(follow, frames[index])
            if turn >= 3:
                spent_ms["nothing"].append(nothing_ms)
                spent_ms["tracked"].append(tracked_ms)
    return [
        {
            "size": sequence.size,
            "megapixels": float(np.prod(SIZES[sequence.size]) / 1e6),
            "dots": sequence.dots,
            "tracked_ms": float(np.median(spent_ms["tracked"])),
            "from_nothing_ms": float(np.median(spent_ms["nothing"])),
        }
        for sequence, _, _, _, spent_ms in played
    ]


def _timed(follow: Tracked, frame: object) -> float:
    begun_s = time.perf_counter()
    follow(frame)
    return 1e3 * (time.perf_counter() - begun_s)


def scaling_text(rows: list[dict[str, float | int | str]]) -> str:
    """Table, and how the time per dot grows."""
    lines = [f"number of dots and size of the image (pitch {LEAST_PITCH_PX:g} px at least), ms"]
    for row in rows:
        lines.append(
            f"  {row['size']:>6} {row['dots']:6d} dots  tracked {row['tracked_ms']:8.2f}  "
            f"from nothing {row['from_nothing_ms']:8.2f}"
        )
    large = [row for row in rows if row["size"] == "1440p" and row["dots"] >= 1000]
    dots = np.log([row["dots"] for row in large])
    for name in ("tracked_ms", "from_nothing_ms"):
        power = np.polyfit(dots, np.log([row[name] for row in large]), 1)[0]
        lines.append(f"  {name} grows as dots^{power:.2f} from 1040 to 10 000 at 1440p (linear: 1 or less)")
    return "\n".join(lines)
