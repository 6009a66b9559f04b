"""Content of summary.json."""

import datetime
import json
from dataclasses import replace

import numpy as np
import pytest

from flat_spline import FLAT
from manytouch.cli.terminal.console import describe_results
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation
from manytouch.paper.tracking import PaperTracking
from manytouch.pipeline import Pipeline
from manytouch.sinks.files.hashing import result_hash
from manytouch.sinks.files.sensor_description import (
    describe_sensor,
    describe_view,
    estimated_pretension,
    pitch_px,
    rest_px,
    sensor_to_dict,
)
from manytouch.sinks.files.summary import Summary, parameters
from manytouch.values import Phase, Roi, Sheet, Status

HASHES = {"input": "1", "sensor": "2", "parameters": "3", "version": "4"}


def summary_of(sensor, frame_count=None, method="paper"):
    recording = {"source": "x.mp4", "frame_count": frame_count}
    return Summary(sensor=sensor, pipeline=pipeline_of(), method=method, recording=recording)


def pipeline_of():
    return Pipeline(
        detect=PaperDetection(roi_px=Roi(1, 2, 30, 40)), track=PaperTracking(), estimate=PaperEstimation()
    )


def test_counts_statuses_contacts_and_what_is_odd(tmp_path, sensor, reading_of, contact_of):
    summary = summary_of(sensor, frame_count=9)
    for index in range(4):
        summary.write(reading_of(index, unseen=(3,)))
    summary.write(reading_of(4, (contact_of(1, Phase.START), contact_of(2, Phase.START)), unseen=(3,)))
    summary.write(reading_of(5, (contact_of(1, Phase.END),), status=Status.DECODE_ERROR))
    summary.save(tmp_path, is_complete=False, hashes=HASHES)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["counts"] == {
        "frames": 6,
        "status": {"decode_error": 1, "ok": 5},
        "methods": {"paper": 5},
        "frames_with_contact": 1,
        "contacts": 2,
        "contacts_at_once": 2,
        "markers": 23,
    }
    assert summary["odd"] == [
        f"1 of 6 frames have the status decode_error. {Status.DECODE_ERROR.remedy}",
        "the input announced 9 frames; 6 were read, up to number 5",
        "1 marker is seen in less than half of the frames: 3",
    ]
    assert not summary["complete"]
    assert summary["hash"] == result_hash(HASHES)
    assert summary["hashes"] == HASHES
    assert summary["assumptions"] == ["The camera has no distortion."]
    assert summary["sensor"]["pitch_px"] == [40.0, 32.0]
    assert summary["sensor"]["missing"] == [9]
    assert len(summary["noise_px"]["per_marker"]) == 24
    assert summary["milliseconds"] == {"p50": 4.5, "p95": 6.75, "p99": 6.95}
    assert summary["parameters"]["detect"]["roi_px"] == [1, 2, 30, 40]


@pytest.mark.parametrize(("is_known", "unit"), [(True, "mm"), (False, "pitch")])
def test_an_estimated_pretension_has_the_unit_of_length(sensor, is_known, unit):
    spline = replace(FLAT, pretension_over_E_mm=0.2, pretension_std_over_E_mm=0.1)
    found = estimated_pretension(replace(sensor, sheet=None, scale_is_known=is_known), spline)
    expected = {f"over_E_{unit}": 0.2, f"std_over_E_{unit}": 0.1, "N_per_mm": None, "std_N_per_mm": None}
    assert found == expected


def test_the_provenance_keeps_its_types(sensor):
    free = {
        "nominal_shape": True,
        "rest_rms_px": 0.125,
        "frames": 3,
        "made": datetime.date(2024, 5, 17),
        "sheet_std": float("inf"),
        "views": [{"name": "left", "residual_px": np.float64(0.5)}],
    }
    written = json.loads(json.dumps(summary_of(replace(sensor, provenance=free)).to_dict(), allow_nan=False))
    assert written["sensor"]["provenance"] == {
        **free,
        "made": "2024-05-17",
        "sheet_std": None,
        "views": [{"name": "left", "residual_px": 0.5}],
    }


