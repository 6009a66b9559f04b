"""Frames per second of the paper's chain with and without its 3-D map, one thread."""

import time
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.evaluation.suite.recordings import SimulatedRecording
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation
from manytouch.paper.tracking import PaperTracking


@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """Median milliseconds of a frame of 2560 x 1440 px.

    Attributes:
        markers: in the picture.
        points: of the map.
        chain_ms: detection, tracking and depths, without the map.
        table_ms: the map with weights that are computed once, as it is in manytouch.
        plain_ms: the map in loops over points and markers, as it is usually written down.
        plot_ms: the map drawn in 3-D by matplotlib, which is not part of the others.
    """

    markers: int
    points: int
    chain_ms: float
    table_ms: float
    plain_ms: float
    plot_ms: float

    @property
    def frames_per_second(self) -> dict[str, float]:
        """Without the map, with it from a table, with it in plain loops, with these and a 3-D plot."""
        return {
            "without the map": 1e3 / self.chain_ms,
            "with the map, weights kept": 1e3 / (self.chain_ms + self.table_ms),
            "with the map in plain loops": 1e3 / (self.chain_ms + self.plain_ms),
            "with the map in plain loops and its plot": 1e3 / (self.chain_ms + self.plain_ms + self.plot_ms),
        }


def speed(recording: SimulatedRecording) -> Speed:
    """Time the stages of `--method paper` on a recording."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return _timed(recording)
    finally:
        cv2.setNumThreads(threads)


def _timed(recording: SimulatedRecording) -> Speed:
    detect, track, estimate = PaperDetection(), PaperTracking(), PaperEstimation()
    detecting, tracking = detect.start(recording.sensor), track.start(recording.sensor)
    estimating = estimate.start(recording.sensor)
    chain_ms, table_ms = [], []
    for frame in recording.frames:
        begun_s = time.perf_counter()
        detecting, detections = detect.step(detecting, frame, None)
        tracking, grid = track.step(tracking, detections)
        estimating, surface, _ = estimate.step(estimating, grid)
        whole_ms = 1e3 * (time.perf_counter() - begun_s)
        begun_s = time.perf_counter()
        estimating.plane.depth(surface)
        table_ms.append(1e3 * (time.perf_counter() - begun_s))
        chain_ms.append(whole_ms - table_ms[-1])
    layout, between = estimating.layout, estimate.interpolation
    depth_mm = -surface.displacement_mm[:, 2]
    begun_s = time.perf_counter()
    surface_mm = plain_map(
        layout.rest_mm[:, 0].tolist(),
        layout.rest_mm[:, 1].tolist(),
        depth_mm.tolist(),
        iterations=between.iterations,
        radius_mm=between.search_radius_pitch * float(np.sqrt(np.prod(layout.pitch_mm))),
        power=between.power,
    )
    plain_ms = 1e3 * (time.perf_counter() - begun_s)
    return Speed(
        markers=len(layout.rest_mm),
        points=between.iterations**2,
        chain_ms=float(np.median(chain_ms)),
        table_ms=float(np.median(table_ms)),
        plain_ms=plain_ms,
        plot_ms=plotted_ms(surface_mm, estimating.x_mm, estimating.y_mm),
    )


def plotted_ms(
    depth_mm: Float64[np.ndarray, "rows columns"],
    x_mm: Float64[np.ndarray, " columns"],
    y_mm: Float64[np.ndarray, " rows"],
) -> float:
    """Milliseconds to draw a map in 3-D by matplotlib, every point of it, into an image."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    begun_s = time.perf_counter()
    canvas = FigureCanvasAgg(Figure())
    axes = canvas.figure.add_subplot(projection="3d")
    axes.plot_surface(*np.meshgrid(x_mm, y_mm), depth_mm, cmap="viridis", rcount=len(y_mm), ccount=len(x_mm))
    canvas.draw()
    return 1e3 * (time.perf_counter() - begun_s)


def plain_map(
    x_mm: list[float],
    y_mm: list[float],
    z_mm: list[float],
    *,
    iterations: int,
    radius_mm: float,
    power: float = 2.0,
) -> np.ndarray:
    """Inverse distance weighting in plain Python: rows of depths over the markers' bounding box."""
    columns = [min(x_mm) + k * (max(x_mm) - min(x_mm)) / (iterations - 1) for k in range(iterations)]
    rows = [min(y_mm) + k * (max(y_mm) - min(y_mm)) / (iterations - 1) for k in range(iterations)]
    surface = []
    for row in rows:
        line = []
        for column in columns:
            share = total = 0.0
            for x, y, z in zip(x_mm, y_mm, z_mm, strict=True):
                distance = ((x - column) ** 2 + (y - row) ** 2) ** 0.5
                if distance <= radius_mm:
                    weight = max(distance, 1e-6 * radius_mm) ** -power
                    share += weight * z
                    total += weight
            line.append(share / total if total > 0.0 else float("nan"))
        surface.append(line)
    return np.array(surface)
