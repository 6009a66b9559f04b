"""The deflection of a clamped sheet."""

import numpy as np
import pytest

from manytouch.design.deflection import deflection_curve


def test_ten_newtons_press_the_papers_sheet_one_centimetre_at_about_three_megapascals():
    curve = deflection_curve(size_mm=(120.0, 80.0), thickness_mm=3.0, poisson=0.45, deepest_mm=10.1)
    young = 10.0 / curve.force_over_E_at(10.1)
    assert 2.8 < young < 3.5
    assert curve.depth_at(10.0 / young) == pytest.approx(10.1)
    assert np.all(np.diff(curve.depth_mm) > 0)
    assert np.all(np.diff(curve.strain) > 0)
    # extrapolated linearly in logarithms
    u, v = np.log(curve.force_over_E_mm2), np.log(curve.depth_mm)
    slope = (v[-1] - v[-2]) / (u[-1] - u[-2])
    assert np.log(curve.depth_at(3.0 * curve.force_over_E_mm2[-1])) == pytest.approx(
        v[-1] + slope * np.log(3.0)
    )
    # a deep press grows with the cube root of the force, as a membrane does
    assert curve.depth_at(8.0 * curve.force_over_E_mm2[-1]) / curve.depth_mm[-1] == pytest.approx(
        2.0, rel=0.35
    )