@pytest.mark.parametrize(
    ("provenance", "first_touched"),
    [
        ({"rest_frames": 3}, 5),
        ({"still_frames": [0, 1, 2], "from": "first frames at rest"}, 5),
        ({"rest_frames": 3}, 60),
        ({"still_frames": [90, 91], "from": "whole recording"}, 5),
        ({}, 5),
    ],
)
def test_a_contact_shortly_after_the_frames_at_rest_is_a_warning(
    sensor, reading_of, contact_of, provenance, first_touched
):
    summary = summary_of(replace(sensor, provenance=provenance))
    for index in (0, 1):
        summary.write(reading_of(index))
    summary.write(reading_of(first_touched, (contact_of(1, Phase.START),)))
    found = [sentence for sentence in summary.warnings() if "the rest is short" in sentence]
    is_from_first = bool(provenance) and provenance.get("from") != "whole recording"
    assert len(found) == (is_from_first and first_touched < 12)
    assert all("a second without a touch" in sentence and "3 frames" in sentence for sentence in found)


def test_compressed_video_is_a_warning(sensor, reading_of):
    summary = summary_of(sensor)
    summary.write(reading_of(0))
    assert not any("the video is compressed" in sentence for sentence in summary.warnings())
    noticed = reading_of(1)
    summary.write(replace(noticed, grid=replace(noticed.grid, is_compressed=True)))
    summary.write(reading_of(2))
    (found,) = [sentence for sentence in summary.warnings() if "the video is compressed" in sentence]
    assert "Record with less compression" in found
    assert "crf" not in found, "video that was encoded with -crf 18 has this warning too"


def test_frames_count_for_the_method_that_estimated_them(sensor, reading_of):
    summary = summary_of(sensor, method="mechanics")
    for index, has_spline in enumerate((True, False, False, True, False)):
        reading = reading_of(index)
        spline = FLAT if has_spline else None
        summary.write(replace(reading, surface=replace(reading.surface, spline=spline)))
    summary.write(reading_of(5, status=Status.BLURRED))
    assert summary.counts["methods"] == {"mechanics": 2, "perimeter": 3}
    (sentence,) = (
        line for line in summary.warnings() if "3 of 6 frames do not show the clamped sheet" in line
    )
    assert "have no forces, not even relative ones" in sentence
    assert summary.to_dict()["warnings"] == summary.to_dict()["odd"] == summary.warnings()
    assert describe_results(summary)[0] == "6 frames, 5 of them ok: 2 by mechanics, 3 by perimeter"
    only = summary_of(sensor, method="perimeter")
    only.write(reading_of(0))
    assert only.counts["methods"] == {"perimeter": 1}
    assert not only.warnings()


def test_a_sensor_file_that_describes_few_frames_does_not_fit(sensor, reading_of):
    known = replace(sensor, sheet=Sheet(size_mm=np.array([30.0, 30.0]), thickness_mm=2.0))
    for described, fits in ((1, False), (4, True)):
        summary = summary_of(known, method="mechanics")
        for index in range(6):
            reading = reading_of(index)
            spline = FLAT if index < described else None
            summary.write(replace(reading, surface=replace(reading.surface, spline=spline)))
        (sentence,) = summary.warnings()
        assert ("the sensor file does not fit this recording: 5 of 6 frames" in sentence) == (not fits)
        assert ("Do not use the contacts, depths and forces of this run" in sentence) == (not fits)


def test_only_frames_with_a_contact_can_differ_from_an_assumed_sheet(sensor, reading_of, contact_of):
    assumed = Sheet(size_mm=np.array([30.0, 30.0]), thickness_mm=2.0, is_assumed=True)
    for touched, described, warns in ((0, 0, False), (4, 3, False), (4, 1, True)):
        summary = summary_of(replace(sensor, sheet=assumed), method="mechanics")
        for index in range(6):
            is_touched = index < touched
            reading = reading_of(index, (contact_of(1, Phase.MOVE),) if is_touched else ())
            spline = FLAT if index < described else None
            summary.write(replace(reading, surface=replace(reading.surface, spline=spline)))
        found = [each for each in summary.warnings() if "do not show the clamped sheet" in each]
        assert bool(found) == warns
        assert all(each.startswith("3 of 4 frames with a contact") for each in found)


