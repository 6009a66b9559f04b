"""Records from the files of a folder: the same as from memory, and one sentence where they do not fit."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from contacts import contact_with
from layouts import lattice_layout
from manytouch.evaluation.compare_folders import evaluate_folders
from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluationError
from manytouch.evaluation.evaluated_recordings.folders import load_result, load_truth
from manytouch.evaluation.evaluated_recordings.in_memory import recording_of_readings, recording_of_truths
from manytouch.evaluation.metrics.comparison import compare, figures
from manytouch.evaluation.report.page import rendered
from manytouch.evaluation.report.report_data import contents, plain
from manytouch.sinks.files.tables import ContactTable, FrameTable, MarkerTable
from manytouch.values import (
    Contacts,
    Detections,
    Frame,
    Phase,
    Reading,
    Sensor,
    Surface,
    TrackedGrid,
    Truth,
)
from straight import straight_camera

ROWS, COLUMNS = 4, 6
MARKERS = ROWS * COLUMNS


@pytest.fixture
def sensor() -> Sensor:
    camera = straight_camera(320, 200, focal_px=300.0, distance_mm=60.0)
    return Sensor(name="small", camera=camera, layout=lattice_layout(ROWS, COLUMNS, 5.0))


def reading(sensor: Sensor, index: int, *, wrong: float) -> Reading:
    """A dent that grows with the frame number; `wrong` spoils everything a little."""
    assert sensor.layout is not None
    rest = sensor.layout.rest_mm
    moved = np.zeros((MARKERS, 3))
    moved[:, 2] = -0.5 * index * np.exp(-(rest[:, 0] ** 2 + rest[:, 1] ** 2) / 60.0) * (1 + wrong)
    centre_px = 160.0 + 5 * rest[:, :2] + wrong
    seen = np.ones(MARKERS, dtype=bool)
    seen[0] = wrong == 0
    covariance = np.zeros((8, 8))
    covariance[range(8), range(8)] = 0.04
    contact = contact_with(
        id=3,
        centre_mm=np.array([1.0 + wrong, 2.0]),
        centre_px=np.array([170.0, 110.0]),
        depth_mm=0.5 * index * (1 + wrong),
        force_N=np.array([0.1, -0.2, -1.0 - wrong]),
        torque_Nmm=0.0,
        area_mm2=20.0,
        covariance=covariance,
    )
    ended = replace(contact, id=9, phase=Phase.END)
    return Reading(
        frame=Frame(index=index, timestamp_ns=index * 10**7, camera="test", image=None),
        detections=Detections(
            centre_px=centre_px,
            covariance_px2=np.zeros((MARKERS, 2, 2)),
            area_px2=np.ones(MARKERS),
            contrast=np.ones(MARKERS),
        ),
        grid=TrackedGrid(
            position_px=np.where(seen[:, None], centre_px, np.nan),
            covariance_px2=np.tile(0.01 * np.eye(2), (MARKERS, 1, 1)),
            is_seen=seen,
            frames_unseen=np.zeros(MARKERS, np.int64),
        ),
        surface=Surface(
            position_mm=rest + moved,
            displacement_mm=moved,
            covariance_mm2=np.tile(0.01 * np.eye(3), (MARKERS, 1, 1)),
        ),
        contacts=Contacts(contacts=(contact, ended) if index else ()),
        milliseconds=4.0 + index,
    )


def as_truth(one: Reading) -> Truth:
    return Truth(frame_index=one.frame.index, grid=one.grid, surface=one.surface, contacts=one.contacts)


def write(folder: Path, sensor: Sensor, readings: list[Reading], *, method: str = "perimeter") -> Path:
    tables = [ContactTable(folder, sensor), MarkerTable(folder, sensor), FrameTable(folder)]
    for table in tables:
        for one in readings:
            table.write(one)
        table.close()
    (folder / "summary.json").write_text(json.dumps({"method": method}))
    return folder


@pytest.fixture
def folders(tmp_path: Path, sensor: Sensor) -> tuple[Path, Path]:
    result = write(tmp_path / "press", sensor, [reading(sensor, index, wrong=0.1) for index in range(4)])
    truth = write(
        tmp_path / "simulated" / "truth", sensor, [reading(sensor, index, wrong=0.0) for index in range(4)]
    )
    return result, truth


def test_folders_and_memory_give_the_same_figures(folders: tuple[Path, Path], sensor: Sensor) -> None:
    readings = [reading(sensor, index, wrong=0.1) for index in range(4)]
    truths = [as_truth(reading(sensor, index, wrong=0.0)) for index in range(4)]
    live = compare(
        recording_of_truths(truths, sensor, name="truth"),
        recording_of_readings(readings, sensor, name="press", method="perimeter"),
    )
    read = compare(load_truth(folders[1]), load_result(folders[0]))
    mine, theirs = figures(live), figures(read)
    for section in ("detection", "depth", "contacts", "force", "latency", "frames"):
        assert theirs[section] == pytest.approx(mine[section], rel=1e-3, abs=1e-4, nan_ok=True), section
    assert mine["contacts"]["recall_percent"] == 100
    assert mine["force"]["normal_median_percent"] == pytest.approx(10)
    assert mine["depth"]["peak_percent"] == pytest.approx(10)
    assert mine["detection"]["found_percent"] == pytest.approx(100 * (MARKERS - 1) / MARKERS)
    assert mine["calibration"]["centre"]["chi2_per_dof"] == pytest.approx(1.0)
    assert theirs["calibration"]["centre"] is None  # the tables hold no deviation of the centres
    assert theirs["calibration"]["depth"]["count"] == mine["calibration"]["depth"]["count"]


def test_the_method_and_the_names_come_from_the_folders(folders: tuple[Path, Path]) -> None:
    result, truth = load_result(folders[0]), load_truth(folders[1])
    assert (result.method, result.name, truth.name) == ("perimeter", "press", "simulated/truth")
    assert result.place_unit == "column"
    assert result.contacts.id.tolist() == [3, 3, 3]  # the contact that ended does not touch


def test_a_truth_needs_neither_frames_nor_summary(folders: tuple[Path, Path]) -> None:
    before = figures(compare(load_truth(folders[1]), load_result(folders[0])))
    for name in ("frames.csv", "summary.json"):
        (folders[1] / name).unlink()
    assert plain(figures(compare(load_truth(folders[1]), load_result(folders[0])))) == plain(before)


def test_places_come_in_mm_where_the_summary_has_the_pitch(folders: tuple[Path, Path]) -> None:
    summary = {"method": "perimeter", "sensor": {"rows": ROWS, "columns": COLUMNS, "pitch_mm": [5.0, 5.0]}}
    (folders[0] / "summary.json").write_text(json.dumps(summary))
    worst = evaluate_folders(*folders).trials[0].comparisons[0].worst
    assert worst is not None
    assert worst.place_unit == "mm"
    assert worst.place[0].tolist() == [-12.5, -7.5]


def in_pitches(folder: Path) -> None:
    for name in ("contacts.csv", "markers.parquet"):
        path = folder / name
        if name.endswith("csv"):
            path.write_text(path.read_text().replace("_mm", "_pitch"))
        else:
            table = pq.read_table(path)
            pq.write_table(
                table.rename_columns([c.replace("_mm", "_pitch") for c in table.column_names]), path
            )


def test_pitches_and_millimetres_are_refused(folders: tuple[Path, Path]) -> None:
    in_pitches(folders[0])
    with pytest.raises(
        EvaluationError,
        match="result press is in pitches and the truth simulated/truth in millimetres; process the "
        "recording again with --sensor or --pitch-mm",
    ):
        evaluate_folders(*folders)


def test_pitches_against_pitches_have_a_gate_of_three_quarters(folders: tuple[Path, Path]) -> None:
    for folder in folders:
        in_pitches(folder)
    with (folders[0] / "contacts.csv").open(newline="") as file:
        lines = list(csv.reader(file))
    place = lines[0].index("x_pitch")
    for line in lines[1:]:
        line[place] = "1.8"  # 0.8 from the truth: within 3 mm, beyond 0.75 pitch
    with (folders[0] / "contacts.csv").open("w", newline="") as file:
        csv.writer(file).writerows(lines)
    found = figures(evaluate_folders(*folders).trials[0].comparisons[0])
    assert found["contacts"]["recall_percent"] == 0


def no_parquet(folder: Path) -> None:
    (folder / "markers.parquet").unlink()


def broken_parquet(folder: Path) -> None:
    (folder / "markers.parquet").write_bytes(b"PAR1 no")


def lost_column(folder: Path) -> None:
    table = pq.read_table(folder / "markers.parquet")
    pq.write_table(table.drop_columns(["seen"]), folder / "markers.parquet")


def no_unit(folder: Path) -> None:
    (folder / "contacts.csv").write_text("frame,contact,phase\n")


def no_number(folder: Path) -> None:
    path = folder / "contacts.csv"
    path.write_text(path.read_text().replace(",move,1.1", ",move,abc"))


def empty(folder: Path) -> None:
    (folder / "contacts.csv").write_text("")


def mixed(folder: Path) -> None:
    path = folder / "contacts.csv"
    path.write_text(path.read_text().replace("_mm", "_pitch"))


def bad_summary(folder: Path) -> None:
    (folder / "summary.json").write_text("{")


def other_frames(folder: Path) -> None:
    path = folder / "contacts.csv"
    lines = path.read_text().splitlines()
    path.write_text(lines[0] + "\n")
    (folder / "frames.csv").unlink()
    table = pq.read_table(folder / "markers.parquet")
    frames = (table["frame"].to_numpy() + 100).astype(np.int32)
    table = table.set_column(0, "frame", [frames])
    pq.write_table(table, folder / "markers.parquet")


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (no_parquet, "has no markers.parquet; give a folder that manytouch process"),
        (broken_parquet, "cannot be read as Parquet"),
        (lost_column, "lacks the columns seen; write it with"),
        (no_unit, "neither a column depth_mm nor depth_pitch"),
        (no_number, "contains a value that is not a number"),
        (empty, "is empty, without even a header"),
        (mixed, "has contacts in pitch and markers in mm"),
        (bad_summary, "cannot be read as JSON"),
        (other_frames, "have no frame in common"),
    ],
)
def test_what_does_not_fit_is_one_clear_sentence(
    folders: tuple[Path, Path], spoil: Callable[[Path], None], sentence: str
) -> None:
    spoil(folders[0])
    with pytest.raises(EvaluationError, match=sentence) as caught:
        evaluate_folders(*folders)
    assert "\n" not in str(caught.value)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="is not a folder; give one"):
        load_result(tmp_path / "nowhere")


def test_frames_that_are_missing_are_reported(folders: tuple[Path, Path], sensor: Sensor) -> None:
    write(folders[0], sensor, [reading(sensor, index, wrong=0.1) for index in (0, 1)])
    found = evaluate_folders(*folders).trials[0].comparisons[0]
    assert (found.frames, found.true_frames) == (2, 4)
    assert found.notes == ("2 of 4 true frames are not in the result",)
    assert figures(found)["contacts"]["recall_percent"] == 100


def with_markers(folder: Path, *, off_px: float = 0.0, fewer: int = 0) -> None:
    """Write markers that are farther to the right, or without the last ones."""
    path = folder / "markers.parquet"
    table = pq.read_table(path)
    column = table.column_names.index("x_px")
    table = table.set_column(column, "x_px", pc.add(table["x_px"], off_px))
    pq.write_table(table.filter(pc.less(table["marker"], MARKERS - fewer)), path)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, None),
        ({"off_px": 5.0}, None),
        ({"off_px": 30.0}, "the markers of the result are 30 px away"),
        ({"fewer": 3}, f"the result has {MARKERS} markers and the truth {MARKERS - 3}"),
    ],
)
def test_a_truth_that_may_be_of_another_sensor_is_a_warning(
    folders: tuple[Path, Path], changed: dict[str, Any], words: str | None
) -> None:
    with_markers(folders[1], **changed)
    evaluation = evaluate_folders(*folders)
    assert len(evaluation.warnings) == (words is not None)
    data = contents(evaluation)
    assert data["warnings"] == list(evaluation.warnings)
    assert data["truth"] == evaluation.truth_description
    page = rendered(evaluation, data)
    for sentence in evaluation.warnings:
        assert words is not None
        assert words in sentence
        assert f"<b>Warning</b>{sentence}." in page
