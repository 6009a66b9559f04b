"""How fast the method `perimeter` is: its start, one step, and and a map of 200 x 120 points.

Dots have areas, so that contacts are found by both witnesses; `--without-areas` leaves displacements alone.
`first step` holds the loading (or, the first time, the compiling) of the compiled loops.

OMP_NUM_THREADS=1 python benchmarks/bench_estimation.py [--frames 200] [--rows 26] [--columns 40]
"""

import argparse
import resource
import time
from dataclasses import replace

import numpy as np

from manytouch.estimation import PerimeterEstimator
from manytouch.geometry.camera import project
from manytouch.geometry.sampling import sampling_on
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Layout, Sensor, TrackedGrid


def sensor_of(rows: int, columns: int) -> Sensor:
    """The demo sensor with another lattice over the same 120 x 80 mm."""
    sensor = demo_sensor()
    row, column = np.divmod(np.arange(rows * columns), columns)
    pitch_mm = np.array([116.0 / (columns - 1), 76.0 / (rows - 1)])
    rest_mm = np.zeros((rows * columns, 3))
    rest_mm[:, :2] = (np.column_stack([column, row]) - [(columns - 1) / 2, (rows - 1) / 2]) * pitch_mm
    layout = Layout(
        rest_mm=rest_mm,
        row_column=np.column_stack([row, column]).astype(np.int64),
        pitch_mm=pitch_mm,
        radius_mm=np.ones(len(rest_mm)),
        polarity="light",
        is_missing=np.zeros(len(rest_mm), dtype=np.bool_),
    )
    return replace(sensor, layout=layout)


def grids(sensor: Sensor, count: int, has_areas: bool = True) -> list[TrackedGrid]:
    """Three fingers that press deeper and slide, with noise."""
    assert sensor.layout is not None
    rest_mm = sensor.layout.rest_mm
    chance = np.random.default_rng(0)
    out = []
    for frame in range(count):
        moved = np.zeros_like(rest_mm)
        for x, y in ((-35.0, 10.0), (0.0, -15.0), (35.0, 12.0)):
            offset = rest_mm[:, :2] - [x + 5 * np.sin(frame / 20), y]
            hollow = 3.0 * np.exp(-(offset**2).sum(axis=1) / 72.0)
            moved[:, 2] -= hollow
            moved[:, :2] += 1.5 * hollow[:, None] * offset / 36.0
        position = project(sensor.camera, rest_mm + moved)
        nearer = sensor.camera.translation_mm[2] / (sensor.camera.translation_mm[2] + moved[:, 2])
        area_px2 = 80.0 * nearer**2 * chance.normal(1.0, 0.01, len(rest_mm))
        out.append(
            TrackedGrid(
                position_px=position + chance.normal(0, 0.03, position.shape),
                covariance_px2=np.tile(0.03**2 * np.eye(2), (len(rest_mm), 1, 1)),
                is_seen=np.ones(len(rest_mm), dtype=np.bool_),
                frames_unseen=np.zeros(len(rest_mm), dtype=np.int64),
                area_px2=area_px2 if has_areas else None,
            )
        )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--rows", type=int, default=26)
    parser.add_argument("--columns", type=int, default=40)
    parser.add_argument("--without-areas", action="store_true")
    given = parser.parse_args()
    sensor = sensor_of(given.rows, given.columns)
    assert sensor.layout is not None
    estimate = PerimeterEstimator()
    begun = time.perf_counter()
    state = estimate.start(sensor)
    spent_ms = 1e3 * (time.perf_counter() - begun)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # kB on Linux
    print(f"start {spent_ms:.0f} ms, {len(sensor.layout.rest_mm)} markers, process at most {peak_mb:.0f} MB")
    dense = sampling_on(sensor.layout, np.linspace(-58, 58, 200), np.linspace(-38, 38, 120))
    spent: dict[str, list[float]] = {"step": [], "map 200 x 120": []}
    for number, grid in enumerate(grids(sensor, given.frames + 10, not given.without_areas)):
        begun = time.perf_counter()
        state, surface, contacts = estimate.step(state, grid)
        between = time.perf_counter()
        dense(-surface.displacement_mm[:, 2])
        if number == 0:
            print(f"first step {1e3 * (between - begun):.0f} ms")
        if number >= 10:
            spent["step"].append(1e3 * (between - begun))
            spent["map 200 x 120"].append(1e3 * (time.perf_counter() - between))
    print(f"{len(contacts.touching)} contacts")
    for name, times in spent.items():
        print(f"{name:16} p50 {np.median(times):6.3f} ms  p99 {np.quantile(times, 0.99):6.3f} ms")


if __name__ == "__main__":
    main()