@pytest.mark.parametrize(
    ("pitch_thickness", "method", "warns"),
    [(3.0, "mechanics", False), (4.0, "mechanics", True), (4.0, "perimeter", False)],
)
def test_markers_far_apart_are_a_warning_of_the_mechanics(sensor, pitch_thickness, method, warns):
    pitch_mm = float(np.sqrt(np.prod(sensor.layout.pitch_mm)))
    sheet = Sheet(size_mm=np.array([30.0, 30.0]), thickness_mm=pitch_mm / pitch_thickness)
    for given, is_known in ((sheet, True), (replace(sheet, is_assumed=True), False)):
        found = summary_of(replace(sensor, sheet=given), method=method).warnings()
        assert any("4.0 thicknesses of the sheet apart" in each for each in found) == (warns and is_known)


def test_markers_are_not_blamed_for_pictures_that_are_missing(tmp_path, sensor, reading_of):
    summary = summary_of(sensor)
    for index in range(3):
        summary.write(reading_of(index))
    everything = tuple(range(24))
    for index in range(3, 8):
        summary.write(reading_of(index, unseen=everything, status=Status.DECODE_ERROR))
    assert summary.warnings() == [f"5 of 8 frames have the status decode_error. {Status.DECODE_ERROR.remedy}"]


def test_a_run_without_frames_has_a_summary_too(tmp_path, sensor):
    summary_of(sensor).save(tmp_path, is_complete=True, hashes=HASHES | {"input": None})
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["counts"]["frames"] == 0
    assert summary["noise_px"]["median"] is None
    assert summary["milliseconds"]["p50"] is None
    assert summary["complete"]
    assert summary["hash"] is None


def test_parameters_name_every_stage():
    found = parameters(pipeline_of())
    assert {name: stage["type"] for name, stage in found.items()} == {
        "detect": "PaperDetection",
        "track": "PaperTracking",
        "estimate": "PaperEstimation",
    }
    json.dumps(found, allow_nan=False)


def test_a_sensor_in_words(sensor):
    assert describe_sensor(sensor) == "4 x 6 markers, dark, pitch 40 x 32 px, 1 missing"
    assert pitch_px(sensor) == pytest.approx([40.0, 32.0])


def test_a_single_row_has_one_pitch(sensor):
    layout = sensor.layout
    kept = np.flatnonzero(layout.row_column[:, 0] == 0)
    arrays = ("rest_mm", "row_column", "radius_mm", "is_missing")
    row = {name: getattr(layout, name)[kept] for name in arrays}
    rest_px = None if layout.rest_px is None else layout.rest_px[kept]
    single = replace(sensor, layout=replace(layout, **row, rest_px=rest_px))
    assert describe_sensor(single) == "1 x 6 markers, dark, pitch 40 px"
    described = json.loads(json.dumps(sensor_to_dict(single), allow_nan=False))
    assert described["pitch_px"] == [40.0, None]


def test_the_size_of_the_picture_on_the_sheet_shows_a_wrong_scale(sensor):
    width_mm, height_mm = summary_of(sensor).to_dict()["view_mm"]
    assert (width_mm, height_mm) == (40.0, 30.0)
    assert describe_view(sensor) is None
    guessed = replace(sensor, sheet=replace(sensor.sheet, is_assumed=True))
    assert describe_view(guessed) == "with this pitch the picture shows 40 x 30 mm of the sheet"
    unknown = replace(guessed, scale_is_known=False)
    assert describe_view(unknown) is None
    assert summary_of(unknown).to_dict()["view_mm"] is None


def test_markers_outside_the_region_of_interest_are_no_rare_ones(sensor, reading_of):
    outside = 0
    x_px = rest_px(sensor)[outside, 0]
    region = Roi(int(x_px) + 5, 0, 2000, 2000)
    for roi_px, is_warned in ((None, True), (region, False)):
        summary = Summary(sensor=sensor, pipeline=pipeline_of(), method="paper", recording={}, roi_px=roi_px)
        summary.write(reading_of(0, unseen=(outside,)))
        assert any("less than half" in sentence for sentence in summary.warnings()) == is_warned
