"""Candidates are the rendered dots, at every size, in grey and in colour."""

import numpy as np
import pytest

from manytouch.detection.candidates import allocate_dog_buffers, find_candidates
from manytouch.simulation.render.discs import Look, render_discs


@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("radius_px", [2.5, 5.0, 8.0, 11.0])
def test_each_dot_is_a_candidate_once(radius_px: float, colours: int) -> None:
    x, y = np.meshgrid(np.arange(40.0, 300.0, 52.0), np.arange(40.0, 180.0, 52.0))
    centre_px = np.stack([x.ravel(), y.ravel()], axis=1) + 0.3
    shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
    look = Look(ground=45.0, dot=205.0, read_noise=2.0)
    image = render_discs(centre_px, shape_px, width_px=320, height_px=200, look=look, seed=1)
    given = image if colours == 1 else np.repeat(image[:, :, None], 3, axis=2)
    weights = np.ones(1) if colours == 1 else np.array([0.2, 0.5, 0.3])
    buffers = allocate_dog_buffers(given, radius_px)
    for _ in range(2):  # the second time with used memory
        found = find_candidates(given, weights, radius_px, 30.0, buffers)
        distance = np.linalg.norm(found.place_px[:, None] - centre_px[None], axis=2)
        assert len(found.place_px) == len(centre_px)
        assert distance.min(axis=0).max() < 0.35 * radius_px
        assert np.median(found.contrast) == pytest.approx(160.0, rel=0.25)
