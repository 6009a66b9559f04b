"""Frames with a contact after everything has been released, on sheets and pads that creep back.

FOLDER contains scenes of `random_scenes.py --moving`, with or without `--pads`. Their true markers get noise.
From the frame on in which nothing presses any more, each marker keeps a share of a mean of its earlier
displacements that fades with a time constant, as a Kelvin-Voigt element in series with an elastic sheet does
(Y. C. Fung, Biomechanics, 1993, chapter 2). Four seconds of rest follow. Nothing touches in these frames.
With `--times 8` there are so many frames for each of the scene, with the markers on the lines between: 120
instead of 15 frames per second.

    .venv/bin/python benchmarks/random_scenes.py --moving --first 500 --scenes 4 --out out/moving
    .venv/bin/python benchmarks/after_release.py out/moving --share 0.03 [--times 8]
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.csv as pc
import pyarrow.parquet as pq

from manytouch.session import pipeline_for
from manytouch.values import TrackedGrid
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.read import load_sensor

NOISE_PX = 0.01
REST_S = 4.0
SETTLE_S = 0.2  # after the release, in which a contact may end


def true_markers(truth: Path) -> tuple[np.ndarray, float]:
    """(f, m, 2) images of the markers in each frame, and the frames per second."""
    table = pq.read_table(truth / "markers.parquet", columns=["frame", "time_s", "marker", "x_px", "y_px"])
    frame, time_s, marker, x_px, y_px = (column.to_numpy() for column in table.columns)
    place_px = np.full((frame.max() + 1, marker.max() + 1, 2), np.nan)
    place_px[frame, marker] = np.column_stack([x_px, y_px])
    return place_px, float(frame.max() / time_s.max())


def at_more_times(place_px: np.ndarray, times: int) -> np.ndarray:
    """(f, m, 2) images in so many frames for each one, on the lines between them."""
    step = np.arange((len(place_px) - 1) * times + 1) / times
    before = np.minimum(step.astype(int), len(place_px) - 2)
    share = (step - before)[:, None, None]
    return np.asarray((1.0 - share) * place_px[before] + share * place_px[before + 1])


def last_pressed(truth: Path) -> int:
    """The last frame in which something presses."""
    rows = pc.read_csv(truth / "contacts.csv").to_pylist()
    return max(row["frame"] for row in rows if row["phase"] != "end")


def creeping_px(place_px: np.ndarray, last: int, share: float, fade: float) -> Iterator[np.ndarray]:
    """(m, 2) images of the markers in each frame, with what remains after the last one that is pressed."""
    kept_px = np.zeros_like(place_px[0])
    for number, now_px in enumerate(place_px):
        moved_px = now_px - place_px[0] if number <= last else 0.0
        kept_px = fade * kept_px + (1.0 - fade) * moved_px
        yield now_px if number <= last else now_px + share * kept_px


def frames_with_contact(folder: Path, share: float, seconds: float, times: int = 1) -> tuple[int, int]:
    """Number of frames with a contact after the release, and number of these frames."""
    truth = folder / "simulated" / "truth"
    place_px, scene_fps = true_markers(truth)
    place_px, fps = at_more_times(place_px, times), times * scene_fps
    place_px = np.concatenate([place_px, np.tile(place_px[:1], (round(REST_S * fps), 1, 1))])
    estimator = pipeline_for("mechanics").estimate
    state = estimator.start(load_sensor(folder / "simulated" / "sensor.toml"))
    random, last, count = np.random.default_rng(0), times * (last_pressed(truth) + 1) - 1, 0
    settle = round(SETTLE_S * fps)
    for number, now_px in enumerate(creeping_px(place_px, last, share, np.exp(-1.0 / (fps * seconds)))):
        is_seen = np.isfinite(now_px).all(axis=1)
        grid = TrackedGrid(
            timestamp_ns=round(number * 1e9 / fps),
            position_px=read_only(now_px + random.normal(0.0, NOISE_PX, now_px.shape)),
            covariance_px2=read_only(
                np.where(is_seen[:, None, None], NOISE_PX**2 * np.eye(2), np.nan * np.eye(2))
            ),
            is_seen=read_only(is_seen),
            frames_unseen=read_only((~is_seen).astype(np.int64)),
        )
        state, _, contacts = estimator.step(state, grid)
        count += number > last + settle and len(contacts.touching) > 0
    return count, len(place_px) - last - 1 - settle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--share", type=float, default=0.03, help="of the displacements that remain at first")
    parser.add_argument("--seconds", type=float, default=1.0, help="time constant with which they fade")
    parser.add_argument("--times", type=int, default=1, help="frames for each frame of the scene")
    args = parser.parse_args()
    found = []
    folders = [truth.parents[1] for truth in sorted(args.folder.glob("*/simulated/truth"))]
    if not folders:
        parser.error(
            f"{args.folder} contains no scenes; make some with random_scenes.py --moving --out FOLDER"
        )
    for folder in folders:
        count, frames = frames_with_contact(folder, args.share, args.seconds, args.times)
        found.append((count, frames))
        print(f"{folder.name}: a contact in {count} of {frames} frames after the release", flush=True)
    print("all: a contact in {} of {} frames after the release".format(*np.sum(found, axis=0)))


if __name__ == "__main__":
    main()
