"""The goals of manytouch, with what was measured.

Times and ratios are medians of processor time: with one thread that is the time on the wall when nothing
else runs, and less disturbed when something does. In brackets is the same from the least times, which a busy
machine disturbs still less. The 99th percentile is that of the time on the wall, in brackets that of
processor time; the two processes are wall time.
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
    lines = [_line("tracked frame, ms", _both(own), 1.0, 0.5, most=True)]
    copy = timings.get("copy of the frame")
    if copy is not None:
        lines.append(_line("tracked frame, copies", _ratio(own, copy), 4.0, 2.0, most=True))
    if nothing is not None:
        lines.append(_line("frame from nothing, ms", _both(nothing), 2.0, 1.0, most=True))
    if row.p99_over_median is not None:
        what = f"p99 / median of {len(row.spent_ms)} tracked frames"
        lines.append(_line(what, row.p99_over_median, 3.0, 2.0, most=True))
    for goal, (must, aim) in TIMES_FASTER.items():
        peer = _peer(timings, goal)
        if peer is not None:
            lines.append(_line(f"times faster than {goal}", _ratio(peer, own), must, aim, most=False))
    decode, whole = timings.get("JPEG to grey"), timings.get("manytouch: JPEG to identities")
    if decode is not None and whole is not None:
        ratio = _ratio(whole, decode)
        lines.append(_line("JPEG to identities / decoding alone", ratio, 1.4, 1.15, most=True))
    if pair is not None:
        lines.append(
            _line("two sensors in two processes / one", (pair["ratio"], None), 1.8, 1.95, most=False)
        )
    return lines


def _both(timing: Timing) -> tuple[float, float]:
    return timing.median_cpu_ms, timing.least_cpu_ms


def _ratio(above: Timing, below: Timing) -> tuple[float, float]:
    return above.median_cpu_ms / below.median_cpu_ms, above.least_cpu_ms / below.least_cpu_ms


def _peer(timings: dict[str, Timing], goal: str) -> Timing | None:
    """The peer of a goal; of the tuned chains the fastest one on the whole image."""
    if goal == "tuned OpenCV":
        whole = [name for name in timings if name.startswith(TUNED) and "half" not in name]
        return min((timings[name] for name in whole), key=lambda each: each.median_cpu_ms, default=None)
    return timings.get(PEERS[goal])


def _line(what: str, measured: tuple[float, float | None], must: float, aim: float, *, most: bool) -> str:
    median, least = measured
    reached = (median <= aim, median <= must) if most else (median >= aim, median >= must)
    word = "aim reached" if reached[0] else "reached" if reached[1] else "NOT reached"
    bracket = "" if least is None else f"({least:.2f})"
    return f"{what:42} {median:9.2f} {bracket:>9}   must {must:g}, aim {aim:g}: {word}"
