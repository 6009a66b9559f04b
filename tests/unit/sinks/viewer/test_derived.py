"""The load on the whole sheet, and where markers support a map."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.viewer.derived import marker_support, total_load
from manytouch.sinks.viewer.update_encoder import viewer_grid
from viewer_session import reading_of


def contact_at(x_mm, y_mm, force_N, torque_Nmm=0.0, std_N=0.1):
    (contact,) = reading_of(0).contacts.contacts
    covariance = np.zeros((8, 8))
    covariance[5, 5] = std_N**2
    return replace(
        contact,
        centre_mm=np.array([x_mm, y_mm]),
        force_N=np.array(force_N),
        torque_Nmm=torque_Nmm,
        covariance=covariance,
    )


def test_forces_add_up_and_a_couple_is_a_torque() -> None:
    couple = [
        contact_at(10.0, 0.0, [0.0, 2.0, -1.0], 3.0, 0.3),
        contact_at(-10.0, 0.0, [0.0, -2.0, -4.0], std_N=0.4),
    ]
    assert total_load(couple) == {
        "normal_N": 5.0,
        "normal_std_N": pytest.approx(0.5),
        "shear_N": [0.0, 0.0],
        "torque_Nmm": pytest.approx(2 * 20.0 + 3.0),
    }


def test_no_force_is_not_zero_force() -> None:
    assert total_load([]) is None
    assert total_load([contact_at(0.0, 0.0, [np.nan] * 3)]) is None


def test_a_map_is_supported_around_single_lost_markers_but_not_in_holes() -> None:
    layout = demo_sensor(320).layout
    assert layout is not None
    grid = viewer_grid(layout)
    supported = marker_support(layout, grid)
    is_seen = np.ones(600, dtype=np.bool_)
    assert supported(is_seen).all()
    is_seen[[100, 315, 407]] = False
    assert supported(is_seen).all()
    is_seen[[314, 315, 316, 344, 345, 346]] = False
    hole = ~supported(is_seen)
    x_mm, y_mm = np.meshgrid(grid.x_mm, grid.y_mm)
    away_mm = np.hypot(x_mm - layout.rest_mm[315, 0], y_mm - layout.rest_mm[315, 1] - 2.0)
    assert hole.any()
    assert away_mm[hole].max() < 6.0
    is_seen[:30] = False
    assert not supported(is_seen)[0].any()  # the rim
    assert not supported(np.zeros(600, dtype=np.bool_)).any()
