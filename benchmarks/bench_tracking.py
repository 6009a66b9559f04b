"""Milliseconds per tracked frame against the number of markers.

    python benchmarks/bench_tracking.py

Sheets of 96 to 10 000 markers are pressed by 0.2 and by 0.8 pitch per frame; in the third case two dots in a
hundred are missing and two are false. One thread; median and 99th percentile of the processor time of
`--frames` frames.
"""

import argparse
import time

import numpy as np

from manytouch.tracking import MarkerTracker
from manytouch.values import Camera, Detections, Layout, Sensor

PITCH_PX = 30.0
SHAPES = ((8, 12), (16, 24), (26, 40), (50, 80), (80, 125))


def sensor_of(rows: int, columns: int) -> Sensor:
    row, column = np.indices((rows, columns))
    rest = PITCH_PX * np.column_stack([column.ravel(), row.ravel(), np.zeros(rows * columns)])
    return Sensor(
        name="benchmark",
        camera=Camera(
            width_px=int(PITCH_PX * (columns + 3)),
            height_px=int(PITCH_PX * (rows + 3)),
            fx_px=1e4,
            fy_px=1e4,
            cx_px=2.0 * PITCH_PX,
            cy_px=2.0 * PITCH_PX,
            distortion=np.zeros(5),
            rotation_vector=np.zeros(3),
            translation_mm=np.array([0.0, 0.0, 1e4]),
        ),
        layout=Layout(
            rest_mm=rest,
            row_column=np.column_stack([row.ravel(), column.ravel()]).astype(np.int64),
            pitch_mm=np.full(2, PITCH_PX),
            radius_mm=np.full(rows * columns, 0.25 * PITCH_PX),
            polarity="light",
            is_missing=np.zeros(rows * columns, dtype=bool),
        ),
    )


def sequence(rest_px: np.ndarray, step: float, damaged: float, frames: int) -> list[Detections]:
    """Detections of a press that comes and goes in the middle."""
    rng = np.random.default_rng(0)
    away = rest_px - rest_px.mean(axis=0)
    bell = np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / (3.0 * PITCH_PX) ** 2)
    field = 1.2 * PITCH_PX * bell * (away / (3.0 * PITCH_PX) + np.array([0.3, 0.1]))
    field *= PITCH_PX / np.linalg.norm(field, axis=1).max()
    turns = max(1, round(1.0 / step))
    found = []
    for k in range(frames):
        phase = k % (2 * turns)
        share = min(1.0, step * (phase if phase <= turns else 2 * turns - phase))
        dots = rest_px + share * field + rng.normal(0.0, 0.05, rest_px.shape)
        dots = dots[rng.random(len(dots)) >= damaged]
        false = rng.uniform(rest_px.min(axis=0), rest_px.max(axis=0), (round(damaged * len(rest_px)), 2))
        dots = rng.permutation(np.concatenate([dots, false]))
        n = len(dots)
        found.append(
            Detections(
                centre_px=dots,
                covariance_px2=np.tile(0.0025 * np.eye(2), (n, 1, 1)),
                area_px2=np.full(n, 180.0),
                contrast=np.full(n, 60.0),
            )
        )
    return found


def timed(sensor: Sensor, detections: list[Detections]) -> tuple[float, float, float]:
    """Median and 99th percentile in ms, and the share of markers seen."""
    follow = MarkerTracker()
    state = follow.start(sensor)
    for each in detections[:20]:
        state, _ = follow.step(state, each)
    milliseconds, seen = [], []
    for each in detections[20:]:
        begun = time.process_time()
        state, grid = follow.step(state, each)
        milliseconds.append(1e3 * (time.process_time() - begun))
        seen.append(grid.is_seen.mean())
    return float(np.median(milliseconds)), float(np.quantile(milliseconds, 0.99)), float(np.mean(seen))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=300)
    frames = parser.parse_args().frames
    cases = {"0.2 pitch": (0.2, 0.0), "0.8 pitch": (0.8, 0.0), "0.2, 2 % damaged": (0.2, 0.02)}
    print("markers  case               p50 ms  p99 ms  seen")
    for rows, columns in SHAPES:
        sensor = sensor_of(rows, columns)
        follow = MarkerTracker()
        rest = follow.start(sensor).graph.arrays.rest_px
        for name, (step, damaged) in cases.items():
            median, tail, seen = timed(sensor, sequence(rest, step, damaged, frames + 20))
            print(f"{rows * columns:7d}  {name:17s}  {median:6.3f}  {tail:6.3f}  {seen:.4f}")


if __name__ == "__main__":
    main()
