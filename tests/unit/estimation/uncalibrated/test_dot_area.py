"""Changes of dot areas."""

import numpy as np
import pytest

from layouts import grid_at
from manytouch.estimation.uncalibrated.dot_area import DotAreaChange
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.values import TrackedGrid

ROWS, COLUMNS = 5, 7
PLANE_MM = np.stack(np.meshgrid(np.arange(COLUMNS) * 4.0, np.arange(ROWS) * 4.0), axis=-1).reshape(-1, 2)
NEIGHBOURS = nearest_neighbours(PLANE_MM)


def grid(area_px2: np.ndarray | None, variance_px2: float = 1e-4) -> TrackedGrid:
    unseen = None if area_px2 is None else ~np.isfinite(area_px2)
    return grid_at(10.0 * PLANE_MM, std_px=np.sqrt(variance_px2), unseen=unseen, area_px2=area_px2)


def test_growth_is_the_change_of_the_logarithm() -> None:
    rest = np.log(np.linspace(100.0, 200.0, len(PLANE_MM)))
    growth = DotAreaChange()(grid(np.exp(rest + 0.07)), rest, NEIGHBOURS)
    np.testing.assert_allclose(growth, 0.07)


def test_the_change_is_limited() -> None:
    rest = np.zeros(len(PLANE_MM))
    growth = DotAreaChange(limit=0.4)(grid(np.full(len(PLANE_MM), np.exp(-2.0))), rest, NEIGHBOURS)
    np.testing.assert_allclose(growth, -0.4)


def test_an_unseen_dot_gets_the_mean_of_its_neighbours() -> None:
    area = np.full(len(PLANE_MM), 100.0 * np.exp(0.1))
    area[17] = np.nan
    growth = DotAreaChange()(grid(area), np.full(len(PLANE_MM), np.log(100.0)), NEIGHBOURS)
    np.testing.assert_allclose(growth, 0.1)


def test_a_frame_without_areas_has_no_change() -> None:
    assert DotAreaChange()(grid(None), np.zeros(len(PLANE_MM)), NEIGHBOURS) is None
    assert DotAreaChange().std(grid(None)) is None


def test_the_standard_deviation_is_that_of_a_noisy_outline() -> None:
    rng = np.random.default_rng(1)
    radius, angle = 9.0, np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    outline = radius + rng.normal(0.0, 0.2, (4000, 60))
    area = 0.5 * (outline**2).mean(axis=1) * 2.0 * np.pi
    centre_x = 2.0 * np.pi * (outline**3 * np.cos(angle)).mean(axis=1) / 3.0 / area
    seen = grid(np.full(len(PLANE_MM), np.pi * radius**2), variance_px2=float(centre_x.var()))
    assert DotAreaChange().std(seen) == pytest.approx(np.log(area).std(), rel=0.05)


def test_rest_is_the_mean_of_the_first_frames_and_then_drifts_slowly() -> None:
    change = DotAreaChange(drift=0.01)
    rest = np.full(len(PLANE_MM), np.nan)
    for frame, area in enumerate((100.0, 121.0)):
        rest = change.updated_rest(grid(np.full(len(PLANE_MM), area)), rest, frame)
    np.testing.assert_allclose(rest, np.log(110.0))
    later = change.updated_rest(grid(np.full(len(PLANE_MM), 220.0)), rest, 5000)
    np.testing.assert_allclose(later - rest, 0.01 * np.log(2.0))


def test_a_dot_that_is_hidden_keeps_its_rest() -> None:
    area = np.full(len(PLANE_MM), 100.0)
    area[3] = np.nan
    rest = DotAreaChange().updated_rest(grid(area), np.full(len(PLANE_MM), np.log(80.0)), 3)
    assert rest[3] == pytest.approx(np.log(80.0))
    assert rest[4] > np.log(80.0)
