"""Comparison of the user's own results and ground truth, each in a folder."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.evaluated_recordings.folders import details, load_result, load_truth
from manytouch.evaluation.metrics.comparison import compare
from manytouch.evaluation.suite.runner import Evaluation, Trial
from manytouch.values.arrays import read_only

_OTHER_PLACE_PITCHES = 0.5
"""Median distance of markers above which they are taken for those of another sensor."""


def evaluate_folders(result: Path, truth: Path) -> Evaluation:
    """Compare what `manytouch process` wrote with what `manytouch simulate` wrote into truth/.

    Raises:
        EvaluationError: a file is missing or wrong, units differ, or no frame is in both.
    """
    estimated, true, known = load_result(result), load_truth(truth), details(result)
    estimated = placed(estimated, known.get("sensor") or {})
    if estimated.place_unit == true.unit and np.array_equal(estimated.marker, true.marker):
        true = replace(true, place=estimated.place, place_unit=estimated.place_unit)
    comparison, doubt = compare(true, estimated), _doubt_of_sensor(true, estimated)
    return Evaluation(
        title=f"{estimated.name} against {true.name}",
        truth_description=f"The tables in {true.name}; who made them knows how true they are",
        warnings=() if doubt is None else (doubt,),
        methods=(estimated.method,),
        trials=(Trial(title=estimated.name, case=None, comparisons=(comparison,)),),
        settings=known,
    )


def _doubt_of_sensor(true: EvaluatedRecording, estimated: EvaluatedRecording) -> str | None:
    """Why a result and a truth may be of different sensors; None if their markers are the same."""
    advice = "check that they are of the same sensor, else errors mean nothing"
    if not np.array_equal(true.marker, estimated.marker):
        return (
            f"the result has {len(estimated.marker)} markers and the truth {len(true.marker)}, or they are "
            f"numbered differently: {advice}"
        )
    _, in_true, in_estimated = np.intersect1d(true.frame, estimated.frame, return_indices=True)
    true_px = true.centre_px[in_true[0]]
    away_px = np.linalg.norm(estimated.centre_px[in_estimated[0]] - true_px, axis=1)
    known_px, away_px = true_px[np.isfinite(true_px[:, 0])], away_px[np.isfinite(away_px)]
    if len(away_px) == 0 or len(known_px) < 2:
        return None
    pitch_px, away_px = np.median(cKDTree(known_px).query(known_px, k=2)[0][:, 1]), np.median(away_px)
    if away_px < _OTHER_PLACE_PITCHES * pitch_px:
        return None
    return f"the markers of the result are {away_px:.0f} px away from those of the truth: {advice}"


def placed(recording: EvaluatedRecording, sensor: dict[str, Any]) -> EvaluatedRecording:
    """The recording with its markers in lengths instead of columns and rows, where the pitch is known."""
    rows, columns = sensor.get("rows"), sensor.get("columns")
    pitch = sensor.get(f"pitch_{recording.unit}")
    if recording.place_unit != "column" or not (rows and columns and pitch):
        return recording
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    place = (recording.place - middle) * np.array(pitch, dtype=np.float64)
    return replace(recording, place=read_only(place), place_unit=recording.unit)
