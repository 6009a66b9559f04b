"""Standard deviations of a sensor's numbers: what it states, else the documented defaults."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.values import Sheet
from manytouch.values.sensor_file.default_std import camera_std, sheet_std
from straight import straight_camera

SHEET = Sheet(size_mm=np.array([60.0, 40.0]), thickness_mm=2.0)


def test_defaults_are_shares_of_what_the_sheet_states() -> None:
    found = sheet_std(replace(SHEET, young_MPa=2.5, poisson=0.45, pretension_N_per_mm=0.1))
    assert found.thickness_mm == pytest.approx(0.1)
    assert found.young_MPa == pytest.approx(0.2)
    assert found.pretension_N_per_mm == pytest.approx(0.02)
    assert (found.poisson, found.outline_mm) == (0.02, 0.3)


def test_an_unknown_number_has_no_deviation() -> None:
    found = sheet_std(SHEET)
    assert found.young_MPa is found.pretension_N_per_mm is found.poisson is found.window_mm is None


def test_stated_deviations_are_kept_also_if_they_are_0() -> None:
    stated = replace(SHEET, young_MPa=2.5, young_std_MPa=0.0, thickness_std_mm=0.01, outline_std_mm=1.0)
    found = sheet_std(stated)
    assert (found.young_MPa, found.thickness_mm, found.outline_mm) == (0.0, 0.01, 1.0)


def test_a_camera_has_defaults_by_its_focal_length_and_distance() -> None:
    camera = straight_camera(320, 240, focal_px=400.0, distance_mm=50.0)
    found = camera_std(camera)
    assert (found.fx_px, found.cy_px) == pytest.approx((1.2, 1.2))
    np.testing.assert_allclose(found.rotation_vector, np.deg2rad(0.2))
    np.testing.assert_allclose(found.translation_mm, 0.15)
    np.testing.assert_array_equal(found.distortion, 0.0)
    stated = camera_std(replace(camera, fx_std_px=0.5, translation_std_mm=np.array([1.0, 2.0, 3.0])))
    assert stated.fx_px == 0.5
    np.testing.assert_array_equal(stated.translation_mm, [1.0, 2.0, 3.0])
