"""Footprints of clusters with known moments: ellipse, unknown axes, rigid faces."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.regions.footprints import Ellipse, Footprints
from manytouch.values import ContactShape

PITCH_MM = 4.0
FIND = Footprints()


def rotated(half_mm: tuple[float, float], angle_rad: float) -> np.ndarray:
    """Second moments of the uniform ellipse with these half axes."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[c, -s], [s, c]])
    return turn @ np.diag(0.25 * np.square(half_mm)) @ turn.T


def cluster(
    moment_mm2: np.ndarray, *, std_mm2: float = 0.1, probability: list[float] | None = None
) -> Clusters:
    covariance = np.diag([0.0, 0.0, 0.0, *3 * [std_mm2**2]])
    return Clusters(
        centre_mm=np.array([[3.0, -2.0]]),
        force_mm2=np.array([[0.0, 0.0, -1.0]]),
        torque_mm3=np.zeros(1),
        spread_mm2=moment_mm2[None],
        covariance=covariance[None],
        sheet_covariance=np.zeros((1, 6, 6)),
        label=np.zeros(4, dtype=np.int64),
        is_face=np.zeros(1, dtype=np.bool_),
        corner_points_mm=(np.zeros((0, 2)),),
        shape_probability=np.array([[0.0, 0.0, 1.0, 0.0] if probability is None else probability]),
        fitted_mm2=np.full(4, np.nan),
        is_one_as_before=np.zeros(1, dtype=np.bool_),
    )


@pytest.mark.parametrize("angle_rad", [-1.2, 0.0, 0.7, np.pi / 2])
def test_the_ellipse_of_a_patch(angle_rad: float) -> None:
    found = FIND(cluster(rotated((8.0, 5.0), angle_rad)), 0, PITCH_MM)
    assert (found.half_major_mm, found.half_minor_mm) == pytest.approx((8.0, 5.0))
    assert found.orientation_rad == pytest.approx(angle_rad)
    assert (found.shape, found.shape_probability) == (ContactShape.PATCH, 1.0)
    (ring,) = found.outline
    np.testing.assert_allclose(ring.point_mm.mean(axis=0), [3.0, -2.0], atol=0.05)
    away = ring.point_mm - np.array([3.0, -2.0])
    far = away[np.linalg.norm(away, axis=1).argmax()]
    across = np.array([-np.sin(angle_rad), np.cos(angle_rad)])
    assert abs(far @ across) < 0.15 * np.linalg.norm(far)


def test_what_is_not_determined_is_unknown() -> None:
    found = FIND(cluster(rotated((3.0, 0.5), 0.3), std_mm2=1.0), 0, PITCH_MM)
    assert found.half_major_mm == pytest.approx(3.0)
    assert np.isnan(found.half_minor_mm)
    round_ = FIND(cluster(rotated((5.0, 4.9), 0.3), std_mm2=1.0), 0, PITCH_MM)
    assert np.isnan(round_.orientation_rad)


def test_a_point_has_the_area_of_the_smoothing_and_doubt_adds_to_its_deviation() -> None:
    sure = FIND(cluster(rotated((5.0, 5.0), 0.0), probability=[1.0, 0.0, 0.0, 0.0]), 0, PITCH_MM)
    unsure = FIND(cluster(rotated((5.0, 5.0), 0.0), probability=[0.6, 0.0, 0.4, 0.0]), 0, PITCH_MM)
    assert sure.area_mm2 == unsure.area_mm2 == pytest.approx(75.3, rel=0.03)
    assert unsure.area_std_mm2 > sure.area_std_mm2 + 20.0
    assert (unsure.shape, unsure.shape_probability) == (ContactShape.POINT, 0.6)


@pytest.mark.parametrize(
    ("half_mm", "probability"), [(0.5, [1.0, 0.0, 0.0, 0.0]), (4.0, [0.0, 0.0, 1.0, 0.0])]
)
def test_the_deviation_of_the_area_covers_that_of_a_rigid_face(
    half_mm: float, probability: list[float]
) -> None:
    found = FIND(
        cluster(rotated((half_mm, half_mm), 0.0), std_mm2=1e-6, probability=probability), 0, PITCH_MM
    )
    face_mm2 = np.pi * half_mm**2
    assert found.area_mm2 - face_mm2 > 20.0
    assert found.area_std_mm2 == pytest.approx(np.sqrt(0.5) * (found.area_mm2 - face_mm2), rel=1e-3)


def test_without_a_fit_the_shape_is_unknown_and_the_area_uncertain() -> None:
    unfitted = replace(
        cluster(rotated((8.0, 5.0), 0.0)),
        covariance=np.full((1, 6, 6), np.nan),
        shape_probability=np.full((1, 4), np.nan),
    )
    found = FIND(unfitted, 0, PITCH_MM)
    assert found.shape is None
    assert 0.1 < found.area_std_mm2 / found.area_mm2 < 0.6


def test_a_rigid_face_has_the_hull_of_where_it_bears() -> None:
    corner_mm = np.array([[-7.0, -12.0], [13.0, -12.0], [13.0, 8.0], [-7.0, 8.0]])
    face = replace(
        cluster(np.diag([100.0, 100.0])),
        covariance=np.full((1, 6, 6), np.nan),
        is_face=np.ones(1, dtype=np.bool_),
        corner_points_mm=(np.concatenate([corner_mm, [[3.0, -2.0]]]),),
    )
    found = FIND(face, 0, PITCH_MM)
    assert found.area_mm2 == pytest.approx(400.0)
    assert found.half_major_mm == pytest.approx(20.0)  # of pressure on the corners only
    assert found.shape is ContactShape.PATCH
    assert len(found.outline[0].point_mm) == 4
    bar = replace(face, spread_mm2=np.diag([100.0, 0.1])[None])
    found = FIND(bar, 0, PITCH_MM)
    assert found.shape is ContactShape.LINE
    assert found.shape_probability > 0.9
    assert 2.0 * 17.3 * 6.0 < found.area_mm2 < 2.0 * 17.3 * 15.0


def test_the_angle_of_an_ellipse_is_half_open() -> None:
    angles = [
        Ellipse.of(rotated((5.0, 2.0), angle), np.zeros((3, 3))).angle_rad for angle in (-1.57, 1.57, 3.0)
    ]
    assert all(-np.pi / 2 < angle <= np.pi / 2 for angle in angles)
