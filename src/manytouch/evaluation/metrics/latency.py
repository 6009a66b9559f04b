"""How long does a frame take?"""

import numpy as np

from manytouch.evaluation.metrics.depth import percentile
from manytouch.values.arrays import Scalars


def latency_figures(milliseconds: Scalars) -> dict[str, float]:
    """Median and 99th percentile of the time from a decoded frame to its finished reading.

    `frames_per_second` is what one core could do: 1000 over the mean.
    """
    known = milliseconds[np.isfinite(milliseconds)]
    mean = float(known.mean()) if len(known) else float("nan")
    return {
        "p50_ms": percentile(known, 50),
        "p99_ms": percentile(known, 99),
        "frames_per_second": 1000.0 / mean if mean > 0 else float("nan"),
        "frames": float(len(known)),
    }
