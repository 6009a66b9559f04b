"""Positions of fingers from the swelling of dots, without knowledge of camera and sheet."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.uncalibrated.marker_spacing import marker_spacing
from manytouch.estimation.uncalibrated.swelling import SwellingModel
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.simulation.demo_sensor import demo_sensor

SENSOR = demo_sensor()
assert SENSOR.layout is not None
LAYOUT = SENSOR.layout
REST_MM = LAYOUT.rest_mm[:, :2]
PITCH_MM = 4.0
MODEL = SwellingModel()
SWELLING = MODEL(LAYOUT, REST_MM, 3.0)
SPACING = marker_spacing(REST_MM, np.zeros(2), nearest_neighbours(REST_MM))


def bump(at_mm: tuple[float, float], radius_mm: float) -> np.ndarray:
    return np.exp(-0.5 * ((REST_MM - at_mm) ** 2).sum(axis=1) / radius_mm**2)


def peak_mm(swelling: np.ndarray) -> np.ndarray:
    load = SWELLING.load_map.load_on_grid(SWELLING.load_map.coefficients(swelling))
    row, column = np.unravel_index(np.argmax(load), load.shape)
    return np.array([SWELLING.load_map.x_mm[column], SWELLING.load_map.y_mm[row]])


@pytest.mark.parametrize("place_mm", [(40.0, 0.0), (-30.0, 20.0), (24.0, -24.0)])
def test_a_press_far_from_the_axis_is_found_at_its_position(place_mm: tuple[float, float]) -> None:
    area, across = SPACING(0.06 * bump(place_mm, 7.0)[:, None] * REST_MM)
    drawn_mm = np.linalg.norm(REST_MM[np.argmax(area)] - place_mm)
    assert drawn_mm > PITCH_MM  # where areas alone would put it
    swelling = MODEL.swelling(area, area, across)
    found = MODEL.fit_centres(SWELLING, peak_mm(swelling)[None], swelling)[0]
    assert np.linalg.norm(found - place_mm) < 0.5 * PITCH_MM


def test_a_squeezed_gel_is_found_where_it_spreads_from() -> None:
    at_mm = np.array([-22.0, 13.0])
    offset = REST_MM - at_mm
    area, across = SPACING(1.5 * PITCH_MM * offset / ((offset**2).sum(axis=1, keepdims=True) + 15.0**2))
    light = 0.3 * bump((30.0, -10.0), 7.0)  # a reflection elsewhere
    found = peak_mm(MODEL.swelling(area + light, area, across))
    assert np.linalg.norm(found - at_mm) < 0.6 * PITCH_MM


def test_a_free_sheet_is_found_by_the_light_under_the_finger() -> None:
    """A sheet that is drawn in from outside of the view shrinks at the border for every press."""
    shift = -0.12 * REST_MM * np.abs(REST_MM / [60.0, 40.0]) ** 3
    area, across = SPACING(shift)
    at_mm = np.array([34.0, 10.0])
    dark = peak_mm(MODEL.swelling(area + 0.1 * bump((34.0, 10.0), 6.0), area, across))
    assert np.linalg.norm(dark - at_mm) < PITCH_MM
    assert np.linalg.norm(peak_mm(MODEL.swelling(None, area, across)) - at_mm) > 4.0 * PITCH_MM


def test_a_fit_finds_both_of_two_fingers_on_a_slope() -> None:
    first, second = (-6.3, 4.1), (16.2, -3.7)
    bumps = 0.12 * bump(first, 6.4) + 0.07 * bump(second, 6.4)
    swelling = bumps + 0.05 + 0.0006 * REST_MM[:, 0]
    initial = np.array([(first[0] + 2.5, first[1] - 1.5), (second[0] - 2.0, second[1] + 2.0)])
    fitted = MODEL.fit_centres(SWELLING, initial, swelling)
    np.testing.assert_allclose(fitted, [first, second], atol=0.5)


def test_a_fit_near_the_border_is_not_drawn_inward() -> None:
    at_mm = (float(REST_MM[:, 0].max()) - 1.0, 0.0)
    fitted = MODEL.fit_centres(SWELLING, np.array([(at_mm[0] - 4.0, 0.0)]), 0.1 * bump(at_mm, 6.4))
    assert np.linalg.norm(fitted[0] - at_mm) < 1.0


def test_a_fit_stays_near() -> None:
    initial = np.array([[-30.0, 0.0]])
    fitted = MODEL.fit_centres(SWELLING, initial, 0.2 * bump((-20.0, 0.0), 6.4))
    assert np.linalg.norm(fitted - initial) == pytest.approx(MODEL.farthest * PITCH_MM)


def test_the_inverse_covariance_is_that_of_background_and_noise() -> None:
    background = SWELLING.background / SWELLING.weight[:, None]
    covariance = background @ background.T + np.diag(1.0 / SWELLING.weight)
    rows = np.random.default_rng(1).normal(size=(3, len(REST_MM)))
    np.testing.assert_allclose(SWELLING.apply_inverse_covariance(rows) @ covariance, rows, atol=1e-6)


def test_predicted_noise_of_the_map_is_the_observed_one() -> None:
    random = np.random.default_rng(3)
    at_mm = np.array([[0.0, 0.0], [58.0, 38.0]])
    noise = random.normal(0.0, 0.02, (400, len(REST_MM)))
    loads = np.array(
        [SWELLING.load_map.load_at(at_mm, SWELLING.load_map.coefficients(each)) for each in noise]
    )
    np.testing.assert_allclose(loads.std(axis=0), SWELLING.load_map.load_std(at_mm, 0.02**2), rtol=0.15)


def test_the_load_at_a_point_is_that_of_the_map() -> None:
    coefficients = SWELLING.load_map.coefficients(0.1 * bump((-48.0, 28.0), 6.0))
    point_mm = np.array([[SWELLING.load_map.x_mm[7], SWELLING.load_map.y_mm[3]]])
    assert SWELLING.load_map.load_at(point_mm, coefficients)[0] == pytest.approx(
        SWELLING.load_map.load_on_grid(coefficients)[3, 7], rel=1e-4
    )


def test_a_dot_that_is_half_of_its_size_at_rest_has_little_effect() -> None:
    """A half-printed dot swells with the light; a sensor file states one radius for all dots."""
    area = np.zeros(len(REST_MM))
    dot = int(np.argmin(np.linalg.norm(REST_MM - [40.0, 20.0], axis=1)))
    area[dot] = 0.4
    radius_px = np.full(len(REST_MM), 17.0)
    radius_px[dot] *= 0.5
    radius_px[:3] = np.nan
    load = []
    for layout in (LAYOUT, replace(LAYOUT, rest_radius_px=radius_px)):
        load_map = MODEL(layout, REST_MM, 3.0).load_map
        load.append(float(load_map.load_on_grid(load_map.coefficients(area)).max()))
    assert load[1] < 0.1 * load[0]
    unseen = MODEL(replace(LAYOUT, rest_radius_px=np.full(len(REST_MM), np.nan)), REST_MM, 3.0)
    np.testing.assert_array_equal(unseen.load_map.estimate, SWELLING.load_map.estimate)
