"""What `process` finds on clamped sheets of which nothing is known, by method.

    python benchmarks/without_sensor_file.py [--parts] [FOLDER ...]

The pictures are those of the demo (up to five fingers at once), or those in the given folders, which
`random_scenes.py` has made. They are processed without a sensor file and without a pitch, so that places are
compared in the image and depths in pitches. A contact is found if an estimate is within three quarters of a
pitch of it; true contacts of any depth count. With `--parts` only regions of the pictures of the demo are
processed, in which the sheet goes on at one to four sides; contacts beyond a region are neither missed nor
false.
"""

import argparse
import csv
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

import manytouch
from manytouch.evaluation.metrics.matching import assigned
from manytouch.sinks.files.sensor_description import pitch_px
from manytouch.sources.simulated import simulated_source

GATE_PITCH = 0.75
METHODS = ("mechanics", "perimeter")
PARTS = {
    "without 5 columns at the left": manytouch.Roi(155, 0, 485, 360),
    "without 5 columns at both sides": manytouch.Roi(140, 0, 360, 360),
    "without 5 rows below": manytouch.Roi(0, 0, 640, 270),
    "the right half": manytouch.Roi(320, 0, 320, 360),
    "without 5 columns and 4 or 5 rows at all sides": manytouch.Roi(140, 80, 360, 200),
    "the 13 columns in the middle": manytouch.Roi(235, 0, 230, 360),
    "12 columns and 10 rows in the middle": manytouch.Roi(250, 90, 220, 180),
}
"""Regions of the pictures of the demo, which has 30 columns and 20 rows of dots."""
DEMO_WIDTH_PX, DEMO_STEP, DEMO_FPS, DEMO_FRAMES = 640, 2, 30.0, 290
RANDOM_FPS = 15.0
Row = dict[str, str]


class Recording(NamedTuple):
    """Pictures, and what is true of them.

    Attributes:
        name: of the scene.
        frames: folder of the pictures.
        fps: of the pictures.
        pitch_mm, pitch_px: of the markers.
        contacts: true ones, with the columns of contacts.csv in mm.
        region: of the pictures that is processed; None: all.
    """

    name: str
    frames: Path
    fps: float
    pitch_mm: float
    pitch_px: float
    contacts: list[Row]
    region: manytouch.Roi | None = None

    def shows(self, row: Row) -> bool:
        """Whether a contact is in the region."""
        if self.region is None:
            return True
        x_px, y_px = float(row["x_px"]) - self.region.x_px, float(row["y_px"]) - self.region.y_px
        return 0.0 <= x_px <= self.region.width_px and 0.0 <= y_px <= self.region.height_px


class Score(NamedTuple):
    """Errors of the contacts of some recordings.

    Attributes:
        found, missed, false: numbers of contacts.
        away_pitch: errors of the centres that were found.
        depth: relative errors of their depths, where they have one.
        in_interval: whether the true depth is within the 95 % interval, for the same.
    """

    found: int
    missed: int
    false: int
    away_pitch: list[float]
    depth: list[float]
    in_interval: list[bool]

    def plus(self, other: "Score") -> "Score":
        """Both together."""
        return Score(*(mine + others for mine, others in zip(self, other, strict=True)))


def demo(folder: Path) -> Recording:
    """The pictures of the demo."""
    simulator = simulated_source("fingers", width_px=DEMO_WIDTH_PX).simulator
    contacts, frames = [], folder / "frames"
    frames.mkdir()
    for number, index in enumerate(range(0, DEMO_FRAMES, DEMO_STEP)):
        cv2.imwrite(str(frames / f"{number:04d}.png"), simulator.frame(index).image)
        for contact in simulator.truth(index).contacts.touching:
            x_px, y_px = contact.centre_px
            values = {"frame": number, "x_px": x_px, "y_px": y_px, "depth_mm": contact.depth_mm}
            contacts.append({key: str(value) for key, value in values.items()} | {"phase": "move"})
    layout = simulator.sensor.layout
    return Recording(
        name="demo",
        frames=frames,
        fps=DEMO_FPS / DEMO_STEP,
        pitch_mm=float(np.sqrt(np.prod(layout.pitch_mm))),
        pitch_px=float(np.mean(pitch_px(simulator.sensor))),
        contacts=contacts,
    )


def made_by_random_scenes(folder: Path) -> Recording:
    """The pictures in a folder of `random_scenes.py`."""
    simulated = folder / "simulated"
    sensor = manytouch.load_sensor(simulated / "sensor.toml")
    return Recording(
        name=folder.name,
        frames=simulated / "frames",
        fps=RANDOM_FPS,
        pitch_mm=float(np.sqrt(np.prod(sensor.layout.pitch_mm))),
        pitch_px=float(np.mean(pitch_px(sensor))),
        contacts=rows_of(simulated / "truth" / "contacts.csv"),
    )


