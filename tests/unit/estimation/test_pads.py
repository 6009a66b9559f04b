"""Pads: where fingers press when nothing is known of camera and sheet."""

import numpy as np
import pytest

from manytouch.estimation.uncalibrated.spacing import spacing
from manytouch.estimation.uncalibrated.swelling import SwellingModel
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.simulation.demo_sensor import demo_sensor

SENSOR = demo_sensor()
assert SENSOR.layout is not None
LAYOUT = SENSOR.layout
REST_MM = LAYOUT.rest_mm[:, :2]
PITCH_MM = 4.0
MODEL = SwellingModel()
PADS = MODEL(LAYOUT, REST_MM, 3.0)
SPACING = spacing(REST_MM, np.zeros(2), nearest_neighbours(REST_MM))


def bell(at_mm: tuple[float, float], radius_mm: float) -> np.ndarray:
    return np.exp(-0.5 * ((REST_MM - at_mm) ** 2).sum(axis=1) / radius_mm**2)


def highest(swelling: np.ndarray) -> np.ndarray:
    load = PADS.chart.load(PADS.chart.modes(swelling))
    row, column = np.unravel_index(np.argmax(load), load.shape)
    return np.array([PADS.chart.x_mm[column], PADS.chart.y_mm[row]])


@pytest.mark.parametrize("place_mm", [(40.0, 0.0), (-30.0, 20.0), (24.0, -24.0)])
def test_a_sheet_that_comes_nearer_far_from_the_axis_is_found_there(place_mm: tuple[float, float]) -> None:
    area, across = SPACING(0.06 * bell(place_mm, 7.0)[:, None] * REST_MM)
    drawn_mm = np.linalg.norm(REST_MM[np.argmax(area)] - place_mm)
    assert drawn_mm > PITCH_MM  # where areas alone would put it
    swelling = MODEL.swelling(area, area, across)
    found = MODEL.fitted(PADS, highest(swelling)[None], swelling)[0]
    assert np.linalg.norm(found - place_mm) < 0.5 * PITCH_MM


def test_a_gel_that_is_squeezed_is_found_where_it_spreads_from() -> None:
    at_mm = np.array([-22.0, 13.0])
    away = REST_MM - at_mm
    area, across = SPACING(1.5 * PITCH_MM * away / ((away**2).sum(axis=1, keepdims=True) + 15.0**2))
    light = 0.3 * bell((30.0, -10.0), 7.0)  # a reflection elsewhere
    found = highest(MODEL.swelling(area + light, area, across))
    assert np.linalg.norm(found - at_mm) < 0.6 * PITCH_MM


def test_where_a_sheet_hangs_the_light_under_the_finger_counts() -> None:
    """A sheet that is drawn in from beyond the view shrinks at the border wherever one presses."""
    shift = -0.12 * REST_MM * np.abs(REST_MM / [60.0, 40.0]) ** 3
    area, across = SPACING(shift)
    at_mm = np.array([34.0, 10.0])
    dark = highest(MODEL.swelling(area + 0.1 * bell((34.0, 10.0), 6.0), area, across))
    assert np.linalg.norm(dark - at_mm) < PITCH_MM
    assert np.linalg.norm(highest(MODEL.swelling(None, area, across)) - at_mm) > 4.0 * PITCH_MM


def test_a_fit_finds_both_of_two_pads_on_a_slope() -> None:
    first, second = (-6.3, 4.1), (16.2, -3.7)
    hills = 0.12 * bell(first, 6.4) + 0.07 * bell(second, 6.4)
    swelling = hills + 0.05 + 0.0006 * REST_MM[:, 0]
    begun = np.array([(first[0] + 2.5, first[1] - 1.5), (second[0] - 2.0, second[1] + 2.0)])
    fitted = MODEL.fitted(PADS, begun, swelling)
    np.testing.assert_allclose(fitted, [first, second], atol=0.5)


def test_a_fit_near_the_border_is_not_drawn_inward() -> None:
    at_mm = (float(REST_MM[:, 0].max()) - 1.0, 0.0)
    fitted = MODEL.fitted(PADS, np.array([(at_mm[0] - 4.0, 0.0)]), 0.1 * bell(at_mm, 6.4))
    assert np.linalg.norm(fitted[0] - at_mm) < 1.0


def test_a_fit_stays_near() -> None:
    begun = np.array([[-30.0, 0.0]])
    fitted = MODEL.fitted(PADS, begun, 0.2 * bell((-20.0, 0.0), 6.4))
    assert np.linalg.norm(fitted - begun) == pytest.approx(MODEL.farthest * PITCH_MM)


def test_what_is_weighed_is_the_inverse_of_the_whole_covariance() -> None:
    behind = PADS.behind / PADS.weight[:, None]
    covariance = behind @ behind.T + np.diag(1.0 / PADS.weight)
    rows = np.random.default_rng(1).normal(size=(3, len(REST_MM)))
    np.testing.assert_allclose(PADS.weighed(rows) @ covariance, rows, atol=1e-6)


def test_predicted_noise_of_the_map_is_the_observed_one() -> None:
    chance = np.random.default_rng(3)
    at_mm = np.array([[0.0, 0.0], [58.0, 38.0]])
    noise = chance.normal(0.0, 0.02, (400, len(REST_MM)))
    loads = np.array([PADS.chart.load_at(at_mm, PADS.chart.modes(each)) for each in noise])
    np.testing.assert_allclose(loads.std(axis=0), PADS.chart.load_std(at_mm, 0.02**2), rtol=0.15)


def test_the_map_at_a_point_is_that_of_the_picture() -> None:
    modes = PADS.chart.modes(0.1 * bell((-48.0, 28.0), 6.0))
    point_mm = np.array([[PADS.chart.x_mm[7], PADS.chart.y_mm[3]]])
    assert PADS.chart.load_at(point_mm, modes)[0] == pytest.approx(PADS.chart.load(modes)[3, 7], rel=1e-4)
