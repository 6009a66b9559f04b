"""Standard deviations against errors, where the right answer is known by hand."""

import numpy as np
import pytest

from manytouch.evaluation.metrics.uncertainty_calibration import uncertainty_calibration


def test_right_deviations_are_calibrated() -> None:
    chance = np.random.default_rng(2)
    std = chance.uniform(0.1, 2.0, 20000)
    found = uncertainty_calibration(std * chance.standard_normal(20000), std)
    assert found is not None
    assert found.chi2_per_dof == pytest.approx(1, abs=0.05)
    assert found.spread == pytest.approx(1, abs=0.03)
    assert found.coverage_68 == pytest.approx(0.68, abs=0.015)
    assert found.coverage_95 == pytest.approx(0.95, abs=0.01)
    assert found.coverage == pytest.approx(found.levels, abs=0.02)
    assert found.observed == pytest.approx(found.predicted, rel=0.1)


def test_deviations_of_half_the_error_are_overconfident() -> None:
    error = np.random.default_rng(3).standard_normal(20000)
    found = uncertainty_calibration(error, np.full(20000, 0.5))
    assert found is not None
    assert found.chi2_per_dof == pytest.approx(4, rel=0.05)
    assert found.spread == pytest.approx(2, rel=0.05)
    assert found.coverage_68 == pytest.approx(0.38, abs=0.02)  # P(|z| < 0.497)
    assert found.coverage_95 == pytest.approx(0.673, abs=0.02)  # P(|z| < 0.98)


def test_deviations_that_are_not_given_or_zero_do_not_count() -> None:
    std = np.ones(100)
    std[:10], std[10:20] = np.nan, 0.0
    found = uncertainty_calibration(np.ones(100), std)
    assert found is not None
    assert found.count == 80
    assert found.given == pytest.approx(0.8)
    assert uncertainty_calibration(np.ones(19), np.ones(19)) is None
    assert uncertainty_calibration(np.ones(100), np.full(100, np.nan)) is None
