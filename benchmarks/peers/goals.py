"""What manytouch wants to reach, beside what was measured.

Times and ratios are medians of processor time: with one thread that is the time on the wall when nothing
else runs, and less disturbed when something does. The 99th percentile and the two processes are wall time.
"""

from rounds import Timing

TIMES_FASTER = {
    "trackpy.locate": (150, 400),
    "tuned blob": (12, 25),
    "default PyrLK": (6, 15),
    "tuned OpenCV": (4, 10),
    "paper's chain": (80, 200),
    "with its IDW": (800, 2000),
}
PEERS = {
    "trackpy.locate": "trackpy.locate",
    "tuned blob": "SimpleBlobDetector, tuned",
    "default PyrLK": "PyrLK, default",
    "paper's chain": "paper's chain",
    "with its IDW": "paper's chain and map",
}
TRACKED = "manytouch: tracked frame"
TUNED = "OpenCV, tuned"


def goals_of(timings: dict[str, Timing], row: Timing, pair: dict[str, float] | None) -> list[str]:
    """One sentence for each goal: what was measured, what must be, what is aimed for.

    `row` are tracked frames one after the other, `pair` the two sensors.
    """
    own, nothing = timings[TRACKED], timings.get("manytouch: frame from nothing")
    said = [_line("tracked frame, ms", own.median_cpu_ms, 1.0, 0.5, most=True)]
    copy = timings.get("copy of the frame")
    if copy is not None:
        said.append(
            _line("tracked frame, copies", own.median_cpu_ms / copy.median_cpu_ms, 4.0, 2.0, most=True)
        )
    if nothing is not None:
        said.append(_line("frame from nothing, ms", nothing.median_cpu_ms, 2.0, 1.0, most=True))
    if row.p99_ms is not None:
        what = f"p99 / median of {len(row.spent_ms)} tracked frames"
        said.append(_line(what, row.p99_ms / row.median_ms, 3.0, 2.0, most=True))
    for goal, (must, aim) in TIMES_FASTER.items():
        ms = _peer_ms(timings, goal)
        if ms is not None:
            said.append(_line(f"times faster than {goal}", ms / own.median_cpu_ms, must, aim, most=False))
    decode, whole = timings.get("JPEG to grey"), timings.get("manytouch: JPEG to identities")
    if decode is not None and whole is not None:
        ratio = whole.median_cpu_ms / decode.median_cpu_ms
        said.append(_line("JPEG to identities / decoding alone", ratio, 1.4, 1.15, most=True))
    if pair is not None:
        said.append(_line("two sensors in two processes / one", pair["ratio"], 1.8, 1.95, most=False))
    return said


def _peer_ms(timings: dict[str, Timing], goal: str) -> float | None:
    """Median of the peer of a goal; of the tuned chains the fastest one on the whole image."""
    if goal == "tuned OpenCV":
        whole = [name for name in timings if name.startswith(TUNED) and "half" not in name]
        return min(timings[name].median_cpu_ms for name in whole) if whole else None
    return timings[PEERS[goal]].median_cpu_ms if PEERS[goal] in timings else None


def _line(what: str, measured: float, must: float, aim: float, *, most: bool) -> str:
    reached = (measured <= aim, measured <= must) if most else (measured >= aim, measured >= must)
    word = "aim reached" if reached[0] else "reached" if reached[1] else "NOT reached"
    return f"{what:42} {measured:9.2f}   must {must:g}, aim {aim:g}: {word}"
