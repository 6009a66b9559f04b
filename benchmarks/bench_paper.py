"""How fast the paper's method is: per stage, as it is in manytouch and with the paper's plain loops.

    OMP_NUM_THREADS=1 python benchmarks/bench_paper.py [--frames 30] [--iterations 100] [--width 2560]

The paper reports less than one frame per second (2560 x 1440, 8th generation Core i7) once the surface
is interpolated. `plain_map` is that interpolation as it is usually written down, point by point and
marker by marker; the same numbers come out.
"""

import argparse
import time

import cv2
import numpy as np

from manytouch.evaluation.published.speed import plain_map
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation, PaperEstimationState
from manytouch.paper.tracking import PaperTracking
from manytouch.sources.simulated import simulated_source
from manytouch.values import Interpolation, Surface


def measured(
    frames: int, width_px: int, estimate: PaperEstimation
) -> tuple[dict[str, np.ndarray], PaperEstimationState, Surface]:
    """Milliseconds of each stage in each frame; the memory and the surface of the last frame."""
    simulator = simulated_source(width_px=width_px).simulator
    stages = (PaperDetection(), PaperTracking(), estimate)
    detecting, tracking, estimating = (stage.start(simulator.sensor) for stage in stages)
    spent_ms: dict[str, list[float]] = {"detection": [], "tracking": [], "estimation": [], "all": []}
    # neighbouring frames, because the gate follows markers; two for nothing, so that memory is warm
    for index in range(40, 42 + frames):
        frame = simulator.frame(index)
        ticks = [time.perf_counter()]
        detecting, detections = stages[0].step(detecting, frame, None)
        ticks.append(time.perf_counter())
        tracking, grid = stages[1].step(tracking, detections)
        ticks.append(time.perf_counter())
        estimating, surface, _ = stages[2].step(estimating, grid)
        ticks.append(time.perf_counter())
        if index >= 42:
            for name, seconds in zip(spent_ms, [*np.diff(ticks), ticks[-1] - ticks[0]], strict=True):
                spent_ms[name].append(1e3 * seconds)
    return {name: np.array(values) for name, values in spent_ms.items()}, estimating, surface


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--frames", type=int, default=30)
    options.add_argument("--iterations", type=int, default=100)
    options.add_argument("--width", type=int, default=2560, help="of the 16:9 image, px")
    chosen = options.parse_args()
    cv2.setNumThreads(1)
    estimate = PaperEstimation(interpolation=Interpolation(kind="idw", iterations=chosen.iterations))
    spent_ms, memory, surface = measured(chosen.frames, chosen.width, estimate)
    layout = memory.layout
    print(f"{chosen.width} px wide, {len(layout.rest_mm)} markers, surface of {chosen.iterations**2} points")
    for name, values in spent_ms.items():
        print(f"{name:>12}: p50 {np.median(values):8.2f} ms   p99 {np.percentile(values, 99):8.2f} ms")
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    begun_s = time.perf_counter()
    plain = plain_map(
        *(layout.rest_mm[:, axis].tolist() for axis in (0, 1)),
        (-surface.displacement_mm[:, 2]).tolist(),
        iterations=chosen.iterations,
        radius_mm=estimate.interpolation.search_radius_pitch * pitch_mm,
        power=estimate.interpolation.power,
    )
    plain_ms = 1e3 * (time.perf_counter() - begun_s)
    apart_mm = float(np.nanmax(np.abs(plain - memory.plane.depth(surface))))
    whole_ms = np.median(spent_ms["all"]) + plain_ms
    print(f"{'plain IDW':>12}: once {plain_ms:9.1f} ms   (differs by at most {apart_mm:.1e} mm)")
    print(f"with plain IDW: {whole_ms:.0f} ms, {1e3 / whole_ms:.2f} frames per second")


if __name__ == "__main__":
    main()
