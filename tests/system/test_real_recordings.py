"""The main job on recordings of other people's sensors, without a single setting."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import manytouch
from manytouch.values import Roi
from results import Tracks, rows_of

REGIONS = {"left": Roi(58, 102, 238, 216), "right": Roi(308, 96, 232, 212)}
PITCH_PX = {"worachit": np.sqrt(62 * 77), "gsrobotics": 31.5, "vts4": 17.0}


class Results(dict[str, Path]):
    """Folders of results by recording, each made when it is first needed."""

    def __init__(self, recordings: Path, out: Path) -> None:
        super().__init__()
        self.recordings, self.out = recordings, out

    def __missing__(self, name: str) -> Path:
        recording, _, side = name.partition("#")
        out = self.out / side if side else self.out
        made = manytouch.process(str(self.recordings / recording), out=out, roi_px=REGIONS.get(side))
        self[name] = made
        return made


@pytest.fixture(scope="session")
def folders(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    return Results(recordings, tmp_path_factory.mktemp("results"))


def touching(folder: Path) -> Counter[int]:
    """Number of contacts (without those that just ended) per frame."""
    return Counter(int(row["frame"]) for row in rows_of(folder / "contacts.csv") if row["phase"] != "end")


def scored_frames(spans: Path, quality: str = "sure") -> list[tuple[int, int]]:
    """(frame, contacts) of the labelled spans, their uncertain ends left out."""
    return [
        (frame, int(span["n_contacts"]))
        for span in rows_of(spans)
        if span["quality"] == quality
        for frame in range(int(span["start"]) + 2, int(span["end"]) - 1)
    ]


@pytest.mark.slow
def test_fingers_on_a_white_sheet_markers(folders: Results) -> None:
    tracks = Tracks.read(folders["worachit/marker_stable_2mm_2.mp4"])
    assert (tracks.row.max() + 1, tracks.column.max() + 1) == (8, 10)
    assert 74 <= tracks.is_seen[0].sum() <= 100
    assert tracks.swapped(slice(12, 19), slice(520, 588), PITCH_PX["worachit"]) == 0
    home = tracks.is_seen[520:588].mean(axis=0) > 0.5
    assert home.sum() >= 74


@pytest.mark.slow
def test_fingers_on_a_white_sheet_contacts(recordings: Path, folders: Results) -> None:
    counted = touching(folders["worachit/marker_stable_2mm_2.mp4"])
    spans = recordings / "worachit" / "hand_contact_spans.csv"
    frames = scored_frames(spans)
    right = sum(counted[frame] == expected for frame, expected in frames)
    assert right >= 0.95 * len(frames), f"{right} of {len(frames)}"
    frames += scored_frames(spans, "hover")
    right = sum(counted[frame] == expected for frame, expected in frames)
    assert right >= 0.9 * len(frames), f"{right} of {len(frames)}"


@pytest.mark.slow
def test_fingers_on_a_white_sheet_positions(recordings: Path, folders: Results) -> None:
    found: dict[int, list[tuple[float, float]]] = {}
    for row in rows_of(folders["worachit/marker_stable_2mm_2.mp4"] / "contacts.csv"):
        if row["phase"] != "end":
            found.setdefault(int(row["frame"]), []).append((float(row["x_px"]), float(row["y_px"])))
    distances = []
    for row in rows_of(recordings / "worachit" / "hand_contacts.csv"):
        fingers = [(float(row["x1_px"]), float(row["y1_px"]))]
        if row["x2_px"]:
            fingers.append((float(row["x2_px"]), float(row["y2_px"])))
        centres = np.array(found.get(int(row["frame"]), [(np.inf, np.inf)]))
        if row["cut"] == "0":
            distances += [np.linalg.norm(centres - finger, axis=1).min() for finger in fingers]
    assert np.median(distances) <= 40.0


def test_nobody_touches(folders: Results) -> None:
    folder = folders["worachit/marker_stable_2mm_unmoved.mp4"]
    assert touching(folder) == Counter()
    summary = json.loads((folder / "summary.json").read_text())
    assert 0 < summary["noise_px"]["median"] < 0.3


def test_a_gel_pad(recordings: Path, folders: Results) -> None:
    folder = folders["gsrobotics/mini_example.avi"]
    tracks = Tracks.read(folder)
    assert (tracks.row.max() + 1, tracks.column.max() + 1) == (7, 10)
    assert 66 <= tracks.is_seen[0].sum() <= 82
    assert tracks.swapped(slice(0, 55), slice(212, 219), PITCH_PX["gsrobotics"]) == 0
    counted = touching(folder)
    frames = scored_frames(recordings / "gsrobotics" / "hand_contact_spans.csv")
    right = sum(counted[frame] == expected for frame, expected in frames)
    assert right >= 0.95 * len(frames), f"{right} of {len(frames)}"


@pytest.mark.parametrize("side", ["left", pytest.param("right", marks=pytest.mark.slow)])
def test_dots_seen_in_a_mirror(folders: Results, side: str) -> None:
    tracks = Tracks.read(folders[f"vts4/0507#{side}"])
    assert 56 <= tracks.is_seen[0].sum() <= 64
    assert tracks.swapped(slice(0, 6), slice(122, 128), PITCH_PX["vts4"]) == 0


@pytest.mark.parametrize(
    "names",
    [("fots_0.png", "gs_tracking_debug.png"), pytest.param(None, marks=pytest.mark.slow)],
    ids=["some", "all"],
)
def test_single_pictures(recordings: Path, tmp_path: Path, names: tuple[str, ...] | None) -> None:
    """The survey, which finds the dots, sees all pictures in test_real_detection.py."""
    for row in rows_of(recordings / "single" / "counts.csv"):
        if names is not None and row["file"] not in names:
            continue
        folder = manytouch.process(str(recordings / "single" / row["file"]), out=tmp_path)
        count = int(Tracks.read(folder).is_seen[0].sum())
        assert int(row["min"]) <= count <= int(row["max"]), f"{row['file']}: {count}"
