"""Regions and second moments of pressures whose values are known."""

import numpy as np
import pytest

from manytouch.simulation.scene.deformation import TrueContact, contact_from_row, row_from_contact
from manytouch.simulation.scene.pressure_region import region_area, second_moments

LINE = (np.arange(160) + 0.5) / 160 * 2 - 1
GRID = np.stack(np.meshgrid(LINE, LINE, indexing="ij"), axis=-1).reshape(-1, 2)
DISC = GRID[(GRID**2).sum(axis=1) < 1.0]


def test_the_region_of_a_point_is_the_disc_of_95_percent_of_its_smoothing() -> None:
    std_mm = 0.5 * 4.0
    area_mm2 = region_area(np.array([[3.0, -2.0]]), np.array([0.7]), 4.0)
    assert area_mm2 == pytest.approx(-2 * np.log(0.05) * np.pi * std_mm**2, rel=0.02)


def test_the_region_of_a_wide_even_pressure_is_nearly_where_it_presses() -> None:
    area_mm2 = region_area(20.0 * DISC, np.ones(len(DISC)), 1.0)
    assert area_mm2 == pytest.approx(0.95 * np.pi * 400.0, rel=0.02)


def test_the_hole_of_a_ring_is_not_in_its_region() -> None:
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    ring_mm = 15.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    band = 2 * 1.96 * 1.0  # 95 % of a line whose smoothing has a deviation of 1 mm
    assert region_area(ring_mm, np.ones(400), 2.0) == pytest.approx(2 * np.pi * 15.0 * band, rel=0.03)


def test_without_force_nothing_is_known() -> None:
    assert np.isnan(region_area(DISC, np.zeros(len(DISC)), 2.0))
    assert np.isnan(second_moments(DISC, np.zeros(len(DISC)))).all()


def test_half_axes_of_an_even_ellipse_are_its_own() -> None:
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    place_mm = (DISC * [6.0, 2.5]) @ turn.T + [10.0, -3.0]
    contact = TrueContact(
        force_N=np.array([0.0, 0.0, -1.0]),
        torque_Nmm=0.0,
        area_mm2=1.0,
        centre_mm=np.zeros(2),
        depth_mm=1.0,
        region_mm2=50.0,
        moment_mm2=second_moments(place_mm, np.ones(len(DISC))),
    )
    assert contact.ellipse == pytest.approx((6.0, 2.5, 0.4), rel=5e-3)
    again = contact_from_row(np.array(row_from_contact(contact)))
    assert again.moment_mm2 == contact.moment_mm2
    assert again.region_mm2 == 50.0
    earlier = contact_from_row(np.array(row_from_contact(contact)[:8]))  # from a file without regions
    assert np.isnan([earlier.region_mm2, *earlier.moment_mm2, *earlier.ellipse]).all()
