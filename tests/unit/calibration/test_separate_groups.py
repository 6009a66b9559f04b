"""Regions around groups of markers that are apart."""

import numpy as np
import pytest

from flat_sensor import rectangle_px
from manytouch.calibration.separate_groups import separate_regions
from manytouch.values import Roi

SIZE = 640, 480


def test_two_views_of_a_sheet_have_a_region_each():
    left, right = (
        rectangle_px(8, 7, (17.0, 17.0), (70.0, 120.0)),
        rectangle_px(8, 7, (18.0, 18.0), (310.0, 110.0)),
    )
    found = separate_regions(np.concatenate([right, left]), *SIZE)
    assert found == (Roi(36, 86, 171, 188), Roi(274, 74, 181, 199))


@pytest.mark.parametrize("gap", [2.0, 3.0])
def test_one_sheet_with_missing_lines_has_no_regions(gap):
    left = rectangle_px(8, 6, (20.0, 20.0), (60.0, 60.0))
    every = np.concatenate([left, left + np.array([(5.0 + gap) * 20.0, 0.0])])
    assert separate_regions(every, *SIZE) == ()


def test_a_few_glints_are_no_group():
    sheet = rectangle_px(8, 7, (20.0, 20.0), (60.0, 60.0))
    glints = rectangle_px(2, 4, (20.0, 20.0), (400.0, 200.0))
    assert separate_regions(np.concatenate([sheet, glints]), *SIZE) == ()


def test_regions_that_would_contain_markers_of_both_are_not_named():
    small = rectangle_px(4, 4, (8.0, 8.0), (200.0, 200.0))
    ring = rectangle_px(11, 11, (30.0, 30.0), (60.0, 60.0))
    around = ring[np.abs(ring - 210.0).max(axis=1) > 130.0]
    assert separate_regions(np.concatenate([small, around]), *SIZE) == ()
