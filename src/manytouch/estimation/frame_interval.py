"""Time between frames, for what changes with time whatever the frame rate."""

import math

USUAL_S = 1.0 / 30.0
"""Interval where the times of frames are not known or do not increase: that of most cameras."""
LONGEST_S = 1.0
"""Longest interval that counts: what was not seen for longer is not known from one frame."""


def interval_s(before_ns: int | None, now_ns: int | None) -> float:
    """Time since the frame before in s; `USUAL_S` where the times do not show it, at most `LONGEST_S`.

    Args:
        before_ns: time of the frame before; None: not known.
        now_ns: time of this frame; None: not known.
    """
    if before_ns is None or now_ns is None or now_ns <= before_ns:
        return USUAL_S
    return min((now_ns - before_ns) * 1e-9, LONGEST_S)


def remaining(elapsed_s: float, time_constant_s: float) -> float:
    """The share that is left after a time of what falls off exponentially; 0 where the constant is 0."""
    return math.exp(-elapsed_s / time_constant_s) if time_constant_s > 0.0 else 0.0
