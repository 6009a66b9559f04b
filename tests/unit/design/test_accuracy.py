"""Predicted deviations, and what other measures would change."""

import csv

import cv2
import numpy as np
import pytest

from manytouch.design.accuracy import changed, predicted_accuracy, predicted_at
from manytouch.design.build import write_prediction
from manytouch.design.choose import design
from manytouch.design.wishes import Wishes


@pytest.fixture(scope="module")
def found():
    return design(Wishes(area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.5, 4.0)))


def test_a_press_is_predicted_to_be_told_well_and_deepest_in_the_middle(found):
    predicted = predicted_accuracy(found, places=(2, 2))
    assert predicted.place_mm.tolist() == [[0.0, 0.0], [20.0, 0.0], [0.0, 12.5], [20.0, 12.5]]
    assert predicted.force_N == pytest.approx(np.sqrt(2.0))
    assert predicted.depth_mm.argmax() == 0
    assert predicted.depth_mm[0] == pytest.approx(
        found.curve.depth_at(predicted.force_N / found.material.young_MPa), rel=0.05
    )
    assert np.all(predicted.depth_std_mm < 0.1 * predicted.depth_mm)
    assert np.all((predicted.position_std_mm > 0.01) & (predicted.position_std_mm < 2.0))
    assert np.all(predicted.force_std_N < 0.5 * predicted.force_N)


def test_wider_markers_tell_positions_worse(found):
    position, _, force = predicted_at(found.sensor, found.wishes)
    wider = changed(found, pitch=1.5)
    assert wider.layout.shape == (7, 10)
    worse_position, _, worse_force = predicted_at(wider, found.wishes)
    assert worse_position > 1.1 * position
    assert worse_force > force


def test_other_measures_change_what_they_name(found):
    assert changed(found, thickness=2.0).sheet.thickness_mm == 6.0
    farther = changed(found, stand_off=1.5).camera.translation_mm[2]
    assert farther == pytest.approx(1.5 * found.sensor.camera.translation_mm[2])
    assert changed(found).layout is found.sensor.layout


@pytest.mark.slow
def test_the_prediction_is_written_and_drawn(found, tmp_path):
    write_prediction(found, tmp_path)
    rows = list(csv.DictReader((tmp_path / "accuracy.csv").read_text().splitlines()))
    assert len(rows) == 12
    assert float(rows[0]["depth_std_mm"]) > 0
    for name in ("accuracy.png", "tradeoff.png"):
        assert cv2.imread(str(tmp_path / name)).std() > 10