def rows_of(path: Path) -> list[Row]:
    """The rows of a table of contacts, without those of contacts that just ended."""
    with path.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["phase"] != "end"]


def by_frame(rows: list[Row]) -> dict[int, list[Row]]:
    """The rows of each frame."""
    found: dict[int, list[Row]] = {}
    for row in rows:
        found.setdefault(int(row["frame"]), []).append(row)
    return found


def score(recording: Recording, method: str) -> Score:
    """Process the pictures with a method, and compare."""
    with tempfile.TemporaryDirectory() as out:
        folder = manytouch.process(
            str(recording.frames),
            out=Path(out) / "results",
            method=method,
            fps=recording.fps,
            roi_px=recording.region,
        )
        estimated = by_frame(rows_of(folder / "contacts.csv"))
    true = by_frame(recording.contacts)
    total = Score(0, 0, 0, [], [], [])
    for frame in true.keys() | estimated.keys():
        total = total.plus(score_of_frame(recording, true.get(frame, []), estimated.get(frame, [])))
    return total


def score_of_frame(recording: Recording, true: list[Row], estimated: list[Row]) -> Score:
    """The score of a frame."""
    places_px = (
        np.array([[float(row["x_px"]), float(row["y_px"])] for row in rows]).reshape(-1, 2)
        for rows in (true, estimated)
    )
    away = np.linalg.norm(next(places_px)[:, None] - next(places_px), axis=2) / recording.pitch_px
    pairs = assigned(away, GATE_PITCH)
    shown = [(own, other) for own, other in pairs if recording.shows(true[own])]
    depths = list(depths_of(recording, [(true[own], estimated[other]) for own, other in shown]))
    return Score(
        found=len(shown),
        missed=sum(map(recording.shows, true)) - len(shown),
        false=len(estimated) - len(pairs),
        away_pitch=[float(away[own, other]) for own, other in shown],
        depth=[error for error, _ in depths],
        in_interval=[is_in for _, is_in in depths],
    )


def depths_of(recording: Recording, pairs: list[tuple[Row, Row]]) -> Iterator[tuple[float, bool]]:
    """Relative error of each depth that is known, and whether it is within its 95 % interval."""
    for own, other in pairs:
        if other["depth_pitch"] and float(own["depth_mm"]) > 0.0:
            off_pitch = float(other["depth_pitch"]) - float(own["depth_mm"]) / recording.pitch_mm
            error = off_pitch * recording.pitch_mm / float(own["depth_mm"])
            yield error, abs(off_pitch) <= 1.96 * float(other["depth_std_pitch"])


def line_of(found: Score) -> str:
    """The score in a line."""
    counted = max(found.found + found.false, 1), max(found.found + found.missed, 1)
    text = f"precision {100 * found.found / counted[0]:.0f} %, recall {100 * found.found / counted[1]:.0f} %"
    if found.away_pitch:
        middle, most = np.percentile(found.away_pitch, [50, 95])
        text += f", position {middle:.2f} pitch (95 %: {most:.2f})"
    if not found.depth:
        return f"{text}, no depths"
    low, middle, high = 100.0 * np.percentile(found.depth, [10, 50, 90])
    within = 100.0 * np.mean(found.in_interval)
    return (
        f"{text}, depth {middle:+.0f} % (80 %: {low:+.0f} to {high:+.0f}, {len(found.depth)} contacts, "
        f"{within:.0f} % within 95 %)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="of random_scenes.py")
    parser.add_argument("--parts", action="store_true", help="regions of the demo instead of all of it")
    given = parser.parse_args()
    if given.parts and given.folders:
        parser.error("--parts are those of the demo: give no FOLDER")
    totals = dict.fromkeys(METHODS, Score(0, 0, 0, [], [], []))
    with tempfile.TemporaryDirectory() as made:
        recordings = list(map(made_by_random_scenes, given.folders)) or [demo(Path(made))]
        if given.parts:
            (whole,) = recordings
            recordings = [whole._replace(name=name, region=region) for name, region in PARTS.items()]
        for recording in recordings:
            for method in METHODS:
                found = score(recording, method)
                totals[method] = totals[method].plus(found)
                print(f"{recording.name}, {method}: {line_of(found)}", flush=True)
    if len(recordings) > 1:
        for method, total in totals.items():
            print(f"all {len(recordings)} recordings, {method}: {line_of(total)}")


if __name__ == "__main__":
    main()
