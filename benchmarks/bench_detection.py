"""Milliseconds per frame of dot detection, stage by stage.

    python benchmarks/bench_detection.py

A frame of 2560 x 1440 px with 1040 dots of 8 px radius, grey and in colour: the search of the whole frame,
its stages, and the windows around expected places. One thread; median and least of `--repeats`
runs of processor time, after compilation.
"""

import argparse
import time
from collections.abc import Callable

import cv2
import numpy as np

from manytouch.detection import DotSearch, estimate_noise, measure, survey
from manytouch.detection.candidates import allocate_dog_buffers, find_candidates
from manytouch.simulation.render.discs import Look, render_discs
from manytouch.values import Camera, Frame, Layout, Sensor

WIDTH, HEIGHT, PITCH_PX, RADIUS_PX = 2560, 1440, 55.0, 8.0
LOOKS = {
    "grey": Look(read_noise=2.5),
    "colour": Look(ground=(45.0, 50.0, 40.0), dot=(190.0, 210.0, 205.0), read_noise=2.5),
}


def places_px() -> np.ndarray:
    x, y = np.meshgrid((np.arange(40) - 19.5) * PITCH_PX, (np.arange(26) - 12.5) * PITCH_PX)
    middle = np.array([0.5 * WIDTH, 0.5 * HEIGHT])
    jitter = np.random.default_rng(0).uniform(-0.5, 0.5, (x.size, 2))
    return np.stack([x.ravel(), y.ravel()], axis=1) + middle + jitter


def sensor_of(centre_px: np.ndarray) -> Sensor:
    """A camera above the sheet's middle; a pixel is a millimetre."""
    middle = np.array([0.5 * WIDTH, 0.5 * HEIGHT])
    return Sensor(
        name="benchmark",
        camera=Camera(
            width_px=WIDTH,
            height_px=HEIGHT,
            fx_px=2000.0,
            fy_px=2000.0,
            cx_px=middle[0],
            cy_px=middle[1],
            distortion=np.zeros(5),
            rotation_vector=np.zeros(3),
            translation_mm=np.array([0.0, 0.0, 2000.0]),
        ),
        layout=Layout(
            rest_mm=np.column_stack([centre_px - middle, np.zeros(len(centre_px))]),
            row_column=None,
            pitch_mm=np.full(2, PITCH_PX),
            radius_mm=np.full(len(centre_px), RADIUS_PX),
            polarity="light",
            is_missing=np.zeros(len(centre_px), dtype=bool),
        ),
    )


def timed(name: str, run: Callable[[], object], repeats: int) -> None:
    run()
    spent_ms = []
    for _ in range(repeats):
        begun_s = time.process_time()
        run()
        spent_ms.append(1e3 * (time.process_time() - begun_s))
    print(f"  {name:<34} {np.median(spent_ms):8.2f} {np.min(spent_ms):8.2f}")


def stages(name: str, image: np.ndarray, centre_px: np.ndarray, repeats: int) -> None:
    search, radius_px = DotSearch(), np.full(len(centre_px), RADIUS_PX)
    frame = Frame(index=0, timestamp_ns=0, camera="benchmark", image=image)
    state, found = search.step(search.start(sensor_of(centre_px)), frame, None)
    weights = state.appearance.weights(1 if image.ndim == 2 else 3)
    buffers = allocate_dog_buffers(image, RADIUS_PX)
    print(f"{name}: {len(found.centre_px)} dots{'median ms':>24}{'least':>9}")
    pieces: dict[str, Callable[[], object]] = {
        "noise": lambda: estimate_noise(image, weights),
        "candidates (with reduced image)": lambda: find_candidates(image, weights, RADIUS_PX, 5.0, buffers),
        "centres": lambda: measure(image, weights, centre_px, radius_px, noise=2.5),
        "whole frame": lambda: search.step(state, frame, None),
        "windows, 0.6 px away": lambda: search.step(state, frame, centre_px + 0.4),
        "windows, 2 px away": lambda: search.step(state, frame, centre_px + 1.4),
    }
    for piece, run in pieces.items():
        timed(piece, run, repeats)
    timed("survey", lambda: survey([frame]), 3)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=40)
    repeats = parser.parse_args().repeats
    cv2.setNumThreads(1)
    centre_px = places_px()
    shape_px = np.tile(RADIUS_PX * np.eye(2), (len(centre_px), 1, 1))
    for name, look in LOOKS.items():
        image = render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=1)
        stages(name, image, centre_px, repeats)


if __name__ == "__main__":
    main()
