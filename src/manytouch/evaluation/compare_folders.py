"""Comparison of the user's own results and ground truth, each in a folder."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.evaluated_recordings.folders import details, load_result, load_truth
from manytouch.evaluation.metrics.comparison import compare
from manytouch.evaluation.suite.runner import Evaluation, Trial
from manytouch.values.arrays import read_only


def evaluate_folders(result: Path, truth: Path) -> Evaluation:
    """Compare what `manytouch process` wrote with what `manytouch simulate` wrote into truth/.

    Raises:
        EvaluationError: a file is missing or wrong, units differ, or no frame is in both.
    """
    estimated, true, known = load_result(result), load_truth(truth), details(result)
    estimated = placed(estimated, known.get("sensor") or {})
    if estimated.place_unit == true.unit and np.array_equal(estimated.marker, true.marker):
        true = replace(true, place=estimated.place, place_unit=estimated.place_unit)
    comparison = compare(true, estimated)
    return Evaluation(
        title=f"{estimated.name} against {true.name}",
        truth_description=f"The tables in {true.name}; who made them knows how true they are",
        methods=(estimated.method,),
        trials=(Trial(title=estimated.name, case=None, comparisons=(comparison,)),),
        settings=known,
    )


def placed(recording: EvaluatedRecording, sensor: dict[str, Any]) -> EvaluatedRecording:
    """The recording with its markers in lengths instead of columns and rows, where the pitch is known."""
    rows, columns = sensor.get("rows"), sensor.get("columns")
    pitch = sensor.get(f"pitch_{recording.unit}")
    if recording.place_unit != "column" or not (rows and columns and pitch):
        return recording
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    place = (recording.place - middle) * np.array(pitch, dtype=np.float64)
    return replace(recording, place=read_only(place), place_unit=recording.unit)
